"""Picture of one run: true and told angle, speed, torque, brake, and what happened when."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from gantryctl.engineering.faults.bench import FaultLog
from gantryctl.engineering.faults.run import FaultResult, Moment
from gantryctl.engineering.report.figures import BLUE, GREEN, GREY, INK, ORANGE, RED, STYLE
from gantryctl.errors import DeviceError, UsageError
from gantryctl.trace.figure import legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMATS: Final = (".png", ".svg")
_STYLE: Final[dict[Any, Any]] = {
    **STYLE,
    "font.size": 9.0,
    "grid.color": "#e4e7eb",
    "grid.linewidth": 0.6,
    "axes.formatter.useoffset": False,
    "legend.fontsize": 8.0,
    # The same run gives the same file: matplotlib draws random ids without a salt.
    "svg.hashsalt": "gantryctl",
}
_BEFORE_S: Final = 0.2
_AFTER_S: Final = 1.0


class Watched(NamedTuple):
    """A run with more than one fault, or none of the catalogue: its rows, when the first fault began, its alarms.

    Attributes:
        rest_s: from the first fault until the motor stands; infinite where all of the rows are shown.
    """

    log: FaultLog
    onset_s: float
    rest_s: float
    moments: tuple[Moment, ...]


def draw_fault(result: FaultResult | Watched, title: str, path: Path) -> None:
    """Write the picture as PNG or SVG, as the name ends; time is counted from the fault.

    Raises:
        UsageError: another ending.
        DeviceError: the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise UsageError(f"{path}: pictures are written as {', '.join(FORMATS)}")
    log = result.log
    time_s = log["time_s"] - result.onset_s
    end_s = (
        min(float(time_s[-1]), max(1.0, result.rest_s + _AFTER_S))
        if np.isfinite(result.rest_s)
        else time_s[-1]
    )
    shown = (time_s >= -_BEFORE_S) & (time_s <= end_s)
    time_s = time_s[shown]
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(8.6, 7.4), layout="constrained")
        FigureCanvasAgg(figure)
        angle, speed, torque, brake = figure.subplots(4, 1, sharex=True, height_ratios=[3, 2, 2, 1])
        told = np.where(log["valid"][shown] > 0.0, log["told_deg"][shown], np.nan)
        _lines(
            angle,
            time_s,
            "angle in deg",
            true=log["pos_deg"][shown],
            load=log["pos_load_deg"][shown],
            told=told,
        )
        _lines(
            speed,
            time_s,
            "speed in deg/s",
            true=log["vel_deg_s"][shown],
            load=log["vel_load_deg_s"][shown],
            told=log["told_deg_s"][shown],
        )
        torque.plot(time_s, log["torque_nm"][shown], color=BLUE)
        torque.set_ylabel("torque in N m")
        brake.step(time_s, log["brake_closed"][shown], color=INK, label="brake closed")
        brake.step(time_s, 0.9 * log["enabled"][shown], color=GREEN, label="drive enabled")
        brake.set_yticks([0, 1], ["no", "yes"])
        legend_above(brake)
        brake.set_xlabel("time after the fault in s")
        for axes in (angle, speed, torque, brake):
            axes.axvline(0.0, color=RED, lw=0.9)
            for moment in result.moments:
                axes.axvline(moment.time_s - result.onset_s, color=GREY, lw=0.8, ls=":")
        _names(angle, result, end_s)
        figure.suptitle(title, fontsize=10.5, fontweight="bold", x=0.01, ha="left")
        try:
            if suffix == ".png":
                figure.savefig(path, dpi=130)
            else:
                figure.savefig(path, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
        except OSError as fault:
            raise DeviceError(f"{path}: cannot be written: {fault.strerror or fault}") from None


def _lines(axes: Axes, time_s: Any, label: str, *, true: Any, load: Any, told: Any) -> None:
    axes.plot(time_s, load, color=GREY, lw=0.9, label="load, true")
    axes.plot(time_s, true, color=BLUE, label="motor side, true")
    axes.plot(time_s, told, color=ORANGE, ls="--", label="told")
    axes.set_ylabel(label)
    legend_above(axes)


def _names(axes: Axes, result: FaultResult | Watched, end_s: float) -> None:
    """Codes at their moments, above the diagram, one below the other where they come together."""
    last_s, row = -1.0, 0
    for moment in result.moments:
        at_s = moment.time_s - result.onset_s
        if not -_BEFORE_S <= at_s <= end_s:
            continue
        row = row + 1 if at_s - last_s < 0.12 * (end_s + _BEFORE_S) else 0
        last_s = at_s
        axes.annotate(
            moment.code,
            (at_s, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(2, -9 - 9 * row),
            textcoords="offset points",
            fontsize=7.5,
            color=INK,
        )
