// The scope of this page: it goes on while another area is shown.
import { link } from '../link.svelte';
import { begin } from '../travel';
import type { Tags } from '../tables';
import { Acquisition, type Mode, type Setting, type Shown } from './acquisition';
import { CHANNELS_MAX, type Capture } from './capture';
import type { Values } from './samples';
import { ALARM, type Slope } from './trigger';

interface TagRow {
  name: keyof Tags;
  unit: string;
  type: string;
  labels: string[];
}
interface Answer {
  period_s: number | null;
  from: number;
  next: number;
  newest: number;
  newest_s: number | null;
  utc_s: number;
  tags: Record<string, Values>;
}
/** Angles of the axis, which people read within a turn. */
const OF_AXIS = new Set(['pos_act_deg', 'pos_ref_deg', 'target_deg']);
const FIRST = ['pos_act_deg', 'vel_act_deg_s', 'torque_act_nm'];
const KINDS = new Set(['float', 'int', 'bool', 'enum']);
const POLL_MS = 250;
/** The service gives one session ten answers a second. */
const HURRY_MS = 120;
const BUSY_MS = 1000;
const REDRAW_MS = 200;
/** Rows from before the start that are asked for. */
const PAST_ROWS = 2000;

class Scope {
  /** Everything that can be shown. */
  tags = $state.raw<Shown[]>([]);
  channels = $state<string[]>([...FIRST]);
  source = $state('vel_act_deg_s');
  level = $state<number | null>(0.5);
  slope = $state<Slope>('rising');
  mode = $state<Mode>('auto');
  window_s = $state(5);
  before_percent = $state(20);
  running = $state(false);
  /** What is shown. */
  capture = $state.raw<Capture | null>(null);
  /** It goes on by itself: not a trigger, a file or a recording. */
  live = $state(false);
  /** Samples come at the period of the scan, s; null while power is off. */
  scan_s = $state<number | null>(null);
  /** Rows of the scan that came too late. */
  missed = $state(0);
  busy = $state(false);

  /** Its area is shown: what comes is drawn. Triggers are taken all the same. */
  watched = false;

  #acquisition: Acquisition | null = null;
  #drawn_ms = 0;
  #next: number | null = null;
  #timer = 0;
  /** Wall clock of the machine at its time 0. */
  #utc0 = Infinity;
  #newest = -1;

