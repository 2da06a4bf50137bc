"""The words of a stop against what was true: times, angle moved, position, state."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Final, NamedTuple, Protocol

from gantryctl.engineering.faults.oracle.limits import Bounds, StopClass
from gantryctl.program.alarms.log import Alarm
from gantryctl.program.alarms.words import Said, Words

# ms besides the scans: a contact, or a closing time that stands for one, may be told later than the brake acts.
_EARLY_MS: Final = 3.0
_LATE_MS: Final = 60.0
_SCANS: Final = 3.0


class TrueAxis(Protocol):
    """What judges need of the axis that the oracle watches (`axis_oracle.AxisOracle`)."""

    bounds: Bounds
    ms: int
    angle: float
    speed: float
    energised: bool
    brake_open: bool

    @property
    def offset(self) -> float:
        """Of the angle that is told, rad at the motor."""
        ...

    @property
    def contact_lies(self) -> bool:
        """The contact of the brake may be late to tell that it is closed."""
        ...

    def reading_lies_ms(self, since_ms: int) -> float:
        """When the encoder began to lie behind a moment; infinite where it did not."""
        ...

    def now(self) -> Instant:
        """What is true now."""
        ...

    def can_ask(self) -> bool:
        """The controller may command a speed, and so ask a reading that stands."""
        ...

    def told_torque_off(self) -> bool:
        """An alarm says that the torque is off."""
        ...

    def deg(self, motor_rad: float) -> float:
        """An angle or a speed of the motor at the gantry, deg or deg/s."""
        ...

    def held_way_deg(self, since: Instant) -> float:
        """Permitted way of a spoilt feedback under a controller that stands still; 0 without."""
        ...

    def scans_ms(self, scans: float) -> float:
        """Time of so many scans."""
        ...

    def say(self, invariant: str, text: str) -> None:
        """Report the first violation of an invariant."""
        ...


class Instant(NamedTuple):
    """What was true at one millisecond: motor side, rad, rad/s."""

    ms: int
    angle: float
    speed: float
    energised: bool
    brake_open: bool


class Stop:
    """One stop, followed from its alarm on.

    Args:
        alarm: of a stop class.
        kind: how far and how long.
        onset: when the fault began to act; the way counts from here.
        told: when the alarm was told; its words count from here.

    Attributes:
        speeds: the true speed of each millisecond since, deg/s at the gantry.
        slow_ms: how long it has been slow. `ended`: at rest and held, `ended_ms` ago.
        lasted: a load that swings on can tear it off no longer.
        allowed_deg: the way that needs no further look.
        off_ms, closed_ms: when the torque went off and the brake closed, after the alarm.
        off: angle and speed there, where the torque went off after the alarm.
    """

    def __init__(self, alarm: Alarm, kind: StopClass, onset: Instant, told: Instant) -> None:
        self.alarm, self.kind, self.onset, self.told = alarm, kind, onset, told
        self.steps: Any = alarm.steps
        self.speeds: list[float] = []
        self.slow_ms = self.ended_ms = 0
        self.ended = self.lasted = False
        self.allowed_deg = 0.0
        # What a drive switched off by itself went off within the scan that tells it.
        self.off_ms: int | None = None if told.energised else 0
        self.off: tuple[float, float] | None = None
        self.closed_ms: int | None = None if told.brake_open else 0

    def torque_off(self, ms: int, angle: float, speed: float) -> None:
        """Torque went off."""
        self.off = (angle, speed) if self.off is None else self.off
        self.off_ms = ms - self.told.ms if self.off_ms is None else self.off_ms

    def brake_closed(self, ms: int) -> None:
        """The brake closed."""
        self.closed_ms = ms - self.told.ms if self.closed_ms is None else self.closed_ms


def judge_words(alarm: Alarm, stop: Stop, true: TrueAxis) -> Iterator[str]:
    """What the words of a finished stop say that is not so."""
    for step in alarm.steps:
        words = step.words if isinstance(step, Said) else step
        judge = _JUDGES.get(words)
        if judge is not None:
            yield from judge(dict(step.values) if isinstance(step, Said) else {}, stop, true)


def _nothing_on(_: dict[str, Any], stop: Stop, true: TrueAxis) -> Iterator[str]:
    told = stop.told
    if told.energised or told.brake_open or abs(true.deg(told.speed)) > true.bounds.rest_deg_s:
        yield f"nothing was switched on, but torque {told.energised}, brake open {told.brake_open}"


def _moved(values: dict[str, Any], stop: Stop, true: TrueAxis) -> Iterator[str]:
    moved = abs(true.deg(true.angle - stop.told.angle))
    if not abs(values["way"] - moved) <= true.bounds.told_deg:
        yield f"moved {values['way']:.3f} deg is told, true {moved:.3f}"
    position = true.deg(true.angle + true.offset)
    # Within the turn that people read: whole turns are no difference.
    if not abs(math.remainder(values["position"] - position, 360.0)) <= true.bounds.told_deg:
        yield f"position {values['position']:.3f} deg is told, true {position:.3f}"


def _at_rest(values: dict[str, Any], stop: Stop, true: TrueAxis) -> Iterator[str]:
    time_ms = values["time_ms"]
    after = stop.speeds[math.ceil(time_ms + true.scans_ms(_SCANS)) :]
    # A rotor that its brake has caught is torn off again within half a swing, which is waited for; an encoder that
    # freezes in that time shows it at rest (random seed 181645: frozen 36 ms after rest, 0.153 deg/s 0.26 s later).
    lies_ms = true.reading_lies_ms(stop.told.ms)
    if math.isfinite(lies_ms):
        after = stop.speeds[math.ceil(time_ms + true.scans_ms(_SCANS)) : int(lies_ms) - stop.told.ms]
    if after and max(after) > true.bounds.told_rest_deg_s:
        yield f"at rest after {time_ms:.0f} ms is told, {max(after):.3f} deg/s later"


def _torque_off(values: dict[str, Any], stop: Stop, true: TrueAxis) -> Iterator[str]:
    return _time("torque off", values["time_ms"], stop.off_ms, true)


def _torque_seen_off(values: dict[str, Any], stop: Stop, true: TrueAxis) -> Iterator[str]:
    return _time("torque seen off", values["time_ms"], stop.off_ms, true, late_ms=math.inf)


def _brake_closed(values: dict[str, Any], stop: Stop, true: TrueAxis) -> Iterator[str]:
    late_ms = math.inf if true.contact_lies else _LATE_MS
    return _time("brake closed", values["time_ms"], stop.closed_ms, true, late_ms=late_ms)


def _brake_seen_closed(values: dict[str, Any], stop: Stop, true: TrueAxis) -> Iterator[str]:
    return _time("brake seen closed", values["time_ms"], stop.closed_ms, true, late_ms=math.inf)


_Judge = Callable[[dict[str, Any], Stop, TrueAxis], Iterator[str]]
_JUDGES: Final[dict[Words, _Judge]] = {
    Words.NOTHING_ON: _nothing_on,
    Words.MOVED_TO: _moved,
    Words.AT_REST_AFTER: _at_rest,
    Words.TORQUE_OFF_AFTER: _torque_off,
    Words.TORQUE_OFF_SEEN: _torque_seen_off,
    Words.BRAKE_CLOSED_AFTER: _brake_closed,
    Words.BRAKE_CLOSED_SEEN: _brake_seen_closed,
}


def _time(
    what: str, told_ms: float, true_ms: int | None, true: TrueAxis, late_ms: float = _LATE_MS
) -> Iterator[str]:
    scans_ms = true.scans_ms(_SCANS)
    if true_ms is None:
        yield f"{what} after {told_ms:.0f} ms is told, and is not so"
    elif not true_ms - _EARLY_MS - scans_ms <= told_ms <= true_ms + late_ms + scans_ms:
        yield f"{what} after {told_ms:.0f} ms is told, true {true_ms} ms"
