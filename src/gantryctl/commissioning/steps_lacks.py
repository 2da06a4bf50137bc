"""Steps for what a drive lacks: its own quick-stop ramp measured, and a torque limit of the maker's tool shown."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis
from gantryctl.commissioning.results import (
    Context,
    Figure,
    Outcome,
    StepResult,
    failed,
    figure_text,
    judged,
    torque_text,
)
from gantryctl.commissioning.stopping.quick_stop import (
    CRUISE_S,
    QuickStop,
    measure_quick_stop,
    permitted_way_deg,
    trial_acc_deg_s2,
    trial_speed_deg_s,
)
from gantryctl.engineering.stops.run import StopClass, StopResult, within_ratings, worst_stop
from gantryctl.errors import AlarmStop
from gantryctl.image import DriveRequest
from gantryctl.machine import Machine
from gantryctl.operation.ledger.rows import RAMP_DEG_S2, TORQUE_LIMIT_NM
from gantryctl.wiring.program import untestable

# Rising: a ramp that is too hard for motor or reducer shows at a speed that hurts neither.
_SPEEDS: Final = (0.3, 0.6, 1.0, 2.0, 3.0)
_SPARE_DEG: Final = 0.3
# A ramp of a fixed time is as much harder as the speed is higher; one of a fixed deceleration stays as it is.
_FIXED_TIME: Final = 0.75
# The stops are computed with the deceleration of the machine file; the monitor of the ramp spares 0.5 deg/s (DRV-07).
_SLOWEST_PART: Final = 0.95
_OTHER_RAMP: Final = "set another quick-stop ramp with the drive maker's tool"
_COMPUTED: Final = "[virtual_axis] quick_dec_deg_s2 = {:g} at most, with the speeds that it permits"


# Known so well, a deceleration goes into the computed stops.
_KNOWN_PART: Final = 0.05


class _Ramp(NamedTuple):
    """Quick stop seen from a speed."""

    speed_deg_s: float
    stop: QuickStop


def ramp(c: Context) -> StepResult:
    """Measure the drive's own quick-stop ramp from slow to fast, as far as motor and reducer bear it at top speed."""
    top, wanted = c.machine.speed.setting_max_deg_s, c.machine.virtual_axis.quick_dec_deg_s2
    seen: list[_Ramp] = []
    figures: dict[str, Figure] = {}
    fastest = min(trial_speed_deg_s(c.machine), c.speed_max_deg_s)
    for number, speed in enumerate([speed for speed in _SPEEDS if speed <= fastest] or [fastest]):
        try:
            # Forward and back: the gantry ends near where it began.
            seen.append(_Ramp(speed, _stop_from(c, speed if number % 2 == 0 else -speed)))
        except AlarmStop as stopped:
            return failed("ramp", str(stopped), _OTHER_RAMP, **figures)
        dec = seen[-1].stop.dec_deg_s2
        figures[f"ramp_{speed:g}_deg_s2".replace(".", "p")] = Figure(dec)
        if not math.isfinite(dec):
            proof = f"the ramp from {speed:g} deg/s ends within three scans: too hard to be measured"
            return failed("ramp", proof, _OTHER_RAMP, **figures)
        hardest = _at_top_deg_s2(seen, top)
        stop = worst_stop(c.machine, StopClass.QUICK, top, hardest)
        figures |= _loads(c, stop)
        reducer_knm = figure_text(stop.torque_reducer_nm / 1e3, 1)
        loads = f"{torque_text(stop.torque_motor_nm)} at the motor, {reducer_knm} kN m at the reducer"
        c.say(f"  from {speed:g} deg/s: {dec:.2f} deg/s2; from {top:g} deg/s that is {loads}")
        if not within_ratings(c.machine, stop):
            proof = f"{dec:.2f} deg/s2 from {speed:g} deg/s; {hardest:.2f} deg/s2 from {top:g} deg/s: {loads}"
            return failed("ramp", f"{proof}, beyond the ratings", _OTHER_RAMP, **figures)
    known = [each.stop for each in seen if each.stop.uncertainty_deg_s2 <= _KNOWN_PART * each.stop.dec_deg_s2]
    slowest = min((stop.dec_deg_s2 for stop in known), default=math.nan)
    figures[RAMP_DEG_S2] = Figure(slowest, low=_SLOWEST_PART * wanted)
    proof = f"{slowest:.2f} deg/s2, seen up to {seen[-1].speed_deg_s:g} deg/s; the stops are computed with {wanted:g}"
    return judged(True, "ramp", proof, _COMPUTED.format(math.floor(10.0 * slowest) / 10.0), **figures)


def _stop_from(c: Context, speed: float) -> QuickStop:
    """One quick stop by the drive's own ramp."""
    # Softer than letting a jog key go is no quick stop.
    softest = c.machine.virtual_axis.jog_release_dec_deg_s2
    way = permitted_way_deg(speed, softest)
    acc = trial_acc_deg_s2(c.machine)
    leash = speed * speed / (2.0 * acc) + CRUISE_S * abs(speed) + way + _SPARE_DEG
    with open_loop_axis(c, leash, f"quick stop from {speed:+g} deg/s", way=speed) as axis:
        axis.enable()
        axis.ramp_to(speed, acc)
        axis.run(CRUISE_S, speed_deg_s=speed)
        return measure_quick_stop(axis, speed, softest)


