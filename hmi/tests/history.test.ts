import { describe, expect, test } from 'vitest';
import { csv, History } from '../src/lib/history';

const START_S = 1_800_000_000;

describe('the time of day of a row', () => {
  test('goes by the controller, not by when a frame came in', () => {
    const history = new History();
    for (const [time_s, late_s] of [
      [10, 0.05],
      [10.05, 0.0],
      [10.1, 0.3],
    ] as const)
      history.add({ time_s }, START_S + time_s + late_s);
    const found = history.last(30).clock_s.map((at) => at - START_S);
    for (const [i, at] of [10, 10.05, 10.1].entries()) expect(found[i]).toBeCloseTo(at, 4);
  });

  test('follows a clock that was set, and a controller that has started anew', () => {
    const history = new History();
    history.add({ time_s: 10 }, START_S + 10);
    history.add({ time_s: 11 }, START_S + 3611);
    expect(history.last(30).clock_s.at(-1)).toBeCloseTo(START_S + 3611, 4);
    history.add({ time_s: 1 }, START_S + 3620);
    expect(history.last(30).clock_s).toHaveLength(1);
    expect(history.last(30).clock_s[0]).toBeCloseTo(START_S + 3620, 4);
  });

  test('of the first row of a controller that has started anew is not behind a gap of the one before', () => {
    const history = new History();
    history.add({ time_s: 10, pos_act_deg: 1 }, START_S);
    history.gap();
    history.add({ time_s: 1, pos_act_deg: 2 }, START_S + 5);
    expect(history.last(30)).toMatchObject({ time_s: [1], pos_act_deg: [2] });
  });

  test('stands in the CSV as UTC', () => {
    const history = new History();
    history.add({ time_s: 10, pos_act_deg: -1.5 }, START_S);
    const [names, row] = csv(history.last(30)).split('\n');
    expect(names?.split(',').at(-1)).toBe('utc');
    expect(row?.split(',').at(-1)).toBe(new Date(1000 * START_S).toISOString());
  });
});
