"""The look that all figures share, their legends, and figures as PNG files by matplotlib, without a window."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gantryctl.errors import DeviceError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours: distinct with every kind of colour vision, and in grey print.
BLUE, ORANGE, GREEN = "#0072b2", "#d55e00", "#009e73"
GREY, INK, RED = "#8a8f98", "#20242b", "#b3261e"

STYLE: Final[dict[Any, Any]] = {
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
}
_PNG_STYLE: Final[dict[Any, Any]] = {
    **STYLE,
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "grid.color": "#e4e7eb",
    "grid.linewidth": 0.6,
    "legend.fontsize": 8.0,
    "figure.constrained_layout.use": True,
}
_DPI: Final = 130


def legend_below(figure: Figure, *axes: Axes) -> None:
    """Name the curves of these axes below the figure, each name once, in as many columns as fit.

    No legend lies inside axes: where a curve of one machine leaves room, that of another runs.
    """
    named: dict[str, Any] = {}
    for each in axes:
        for handle, label in zip(*each.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    # A letter of the legend is about 0.07 in wide, its line half an inch.
    widest = 0.55 + 0.07 * max((len(label) for label in named), default=0)
    columns = max(1, min(len(named), int(figure.get_figwidth() / widest)))
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=columns, handlelength=2.4)


@contextmanager
def png_figure(path: Path, title: str, rows: int, columns: int, **options: Any) -> Iterator[Any]:
    """The axes of a figure, saved when the block ends.

    Raises:
        DeviceError: the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(_PNG_STYLE):
        sheet: Figure = Figure(figsize=options.pop("figsize", (8.6, 6.0)))
        axes = sheet.subplots(rows, columns, **options)
        sheet.suptitle(title, fontsize=10.5, fontweight="bold", x=0.01, ha="left")
        yield axes
        try:
            sheet.savefig(path, dpi=_DPI)
        except OSError as fault:
            raise DeviceError(f"{path}: cannot be written: {fault.strerror or fault}") from None
