"""The step sign: a brief pulse with the position loop open, limits lowered, and whether they act."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.commissioning.open_loop_axis import OpenLoopAxis, open_loop_axis
from gantryctl.commissioning.results import Context, Figure, StepResult, judged, torque_text
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import DeviceError
from gantryctl.image import DriveRequest
from gantryctl.operation.ledger.rows import INCREMENTS_PER_TURN
from gantryctl.units import DEG_S_PER_R_MIN

# Ways and speeds are those at the gantry from this ratio on. Below it the motor turns as far as there: what friction
# takes of a pulse before the speed loop follows is an angle of the motor, 1.3 deg of a rotary table.
_RATIO: Final = 500.0
# Less than the leash of 0.05 deg, whichever way the motor turns.
_PULSE_DEG: Final = 0.03
_PULSE_S: Final = 1.5
_LEASH_DEG: Final = 0.05
# Some times the pulse: a drive without 6080 that runs away is off before it has reached the leash of the angle.
_LEASH_DEG_S: Final = 0.2
_TOLERANCE: Final = 0.2
_REST_S: Final = 0.5
# Of the rated torque: above what holds the load, below what a drive gives that heeds no limit.
_TORQUE_PART: Final = 0.5
_TORQUE_LIMIT: Final = 0x6072
_SPEED_CEILING: Final = 0x6080
# The push asks for a speed that grows until the speed loop is at the limit, whatever its gain; 6080 leaves room for it.
_PUSH_DEG_S2: Final = 30.0
_CEILING_DEG_S: Final = 0.6
_PUSH_DEG: Final = 0.02
_PUSH_S: Final = 0.5
_HELD_S: Final = 0.04
# Slow enough to end within the leash, fast enough for a whole number of r/min to be exact within 3 %.
_COUNTED_DEG_S: Final = 0.08
_COUNTED_S: Final = 0.4
_COUNTS_PART: Final = 0.05
# Rounding of 6072 and 6077, ripple of the current loop.
_REACHED: Final = 0.9
_PASSED: Final = 1.15


def sign(c: Context) -> StepResult:
    """Command a half-sine pulse of speed: position and speed must show the commanded way, then the lowered 6072 act."""
    figures: dict[str, Figure] = {}
    longer = longer_by(c.machine.axis.ratio)
    pulse_deg, leash_deg, leash_deg_s = (longer * each for each in (_PULSE_DEG, _LEASH_DEG, _LEASH_DEG_S))
    with open_loop_axis(c, leash_deg, "speed pulse", following=False) as axis:
        sdo = axis.drive.node.sdo
        full = {index: sdo.optional(index) for index in (_TORQUE_LIMIT, _SPEED_CEILING)}
        lowered = _lower_limits(c, axis)
        axis.enable()
        way, way_by_speed = _pulse(axis)
        for name, seen in (("ratio_position", way), ("ratio_speed", way_by_speed)):
            figures[name] = Figure(seen / pulse_deg, 1.0 - _TOLERANCE, 1.0 + _TOLERANCE)
        ways = f"{way:+.4f} deg by position, {way_by_speed:+.4f} deg by speed (motor side)"
        proof = f"{pulse_deg:.2g} deg commanded: {ways}"
        # Only a drive that turns the right way is pushed harder.
        if all(figure.within for figure in figures.values()):
            proof += _push(axis, lowered, figures)
        axis.disable()
        # Of a drive that is off. One that had to be stopped keeps the low ones until the next start.
        for index in lowered:
            sdo.set(index, 0, full[index] or 0)
        settings = axis.drive.opened.settings
        known = any(
            row.place == "608F:01" and row.verdict is ParameterVerdict.OK for row in axis.drive.opened.rows
        )
    right = all(figure.within for figure in figures.values())
    if right and not known:
        proof += _counts(c, settings, way / pulse_deg, lowered, figures)
    if missing := [f"{index:04X}" for index in (_TORQUE_LIMIT, _SPEED_CEILING) if index not in lowered]:
        until = f"{leash_deg:.2g} deg or {leash_deg_s:.2g} deg/s"
        proof += f"; no {', '.join(missing)} in this drive: torque off at {until}"
    to_do = "[can] inverted, increments_per_turn, velocity_unit, or [axis] ratios; 6072 where the torque is not limited"
    return judged(True, "sign", proof, to_do, **figures)


def longer_by(ratio: float) -> float:
    """How much longer the test moves are on an axis of a low ratio."""
    return max(1.0, _RATIO / ratio)


def _counts(
    c: Context, settings: CanopenSettings, ratio: float, lowered: dict[int, int], figures: dict[str, Figure]
) -> str:
    """Increments of a motor turn in a drive without 608F, where it shows them; in words.

    A 60FF in r/min counts turns, so that the way by position shows them. Where 60FF counts increments, the ceiling
    6080, which is in r/min in every drive, does.
    """
    set_to = settings.increments_per_turn
    if not settings.speed_in_increments:
        figures[INCREMENTS_PER_TURN] = Figure(
            ratio * set_to, (1.0 - _TOLERANCE) * set_to, (1.0 + _TOLERANCE) * set_to
        )
    elif _SPEED_CEILING in lowered:
        seen = set_to * _at_ceiling(c)
        figures[INCREMENTS_PER_TURN] = Figure(
            seen, (1.0 - _COUNTS_PART) * set_to, (1.0 + _COUNTS_PART) * set_to
        )
    else:
        return (
            "; no 608F and no 6080, and 60FF counts increments: nothing in this drive shows those of a turn"
        )
    return f"; no 608F: {figures[INCREMENTS_PER_TURN].value:.0f} increments in a turn, set to {set_to}"


def _at_ceiling(c: Context) -> float:
    """Speed at a lowered 6080, with 60FF above it: by the increments of the machine file, as part of what it is."""
    longer = longer_by(c.machine.axis.ratio)
    counted_deg_s = longer * _COUNTED_DEG_S
    with open_loop_axis(c, longer * _LEASH_DEG, "speed ceiling", following=False) as axis:
        ceiling = max(1, round(counted_deg_s * axis.ratio / DEG_S_PER_R_MIN))
        sdo = axis.drive.node.sdo
        full = sdo.number(_SPEED_CEILING)
        sdo.set(_SPEED_CEILING, 0, ceiling)
        axis.enable()
        seen = []
        for k in range(round(_COUNTED_S / axis.period_s)):
            axis.scan(DriveRequest.ENABLE, 2.0 * counted_deg_s)
            _hold_back(axis, counted_deg_s)
            if k * axis.period_s >= _COUNTED_S / 2.0:
                seen.append(axis.speed_deg_s)
        axis.run(_REST_S)
        axis.disable()
        sdo.set(_SPEED_CEILING, 0, full)
    return sum(seen) / len(seen) / (ceiling * DEG_S_PER_R_MIN / axis.ratio)


def _pulse(axis: OpenLoopAxis) -> tuple[float, float]:
    """Way by position and by speed of one pulse, deg."""
    begun, way_by_speed = axis.angle_deg, 0.0
    n = round(_PULSE_S / axis.period_s)
    # A half sine has no jump of speed: its mean is 2/pi of its peak.
    peak = longer_by(axis.ratio) * _PULSE_DEG / _PULSE_S * math.pi / 2.0
    for k in range(n + round(_REST_S / axis.period_s)):
        axis.scan(DriveRequest.ENABLE, peak * math.sin(math.pi * (k + 0.5) / n) if k < n else 0.0)
        way_by_speed += axis.speed_deg_s * axis.period_s
        _hold_back(axis, peak)
    return axis.angle_deg - begun, way_by_speed


def _hold_back(axis: OpenLoopAxis, wanted_deg_s: float) -> None:
    if not abs(axis.speed_deg_s) <= longer_by(axis.ratio) * _LEASH_DEG_S:
        axis.stop_for(
            f"{axis.speed_deg_s:+.2f} deg/s by the drive, at most {wanted_deg_s:.3f} deg/s are commanded"
        )


def _push(axis: OpenLoopAxis, lowered: dict[int, int], figures: dict[str, Figure]) -> str:
    """Ask for more torque than the lowered 6072 allows, until it is held or 0.02 deg are over; in words.

    Raises:
        AlarmStop: the drive gives more; torque off and brake were commanded then.
    """
    if _TORQUE_LIMIT not in lowered or not axis.drive.process.torque_known:
        return "; the torque limit is not shown"
    limit = lowered[_TORQUE_LIMIT] * axis.drive.opened.units.torque_unit_nm
    begun, most, held, longer = axis.angle_deg, 0.0, 0, longer_by(axis.ratio)
    for k in range(round(_PUSH_S / axis.period_s)):
        # Back over the way of the pulse.
        axis.scan(DriveRequest.ENABLE, -longer * _PUSH_DEG_S2 * (k + 1) * axis.period_s)
        given = abs(axis.feedback.torque_act_nm)
        most = max(most, given)
        if not given <= _PASSED * limit:
            axis.stop_for(f"6072 lowered to {torque_text(limit)} is not heeded: {torque_text(given)} given")
        held = held + 1 if given >= _REACHED * limit else 0
        if held * axis.period_s >= _HELD_S or not abs(axis.angle_deg - begun) <= longer * _PUSH_DEG:
            break
    axis.run(_REST_S)
    figures["torque_most_nm"] = Figure(most, _REACHED * limit, _PASSED * limit)
    return f"; 6072 lowered to {torque_text(limit)}, {torque_text(most)} given"


def _lower_limits(c: Context, axis: OpenLoopAxis) -> dict[int, int]:
    """Lower 6072 and 6080 for the test move only, and read them back; what is lower already stays.

    Returns:
        Values by index of those that the drive takes.
    """
    sdo = axis.drive.node.sdo
    wanted = {
        _TORQUE_LIMIT: round(
            _TORQUE_PART * c.machine.motor.torque_rated_nm / axis.drive.opened.units.torque_unit_nm
        ),
        _SPEED_CEILING: max(
            1, math.ceil(longer_by(axis.ratio) * _CEILING_DEG_S * axis.ratio / DEG_S_PER_R_MIN)
        ),
    }
    lowered = {}
    for index, most in wanted.items():
        now = sdo.optional(index)
        if now is None:
            continue
        value = min(most, now or most)
        try:
            sdo.set(index, 0, value)
        except SdoError as refused:
            if refused.silent:
                raise
            continue
        lowered[index] = sdo.number(index)
        if abs(lowered[index] - value) > 1:
            raise DeviceError(f"{index:04X} does not take {value}: the test move wants it lowered")
    return lowered
