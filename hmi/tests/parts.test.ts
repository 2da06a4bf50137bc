// What a person is offered and shown before something moves.
import { flushSync, mount, unmount, type Component } from 'svelte';
import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { link } from '../src/lib/link.svelte';
import { halting, keys, motion, move, whyNot } from '../src/lib/rules';
import { sight } from '../src/lib/sight.svelte';
import Commissioning from '../src/parts/Commissioning.svelte';
import Login from '../src/parts/Login.svelte';
import Move from '../src/parts/Move.svelte';
import Shift from '../src/parts/Shift.svelte';
import TooSmall from '../src/parts/TooSmall.svelte';
import Travel from '../src/parts/Travel.svelte';
import TwoStep from '../src/parts/TwoStep.svelte';
import type { Reply, Welcome } from '../src/lib/protocol';
import type { AlarmRow, Tags } from '../src/lib/tables';

let shown: Record<string, unknown> | undefined;
const READY: Partial<Tags> = {
  authority_client: 'c1',
  power: true,
  journal_state: 'ok',
  mode: 'continuous',
  alarms: [],
  speed_setting_deg_s: 3,
  speed_cap_deg_s: 6,
  override_percent: 100,
  brake_test_overdue: false,
};

beforeEach(() => {
  vi.spyOn(sight, 'look').mockImplementation(() => {});
  sight.stop = true;
  link.stale = false;
  link.session = { user: 'anna', person: 'Anna', role: 'service', may: [] };
  link.welcome = {
    client: 'c1',
    place: 'console',
    may: ['jog', 'move', 'power', 'halt', 'brake_test', 'commission', 'set_speed'],
  } as unknown as Welcome;
  link.tags = READY;
});
afterEach(() => {
  if (shown) void unmount(shown);
  shown = undefined;
  document.body.innerHTML = '';
  vi.restoreAllMocks();
});

function show<P extends Record<string, unknown>>(part: Component<P>, props: P): HTMLElement {
  shown = mount(part, { target: document.body, props });
  flushSync();
  return document.body;
}
function tags(more: Partial<Tags>): void {
  link.tags = { ...READY, ...more };
  flushSync();
}

describe('what starts motion', () => {
  test.each([
    [{}, ''],
    [{ power: false }, 'why_power'],
    [{ power: null }, 'why_power'], // not known is not on
    [{ journal_state: 'full' } as unknown as Partial<Tags>, 'why_journal'],
    [{ journal_state: 'slow' } as unknown as Partial<Tags>, ''],
    [{ alarms: [{ severity: 'WARNING' } as AlarmRow] }, ''],
    [{ alarms: [{ severity: 'WARNING' } as AlarmRow, { severity: 'STOP' } as AlarmRow] }, 'why_alarm'],
    [{ authority_client: 'c2' }, 'why_control'],
    [{ authority_client: null }, 'why_control'],
    [{ brake_test_overdue: true }, ''],
    [{ brake_test_overdue: true, speed_cap_deg_s: 1 }, 'why_overdue'],
    [{ brake_test_overdue: true, speed_cap_deg_s: 1, enabling_switch: true }, 'why_overdue'],
    [{ alarms: [{ severity: 'STOP', acknowledged_by: 'ben' } as AlarmRow] }, 'why_alarm'],
  ])('with %o is refused by "%s"', (more, why) => {
    tags(more);
    expect(whyNot('move', motion())).toBe(why);
  });

  test('needs fresh data, the right and Stop in sight, in this order', () => {
    expect(whyNot('take_over')).toBe('why_role');
    sight.stop = false;
    expect(whyNot('jog', motion())).toBe('why_no_stop');
    link.welcome = { ...link.welcome, may: [] } as unknown as Welcome;
    expect(whyNot('jog', motion())).toBe('why_role');
    link.stale = true;
    expect(whyNot('jog', motion())).toBe('why_stale');
  });

  test('by hand, or from another machine, is capped without the enabling switch whatever the override', () => {
    tags({ speed_cap_deg_s: 1, override_percent: 10 });
    expect(whyNot('jog', keys('continuous'))).toBe('why_cap');
    expect(whyNot('move', move())).toBe('');
    link.welcome = { ...link.welcome, place: 'remote' } as unknown as Welcome;
    expect(whyNot('move', move())).toBe('why_cap');
    tags({ speed_cap_deg_s: 1, enabling_switch: true });
    expect([whyNot('jog', keys('continuous')), whyNot('move', move())]).toEqual(['', '']);
    tags({ speed_cap_deg_s: 3 });
    expect(whyNot('jog', keys('continuous'))).toBe('');
  });

  test('of an axis that knows no slower speed is not told to be slower', () => {
    tags({ speed_cap_deg_s: 1, speed_setting_deg_s: 6, speed_min_deg_s: 6 });
    expect(whyNot('jog', keys('continuous'))).toBe('why_cap_always');
    tags({ speed_cap_deg_s: 1, speed_setting_deg_s: 6, speed_min_deg_s: 0.6 });
    expect(whyNot('jog', keys('continuous'))).toBe('why_cap');
  });

  test('is not ended by Halt once an alarm stops it, and not called at rest then', () => {
    tags({ axis_state: 'error_stop', at_rest: true });
    expect(whyNot('halt', halting())).toBe('why_alarm');
    tags({ axis_state: 'standstill', at_rest: true });
    expect(whyNot('halt', halting())).toBe('why_at_rest');
    tags({ axis_state: 'discrete_motion', at_rest: false });
    expect(whyNot('halt', halting())).toBe('');
  });

  test('by hand is that of the mode in force', () => {
    expect(whyNot('jog', keys('incremental'))).toBe('why_incremental');
    tags({ mode: 'incremental' });
    expect(whyNot('jog', keys('continuous'))).toBe('why_continuous');
    expect(whyNot('jog', keys('incremental'))).toBe('');
  });
});

