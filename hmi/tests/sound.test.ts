import { expect, test } from 'vitest';
import { loudness } from '../src/lib/shift/loudness';

test('the first beep is quiet, and none is louder than the most', () => {
  const beeps = [0, 1, 2, 3, 4, 100].map(loudness);
  expect(beeps[0]).toBeLessThan(0.05);
  expect(Math.max(...beeps)).toBeCloseTo(0.2);
  expect(beeps).toEqual([...beeps].sort((a, b) => a - b));
});
