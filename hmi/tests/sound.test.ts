import { expect, test, vi } from 'vitest';
import { loudness } from '../src/lib/shift/loudness';

test('the first beep is quiet, and none is louder than the most', () => {
  const beeps = [0, 1, 2, 3, 4, 100].map(loudness);
  expect(beeps[0]).toBeLessThan(0.05);
  expect(Math.max(...beeps)).toBeCloseTo(0.2);
  expect(beeps).toEqual([...beeps].sort((a, b) => a - b));
});

test('an alarm that comes when all was seen is quiet at first again', async () => {
  const loud: number[] = [];
  const sink = { connect: () => sink, start: () => {}, stop: () => {}, frequency: { value: 0 } };
  const gain = { setValueAtTime: () => {}, linearRampToValueAtTime: (to: number) => to && loud.push(to) };
  vi.stubGlobal(
    'AudioContext',
    class {
      state = 'running';
      currentTime = 0;
      resume = (): Promise<void> => Promise.resolve();
      createOscillator = (): object => sink;
      createGain = (): object => ({ gain, connect: () => sink });
    },
  );
  vi.useFakeTimers();
  const { link } = await import('../src/lib/link.svelte');
  const { sound } = await import('../src/lib/shift/sound.svelte');
  const alarm = { active: true, severity: 'STOP', acknowledged_by: '' };
  sound.set(true);
  await vi.advanceTimersByTimeAsync(10);
  for (const rows of [[alarm], [], [alarm]]) {
    link.tags = { alarms: rows as never };
    await vi.advanceTimersByTimeAsync(6000);
  }
  // Switched on, three beeps, silence, three beeps.
  const rise = [0, 1, 2].map(loudness);
  expect(loud).toEqual([loudness(0), ...rise, ...rise]);
  sound.set(false);
  vi.useRealTimers();
});
