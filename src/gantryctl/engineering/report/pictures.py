"""Pictures as data: curves in panels, from which both the printed figure and the one on the screen are drawn."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gantryctl.trace.thinning import drawn
from gantryctl.units import SIGNED, Dial

# Two for each pixel of a panel across the page: a screen shows no more, and ten curves stay below 400 kB.
POINTS: Final = 2000
_DIGITS: Final = 6


@dataclass(frozen=True)
class Line:
    """One curve."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]


@dataclass(frozen=True)
class Panel:
    """Curves over one another.

    Attributes:
        limits: levels that are drawn as limits.
        title: above the panel, "" for none.
        followed: the first curve is a set-point, which the others follow.
        x_dial, y_dial: how angles of the axis are read on this side. The curves go on over the end of the turn; only
            what stands beside them begins anew.
    """

    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    limits: tuple[float, ...] = ()
    title: str = ""
    followed: bool = False
    x_dial: Dial = SIGNED
    y_dial: Dial = SIGNED


@dataclass(frozen=True)
class Picture:
    """Panels in rows of `columns`; 0 for one row. One column shares its horizontal axis."""

    title: str
    panels: tuple[Panel, ...]
    columns: int = 0


def line(name: str, x: ArrayLike, y: ArrayLike, points: int = POINTS) -> Line:
    """A curve of at most `points` samples (see `drawn`), without what is not finite."""
    xs, ys = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    known = np.isfinite(xs) & np.isfinite(ys)
    xs, ys = xs[known], ys[known]
    kept = drawn(ys, points)
    return Line(name, _short(xs[kept].tolist()), _short(ys[kept].tolist()))


def _short(values: Iterable[float]) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)
