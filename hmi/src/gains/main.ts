import 'uplot/dist/uPlot.min.css';
import '../report/viewer.css';
import './gains.css';
import { Chart } from '../report/chart';
import type { Line, Panel } from '../report/recording';
import { answer, type Answer, type Axis, type Gains } from './answer';
import { Core } from './core';

declare global {
  /** What `tools/build_wasm.py` writes beside this script: a page that was opened as a file may not fetch. */
  var gantryctlCore: { axes: Axis[]; wasm: string };
}

interface Knob {
  key: keyof Gains;
  name: string;
  unit: string;
  /** As shown, of the SI value. */
  times: number;
}
const KNOBS: Knob[] = [
  { key: 'kvp_nm_s_per_rad', name: 'Kvp', unit: 'N m s/rad', times: 1 },
  { key: 'tvi_s', name: 'Tvi', unit: 'ms', times: 1e3 },
  { key: 'kpp_per_s', name: 'Kpp', unit: '1/s', times: 1 },
  { key: 'kvf', name: 'Kvf', unit: '%', times: 1e2 },
];
/** A knob goes from an eighth of the machine file's value to eight times of it; Kvf from 0 to 200 %. */
const RANGE = 8;

const OWN = '#1f5fa8';
const LOAD = '#c8620a';
const BEFORE = '#8a8f98';

const curve = (name: string, colour: string, dashes: number[], x: number[], y: number[]): Line => ({
  name,
  colour,
  dashes,
  width: 1,
  x,
  y: y.map((value) => (Number.isFinite(value) ? value : null)),
});
const panel = (title: string, y: string, lines: Line[]): Panel => ({
  title,
  x: 'time, s',
  y,
  xBegin: null,
  yBegin: null,
  limits: [],
  lines,
});

/** Two charts: what the gains of the machine file give, dashed, and what those of the knobs give. */
function panels(file: Answer, now: Answer): [Panel, Panel] {
  return [
    panel('a step of the set-point; 1 = the step', 'angle, steps', [
      curve('motor', OWN, [], now.step.time, now.step.motor),
      curve('load', LOAD, [], now.step.time, now.step.load),
      curve('load, as in the machine file', BEFORE, [4, 2], file.step.time, file.step.load),
    ]),
    panel('a move with the profile of the machine file', 'speed error of the load, deg/s', [
      curve('now', LOAD, [], now.move.time, now.move.error),
      curve('as in the machine file', BEFORE, [4, 2], file.move.time, file.move.error),
    ]),
  ];
}

function told(now: Answer): string {
  const percent = (part: number): string => `${(100 * part).toFixed(1)} %`;
  return (
    `The motor overshoots the step by ${percent(now.step.motorOver)}, the load by ${percent(now.step.loadOver)}; ` +
    `the largest speed error of the load in the move is ${now.move.largest.toPrecision(2)} deg/s.` +
    (now.limited ? ' The torque limit acts: these gains ask for more than the motor has.' : '')
  );
}

function made<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  values: Partial<HTMLElementTagNameMap[K]> = {},
): HTMLElementTagNameMap[K] {
  return Object.assign(document.createElement(tag), values);
}

async function begin(place: Element): Promise<void> {
  const { axes: all, wasm } = gantryctlCore;
  const core = await Core.load(Uint8Array.from(atob(wasm), (letter) => letter.charCodeAt(0)));
  const choice = made('select');
  choice.append(...all.map(({ name }) => made('option', { value: name, textContent: name })));
  const knobs = KNOBS.map((knob) => {
    const input = made('input', { type: 'range', min: '-1', max: '1', step: '0.01', value: '0' });
    return { knob, input, output: made('output') };
  });
  const rows = knobs.map(({ knob, input, output }) => {
    const label = made('label');
    label.append(made('span', { textContent: `${knob.name}, ${knob.unit}` }), input, output);
    return label;
  });
  const back = made('button', { type: 'button', textContent: 'As in the machine file' });
  const words = made('p');
  words.setAttribute('role', 'status');
  const charts = made('div', { className: 'charts' });
  const machine = made('label', { textContent: 'Machine ' });
  machine.append(choice);
  place.replaceChildren(machine, ...rows, back, words, charts);
  place.classList.add('live');

  let axis = all[0];
  let file: Answer | undefined;
  let drawn: Chart[] = [];
  const gains = (of: Axis): Gains => {
    const found = { ...of.gains };
    for (const { knob, input } of knobs) {
      const at = Number(input.value);
      found[knob.key] = knob.key === 'kvf' ? of.gains.kvf * (1 + at) : of.gains[knob.key] * RANGE ** at;
    }
    return found;
  };
  const show = (): void => {
    if (axis === undefined) return;
    const now = gains(axis);
    for (const { knob, output } of knobs) output.textContent = (knob.times * now[knob.key]).toPrecision(3);
    file ??= answer(core, axis, axis.gains);
    const found = answer(core, axis, now);
    words.textContent = told(found);
    const shown = panels(file, found);
    if (drawn.length === 0) {
      drawn = shown.map((each) => new Chart(each, 'gains'));
      charts.replaceChildren(...drawn.map((chart) => chart.element));
    }
    drawn.forEach((chart, k) => chart.show(shown[k]));
  };
  // A page draws as often as the screen does, however fast the knob is dragged.
  let asked = false;
  const soon = (): void => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      show();
    });
  };
  knobs.forEach(({ input }) => input.addEventListener('input', soon));
  const reset = (): void => {
    knobs.forEach(({ input }) => (input.value = '0'));
    soon();
  };
  back.addEventListener('click', reset);
  choice.addEventListener('change', () => {
    axis = all.find(({ name }) => name === choice.value);
    file = undefined;
    reset();
  });
  new ResizeObserver(() => drawn.forEach((chart) => chart.fit())).observe(charts);
  show();
}

for (const place of document.querySelectorAll('.gains-to-drag'))
  begin(place).catch((wrong: unknown) => place.append(made('p', { textContent: String(wrong) })));
