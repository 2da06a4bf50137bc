// Recordings of the service as pictures: it reads them, thinned so that no peak is lost.
import { periods, type Capture } from './capture';
import type { Shown } from './acquisition';

export interface Recording {
  id: string;
  name: string;
  size: number;
}
interface Answer {
  name: string;
  machine: string;
  utc_s: number | null;
  end_s: number;
  columns: { name: string; unit: string; x: number[]; y: (number | null)[] }[];
}
export interface Opened {
  capture: Capture;
  /** Time of its last row, from its first. */
  end_s: number;
}

/** The recordings, newest first; the status of an answer that has none. */
export async function recordings(): Promise<Recording[] | number> {
  const answer = await fetch('/api/v1/traces').catch(() => null);
  return answer?.ok ? ((await answer.json()) as Recording[]) : (answer?.status ?? 0);
}

/** One of them between two times from its first row, to its end without the second; the status of a refusal. */
export async function opened(
  id: string,
  from_s: number,
  to_s: number | null,
  tags: readonly Shown[],
): Promise<Opened | number> {
  const ms = (time_s: number): string => Math.round(1000 * Math.max(0, time_s)).toFixed(0);
  const until = to_s === null ? '' : `&to=${ms(to_s)}`;
  const address = `/api/v1/traces/${encodeURIComponent(id)}/columns?from=${ms(from_s)}${until}`;
  const answer = await fetch(address).catch(() => null);
  return answer?.ok ? captureOf((await answer.json()) as Answer, tags) : (answer?.status ?? 0);
}

export function captureOf(found: Answer, tags: readonly Shown[]): Opened {
  const channels = found.columns.map(({ name, unit, x, y }) => {
    const tag = tags.find((each) => each.name === name);
    return {
      name,
      unit,
      steps: tag?.steps ?? false,
      labels: tag?.labels ?? [],
      begin: tag?.begin ?? null,
      periods_s: periods(x),
      x,
      y,
    };
  });
  const { name, machine, utc_s, end_s } = found;
  return { capture: { title: name, machine, utc_s, channels, marks: [] }, end_s };
}
