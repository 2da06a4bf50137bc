import uPlot from 'uplot';
import type { Line, Mark, Panel } from './recording';

/** Colours and height of a chart. */
export interface Look {
  ink: string;
  soft: string;
  grid: string;
  limit: string;
  height: number;
}
const PAPER: Look = { ink: '#20242b', soft: '#5a606b', grid: '#e7eaee', limit: '#b3261e', height: 190 };
const FONT = '11px system-ui, sans-serif';
const NAMES = ['A', 'B'];
/** More would hide the curves. */
const MARKS_MOST = 60;

/** The unit at the end of a label: `speed, deg/s`. */
function unit(label: string): string {
  const at = label.lastIndexOf(', ');
  return at < 0 ? '' : signs(label.slice(at + 2));
}
function signs(label: string): string {
  return label.replace('deg/s2', '°/s²').replace('deg/s', '°/s').replace('deg', '°');
}
function number(value: number | null | undefined): string {
  if (value == null) return '–';
  const size = Math.abs(value);
  const text =
    size !== 0 && (size < 1e-4 || size >= 1e6)
      ? value.toExponential(3)
      : String(Number(value.toPrecision(6)));
  return text.replaceAll('-', '−');
}

/** A number of one side as people read it: an angle of the axis within its turn. */
function read(value: number | null | undefined, begin: number | null): string {
  if (value == null || begin == null) return number(value);
  // An axis that settles at 0 does not show 360.
  const from = begin - 0.005;
  return number(Number((from + ((((value - from) % 360) + 360) % 360)).toFixed(6)));
}

/** A value of one curve with its unit, as people read it. */
function told(line: Line, panel: Panel, value: number | null | undefined): string {
  const { own } = line;
  if (own === undefined) return `${read(value, panel.yBegin)} ${unit(panel.y)}`;
  return own.labels[value ?? -1] ?? `${read(value, own.begin)} ${signs(own.unit)}`;
}

type Sample = readonly [x: number, y: number | null];

/** Samples at rising places: a way back is drawn over the way there. */
function rising(line: Line): Sample[] {
  const samples = line.x.map((x, i): Sample => [x, line.y[i] ?? null]).sort((a, b) => a[0] - b[0]);
  return samples.filter(([x], i) => x !== samples[i - 1]?.[0]);
}

/** Places, and the values of every curve there. */
function aligned(panel: Panel): uPlot.AlignedData {
  // Channels of one capture share their places, which rise.
  const shared = new Map<number[], Line[]>();
  for (const line of panel.lines) if (line.own) shared.set(line.x, [...(shared.get(line.x) ?? []), line]);
  const groups = [...shared.values(), ...panel.lines.filter((line) => !line.own).map((line) => [line])];
  if (groups.length === 0) return [[0]];
  const tables = groups.map((lines): uPlot.AlignedData => {
    const [first] = lines;
    if (first?.own) return [first.x, ...lines.map((line) => line.y)];
    const samples = first === undefined ? [] : rising(first);
    return [samples.map(([x]) => x), samples.map(([, y]) => y)];
  });
  const [only] = tables;
  const joined = tables.length === 1 && only !== undefined ? only : uPlot.join(tables);
  const place = new Map(groups.flat().map((line, i) => [line, i + 1]));
  return [joined[0], ...panel.lines.map((line) => joined[place.get(line) ?? 0] ?? [])];
}

/** The value of a curve at a place between its samples; null outside of them. */
function valueAt(line: Line, place: number): number | null {
  let before: Sample | undefined;
  for (const sample of line.own ? line.x.map((x, i): Sample => [x, line.y[i] ?? null]) : rising(line)) {
    if (sample[0] === place) return sample[1];
    if (sample[0] > place) {
      if (before === undefined) return null;
      if (line.own?.steps) return before[1];
      if (before[1] === null || sample[1] === null) return null;
      const part = (place - before[0]) / (sample[0] - before[0]);
      return before[1] + part * (sample[1] - before[1]);
    }
    before = sample;
  }
  return null;
}

