"""Steps with torque and the position loop open: silence, brake, sign and scale, velocity step."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Final

import numpy as np

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis, state_name
from gantryctl.commissioning.results import Context, Figure, Outcome, StepResult, failed, judged, passed
from gantryctl.commissioning.stopping.silence import (
    Silence,
    SilentDrive,
    Way,
    fall_silent,
    seen_by_s,
    watched_ways,
)
from gantryctl.errors import DeviceError
from gantryctl.image import DriveRequest, DriveState
from gantryctl.operation.brake_policy import after_test
from gantryctl.operation.proofs import silent_master_proof_path, store_silent_master_proof
from gantryctl.program import BrakeTestOutcome, BrakeTestResult
from gantryctl.program.power.brake_test import BrakeTest
from gantryctl.units import deg, rad
from gantryctl.wiring.program import untestable

_STAND_DEG: Final = 0.1
# What the step announces: the gantry may sag by less than this when the brake closes.
_SAG_DEG: Final = 0.05
_STEP_S: Final = 4.0
_STEP_TOLERANCE: Final = 0.02


def silence(c: Context) -> StepResult:
    """Stop commands, then the heartbeat, each alone; the drive must switch itself off and brake."""
    figures: dict[str, Figure] = {}
    lacking, times_s = [], []
    for way in Way:
        with open_loop_axis(c, _STAND_DEG, f"{way} silent") as axis:
            if way not in watched_ways(axis):
                lacking.append(f"{way.place} ({way})")
                continue
            axis.enable()
            seen = fall_silent(axis, Silence((way,), way.limit_s(c.machine), _SAG_DEG))
            if seen.stopped:
                axis.wake()
                reset(axis)
        key = way.replace(" ", "_")
        most_ms = 1e3 * seen_by_s(way.limit_s(c.machine), axis.period_s)
        figures[f"{key}_ms"] = Figure(1e3 * seen.stopped_s, high=most_ms)
        figures[f"{key}_moved_deg"] = Figure(seen.way_deg, high=_SAG_DEG)
        said = f"{way} silent: {told(seen)}"
        c.say(f"  {said}")
        # One liar is enough: nothing that such a drive shows afterwards can be believed.
        if not seen.stopped:
            to_do = f"the drive does not stop a silent controller's axis ({way}): 6007, 605E, {way.place}"
            return failed("silence", said, to_do, **figures)
        times_s.append(seen.stopped_s)
    if not times_s:
        # The ledger refuses such a drive without a watchdog relay, which has a step of its own.
        why = f"this drive has no {', '.join(lacking)}"
        return StepResult(
            "silence", Outcome.NOT_TESTABLE, why, to_do="a watchdog relay, and the step watchdog"
        )
    marker = keep_proof(c)
    proof = ", ".join(f"{key} {figure.value:.4g}" for key, figure in figures.items())
    if lacking:
        proof += f"; this drive has no {', '.join(lacking)}"
    if marker is None:
        proof += "; this drive takes no marker: a restart between two runs is not noticed"
    return passed("silence", proof, **figures, silent_stop_s=min(times_s))


def keep_proof(c: Context) -> int | None:
    """Keep that this drive was seen to stop; the marker that was left in it, None where it takes none."""
    with open_loop_axis(c, _STAND_DEG) as axis:
        # Some drives answer SDO in PRE-OPERATIONAL only.
        axis.drive.node.enter_pre_operational()
        key, marker = axis.drive.opened.identity.key, axis.drive.leave_restart_marker()
        store_silent_master_proof(silent_master_proof_path(c.store.directory, c.machine), key, marker)
    return marker


def told(seen: SilentDrive) -> str:
    """What a drive did in the silence, for people."""
    complained = (
        "no EMCY" if math.isnan(seen.complained_s) else f"EMCY after {1e3 * seen.complained_s:.0f} ms"
    )
    if seen.broken_off:
        return f"{complained}, {seen.broken_off}"
    brake = "open" if seen.brake_open else "closed"
    return (
        f"left operation enabled after {1e3 * seen.stopped_s:.0f} ms ({complained}), moved {seen.way_deg:.4f} deg, "
        f"{state_name(seen.state)}, brake {brake}"
    )


def watchdog(c: Context) -> StepResult:
    """Fall silent whole, as a controller that is killed: the watchdog relay must take the torque off."""
    place = c.machine.can.output_place("watchdog")
    if not place:
        return StepResult("watchdog", Outcome.NOT_TESTABLE, "no output works a watchdog relay")
    relay_s = 1e-3 * c.machine.can.watchdog_ms
    with open_loop_axis(c, _STAND_DEG) as axis:
        own = watched_ways(axis)
        axis.enable()
        if axis.drive.beside.inputs.watchdog_contact() is False:
            proof = f"the drive is enabled, and the contact of the relay at {place} shows open"
            return failed("watchdog", proof, "look at the bit watchdog_closed and its wire")
        seen = fall_silent(axis, Silence(tuple(Way), relay_s, _SAG_DEG))
        closed = axis.drive.beside.ask_watchdog_contact()
        most_ms = 1e3 * seen_by_s(relay_s, axis.period_s)
        if seen.stopped:
            axis.wake()
    said = f"all silent: {told(seen)}"
    c.say(f"  {said}")
    figures = {
        "watchdog_ms": Figure(1e3 * seen.stopped_s, high=most_ms),
        "watchdog_moved_deg": Figure(seen.way_deg, high=_SAG_DEG),
    }
    if not seen.stopped:
        to_do = f"the relay at {place} does not take the torque off within {1e3 * relay_s:g} ms: its time, its wires"
        return failed("watchdog", said, to_do, **figures)
    if closed:
        to_do = (
            f"the relay at {place} has not opened: it hangs, or watchdog_closed is wired to something else"
        )
        return failed("watchdog", f"{said}; its contact still shows closed", to_do, **figures)
    # The drive's own watch may have been earlier: then the contact alone shows what the relay did.
    if own and closed is None:
        to_do = "wire the contact of the relay: [can.inputs] or [can.io.inputs] watchdog_closed"
        return failed("watchdog", f"{said}, perhaps by the drive's own watch", to_do, **figures)
    if not own:
        keep_proof(c)
    shown = "the contact of the relay is open" if closed is False else "the drive has no watch of its own"
    return passed("watchdog", f"{said}; {shown}", **figures, silent_stop_s=seen.stopped_s)


def reset(axis: OpenLoopAxis) -> None:
    """Clear the fault that a proof has caused."""
    for _ in range(round(1.0 / axis.period_s)):
        if axis.scan(DriveRequest.FAULT_RESET).state is DriveState.SWITCH_ON_DISABLED:
            return
    # Silence made the fault on purpose: within a second it must be gone.
    raise DeviceError(f"the drive's fault does not go away: {axis.feedback.error_code:04X}h")


def brake(c: Context) -> StepResult:
    """Run the brake test of operation where the controller can keep the brake closed: the machine's first one."""
    reason = untestable(c.machine)
    if reason:
        return StepResult("brake", Outcome.NOT_TESTABLE, str(reason), to_do="use the drive's own brake test")
    with open_loop_axis(c, _STAND_DEG, "torque against the closed brake") as axis:
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
    speed = c.machine.speed.creep_deg_s
    with open_loop_axis(c, 2.0 * _STEP_S * speed, "creep speed") as axis:
        axis.enable()
        axis.ramp_to(speed, c.machine.virtual_axis.acc_deg_s2)
        axis.run(1.0, speed_deg_s=speed)
        begun = axis.angle_deg
        seen = axis.run(_STEP_S, speed_deg_s=speed)
        reached = (axis.angle_deg - begun) / _STEP_S
        axis.ramp_to(0.0, c.machine.virtual_axis.acc_deg_s2)
        axis.run(0.5)
        axis.disable()
        told = axis.drive.reports_torque
    low, high = speed * (1.0 - _STEP_TOLERANCE), speed * (1.0 + _STEP_TOLERANCE)
    proof = f"{speed:g} deg/s commanded, {reached:.5f} deg/s over {_STEP_S:g} s"
    figures = {"speed_deg_s": Figure(reached, low, high)}
    if told:
        torque = float(np.mean([f.torque_act_nm for f in seen]))
        proof += f", mean torque {torque:.1f} N m"
        figures["torque_nm"] = Figure(torque)
    return judged(True, "velocity", proof, "the drive's speed loop or [can] velocity_unit", **figures)
