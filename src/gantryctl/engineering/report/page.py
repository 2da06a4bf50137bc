"""Reports as one HTML page: a template that extends `frame.html.j2`, nothing fetched, readable in print."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

FRAME: Final = Path(__file__).parent / "templates"


def render_page(template: Path, view: dict[str, Any]) -> str:
    """The page of a template, which sees words and numbers only."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader((template.parent, FRAME)),
        autoescape=True,
        # A name that the view lacks is a fault of the program, never a blank on the page.
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(words=words, signed=signed)
    return environment.get_template(template.name).render(view)


def words(text: str) -> str:
    """A sentence with the signs a page can show; its first letter large."""
    for plain, sign in ((" deg/s2", "°/s²"), (" deg/s", "°/s"), (" deg", "°"), ("+-", "±")):
        text = text.replace(plain, sign)
    return text[:1].upper() + text[1:]


def signed(text: str) -> str:
    """A number with a minus sign instead of a hyphen."""
    return text.replace("-", "−")