/** Lines at the limits, at moments with a word and at the two cursors. */
function marks(panel: () => Panel, look: Look, cursors: () => number[]): uPlot.Plugin {
  return {
    hooks: {
      draw: (plot: uPlot) => {
        const { ctx, bbox } = plot;
        const upright = ({ x: place, label, colour }: Mark, down: number): void => {
          ctx.strokeStyle = colour;
          ctx.fillStyle = colour;
          const x = plot.valToPos(place, 'x', true);
          ctx.beginPath();
          ctx.moveTo(x, bbox.top);
          ctx.lineTo(x, bbox.top + bbox.height);
          ctx.stroke();
          ctx.fillText(label, x + 3 * devicePixelRatio, bbox.top + down * devicePixelRatio);
        };
        ctx.save();
        ctx.beginPath();
        ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
        ctx.clip();
        ctx.lineWidth = devicePixelRatio;
        ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
        for (const level of panel().limits) {
          ctx.strokeStyle = look.limit;
          ctx.setLineDash([4, 3]);
          const y = plot.valToPos(level, 'y', true);
          ctx.beginPath();
          ctx.moveTo(bbox.left, y);
          ctx.lineTo(bbox.left + bbox.width, y);
          ctx.stroke();
        }
        ctx.setLineDash([1, 3]);
        for (const mark of seen(panel().marks ?? [], plot)) upright(mark, 24);
        ctx.setLineDash([]);
        cursors().forEach((x, i) => upright({ x, label: NAMES[i] ?? '', colour: look.ink }, 12));
        ctx.restore();
      },
    },
  };
}

/** Marks within the picture; where they are too many, evenly chosen ones without their words. */
function seen(found: Mark[], plot: uPlot): Mark[] {
  const { min = 0, max = 0 } = plot.scales.x ?? {};
  const within = found.filter(({ x }) => x >= min && x <= max);
  if (within.length <= MARKS_MOST) return within;
  const step = Math.ceil(within.length / (4 * MARKS_MOST));
  return within.filter((_, i) => i % step === 0).map((mark) => ({ ...mark, label: '' }));
}

/** One panel: drag to zoom, double click to see all, click to set a cursor (A, then B). */
export class Chart {
  readonly element = document.createElement('div');
  /** Places of the cursors. */
  cursors: number[] = [];
  private readonly host = document.createElement('div');
  private readonly readings = document.createElement('div');
  private before: number[] = [];
  private plot: uPlot | undefined;

  constructor(
    private panel: Panel,
    private readonly sync: string,
    private readonly look = PAPER,
  ) {
    this.element.className = 'chart';
    this.readings.className = 'readings';
    this.element.append(this.host, this.readings);
  }

  /** Draw, or draw again with other curves. */
  show(panel = this.panel): void {
    this.panel = panel;
    this.plot?.destroy();
    const { lines } = panel;
    const xUnit = unit(panel.x);
    this.plot = new uPlot(
      {
        width: this.element.clientWidth || 300,
        height: this.look.height,
        title: signs(panel.title),
        scales: {
          x: { time: false, range: (_, low, high) => wide(low, high, 0) },
          y: { range: (_, low, high) => wide(...withLimits(panel, low, high), 0.06) },
          ...Object.fromEntries(
            lines.flatMap(({ own }, i) =>
              own === undefined ? [] : [[`own${i}`, { range: own.range ?? around(own.steps) }]],
            ),
          ),
        },
        cursor: { sync: { key: this.sync }, drag: { x: true, y: true, uni: 24 }, focus: { prox: 24 } },
        plugins: [
          marks(
            () => this.panel,
            this.look,
            () => this.cursors,
          ),
        ],
        axes: [{ ...this.side(signs(panel.x), panel.xBegin), size: 24 }, this.left()],
        series: [
          { label: signs(panel.x.replace(/,.*/, '')), value: (_, x) => `${read(x, panel.xBegin)} ${xUnit}` },
          ...lines.map((line, i) => ({
            label: line.name,
            stroke: line.colour,
            dash: line.dashes.map((part) => 1.5 * part),
            width: 1.2 * line.width,
            spanGaps: line.own === undefined,
            points: { show: line.x.length <= 12 },
            value: (_: uPlot, y: number | null) => told(line, panel, y),
            ...(line.own !== undefined && { scale: `own${i}` }),
            ...(line.own?.steps && { paths: uPlot.paths.stepped?.({ align: 1 }) }),
          })),
        ],
      },
      aligned(panel),
      this.host,
    );
    this.plot.over.addEventListener('click', (event) => this.mark(event));
    // Its first click has set a cursor.
    this.plot.over.addEventListener('dblclick', () => this.set(this.before));
    this.read();
  }

  /** Draw newer values of the same curves. */
  renew(panel: Panel): void {
    this.panel = panel;
    this.plot?.setData(aligned(panel));
    this.read();
  }

