import type { Tags } from './tables';

/** What the strip chart shows and exports, named as in the tag table. */
const COLUMNS = [
  'time_s',
  'pos_act_deg',
  'pos_ref_deg',
  'vel_act_deg_s',
  'vel_ref_deg_s',
  'vel_cmd_deg_s',
  'pos_err_deg',
  'torque_act_nm',
  'torque_expected_nm',
] as const satisfies (keyof Tags)[];
export type Column = (typeof COLUMNS)[number];
/** With the time of day of each row: seconds since 1970. */
export type Rows = Record<Column, (number | null)[]> & { clock_s: number[] };

const KEPT_S = 600;
const CLEARED_ROWS = 1000;
/** More than a network delays: the clock of this computer was set. */
const CLOCK_STEP_S = 2;

/** The last ten minutes; a gap in the data is a row of nothing. */
export class History {
  #rows: (number | null)[][] = [];
  /** Time of day when the controller's time was 0. */
  #started_s = 0;
  #gap = false;

  /** One row; `now_s` is the time of day when it was new. */
  add(tags: Partial<Tags>, now_s: number): void {
    const row = COLUMNS.map((name) => (typeof tags[name] === 'number' ? tags[name] : null));
    const before = this.#rows.at(-1)?.[0];
    if (row[0] == null || row[0] === before) return;
    if (typeof before === 'number' && row[0] < before) this.#rows = []; // the controller has started anew
    // Rows that arrive late do not move the scale: the earliest arrival is the nearest to the truth.
    const started_s = now_s - row[0];
    if (this.#rows.length === 0 || Math.abs(started_s - this.#started_s) > CLOCK_STEP_S)
      this.#started_s = started_s;
    else this.#started_s = Math.min(this.#started_s, started_s);
    if (this.#rows.length === 0) this.#gap = false;
    else if (this.#gap && typeof before === 'number')
      this.#rows.push([before + 1e-3, ...Array(COLUMNS.length - 1).fill(null)]);
    this.#gap = false;
    this.#rows.push(row);
    if (this.#rows.length % CLEARED_ROWS === 0) {
      const since = row[0] - KEPT_S;
      this.#rows.splice(
        0,
        this.#rows.findIndex((each) => (each[0] ?? 0) >= since),
      );
    }
  }

  /** Data went stale: whatever comes next is not joined to what was. */
  gap(): void {
    this.#gap = true;
  }

  /** Columns of the last seconds. */
  last(seconds: number): Rows {
    const end = this.#rows.at(-1)?.[0] ?? 0;
    let first = this.#rows.length;
    while (first > 0 && (this.#rows[first - 1]?.[0] ?? 0) >= end - seconds) first--;
    const rows = this.#rows.slice(first);
    const columns = Object.fromEntries(COLUMNS.map((name, i) => [name, rows.map((row) => row[i] ?? null)]));
    return { ...columns, clock_s: rows.map(([time_s]) => this.#started_s + (time_s ?? 0)) } as Rows;
  }
}

/** The same as a CSV file. */
export function csv(rows: Rows): string {
  const utc = (i: number): string => new Date(1000 * (rows.clock_s[i] ?? 0)).toISOString();
  const lines = rows.time_s.map((_, i) => [...COLUMNS.map((name) => rows[name][i] ?? ''), utc(i)].join(','));
  return [`${COLUMNS.join(',')},utc`, ...lines].join('\n') + '\n';
}
