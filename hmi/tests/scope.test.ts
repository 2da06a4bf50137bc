import { expect, test } from 'vitest';
import { Acquisition, type Setting } from '../src/lib/scope/acquisition';
import { identifiers, marksOf, telegrams } from '../src/lib/scope/buslog';
import { fromFile, toFile, type Capture } from '../src/lib/scope/capture';
import { panelOf } from '../src/lib/scope/look';
import { ALARM, Trigger, type Slope } from '../src/lib/scope/trigger';

function fired(values: (number | null)[], slope: Slope, level = 1, source = 'x'): number[] {
  const trigger = new Trigger({ source, level, slope });
  return values.flatMap((value, i) => (trigger.fires(value) ? [i] : []));
}

test('it fires at the first sample at or beyond the level', () => {
  const values = [0, 0.5, 1, 2, 0.5, -1, 3];
  expect(fired(values, 'rising')).toEqual([2, 6]);
  expect(fired(values, 'falling')).toEqual([4]);
  expect(fired(values, 'either')).toEqual([2, 4, 6]);
});

test('what begins beyond the level, and what comes after a gap, fires nothing', () => {
  expect(fired([2, 3, 4], 'rising')).toEqual([]);
  expect(fired([0, null, 2, 3], 'rising')).toEqual([]);
  expect(fired([0, 0, 1, 1, 2, 1], 'rising', 0, ALARM)).toEqual([2, 4]);
});

const SETTING: Setting = {
  trigger: { source: 'v', level: 0.5, slope: 'rising' },
  mode: 'normal',
  window_s: 0.1,
  before: 0.25,
};

/** Rows of a scan of 1 ms: a step at row `step`. */
function rows(from: number, count: number, step: number): [number[], Record<string, number[]>] {
  const numbers = Array.from({ length: count }, (_, i) => from + i);
  return [numbers.map((n) => n / 1000), { v: numbers.map((n) => (n >= step ? 1 : 0)) }];
}

test('a picture has its parts before and after the trigger, to the sample, however rows are cut', () => {
  for (const part of [1, 7, 250]) {
    const scope = new Acquisition(SETTING);
    scope.arm(SETTING, 0.05);
    let at: number | null = null;
    for (let n = 0; n < 500 && at === null; n += part) {
      scope.takeRows(...rows(n, part, 203), -Infinity, false);
      at = scope.whole();
    }
    expect(at).toBe(0.203);
    const shown = [{ name: 'v', unit: '', steps: false, labels: [], begin: null }];
    const [channel] = scope.picture(0.203, 0.203 - 0.025, 0.203 + 0.075, shown);
    expect(channel?.x).toHaveLength(101);
    expect([channel?.x[0], channel?.x[25], channel?.x.at(-1)]).toEqual([-0.025, 0, 0.075]);
    expect([channel?.y[24], channel?.y[25]]).toEqual([0, 1]);
  }
});

test('without power frames are judged, but not before it is known that no rows lie between', () => {
  const scope = new Acquisition(SETTING);
  scope.arm(SETTING, 0);
  for (let n = 1; n <= 20; n++) scope.takeFrame(0.05 * n, { v: n >= 10 ? 1 : 0 });
  expect(scope.whole()).toBe(null);
  scope.takeRows([], {}, 1.0, false);
  expect(scope.whole()).toBe(0.5);
});

test('what happens between the last sample before it is armed and the next one fires, once', () => {
  const setting = { ...SETTING, trigger: { source: ALARM, level: 0, slope: 'rising' as const } };
  const scope = new Acquisition(setting);
  scope.takeFrame(1.0, { [ALARM]: 0 });
  scope.arm(setting, 1.0);
  scope.takeFrame(1.5, { [ALARM]: 1 });
  scope.takeRows([], {}, 2.0, false);
  expect(scope.whole()).toBe(1.5);
  scope.takeFrame(2.5, { [ALARM]: 1 });
  scope.arm(setting, 2.5);
  scope.takeRows([], {}, 3.5, false);
  expect(scope.whole()).toBe(null);
});

