// Keys of the operation area and of commissioning: whom each is offered, and what it sends.
import { flushSync, type Component } from 'svelte';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import Operation from '../src/areas/Operation.svelte';
import { hold } from '../src/lib/hold.svelte';
import { link } from '../src/lib/link.svelte';
import { prefs } from '../src/lib/prefs.svelte';
import { sound } from '../src/lib/shift/sound.svelte';
import { sight } from '../src/lib/sight.svelte';
import Commissioning from '../src/parts/Commissioning.svelte';
import Foot from '../src/parts/Foot.svelte';
import HoldKey from '../src/parts/HoldKey.svelte';
import TwoStep from '../src/parts/TwoStep.svelte';
import type { Reply, Welcome } from '../src/lib/protocol';
import type { AlarmRow, Tags } from '../src/lib/tables';
import { key, leave, show as mounted } from './mounted';

const DONE = { ok: true, code: '', text: '', values: {} } as Reply;
const READY: Partial<Tags> = {
  authority_client: 'c1',
  at_rest: true,
  power: true,
  power_phase: 'on',
  journal_state: 'ok',
  mode: 'incremental',
  alarms: [],
  blocked_by: '',
  speed_setting_deg_s: 3,
  speed_cap_deg_s: 6,
  increment_deg: 2,
  brake_test_overdue: false,
};

beforeEach(() => {
  vi.spyOn(sight, 'look').mockImplementation(() => {});
  sight.stop = true;
  link.stale = false;
  link.note = null;
  link.session = { user: 'anna', person: 'Anna', role: 'service', may: [] };
  link.welcome = {
    client: 'c1',
    place: 'console',
    may: ['jog', 'move', 'power', 'mode', 'halt', 'brake_test', 'commission', 'stop'],
  } as unknown as Welcome;
});
afterEach(() => {
  leave();
  vi.unstubAllGlobals();
  vi.restoreAllMocks();
});

function show<P extends Record<string, unknown>>(part: Component<P>, props: P, more: Partial<Tags>): void {
  mounted(part, props, { ...READY, ...more });
}

test('power is switched off by everybody who may, with control or without, in every state', () => {
  const send = vi.spyOn(link, 'send').mockResolvedValue(DONE);
  for (const more of [
    {},
    { authority_client: 'c2' },
    { authority_client: 'c2', at_rest: false, journal_state: 'failed' as const },
  ]) {
    show(Operation, {}, more);
    expect(key('Power off').disabled).toBe(false);
    key('Power off').click();
  }
  expect(send.mock.calls).toEqual(Array(3).fill(['power', { on: false }]));
  sight.stop = false; // it starts nothing
  show(Operation, {}, {});
  expect([key('Power off').disabled, key('Power on').disabled]).toEqual([false, true]);
});

test('power is switched on with control, when it is off and nothing stands against it', () => {
  const offered = (more: Partial<Tags>): boolean => {
    show(Operation, {}, { power: false, power_phase: 'off', ...more });
    return !key('Power on').disabled;
  };
  expect(offered({})).toBe(true);
  expect(offered({ power: true })).toBe(false);
  expect(offered({ blocked_by: 'ENC-10' })).toBe(false);
  expect(offered({ power_phase: 'testing' })).toBe(false);
  expect(offered({ authority_client: 'c2' })).toBe(false);
});

test('each step key moves its own way, at rest alone', () => {
  const send = vi.spyOn(link, 'send').mockResolvedValue(DONE);
  show(Operation, {}, {});
  key('−2.00°').click();
  key('+2.00°').click();
  expect(send.mock.calls).toEqual([
    ['increment', { direction: 'reverse' }],
    ['increment', { direction: 'forward' }],
  ]);
  show(Operation, {}, { at_rest: false });
  expect([key('−2.00°').disabled, key('+2.00°').disabled]).toEqual([true, true]);
});

test('a mode is chosen at rest, the one that stands on the key', () => {
  const send = vi.spyOn(link, 'send').mockResolvedValue(DONE);
  show(Operation, {}, { mode: 'continuous' });
  for (const name of ['none', 'continuous', 'incremental']) key(name).click();
  expect(send.mock.calls.map(([, keys]) => keys)).toEqual([
    { mode: 'none' },
    { mode: 'continuous' },
    { mode: 'incremental' },
  ]);
  expect(key('continuous').getAttribute('aria-pressed')).toBe('true');
  expect(key('incremental').getAttribute('aria-pressed')).toBe('false');
  show(Operation, {}, { at_rest: false });
  expect(key('continuous').disabled).toBe(true);
});