describe('a move', () => {
  const AT: Partial<Tags> = {
    axis_kind: 'linear',
    pos_ref_deg: 10,
    pos_min_deg: -180,
    pos_max_deg: 180,
    reach_min_deg: -180,
    reach_max_deg: 180,
    acc_setting_deg_s2: 0.4,
    speed_setting_deg_s: 6,
    override_percent: 50,
  };
  function type(text: string): void {
    const field = document.querySelector('input')!;
    field.value = text;
    field.dispatchEvent(new Event('input', { bubbles: true }));
    flushSync();
  }
  const preview = (): string[] =>
    [...document.querySelectorAll('dd')].map((each) => each.textContent?.trim() ?? '');

  test('is shown before it begins: from, to, way, speed with override, time', () => {
    tags(AT);
    show(Move, { why: '' as const });
    type('-80');
    // 90 deg at 3 deg/s: 30 s and 3 / 0.4 = 7.5 s for both ramps.
    expect(preview()).toEqual(['10.00°', '−80.00°', '−90.00°', '3.00 °/s (0.500 r/min)', '37.5 s']);
    type('-175');
    expect(preview()[2]).toMatch(/^−185\.00° \S/);
  });

  test('that nobody has typed goes nowhere, also where another angle reads like this one', () => {
    const wide = { pos_min_deg: -270, pos_max_deg: 270, reach_min_deg: -270, reach_max_deg: 270 };
    const ends = { mechanical_stop_min_deg: -273, mechanical_stop_max_deg: 273 };
    tags({ ...AT, ...wide, ...ends, display: '0..360', pos_ref_deg: -200 });
    show(Move, { why: '' as const });
    expect(document.querySelector('input')?.value).toBe('160.00');
    expect(preview().slice(0, 3)).toEqual(['160.00° (− end)', '160.00° (− end)', '0.00°']);
    // Typed, it is the place that can be typed.
    type('160');
    expect(preview()[1]).toBe('160.00° (+ end)');
    expect(preview()[2]).toMatch(/^360\.00° \S/);
  });

  test('goes to what is typed, and to nothing that is refused, by the Enter key neither', () => {
    tags(AT);
    const sent = vi.spyOn(link, 'send').mockResolvedValue({ ok: true } as Reply);
    show(Move, { why: '' as const });
    const form = document.querySelector('form')!;
    const enter = (): void => void form.dispatchEvent(new Event('submit', { cancelable: true }));
    enter(); // nothing is typed
    type('200');
    enter();
    expect(document.body.textContent).toContain('CTL-09');
    type('9o');
    enter();
    expect(sent).not.toHaveBeenCalled();
    type('-90');
    enter();
    expect(sent.mock.calls).toEqual([['move', { target_deg: -90 }]]);
  });

  test('of a turning axis is sent with its direction', () => {
    tags({ ...AT, axis_kind: 'modulo', reach_min_deg: null, reach_max_deg: null });
    const sent = vi.spyOn(link, 'send').mockResolvedValue({ ok: true } as Reply);
    show(Move, { why: '' as const });
    const choice = document.querySelector('select')!;
    // The model of a browser has no `:checked` of an option.
    vi.spyOn(choice, 'querySelector').mockReturnValue(choice.options[2]!);
    choice.dispatchEvent(new Event('change', { bubbles: true }));
    type('90');
    expect(preview()[2]).toBe('−280.00°');
    document.querySelector('form')!.dispatchEvent(new Event('submit', { cancelable: true }));
    expect(sent.mock.calls).toEqual([['move', { target_deg: 90, direction: 'negative' }]]);
  });
});

