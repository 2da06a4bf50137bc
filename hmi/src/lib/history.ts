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
export type Rows = Record<Column, (number | null)[]>;

const KEPT_S = 600;
const CLEARED_ROWS = 1000;

/** The last ten minutes; a gap in the data is a row of nothing. */
export class History {
  #rows: (number | null)[][] = [];
  #gap = false;

  add(tags: Partial<Tags>): void {
    const row = COLUMNS.map((name) => (typeof tags[name] === 'number' ? tags[name] : null));
    const before = this.#rows.at(-1)?.[0];
    if (row[0] == null || row[0] === before) return;
    if (typeof before === 'number' && row[0] < before)
      this.#rows = []; // the controller has started anew
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
    return Object.fromEntries(COLUMNS.map((name, i) => [name, rows.map((row) => row[i] ?? null)])) as Rows;
  }
}

/** The same as a CSV file. */
export function csv(rows: Rows): string {
  const lines = rows.time_s.map((_, i) => COLUMNS.map((name) => rows[name][i] ?? '').join(','));
  return [COLUMNS.join(','), ...lines].join('\n') + '\n';
}
