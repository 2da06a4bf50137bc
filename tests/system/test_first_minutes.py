"""The pictures of the first ten minutes show what the commands print, and the page has the same commands."""

from __future__ import annotations

import re
from pathlib import Path

from support.first_minutes import PLOTS, TERMINALS, terminals

TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"


def words(picture: str) -> str:
    """The text of a picture, without what Rich of another version may draw otherwise."""
    return re.sub(r"<[^>]+>|\s+", " ", picture.split("</style>")[1])


def test_the_pictures_are_what_the_commands_print() -> None:
    for name, picture in terminals().items():
        kept = (TUTORIALS / f"{name}.svg").read_text(encoding="utf-8")
        assert words(kept) == words(picture), "run: make screenshots"
        assert "url(http" not in kept


def test_the_page_shows_every_picture_under_its_commands() -> None:
    page = (TUTORIALS / "first-ten-minutes.md").read_text(encoding="utf-8")
    shown = {
        name: re.findall(r"(?m)^    (gantryctl .*)", part)
        for part in page.split("\n## ")
        for name in names(part)
    }
    assert {name: shown[name] for name in TERMINALS} == TERMINALS
    assert set(PLOTS) <= set(shown)


def names(part: str) -> list[str]:
    return re.findall(r"\((minute_\w+)\.(?:svg|png)\)", part)
