// Travel of the axis as the page shows it: how angles are read, how far the set-point may go, what lies between.
// The service decides; what is refused here it would refuse in the same words (`program/axis/command_checks.py`).
import { num, signed } from './format';
import { t } from './prefs.svelte';
import type { Message, Tags, Values } from './tables';

type Known = Partial<Tags>;
export type Sector = readonly [begin: number, end: number];
export type Way = 'shortest' | 'positive' | 'negative' | 'current';

/** An axis that settles at 0 does not show 360: the turn begins a little below. */
const EDGE_DEG = 0.005;
/** Of the slowest setting: below it is what an encoder and a load that swings out show of an axis that stands. */
const REST_SHARE = 0.1;
/** Beyond it a target of a turning axis may have been meant as a way. */
const TURN_MAX_DEG = 360;

export const modulo = (tags: Known): boolean => tags.axis_kind === 'modulo';
export const low = (tags: Known): number => tags.pos_min_deg ?? -180;
export const high = (tags: Known): number => tags.pos_max_deg ?? 180;

/** Angles are read within a turn, so that they jump where it ends. */
export const within = (tags: Known): boolean => begin(tags) !== null;

/** Where the turn begins that angles are read in; null where they are read as they are. */
export function begin(tags: Known): number | null {
  if (modulo(tags)) return low(tags);
  return tags.display === '0..360' ? 0 : null;
}

/** An angle of the axis as people read it; never a difference of angles. */
export function read(deg: number | null | undefined, tags: Known): number | null {
  const from = begin(tags);
  if (deg == null || from === null) return deg ?? null;
  const start = from - EDGE_DEG;
  return start + ((((deg - start) % 360) + 360) % 360);
}

/** A limit of the angle in sentences: with its sign where both ends of travel read alike. */
function readEnd(deg: number, tags: Known): number {
  const { over_travel_min_deg: bottom, over_travel_max_deg: top } = tags;
  const alike = tags.display === '0..360' && bottom != null && top != null && top - bottom >= 360;
  return alike ? deg : (read(deg, tags) ?? deg);
}

/** The end of travel at which an angle lies whose reading another place of the axis shares, as ±180° do; '' elsewhere. */
export function endOf(deg: number | null | undefined, tags: Known): '' | '−' | '+' {
  const { mechanical_stop_min_deg: bottom, mechanical_stop_max_deg: top } = tags;
  if (deg == null || tags.display !== '0..360' || modulo(tags) || bottom == null || top == null) return '';
  return deg + 360 <= top ? '−' : deg - 360 >= bottom ? '+' : '';
}

/** In words, '' where the reading alone is clear. */
export function endText(deg: number | null | undefined, tags: Known): string {
  const end = endOf(deg, tags);
  return end && t('end_of', { end });
}

/** An angle of the axis as people read it, with the end of travel where two places read alike. */
export function angleText(deg: number | null | undefined, decimals: number, tags: Known): string {
  const end = endText(deg, tags);
  return `${num(read(deg, tags), decimals)}°${end && ` (${end})`}`;
}

/** What stands at a place of a scale: with a sign where angles have one. */
export function label(deg: number, tags: Known): string {
  const from = begin(tags);
  return from === null || from < 0 ? signed(read(deg, tags), 0) : num(read(deg, tags), 0);
}

/** The angle of the axis that a person means who types what the page shows. */
export function meant(deg: number, tags: Known): number {
  if (tags.display !== '0..360' || modulo(tags) || (low(tags) <= deg && deg <= high(tags))) return deg;
  // 500° is no angle that the page shows, and -190° is one beyond travel: nothing is guessed.
  if (deg < 0 || deg > 360) return deg;
  return [deg - 360, deg + 360].find((angle) => low(tags) <= angle && angle <= high(tags)) ?? deg;
}

/** No-go sectors between two angles; those of a turning axis in every turn. */
export function sectors(tags: Known, from: number, to: number): Sector[] {
  const own = (tags.no_go_deg ?? []).map(([a, b]): Sector => [a, modulo(tags) && b < a ? b + 360 : b]);
  if (!modulo(tags)) return own;
  return own.flatMap(([a, b]) => {
    const first = Math.ceil((from - b) / 360);
    const turns = Math.max(0, Math.floor((to - a) / 360) - first + 1);
    return Array.from({ length: turns }, (_, k): Sector => [a + 360 * (first + k), b + 360 * (first + k)]);
  });
}

interface Reach {
  low: number;
  high: number;
  below: Sector | undefined;
  above: Sector | undefined;
}

/** How far the set-point may go from where it is, and the sector that is the reason; none at an end of travel. */
function reach(tags: Known): Reach {
  const bottom = tags.reach_min_deg ?? -Infinity;
  const top = tags.reach_max_deg ?? Infinity;
  const near = Number.isFinite(bottom) ? sectors(tags, bottom - 360, top + 360) : [];
  return {
    low: bottom,
    high: top,
    below: near.filter(([, b]) => b <= bottom).sort((x, y) => y[1] - x[1])[0],
    above: near.filter(([a]) => a >= top).sort((x, y) => x[0] - y[0])[0],
  };
}

/** The same angles without steps of whole turns, in the turn of the first of them that is known. */
export function continued(angles: (number | null)[], begin?: number): (number | null)[] {
  let last = begin ?? angles.find((deg) => deg !== null) ?? 0;
  return angles.map((deg) => {
    if (deg === null) return null;
    last = deg - 360 * Math.round((deg - last) / 360);
    return last;
  });
}

