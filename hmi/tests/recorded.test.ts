import { flushSync, mount, unmount } from 'svelte';
import { afterEach, expect, test, vi } from 'vitest';
import { link } from '../src/lib/link.svelte';
import { captureOf } from '../src/lib/scope/recorded';
import { scope } from '../src/lib/scope/scope.svelte';
import Recorded from '../src/parts/scope/Recorded.svelte';
import type { Welcome } from '../src/lib/protocol';

const NAME = 'service-000012-20261122T151537123.parquet';
const FOUND = {
  name: NAME,
  machine: 'hust_gantry',
  utc_s: 1795360537.123,
  end_s: 30,
  columns: [
    { name: 'pos_act_deg', unit: 'deg', x: [0, 1, 2], y: [0, 1, null] },
    { name: 'motor_a', unit: 'A', x: [0, 2], y: [3, 4] },
  ],
};
let shown: Record<string, unknown> | undefined;

afterEach(() => {
  if (shown) void unmount(shown);
  shown = undefined;
  scope.capture = null;
  vi.unstubAllGlobals();
});

function page(): HTMLElement {
  document.body.innerHTML = '';
  shown = mount(Recorded, { target: document.body, props: { over: null } });
  flushSync();
  return document.body;
}
/** What the service answers, and what it was asked. */
function service(status = 200): string[] {
  const asked: string[] = [];
  vi.stubGlobal('fetch', (address: string) => {
    asked.push(address);
    const list = address.endsWith('/traces');
    const body = list ? [{ id: 'a b', name: NAME, size: 1, modified: '' }] : FOUND;
    return Promise.resolve(new Response(JSON.stringify(body), { status: list ? 200 : status }));
  });
  return asked;
}
async function settle(): Promise<void> {
  for (let n = 0; n < 5; n++) await Promise.resolve();
  await new Promise((done) => setTimeout(done));
  flushSync();
}
function button(name: string): HTMLButtonElement {
  const found = [...document.querySelectorAll('button')].find((each) => each.textContent?.trim() === name);
  if (found === undefined) throw new Error(`no button ${name}`);
  return found;
}
function fill(field: HTMLInputElement | HTMLSelectElement, value: string): void {
  field.value = value;
  field.dispatchEvent(new Event(field instanceof HTMLInputElement ? 'input' : 'change', { bubbles: true }));
  flushSync();
}
async function chosen(): Promise<void> {
  link.welcome = { may: ['traces'] } as unknown as Welcome;
  const body = page();
  button('List recordings').click();
  await settle();
  expect([button('Show').disabled, body.querySelector('#recorded-why')?.textContent]).toEqual([
    true,
    'Choose a recording.',
  ]);
  fill(body.querySelector('select')!, 'a b');
}

test('a recording is listed, chosen with its time, and shown as any capture', async () => {
  const asked = service();
  await chosen();
  const [from, to] = document.querySelectorAll('input');
  fill(from!, '1.5');
  fill(to!, '2');
  button('Show').click();
  await settle();
  expect(asked).toEqual(['/api/v1/traces', '/api/v1/traces/a%20b/columns?from=1500&to=2000']);
  expect(scope.capture?.title).toBe(NAME);
  expect(scope.channels).toEqual(['pos_act_deg', 'motor_a']);
  expect(to!.placeholder).toBe('30.0');
});

test('the whole of it without times; a damaged one is said to be', async () => {
  const asked = service(422);
  await chosen();
  button('Show').click();
  await settle();
  expect(asked.at(-1)).toBe('/api/v1/traces/a%20b/columns?from=0');
  expect(document.querySelector('[role=alert]')?.textContent).toContain('damaged');
  expect(scope.capture).toBe(null);
});

test('a role that may not read recordings is not offered any', () => {
  link.welcome = { may: ['view'] } as unknown as Welcome;
  expect(page().textContent?.trim()).toBe('');
});

test('what a tag is comes from the tag table, of other columns from the recording', () => {
  const tag = { name: 'pos_act_deg', unit: 'deg', steps: false, labels: [], begin: -180 };
  const { capture, end_s } = captureOf(FOUND, [tag]);
  expect(capture.channels.map(({ begin, unit, periods_s }) => [begin, unit, periods_s])).toEqual([
    [-180, 'deg', [1, 1]],
    [null, 'A', [2, 2]],
  ]);
  expect([capture.utc_s, end_s]).toEqual([1795360537.123, 30]);
});
