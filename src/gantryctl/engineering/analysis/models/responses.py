"""Time responses of the closed loop as it runs: step, ramp and parabola of the set-point, sampled at the scan."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from gantryctl.engineering.analysis.models.linear import FloatArray
from gantryctl.engineering.analysis.models.mechanics import LOAD
from gantryctl.engineering.analysis.models.sampled import SampledLoop


class SetPointStep(Enum):
    """Course of the set-point from t = 0."""

    STEP = "step of the angle"
    RAMP = "step of the speed"
    PARABOLA = "step of the acceleration"


@dataclass(frozen=True)
class TimeResponse:
    """One response at the gantry.

    Attributes:
        size: of the step, in rad, rad/s or rad/s2.
        pos_err_motor_rad, pos_err_load_rad: set-point minus angle.
    """

    reference: SetPointStep
    size: float
    time_s: FloatArray
    pos_err_motor_rad: FloatArray
    pos_err_load_rad: FloatArray


def time_response(loop: SampledLoop, reference: SetPointStep, size: float, duration_s: float) -> TimeResponse:
    """Response from standstill.

    The step has no speed: the controller is given a new angle and r' = 0, unlike eq. (5), which
    differentiates the step.
    """
    s, ratio = loop.settings, loop.plant.ratio
    time = s.scan_s * np.arange(round(duration_s / s.scan_s) + 1, dtype=np.float64)
    pos, vel = {
        SetPointStep.STEP: (np.full_like(time, size), np.zeros_like(time)),
        SetPointStep.RAMP: (size * time, np.full_like(time, size)),
        SetPointStep.PARABOLA: (0.5 * size * time**2, size * time),
    }[reference]
    # Eq. (4): v_cmd = i (Kpp r + Kvf r') - Kpp y, held over the scan; `closed` holds the feedback part.
    closed, command = loop.closed(), loop.scan()[1]
    feed = ratio * (s.kpp_per_s * pos + s.kvf * vel)
    states = np.zeros((len(time), len(command)))
    for k in range(len(time) - 1):
        states[k + 1] = closed @ states[k] + command * feed[k]
    return TimeResponse(
        reference,
        size,
        time,
        pos - states @ loop.row(loop.encoder) / ratio,
        pos - states @ loop.row(loop.plant.position(LOAD)),
    )
