"""The look that all figures share: colours, lines, grid."""

from __future__ import annotations

from typing import Any, Final

GREY: Final = "#8a8f98"
INK: Final = "#20242b"
RED: Final = "#b3261e"

STYLE: Final[dict[Any, Any]] = {
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
}
