// The whole page: keys of the keyboard, and what leaving an area ends.
import { flushSync, mount, unmount } from 'svelte';
import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Reply, Welcome } from '../src/lib/protocol';

vi.stubGlobal('fetch', () => Promise.resolve(new Response('[]', { status: 503 })));
const { default: App } = await import('../src/App.svelte');
const { hold } = await import('../src/lib/hold.svelte');
const { link } = await import('../src/lib/link.svelte');
const { sight } = await import('../src/lib/sight.svelte');
let shown: Record<string, unknown>;
const sent: string[] = [];

beforeEach(() => {
  vi.spyOn(sight, 'look').mockImplementation(() => {});
  sight.roomy = sight.stop = true;
  sent.length = 0;
  vi.spyOn(link, 'send').mockImplementation((kind) => {
    sent.push(kind);
    return Promise.resolve({ ok: true, code: '', text: '', values: {} } as Reply);
  });
  vi.spyOn(hold, 'release').mockReturnValue();
  link.session = { user: 'anna', person: 'Anna', role: 'service', may: [] };
  link.welcome = { client: 'c1', may: [] } as unknown as Welcome;
  link.stale = false;
  location.hash = '#settings';
  shown = mount(App, { target: document.body });
  flushSync();
});
afterEach(() => {
  void unmount(shown);
  document.body.innerHTML = '';
  vi.restoreAllMocks();
});

const area = (): string | null | undefined => document.querySelector('#area')?.getAttribute('data-area');
function press(key: string, more: KeyboardEventInit = {}, target: EventTarget = document.body): void {
  target.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, ...more }));
  flushSync();
}

test('Esc is Stop: in a field, without fresh data, with help open; once for each press', () => {
  press('Escape');
  press('Escape', { repeat: true });
  expect(sent).toEqual(['stop']);
  press('Escape', {}, document.querySelector('#area input')!);
  link.stale = true;
  press('Escape');
  press('F1');
  press('Escape', { shiftKey: true });
  expect(sent).toEqual(['stop', 'stop', 'stop', 'stop']);
});

test('digits choose the area, but not while a person types; leaving one lets a held key go', () => {
  expect(area()).toBe('settings');
  press('4', {}, document.querySelector('#area input')!);
  press('4', { ctrlKey: true });
  expect([area(), vi.mocked(hold.release).mock.calls]).toEqual(['settings', []]);
  press('3');
  expect(hold.release).not.toHaveBeenCalled(); // it is shown already
  press('4');
  expect([area(), vi.mocked(hold.release).mock.calls]).toEqual(['alarms', [['left']]]);
  press('9');
  expect(area()).toBe('alarms');
  expect(sent).toEqual([]);
});

test('a window without room ends a held key, and has Stop still', () => {
  sight.roomy = false;
  flushSync();
  expect(hold.release).toHaveBeenCalledWith('unseen');
  for (const key of document.querySelectorAll<HTMLElement>('[data-stop]')) key.click();
  expect(sent).toEqual(['stop', 'quick_stop']);
});

test('Stop is no button that waits for anything', () => {
  link.stale = true;
  link.open = false;
  flushSync();
  const keys = [...document.querySelectorAll<HTMLButtonElement>('[data-stop]')];
  expect(keys.map((each) => each.disabled)).toEqual([false, false]);
  expect(document.querySelector('[data-stale]')?.getAttribute('data-stale')).toBe('true');
  expect(document.querySelector('[data-testid=stale]')).not.toBeNull();
});