  fit(): void {
    this.plot?.setSize({ width: this.element.clientWidth, height: this.look.height });
  }

  /** Set the cursors. */
  set(cursors: number[]): void {
    this.cursors = cursors;
    this.plot?.redraw();
    this.read();
  }

  destroy(): void {
    this.plot?.destroy();
    this.plot = undefined;
  }

  /** A click sets a cursor; dragging ends with a click as well, and sets none. */
  private mark(event: MouseEvent): void {
    const plot = this.plot;
    if (plot === undefined || plot.select.width > 0 || plot.cursor.left == null || event.detail > 1) return;
    const place = plot.posToVal(plot.cursor.left, 'x');
    this.before = this.cursors;
    this.set(this.cursors.length === 2 ? [place] : [...this.cursors, place]);
  }

  private read(): void {
    const { x, lines, xBegin } = this.panel;
    const [a, b] = this.cursors;
    const rows = this.cursors.map(
      (place, i) => [`${NAMES[i]}: ${read(place, xBegin)} ${unit(x)}`, place] as const,
    );
    const found = rows.map(
      ([head, place]) =>
        `${head}; ${lines.map((line) => `${line.name} ${told(line, this.panel, valueAt(line, place))}`).join(', ')}`,
    );
    if (a !== undefined && b !== undefined) {
      const apart = lines.map((line) => {
        const [from, to] = [valueAt(line, a), valueAt(line, b)];
        const of = line.own === undefined ? unit(this.panel.y) : signs(line.own.unit);
        return `${line.name} ${from === null || to === null ? '–' : number(to - from)} ${of}`;
      });
      found.push(`B − A: ${number(b - a)} ${unit(x)}; ${apart.join(', ')}`);
    }
    this.readings.replaceChildren(
      ...found.map((text) => Object.assign(document.createElement('div'), { textContent: text })),
    );
  }

  /** The scale at the left: of the panel, or of one curve. */
  private left(): uPlot.Axis {
    const { panel } = this;
    const at = panel.side ?? 0;
    const line = panel.lines[at];
    const own = line?.own;
    if (line === undefined || own === undefined)
      return { ...this.side(signs(panel.y), panel.yBegin), size: 54 };
    const words = own.labels.length > 0;
    return {
      ...this.side(own.unit ? `${line.name}, ${signs(own.unit)}` : line.name, own.begin),
      size: words ? 90 : 62,
      scale: `own${at}`,
      stroke: line.colour,
      ...(words && { values: (_, ticks) => ticks.map((tick) => own.labels[tick] ?? '') }),
    };
  }

  /** One side of a diagram; only what stands beside a curve is read within a turn, the curve goes on. */
  private side(label: string, begin: number | null): uPlot.Axis {
    const { soft, grid } = this.look;
    const common = {
      stroke: soft,
      grid: { stroke: grid, width: 1 },
      ticks: { show: false },
      font: FONT,
      label,
      labelSize: 16,
      labelFont: FONT,
    };
    return begin == null
      ? common
      : { ...common, values: (_, ticks) => ticks.map((tick) => read(tick, begin)) };
  }
}

/** The range that a channel's values need; a flag or state has room above and below. */
function around(steps: boolean): uPlot.Scale.Range {
  return (_: uPlot, low: number | null, high: number | null): [number, number] =>
    steps ? [(low ?? 0) - 0.5, (high ?? 0) + 0.5] : wide(low, high, 0.06);
}

/** The range of all samples reaches to the limits, as on paper; who zooms in sees what was asked for. */
function withLimits(panel: Panel, low: number | null, high: number | null): [number, number] {
  const [a, b] = [low ?? 0, high ?? 0];
  const values = panel.lines.flatMap((line) => line.y.filter((y) => y !== null));
  const lowest = values.reduce((least, y) => Math.min(least, y), Infinity);
  const highest = values.reduce((most, y) => Math.max(most, y), -Infinity);
  if (a !== lowest || b !== highest) return [a, b];
  return [Math.min(a, ...panel.limits), Math.max(b, ...panel.limits)];
}

/** A range with a margin; a constant lies in the middle of one unit. */
function wide(low: number | null, high: number | null, part: number): [number, number] {
  const [a, b] = [low ?? 0, high ?? 0];
  if (b - a <= 1e-9 * Math.max(Math.abs(a), Math.abs(b), 1e-9)) return [a - 0.5, b + 0.5];
  return [a - part * (b - a), b + part * (b - a)];
}
