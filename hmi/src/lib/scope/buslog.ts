// A log of the bus as `candump -l` and gantryctl write it: `(1795385708.661480) can0 181#37060000`.
import type { Capture } from './capture';

export interface Telegram {
  time_s: number;
  id: number;
  data: string;
}
const LINE = /^\((\d+\.\d+)\) (\S+) ([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#([0-9A-Fa-f]*)(?: [RT])?$/;
/** Two minutes of a bus with 16 telegrams every 10 ms. */
export const TELEGRAMS_MAX = 200_000;

/** The telegrams of a log, at most `TELEGRAMS_MAX`; empty for any other text. */
export function telegrams(text: string): Telegram[] {
  const found: Telegram[] = [];
  for (const line of text.split('\n')) {
    const match = LINE.exec(line.trimEnd());
    if (match === null) continue;
    const [, time, , id, data] = match;
    found.push({ time_s: Number(time), id: parseInt(id ?? '', 16), data: data ?? '' });
    if (found.length === TELEGRAMS_MAX) break;
  }
  return found;
}

/** Identifiers that a person asks for, `181, 201`; null for any other text, empty for all. */
export function identifiers(text: string): Set<number> | null {
  const parts = text.split(/[\s,;]+/).filter(Boolean);
  if (!parts.every((part) => /^(0x)?[0-9a-f]{1,8}$/i.test(part))) return null;
  return new Set(parts.map((part) => parseInt(part, 16)));
}

/** Marks in a picture for its telegrams; a log whose clock begins at 0 (a virtual bus) begins with the picture. */
export function marksOf(
  log: Telegram[],
  wanted: Set<number>,
  capture: Capture,
  shift_s: number,
): Capture['marks'] {
  const [first] = log;
  if (first === undefined) return [];
  const start = Math.min(...capture.channels.flatMap(({ x }) => x.slice(0, 1)), 0);
  const zero = capture.utc_s !== null && first.time_s > 1e9 ? capture.utc_s : first.time_s - start;
  return log
    .filter(({ id }) => wanted.size === 0 || wanted.has(id))
    .map(({ time_s, id, data }) => ({
      x: time_s - zero + shift_s,
      label: `${id.toString(16).toUpperCase().padStart(3, '0')}#${data}`,
    }));
}
