/** Loudness of the first beep and of those from the fourth on. */
export const FIRST = 0.03;
const MOST = 0.2;
const BEEPS_TO_MOST = 4;

/** Loudness of a beep: nobody is startled by the first one. */
export function loudness(count: number): number {
  return FIRST + (MOST - FIRST) * Math.min(1, count / (BEEPS_TO_MOST - 1));
}
