import { flushSync, mount, unmount } from 'svelte';
import { afterEach, beforeEach, describe, expect, test, vi } from 'vitest';
import { link } from '../src/lib/link.svelte';
import { sight } from '../src/lib/sight.svelte';
import { whyNot } from '../src/lib/rules';
import Setting from '../src/parts/Setting.svelte';
import Stops from '../src/parts/Stops.svelte';
import type { Reply, Welcome } from '../src/lib/protocol';

const MINE = 'mine';
const DONE = { ok: true, code: '', text: '', values: {} } as Reply;
let shown: Record<string, unknown> | undefined;

beforeEach(() => {
  link.stale = false;
  link.welcome = { client: MINE, may: ['set_speed', 'power', 'commission', 'stop'] } as unknown as Welcome;
  link.tags = { authority_client: MINE, speed_setting_deg_s: 0.6 };
});
afterEach(() => {
  if (shown) void unmount(shown);
  shown = undefined;
  vi.restoreAllMocks();
});

function setting(): { field: HTMLInputElement; button: HTMLButtonElement; why: () => string } {
  const props = {
    label: 'Speed',
    tag: 'speed_setting_deg_s',
    action: 'set_speed',
    unit: 'r/min',
    scale: 6,
  } as const;
  shown = mount(Setting, { target: document.body, props: { ...props, decimals: 3, low: 0.6, high: 6 } });
  flushSync();
  const [field, button] = [document.querySelector('input'), document.querySelector('button')];
  if (field === null || button === null) throw new Error('no field or no button');
  const told = button.getAttribute('aria-describedby') ?? '';
  return { field, button, why: () => document.getElementById(told)?.textContent?.trim() ?? '' };
}
function type(field: HTMLInputElement, text: string): void {
  field.value = text;
  field.dispatchEvent(new Event('input', { bubbles: true }));
  flushSync();
}

describe('a setting', () => {
  test('shows the value in force, also when that changes, until a person types', () => {
    const { field, button, why } = setting();
    expect([field.value, button.disabled, why()]).toEqual(['0.100', true, 'It is in force.']);
    link.tags = { ...link.tags, speed_setting_deg_s: 3 };
    flushSync();
    expect(field.value).toBe('0.500');
    type(field, '0.2');
    link.tags = { ...link.tags, speed_setting_deg_s: 6 };
    flushSync();
    expect([field.value, button.disabled, why()]).toEqual(['0.2', false, '']);
  });

  test.each([
    ['0.05', 'Outside the allowed range.'],
    ['1.01', 'Outside the allowed range.'],
    ['fast', 'Type a number.'],
  ])('%s is not offered, and the reason stands beside the button', (text, reason) => {
    const { field, button, why } = setting();
    type(field, text);
    expect([button.disabled, why()]).toEqual([true, reason]);
  });

  test('is sent in the unit of the tag, and shows what is in force again', async () => {
    const sent = vi.spyOn(link, 'send').mockResolvedValue(DONE);
    const { field, button } = setting();
    type(field, '0,25');
    button.click();
    await vi.waitFor(() =>
      expect(sent).toHaveBeenCalledWith('set', { tag: 'speed_setting_deg_s', value: 1.5 }),
    );
    await vi.waitFor(() => expect(field.value).toBe('0.100'));
  });

  test.each([
    ['off', 'No connection: the command was not sent. Use the stop devices at the machine.'],
    ['silent', 'No answer from the controller.'],
  ])('that has no reply (%s) says so, and keeps what was typed', async (text, words) => {
    vi.spyOn(link, 'send').mockResolvedValue({ ...DONE, ok: false, text });
    const { field, button, why } = setting();
    type(field, '0.25');
    button.click();
    await vi.waitFor(() => expect(why()).toBe(words));
    expect(field.value).toBe('0.25');
  });
});

test('a range is told in digits that are allowed: rounded to the inside where two decimals are not enough', () => {
  // 0.1998 deg/s are 0.0333 r/min, which 0.03 and 0.033 are below; 1.6 deg/s are 0.26667 r/min, which 0.267 is above.
  const range = (low: number, high: number, scale: number): string | undefined => {
    if (shown) void unmount(shown);
    const props = { label: 'x', tag: 'acc_setting_deg_s2', action: 'set_acceleration', unit: 'u' } as const;
    shown = mount(Setting, { target: document.body, props: { ...props, scale, decimals: 3, low, high } });
    flushSync();
    return document.querySelector('small')?.textContent?.split(' u ')[0]?.trim();
  };
  expect(range(0.1998, 1.6, 6)).toBe('0.034 … 0.266');
  expect(range(0.02497, 0.2497, 1)).toBe('0.025 … 0.249');
  expect(range(0.6, 6, 6)).toBe('0.10 … 1.00');
  expect(range(0.1998, 1.998, 6)).toBe('0.034 … 0.333');
});

