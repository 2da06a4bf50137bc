"""A report as a browser shows and prints it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page

# Content of an A4 page between margins of 14 mm, in CSS pixels.
PAGE_WIDTH_PX = 182.0 / 25.4 * 96.0
# What must lie on one page. A table may go on where it is longer than a page.
WHOLE = "figure, table.required, .signatures, .identity, .tiles, .note, .warnings"
_MARK = """(whole) => {
  const marks = [];
  document.querySelectorAll(whole).forEach((element, k) => {
    for (const [end, place] of [['first', 'afterbegin'], ['last', 'beforeend']]) {
      const id = `mark-${k}-${end}`;
      const row = end === 'first' ? 'tr:first-of-type > *' : 'tbody tr:last-of-type > *';
      const host = element.tagName === 'TABLE' ? element.querySelector(row) : element;
      host.insertAdjacentHTML(place, `<a id="${id}"></a>`);
      marks.push(`<a href="#${id}">.</a>`);
    }
  });
  document.body.insertAdjacentHTML('beforeend', marks.join(' '));
  return [...document.querySelectorAll(whole)].map((each) => each.id || each.className || each.tagName);
}"""
_WIDE = """(width) => [...document.body.querySelectorAll('*')]
  .filter((element) => !element.closest('svg, .charts, script, style') || element.tagName === 'svg')
  .filter((element) => element.getClientRects().length > 0 && element.getBoundingClientRect().right > width + 1)
  .map((element) => `${element.tagName} ${element.className} ${element.textContent.slice(0, 40)}`)"""


@contextmanager
def opened(browser: Browser, file: Path, **options: bool) -> Iterator[Page]:
    """The page of a report; whatever it asks for beside itself, and whatever its script complains of, is an error."""
    context = browser.new_context(viewport={"width": 1000, "height": 1200}, **options)
    page = context.new_page()
    asked: list[str] = []
    wrong: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.goto(file.as_uri())
    yield page
    assert asked == [file.as_uri()]
    assert wrong == []
    context.close()


def broken(page: Page) -> list[str]:
    """Figures and blocks that lie on two printed pages; changes the page."""
    names = page.evaluate(_MARK, WHOLE)
    pdf = page.pdf(prefer_css_page_size=True)
    places = dict(re.findall(rb"/(mark-\d+-(?:first|last)) \[(\d+) 0 R", pdf))
    ends = [[places[b"mark-%d-%s" % (k, end)] for end in (b"first", b"last")] for k in range(len(names))]
    return [name for name, (first, last) in zip(names, ends, strict=True) if first != last]


def too_wide(page: Page) -> list[str]:
    """What sticks out of the printed page; leaves the page as it is printed."""
    page.emulate_media(media="print")
    page.set_viewport_size({"width": int(PAGE_WIDTH_PX), "height": 1000})
    found: list[str] = page.evaluate(_WIDE, PAGE_WIDTH_PX)
    return found
