// What the areas show and offer of the tags, word by word.
import { flushSync, type Component } from 'svelte';
import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import Alarms from '../src/areas/Alarms.svelte';
import Diagnosis from '../src/areas/Diagnosis.svelte';
import Display from '../src/areas/Display.svelte';
import Operation from '../src/areas/Operation.svelte';
import Settings from '../src/areas/Settings.svelte';
import { hold } from '../src/lib/hold.svelte';
import { link } from '../src/lib/link.svelte';
import { made, said } from '../src/lib/messages';
import { prefs, t } from '../src/lib/prefs.svelte';
import { sight } from '../src/lib/sight.svelte';
import Bar from '../src/parts/Bar.svelte';
import BrakeTest from '../src/parts/BrakeTest.svelte';
import Dial from '../src/parts/Dial.svelte';
import HoldKey from '../src/parts/HoldKey.svelte';
import Overview from '../src/parts/Overview.svelte';
import Reset from '../src/parts/Reset.svelte';
import SpeedSettings from '../src/parts/SpeedSettings.svelte';
import type { Reply, Welcome } from '../src/lib/protocol';
import type { AlarmRow, Tags } from '../src/lib/tables';
import { key, leave, show } from './mounted';

beforeEach(() => {
  vi.spyOn(sight, 'look').mockImplementation(() => {});
  vi.stubGlobal('fetch', () => Promise.resolve(new Response('[]')));
  sight.stop = true;
  prefs.language = 'en';
  link.stale = false;
  link.session = { user: 'anna', person: 'Anna', role: 'service', may: [] };
  link.welcome = {
    client: 'c1',
    may: ['authority', 'take_over', 'acknowledge', 'reset', 'reset_locked', 'jog', 'brake_test'],
  } as unknown as Welcome;
  link.tags = {};
});
afterEach(() => {
  leave();
  prefs.language = 'en';
  vi.restoreAllMocks();
});

describe('control', () => {
  test.each([
    [{ authority_client: null, authority_user: null }, 'Nobody', 'take', false, { over: false }],
    [{ authority_client: 'c2', authority_user: 'ben', at_rest: true }, 'ben', 'over', false, { over: true }],
    [{ authority_client: 'c2', authority_user: 'ben', at_rest: false }, 'ben', 'over', true, null],
  ] as const)('of %o', (tags, who, label, disabled, sent) => {
    const send = vi.spyOn(link, 'send').mockResolvedValue({ ok: true } as Reply);
    show(Overview, {}, tags as Partial<Tags>);
    const cell = document.querySelector('[data-testid=control]')!;
    expect(cell.querySelector('b')?.textContent?.toLowerCase()).toBe(who.toLowerCase());
    const button = cell.querySelector('button')!;
    expect(button.textContent?.toLowerCase()).toContain(label);
    expect(button.disabled).toBe(disabled);
    button.click();
    expect(send.mock.calls).toEqual(sent === null ? [] : [['take', sent]]);
  });

  test('of mine is given back', () => {
    const send = vi.spyOn(link, 'send').mockResolvedValue({ ok: true } as Reply);
    show(Overview, {}, { authority_client: 'c1', authority_user: 'anna', at_rest: false });
    document.querySelector<HTMLButtonElement>('[data-testid=control] button')!.click();
    expect(send.mock.calls).toEqual([['give', {}]]);
  });

  test('what is unknown of alarms is not none', () => {
    const cell = (): string => document.querySelector('[data-testid=alarm]')?.textContent ?? '';
    show(Overview, {}, {});
    const unknown = cell();
    show(Overview, {}, { alarms: [] });
    expect(cell()).not.toBe(unknown);
  });
});

