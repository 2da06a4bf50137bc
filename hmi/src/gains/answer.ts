import type { Core, Numbers, Plan } from './core';

/** What may be dragged; the keys are those of a machine file, in SI. */
export interface Gains {
  kvp_nm_s_per_rad: number;
  tvi_s: number;
  kpp_per_s: number;
  kvf: number;
}

export interface Axis {
  name: string;
  numbers: Numbers;
  /** Of the machine file. */
  gains: Gains;
  stands_rad: number;
  step_rad: number;
  move_from_rad: number;
  move: Plan;
}

/** Time in s; 1 = the step; errors in deg/s at the load. */
export interface Answer {
  step: { time: number[]; motor: number[]; load: number[]; motorOver: number; loadOver: number };
  move: { time: number[]; error: number[]; largest: number };
  limited: boolean;
}

const CALM_S = 2;
const WATCH_S = 4;
const MEAN_S = 2;
const SHOWN_S = 2;
const AFTER_S = 2;
const DEG = 180 / Math.PI;

/** Step of the set-point and move of an axis with these gains, as `gantryctl tune` tries them (its `Bench`). */
export function answer(core: Core, axis: Axis, gains: Gains): Answer {
  const numbers = {
    ...axis.numbers,
    'drive.kvp_nm_s_per_rad': gains.kvp_nm_s_per_rad,
    'drive.tvi_s': gains.tvi_s,
    'law.kpp_per_s': gains.kpp_per_s,
  };
  const period = Number(axis.numbers.scan_period_s);
  const scans = (seconds: number): number => Math.ceil(seconds / period - 1e-9);
  const column = (log: Map<string, Float64Array>, name: string): Float64Array => {
    const found = log.get(name);
    if (found === undefined) throw new RangeError(`the core logs no ${name}`);
    return found;
  };
  const times = (count: number): number[] => Array.from({ length: count }, (_, k) => k * period);

  // Without feed-forward, which would double a step.
  core.stand({ ...numbers, 'law.kvf': 0 }, axis.stands_rad);
  core.rest(axis.stands_rad, scans(CALM_S));
  const before = core.rest(axis.stands_rad, scans(1));
  const log = core.rest(axis.stands_rad + axis.step_rad, scans(WATCH_S));
  const part = (name: string): number[] => {
    const from = column(before, name).at(-1) ?? 0;
    return Array.from(column(log, name), (value) => (value - from) / axis.step_rad);
  };
  const [motor, load] = [part('pos_act_rad'), part('pos_load_rad')];
  const settled = load.slice(-scans(MEAN_S));
  const mean = settled.reduce((sum, value) => sum + value, 0) / settled.length;
  const shown = scans(SHOWN_S);

  core.stand({ ...numbers, 'law.kvf': gains.kvf }, axis.move_from_rad);
  core.rest(axis.move_from_rad, scans(CALM_S));
  const moved = core.run(axis.move, scans(axis.move.duration_s + AFTER_S));
  const wanted = column(moved, 'vel_ref_rad_s');
  const error = Array.from(column(moved, 'vel_load_rad_s'), (value, k) => DEG * (value - (wanted[k] ?? 0)));
  return {
    step: {
      time: times(shown),
      motor: motor.slice(0, shown),
      load: load.slice(0, shown),
      motorOver: Math.max(0, Math.max(...motor) - 1),
      loadOver: Math.max(0, Math.max(...load) - mean),
    },
    move: {
      time: times(error.length),
      error,
      largest: error.reduce((most, e) => Math.max(most, Math.abs(e)), 0),
    },
    limited: [log, moved].some((each) => column(each, 'torque_limited').some((value) => value > 0)),
  };
}
