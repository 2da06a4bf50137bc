// From samples to pictures: what a scope keeps, when it fires, and what it shows then.
import { periods, type Channel } from './capture';
import { Samples, type Values } from './samples';
import { Trigger, type TriggerSetting } from './trigger';

export const MODES = ['auto', 'normal', 'single'] as const;
export type Mode = (typeof MODES)[number];

export interface Shown {
  name: string;
  unit: string;
  steps: boolean;
  labels: readonly string[];
  begin: number | null;
}
export interface Setting {
  trigger: TriggerSetting;
  mode: Mode;
  /** Length of a picture. */
  window_s: number;
  /** Part of it before the trigger, 0..1. */
  before: number;
}

/** A frame stands for itself only where no row is as near: power is off. */
const NEAR_S = 0.1;
/** Without a trigger for so long, `auto` shows what comes. */
const AUTO_S = 1;
const KEPT_MORE_S = 5;
/** Times are told with six decimals; sums of them are not that exact. */
const ROUND_S = 1e-7;

export class Acquisition {
  /** Of every scan. */
  readonly rows = new Samples();
  /** Of the status frames. */
  readonly frames = new Samples();
  #setting: Setting;
  #trigger: Trigger;
  #known = -Infinity;
  /** Samples up to here were judged. */
  #judged = -Infinity;
  #fired: number | null = null;
  #shown = -Infinity;

  constructor(setting: Setting) {
    this.#setting = setting;
    this.#trigger = new Trigger(setting.trigger);
  }

  /** Everything up to here is known; rows of the scan come in parts, later than frames. */
  get now(): number {
    return this.#known;
  }

  /** It has fired, and waits for the end of its picture. */
  get filling(): boolean {
    return this.#fired !== null;
  }

  /** Wait for a trigger after the time `since`; samples before it are shown, and the last of them is what the first
   * one after it is compared with: an alarm in the half second to the next frame fires. */
  arm(setting: Setting, since: number): void {
    this.#setting = setting;
    this.#trigger = new Trigger(setting.trigger);
    this.#judged = this.#shown = Math.max(since, this.now);
    this.#fired = null;
    this.#trigger.fires(this.#merged(setting.trigger.source, -Infinity, this.#judged)[1].at(-1) ?? null);
  }

  /** Rows of the scan, all that there were up to `known`; `gap`: some before them are missing. */
  takeRows(times: number[], columns: Record<string, Values>, known: number, gap: boolean): void {
    if ((times[0] ?? Infinity) <= this.rows.newest) this.#restart();
    if (gap) this.#trigger.gap();
    this.rows.add(times, columns);
    this.#known = Math.max(this.#known, known, this.rows.newest);
    this.#judge();
    this.#forget();
  }

  /** The values of one status frame; they are judged when the rows beside it are known. */
  takeFrame(time: number, values: Record<string, number | null>): void {
    if (time === this.frames.newest) return;
    if (time < this.frames.newest) this.#restart();
    this.frames.add([time], Object.fromEntries(Object.entries(values).map(([tag, value]) => [tag, [value]])));
  }

  /** Time of the trigger whose picture is whole now; null while there is none. It is given once. */
  whole(): number | null {
    const at = this.#fired;
    const { window_s, before } = this.#setting;
    if (at === null || this.now < at + (1 - before) * window_s - ROUND_S) return null;
    this.#fired = null;
    this.#shown = this.now;
    return at;
  }

  /** Whether what comes in just now is to be shown. */
  get free(): boolean {
    return (
      this.#setting.mode === 'auto' &&
      !this.filling &&
      this.now - this.#shown > this.#setting.window_s + AUTO_S
    );
  }

  /** The channels around a moment. */
  picture(at: number, from: number, to: number, shown: readonly Shown[]): Channel[] {
    const shared = new Map<string, number[]>();
    return shown.map((each) => {
      const [times, y] = this.#merged(each.name, from - ROUND_S, to + ROUND_S);
      // Channels of the same samples share their places: the chart joins them at once.
      const key = `${times.length} ${times[0]} ${times.at(-1)}`;
      const x = shared.get(key) ?? times.map((time) => Number((time - at).toFixed(6)));
      shared.set(key, x);
      return { ...each, periods_s: periods(x), x, y };
    });
  }

  #judge(): void {
    const { source } = this.#setting.trigger;
    const [times, values] = this.#merged(source, this.#judged, this.#known);
    times.forEach((time, i) => {
      if (time <= this.#judged) return;
      this.#judged = time;
      if (this.#trigger.fires(values[i] ?? null)) this.#fired ??= time;
    });
  }

  /** Rows of the scan where there are some, frames where there are none. */
  #merged(tag: string, from: number, to: number): [number[], Values] {
    const [times, values] = this.frames.part(tag, from, to);
    if (!this.rows.has(tag)) return [times, values];
    const [rowTimes, rowValues] = this.rows.part(tag, from, to);
    if (rowTimes.length === 0) return [times, values];
    const alone: [number, number | null][] = [];
    let next = 0;
    times.forEach((time, i) => {
      while (next < rowTimes.length && (rowTimes[next] ?? 0) <= time) next++;
      const before = next > 0 ? (rowTimes[next - 1] ?? 0) : -Infinity;
      const after = next < rowTimes.length ? (rowTimes[next] ?? 0) : Infinity;
      if (time - before > NEAR_S && after - time > NEAR_S) alone.push([time, values[i] ?? null]);
    });
    if (alone.length === 0) return [rowTimes, rowValues];
    const all = [
      ...alone,
      ...rowTimes.map((time, i) => [time, rowValues[i] ?? null] as [number, number | null]),
    ];
    all.sort((a, b) => a[0] - b[0]);
    return [all.map(([time]) => time), all.map(([, value]) => value)];
  }

  #forget(): void {
    const before = this.now - 2 * this.#setting.window_s - KEPT_MORE_S;
    this.rows.forget(before);
    this.frames.forget(before);
  }

  /** Time begins anew with a controller. */
  #restart(): void {
    this.rows.clear();
    this.frames.clear();
    this.#trigger.gap();
    this.#known = this.#judged = this.#shown = -Infinity;
    this.#fired = null;
  }
}