def _at_top_deg_s2(seen: list[_Ramp], top: float) -> float:
    """Hardest deceleration to be expected from the highest speed, as far as it is sure."""
    sure = [each.stop.dec_deg_s2 - each.stop.uncertainty_deg_s2 for each in seen]
    first, last = seen[0], seen[-1]
    rises = sure[-1] / sure[0] >= _FIXED_TIME * last.speed_deg_s / first.speed_deg_s
    return sure[-1] * top / last.speed_deg_s if rises and len(seen) > 1 else max(sure)


def _loads(c: Context, stop: StopResult) -> dict[str, Figure]:
    return {
        "torque_at_top_nm": Figure(stop.torque_motor_nm, high=c.machine.motor.torque_max_nm),
        "reducer_at_top_nm": Figure(stop.torque_reducer_nm, high=c.machine.reducer.torque_momentary_nm),
    }


# --- torque limit of the maker's tool ------------------------------------------------------------------------------

# Of the torque that the brake has held, less what the load takes of it.
_BRAKE_PART: Final = 0.6
_MOVED_MAX_DEG: Final = 0.02
_RISE_S: Final = 0.5
_HOLD_S: Final = 0.3
# Beside the limit itself: scale of 6077, friction of the drive's own control.
_TOLERANCE: Final = 0.15


def push_deg(machine: Machine) -> float:
    """What a push against the closed brake may turn the axis by: what the brake test permits where that is more."""
    return max(_MOVED_MAX_DEG, machine.brake.sag_max_deg)


def torque(c: Context) -> StepResult:
    """Push against the closed brake with a part of its proven torque: 6077 follows and never passes the limit."""
    entered = c.machine.can.torque_limit_in_drive_nm
    brake = c.results.get("brake")
    reason = untestable(c.machine)
    if reason is not None:
        return StepResult(
            "torque", Outcome.NOT_TESTABLE, str(reason), to_do="what the drive can do is accepted by name"
        )
    if brake is None or brake.outcome is not Outcome.PASSED:
        return failed("torque", "the brake has held nothing yet", "run the step brake first")
    held = min(brake.number("plus_nm"), -brake.number("minus_nm"))
    level = _BRAKE_PART * held - c.machine.plant.load.eccentric_moment_nm / c.machine.axis.ratio
    if level <= 0.0:
        proof = f"{_BRAKE_PART:g} of the {held:.0f} N m that the brake has held is less than the load takes"
        return StepResult("torque", Outcome.NOT_TESTABLE, proof, to_do="a higher [brake] test_torque_nm")
    with open_loop_axis(c, push_deg(c.machine), "push against the brake", following=False) as axis:
        if not axis.drive.torque_preload:
            reason = untestable(c.machine, torque_preload=False)
            return StepResult(
                "torque", Outcome.NOT_TESTABLE, str(reason), to_do="accept by name what the drive can do"
            )
        pushed = [abs(_push(axis, sign * level, (1.0 + _TOLERANCE) * entered)) for sign in (1.0, -1.0)]
    least, most, expected = min(pushed), max(pushed), min(level, entered)
    shown = min(entered, least)
    proof = (
        f"{level:.1f} N m asked for against the closed brake, {least:.1f} and {most:.1f} N m given; limit of the "
        f"drive as entered {entered:g} N m, what lies above {shown:.1f} N m is not shown"
    )
    low, high = (1.0 - _TOLERANCE) * expected, (1.0 + _TOLERANCE) * expected
    figures = {
        "pushed_least_nm": Figure(least, low, high), "pushed_most_nm": Figure(most, low, high),
        TORQUE_LIMIT_NM: Figure(shown),
    }  # fmt: skip
    to_do = "the limit in the maker's tool, [can] torque_limit_in_drive_nm, torque_reference"
    return judged(True, "torque", proof, to_do, **figures)


def _push(axis: OpenLoopAxis, torque_nm: float, most_nm: float) -> float:
    """Raise the torque against the closed brake, hold it, take it back; what was given, by 6077.

    Raises:
        AlarmStop: the shaft moved by more than `push_deg`, or the torque passed the limit of the drive; it is off then.
    """
    axis.enable(brake=False)
    rest = axis.feedback.torque_act_nm
    given = 0.0
    rise = max(1, round(_RISE_S / axis.period_s))
    for k in range(rise + round(_HOLD_S / axis.period_s)):
        wanted = torque_nm * min(1.0, (k + 1) / rise)
        seen = axis.scan(DriveRequest.ENABLE, torque_nm=wanted, brake=False).torque_act_nm - rest
        if not abs(seen) <= most_nm:
            axis.stop_for(f"{seen:+.1f} N m given, {most_nm:.1f} N m are the limit of the drive")
        given = seen
    # The speed loop has a torque of its own against the closed brake: what is left of it is taken out.
    axis.run(0.2, torque_nm=torque_nm - axis.feedback.torque_act_nm, brake=False)
    axis.run(0.3, DriveRequest.DISABLE, brake=False)
    return given
