"""Reports as one HTML page: every one in the same frame, nothing fetched, printed on A4."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.engineering.report.head import Head, Required, Verdict
from gantryctl.engineering.report.recording import ShownFigure
from gantryctl.engineering.report.text import TextTable

FRAME: Final = Path(__file__).parent / "templates"
SECTIONS: Final = FRAME / "sections.html.j2"
# Built from hmi/src/report by `make page`.
VIEWER: Final = Path(__file__).parent / "viewer"


class Section(NamedTuple):
    """A part of a report: sentences, then tables, then figures."""

    title: str
    sentences: Sequence[str] = ()
    tables: Sequence[TextTable] = ()
    figures: Sequence[ShownFigure] = ()


def render_page(
    template: Path, head: Head, verdict: Verdict, required: Sequence[Required], view: dict[str, Any]
) -> str:
    """The page of a template, which sees words and numbers only.

    Args:
        required: rows of the table of required values; empty for none.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader((template.parent, FRAME)),
        autoescape=True,
        # A name that the view lacks is a fault of the program, never a blank on the page.
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(words=words, signs=signs, signed=signed, css_text=css_text)
    script = (VIEWER / "viewer.js").read_text(encoding="utf-8")
    frame = {
        "head": head,
        "verdict": verdict,
        "required": required,
        "script": script,
        # The policy of the page names the one script that runs: a text smuggled into a table cannot.
        "script_hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        "script_style": (VIEWER / "viewer.css").read_text(encoding="utf-8"),
        "page_style": (FRAME / "frame.css").read_text(encoding="utf-8"),
    }
    return environment.get_template(template.name).render({**frame, **view})


def render_sections(
    head: Head,
    verdict: Verdict,
    required: Sequence[Required],
    *,
    title: str,
    subtitle: str,
    sections: Sequence[Section],
    tiles: Sequence[tuple[str, str, str]] = (),
) -> str:
    """The page of a report that is made of sentences, tables and figures.

    Args:
        tiles: the most important figures: value, name, remark.
    """
    view = {"title": title, "subtitle": subtitle, "tiles": tiles, "sections": sections}
    return render_page(SECTIONS, head, verdict, required, view)


def signs(text: str) -> str:
    """A text with the signs a page can show."""
    for plain, sign in ((" deg/s2", "°/s²"), (" deg/s", "°/s"), (" deg", "°"), ("+-", "±")):
        text = text.replace(plain, sign)
    return text


def words(text: str) -> str:
    """A sentence with the signs a page can show; its first letter large, unless it begins with a name."""
    text = signs(text)
    return text[:1].upper() + text[1:] if text.partition(" ")[0].isalpha() else text


def signed(text: str) -> str:
    """A number with a minus sign instead of a hyphen."""
    return text.replace("-", "−")


def css_text(text: str) -> str:
    """A text as a string of a style sheet (CSS Syntax 3, section 4.3.5), safe within a `style` element."""
    return '"' + "".join(c if c.isalnum() or c in " .,:_-+" else f"\\{ord(c):x} " for c in text) + '"'
