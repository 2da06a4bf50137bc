import 'uplot/dist/uPlot.min.css';
import './viewer.css';
import { Chart } from './chart';
import { overlaid, recordings, type Recording } from './recording';

/** The charts of one figure, above its printed picture. */
class Viewer {
  private readonly charts: Chart[];

  constructor(
    figure: Element,
    private readonly own: Recording,
  ) {
    const grid = document.createElement('div');
    grid.className = 'charts';
    grid.style.gridTemplateColumns = `repeat(${own.columns}, minmax(0, 1fr))`;
    this.charts = own.panels.map((panel) => new Chart(panel, figure.id));
    grid.append(...this.charts.map((chart) => chart.element));
    figure.prepend(grid);
    figure.classList.add('live');
    this.charts.forEach((chart) => chart.show());
    new ResizeObserver(() => this.charts.forEach((chart) => chart.fit())).observe(grid);
  }

  show(other: Recording | undefined, name: string): void {
    const shown = other === undefined ? this.own : overlaid(this.own, other, name);
    this.charts.forEach((chart, i) => chart.show(shown.panels[i]));
  }
}

const viewers = new Map<string, Viewer>();
for (const [id, recording] of recordings(document)) {
  const figure = document.getElementById(id);
  if (figure !== null) viewers.set(id, new Viewer(figure, recording));
}

/** The bar that lays another report of the same kind over this one. */
function overlayBar(): HTMLElement {
  const bar = document.createElement('div');
  bar.className = 'overlay';
  const label = document.createElement('label');
  label.textContent = 'Lay another report over this one: ';
  const input = Object.assign(document.createElement('input'), { type: 'file', accept: '.html' });
  const off = Object.assign(document.createElement('button'), { type: 'button', textContent: 'Without it' });
  const said = document.createElement('span');
  said.textContent = 'Drag to zoom, double click to see all, click to set cursors A and B.';
  const clear = (): void => {
    viewers.forEach((viewer) => viewer.show(undefined, ''));
    off.hidden = true;
  };
  off.hidden = true;
  off.onclick = (): void => {
    clear();
    input.value = '';
    said.textContent = '';
  };
  input.onchange = async (): Promise<void> => {
    const file = input.files?.[0];
    if (file === undefined) return;
    clear();
    const other = recordings(new DOMParser().parseFromString(await file.text(), 'text/html'));
    const shared = [...viewers.keys()].filter((id) => other.has(id));
    shared.forEach((id) => viewers.get(id)?.show(other.get(id), file.name));
    off.hidden = shared.length === 0;
    said.textContent =
      shared.length === 0
        ? `${file.name} has no recording of these figures.`
        : `${file.name}: ${shared.length} of ${viewers.size} figures, fine dashes.`;
  };
  label.append(input);
  bar.append(label, off, said);
  return bar;
}

if (viewers.size > 0) document.querySelector('header')?.after(overlayBar());
