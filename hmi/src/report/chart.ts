import uPlot from 'uplot';
import type { Line, Panel } from './recording';

const RED = '#b3261e';
const GRID = { stroke: '#e7eaee', width: 1 };
const AXIS = { stroke: '#5a606b', grid: GRID, ticks: { show: false }, font: '11px system-ui, sans-serif' };
const HEIGHT = 190;
const NAMES = ['A', 'B'];

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

type Sample = readonly [x: number, y: number];

/** Samples at rising places: a way back is drawn over the way there. */
function rising(line: Line): Sample[] {
  const samples = line.x.map((x, i): Sample => [x, line.y[i] ?? NaN]).sort((a, b) => a[0] - b[0]);
  return samples.filter(([x], i) => x !== samples[i - 1]?.[0]);
}

function aligned(panel: Panel): uPlot.AlignedData {
  return uPlot.join(
    panel.lines.map((line) => {
      const samples = rising(line);
      return [samples.map(([x]) => x), samples.map(([, y]) => y)];
    }),
  );
}

/** The value of a curve at a place between its samples; null outside of them. */
function valueAt(line: Line, place: number): number | null {
  let before: Sample | undefined;
  for (const sample of rising(line)) {
    if (sample[0] === place) return sample[1];
    if (sample[0] > place) {
      if (before === undefined) return null;
      const part = (place - before[0]) / (sample[0] - before[0]);
      return before[1] + part * (sample[1] - before[1]);
    }
    before = sample;
  }
  return null;
}

/** Lines at the limits and at the two cursors. */
function marks(panel: Panel, cursors: () => number[]): uPlot.Plugin {
  return {
    hooks: {
      draw: (plot: uPlot) => {
        const { ctx, bbox } = plot;
        ctx.save();
        ctx.beginPath();
        ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
        ctx.clip();
        ctx.lineWidth = devicePixelRatio;
        for (const level of panel.limits) {
          ctx.strokeStyle = RED;
          ctx.setLineDash([4, 3]);
          const y = plot.valToPos(level, 'y', true);
          ctx.beginPath();
          ctx.moveTo(bbox.left, y);
          ctx.lineTo(bbox.left + bbox.width, y);
          ctx.stroke();
        }
        cursors().forEach((place, i) => {
          ctx.strokeStyle = '#20242b';
          ctx.fillStyle = '#20242b';
          ctx.setLineDash([]);
          const x = plot.valToPos(place, 'x', true);
          ctx.beginPath();
          ctx.moveTo(x, bbox.top);
          ctx.lineTo(x, bbox.top + bbox.height);
          ctx.stroke();
          ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
          ctx.fillText(NAMES[i] ?? '', x + 3 * devicePixelRatio, bbox.top + 12 * devicePixelRatio);
        });
        ctx.restore();
      },
    },
  };
}

/** One panel: drag to zoom, double click to see all, click to set a cursor (A, then B). */
export class Chart {
  readonly element = document.createElement('div');
  private readonly host = document.createElement('div');
  private readonly readings = document.createElement('div');
  private cursors: number[] = [];
  private before: number[] = [];
  private plot: uPlot | undefined;

  constructor(
    private panel: Panel,
    private readonly sync: string,
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
    const yUnit = unit(panel.y);
    this.plot = new uPlot(
      {
        width: this.element.clientWidth || 300,
        height: HEIGHT,
        title: signs(panel.title),
        scales: {
          x: { time: false, range: (_, low, high) => wide(low, high, 0) },
          y: { range: (_, low, high) => wide(...withLimits(panel, low, high), 0.06) },
        },
        cursor: { sync: { key: this.sync }, drag: { x: true, y: true, uni: 24 }, focus: { prox: 24 } },
        plugins: [marks(panel, () => this.cursors)],
        axes: [
          { ...side(panel.x, panel.xBegin), size: 24 },
          { ...side(panel.y, panel.yBegin), size: 54 },
        ],
        series: [
          { label: signs(panel.x.replace(/,.*/, '')), value: (_, x) => `${read(x, panel.xBegin)} ${xUnit}` },
          ...lines.map((line) => ({
            label: line.name,
            stroke: line.colour,
            dash: line.dashes.map((part) => 1.5 * part),
            width: 1.2 * line.width,
            spanGaps: true,
            points: { show: line.x.length <= 12 },
            value: (_: uPlot, y: number | null) => `${read(y, panel.yBegin)} ${yUnit}`,
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

  fit(): void {
    this.plot?.setSize({ width: this.element.clientWidth, height: HEIGHT });
  }

  /** A click sets a cursor; dragging ends with a click as well, and sets none. */
  private mark(event: MouseEvent): void {
    const plot = this.plot;
    if (plot === undefined || plot.select.width > 0 || plot.cursor.left == null || event.detail > 1) return;
    const place = plot.posToVal(plot.cursor.left, 'x');
    this.before = this.cursors;
    this.set(this.cursors.length === 2 ? [place] : [...this.cursors, place]);
  }

  private set(cursors: number[]): void {
    this.cursors = cursors;
    this.plot?.redraw();
    this.read();
  }

  private read(): void {
    const { x, y, lines, xBegin, yBegin } = this.panel;
    const [a, b] = this.cursors;
    const rows = this.cursors.map(
      (place, i) => [`${NAMES[i]}: ${read(place, xBegin)} ${unit(x)}`, place] as const,
    );
    const told = rows.map(
      ([head, place]) =>
        `${head}; ${lines.map((line) => `${line.name} ${read(valueAt(line, place), yBegin)} ${unit(y)}`).join(', ')}`,
    );
    if (a !== undefined && b !== undefined) {
      const apart = lines.map((line) => {
        const [from, to] = [valueAt(line, a), valueAt(line, b)];
        return `${line.name} ${from === null || to === null ? '–' : number(to - from)} ${unit(y)}`;
      });
      told.push(`B − A: ${number(b - a)} ${unit(x)}; ${apart.join(', ')}`);
    }
    this.readings.replaceChildren(
      ...told.map((text) => Object.assign(document.createElement('div'), { textContent: text })),
    );
  }
}

/** One side of a diagram; only what stands beside a curve is read within a turn, the curve goes on. */
function side(label: string, begin: number | null): uPlot.Axis {
  const common = { ...AXIS, label: signs(label), labelSize: 16, labelFont: AXIS.font };
  return begin == null ? common : { ...common, values: (_, ticks) => ticks.map((tick) => read(tick, begin)) };
}

/** The range of all samples reaches to the limits, as on paper; who zooms in sees what was asked for. */
function withLimits(panel: Panel, low: number | null, high: number | null): [number, number] {
  const [a, b] = [low ?? 0, high ?? 0];
  const values = panel.lines.flatMap((line) => line.y);
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
