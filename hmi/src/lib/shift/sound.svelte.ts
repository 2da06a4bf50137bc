// Alarm sound of this browser: off until somebody switches it on, quiet at first, silent once everything is seen.
import { link } from '../link.svelte';
import { FIRST, loudness } from './loudness';

const KEY = 'gantryctl.sound';
const EVERY_MS = 2000;
const BEEP_S = 0.15;
class AlarmSound {
  on = $state(localStorage.getItem(KEY) === 'on');
  /** The browser lets it sound: it wants a press of a key or the mouse first. */
  ready = $state(false);
  /** Something is active that nobody has acknowledged. */
  wanted = $derived(
    (link.tags.alarms ?? []).some((row) => row.active && row.severity !== 'INFO' && !row.acknowledged_by),
  );
  #context: AudioContext | null = null;
  #count = 0;

  constructor() {
    // Any press anywhere is what the browser waits for.
    for (const kind of ['pointerdown', 'keydown']) addEventListener(kind, () => this.on && this.#wake());
    setInterval(() => this.#beat(), EVERY_MS);
  }

  /** Switch it; switching on is heard, quietly. */
  set(on: boolean): void {
    this.on = on;
    localStorage.setItem(KEY, on ? 'on' : 'off');
    this.#count = 0;
    if (on) this.#wake(() => this.#beep(FIRST));
  }

  #wake(then: () => void = () => {}): void {
    this.#context ??= new AudioContext();
    void this.#context
      .resume()
      .then(() => {
        this.ready = this.#context?.state === 'running';
        then();
      })
      .catch(() => (this.ready = false));
  }

  #beat(): void {
    this.ready = this.#context?.state === 'running';
    if (!this.on || !this.wanted) this.#count = 0;
    else if (this.ready) this.#beep(loudness(this.#count++));
  }

  #beep(gain: number): void {
    const context = this.#context;
    if (context === null) return;
    const [tone, level] = [context.createOscillator(), context.createGain()];
    const now = context.currentTime;
    tone.frequency.value = 880;
    // Without a step: a step clicks.
    level.gain.setValueAtTime(0, now);
    level.gain.linearRampToValueAtTime(gain, now + 0.02);
    level.gain.linearRampToValueAtTime(0, now + BEEP_S);
    tone.connect(level).connect(context.destination);
    tone.start(now);
    tone.stop(now + BEEP_S);
  }
}

export const sound = new AlarmSound();
