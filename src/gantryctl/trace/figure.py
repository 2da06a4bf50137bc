"""Pictures of a trace, in degrees: PNG or SVG.

matplotlib is imported where it is used; no window is ever opened.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol

import numpy as np

from gantryctl.errors import UsageError
from gantryctl.files import check_place, unwritable
from gantryctl.trace.columns import TIME_COLUMN, in_degrees, unit_of
from gantryctl.trace.files import Floats
from gantryctl.trace.thinning import drawn
from gantryctl.units import SIGNED, Dial, deg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

FORMATS: Final = (".png", ".svg")
# Samples of a long curve: about two for each pixel of a picture 9 in wide at 150 dpi. An SVG grows with every one.
_POINTS_DRAWN: Final = 3000
# The palette of Okabe and Ito, which people with any colour vision can tell apart.
_BLUE, _ORANGE, _GREEN = "#0072b2", "#d55e00", "#009e73"
_MORE_COLOURS: Final = (_BLUE, _ORANGE, _GREEN, "#cc79a7", "#56b4e9", "#e69f00", "#000000")
_STYLE: Final[dict[Any, Any]] = {
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e0e0e0",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "legend.frameon": False,
    # The same trace gives the same file: matplotlib draws random ids without a salt.
    "svg.hashsalt": "gantryctl",
    "svg.fonttype": "path",
}


# `Trace`, which draws itself: it imports this file, and this file only says what it needs of one.
class Drawable(Protocol):
    """What a picture is drawn of."""

    @property
    def columns(self) -> tuple[str, ...]: ...

    @property
    def dial(self) -> Dial: ...

    @property
    def time_s(self) -> Floats: ...

    def __getitem__(self, name: str) -> Floats: ...

    def __contains__(self, name: object) -> bool: ...

    def __len__(self) -> int: ...

    def in_degrees(self) -> Drawable: ...


class Line(NamedTuple):
    """Curve of a diagram."""

    label: str
    values: Floats
    colour: str
    width: float = 1.1


class Panel(NamedTuple):
    """Diagram over time."""

    title: str
    axis_label: str
    lines: Sequence[Line]
    dial: Dial = SIGNED
    """How angles of the axis are read; the curves go on over the end of the turn."""


# Role in the column's name, label, colour and width; the set-point is a broad band behind what follows it.
_SIDES: Final = (("load", "load side", _ORANGE, 0.9), ("act", "motor side", _BLUE, 1.1))
_FOLLOWED: Final = (("ref", "set-point", "#c0c0c0", 4.0), *_SIDES)


_ANGLES: Final = frozenset(f"pos_{role}_rad" for role, *_ in _FOLLOWED)


def read_on(side: Axis, dial: Dial) -> None:
    """Write the numbers of one side of a diagram as people read angles of the axis."""
    if dial.begin_deg is None:
        return
    from matplotlib.ticker import FuncFormatter

    side.set_major_formatter(FuncFormatter(lambda angle_deg, _: f"{dial.read_deg(angle_deg) + 0.0:.6g}"))


def overview(trace: Drawable) -> list[Panel]:
    """Diagrams of angle, speed, their errors and torque: of these, what the trace has."""
    torque = [Line("motor", trace["torque_act_nm"], _BLUE)] if "torque_act_nm" in trace else []
    panels = [
        Panel("Angle", "angle in deg", _angles(trace), trace.dial),
        Panel("Following error (set-point minus angle)", "error in mdeg", _errors(trace, "pos_{}_rad", 1e3)),
        Panel("Speed", "speed in deg/s", _followed(trace, "vel_{}_rad_s")),
        Panel("Speed error (set-point minus speed)", "error in deg/s", _errors(trace, "vel_{}_rad_s", 1.0)),
        Panel("Motor torque", "torque in N m", torque),
    ]
    return [panel for panel in panels if panel.lines]


def _followed(trace: Drawable, pattern: str) -> list[Line]:
    """Curves of the set-point and of what followed it, at the gantry, in degrees."""
    return [
        Line(label, deg(1.0) * trace[column], colour, width)
        for role, label, colour, width in _FOLLOWED
        if (column := pattern.format(role)) in trace
    ]


def _angles(trace: Drawable) -> list[Line]:
    """Angles in degrees, each without the whole turns by which the zero of a modulo axis moves on."""
    lines = _followed(trace, "pos_{}_rad")
    if not lines or not len(trace):
        return lines
    whole = [each._replace(values=_continued(each.values)) for each in lines]
    first = whole[0].values[0]
    return [each._replace(values=_less_turns(each.values, each.values[0] - first)) for each in whole]


def _continued(angle_deg: Floats) -> Floats:
    """The same angle without steps of whole turns; of a linear axis, the same numbers."""
    step = np.diff(angle_deg)
    turns = np.where(np.abs(step) > 180.0, np.round(step / 360.0), 0.0)
    return angle_deg - 360.0 * np.concatenate(([0.0], np.cumsum(turns)))


def _less_turns(values_deg: Floats, by_deg: Floats | float) -> Floats:
    """Values less the whole turns in a difference of angles; NaN has none."""
    return values_deg - 360.0 * np.nan_to_num(np.round(np.asarray(by_deg) / 360.0))


def _errors(trace: Drawable, pattern: str, scale: float) -> list[Line]:
    """Set-point minus each side; `scale` 1e3 for thousandths of a degree."""
    if (set_point := pattern.format("ref")) not in trace:
        return []
    return [
        Line(
            label, scale * (_less_turns(error, error) if pattern.startswith("pos") else error), colour, width
        )
        for role, label, colour, width in _SIDES
        if (column := pattern.format(role)) in trace
        for error in [deg(1.0) * (trace[set_point] - trace[column])]
    ]


def chosen(trace: Drawable, columns: Sequence[str]) -> list[Panel]:
    """Diagrams of the columns asked for, one per unit."""
    units: dict[str, list[str]] = {}
    for name in columns:
        trace[name]  # UsageError with all names when it is not there
        units.setdefault(unit_of(in_degrees(name)).symbol, []).append(name)
    shown = trace.in_degrees()
    panels = []
    for unit, names in units.items():
        lines = [
            Line(in_degrees(name), shown[in_degrees(name)], _MORE_COLOURS[index % len(_MORE_COLOURS)])
            for index, name in enumerate(names)
        ]
        title = lines[0].label if len(lines) == 1 else f"Columns in {unit}" if unit else "Numbers"
        dial = trace.dial if _ANGLES.issuperset(names) else SIGNED
        panels.append(Panel(title, unit or "number", lines, dial))
    return panels


def draw(
    trace: Drawable, panels: Sequence[Panel], title: str, marks: Mapping[str, float] = MappingProxyType({})
) -> Figure:
    """Draw the diagrams below each other over one time axis.

    Args:
        marks: times in s that all diagrams show, by what is written beside the line of the first.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if not panels:
        raise UsageError(f"nothing to plot by default; choose columns: {', '.join(trace.columns)}")
    if not len(trace):
        raise UsageError("nothing to plot: no row in this time")
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(9.0, 1.0 + 1.8 * len(panels)), layout="constrained")
        FigureCanvasAgg(figure)
        all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, panel in zip(all_axes, panels, strict=True):
            _draw_panel(axes, trace[TIME_COLUMN], panel)
            for time_s in marks.values():
                axes.axvline(time_s, color="#000000", lw=0.8, ls="--")
        for text, time_s in marks.items():
            all_axes[0].annotate(
                text,
                (time_s, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(3.0, -9.0),
                textcoords="offset points",
            )
        all_axes[-1].set_xlabel("time in s")
        all_axes[-1].set_xlim(trace.time_s[0], max(trace.time_s[-1], trace.time_s[0] + 1e-9))
        figure.suptitle(title, fontsize=11.0, x=0.01, ha="left")
        figure.align_ylabels()
    return figure


def _draw_panel(axes: Axes, time_s: Floats, panel: Panel) -> None:
    for line in panel.lines:
        kept = drawn(line.values, _POINTS_DRAWN)
        axes.plot(time_s[kept], line.values[kept], color=line.colour, lw=line.width, label=line.label)
    axes.set_title(panel.title)
    axes.set_ylabel(panel.axis_label)
    axes.margins(y=0.08)
    read_on(axes.yaxis, panel.dial)
    low, high = axes.dataLim.intervaly
    # A constant is a line in the middle, not rounding on a scale of its own.
    if low == high:
        axes.set_ylim(low - 0.5, high + 0.5)
    if len(panel.lines) > 1:
        legend_above(axes)


def legend_above(axes: Axes) -> None:
    """Name the curves of axes above them, at the right: panels below one another, each with curves of its own."""
    count = len(axes.get_legend_handles_labels()[1])
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=count, borderaxespad=0.1)


