// Samples of many tags over time, in columns.

export type Values = (number | null)[];

export class Samples {
  readonly times: number[] = [];
  readonly #columns = new Map<string, Values>();

  get newest(): number {
    return this.times.at(-1) ?? -Infinity;
  }

  has(tag: string): boolean {
    return this.#columns.has(tag);
  }

  /** Append rows that are newer than all others; a tag that was not there before is unknown until now. */
  add(times: number[], columns: Record<string, Values>): void {
    for (const tag of Object.keys(columns))
      if (!this.#columns.has(tag)) this.#columns.set(tag, Array<null>(this.times.length).fill(null));
    for (const [tag, values] of this.#columns)
      for (let i = 0; i < times.length; i++) values.push(columns[tag]?.[i] ?? null);
    for (const time of times) this.times.push(time);
  }

  /** Forget what is older, but not row by row. */
  forget(before: number): void {
    const count = this.#first(before);
    if (count < 1000) return;
    this.times.splice(0, count);
    for (const values of this.#columns.values()) values.splice(0, count);
  }

  clear(): void {
    this.times.length = 0;
    this.#columns.clear();
  }

  /** Times and values of one tag from `from` to `to`, both included. */
  part(tag: string, from: number, to: number): [number[], Values] {
    const [a, b] = [this.#first(from), this.#first(to, true)];
    return [this.times.slice(a, b), (this.#columns.get(tag) ?? []).slice(a, b)];
  }

  /** Index of the first row at `time` or later; later only with `beyond`. */
  #first(time: number, beyond = false): number {
    let [low, high] = [0, this.times.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      const here = this.times[middle] ?? Infinity;
      if (here < time || (beyond && here === time)) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}
