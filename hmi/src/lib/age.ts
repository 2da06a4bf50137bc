/** A status frame that arrives this much later than the quickest ones did is late: the network held it back. */
const FORGET = 0.1;

/**
 * How late status frames arrive, from their numbers alone.
 *
 * Frames are numbered by the controller, one every `frameMs`, so number times period is its clock. The quickest
 * frames set the zero; it is forgotten slowly, for the two clocks drift and a controller may start anew.
 */
export class Lateness {
  #zero = Infinity;
  #last = -1;
  #at = 0;

  /** Milliseconds that this frame is late; 0 for the first. */
  of(frame: number, now: number, frameMs: number): number {
    if (frame < this.#last) this.#zero = Infinity;
    const offset = now - frame * frameMs;
    const zero = Number.isFinite(this.#zero) ? this.#zero + FORGET * (now - this.#at) : offset;
    this.#zero = Math.min(zero, offset);
    this.#last = frame;
    this.#at = now;
    return offset - this.#zero;
  }
}
