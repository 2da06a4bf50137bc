/** A number with its decimals and a real minus; a dash for what is unknown. */
export function num(value: number | null | undefined, decimals: number): string {
  if (value == null) return '–';
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace('-', '') : text).replace('-', '−');
}

/** With a sign, for quantities that have a direction. */
export function signed(value: number | null | undefined, decimals: number): string {
  const text = num(value, decimals);
  return value != null && Number(value.toFixed(decimals)) > 0 ? `+${text}` : text;
}

/** An angle of a linear axis as people read it: signed, or within 0 to 360 degrees. */
export function read(deg: number | null | undefined, display: string | null | undefined): number | null {
  if (deg == null) return null;
  return display === '0..360' ? ((deg % 360) + 360) % 360 : deg;
}

/** The angle of the axis that a person means who types what the display shows. */
export function meant(deg: number, display: string | null | undefined, min: number, max: number): number {
  if (display !== '0..360' || (min <= deg && deg <= max)) return deg;
  return [deg - 360, deg + 360].find((angle) => min <= angle && angle <= max) ?? deg;
}

/** deg/s of the gantry as r/min. */
export function rpm(deg_s: number | null | undefined): number | null {
  return deg_s == null ? null : deg_s / 6;
}

/** A number typed by a person: comma or point, any minus; null when it is none. */
export function typed(text: string): number | null {
  const clean = text.trim().replace(',', '.').replace('−', '-');
  return /^[+-]?(\d+\.?\d*|\.\d+)$/.test(clean) ? Number(clean) : null;
}

export type Way = 'shortest' | 'positive' | 'negative' | 'current';

/** Way of a modulo axis to an angle, as the controller takes it; null where only it knows the last direction. */
export function turning(from: number, to: number, direction: Way, window_deg = 0.005): number | null {
  const forward = (((to - from) % 360) + 360) % 360;
  if (direction === 'current') return null;
  if (direction === 'positive') return forward > 360 - window_deg ? forward - 360 : forward;
  if (direction === 'negative') return forward < window_deg ? forward : forward - 360;
  return forward <= 180 + window_deg ? forward : forward - 360;
}

/** Seconds that a move takes on a trapezoid, without the jerk. */
export function moveTime(way_deg: number, vel_deg_s: number, acc_deg_s2: number): number {
  const way = Math.abs(way_deg);
  return way >= vel_deg_s ** 2 / acc_deg_s2
    ? way / vel_deg_s + vel_deg_s / acc_deg_s2
    : 2 * Math.sqrt(way / acc_deg_s2);
}