describe('alarms', () => {
  const row = (id: number, code: string, more: Partial<AlarmRow> = {}): AlarmRow =>
    ({
      id, code, severity: 'STOP', title: `title ${code}`, measured: `measured ${code}`, values: {}, steps: [],
      done: `done ${code}`, to_do: `to do ${code}`, cause: `cause ${code}`, text: '', at: '2026-11-28T10:00:00Z',
      time_s: 1, pos_act_deg: -5, active: true, first_out: false, follows: '', lock: false, acknowledged_by: '', ...more,
    }) as AlarmRow; // prettier-ignore
  const detail = (): string => document.querySelector('.detail')?.textContent ?? '';

  test('the first is shown whole until another is chosen, and that one is acknowledged', () => {
    const send = vi.spyOn(link, 'send').mockResolvedValue({ ok: true } as Reply);
    const [first, second] = [row(7, 'CTL-03', { first_out: true }), row(8, 'BRK-06', { follows: 'CTL-03' })];
    show(Alarms, {}, { alarms: [first, second], alarm_history: [second, first], reset_locked: false });
    for (const part of ['measured', 'cause', 'done', 'to do']) expect(detail()).toContain(`${part} CTL-03`);
    document.querySelectorAll<HTMLButtonElement>('.link')[1]?.click();
    flushSync();
    expect(detail()).toContain('measured BRK-06');
    key('Acknowledge').click();
    expect(send.mock.calls).toEqual([['acknowledge', { id: 8 }]]);
  });

  test('one of the history is shown when it is chosen, though another is active', () => {
    show(Alarms, {}, { alarms: [row(7, 'CTL-03')], alarm_history: [row(3, 'ENC-01', { active: false })] });
    document.querySelectorAll<HTMLButtonElement>('.link')[1]?.click();
    flushSync();
    for (const part of ['measured', 'cause', 'done', 'to do']) expect(detail()).toContain(`${part} ENC-01`);
  });

  test('one that somebody has seen is not seen again, and the angle is that of the alarm', () => {
    show(Alarms, {}, { alarms: [row(7, 'CTL-03', { acknowledged_by: 'ben' })], alarm_history: [] });
    expect(key('Acknowledge').disabled).toBe(true);
    expect(detail()).toContain('ben');
    expect(detail()).toContain('−5.000°');
    show(Alarms, {}, { alarms: [row(7, 'CTL-03', { pos_act_deg: null })], alarm_history: [] });
    expect(detail()).toContain('–°');
  });

  test('a reset that meets something locked takes two steps', () => {
    show(Reset, {}, { reset_locked: false, authority_client: 'c1' });
    expect(document.querySelectorAll('button')).toHaveLength(1);
    show(Reset, {}, { reset_locked: true, authority_client: 'c1' });
    const [arm, go] = document.querySelectorAll('button');
    expect([arm?.disabled, go?.disabled]).toEqual([false, true]);
  });
});

test('what is not known yet is neither at rest, nor free to be switched on, nor on the disk', () => {
  const text = (part: Component, tags: Partial<Tags>): string => show(part, {}, tags).textContent ?? '';
  const stands = { at_rest: true, vel_act_deg_s: 0.0001, speed_min_deg_s: 0.6 };
  expect(text(Display, stands)).toContain('at rest');
  expect(text(Display, { ...stands, vel_act_deg_s: 2.8 })).not.toContain('at rest'); // a quick stop
  expect(text(Display, { ...stands, vel_act_deg_s: null })).not.toContain('at rest');
  expect(text(Display, {})).not.toContain('at rest');
  expect(text(Display, { at_rest: false, time_left_s: 2.5 })).not.toContain('at rest');
  expect(text(Diagnosis, { blocked_by: '' })).toContain('Power can be switched on.');
  expect(text(Diagnosis, { blocked_by: 'CTL-03', blocked_by_messages: [] })).toContain('CTL-03');
  expect(text(Diagnosis, {})).not.toContain('Power can be switched on.');
  const open = (tags: Partial<Tags>): string | null | undefined => {
    show(Diagnosis, {}, tags);
    const title = [...document.querySelectorAll('dt')].find((each) => each.textContent === t('journal_open'));
    return title?.nextElementSibling?.textContent;
  };
  expect(open({ journal_sequence: 12, journal_committed: 9 })).toBe('3');
  expect(open({ journal_sequence: 12 })).toBe('–');
});