test('a limit that is not allowed itself is outside', () => {
  const outside = (open: boolean, text: string): boolean => {
    if (shown) void unmount(shown);
    const props = { label: 'x', tag: 'increment_deg', action: 'set_speed', unit: '°' } as const;
    shown = mount(Setting, {
      target: document.body,
      props: { ...props, decimals: 3, low: 0, high: 5, open },
    });
    link.stale = false;
    flushSync();
    type(document.querySelector('input')!, text);
    return document.querySelector('button')!.disabled;
  };
  expect([outside(true, '0'), outside(true, '0.001'), outside(true, '5'), outside(true, '5.001')]).toEqual([
    true,
    false,
    false,
    true,
  ]);
  expect(outside(false, '0')).toBe(false);
});

test('what was done leaves no refusal behind', async () => {
  const send = vi.spyOn(link, 'send').mockResolvedValue({ ...DONE, ok: false, text: 'off' });
  const { field, button, why } = setting();
  type(field, '0.25');
  button.click();
  await vi.waitFor(() => expect(why()).toContain('No connection'));
  send.mockResolvedValue(DONE);
  link.stale = false;
  flushSync();
  button.click();
  await vi.waitFor(() => expect(field.value).toBe('0.100'));
  expect(why()).not.toContain('No connection');
});

test('a refusal goes when another value is typed', async () => {
  vi.spyOn(link, 'send').mockResolvedValue({ ...DONE, ok: false, text: 'off' });
  const { field, button, why } = setting();
  type(field, '0.25');
  button.click();
  await vi.waitFor(() => expect(why()).toContain('No connection'));
  link.stale = false;
  type(field, '9');
  expect(why()).toBe('Outside the allowed range.');
});

describe('motion and Stop', () => {
  test('what starts motion is not offered while Stop is out of sight; what stops always is', () => {
    sight.look(); // no Stop in this document
    expect(whyNot('power')).toBe('why_no_stop');
    expect(whyNot('commission')).toBe('why_no_stop'); // a step may move the axis
    expect(whyNot('set_speed')).toBe('');
    shown = mount(Stops, { target: document.body });
    const keys = [...document.querySelectorAll<HTMLElement>('[data-stop]')];
    const box = new DOMRect(10, 10, 100, 50);
    for (const key of keys) key.getBoundingClientRect = () => box;
    document.elementFromPoint = () => keys[0] ?? null;
    sight.look();
    expect(whyNot('power')).toBe('why_no_stop'); // the first lies over the second
    for (const [i, key] of keys.entries())
      key.getBoundingClientRect = () => new DOMRect(10 + 200 * i, 10, 100, 50);
    document.elementFromPoint = (x: number) => keys[x > 150 ? 1 : 0] ?? null;
    sight.look();
    expect(whyNot('power')).toBe('');
    for (const key of keys) key.getBoundingClientRect = () => new DOMRect(innerWidth - 50, 10, 100, 50);
    sight.look();
    expect(whyNot('power')).toBe('why_no_stop');
    // Half of them below the window, at its left edge and above it, each still on top in its middle.
    for (const [left, top] of [
      [10, innerHeight - 30],
      [-30, 10],
      [10, -20],
    ] as const) {
      for (const [i, key] of keys.entries())
        key.getBoundingClientRect = () => new DOMRect(left + 200 * i, top, 100, 50);
      sight.look();
      expect(whyNot('power')).toBe('why_no_stop');
    }
  });

  test('a press is sent whatever the state is', () => {
    const sent = vi.spyOn(link, 'send').mockResolvedValue(DONE);
    link.stale = true;
    shown = mount(Stops, { target: document.body });
    for (const key of document.querySelectorAll<HTMLElement>('[data-stop]')) key.click();
    expect(sent.mock.calls.map(([type]) => type)).toEqual(['stop', 'quick_stop']);
  });
});
