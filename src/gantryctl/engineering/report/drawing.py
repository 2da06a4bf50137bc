"""A picture as a printed figure."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle, islice
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from gantryctl.engineering.report.figures import GREEN, GREY, RED, legend_below
from gantryctl.engineering.report.pictures import Panel, Picture
from gantryctl.engineering.report.svg import BLUE, ORANGE, new_figure, styled
from gantryctl.trace.figure import read_on
from gantryctl.trace.thinning import drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROW_IN: Final = 1.9
# Room for the legend and the label of the horizontal axis.
_FOOT_IN: Final = 0.5
# Across the page: 170 mm at 180 dots per inch.
_POINTS: Final = 1200
_COLOURS: Final = (BLUE, ORANGE, GREEN, "#cc79a7", "#56b4e9", "#e69f00")
# Lengths of stroke and gap, in widths of the line: the page is printed in grey, too.
_DASHES: Final[tuple[tuple[float, ...], ...]] = ((), (4, 2), (1, 1.5), (6, 2, 1, 2))


class Look(NamedTuple):
    """Colour and dashes of a curve; () for a line without gaps."""

    colour: str
    dashes: tuple[float, ...]
    width: float = 1.0


def looks_of(panel: Panel) -> list[Look]:
    """How the curves of a panel are told apart; a set-point is a pale band behind what follows it."""
    looks = (Look(colour, dashes) for colour, dashes in zip(cycle(_COLOURS), cycle(_DASHES), strict=False))
    if not panel.followed:
        return list(islice(looks, len(panel.lines)))
    return [Look(GREY, (), 2.4), *islice(looks, len(panel.lines) - 1)]


@styled
def draw_picture(picture: Picture) -> Figure:
    """The panels of a picture."""
    columns = picture.columns or len(picture.panels)
    rows = -(-len(picture.panels) // columns)
    figure = new_figure(rows * _ROW_IN + _FOOT_IN)
    grid = figure.subplots(rows, columns, squeeze=False, sharex=columns == 1 and rows > 1)
    for ax in grid.flat[len(picture.panels) :]:
        ax.set_axis_off()
    for ax, panel in zip(grid.flat, picture.panels, strict=False):
        _draw_panel(ax, panel, _POINTS // columns)
        if columns == 1 and ax is not grid[-1, 0]:
            ax.set_xlabel("")
    _name_curves(figure, picture, list(grid.flat))
    figure.align_ylabels()
    return figure


def _name_curves(figure: Figure, picture: Picture, axes: Sequence[Axes]) -> None:
    """One legend below where all panels have the same curves, else one above each panel with several."""
    several = [(ax, panel) for ax, panel in zip(axes, picture.panels, strict=False) if len(panel.lines) > 1]
    names = {tuple(curve.name for curve in panel.lines) for _, panel in several}
    if len(names) == 1:
        legend_below(figure, several[0][0])
        return
    for ax, panel in several:
        ax.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=min(len(panel.lines), 4 if picture.columns == 1 else 2),
            handlelength=1.8,
            borderaxespad=0.2,
            fontsize=6.5,
        )


def _draw_panel(ax: Axes, panel: Panel, points: int) -> None:
    from matplotlib.ticker import MaxNLocator

    # As many ticks whatever the height: else the layout, which changes it, can end between two sets of labels.
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    for order, (curve, look) in enumerate(zip(panel.lines, looks_of(panel), strict=True)):
        style = (0, look.dashes) if look.dashes else "-"
        kept = drawn(np.array(curve.y), points)
        x, y = np.array(curve.x)[kept], np.array(curve.y)[kept]
        ax.plot(
            x, y, color=look.colour, ls=style, lw=look.width, label=curve.name, zorder=_zorder(order, panel)
        )
    for level in panel.limits:
        ax.axhline(level, color=RED, lw=0.8, ls=(0, (4, 2)))
    ends = [x for curve in panel.lines for x in (min(curve.x, default=0.0), max(curve.x, default=0.0))]
    if ends and min(ends) < max(ends):
        ax.set_xlim(min(ends), max(ends))
    _open(ax)
    for side, dial in ((ax.xaxis, panel.x_dial), (ax.yaxis, panel.y_dial)):
        read_on(side, dial)
    ax.set_xlabel(_signs(panel.x_label))
    ax.set_ylabel(_signs(panel.y_label))
    if panel.title:
        ax.set_title(_signs(panel.title))


def _zorder(order: int, panel: Panel) -> float:
    """The first curve lies above the others, a set-point below what follows it."""
    return 2.0 if panel.followed and order == 0 else 3.0 - 0.01 * order


def _open(ax: Axes) -> None:
    """A constant is a line in the middle, not rounding on a scale of its own."""
    low, high = ax.dataLim.intervaly
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-9):
        ax.set_ylim(low - 0.5, high + 0.5)


def _signs(text: str) -> str:
    return text.replace("deg/s", "°/s").replace("deg", "°").replace("°/s2", "°/s²")