test('a held key shows its lease, and the other one none; its arrow turns as the axis does', () => {
  hold.direction = 'forward';
  const key = (direction: 'forward' | 'reverse'): [string | null | undefined, string | null | undefined] => {
    show(HoldKey, { direction, why: '' as const, told: 'x' }, { lease_left_ms: 125 });
    const arrow = document.querySelector('.turn path')?.getAttribute('d');
    // The sweep of an arc is 1 where it goes clockwise, the way of positive angles.
    return [document.querySelector('.left')?.getAttribute('width'), /a18 18 0 1 (\d)/.exec(arrow!)?.[1]];
  };
  expect(key('forward')).toEqual(['50', '1']); // 125 of 250 ms
  expect(key('reverse')).toEqual(['0', '0']);
  hold.direction = null;
});

test('what is armed is executed only where its other conditions hold, too', () => {
  const armed = { armed_action: 'brake_test' as const, armed_client: 'c1', armed_left_s: 4 };
  const offered = (fails: boolean): boolean[] => {
    const more: [boolean, 'why_power_off_first'][] = [[fails, 'why_power_off_first']];
    show(TwoStep, { action: 'brake_test' as const, label: 'x', more, run: () => {} }, armed);
    return [...document.querySelectorAll('button')].map((each) => !each.disabled);
  };
  expect(offered(false)).toEqual([true, true]);
  expect(offered(true)).toEqual([false, false]);
});

test('the alarm sound is wanted while anything but information is active and not seen by anybody', () => {
  const wanted = (...rows: Partial<AlarmRow>[]): boolean => {
    link.tags = {
      alarms: rows.map((each) => ({ active: true, severity: 'STOP', acknowledged_by: '', ...each })),
    } as Partial<Tags>;
    return sound.wanted;
  };
  expect([wanted(), wanted({}), wanted({ severity: 'WARNING' }), wanted({ severity: 'INFO' })]).toEqual([
    false,
    true,
    true,
    false,
  ]);
  expect([wanted({ acknowledged_by: 'ben' }), wanted({ active: false })]).toEqual([false, false]);
  expect(wanted({ acknowledged_by: 'ben' }, { severity: 'WARNING' })).toBe(true);
  expect(wanted({}, { acknowledged_by: 'ben' })).toBe(true);
});

test.each([
  [{ ok: true, code: '', text: '' }, 'Done.'],
  [{ ok: true, code: 'JRN-03', text: 'it was done, and is not kept' }, 'JRN-03 it was done, and is not kept'],
  [{ ok: false, code: 'SEC-07', text: 'ben has control' }, 'Refused SEC-07 ben has control'],
  [{ ok: false, code: '', text: 'silent' }, 'Refused  No answer from the controller.'],
  [{ ok: false, code: '', text: 'off' }, 'Refused  No connection: the command was not sent.'],
])('the foot tells of %o what became of it', (note, said) => {
  link.note = { values: {}, ...note };
  show(Foot, {}, {});
  const told = document.querySelector('[data-testid=note]')?.textContent?.replace(/\n\s*/g, ' ').trim();
  expect(told?.replace(/\s+/g, ' ')).toContain(said.replace(/\s+/g, ' '));
  expect(document.querySelector('.bad') === null).toBe(note.ok && note.code === '');
});

