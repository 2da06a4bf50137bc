// When a scope fires.

export const SLOPES = ['rising', 'falling', 'either'] as const;
export type Slope = (typeof SLOPES)[number];

/** Any new alarm is the trigger: their number rises. */
export const ALARM = 'alarm_count';

export interface TriggerSetting {
  /** Tag that is watched. */
  source: string;
  level: number;
  slope: Slope;
}

/** Looks at one sample after the other. */
export class Trigger {
  #before: number | null = null;

  constructor(readonly setting: TriggerSetting) {}

  /** Whether this sample is the first at or beyond the level; a gap before it fires nothing. */
  fires(value: number | null): boolean {
    const before = this.#before;
    this.#before = value;
    if (before === null || value === null) return false;
    const { source, level, slope } = this.setting;
    if (source === ALARM) return value > before;
    const up = before < level && value >= level;
    const down = before > level && value <= level;
    return (up && slope !== 'falling') || (down && slope !== 'rising');
  }

  /** Samples are missing: the next one has none before it. */
  gap(): void {
    this.#before = null;
  }
}
