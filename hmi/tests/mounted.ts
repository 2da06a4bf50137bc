// One part of the page at a time, mounted with the tags that it is to show.
import { flushSync, mount, unmount, type Component } from 'svelte';
import { link } from '../src/lib/link.svelte';
import type { Tags } from '../src/lib/tables';

let shown: Record<string, unknown> | undefined;

/** Mount a part in place of the one before; the body of the page. */
export function show<P extends Record<string, unknown>>(
  part: Component<P>,
  props: P,
  tags: Partial<Tags>,
): HTMLElement {
  if (shown) void unmount(shown);
  link.tags = tags;
  shown = mount(part, { target: document.body, props });
  flushSync();
  return document.body;
}

/** Take the part away, and all that is left of it. */
export function leave(): void {
  if (shown) void unmount(shown);
  shown = undefined;
  document.body.innerHTML = '';
}

/** The button with this text. */
export function key(name: string): HTMLButtonElement {
  const found = [...document.querySelectorAll('button')].find((each) => each.textContent?.trim() === name);
  if (found === undefined) throw new Error(`no button ${name}`);
  return found;
}