test('figures are in the unit that stands beside them', () => {
  const told = (name: string): string | undefined => {
    const title = [...document.querySelectorAll('dt')].find((each) => each.textContent === name);
    return title?.nextElementSibling?.textContent?.replace(/\s+/g, ' ').trim();
  };
  show(Display, {}, {
    eccentric_moment_nm: 12340, eccentric_angle_deg: -40, overload: 0.873, vel_act_deg_s: -3, speed_setting_deg_s: 1.5,
    override_percent: 40, stopping_angle_deg: 3.456, quick_stop_angle_deg: 0.789, torque_act_nm: -60, torque_expected_nm: 52,
    torque_rated_nm: 50, torque_max_nm: 150, pos_err_deg: -0.06, following_error_trip_deg: 0.1, travel_left_minus_deg: 12.3,
    travel_left_plus_deg: 45.6,
  }); // prettier-ignore
  expect(told('Imbalance')).toBe('12.34 kN m hangs at −40°');
  expect(told('Speed')).toBe('−3.000 °/s −0.500 r/min');
  expect(told('Speed setting')).toBe('1.50 °/s 40 %');
  expect(told('Stopping angle now')).toBe('3.46 ° quick stop 0.79°');
  expect(told('Cable left − | +')).toBe('12.3 | 45.6 °');
  expect(document.body.textContent).toMatch(/Motor overload used:\s+87 %/);
  // Torque above its rated value and an error above half of its trip are abnormal, in both directions.
  const bad = (): boolean[] => [...document.querySelectorAll('.bar')].map((each) => each.matches('.bad'));
  expect(bad()).toEqual([true, true]);
  expect(document.body.textContent).toContain('−60.0 N m, expected +52.0');
  expect(document.body.textContent).toContain('−0.0600° of 0.100°');
  show(Display, {}, {
    torque_act_nm: 49, torque_rated_nm: 50, torque_max_nm: 150, pos_err_deg: 0.049, following_error_trip_deg: 0.1,
  }); // prettier-ignore
  expect(bad()).toEqual([false, false]);
});

test('each lamp shows its own tag, and is abnormal in the state that is', () => {
  const lamps = (tags: object): string[] => {
    show(Diagnosis, {}, tags);
    return [...document.querySelectorAll('.lamp.bad span')].map((each) => each.textContent ?? '');
  };
  const sound = {
    estop_ok: true, estop_ok_2: true, collision_ok: true, door_ok: true, motion_permit: true, mains_ready: true,
    limit_minus_ok: true, limit_plus_ok: true, position_valid: true, torque_limited: false, enabling_switch: false,
    brake_open_cmd: false, brake_open: false,
  }; // prettier-ignore
  expect(lamps(sound)).toEqual([]);
  expect(lamps({ ...sound, enabling_switch: true, brake_open: true, brake_open_cmd: true })).toEqual([]);
  for (const [tag, name] of [
    ['estop_ok', 'Emergency-stop chain closed'],
    ['estop_ok_2', 'Emergency-stop chain, channel 2'],
    ['collision_ok', 'No collision'],
    ['door_ok', 'Room door closed'],
    ['motion_permit', 'Motion permitted'],
    ['mains_ready', 'Mains ready'],
    ['limit_minus_ok', 'Limit switch − free'],
    ['limit_plus_ok', 'Limit switch + free'],
    ['position_valid', 'Angle trusted'],
  ] as const)
    expect(lamps({ ...sound, [tag]: false })).toEqual([name]);
  expect(lamps({ ...sound, torque_limited: true })).toEqual(['Torque at its limit']);
  // What the machine does not have has no lamp; what it has and nobody knows is unknown.
  show(Diagnosis, {}, { estop_ok: null });
  const names = [...document.querySelectorAll('.lamp span')].map((each) => each.textContent);
  expect(names).not.toContain('Room door closed');
  expect(names).not.toContain('Motion permitted');
  expect(document.querySelector('.lamp')?.textContent).toContain('unknown');
});

