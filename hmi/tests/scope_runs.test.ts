// The scope of the page at a service that is played by the test: what it asks for, what it counts, when it ends.
import { beforeEach, expect, test, vi } from 'vitest';

interface Rows {
  from: number;
  next: number;
  newest: number;
  newest_s: number;
  utc_s: number;
  period_s: number | null;
  tags: Record<string, number[]>;
}
vi.useFakeTimers();
const TAGS = ['vel_act_deg_s', 'torque_act_nm'].map((name) => ({
  name,
  unit: '',
  type: 'float',
  labels: [],
}));
let asked: string[] = [];
let answers: Rows[] = [];
let held: Promise<void> = Promise.resolve();
vi.stubGlobal('fetch', async (address: string) => {
  if (address.endsWith('/tags')) return new Response(JSON.stringify(TAGS));
  asked.push(address);
  const found = answers.shift();
  await held;
  return found ? new Response(JSON.stringify(found)) : new Response('', { status: 503 });
});
const { link } = await import('../src/lib/link.svelte');
const { scope } = await import('../src/lib/scope/scope.svelte');
const pass = (ms: number): Promise<unknown> => vi.advanceTimersByTimeAsync(ms);

/** Rows of 1 ms with these numbers; the speed rises over 0.5 deg/s at number `step`. */
function rows(from: number, count: number, step: number, zero_utc_s: number): Rows {
  const numbers = Array.from({ length: count }, (_, i) => from + i);
  const newest = from + count;
  return {
    from,
    next: newest,
    newest,
    newest_s: newest / 1000,
    utc_s: zero_utc_s + newest / 1000,
    period_s: 0.001,
    tags: { time_s: numbers.map((n) => n / 1000), vel_act_deg_s: numbers.map((n) => (n < step ? 0 : 1)) },
  };
}

beforeEach(async () => {
  scope.stop();
  await pass(2000);
  [asked, answers, held] = [[], [], Promise.resolve()];
  await scope.load();
  link.tags = { time_s: 1 };
  Object.assign(scope, { mode: 'normal', window_s: 0.1, before_percent: 20, capture: null });
});

test('rows that came too late are counted over all of a run, and those of the run before are not', async () => {
  answers = [rows(0, 3000, 9999, 0), rows(1100, 100, 9999, 0), rows(1250, 100, 9999, 0)];
  scope.start();
  await pass(400);
  expect(asked.map((address) => address.split('?')[1])).toEqual([undefined, 'from=1000', 'from=1200']);
  expect([scope.missed, scope.scan_s]).toEqual([150, 0.001]);
  answers = [{ ...rows(1350, 0, 9999, 0), tags: { time_s: [] } }]; // power is off: no rows of the scan
  await pass(300);
  expect([scope.missed, scope.scan_s]).toEqual([150, null]);
  scope.stop();
  await pass(1000);
  scope.start();
  expect(scope.missed).toBe(0);
});

test('a single picture stays, with the time of day of the controller that runs now', async () => {
  answers = [rows(0, 1000, 9999, 500), rows(1000, 100, 9999, 500)];
  scope.start();
  await pass(300);
  scope.stop();
  await pass(1000);
  // The controller has started anew: its time 0 is 300 s later.
  scope.mode = 'single';
  answers = [rows(0, 1000, 9999, 800), rows(1000, 400, 1200, 800)];
  scope.start();
  await pass(100);
  const { capture } = scope;
  expect([scope.running, capture?.title]).toEqual([false, 'vel_act_deg_s']);
  expect(capture?.utc_s).toBeCloseTo(801.2, 6);
  answers = [rows(1400, 400, 1500, 800)];
  await pass(1000);
  expect(scope.capture).toBe(capture);
});

test('what was recorded is shown until somebody starts again', async () => {
  answers = [rows(0, 1000, 9999, 0), rows(1000, 400, 1200, 0)];
  scope.start();
  const recorded = { title: 'recorded', machine: '', utc_s: null, channels: [], marks: [] };
  scope.show(recorded);
  await pass(1000);
  expect([scope.running, scope.capture?.title]).toEqual([false, 'recorded']);
});

test('an answer that a run before has asked for begins no second row of questions', async () => {
  let give = (): void => {};
  held = new Promise((resolve) => (give = resolve));
  answers = Array.from({ length: 40 }, () => rows(0, 1000, 9999, 0));
  scope.start();
  scope.stop();
  scope.start();
  expect(asked).toHaveLength(2);
  give();
  await pass(900);
  // Of the run that goes on: its rows at once, then every 250 ms.
  expect(asked).toHaveLength(2 + 1 + 3);
});
