/** Milliseconds per millisecond: more than two clocks of computers ever drift apart. */
const FORGET = 0.001;

/**
 * How late status frames arrive, from their times of issue alone.
 *
 * Frames carry their time by the controller's clock. The quickest frames set the zero; it is forgotten slowly, for two
 * clocks drift, and at once when a controller starts anew.
 */
export class Lateness {
  #zero = Infinity;
  #last = -1;
  #at = 0;

  /** Milliseconds that this frame is late; 0 for the first. */
  of(issued: number, now: number): number {
    if (issued < this.#last) this.#zero = Infinity;
    const offset = now - issued;
    const zero = Number.isFinite(this.#zero) ? this.#zero + FORGET * (now - this.#at) : offset;
    this.#zero = Math.min(zero, offset);
    this.#last = issued;
    this.#at = now;
    return offset - this.#zero;
  }
}
