"""The encoder on the ring beside the motor's: sign, scale, slip and zero."""

from __future__ import annotations

import math
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis
from gantryctl.commissioning.results import Context, Figure, Outcome, StepResult, judged
from gantryctl.image import DriveFeedback, DriveRequest
from gantryctl.machine import Machine
from gantryctl.operation.run import AxisRun
from gantryctl.units import deg

Floats: TypeAlias = NDArray[np.float64]

# Far enough that what lies between both encoders does not count: lost motion and wind-up 0.004 deg, gear error 0.005.
_WAY_DEG: Final = 1.5
_SPEED_DEG_S: Final = 0.3
_REST_S: Final = 0.5
# Three times what the gear of the reference gantry makes of this way.
_RATIO_TOLERANCE: Final = 0.02
# Three times its lost motion, both ways.
_SLIP_DEG: Final = 0.015
# Of the difference at which the second encoder stops the axis (ENC-07).
_SHARE: Final = 0.5
_LEASH_DEG: Final = 2.0


class _Standing(NamedTuple):
    """Both encoders while the gantry stands, deg; the ring is NaN where its reading is not to be believed."""

    motor_deg: float
    ring_deg: float

    @property
    def apart_deg(self) -> float:
        """Ring minus motor, whole turns left out: the ring has one."""
        return math.remainder(self.ring_deg - self.motor_deg, 360.0)


def has_ring(machine: Machine) -> bool:
    """The bus has an encoder on the ring."""
    return machine.can.load_encoder.source != "none"


def ring(c: Context) -> StepResult:
    """Turn a little forward and back with the position loop open, and compare both encoders at rest.

    The position loop comes later, for it may go through this encoder.
    """
    if not has_ring(c.machine):
        return StepResult("ring", Outcome.NOT_TESTABLE, "no encoder on the ring: [can.load_encoder] source")
    with open_loop_axis(c, _LEASH_DEG, "ring encoder") as axis:
        axis.enable()
        stood = [_standing(axis)]
        acc = c.machine.virtual_axis.acc_deg_s2
        # Of an axis that is slow, or gathers speed slowly, the way stays what it is.
        most = min(_SPEED_DEG_S, c.machine.speed.setting_max_deg_s, math.sqrt(_WAY_DEG * acc))
        for speed in (most, -most):
            axis.ramp_to(speed, acc)
            axis.run(_WAY_DEG / most - most / acc, speed_deg_s=speed)
            axis.ramp_to(0.0, acc)
            stood.append(_standing(axis))
        axis.disable()
    return _judged(c.machine, *stood)


def _standing(axis: OpenLoopAxis) -> _Standing:
    """Mean of both encoders over a rest."""
    begun, start_deg = axis.start_counts, axis.start_deg
    axis.run(_REST_S)
    seen: list[DriveFeedback] = axis.run(_REST_S, DriveRequest.ENABLE)
    motor = np.mean([(f.pos_act_counts - begun) * axis.deg_per_count for f in seen])
    return _Standing(start_deg + float(motor), deg(float(np.mean([f.pos_ring_rad for f in seen]))))