test.each([
  [2, 10, 14],
  [-2, 6, 10],
  [0, 10, 10],
])('the way to rest of an axis with %s deg/s is drawn from %s to %s deg', (vel_ref_deg_s, from, to) => {
  const ends = {
    pos_min_deg: -180,
    pos_max_deg: 180,
    mechanical_stop_min_deg: -172,
    mechanical_stop_max_deg: 172,
  };
  tags({ ...ends, pos_act_deg: 10, vel_ref_deg_s, stopping_angle_deg: vel_ref_deg_s === 0 ? 0 : 4 });
  vi.spyOn(HTMLElement.prototype, 'clientWidth', 'get').mockReturnValue(380);
  // 380 wide with 18 at each end: one unit is one degree, 0 in the middle.
  const box = show(Travel, {}).querySelector('.stopway')!;
  expect(Number(box.getAttribute('x'))).toBeCloseTo(from, 6);
  expect(Number(box.getAttribute('width'))).toBeCloseTo(to - from, 6);
});

test('Enter in the field of a move sends nothing that its button withholds', () => {
  const sent = vi.spyOn(link, 'send').mockResolvedValue({ ok: true } as Reply);
  tags({ pos_ref_deg: 10, pos_min_deg: -180, pos_max_deg: 180 });
  const enter = (why: '' | 'why_alarm'): void => {
    if (shown) void unmount(shown);
    show(Move, { why });
    const field = document.querySelector('input')!;
    field.value = '20';
    field.dispatchEvent(new Event('input', { bubbles: true }));
    flushSync();
    document.querySelector('form')!.dispatchEvent(new Event('submit', { cancelable: true }));
  };
  enter('why_alarm');
  expect(sent).not.toHaveBeenCalled();
  enter('');
  expect(sent.mock.calls).toEqual([['move', { target_deg: 20 }]]);
});

test('a window without room tells the angle that is read elsewhere, and that data are stale', () => {
  tags({ axis_kind: 'modulo', pos_min_deg: 0, pos_max_deg: 360, pos_act_deg: 730.5, vel_act_deg_s: 1 });
  expect(show(TooSmall, {}).querySelector('b.live')?.textContent).toBe('10.50°');
  expect(document.querySelector('[data-testid=stale]')).toBeNull();
  link.stale = true;
  flushSync();
  expect(document.querySelector('[data-testid=stale]')).not.toBeNull();
});

test('who has tried too often is told how long to wait', async () => {
  const answer = new Response('', { status: 429, headers: { 'Retry-After': '37' } });
  vi.stubGlobal('fetch', () => Promise.resolve(answer));
  show(Login, {});
  document.querySelector('form')!.dispatchEvent(new Event('submit', { cancelable: true }));
  await vi.waitFor(() =>
    expect(document.querySelector('[role=alert]')?.textContent).toBe('Too many attempts. Try again in 37 s.'),
  );
  vi.unstubAllGlobals();
});