test('what comes late of before it was armed fires nothing, and a picture that fills is given up', () => {
  const scope = new Acquisition(SETTING);
  scope.arm(SETTING, 2.0);
  for (const [time, v] of [[1.0, 0], [1.9, 1], [2.1, 0], [2.5, 1]] as const) scope.takeFrame(time, { v }); // prettier-ignore
  scope.takeRows([], {}, 2.51, false);
  expect([scope.filling, scope.whole()]).toEqual([true, null]);
  scope.takeRows([], {}, 2.6, false);
  expect(scope.whole()).toBe(2.5);
  scope.takeFrame(2.7, { v: 0 });
  scope.takeFrame(2.8, { v: 1 });
  scope.takeRows([], {}, 2.81, false);
  scope.arm(SETTING, 2.81);
  scope.takeRows([], {}, 3.0, false);
  expect([scope.filling, scope.whole()]).toEqual([false, null]);
});

test('a picture stands around the first of two edges, and none around one of a controller that has gone', () => {
  const scope = new Acquisition(SETTING);
  scope.arm(SETTING, 0);
  const at = (from: number, v: number[]): void =>
    scope.takeRows(
      v.map((_, i) => from + i / 100),
      { v },
      -Infinity,
      false,
    );
  at(1, [0, 1, 0, 1, 0, 0, 0]);
  expect(scope.filling).toBe(true);
  at(1.07, [0, 0, 0]);
  expect(scope.whole()).toBe(1.01);
  at(1.2, [0, 1, 1]);
  expect(scope.filling).toBe(true);
  at(0.1, [0, 0, 0]); // its time begins anew
  expect([scope.filling, scope.whole()]).toEqual([false, null]);
});

test('rows that are missing fire nothing', () => {
  const scope = new Acquisition(SETTING);
  scope.arm(SETTING, 0);
  scope.takeRows(...rows(1, 100, 150), -Infinity, false);
  scope.takeRows(...rows(200, 200, 150), -Infinity, true);
  expect(scope.whole()).toBe(null);
});

test('a file is what was saved, and anything else is none', () => {
  const capture: Capture = {
    title: 'v',
    machine: 'm',
    utc_s: 1795385708,
    channels: [
      {
        name: 'v',
        unit: '',
        steps: true,
        labels: ['a'],
        begin: null,
        periods_s: [1, 1],
        x: [0, 1],
        y: [0, null],
      },
    ],
    marks: [{ x: 0, label: 'CTL-03' }],
  };
  expect(fromFile(toFile(capture))).toEqual(capture);
  const wrong = [{ x: [1, 0] }, { y: [0] }, { name: 5 }, { y: [0, 'x'] }, { labels: [1] }];
  for (const change of wrong) {
    const channels = [{ ...capture.channels[0], ...change }];
    expect(fromFile(JSON.stringify({ format: 'gantryctl scope', version: 1, ...capture, channels }))).toBe(
      null,
    );
  }
  for (const text of ['', '{}', '[]', 'null', '{"format":"gantryctl scope","version":2}'])
    expect(fromFile(text)).toBe(null);
});

test('telegrams of a log are placed by the wall clock, those of a virtual bus from the begin of the picture', () => {
  const log = telegrams('(1795385708.250000) can0 181#37060000\nno line\n(1795385709.0) can0 201#0F00 T\n');
  expect(log.map(({ id }) => id)).toEqual([0x181, 0x201]);
  const capture: Capture = { title: '', machine: '', utc_s: 1795385708, channels: [], marks: [] };
  expect(marksOf(log, identifiers('0x181') ?? new Set(), capture, 0.5)).toEqual([
    { x: 0.75, label: '181#37060000' },
  ]);
  const own = telegrams('(3.000000) vcan 181#\n');
  expect(marksOf(own, new Set(), capture, 0).map(({ x }) => x)).toEqual([0]);
  expect(identifiers('12x')).toBe(null);
});

test('a capture that is laid over another one lies as much later as it was shifted', () => {
  const capture = (y: number[]): Capture => ({
    title: '', machine: 'm', utc_s: null, marks: [],
    channels: [{ name: 'v', unit: '', steps: false, labels: [], begin: null, periods_s: null, x: [0, 1], y }],
  }); // prettier-ignore
  const over = { capture: capture([3, 4]), shift_s: 0.25 };
  const { lines } = panelOf(capture([1, 2]), ['v'], {}, false, 'v', over, [], 'time');
  expect(lines.map(({ name, x, y }) => [name, x, y])).toEqual([
    ['v', [0, 1], [1, 2]],
    ['v (2)', [0.25, 1.25], [3, 4]],
  ]);
});
