"""One judge of the program each, asked in the shortest way whether it acts at a value; and its limit, by hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.command_checks import check_range, check_target
from gantryctl.program.axis.reference import Reference
from gantryctl.program.monitors.liveness import Liveness
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.program.monitors.torque import TorqueWatch
from gantryctl.program.power.brake_test import BrakeTest, BrakeTestOutcome, BrakeTestPhase
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.ramp_watch import RampWatch
from gantryctl.program.power.slip_watch import SlipWatch
from gantryctl.program.power.torque_proof import TorqueProof
from gantryctl.program.power.wear import BrakeWear
from gantryctl.units import rad
from unit.program.parts import Parts
from unit.program.rig import RATIO

Acts = Callable[[Parts, float], bool]


def monitors_of(parts: Parts, *, resting: bool = False) -> Monitors:
    watch = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.virtual.at_rest = resting
    return watch


def scans(parts: Parts, scan: Callable[[], object], count: int) -> bool:
    """Whether so many scans raise an alarm."""
    for _ in range(count):
        parts.alarms.scan += 1
        scan()
    return bool(parts.alarms.active)


# --- power ------------------------------------------------------------------------------------------------------------


def slips(parts: Parts, x: float) -> bool:
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(0.0, unwinds=False)
    return watch.slipped(x, Code.BRK_03)


def slips_without_torque(parts: Parts, x: float) -> bool:
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(0.0, unwinds=False)
    return watch.slipped_without_torque(x, 1.0, Code.BRK_04)


def slips_while_it_unwinds(parts: Parts, x: float) -> bool:
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(0.0, unwinds=True)
    return watch.slipped_without_torque(x, 0.2, Code.BRK_04)


def unwinds_longer(parts: Parts, x: float) -> bool:
    """The second angle is a slip where the time to unwind is over at the first."""
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(0.0, unwinds=True)
    watch.slipped_without_torque(rad(0.04), abs(x), Code.BRK_04)
    return watch.slipped_without_torque(0.0, abs(x), Code.BRK_04)


def moves_in_hold(parts: Parts, x: float) -> bool:
    HoldWatch(parts.settings, parts.feedback, parts.alarms).tell_if_moved(abs(x))
    return bool(parts.codes)


def turns_in_hold(parts: Parts, x: float) -> bool:
    watch = HoldWatch(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.vel_rad_s, parts.feedback.torque_nm = x, -math.copysign(5.0, x)
    return scans(parts, lambda: watch.scan(0.0), 310)


def pushes_too_much_in_hold(parts: Parts, x: float) -> bool:
    watch = HoldWatch(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.torque_nm, parts.feedback.vel_rad_s = x, -math.copysign(rad(0.2), x)
    return scans(parts, lambda: watch.scan(0.0), 60)


def turns_on_its_ramp(parts: Parts, x: float) -> bool:
    watch = RampWatch(parts.settings, parts.feedback)
    parts.feedback.vel_rad_s = x
    return scans(parts, lambda: watch.obeyed(0.1), 60)


def turns_after_its_ramp(parts: Parts, x: float) -> bool:
    watch = RampWatch(parts.settings, parts.feedback)
    parts.feedback.vel_rad_s = x
    return scans(parts, lambda: watch.obeyed(0.3), 60)


def should_stand(parts: Parts, x: float) -> bool:
    watch = RampWatch(parts.settings, parts.feedback)
    parts.turn(0.1)
    return scans(parts, lambda: watch.obeyed(abs(x)), 60)


def is_not_waited_for(parts: Parts, x: float) -> bool:
    watch = RampWatch(parts.settings, parts.feedback)
    return scans(parts, lambda: watch.obeyed(abs(x)), 1)


def proof_of(parts: Parts, way: float) -> TorqueProof:
    parts.holding.mean_nm = way * 12.0
    parts.holding.preload()
    proof = TorqueProof(parts.settings, parts.feedback, parts.alarms, parts.holding)
    proof.begin()
    return proof


def gives_too_much(parts: Parts, x: float) -> bool:
    proof = proof_of(parts, math.copysign(1.0, x))
    parts.feedback.torque_nm = x
    return not proof.given(1)


def is_not_learned(parts: Parts, x: float) -> bool:
    parts.holding.learn(x)
    return parts.holding.mean_nm == 0.0


def wears(parts: Parts, x: float) -> bool:
    wear = BrakeWear(parts.settings, parts.feedback, parts.alarms)
    wear.begin(abs(x))
    return wear.stops > 0


def fails_the_test(parts: Parts, x: float) -> bool:
    test = BrakeTest(64.0, rad(0.02), 385.0, 0.001)
    test.prepare(0.0)
    test.begin()
    test.scan(0.0, 0.0)
    test.scan(0.0, x)
    return test.outcome is BrakeTestOutcome.FAILED


def the_test_waits(parts: Parts, x: float) -> bool:
    """Torque that the motor gives as the ramp has come to 64 N m; 60.8 are 95 % of it."""
    test = BrakeTest(64.0, rad(0.02), 385.0, 0.001)
    test.prepare(0.0)
    test.begin()
    if x < 0.0:
        test._enter(BrakeTestPhase.MINUS_RISING)
    for _ in range(600):
        test.scan(x, 0.0)
    return test.phase in (BrakeTestPhase.PLUS_RISING, BrakeTestPhase.MINUS_RISING)


POWER: dict[str, tuple[Acts, float]] = {
    "slip under torque": (slips, rad(0.02)),
    "slip without torque": (slips_without_torque, rad(0.02)),
    "slip of a gear that unwinds": (slips_while_it_unwinds, rad(0.02) + rad(0.03)),
    "time to unwind": (unwinds_longer, 0.300),
    "way in HOLD": (moves_in_hold, rad(0.15)),
    "speed in HOLD": (turns_in_hold, rad(0.1)),
    "torque in HOLD": (pushes_too_much_in_hold, 70.0),
    "speed beside the ramp": (turns_on_its_ramp, rad(0.5)),
    "speed after the ramp": (turns_after_its_ramp, 0.1 * rad(0.5)),
    "time to stand": (should_stand, 0.25),
    "time of a stop": (is_not_waited_for, 3.0),
    "proof torque": (gives_too_much, 90.0),
    "learned torque": (is_not_learned, 0.6 * 257.0),
    "speed of a stop by the brake": (wears, rad(0.1)),
    "way in a brake test": (fails_the_test, rad(0.02)),
}

# --- monitors ---------------------------------------------------------------------------------------------------------


def lags(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    return scans(parts, lambda: watch.scan(0.0, x, 0.0), 1)


def lags_too_far(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    scans(parts, lambda: watch.scan(0.0, x, 0.0), 20)
    return "CTL-03" in parts.codes


def does_not_obey(parts: Parts, x: float) -> bool:
    """It has torque, so that it is not lost."""
    watch = monitors_of(parts)
    parts.feedback.vel_rad_s, parts.feedback.torque_nm = x, 20.0
    scans(parts, lambda: watch.scan(0.0, 0.0, 0.0), 25)
    return "CTL-05" in parts.codes


def gets_no_ramp(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    parts.feedback.vel_rad_s, parts.feedback.torque_nm = x, 20.0
    scans(parts, lambda: watch.scan(0.0, rad(1.0), 0.0), 12)
    return parts.reaction("CTL-03") is Reaction.TORQUE_OFF


def swings(parts: Parts, x: float) -> bool:
    """Both ways in turn, for more than a second."""
    watch = monitors_of(parts)
    watch._torque_watch = watch.drag = type("", (), {"__getattr__": lambda *_: lambda *_: None})()
    way = x

    def scan() -> None:
        nonlocal way
        way = -way if parts.alarms.scan % 100 == 0 else way
        parts.feedback.vel_rad_s = way
        watch.scan(0.0, 0.0, 0.0)

    return scans(parts, scan, 1300)


def is_too_fast(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    parts.feedback.vel_rad_s = parts.virtual.vel_ref_rad_s = x
    scans(parts, lambda: watch.scan(0.0, 0.0, x * RATIO), 25)
    return "CTL-04" in parts.codes


def is_far_too_fast(parts: Parts, x: float) -> bool:
    is_too_fast(parts, x)
    return parts.reaction("CTL-04") is Reaction.TORQUE_OFF


def is_beyond(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    return scans(parts, lambda: watch.scan(x, 0.0, 0.0), 1)


def stays_beyond(parts: Parts, x: float) -> bool:
    """Switched on there, it may go on by the window of standstill."""
    watch = monitors_of(parts)
    watch.open_the_way_back(x)
    return not scans(parts, lambda: watch.scan(x + math.copysign(rad(0.01), x), 0.0, 0.0), 1)


def reads_no_torque(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    watch._torque_watch = watch.drag = type("", (), {"__getattr__": lambda *_: lambda *_: None})()
    parts.feedback.torque_nm = x
    return scans(parts, lambda: watch.scan(0.0, 0.0, 0.0), 1)


def reads_no_torque_released(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    watch._torque_watch = type("", (), {"__getattr__": lambda *_: lambda *_: None})()
    parts.feedback.torque_nm = x
    return scans(parts, lambda: watch.scan_released(0.0), 1)


def feels_the_brake(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    parts.feedback.brake_open = False
    return scans(parts, lambda: watch.scan(0.0, x, 0.0), 1) and "BRK-05" in parts.codes


def stays_armed_beyond(parts: Parts, x: float) -> bool:
    """Released beyond the travel and back at `x`: the way back is not opened any further once it is inside."""
    watch = monitors_of(parts)
    watch.open_the_way_back(math.copysign(rad(181.0), x))
    watch.scan_released(x)
    return not scans(parts, lambda: watch.scan(math.copysign(rad(180.9), x), 0.0, 0.0), 1)


def is_not_in_position(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts, resting=True)
    scans(parts, lambda: watch.scan(0.0, x, 0.0), 210)
    return not watch.in_position


def leaves_standstill(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts, resting=True)
    scans(parts, lambda: watch.scan(0.0, 0.0, 0.0), 210)
    scans(parts, lambda: watch.scan(0.0, x, 0.0), 20)
    return "CTL-13" in parts.codes


def grows_at_the_torque_limit(parts: Parts, x: float) -> bool:
    watch = monitors_of(parts)
    parts.feedback.torque_limited = True
    watch.scan(0.0, 0.0, 0.0)
    scans(parts, lambda: watch.scan(0.0, x, 0.0), 210)
    return "CTL-07" in parts.codes


def turns_off_its_command(parts: Parts, x: float) -> bool:
    """Beside a set-point that rests: entered once it is beyond the limit."""
    watch = monitors_of(parts)
    entered = []
    watch._oscillation = SimpleNamespace(scan=entered.append)
    parts.feedback.vel_rad_s = x
    watch.scan(0.0, 0.0, x * RATIO)
    return bool(entered)


def torque_of(parts: Parts, torque_nm: float) -> TorqueWatch:
    parts.feedback.torque_nm = torque_nm
    return TorqueWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)


def is_heavy(parts: Parts, x: float) -> bool:
    return scans(parts, torque_of(parts, x).standing, 260)


def is_too_heavy(parts: Parts, x: float) -> bool:
    scans(parts, torque_of(parts, x).standing, 260)
    return parts.reaction("CTL-06") is Reaction.QUICK_STOP


def has_torque_while_off(parts: Parts, x: float) -> bool:
    watch = torque_of(parts, x)
    parts.feedback.state = DriveState.SWITCH_ON_DISABLED
    return scans(parts, watch.scan_released, 110)


def has_torque(parts: Parts, x: float) -> bool:
    """A drive that is off its command."""
    watch = torque_of(parts, x)
    parts.turn(3.0)
    return not scans(parts, lambda: watch.scan(-rad(0.06), 0.0), 60)


def loses_its_torque(parts: Parts, x: float) -> bool:
    watch = torque_of(parts, 0.0)
    parts.turn(3.0)
    return scans(parts, lambda: watch.scan(x, 0.0), 60)


def loses_its_torque_at_once(parts: Parts, x: float) -> bool:
    """All of 100 N m is gone: what it had is suspected whatever the speed."""
    watch = torque_of(parts, 100.0)
    parts.turn(3.0)
    parts.feedback.torque_nm = 0.0
    scans(parts, lambda: watch.scan(x, 0.0), 55)
    return "DRV-13" in parts.codes


def lives_of(parts: Parts) -> Liveness:
    limits = {"encoder_still_time_s": 0.5, "torque_still_max_nm": 15.0}
    config = replace(parts.settings, monitors=replace(parts.settings.monitors, **limits))
    return Liveness(config, parts.feedback, parts.holding, parts.alarms)


def stands_under_torque(parts: Parts, x: float) -> bool:
    watch = lives_of(parts)
    parts.feedback.torque_nm = x
    return scans(parts, watch.stop, 40)


def torque_leaves(parts: Parts, x: float) -> bool:
    """In two steps: one jump asks nothing."""
    watch = lives_of(parts)
    for share in (0.0, 0.5, 1.0, *(1.0 for _ in range(40))):
        parts.feedback.torque_nm = share * x
        scans(parts, lambda: watch.stand(proven=True), 1)
    return watch.dithers > 0


def pushes_with_all(parts: Parts, x: float) -> bool:
    watch = lives_of(parts)
    parts.feedback.torque_nm = x
    for deg_s in (0.2, 0.4):
        parts.turn(-math.copysign(deg_s, x))
        scans(parts, watch.drive_against, 1)
    return bool(parts.codes)


def is_not_explained(parts: Parts, x: float) -> bool:
    """Torque beside its mean that must have turned the shaft: what was missing before is not forgotten."""
    watch = torque_of(parts, 0.0)
    watch._missing = 1.0
    watch._suspect(0.0, x, 0.0)
    return watch._missing != 0.0


def leaps(parts: Parts, x: float) -> bool:
    watch = torque_of(parts, 0.0)
    watch._suspect(x, 0.0, 0.0)
    return watch._leap != 0


def looks_for_the_brake(parts: Parts, x: float) -> bool:
    """The shaft was held back, and 300 N m more stay, in the direction of the command."""
    watch = torque_of(parts, 0.0)
    watch._pulled = True
    return any(watch._gripped(math.copysign(300.0, x), x) for _ in range(31))


MONITORS: dict[str, tuple[Acts, float]] = {
    "following error that warns": (lags, 0.5 * rad(0.03)),
    "following error": (lags_too_far, rad(0.03)),
    "deviation of the speed": (does_not_obey, rad(0.5)),
    "deviation without a ramp": (gets_no_ramp, rad(0.5)),
    "swing": (swings, 0.4 * rad(0.5)),
    "scan of a swing": (turns_off_its_command, 0.4 * rad(0.5)),
    "overspeed": (is_too_fast, rad(6.6)),
    "overspeed without a ramp": (is_far_too_fast, 1.2 / 1.1 * rad(6.6)),
    "over-travel": (is_beyond, rad(180.5)),
    "torque reading": (reads_no_torque, 1540.0),
    "torque reading of a released axis": (reads_no_torque_released, 1540.0),
    "following error with the brake closed": (feels_the_brake, 0.5 * rad(0.03)),
    "window in position": (is_not_in_position, rad(0.005)),
    "window of standstill": (leaves_standstill, rad(0.02)),
    "error at the torque limit": (grows_at_the_torque_limit, rad(0.005)),
    "heavy load": (is_heavy, 0.6 * 257.0),
    "load that is too heavy": (is_too_heavy, 0.9 * 257.0),
    "torque while off": (has_torque_while_off, 0.1 * 257.0),
    "torque of NaN": (has_torque, 0.02 * 257.0),
    "deviation without torque": (loses_its_torque, 0.1 * rad(0.5)),
    "deviation as the torque goes": (loses_its_torque_at_once, 0.1 * rad(0.5)),
    "torque of a standing count": (stands_under_torque, 15.0),
    "torque that leaves a standing count": (torque_leaves, 15.0),
    "torque of the wrong sign": (pushes_with_all, 0.8 * 385.0),
    "torque that must turn the shaft": (is_not_explained, 100.0 / 385.0 * 385.0),
    "leap of the torque": (leaps, 0.8 * 257.0),
    "command behind which a brake is looked for": (looks_for_the_brake, 0.04 * rad(0.5)),
}

# --- readings and commands --------------------------------------------------------------------------------------------


def is_a_wrong_speed(parts: Parts, x: float) -> bool:
    parts.feedback._speed(x, 0.0, 1.0)
    return bool(parts.codes)


def is_a_wrong_target(parts: Parts, x: float) -> bool:
    return check_target(0.0, x, parts.settings.travel) is not None


def is_a_wrong_reference(parts: Parts, x: float) -> bool:
    return Reference(parts.settings, parts.feedback, None).check(x, standing=True) is not None


def turns_too_fast_for_a_reference(parts: Parts, x: float) -> bool:
    parts.feedback.vel_rad_s = x
    return Reference(parts.settings, parts.feedback, None).check(0.0, standing=True) is not None


def is_guarded(parts: Parts, x: float) -> bool:
    axis = Axis(parts.settings, 0.0)
    axis.virtual.following, axis._vel_next = True, x
    return axis.end().vel_cmd_rad_s == 0.0


def torque_is_guarded(parts: Parts, x: float) -> bool:
    axis = Axis(parts.settings, 0.0)
    axis.power.torque_ff_nm = x
    return axis.end().torque_ff_nm == 0.0


def is_absurd(parts: Parts, x: float) -> bool:
    return check_range(x, parts.settings.travel) is not None


READINGS: dict[str, tuple[Acts, float]] = {
    "speed reading": (is_a_wrong_speed, rad(21.0)),
    # And what the angles of a double leave of it: less than a fine count, 1.3e-9 rad.
    "target": (is_a_wrong_target, rad(180.0) + 1e-9),
    "way": (is_absurd, rad(1e6)),
    "reference": (is_a_wrong_reference, rad(180.0)),
    "speed at a reference": (turns_too_fast_for_a_reference, rad(0.1)),
    "speed command": (is_guarded, rad(6.3) * RATIO),
    "torque command": (torque_is_guarded, 385.0),
}

# --- limits from which on something is so -----------------------------------------------------------------------------


def proves(parts: Parts, x: float) -> bool:
    proof = proof_of(parts, math.copysign(1.0, x))
    parts.feedback.torque_nm = x
    return proof.given(1)


def gives_the_test_torque(parts: Parts, x: float) -> bool:
    return not the_test_waits(parts, x)


def turns(parts: Parts, x: float) -> bool:
    parts.feedback.vel_rad_s = x
    return not parts.feedback.slow


def is_warm(code: str) -> Acts:
    def acts(parts: Parts, x: float) -> bool:
        parts.feedback.overload = abs(x)
        MotorThermal(parts.settings, parts.feedback, parts.alarms).scan(0.0)
        return code in parts.codes

    return acts


FROM: dict[str, tuple[Acts, float]] = {
    "proof torque": (proves, 24.0),
    "test torque": (gives_the_test_torque, 60.8),
    "a turning axis": (turns, rad(0.02)),
    "an axis back inside its travel": (stays_armed_beyond, rad(180.5)),
    "a warm motor": (is_warm("THM-01"), 0.80),
    "a hot motor": (is_warm("THM-03"), 0.95),
    "a motor at its limit": (is_warm("THM-04"), 1.0),
}