class Picture:
    """A drawn figure; a notebook shows it as it is.

    Attributes:
        figure: of matplotlib.
    """

    def __init__(self, figure: Figure) -> None:
        self.figure = figure

    def save(self, path: str | Path) -> None:
        """Write PNG or SVG, as the name ends.

        Raises:
            UsageError: another ending, or no place of this name. DeviceError: the disk does not take it.
        """
        save(self.figure, Path(path))

    def _repr_png_(self) -> bytes:
        return _drawn(self.figure, ".png", dpi=100)


def check_picture(path: Path) -> None:
    """Refuse a name by which no picture can be written.

    Raises:
        UsageError: another ending, or no place of this name.
    """
    if path.suffix.lower() not in FORMATS:
        raise UsageError(f"{path}: pictures are written as {', '.join(FORMATS)}")
    check_place(path)


def save(figure: Figure, path: Path) -> None:
    """Write the figure as PNG or SVG, as the name ends.

    Raises:
        UsageError: another ending, or no place of this name. DeviceError: the disk does not take it.
    """
    check_picture(path)
    content = _drawn(figure, path.suffix.lower(), dpi=150)
    try:
        path.write_bytes(content)
    except OSError as fault:
        raise unwritable(path, fault) from fault


def _drawn(figure: Figure, suffix: str, dpi: int) -> bytes:
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context(_STYLE):
        if suffix == ".png":
            figure.savefig(buffer, format="png", dpi=dpi)
        else:
            figure.savefig(
                buffer, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
            )
    return buffer.getvalue()