/** Way of a turning axis to an angle, as the controller takes it; null where only it knows the last direction. */
function turning(from: number, to: number, direction: Way): number | null {
  const forward = (((to - from) % 360) + 360) % 360;
  if (direction === 'current') return null;
  if (direction === 'positive') return forward > 360 - EDGE_DEG ? forward - 360 : forward;
  if (direction === 'negative') return forward < EDGE_DEG ? forward : forward - 360;
  return forward <= 180 + EDGE_DEG ? forward : forward - 360;
}

/** The way to an angle from the set-point; null where it is not known. */
export function wayTo(target: number, direction: Way, tags: Known): number | null {
  const from = tags.pos_ref_deg;
  if (from == null) return null;
  return modulo(tags) ? turning(from, target, direction) : target - from;
}

/** Why the service would refuse an angle from here; null where it would not. */
export function refusal(target: number, direction: Way, tags: Known): Message | null {
  const here = tags.pos_ref_deg;
  if (here == null) return null;
  if (modulo(tags) && Math.abs(target) > TURN_MAX_DEG) {
    const allowed = { words: 'WITHIN_TRAVEL', values: { low: -TURN_MAX_DEG, high: TURN_MAX_DEG } };
    const measured = { words: 'ANGLE', values: { value: target } };
    const name = { words: 'NAME_TARGET', values: {} };
    return { code: 'CTL-01', values: { name, allowed, measured } };
  }
  const way = wayTo(target, direction, tags);
  if (way === null) return null;
  const end = here + way;
  const { low: bottom, high: top, below, above } = reach(tags);
  // The way back from outside is always open. The ends come rounded to what a tag has.
  const up = end > top + 1e-6 && end >= here;
  if (!up && !(end < bottom - 1e-6 && end <= here)) return null;
  const limit = up ? top : bottom;
  const sector = up ? above : below;
  // Beyond a turn it is no angle of the axis: what was typed is shown.
  const measured = Math.abs(end) > 360 && !modulo(tags) ? end : read(end, tags);
  const common: Values = { measured: measured ?? end, limit: read(limit, tags) ?? limit };
  const position = hundredths(read(here, tags) ?? here);
  if (!sector)
    return {
      code: 'CTL-09',
      values: {
        ...common,
        limit: readEnd(limit, tags),
        position,
        left: Math.abs(Math.max(0, up ? top - here : here - bottom)),
      },
    };
  const other = end - 360 * Math.sign(way);
  const free = !sectors(tags, end - 360, end + 360).some(([a, b]) => a < end && end < b);
  const round: Message =
    modulo(tags) && free && bottom <= other && other <= top
      ? { words: 'WAY_ROUND', values: { way: other - here } }
      : { words: 'NO_WAY_ROUND', values: {} };
  const [a, b] = sector.map((edge) => read(edge, tags) ?? edge);
  return { code: 'CTL-18', values: { ...common, begin: a ?? 0, end: b ?? 0, position, round } };
}

function hundredths(deg: number): number {
  return Number(deg.toFixed(2)) + 0;
}

/** Multiples of a step that divides a turn, at most `most` of them, from `from` to `to`. */
export function steps(from: number, to: number, most: number): number[] {
  const every = [1, 2, 5, 10, 15, 30, 45, 90, 180, 360, 720, 1800].find(
    (step) => marks(from, to, step).length <= most,
  );
  return marks(from, to, every ?? 3600);
}
function marks(from: number, to: number, step: number): number[] {
  const first = Math.ceil(from / step - 1e-9);
  const count = Math.max(0, Math.floor(to / step + 1e-9) - first + 1);
  return Array.from({ length: count }, (_, i) => (first + i) * step);
}

/** It stands, as far as is known: a quick stop leaves a set-point behind that stands while the axis still moves. */
export function rests(tags: Known): boolean {
  const { at_rest, vel_act_deg_s: vel, speed_min_deg_s: slowest } = tags;
  return at_rest === true && vel != null && Math.abs(vel) <= REST_SHARE * (slowest ?? 0);
}

/** The angle beyond which a key moves nothing, where the set-point stands there; null elsewhere. */
export function endOfKey(direction: 'forward' | 'reverse', tags: Known): number | null {
  const end = direction === 'forward' ? tags.reach_max_deg : tags.reach_min_deg;
  const { pos_ref_deg: pos, vel_ref_deg_s: vel } = tags;
  return end != null && pos != null && vel === 0 && Math.abs(pos - end) < EDGE_DEG ? end : null;
}

/** Angles that are worth a button: inside of what the set-point can reach, not its ends. */
export function usual(tags: Known): number[] {
  const { low: bottom, high: top } = reach(tags);
  if (!Number.isFinite(bottom)) return steps(low(tags), low(tags) + 360 - EDGE_DEG, 5);
  // Of two angles that read alike the button can mean one: the one that is meant where it is typed.
  const found = steps(bottom + EDGE_DEG, top - EDGE_DEG, 5);
  const alike = (angle: number): boolean =>
    found.some((each) => each !== angle && read(each, tags) === read(angle, tags));
  return found.filter((angle) => !alike(angle) || meant(read(angle, tags) ?? angle, tags) === angle);
}
