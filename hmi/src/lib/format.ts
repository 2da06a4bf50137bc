/** A number with its decimals and a real minus; a dash for what is unknown. */
export function num(value: number | null | undefined, decimals: number): string {
  if (value == null) return '–';
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace('-', '') : text).replace('-', '−');
}

/** A number with all digits that it has, but at least so many decimals and at most six. */
export function whole(value: number | null | undefined, least: number): string {
  const text = num(value, 6);
  const end = text.indexOf('.') + 1 + least;
  return value == null ? text : text.slice(0, end) + text.slice(end).replace(/0+$/, '');
}

/** With a sign, for quantities that have a direction. */
export function signed(value: number | null | undefined, decimals: number): string {
  const text = num(value, decimals);
  return value != null && Number(value.toFixed(decimals)) > 0 ? `+${text}` : text;
}

/** Decimals that show two digits of a quantity of this size. */
export function decimalsOf(size: number | null | undefined): number {
  return size == null || !(size > 0) ? 0 : Math.max(0, 1 - Math.floor(Math.log10(size)));
}

/** Decimals of a speed, at least so many: two digits of the slowest setting of the axis. */
export function speedDecimals(slowest: number | null | undefined, least: number): number {
  return Math.max(least, decimalsOf(slowest));
}

/** deg/s of the gantry as r/min. */
export function rpm(deg_s: number | null | undefined): number | null {
  return deg_s == null ? null : deg_s / 6;
}

/** A speed of the axis in both units that people use. */
export function speedText(deg_s: number | null | undefined, decimals: number): string {
  return `${num(deg_s, decimals)} °/s (${num(rpm(deg_s), decimals + 1)} r/min)`;
}

/** A number typed by a person: comma or point, any minus; null when it is not a number. */
export function typed(text: string): number | null {
  const clean = text.trim().replace(',', '.').replace('−', '-');
  return /^[+-]?(\d+\.?\d*|\.\d+)$/.test(clean) ? Number(clean) : null;
}

/** Seconds that a move takes on a trapezoid, without the jerk. */
export function moveTime(way_deg: number, vel_deg_s: number, acc_deg_s2: number): number {
  const way = Math.abs(way_deg);
  return way >= vel_deg_s ** 2 / acc_deg_s2
    ? way / vel_deg_s + vel_deg_s / acc_deg_s2
    : 2 * Math.sqrt(way / acc_deg_s2);
}
