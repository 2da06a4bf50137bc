"""Figures of a page as inline SVG: light, print-safe, readable without colour."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec

from gantryctl.engineering.report.figures import INK
from gantryctl.engineering.report.figures import STYLE as SHARED_STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH_IN = 8.6
# Directions differ by colour and by marker: the page is printed in grey, too.
BLUE, ORANGE = "#1f5fa8", "#c8620a"
STYLE: Any = {
    **SHARED_STYLE,
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8.0,
    "axes.edgecolor": "#c3c8d0",
    "axes.linewidth": 0.8,
    "grid.color": "#e7eaee",
    "grid.linewidth": 0.7,
    "xtick.color": "#5a606b",
    "ytick.color": "#5a606b",
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "text.color": INK,
    "axes.labelcolor": INK,
    "legend.fontsize": 7.5,
    # Letters as paths: the page is the same without the fonts of the machine that made it.
    "svg.fonttype": "path",
    "axes.unicode_minus": True,
    "figure.constrained_layout.w_pad": 0.08,
}


P = ParamSpec("P")


def styled(make: Callable[P, Figure]) -> Callable[P, Figure]:
    """Decorate the maker of a figure: it works under the report's matplotlib settings, whatever the caller's are."""

    @wraps(make)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        import matplotlib as mpl

        with mpl.rc_context(STYLE):
            return make(*args, **kwargs)

    return wrapper


def new_figure(height_in: float) -> Figure:
    """An empty figure across the page."""
    from matplotlib.figure import Figure as NewFigure

    return NewFigure(figsize=(WIDTH_IN, height_in), layout="constrained")


def svg(figure: Figure, name: str) -> str:
    """The figure as an `<svg>` element: no XML head, no date, ids that no other figure of the page has."""
    import matplotlib as mpl

    out = io.StringIO()
    # A salt of its own and no date: the same report gives the same page, byte for byte.
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r' d="[^"]*"', _rounded, text)
    text = re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{name}-", text)
    return re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)


def _rounded(path: re.Match[str]) -> str:
    """Coordinates of a path to a hundredth of a point."""
    # Finer than any print, and the page stays below a megabyte.
    return re.sub(r"(\.\d\d)\d+", r"\1", path[0])