describe('drawings', () => {
  /** Angle, clockwise from the top, and radius of the end of a path. */
  function ends(path: string): number[] {
    const numbers = path.match(/-?\d+\.\d\d/g)!.map(Number);
    const [x, y] = numbers.slice(-2) as [number, number];
    return [(Math.atan2(x, -y) * 180) / Math.PI, Math.hypot(x, y)];
  }
  const AXIS: Partial<Tags> = {
    axis_kind: 'linear', pos_min_deg: -180, pos_max_deg: 180, pos_act_deg: 30, drawing: 'couch',
  }; // prettier-ignore

  test.each([
    [2, 10, 40],
    [-2, 10, 20],
    [0, 10, null],
  ])('the way to rest with %s deg/s is on its side', (vel_ref_deg_s, stopping_angle_deg, to) => {
    show(
      Dial,
      {},
      { ...AXIS, vel_ref_deg_s, stopping_angle_deg: vel_ref_deg_s === 0 ? 0 : stopping_angle_deg },
    );
    const way = document.querySelector('.stopway')?.getAttribute('d');
    if (to === null) return expect(way).toBeUndefined();
    // An arc is drawn from the lower angle to the higher one.
    expect(ends(way!)[0]).toBeCloseTo(Math.max(30, to), 0);
    const [x, y] = way!.match(/-?\d+\.\d\d/g)!.map(Number) as [number, number];
    expect((Math.atan2(x, -y) * 180) / Math.PI).toBeCloseTo(Math.min(30, to), 0);
  });

  test('the centre of gravity hangs down where the axis rests by itself, and turns with it', () => {
    const heavy = (pos_act_deg: number): string | null | undefined => {
      show(Dial, {}, { ...AXIS, pos_act_deg, eccentric_angle_deg: 40 });
      return document.querySelector('.heavy')?.getAttribute('transform');
    };
    expect([heavy(40), heavy(50)]).toEqual(['rotate(180)', 'rotate(190)']);
  });

  test('a target is shown of a move, and of nothing else', () => {
    show(Dial, {}, { ...AXIS, axis_state: 'discrete_motion', target_deg: -60 });
    expect(document.querySelector('.target')?.getAttribute('transform')).toBe('rotate(-60)');
    show(Dial, {}, { ...AXIS, axis_state: 'stopping', target_deg: -60 });
    expect(document.querySelector('.target')).toBeNull();
  });

  test('a bar has its side, its end at the limit, and warns beyond its mark on both sides', () => {
    const bar = (value: number): (string | boolean | null)[] => {
      show(Bar, { label: 'l', value, limit: 50, warn: 20, text: 't' }, {});
      const fill = document.querySelector('.fill')!;
      return [fill.getAttribute('x'), fill.getAttribute('width'), document.querySelector('.bad') !== null];
    };
    expect(bar(10)).toEqual(['0', '20', false]);
    expect(bar(-25)).toEqual(['-50', '50', true]);
    expect(bar(500)).toEqual(['0', '100', true]);
  });
});

describe('a key on the screen', () => {
  test('is held by the main button, Enter and space alone, and let go by each end of it', () => {
    const [press, release] = [
      vi.spyOn(hold, 'press').mockReturnValue(),
      vi.spyOn(hold, 'release').mockReturnValue(),
    ];
    show(HoldKey, { direction: 'reverse' as const, why: '' as const, told: 'x' }, {});
    const button = document.querySelector('button')!;
    button.dispatchEvent(new PointerEvent('pointerdown', { button: 2, bubbles: true }));
    button.dispatchEvent(new KeyboardEvent('keydown', { key: 'a', bubbles: true }));
    button.dispatchEvent(new KeyboardEvent('keydown', { key: ' ', repeat: true, bubbles: true }));
    expect(press).not.toHaveBeenCalled();
    button.dispatchEvent(new KeyboardEvent('keydown', { key: ' ', bubbles: true }));
    button.dispatchEvent(new PointerEvent('pointerdown', { button: 0, bubbles: true }));
    expect(press.mock.calls).toEqual([['reverse'], ['reverse']]);
    button.dispatchEvent(new FocusEvent('blur'));
    expect(release).not.toHaveBeenCalled(); // of a key that is not held
    hold.direction = 'reverse';
    flushSync();
    // The window hears of a pointer too: each end lets go at least once.
    for (const end of [
      new FocusEvent('blur'),
      new PointerEvent('lostpointercapture', { bubbles: true }),
      new PointerEvent('pointerup', { bubbles: true }),
      new PointerEvent('pointercancel', { bubbles: true }),
      new KeyboardEvent('keyup', { key: 'Enter', bubbles: true }),
    ]) {
      release.mockClear();
      button.dispatchEvent(end);
      expect(release).toHaveBeenCalledWith('released');
    }
    hold.direction = null;
  });

  test('that is not offered any more is not held: its button is told nothing then', () => {
    const release = vi.spyOn(hold, 'release').mockReturnValue();
    const props = { direction: 'forward' as const, told: 'x' };
    show(HoldKey, { ...props, why: 'why_journal' as const }, {});
    expect(release).not.toHaveBeenCalled();
    hold.direction = 'reverse'; // the other key
    flushSync();
    expect(release).not.toHaveBeenCalled();
    hold.direction = 'forward';
    flushSync();
    expect(release.mock.calls).toEqual([['withdrawn']]);
    show(HoldKey, { ...props, why: 'why_no_stop' as const }, {});
    expect(release.mock.calls).toEqual([['withdrawn'], ['unseen']]);
    hold.direction = null;
  });

  test('that makes a step tells its whole length', () => {
    const steps = (increment_deg: number | null): string[] => {
      show(Operation, {}, { increment_deg });
      const keys = document.querySelectorAll('.pair')[1]?.querySelectorAll('button') ?? [];
      return [...keys].map((each) => each.textContent?.trim() ?? '');
    };
    expect(steps(0.125)).toEqual(['−0.125°', '+0.125°']);
    expect(steps(0.004)).toEqual(['−0.004°', '+0.004°']);
    expect(steps(1)).toEqual(['−1.00°', '+1.00°']);
    expect(steps(null)).toEqual(['−–°', '+–°']);
  });
});

