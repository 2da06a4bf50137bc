"""Summary of a motion from its recording."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gantryctl.machine.tables.axis import AxisTable
from gantryctl.notebook import facts_html
from gantryctl.trace.table import Trace

Floats = NDArray[np.float64]
_USED: Final = (
    "pos_ref_rad", "vel_ref_rad_s", "pos_act_rad", "vel_act_rad_s", "pos_err_rad", "torque_act_nm",
    "pos_load_rad", "vel_load_rad_s", "vel_motor_rad_s",
)  # fmt: skip


@dataclass(frozen=True)
class MotionSummary:
    """One motion, from the first scan of its set-point to standstill. Angles at the gantry.

    Attributes:
        duration_s: of the set-point's motion. peak_deg_s: its highest speed.
        end_deg: measured angle at the end (motor encoder); None where its reading is in doubt.
        following_error_motor_deg, following_error_load_deg: largest set-point minus angle, motor side and load side.
        speed_error_motor_deg_s, speed_error_load_deg_s: likewise for the speed.
        torque_max_nm: largest motor torque.

    The load side is known to a simulator only, else None.
    """

    start_deg: float
    end_deg: float | None
    duration_s: float
    peak_deg_s: float
    following_error_motor_deg: float
    following_error_load_deg: float | None
    speed_error_motor_deg_s: float
    speed_error_load_deg_s: float | None
    torque_max_nm: float

    def as_dict(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    def _repr_html_(self) -> str:
        def pair(motor: float, load: float | None, unit: str) -> str:
            side = "" if load is None else f", load side {load:.5f} {unit}"
            return f"motor side {motor:.5f} {unit}{side}"

        end = "in doubt" if self.end_deg is None else f"{self.end_deg:.4f} deg"
        facts = {
            "from, to": f"{self.start_deg:.4f} deg, {end}",
            "time": f"{self.duration_s:.2f} s",
            "peak speed": f"{self.peak_deg_s:.2f} deg/s",
            "following error": pair(self.following_error_motor_deg, self.following_error_load_deg, "deg"),
            "speed error": pair(self.speed_error_motor_deg_s, self.speed_error_load_deg_s, "deg/s"),
            "largest torque": f"{self.torque_max_nm:.1f} N m",
        }
        return facts_html("Motion", facts)


def summarise(
    trace: Trace, from_s: float, to_s: float, axis: AxisTable, *, end_known: bool = True
) -> MotionSummary | None:
    """The motion between two times of a recording.

    `end_known`: the reading of the last scan is believed.

    Rows that are not finite (a program that failed computes nothing any more) are left out; None when no row is left.
    """
    # A program that failed computes nothing any more: the rows of its stop hold no numbers.
    part = _finite(trace.slice(from_s, to_s))
    if not len(part):
        return None
    ref, vel_ref = np.degrees(part["pos_ref_rad"]), np.degrees(part["vel_ref_rad_s"])
    moving = np.nonzero(vel_ref)[0]
    time_s = part["time_s"]
    duration = float(time_s[moving[-1]] - time_s[moving[0]]) if len(moving) else 0.0
    load_error = load_vel_error = None
    # Without the truth of a simulator only the drive's own reading of the speed is known.
    vel_motor = np.degrees(part["vel_act_rad_s"])
    if "pos_load_rad" in part.columns:
        # Whole turns: a modulo axis counts its angle from another turn than the plant.
        error = ref - np.degrees(part["pos_load_rad"])
        load_error = _largest(error - 360.0 * np.round(error / 360.0))
        load_vel_error = _largest(vel_ref - np.degrees(part["vel_load_rad_s"]))
        vel_motor = np.degrees(part["vel_motor_rad_s"]) / axis.ratio
    return MotionSummary(
        start_deg=axis.shown_deg(float(ref[0])),
        end_deg=axis.shown_deg(float(np.degrees(part["pos_act_rad"][-1]))) if end_known else None,
        duration_s=duration,
        peak_deg_s=_largest(vel_ref),
        following_error_motor_deg=_largest(np.degrees(part["pos_err_rad"])),
        following_error_load_deg=load_error,
        speed_error_motor_deg_s=_largest(vel_ref - vel_motor),
        speed_error_load_deg_s=load_vel_error,
        torque_max_nm=_largest(part["torque_act_nm"]),
    )


def _finite(part: Trace) -> Trace:
    """Rows with a value in every column of the summary."""
    used = [name for name in _USED if name in part.columns]
    whole = np.all([np.isfinite(part[name]) for name in used], axis=0)
    if np.all(whole):
        return part
    return Trace.from_rows(part.columns, part.rows()[whole], part.metadata)


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values))) if len(values) else 0.0
