// One picture of the scope: what was sampled around a moment; and as a file.
import type { Mark } from '../../report/recording';
import type { Values } from './samples';

export interface Channel {
  name: string;
  unit: string;
  /** A flag or state: it keeps its value until the next sample. */
  steps: boolean;
  /** Words of a state by its number. */
  labels: readonly string[];
  /** Where the turn begins that it is read in; null for any other number. */
  begin: number | null;
  /** Time between samples, s: the shortest and the longest that is usual in it; null without two. */
  periods_s: [number, number] | null;
  /** Seconds from the moment. */
  x: number[];
  y: Values;
}
export interface Capture {
  /** What it is of: a tag that fired, a file, a recording; empty for what comes in just now. */
  title: string;
  machine: string;
  /** The moment by the wall clock of the machine, s since 1970; null where it is not known. */
  utc_s: number | null;
  channels: Channel[];
  marks: Pick<Mark, 'x' | 'label'>[];
}

const FORMAT = 'gantryctl scope';
const VERSION = 1;
/** Of a file that is opened. */
export const FILE_MAX_MB = 64;
export const CHANNELS_MAX = 8;
const CHANNELS_READ = 64;

/** Shortest and longest usual time between samples: below and above are 5 % of them. */
export function periods(x: number[]): [number, number] | null {
  if (x.length < 2) return null;
  const apart = x.slice(1).map((time, i) => time - (x[i] ?? time));
  apart.sort((a, b) => a - b);
  const at = (part: number): number => apart[Math.round(part * (apart.length - 1))] ?? 0;
  return [at(0.05), at(0.95)];
}

export function toFile(capture: Capture): string {
  return JSON.stringify({ format: FORMAT, version: VERSION, ...capture });
}

/** The capture of a file; null for any other file. */
export function fromFile(text: string): Capture | null {
  try {
    const found = JSON.parse(text) as Partial<Capture> & { format?: unknown; version?: unknown };
    if (found.format !== FORMAT || found.version !== VERSION) return null;
    const { channels, marks } = found;
    if (!Array.isArray(channels) || channels.length > CHANNELS_READ || !channels.every(isChannel))
      return null;
    return {
      title: text_of(found.title),
      machine: text_of(found.machine),
      utc_s: isNumber(found.utc_s) ? found.utc_s : null,
      channels,
      marks: Array.isArray(marks) ? marks.filter((mark) => isNumber(mark?.x) && isText(mark?.label)) : [],
    };
  } catch {
    return null;
  }
}

function isChannel(found: Partial<Channel> | null): found is Channel {
  if (found === null || typeof found !== 'object') return false;
  const { name, unit, steps, labels, begin, periods_s: apart, x, y } = found;
  return (
    isText(name) &&
    isText(unit) &&
    typeof steps === 'boolean' &&
    Array.isArray(labels) &&
    labels.every(isText) &&
    (begin === null || isNumber(begin)) &&
    (apart === null || (Array.isArray(apart) && apart.length === 2 && apart.every(isNumber))) &&
    Array.isArray(x) &&
    Array.isArray(y) &&
    x.length === y.length &&
    x.every((time, i) => isNumber(time) && !(time < (x[i - 1] ?? -Infinity))) &&
    y.every((value) => value === null || isNumber(value))
  );
}
function isNumber(found: unknown): found is number {
  return typeof found === 'number' && Number.isFinite(found);
}
function isText(found: unknown): found is string {
  return typeof found === 'string' && found.length <= 200;
}
function text_of(found: unknown): string {
  return isText(found) ? found : '';
}
