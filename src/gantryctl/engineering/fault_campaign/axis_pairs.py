"""Two faults within half a second of each other on another axis, the first at a moment of a short session.

The times of a motion are those of its plan on the sound axis (`program.virtual_axis`), which is planned here as the
program plans it; nothing is played.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple, get_args

from gantryctl.engineering.fault_campaign.draw import (
    PAIR_STRIDE,
    WIDE_SCANS_MS,
    Draw,
    Drive,
    drawn_machine,
    other_axis,
    pairs,
    planned,
)
from gantryctl.engineering.fault_campaign.machines import axis_of
from gantryctl.engineering.fault_campaign.person import PULSE_S
from gantryctl.engineering.fault_campaign.scenario import Action, Deed, PlannedFault, Scenario
from gantryctl.engineering.faults.catalogue import fault_case
from gantryctl.machine import Machine
from gantryctl.machine.places import reach_deg
from gantryctl.program.settings import AxisSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg, rad
from gantryctl.wiring.program import axis_settings

Moment = Literal[
    "power on", "brake opens for a move", "gains speed", "at speed", "slows down", "last degree", "stop", "power off",
    "recovery",
]  # fmt: skip
"""Where the first fault of a pair begins."""
MOMENTS: Final[tuple[Moment, ...]] = get_args(Moment)
GAP_MAX_S: Final = 0.5
# From one scan to the longest.
_GAPS_S: Final = (0.0, 0.004, 0.01, 0.02, 0.05, 0.1, 0.2, GAP_MAX_S)
_POWER_S: Final = 0.2
SWITCHING_S: Final = 0.3
"""Drive, proof of the torque and brake take 0.3 to 0.5 s to power on, 0.1 to 0.4 s to power off or park."""
# After power: the axis is ready, and has learned what holds its load, or has not.
_READY_S: Final = (0.8, 2.2)
# An axis that parks after the shortest time is parked so long after its power was asked for.
_PARKS_S: Final = 0.5
_PARKED_S: Final = (1.8, 2.8)
# A slow ramp is as long on the bus as thirty other scenarios: such an axis does not come to its highest speed.
_RAMP_MAX_S: Final = 4.0
_TRAVEL_SHARE: Final = 0.8
# Of the speed that was asked for: what is below is not at speed, and what is less has begun or is over.
_AT_SPEED: Final = 0.98
_MOVES: Final = 0.02
_QUICK_STOP_S: Final = 0.3
_RECOVERS_S: Final = 1.0
RECOVERY_S: Final = 0.9
"""Let go, reset 0.1 s later, power after 0.6 s, and the brake begins to open."""
# After what is last: a stop, and what a person is told of it.
_AFTER_S: Final = 4.0


class _Session(NamedTuple):
    """What the person does, where the axis begins, and when the first fault may begin."""

    actions: tuple[Action, ...]
    angle_deg: float
    from_s: float
    to_s: float
    hold_s: float | None = None


class _Motion(NamedTuple):
    """A move or a key, and its set-point: time, deg and deg/s."""

    action: Action
    begin_deg: float
    plan: tuple[tuple[float, float, float], ...]

    def within(self, moment: Moment) -> tuple[float, float]:
        """First and last time of a part of the motion."""
        top = abs(self.action.speed_deg_s)
        fast = [at_s for at_s, _, speed in self.plan if abs(speed) >= _AT_SPEED * top]
        moves = [at_s for at_s, _, speed in self.plan if abs(speed) >= _MOVES * top]
        match moment:
            case "gains speed":
                return moves[0], fast[0]
            case "slows down":
                return fast[-1], moves[-1]
            case "last degree":
                end = self.plan[-1][1]
                degree = min(1.0, 0.1 * abs(end - self.begin_deg))
                near = [at_s for at_s, here, _ in self.plan if abs(end - here) <= degree]
                return near[0], moves[-1]
            case _:
                return fast[0], fast[-1]


def axis_pair_scenario(
    series: int, number: int, scan_ms: float | None = None, drive: Drive = "sim"
) -> Scenario:
    """Two rows forced together on another axis: every ordered pair in turn, as `draw.pair_scenario` has them."""
    name = f"axis-pairs {series} {number}"
    draw = Draw(name)
    scan_ms = draw.one_of(WIDE_SCANS_MS) if scan_ms is None else scan_ms
    axis = other_axis(draw, drive)
    base = drawn_machine(draw, drive, number, scan_ms, beside=False)
    inverted = drive == "bus" and draw.happens(0.5)
    base = base.model_copy(update={**axis, "inverted": inverted, "ramp_deg_s2": None})
    moment = draw.one_of(MOMENTS)
    machine = axis_of(base)
    assert machine is not None
    session = _session(draw, machine, moment)
    of_drive = pairs(drive, beside=False)
    first, second = of_drive[number * PAIR_STRIDE % len(of_drive)]
    one = planned(draw, fault_case(first), round(draw.uniform(session.from_s, session.to_s), 6))
    gap_s = draw.one_of((*_GAPS_S, draw.uniform(0.0, GAP_MAX_S)))
    two = planned(draw, fault_case(second), round(one.at_s + gap_s, 6))
    actions = (*session.actions, *_afterwards(draw, two, session))
    last_s = max(two.at_s, *(each.at_s for each in actions))
    return base.model_copy(
        update={
            "name": f"{name}, {moment}",
            "angle_deg": session.angle_deg,
            "hold_s": session.hold_s,
            "actions": tuple(sorted(actions, key=lambda each: each.at_s)),
            "faults": (one, two),
            "duration_s": round(last_s + _AFTER_S, 3),
        }
    )


def _session(draw: Draw, machine: Machine, moment: Moment) -> _Session:
    """From power on to the deed that the first fault meets."""
    power = Action(at_s=_POWER_S, do="power")
    low, high = reach_deg(machine)
    if moment == "power on":
        return _Session((power,), draw.uniform(low, high), _POWER_S, _POWER_S + SWITCHING_S)
    if moment == "brake opens for a move":
        at_s = round(_POWER_S + draw.uniform(*_PARKED_S), 6)
        motion = _motion(draw, machine, at_s, jog=draw.happens(0.5))
        # A key is pressed a moment after its speed has been set.
        from_s = at_s if motion.action.do == "move" else at_s + PULSE_S
        return _Session((power, motion.action), motion.begin_deg, from_s, from_s + SWITCHING_S, _PARKS_S)
    at_s = round(_POWER_S + draw.uniform(*_READY_S), 6)
    if moment == "power off":
        off = Action(at_s=at_s, do="power_off")
        return _Session((power, off), draw.uniform(low, high), at_s, at_s + SWITCHING_S)
    if moment == "recovery":
        again_s = round(at_s + _RECOVERS_S, 6)
        stop = Action(at_s=at_s, do="quick_stop", for_s=_QUICK_STOP_S)
        recover = Action(at_s=again_s, do="recover")
        return _Session((power, stop, recover), draw.uniform(low, high), again_s, again_s + RECOVERY_S)
    motion = _motion(draw, machine, at_s, jog=moment != "last degree" and draw.happens(0.5))
    from_s, to_s = motion.within(moment)
    if moment != "stop":
        return _Session((power, motion.action), motion.begin_deg, from_s, to_s)
    stop_s = draw.uniform(from_s, to_s)
    deeds: tuple[Deed, ...] = ("halt", "stop", "power_off", "quick_stop")
    stop = Action(at_s=stop_s, do=draw.one_of(deeds))
    # No stop is shorter than that with the ramp of the quick stop.
    lasts_s = abs(motion.action.speed_deg_s) / machine.virtual_axis.quick_dec_deg_s2
    return _Session((power, motion.action, stop), motion.begin_deg, stop_s, stop_s + lasts_s)


def _motion(draw: Draw, machine: Machine, at_s: float, *, jog: bool) -> _Motion:
    """A move or key that comes to its speed within the travel."""
    top, ramps = machine.speed.setting_max_deg_s, machine.virtual_axis
    speed = top * draw.one_of((0.1, 0.2, 0.5, 1.0, draw.uniform(0.1, 1.0)))
    speed = min(speed, _RAMP_MAX_S * ramps.acc_deg_s2)
    cruise_s = draw.uniform(0.3, 2.0)
    low, high = reach_deg(machine)
    room = _TRAVEL_SHARE * (high - low)

    def time_s() -> float:
        # Of one ramp, at most, with a limit of its jerk, and of the speed.
        jerk_s = ramps.acc_deg_s2 / ramps.jerk_deg_s3 if ramps.profile == "jerk_limited" else 0.0
        return speed / ramps.acc_deg_s2 + jerk_s + cruise_s

    while speed * time_s() > room:
        speed *= 0.7
    speed, lasts_s = round(speed, 6), round(time_s(), 6)
    way, sign = speed * lasts_s, draw.one_of((-1.0, 1.0))
    begin = draw.uniform(low, high - way) if sign > 0.0 else draw.uniform(low + way, high)
    # Where a stop takes the rest of the way there is no end of travel, but for a key it may be one.
    end = round(begin + sign * way, 6)
    settings = axis_settings(machine)
    if jog:
        key = Action(at_s=at_s, do="jog", speed_deg_s=sign * speed, for_s=lasts_s)
        far = high if sign > 0.0 else low
        return _Motion(key, begin, _planned_motion(settings, begin, far, speed, at_s + PULSE_S, lasts_s))
    move = Action(at_s=at_s, do="move", target_deg=end, speed_deg_s=speed)
    return _Motion(move, begin, _planned_motion(settings, begin, end, speed, at_s))


def _planned_motion(
    settings: AxisSettings,
    begin: float,
    end: float,
    speed: float,
    at_s: float,
    released_s: float = float("inf"),
) -> tuple[tuple[float, float, float], ...]:
    """Set-point of a motion, deg and deg/s, scan by scan; a key is let go after `released_s`."""
    axis, period_s = VirtualAxis(settings), settings.period_s
    axis.follow_from(rad(begin), 0)
    axis.move_to(rad(end), rad(speed), settings.ramps, 0)
    found: list[tuple[float, float, float]] = []
    scan = 0
    while not found or not axis.at_rest:
        if scan * period_s >= released_s and not axis.stopping:
            axis.stop(settings.ramps.jog_release(settings.speed.setting_max_rad_s), scan)
        scan += 1
        axis.sample(scan)
        found.append((at_s + scan * period_s, deg(axis.pos_ref_rad), deg(axis.vel_ref_rad_s)))
    return tuple(found)


def _afterwards(draw: Draw, second: PlannedFault, session: _Session) -> list[Action]:
    """The person comes back, and moves on: what the first fault has left behind meets what comes next."""
    if not draw.happens(0.7):
        return []
    after_s = max(second.at_s, session.actions[-1].at_s)
    at_s = round(after_s + draw.uniform(0.3, 2.0), 6)
    actions = [Action(at_s=at_s, do="recover")]
    if draw.happens(0.5):
        motions = [each for each in session.actions if each.do in ("move", "jog")]
        speed = abs(motions[0].speed_deg_s) if motions else 1.0
        key = Action(
            at_s=round(at_s + 2.0, 6), do="jog", speed_deg_s=draw.one_of((-1.0, 1.0)) * speed, for_s=1.0
        )
        actions.append(key)
    return actions