  constructor() {
    link.heard.add(() => this.#frame());
  }

  async load(): Promise<void> {
    if (this.tags.length > 0) return;
    const answer = await fetch('/api/v1/tags').catch(() => null);
    if (!answer?.ok) return;
    const rows = (await answer.json()) as TagRow[];
    this.tags = rows
      .filter((row) => KINDS.has(row.type))
      .map(({ name, unit, type, labels }) => ({
        name,
        unit,
        steps: type === 'bool' || type === 'enum',
        labels,
        begin: OF_AXIS.has(name) ? begin(link.tags) : null,
      }));
  }

  start(): void {
    const setting = this.#setting();
    if (setting === null) return;
    if (!this.running) {
      this.#acquisition = new Acquisition(setting);
      this.#next = null;
      this.#utc0 = Infinity;
      this.missed = 0;
      this.running = true;
      this.#frame();
      void this.#poll();
    }
    this.#acquisition?.arm(setting, link.tags.time_s ?? -Infinity);
  }

  stop(): void {
    this.running = this.live = false;
    clearTimeout(this.#timer);
  }

  /** Show what was saved or recorded. */
  show(capture: Capture): void {
    this.stop();
    this.capture = capture;
    this.channels = capture.channels.slice(0, CHANNELS_MAX).map(({ name }) => name);
  }

  /** Whether it waits for its trigger. */
  waits(): boolean {
    return this.running && !this.live;
  }

  #setting(): Setting | null {
    const { source, level, slope, mode, window_s } = this;
    if (source !== ALARM && level === null) return null;
    const trigger = { source, level: level ?? 0, slope };
    return { trigger, mode, window_s, before: this.before_percent / 100 };
  }

  /** A status frame. */
  #frame(): void {
    const { time_s } = link.tags;
    if (!this.running || this.#acquisition === null || typeof time_s !== 'number') return;
    const values = this.tags.map(({ name, labels }) => [
      name,
      numberOf(link.tags[name as keyof Tags], labels),
    ]);
    this.#acquisition.takeFrame(time_s, Object.fromEntries(values) as Record<string, number | null>);
  }

  async #poll(): Promise<void> {
    const acquisition = this.#acquisition;
    const framed = acquisition?.frames.newest ?? -Infinity;
    const query = this.#next === null ? '' : `?from=${this.#next}`;
    const answer = await fetch(`/api/v1/samples${query}`).catch(() => null);
    if (!this.running || acquisition !== this.#acquisition) return;
    this.busy = answer?.status === 429;
    let wait_ms = answer?.ok ? POLL_MS : BUSY_MS;
    if (answer?.ok) {
      const found = (await answer.json()) as Answer;
      if (this.#next === null) {
        this.#next = Math.max(0, found.newest - PAST_ROWS);
        wait_ms = 0;
      } else {
        this.#take(found, framed);
        if (found.next < found.newest) wait_ms = HURRY_MS;
      }
    }
    this.#timer = window.setTimeout(() => void this.#poll(), wait_ms);
  }

  /** Rows in memory; `framed` is the time of the newest frame when they were asked for. */
  #take(found: Answer, framed: number): void {
    const { time_s: times, ...columns } = found.tags;
    const gap = this.#next !== null && found.from !== this.#next;
    if (gap) this.missed += Math.max(0, found.from - (this.#next ?? 0));
    this.#next = found.next;
    // The least is the truest: a row is seen late, never early.
    if (found.newest !== this.#newest && found.newest_s !== null)
      this.#utc0 = Math.min(this.#utc0, found.utc_s - found.newest_s);
    this.#newest = found.newest;
    this.scan_s = times?.length ? found.period_s : null;
    // Where no row is left to ask for, there was none up to that frame but those that are known.
    const known = found.next === found.newest ? framed : -Infinity;
    this.#acquisition?.takeRows((times ?? []) as number[], columns, known, gap);
    this.#look();
  }

  #look(): void {
    const acquisition = this.#acquisition;
    const setting = this.#setting();
    if (acquisition === null || setting === null) return;
    const { window_s, before } = setting;
    const at = acquisition.whole();
    if (at !== null) {
      const from = at - before * window_s;
      this.capture = this.#picture(at, from, from + window_s, this.source === ALARM ? '!' : this.source);
      this.live = false;
      if (this.mode === 'single') this.stop();
    } else if (acquisition.free && this.watched && performance.now() - this.#drawn_ms > REDRAW_MS) {
      const { now } = acquisition;
      this.#drawn_ms = performance.now();
      this.live = true;
      this.capture = this.#picture(now, now - window_s, now, '');
    }
  }

  #picture(at: number, from: number, to: number, title: string): Capture {
    const shown = this.channels.flatMap((name) => this.tags.filter((tag) => tag.name === name));
    const alarms = link.tags.alarms ?? [];
    return {
      title,
      machine: link.tags.machine ?? '',
      utc_s: Number.isFinite(this.#utc0)
        ? at + this.#utc0
        : Date.now() / 1000 - ((link.tags.time_s ?? at) - at),
      channels: this.#acquisition?.picture(at, from, to, shown) ?? [],
      marks: alarms
        .filter(({ time_s }) => time_s >= from && time_s <= to)
        .map(({ time_s, code }) => ({ x: Number((time_s - at).toFixed(6)), label: code })),
    };
  }
}

/** A tag as a number: a state by the place of its word. */
function numberOf(value: Tags[keyof Tags] | undefined, labels: readonly string[]): number | null {
  if (typeof value === 'number') return value;
  if (typeof value === 'boolean') return value ? 1 : 0;
  const at = typeof value === 'string' ? labels.indexOf(value) : -1;
  return at < 0 ? null : at;
}

export const scope = new Scope();
