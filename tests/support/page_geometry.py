"""What is wrong with a page as it stands in the browser, found by measuring boxes: one look, a list of sentences.

Text is measured as it is drawn, by the boxes of its lines, without the leading above and below the letters.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from playwright.sync_api import Page

AXE = Path(__file__).resolve().parents[2] / "hmi" / "node_modules" / "axe-core" / "axe.min.js"
TARGET_PX = 44
"""A finger: the least width and height of whatever can be pressed (WCAG 2.2, 2.5.5)."""

_MEASURE = r"""(target) => {
  const found = [];
  const near = 1.5;  // px: borders, and what rounding of positions makes
  const called = (e) => {
    if (e.tagName === 'MAIN') return '<main>';
    const words = (e.getAttribute?.('aria-label') || e.textContent || '').trim().replace(/\s+/g, ' ').slice(0, 40);
    return `<${e.tagName.toLowerCase()} ${e.id || e.className?.baseVal || e.className || ''}> "${words}"`;
  };
  const seen = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  const style = (e) => getComputedStyle(e);
  const flows = (value) => value === 'auto' || value === 'scroll';
  const clips = (value) => value === 'hidden' || value === 'clip';
  const parents = (e) => { const all = []; for (let p = e; p; p = p.parentElement) all.push(p); return all; };
  const scroller = (e) => parents(e).find((p) => flows(style(p).overflowX) || flows(style(p).overflowY)) ?? null;
  const meet = (a, b) => ({
    left: Math.max(a.left, b.left), right: Math.min(a.right, b.right),
    top: Math.max(a.top, b.top), bottom: Math.min(a.bottom, b.bottom),
  });

  // Lines of text, with the element that they are in and the box that scrolls them.
  const lines = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const e = node.parentElement;
    if (!node.data.trim() || !seen(e) || e.closest('script, style, option')) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const r of range.getClientRects()) {
      if (r.width < 1 || r.height < 1) continue;
      const leading = 0.14 * r.height;
      lines.push({
        node, e, scroller: scroller(e),
        box: { left: r.left, right: r.right, top: r.top + leading, bottom: r.bottom - leading },
      });
    }
  }
  for (const line of lines) {
    line.shown = line.box;
    for (const p of parents(line.e))
      if (style(p).overflowX !== 'visible') line.shown = meet(line.shown, p.getBoundingClientRect());
  }
  for (const [i, a] of lines.entries()) for (const b of lines.slice(i + 1)) {
    if (a.node === b.node) continue;
    const over = a.scroller === b.scroller ? meet(a.box, b.box) : meet(a.shown, b.shown);
    if (over.right - over.left > near && over.bottom - over.top > near)
      found.push(`overlap: ${called(a.e)} and ${called(b.e)}`);
  }
  for (const { e, box } of lines) {
    let [across, down] = [true, true];  // what can be scrolled to is not cut off
    for (const p of parents(e)) {
      const edge = p.getBoundingClientRect();
      const { overflowX, overflowY } = style(p);
      across &&= !flows(overflowX);
      down &&= !flows(overflowY);
      const out = (across && (box.left < edge.left - near || box.right > edge.right + near))
        || (down && (box.top < edge.top - near || box.bottom > edge.bottom + near));
      if (out && (clips(overflowX) || clips(overflowY))) found.push(`clipped: ${called(e)} by ${called(p)}`);
      else if (out && p.matches('button, .panel, td, th, li, header, footer, .overview, .value'))
        found.push(`spills: ${called(e)} out of ${called(p)}`);
    }
  }
  for (const e of document.querySelectorAll('input, select, button')) {
    if (seen(e) && e.scrollWidth > e.clientWidth + near) found.push(`clipped: inside ${called(e)}`);
  }
  for (const e of document.querySelectorAll('body *')) {
    if (!seen(e) || e.closest('svg') !== null && e.tagName !== 'svg') continue;
    const r = e.getBoundingClientRect();
    const own = e.parentElement === null ? null : scroller(e.parentElement);
    const wide = own !== null && own.matches('.scroll, [data-scroll-x]');
    if (r.width > 0 && !wide && (r.left < -near || r.right > innerWidth + near)) found.push(`outside: ${called(e)}`);
  }
  if (document.documentElement.scrollHeight > innerHeight + near) found.push('the page itself scrolls');
  for (const e of document.querySelectorAll('button, select, input, summary, a[href]')) {
    const r = e.getBoundingClientRect();
    if (seen(e) && (r.width < target - 0.5 || r.height < target - 0.5))
      found.push(`small: ${called(e)} ${r.width.toFixed(0)} x ${r.height.toFixed(0)}`);
  }
  for (const key of ['stop', 'quick_stop']) {
    const e = document.querySelector(`[data-stop=${key}]`);
    if (e === null) { found.push(`no ${key}`); continue; }
    const r = e.getBoundingClientRect();
    const inside = r.left >= 0 && r.top >= 0 && r.right <= innerWidth && r.bottom <= innerHeight;
    const hit = document.elementFromPoint((r.left + r.right) / 2, (r.top + r.bottom) / 2);
    if (!inside || !e.contains(hit)) found.push(`not in sight: ${key}, there is ${hit && called(hit)}`);
  }
  return [...new Set(found)];
}"""

_GREY = r"""() => [...document.querySelectorAll('button:disabled')].filter((e) => e.checkVisibility()).filter((e) => {
  const told = document.getElementById(e.getAttribute('aria-describedby') ?? '');
  return !(told?.checkVisibility() && told.innerText.trim());
}).map((e) => (e.getAttribute('aria-label') || e.innerText).trim())"""


def faults_of_layout(page: Page) -> list[str]:
    """Text over text, text cut off, what lies outside the window, small targets, and a Stop that cannot be pressed."""
    found: list[str] = page.evaluate(_MEASURE, TARGET_PX)
    return found


def grey_without_reason(page: Page) -> list[str]:
    """Names of buttons that are not offered and have no visible text that says why."""
    found: list[Any] = page.evaluate(_GREY)
    return [str(each) for each in found]


def heavy_findings(page: Page) -> list[str]:
    """What axe-core finds that is serious or critical."""
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found: list[dict[str, Any]] = page.evaluate(
        "async () => (await axe.run(document, { resultTypes: ['violations'] })).violations"
    )
    return [
        f"{each['impact']} {each['id']}: {[node['target'] for node in each['nodes']][:5]}"
        for each in found
        if each["impact"] in ("serious", "critical")
    ]
