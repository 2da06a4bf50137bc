"""Pictures of a step as SVG."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

from gantryctl.commissioning.pictures import Picture
from gantryctl.engineering.report.figures import GREEN, GREY, RED
from gantryctl.engineering.report.svg import BLUE, ORANGE, WIDTH_IN, styled, svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEIGHT_IN = 1.9
# The page is printed in grey, too: what is compared differs in its dashes as well.
_DASHES = ("-", (0, (4, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))


def picture_svg(picture: Picture, name: str) -> str:
    """The picture as an `<svg>` element; `name` is no other picture's on the page."""
    return svg(_drawn(picture), name)


@styled
def _drawn(picture: Picture) -> Figure:
    from matplotlib.figure import Figure as NewFigure

    figure = NewFigure(figsize=(WIDTH_IN, _HEIGHT_IN), layout="constrained")
    grid = figure.subplots(1, len(picture.panels), squeeze=False)
    for ax, panel in zip(grid[0], picture.panels, strict=True):
        one = len(panel.lines) == 1
        looks = cycle([(BLUE, "-")] if one else zip((GREY, BLUE, ORANGE, GREEN), _DASHES, strict=True))
        for curve, (colour, dashes) in zip(panel.lines, looks, strict=False):
            ax.plot(curve.x, curve.y, color=colour, ls=dashes, lw=1.0, label=curve.name)
        for level in panel.limits:
            ax.axhline(level, color=RED, lw=0.8, ls=(0, (4, 2)))
        ax.set_xlabel(_signs(panel.x_label))
        ax.set_ylabel(_signs(panel.y_label))
        if not one:
            ax.legend(loc="best", handlelength=1.8, frameon=False, fontsize=6.5)
    return figure


def _signs(text: str) -> str:
    return text.replace("deg/s", "°/s").replace("deg", "°")