describe('the shift', () => {
  test('is told when a line was done and is not kept', async () => {
    vi.stubGlobal('fetch', () => Promise.resolve(new Response('[]')));
    link.welcome = { client: 'c1', may: ['note'] } as unknown as Welcome;
    const reply = { ok: true, code: 'JRN-03', text: 'it was done, and is not kept', values: {} } as Reply;
    const send = vi.spyOn(link, 'send').mockResolvedValue(reply);
    show(Shift, {});
    const field = document.querySelector('input')!;
    field.value = 'belt greased';
    field.dispatchEvent(new Event('input', { bubbles: true }));
    flushSync();
    document.querySelector('form')!.dispatchEvent(new Event('submit', { cancelable: true }));
    expect(send.mock.calls).toEqual([['note', { line: 'belt greased' }]]);
    await vi.waitFor(() =>
      expect(document.querySelector('[role=alert]')?.textContent).toBe(
        'JRN-03 · it was done, and is not kept',
      ),
    );
    vi.unstubAllGlobals();
  });

  test('shows who is here, and nobody as here without a connection', async () => {
    const people = [{ client: 'c2', user: 'ben', person: 'Ben', role: 'operator', place: 'console' }];
    vi.stubGlobal('fetch', (path: string) =>
      Promise.resolve(new Response(JSON.stringify(path.endsWith('people') ? people : []))),
    );
    show(Shift, {});
    const list = document.querySelector('section:last-of-type ul')!;
    expect(list.textContent).toContain('unknown'); // nothing was heard yet
    await vi.waitFor(() => {
      link.stale = false; // the clock of the page has gone on
      flushSync();
      expect(list.textContent).toContain('ben');
    });
    expect(list.classList).toContain('live');
    link.stale = true;
    flushSync();
    expect([list.textContent?.includes('ben'), list.textContent?.trim()]).toEqual([false, 'unknown']);
    vi.unstubAllGlobals();
  });
});

describe('what is done in two steps', () => {
  function offered(more: Partial<Tags>): boolean[] {
    tags({ armed_action: 'brake_test', armed_left_s: 8, armed_client: 'c1', armed_person: 'Anna', ...more });
    const run = vi.fn();
    if (shown) void unmount(shown);
    show(TwoStep, { action: 'brake_test' as const, label: 'Brake test', more: [], run });
    return [...document.querySelectorAll('button')].map((key) => !key.disabled);
  }

  test('is executed only after it was armed, here, and with control', () => {
    expect(offered({})).toEqual([true, true]);
    expect(offered({ armed_action: null })).toEqual([true, false]);
    expect(offered({ armed_action: 'reset_locked' })).toEqual([true, false]);
    expect(offered({ armed_client: 'c2' })).toEqual([true, false]);
    expect(offered({ authority_client: 'c2' })).toEqual([false, false]);
    link.stale = true;
    expect(offered({})).toEqual([false, false]);
  });

  test('of commissioning is the step that was armed, and no other', () => {
    const keys = (armed_step: string, second_person = false): boolean[] => {
      tags({
        armed_action: 'commission',
        armed_client: 'c1',
        armed_person: 'Ben',
        armed_step,
        second_person,
      });
      if (shown) void unmount(shown);
      const title = (key: string): string => `the ${key}`;
      const step = { key: 'sign', title };
      show(TwoStep, { action: 'commission' as const, label: 'x', step, more: [], run: () => {} });
      return [...document.querySelectorAll('button')].map((key) => !key.disabled);
    };
    const told = (): string => document.querySelector('#commission-why')?.textContent ?? '';
    expect(keys('sign')).toEqual([true, true]);
    expect(told()).toContain('the step the sign.');
    expect(keys('turn')).toEqual([true, false]);
    expect(told()).toContain('the step the turn.');
    expect(told()).toContain('Another step is armed');
    expect([keys('sign', true), keys('turn', true)]).toEqual([
      [true, true],
      [true, false],
    ]);
    const send = vi.spyOn(link, 'send').mockResolvedValue({ ok: true } as Reply);
    document.querySelector('button')?.click();
    expect(send.mock.calls).toEqual([['arm', { action: 'commission', step: 'sign' }]]);
    send.mockRestore();
  });

  test('for two persons is armed by one and executed by another, whatever their screens', () => {
    expect(offered({ second_person: true })).toEqual([true, false]);
    expect(offered({ second_person: true, armed_client: 'c2' })).toEqual([true, false]); // Anna on another screen
    expect(offered({ second_person: true, armed_person: 'Ben', armed_client: 'c2' })).toEqual([true, true]);
    // Who arms needs no control, who executes does.
    expect(offered({ second_person: true, armed_person: 'Ben', authority_client: 'c2' })).toEqual([
      true,
      false,
    ]);
  });
});

describe('a step of commissioning', () => {
  test.each([
    ['torque_hold', 'Torque alone holds the load'],
    ['off', ''],
  ] as const)('in power phase %s tells whether torque alone holds the load', (phase, said) => {
    vi.stubGlobal('fetch', () => Promise.resolve({ ok: false }));
    tags({ commissioning: 'running', commissioning_step: 'velocity', power_phase: phase });
    const at = show(Commissioning, {}).querySelector('[data-testid=commission_holds]');
    expect(at?.textContent ?? '').toContain(said);
    expect(at === null).toBe(said === '');
    vi.unstubAllGlobals();
  });
});
