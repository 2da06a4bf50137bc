// Hold-to-run: the axis moves while a key is held, and this page proves with every status frame that it still is.
import { link } from './link.svelte';
import { sight } from './sight.svelte';
import type { Reply } from './protocol';
import type { Commands } from './tables';

export type Direction = Commands['jog']['direction'];

/** A lease that the controller has not shown by now will not live any more. */
const GRACE_MS = 400;

type Ending =
  '' | 'released' | 'both' | 'left' | 'unseen' | 'stale' | 'late' | 'refused' | 'lost' | 'withdrawn';

class Hold {
  direction = $state<Direction | null>(null);
  ended = $state<Ending>('');
  /** The refusal of the last press. */
  refusal = $state.raw<Reply | null>(null);
  #lease = '';
  #pressedAt = 0;
  #timer = 0;

  constructor() {
    const leave = (): void => this.release('left');
    for (const name of ['blur', 'pagehide', 'freeze']) addEventListener(name, leave);
    document.addEventListener('visibilitychange', leave);
    for (const name of ['pointerup', 'pointercancel']) addEventListener(name, () => this.release('released'));
    link.refused = () => this.#forget('lost');
    link.watch = () => this.#check();
    link.framed = () => this.#beat();
  }

  /** Begin; both keys together mean stop. */
  press(direction: Direction): void {
    if (this.direction !== null) return this.release('both');
    if (link.stale || !sight.stop) return;
    // A press on old data is not sent: it would arrive too late to be meant.
    if (link.since() > (link.welcome?.key_view_max_ms ?? 200)) {
      this.ended = 'late';
      return;
    }
    const lease = newLease();
    this.#lease = lease;
    this.#pressedAt = performance.now();
    this.direction = direction;
    this.ended = '';
    void link.send('jog', { lease, direction }).then((reply) => {
      if (reply.ok || this.#lease !== lease) return;
      this.refusal = reply;
      this.release('refused');
    });
    this.#timer = window.setInterval(() => this.#beat(), link.welcome?.renew_ms ?? 30);
  }

  /** End it, whatever the reason; the lease stays dead. */
  release(why: Ending): void {
    const lease = this.#lease;
    if (lease === '') return;
    this.#forget(why);
    // The answer to a release must not take the place of the refusal that is shown.
    if (why === 'refused') link.post('release', { lease });
    else void link.send('release', { lease });
  }

  /** With every status frame, and by a timer: only a newer frame makes the lease longer. */
  #beat(): void {
    if (this.#lease === '') return;
    if (link.stale) this.release('stale');
    else if (!link.post('renew', { lease: this.#lease })) this.#forget('lost');
  }

  #check(): void {
    if (this.#lease === '') return;
    if (link.stale) this.release('stale');
    else if (!sight.stop) this.release('unseen');
    else if (performance.now() - this.#pressedAt > GRACE_MS && link.tags.lease_left_ms === 0)
      this.release('lost');
  }

  #forget(why: Ending): void {
    if (this.#lease === '') return;
    clearInterval(this.#timer);
    this.#lease = '';
    this.direction = null;
    this.ended = why;
  }
}

function newLease(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(8));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, '0')).join('');
}

export const hold = new Hold();