test('a brake test is offered with power off, and its result keeps the sign of both directions', () => {
  const ready: Partial<Tags> = {
    authority_client: 'c1', brake_test_available: true, power_phase: 'off', journal_state: 'ok',
    brake_test_phase: 'idle', brake_test_result: 'failed', brake_test_plus_nm: 90, brake_test_minus_nm: -88,
    brake_test_text: 'slipped', brake_test_overdue: true, brake_test_cycles_left: 0,
  }; // prettier-ignore
  const armed = (more: Partial<Tags>): boolean | undefined => {
    show(BrakeTest, {}, { ...ready, ...more });
    return document.querySelector('button')?.disabled;
  };
  expect(armed({})).toBe(false);
  expect(document.querySelector('.result')?.textContent).toMatch(/failed/i);
  expect(document.body.textContent).toContain('+90 | −88 N m');
  expect(document.body.textContent).toContain('slipped');
  for (const more of [
    { power_phase: 'on' },
    { brake_test_available: false },
    { brake_test_phase: 'plus_held' },
    { journal_state: 'failed' },
  ])
    expect(armed(more as Partial<Tags>)).toBe(true);
  // A brake that gave way beyond its limit is abnormal, either way; what is within it is not.
  const bad = (brake_test_moved_deg: number): boolean => {
    show(BrakeTest, {}, { ...ready, brake_test_limit_deg: 0.1, brake_test_moved_deg });
    return document.querySelector('.bar.bad') !== null;
  };
  // A dish permits 0.002 deg: what is told is what is permitted, neither 0.00 nor more.
  for (const [limit, said] of [
    [0.002, '0.002'],
    [0.1885, '0.1885'],
    [0.02, '0.02'],
  ] as const) {
    show(BrakeTest, {}, { ...ready, brake_test_level_nm: 5, brake_test_limit_deg: limit });
    expect(document.body.textContent).toContain(`It may move ${said}°.`);
  }
  expect([bad(0.099), bad(0.101), bad(-0.101), bad(-0.099)]).toEqual([false, true, true, false]);
});

test('limits are told in all their digits, each its own, and of an axis without ends that it has none', () => {
  const told = (tags: Partial<Tags>): Record<string, string> => {
    show(Settings, {}, tags);
    const names = [...document.querySelectorAll('.inline dt')];
    return Object.fromEntries(
      names.map((each) => [each.textContent, each.nextElementSibling?.textContent ?? '']),
    );
  };
  const ends = {
    pos_min_deg: -170.25, pos_max_deg: 170.25, over_travel_min_deg: -170.5, over_travel_max_deg: 170.75,
    limit_switch_min_deg: -172, limit_switch_max_deg: 172.125, mechanical_stop_min_deg: -175,
    mechanical_stop_max_deg: 176, no_go_deg: [[10.05, 20.96], [30, 40]] as [number, number][],
  }; // prettier-ignore
  expect(told(ends)).toEqual({
    'Set-point': '−170.25 … 170.25°',
    'No-go sectors': '10.05 … 20.96°, 30.0 … 40.0°',
    'Trip of the measured angle': '−170.5 … 170.75°',
    'Limit switches': '−172.0 … 172.125°',
    'Mechanical stops': '−175.0 … 176.0°',
  });
  const turning = {
    axis_kind: 'modulo',
    pos_min_deg: 0,
    pos_max_deg: 360,
    no_go_deg: [[340, 20]] as [number, number][],
  };
  expect(told(turning)).toEqual({ 'Set-point': 'turns without ends', 'No-go sectors': '340.0 … 20.0°' });
  prefs.language = 'zh';
  expect(told(turning)).toEqual({ 设定值: '无限旋转', 禁入扇区: '340.0 … 20.0°' });
});

