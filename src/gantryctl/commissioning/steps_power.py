"""Steps with torque and the position loop open: brake, velocity step."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Final

import numpy as np

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis
from gantryctl.commissioning.results import Context, Figure, Outcome, StepResult, judged
from gantryctl.commissioning.room import stand_deg
from gantryctl.image import DriveRequest
from gantryctl.operation.brake_policy import after_test
from gantryctl.program import BrakeTestOutcome, BrakeTestResult
from gantryctl.program.power.brake_test import BrakeTest
from gantryctl.units import deg, rad
from gantryctl.wiring.program import untestable

# Of the step to creep speed: time at it, the part of that before it is measured, and the way with both ramps.
_STEP_S: Final = 5.0
_SETTLE_PART: Final = 0.2
_STEP_WAY_DEG: Final = 1.0
_STEP_SPARE_DEG: Final = 0.2
_STEP_TOLERANCE: Final = 0.02


def brake(c: Context) -> StepResult:
    """Run the brake test of operation where the controller can keep the brake closed: the machine's first one."""
    reason = untestable(c.machine)
    if reason:
        return StepResult("brake", Outcome.NOT_TESTABLE, str(reason), to_do="use the drive's own brake test")
    with open_loop_axis(c, stand_deg(c.machine), "torque against the closed brake") as axis:
        if not axis.drive.torque_preload:
            return StepResult(
                "brake", Outcome.NOT_TESTABLE, str(untestable(c.machine, torque_preload=False)),
                to_do="use the drive's own brake test",
            )  # fmt: skip
        result = _test_brake(c, axis)
        axis.retained = after_test(axis.retained, result, axis.retained.power_ups, datetime.now(UTC))
    ok = result.outcome is BrakeTestOutcome.PASSED
    return judged(
        ok, "brake", result.text, "brake or torque scaling; call service",
        torque_nm=c.machine.brake.test_torque_nm,
        moved_deg=Figure(deg(result.moved_rad), high=c.machine.brake.sag_max_deg),
        plus_nm=result.plus_nm, minus_nm=result.minus_nm,
    )  # fmt: skip


def _test_brake(c: Context, axis: OpenLoopAxis) -> BrakeTestResult:
    """Enable behind the closed brake, test it, take the torque off, disable."""
    m = c.machine
    test = BrakeTest(m.brake.test_torque_nm, rad(m.brake.sag_max_deg), m.motor.torque_max_nm, axis.period_s)
    axis.enable(brake=False)
    test.prepare(axis.retained.holding_torque_nm or 0.0)
    test.begin()
    seen, torque = axis.feedback, 0.0
    while test.running:
        torque = test.scan(seen.torque_act_nm, rad(axis.angle_deg))
        seen = axis.scan(DriveRequest.ENABLE, torque_nm=torque, brake=False)
    # The torque ends behind the closed brake, before the drive is disabled.
    axis.run(0.3, torque_nm=torque - seen.torque_act_nm, brake=False)
    axis.run(0.2, DriveRequest.DISABLE, brake=False)
    return test.result


def velocity(c: Context) -> StepResult:
    """Turn at creep speed and measure it."""
    acc = c.machine.virtual_axis.acc_deg_s2
    # An axis whose creep is fast goes no further than the step says: half of the way is left for constant speed.
    speed = min(c.machine.speed.creep_deg_s, math.sqrt(0.5 * _STEP_WAY_DEG * acc))
    at_speed_s = min(_STEP_S, (_STEP_WAY_DEG - speed * speed / acc) / speed)
    measured_s = (1.0 - _SETTLE_PART) * at_speed_s
    way_deg = speed * at_speed_s + speed * speed / acc
    with open_loop_axis(c, way_deg + _STEP_SPARE_DEG, "creep speed") as axis:
        axis.enable()
        axis.ramp_to(speed, acc)
        axis.run(_SETTLE_PART * at_speed_s, speed_deg_s=speed)
        begun = axis.angle_deg
        seen = axis.run(measured_s, speed_deg_s=speed)
        reached = (axis.angle_deg - begun) / (len(seen) * axis.period_s)
        axis.ramp_to(0.0, acc)
        axis.run(0.5)
        axis.disable()
        told = axis.drive.reports_torque
    low, high = speed * (1.0 - _STEP_TOLERANCE), speed * (1.0 + _STEP_TOLERANCE)
    proof = f"{speed:g} deg/s commanded, {reached:.5f} deg/s over {measured_s:.3g} s"
    figures = {"speed_deg_s": Figure(reached, low, high)}
    if told:
        torque = float(np.mean([f.torque_act_nm for f in seen]))
        proof += f", mean torque {torque:.1f} N m"
        figures["torque_nm"] = Figure(torque)
    return judged(True, "velocity", proof, "the drive's speed loop or [can] velocity_unit", **figures)
