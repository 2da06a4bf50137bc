"""Rules of the compensations: what needs what."""

from __future__ import annotations

from gantryctl.machine.rules.book import Broken, rule
from gantryctl.machine.tables.compensation import NEED_CALIBRATION
from gantryctl.machine.tables.model import Machine

_AT = "control.compensation"
_PROFILE = "virtual_axis.profile"
_STEP = 'must go with [virtual_axis] profile = "jerk_limited": a step of the acceleration becomes a jump of the command'


@rule(f"{_AT}.torque.acceleration", _PROFILE)
def acceleration_torque_without_steps(m: Machine) -> Broken:
    """Torque feed-forward of the acceleration needs a jerk-limited profile."""
    wrong = m.control.compensation.torque.acceleration and m.virtual_axis.profile == "trapezoid"
    return _STEP if wrong else None


@rule(f"{_AT}.windup.active", _PROFILE)
def windup_without_steps(m: Machine) -> Broken:
    """Wind-up compensation needs a jerk-limited profile."""
    wrong = m.control.compensation.windup.active and m.virtual_axis.profile == "trapezoid"
    return _STEP if wrong else None


@rule(f"{_AT}.damping.active", f"{_AT}.load_encoder.active")
def damping_needs_the_load_encoder(m: Machine) -> Broken:
    """Swing damping sees the load through the load-side encoder."""
    c = m.control.compensation
    wrong = c.damping.active and not c.load_encoder.active
    return "must go with the load-side loop, whose encoder it reads: switch that on too" if wrong else None


@rule(f"{_AT}.load_encoder.own_errors", f"{_AT}.load_encoder.active")
def own_errors_need_the_load_encoder(m: Machine) -> Broken:
    """The load-side encoder's own errors matter only where it is read."""
    c = m.control.compensation.load_encoder
    return "must go with the load-side loop: switch that on too" if c.own_errors and not c.active else None


@rule(f"{_AT}.moment_observer.limit_nm", f"{_AT}.moment_observer.active")
def observer_has_a_limit(m: Machine) -> Broken:
    """A moment that is followed is followed within a limit."""
    c = m.control.compensation.moment_observer
    wrong = c.active and not c.limit_nm > 0.0
    return (
        "must be above 0: how much the eccentric moment may change before it counts as a fault"
        if wrong
        else None
    )


@rule(f"{_AT}.backlash_observer.limit_deg", f"{_AT}.backlash_observer.active")
def backlash_has_a_limit(m: Machine) -> Broken:
    """Backlash that is followed is followed within a limit."""
    c = m.control.compensation.backlash_observer
    wrong = c.active and not c.limit_deg > 0.0
    return "must be above 0: the largest backlash that the gears may have" if wrong else None


@rule(
    f"{_AT}.backlash_observer.active",
    f"{_AT}.moment_observer.active",
    f"{_AT}.windup.active",
    f"{_AT}.windup.reversal",
)
def backlash_goes_with_its_flank(m: Machine) -> Broken:
    """Backlash is followed where moment and friction are, which say on which flank the load lies."""
    c = m.control.compensation
    wrong = c.backlash_observer.active and not (
        c.moment_observer.active and c.windup.active and c.windup.reversal
    )
    return (
        "must go with the moment observer, wind-up and lost motion, which say on which flank the load lies: "
        "switch them on too"
        if wrong
        else None
    )


@rule(f"{_AT}.load_encoder.active", "plant.load_encoder.fitted", "drive.kind")
def load_encoder_is_there(m: Machine) -> Broken:
    """A load-side loop on the simulated drive needs a simulated load-side encoder."""
    active = m.control.compensation.load_encoder.active
    wrong = active and m.drive.kind == "sim" and not m.plant.load_encoder.fitted
    return "must stay false: the simulated axis has no encoder on its ring" if wrong else None


@rule(f"{_AT}.calibration", *(f"{_AT}.{key}" for key in NEED_CALIBRATION))
def calibration_is_named(m: Machine) -> Broken:
    """What lives on identified values needs a calibration file."""
    c = m.control.compensation
    if c.needs_calibration and not c.calibration:
        return "must name the file that `gantryctl identify` writes: a compensation that is on needs identified values"
    return None
