// Colours and dashes of channels: told apart without colours too.
import type { Look } from '../../report/chart';
import type { Line, Mark, Panel } from '../../report/recording';
import { continued } from '../travel';
import type { Capture, Channel } from './capture';

const LIGHT = ['#123a63', '#a03c00', '#00604f', '#7b1fa2', '#5b6300', '#b0005a', '#1565c0', '#5d4037'];
const DARK = ['#a8cdf2', '#ffb27a', '#7fd8c4', '#d9a6f0', '#d3dc7a', '#ff9cc8', '#78b4ff', '#cbb3a6'];
const DASHES = [[], [5, 3], [2, 2], [8, 3, 2, 3]];

export interface Style {
  colour: string;
  dashes: number[];
}
export function styleOf(index: number, dark: boolean): Style {
  const colours = dark ? DARK : LIGHT;
  return { colour: colours[index % colours.length] ?? '', dashes: DASHES[index % DASHES.length] ?? [] };
}

/** Colours of the page, as they are now. */
export function lookOf(height: number): Look {
  const css = getComputedStyle(document.documentElement);
  const colour = (name: string): string => css.getPropertyValue(name).trim();
  return {
    ink: colour('--text'),
    soft: colour('--soft'),
    grid: colour('--grid'),
    limit: colour('--stop'),
    height,
  };
}

export type Ranges = Record<string, [number, number] | null>;

function line(channel: Channel, style: Style, range: [number, number] | null, name = channel.name): Line {
  const { unit, steps, begin, labels, x } = channel;
  // A curve goes on over the end of the turn; only the numbers beside it begin anew.
  const y = begin === null ? channel.y : continued(channel.y);
  return { name, ...style, width: 1.2, x, y, own: { unit, range, steps, begin, labels } };
}

/** The panel of a capture, with another one over it. */
export function panelOf(
  capture: Capture,
  names: readonly string[],
  ranges: Ranges,
  dark: boolean,
  side: string,
  over: { capture: Capture; shift_s: number } | null,
  marks: Capture['marks'],
  timeWord: string,
): Panel {
  const lines: Line[] = [];
  const range = (name: string): [number, number] | null => ranges[name] ?? null;
  names.forEach((name, i) => {
    const style = styleOf(i, dark);
    const own = capture.channels.find((each) => each.name === name);
    if (own !== undefined) lines.push(line(own, style, range(name)));
    const other = over?.capture.channels.find((each) => each.name === name);
    if (over == null || other === undefined) return;
    // On the same scale, or two curves that are alike would not look it.
    const both = range(name) ?? spanOf([own, other]);
    const last = own === undefined ? undefined : lines.at(-1);
    if (last?.own) last.own = { ...last.own, range: both };
    const shifted = { ...other, x: other.x.map((x) => x + over.shift_s) };
    lines.push(line(shifted, { ...style, dashes: [1, 2] }, both, `${name} (2)`));
  });
  const style = { colour: lookOf(0).soft };
  const all: Mark[] = [...capture.marks, ...marks].map((mark) => ({ ...mark, ...style }));
  if (capture.title) all.push({ x: 0, label: 'T', ...style });
  const at = lines.findIndex(({ name }) => name === side);
  return {
    title: '',
    x: `${timeWord}, s`,
    y: '',
    xBegin: null,
    yBegin: null,
    limits: [],
    lines,
    marks: all,
    side: Math.max(0, at),
  };
}

/** Lowest and highest value of some channels, with a margin; null without one. */
function spanOf(channels: (Channel | undefined)[]): [number, number] | null {
  let [low, high] = [Infinity, -Infinity];
  for (const channel of channels)
    for (const value of channel?.y ?? []) {
      if (value === null) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  if (low > high) return null;
  const margin = Math.max(0.06 * (high - low), 1e-6);
  return [low - margin, high + margin];
}