describe('a message', () => {
  const refused = { code: 'CTL-09', values: { measured: 200, limit: 180, position: -0.5, left: 90 } };

  test('of the page is in the words of the service, numbers with sign and decimals', () => {
    expect(made(refused)).toContain('200.00');
    expect(made(refused)).toContain('+180.00');
    expect(made(refused)).toContain('-0.50');
  });

  test('is Chinese where the page is, and English where one part of it is not known', () => {
    expect(said([refused], 'english')).toBe('english');
    prefs.language = 'zh';
    expect(said([refused], 'english')).toMatch(/^目标 200\.00° .*\+180\.00°/);
    expect(said([refused, { words: 'NO_SUCH_WORD', values: {} }], 'english')).toBe('english');
    expect(said([{ ...refused, values: {} }], 'english')).toBe('english'); // a long reply comes without them
    expect(said([{ ...refused, values: { ...refused.values, limit: 0 } }], 'english')).toContain('+0.00°');
    expect(said([], 'english')).toBe('english');
    expect(said(null, undefined)).toBe('');
  });

  test('keeps what it has found apart, and says of what holds the axis what to do about it', () => {
    prefs.language = 'zh';
    const stale = [
      { words: 'STALE_FRICTION', values: { measured: 12, limit: 10 } },
      { words: 'STALE_BACKLASH', values: { measured: 0.5, limit: 0.25 } },
    ];
    expect(said([{ code: 'CTL-22', values: { measured: stale } } as never], '')).toMatch(
      /摩擦改变 \+12 N m，限值 10 N m；齿隙至少 0\.5000°/,
    );
    const held = { reason: 'CTL-23', values: { measured: 120, limit: 90 } };
    expect(said([held as never], '')).toMatch(/^CTL-23 · .*120 N m.*90 N m · 查看轴。复位/);
  });
});

test('the imbalance of a table is told in newton metres, and that of a gantry in thousands', () => {
  const told = (eccentric_moment_nm: number | null): string | undefined => {
    show(Display, {}, { eccentric_moment_nm, eccentric_angle_deg: 0 });
    const title = [...document.querySelectorAll('dt')].find((each) => each.textContent === 'Imbalance');
    return title?.nextElementSibling?.textContent?.replace(/\s+/g, ' ').trim();
  };
  expect(told(6.25)).toBe('6.3 N m hangs at 0°');
  expect(told(0.041)).toBe('0.041 N m hangs at 0°');
  expect(told(999)).toBe('999 N m hangs at 0°');
  expect(told(1000)).toBe('1.00 kN m hangs at 0°');
  expect(told(25580)).toBe('25.58 kN m hangs at 0°');
  expect(told(null)).toBe('– kN m learned by motion both ways');
});

test('a slow axis is told two digits of its slowest speed, wherever a speed stands', () => {
  const YAW: Partial<Tags> = {
    vel_act_deg_s: 0.0483, speed_min_deg_s: 0.048, speed_max_deg_s: 0.48, speed_setting_deg_s: 0.0512, at_rest: true,
  }; // prettier-ignore
  const told = (part: Component, tags: Partial<Tags>): string =>
    show(part, {}, tags).textContent?.replace(/\s+/g, ' ') ?? '';
  expect(told(Overview, YAW)).toContain('0.048 °/s');
  expect(told(Display, YAW)).toContain('0.051 °/s');
  expect(told(SpeedSettings, YAW)).toContain('0.0085 r/min (0.051 °/s)');
  const gantry = {
    ...YAW,
    vel_act_deg_s: 5.987,
    speed_min_deg_s: 0.6,
    speed_max_deg_s: 6,
    speed_setting_deg_s: 6,
  };
  expect(told(Overview, gantry)).toContain('5.99 °/s');
  expect(told(SpeedSettings, gantry)).toContain('1.000 r/min (6.000 °/s)');
});

test('the words of both ends of a spiral lie beside each other and not over each other', () => {
  show(Dial, {}, { axis_kind: 'linear', pos_act_deg: 0, pos_min_deg: -360, pos_max_deg: 360 });
  const at = (word: string): number => {
    const found = [...document.querySelectorAll('text')].find((each) => each.textContent === word);
    return Number(found?.getAttribute('x'));
  };
  // Five letters of 10 units are some 27 wide, and centred.
  expect(Math.abs(at('+360') - at('−360'))).toBeGreaterThan(30);
});
