/** What a report carries for each figure with a recording (`engineering/report/recording.py`). */

export interface Line {
  name: string;
  colour: string;
  dashes: number[];
  width: number;
  x: number[];
  y: (number | null)[];
  /** Of a channel of the scope: a scale of its own. Null in its values is a gap. */
  own?: Scale;
}
export interface Scale {
  unit: string;
  /** As set; null for what the values need. */
  range: [number, number] | null;
  /** A flag or state: it keeps its value until the next sample. */
  steps: boolean;
  /** Where the turn begins that it is read in; null for any other number. */
  begin: number | null;
  /** Words of a state by its number. */
  labels: readonly string[];
}
/** A moment with a word. */
export interface Mark {
  x: number;
  label: string;
  colour: string;
}
export interface Panel {
  title: string;
  x: string;
  y: string;
  /** Where the turn begins that angles of the axis are read in on this side; null for any other number. */
  xBegin: number | null;
  yBegin: number | null;
  limits: number[];
  lines: Line[];
  marks?: Mark[];
  /** Index of the line with a scale of its own that stands at the side. */
  side?: number;
}
export interface Recording {
  columns: number;
  panels: Panel[];
}

/** The recordings of a page by the id of their figure. */
export function recordings(page: Document): Map<string, Recording> {
  const found = new Map<string, Recording>();
  for (const figure of page.querySelectorAll('figure.recorded')) {
    const text = figure.querySelector('script.recording')?.textContent;
    if (text) found.set(figure.id, JSON.parse(text) as Recording);
  }
  return found;
}

/** The curves of another run, dashed, in the panels of the same place and unit. */
export function overlaid(own: Recording, other: Recording, name: string): Recording {
  const panels = own.panels.map((panel, i) => {
    const beside = other.panels[i];
    if (beside === undefined || beside.y !== panel.y || beside.x !== panel.x) return panel;
    const more = beside.lines.map((line) => ({
      ...line,
      name: `${line.name} (${name})`,
      dashes: [2, 3],
      width: 1.2,
    }));
    return { ...panel, lines: [...panel.lines, ...more] };
  });
  return { ...own, panels };
}
