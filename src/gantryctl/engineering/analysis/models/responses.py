"""Time responses of the closed loop as it runs: step, ramp and parabola of the set-point, sampled at the
scan.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from gantryctl.engineering.analysis.models.full import CLOSED_OUTPUTS, control_models
from gantryctl.engineering.analysis.models.linear import FloatArray

if TYPE_CHECKING:
    from gantryctl.engineering.analysis.models.sampled import SampledLoop


class Reference(Enum):
    """What the set-point does at t = 0."""

    STEP = "step of the angle"
    RAMP = "step of the speed"
    PARABOLA = "step of the acceleration"


@dataclass(frozen=True)
class TimeResponse:
    """One response; all at the gantry but the torque.

    Attributes:
        size: of the step, in rad, rad/s or rad/s2.
        pos_err_motor_rad, pos_err_load_rad: set-point minus angle. vel_err_load_rad_s: the same of the speed.
        torque_nm: of the motor, beyond what holds and moves the axis in steady state.
    """

    reference: Reference
    size: float
    time_s: FloatArray
    pos_ref_rad: FloatArray
    pos_err_motor_rad: FloatArray
    pos_err_load_rad: FloatArray
    vel_err_load_rad_s: FloatArray
    torque_nm: FloatArray


def time_response(loop: SampledLoop, reference: Reference, size: float, duration_s: float) -> TimeResponse:
    """Response from standstill.

    The step has no speed: the controller is given a new angle and r' = 0, unlike eq. (5), which
    differentiates the step.
    """
    import control

    time = loop.settings.scan_s * np.arange(round(duration_s / loop.settings.scan_s) + 1, dtype=np.float64)
    pos, vel = {
        Reference.STEP: (np.full_like(time, size), np.zeros_like(time)),
        Reference.RAMP: (size * time, np.full_like(time, size)),
        Reference.PARABOLA: (0.5 * size * time**2, size * time),
    }[reference]
    result = control.forced_response(control_models(loop).closed, time, np.vstack([pos, vel]))
    outputs = dict(zip(CLOSED_OUTPUTS, np.asarray(result.outputs), strict=True))
    return TimeResponse(
        reference=reference,
        size=size,
        time_s=time,
        pos_ref_rad=pos,
        pos_err_motor_rad=pos - outputs["pos_act_rad"],
        pos_err_load_rad=pos - outputs["pos_load_rad"],
        vel_err_load_rad_s=vel - outputs["vel_load_rad_s"],
        torque_nm=outputs["torque_act_nm"],
    )