test('a step that moves takes two steps, also again; the one that was chosen is run', async () => {
  const step = (name: string, moves: string, outcome: string): object => ({
    key: name, title: name, does: `does ${name}`, moves, outcome, offered: true, proof: '', to_do: '', at: '', by: '',
  }); // prettier-ignore
  const steps = [step('pdo', '', 'passed'), step('sign', '0.05°', 'passed'), step('loop', '1°', '')];
  const board = { complete: false, note: '', open: [], steps };
  vi.stubGlobal('fetch', () => Promise.resolve(new Response(JSON.stringify(board))));
  Element.prototype.scrollIntoView = () => {};
  const send = vi.spyOn(link, 'send').mockResolvedValue(DONE);
  const armed = {
    armed_action: 'commission' as const, armed_step: 'sign', armed_client: 'c1', armed_left_s: 5,
  }; // prettier-ignore
  show(Commissioning, {}, { commissioning: 'waiting', commissioning_results: 1, ...armed });
  await vi.waitFor(() => expect(document.querySelector('.nextstep')).not.toBeNull());
  const next = (): string | null | undefined =>
    document.querySelector('.nextstep')?.getAttribute('data-step');
  expect(next()).toBe('loop');
  expect(document.querySelector('.nextstep')?.textContent).toContain('Could move: 1°.');
  expect(document.querySelectorAll('.nextstep button')).toHaveLength(2);
  const click = (keys: string, nth: number): void => {
    link.stale = false; // the clock of the page has gone on
    flushSync();
    document.querySelectorAll<HTMLButtonElement>(`${keys} button`)[nth]?.click();
    flushSync();
  };
  link.stale = false;
  flushSync();
  // Somebody has armed another step than the one that is shown: it is named, and nothing runs.
  expect(document.querySelector('#commission-why')?.textContent).toContain('the step sign.');
  expect(document.querySelectorAll<HTMLButtonElement>('.nextstep button')[1]?.disabled).toBe(true);
  expect(document.querySelector('tr[data-key=loop] button')).toBeNull();
  click('tr[data-key=sign]', 0);
  await vi.waitFor(() => expect(next()).toBe('sign'));
  expect(document.querySelector('tr[data-key=loop] button')?.textContent).toBe('Choose');
  expect(document.querySelectorAll('.nextstep button')).toHaveLength(2);
  click('.nextstep', 1);
  expect(send.mock.calls).toEqual([['commission_step', { step: 'sign' }]]);
  expect(next()).toBe('loop');
  click('tr[data-key=pdo]', 0);
  await vi.waitFor(() => expect(next()).toBe('pdo'));
  expect(document.querySelectorAll('.nextstep button')).toHaveLength(1);
  expect(document.querySelector('.nextstep')?.textContent).toContain('Nothing moves in it.');
});

test.each([
  ['silence', 'the axis may sag by less than 0.2 deg when the brake closes', '轴可能下沉不到 0.2°'],
  ['brake', 'less than 0.19 deg', '不到 0.19°'],
  ['sign', 'at most 0.05 deg, or 25 deg of the motor where that is more', '最多 0.05°，或电机 25°'],
])('who reads Chinese is told of %s how far this machine could move', async (name, moves, said) => {
  const step = {
    key: name,
    title: name,
    does: name,
    moves,
    outcome: '',
    offered: true,
    proof: '',
    to_do: '',
  };
  const board = { complete: false, note: '', open: [], steps: [{ ...step, at: '', by: '' }] };
  vi.stubGlobal('fetch', () => Promise.resolve(new Response(JSON.stringify(board))));
  prefs.language = 'zh';
  show(Commissioning, {}, { commissioning: 'waiting', commissioning_results: 1 });
  await vi.waitFor(() => expect(document.querySelector('.nextstep')).not.toBeNull());
  expect(document.querySelector('.nextstep')?.textContent).toContain(said);
  prefs.language = 'en';
});

test('a key that is held where it moves nothing any more says so, and the other one does not', () => {
  const told = (direction: 'forward' | 'reverse' | null, more: Partial<Tags> = {}): string | undefined => {
    hold.direction = direction;
    show(Operation, {}, {
      mode: 'continuous', pos_ref_deg: 99.872, vel_ref_deg_s: 0, reach_min_deg: -219.5, reach_max_deg: 99.872232,
      ...more,
    }); // prettier-ignore
    const text = document.querySelector('#jog-why')?.textContent?.trim();
    hold.direction = null;
    return text;
  };
  expect(told('forward')).toBe('It goes no further: 99.87° is the end of travel, or before a no-go sector.');
  expect(told('reverse')).not.toContain('no further');
  expect(told(null)).not.toContain('no further');
  expect(told('forward', { vel_ref_deg_s: 0.3 })).not.toContain('no further');
  expect(told('forward', { pos_ref_deg: 98 })).not.toContain('no further');
  expect(told('reverse', { pos_ref_deg: -219.5 })).toContain('−219.50° is the end');
});
