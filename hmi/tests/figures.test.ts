import { expect, test } from 'vitest';
import { decimalsOf, moveTime, num, signed, speedText, typed, whole } from '../src/lib/format';
import { History } from '../src/lib/history';

test('a number has a real minus, no minus at zero, and a dash where it is not known', () => {
  expect([num(-1.25, 1), num(-0.004, 2), num(null, 2), num(undefined, 0)]).toEqual([
    '−1.3',
    '0.00',
    '–',
    '–',
  ]);
  expect([signed(0.004, 2), signed(0.006, 2), signed(-3, 0), signed(null, 1)]).toEqual([
    '0.00',
    '+0.01',
    '−3',
    '–',
  ]);
});

test('a torque has two digits whatever the motor: none behind the point of 70 N m, three of 0.064', () => {
  expect([70, 257, 9.6, 0.64, 0.064, 0, null].map(decimalsOf)).toEqual([0, 0, 1, 2, 3, 0, 0]);
});

test('a figure is told with all its digits, at least two', () => {
  expect([whole(0.125, 2), whole(1, 2), whole(-0.0005, 2), whole(12.34567891, 2), whole(null, 2)]).toEqual([
    '0.125',
    '1.00',
    '−0.0005',
    '12.345679',
    '–',
  ]);
});

test('a speed is shown in deg/s and r/min: 6 deg/s are 1 r/min', () => {
  expect(speedText(3, 2)).toBe('3.00 °/s (0.500 r/min)');
  expect(speedText(null, 2)).toBe('– °/s (– r/min)');
});

test.each([
  ['90', 90],
  [' -1,5 ', -1.5],
  ['−0.25', -0.25],
  ['+.5', 0.5],
  ['1,000.5', null],
  ['9o', null],
  ['1e3', null],
  ['', null],
  ['-', null],
  ['5 6', null],
])('%s is the number %s', (text, value) => {
  expect(typed(text)).toBe(value);
});

test('a move takes the time of its trapezoid, or of its triangle where it is short', () => {
  expect(moveTime(90, 6, 0.4)).toBeCloseTo(30, 9); // 90 = 36 / 0.4: the speed is just reached
  expect(moveTime(-120, 6, 0.4)).toBeCloseTo(35, 9);
  expect(moveTime(10, 6, 0.4)).toBeCloseTo(10, 9); // 5 s up, 5 s down
});

test('a strip chart keeps ten minutes, and a gap is a row of nothing', () => {
  const history = new History();
  for (let n = 0; n < 7000; n++) history.add({ time_s: 0.1 * n, pos_act_deg: n }, 0.1 * n);
  expect(history.last(1000).time_s.length).toBeGreaterThanOrEqual(6000);
  expect(history.last(10).pos_act_deg).toHaveLength(101);
  history.gap();
  history.add({ time_s: 705, pos_act_deg: 1 }, 705);
  expect(history.last(5.11).pos_act_deg).toEqual([6999, null, 1]);
  history.add({ time_s: 705, pos_act_deg: 2 }, 705.1); // the same scan again
  expect(history.last(1).pos_act_deg).toEqual([1]);
});