def _judged(machine: Machine, begun: _Standing, there: _Standing, back: _Standing) -> StepResult:
    ways = [(there, begun), (back, there)]
    ratios = [
        (later.ring_deg - earlier.ring_deg) / (later.motor_deg - earlier.motor_deg) for later, earlier in ways
    ]
    slip_deg = back.apart_deg - begun.apart_deg
    apart_deg = begun.apart_deg
    limit_deg = _SHARE * machine.control.compensation.load_encoder.disagreement_deg
    low, high = 1.0 - _RATIO_TOLERANCE, 1.0 + _RATIO_TOLERANCE
    figures = {
        "ratio_forward": Figure(ratios[0], low, high),
        "ratio_back": Figure(ratios[1], low, high),
        "slip_deg": Figure(slip_deg, -_SLIP_DEG, _SLIP_DEG),
        "apart_deg": Figure(apart_deg, -limit_deg, limit_deg),
    }
    proof = (
        f"ring by motor {ratios[0]:+.4f} forward, {ratios[1]:+.4f} back; after both {slip_deg:+.4f} deg of slip; "
        f"{apart_deg:+.4f} deg apart"
    )
    # A zero is proposed only where the encoder turns with the gantry.
    turns = all(figures[name].within for name in ("ratio_forward", "ratio_back", "slip_deg"))
    if turns:
        zero = zero_proposed(machine, apart_deg)
        figures["zero_proposed_counts"] = Figure(float(zero))
        to_do = f"[can.load_encoder] zero_counts = {zero} is proposed, by the zero of the motor encoder"
    elif max(ratios) < 0.0:
        to_do = "[can.load_encoder] inverted: it turns the other way"
    else:
        to_do = (
            "[can.load_encoder] counts_per_turn, the coupling of the encoder to the ring, or its reading head"
        )
    return judged(True, "ring", proof, to_do, **figures)


def zero_proposed(machine: Machine, apart_deg: float) -> int:
    """Counts at 0 deg with which the ring shows what the motor shows."""
    encoder = machine.can.load_encoder
    return round(encoder.zero_counts + apart_deg / 360.0 * encoder.counts_per_turn)


class BothEncoders:
    """What both encoders show while the axis goes through its travel, ten times a second.

    Args:
        run: of the axis.
    """

    def __init__(self, run: AxisRun) -> None:
        self._run = run
        self._rows: list[tuple[float, float, float]] = []

    def look(self) -> None:
        """Keep the present readings."""
        axis = self._run.axis
        ring_rad = self._run.engine.image.drive.pos_ring_rad
        self._rows.append((axis.pos_act_rad, ring_rad, axis.virtual.vel_ref_rad_s))

    def compared(self) -> tuple[str, dict[str, Figure]]:
        """The sentence and the figures, at constant speed."""
        motor, ring_rad, vel = np.array(self._rows).T
        steady = np.abs(vel) > np.max(np.abs(vel)) * (1.0 - 1e-6)
        return over_the_travel(
            self._run.machine, np.degrees(motor[steady]), np.degrees(ring_rad[steady]), vel[steady] > 0.0
        )


def over_the_travel(
    machine: Machine, motor_deg: Floats, ring_deg: Floats, forward: NDArray[np.bool_]
) -> tuple[str, dict[str, Figure]]:
    """Both encoders over the travel: offset, scale and what lies between both ways; the sentence and the figures.

    Args:
        motor_deg, ring_deg: as they show the gantry, both ways through the travel. forward: the way, row by row.
    """
    apart = np.remainder(ring_deg - motor_deg + 180.0, 360.0) - 180.0
    limit = Figure(
        float(np.max(np.abs(apart))), high=machine.control.compensation.load_encoder.disagreement_deg
    )
    # NaN: a reading that is not to be believed.
    if not math.isfinite(limit.value or 0.0):
        return "; the ring shows no angle on the way", {"ring_most_apart_deg": Figure(None, high=limit.high)}
    model = np.column_stack((np.ones_like(motor_deg), motor_deg, np.where(forward, 0.5, -0.5)))
    (offset, slope, reversal), *_ = np.linalg.lstsq(model, apart, rcond=None)
    zero = zero_proposed(machine, float(offset))
    text = (
        f"; ring minus motor {offset:+.4f} deg, {1e6 * slope:+.0f} ppm of the angle, {reversal:+.4f} deg between both "
        f"ways, at most {limit.value:.4f} deg: [can.load_encoder] zero_counts = {zero} is proposed"
    )
    return text, {
        "ring_most_apart_deg": limit,
        "ring_offset_deg": Figure(float(offset)),
        "ring_reversal_deg": Figure(float(reversal)),
        "ring_zero_proposed_counts": Figure(float(zero)),
    }
