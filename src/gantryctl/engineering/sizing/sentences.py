"""What a sizing means, in plain sentences."""

from __future__ import annotations

from collections.abc import Sequence

from gantryctl.engineering.sizing import equations as eq
from gantryctl.engineering.sizing.checks import Fit, usable_torque_nm
from gantryctl.units import deg


def sentences(shown: Fit, fits: Sequence[Fit]) -> list[str]:
    """The complete torque against the paper's, the reducer, and why motors do not fit."""
    found = [_torque(shown), _acceleration(shown), *_reducer(shown)]
    for fitted in fits:
        if fitted.fits:
            tightest = fitted.tightest
            found.append(
                f"{fitted.motor.name} fits; the tightest is {tightest.name}: {tightest.used:.4g} of "
                f"{tightest.limit:.4g} {tightest.unit}."
            )
        else:
            found.append(f"{fitted.motor.name} does not fit: {'; '.join(fitted.reasons)}.")
    if not any(fitted.fits for fitted in fits):
        found.append("No motor fits; choose a larger one, or ask for less.")
    return found


def _torque(shown: Fit) -> str:
    train, motor = shown.train, shown.motor
    speed = eq.motor_speed_r_min(train.sheet.motion.speed_max_r_min, train.ratio)
    paper = eq.motor_torque_nm(train.sheet.load.inertia_kg_m2, train.sizing_acc_rad_s2, train.ratio)
    complete = train.largest_nm(train.sizing_acc_rad_s2)
    rated = motor.torque_at_nm(motor.motor.torque_rated_nm, speed)
    how = "within" if complete <= rated else "above"
    return (
        f"The sizing case takes {complete:.0f} N m, not the {paper:.0f} N m of eq. (2): {how} the {rated:.0f} N m that "
        f"{motor.name} gives for ever at {speed:.0f} r/min"
        + (
            f"; for {train.sheet.motion.sizing_time_s:g} s it needs its overload of {motor.motor.torque_max_nm:g} N m."
            if complete > rated
            else "."
        )
    )


def _acceleration(shown: Fit) -> str:
    train = shown.train
    ratio = train.sizing_acc_rad_s2 / train.normal_acc_rad_s2
    return (
        f"Normal moves accelerate with {deg(train.normal_acc_rad_s2):.4g} deg/s2, {ratio:.3g} times less than the "
        f"sizing case, and take at most {train.largest_nm(train.normal_acc_rad_s2):.0f} N m."
    )


def _reducer(shown: Fit) -> list[str]:
    train, gears = shown.train, shown.train.sheet.gears
    found = []
    swinging = train.reducer_nm(train.sizing_acc_rad_s2, 2.0)
    if swinging > gears.torque_momentary_nm:
        found.append(
            f"As a step the sizing acceleration would swing the reducer up to {swinging / 1e3:.0f} kN m, above its "
            f"momentary {gears.torque_momentary_nm / 1e3:.1f} kN m: it needs a jerk limit. The reducer and the base "
            "are the limit, not the motor."
        )
    usable = usable_torque_nm(train.sheet, shown.motor)
    if usable < shown.motor.motor.torque_max_nm:
        found.append(
            f"The drive must limit {shown.motor.name} to {usable:.4g} N m: its {shown.motor.motor.torque_max_nm:g} N m "
            "would break the reducer."
        )
    return found
