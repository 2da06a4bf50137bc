"""The axis of a controller that commands no more: drive, watchdog and brake must end its motion by themselves."""

from __future__ import annotations

from gantryctl.engineering.faults.oracle.limits import StopClass
from gantryctl.engineering.faults.oracle.words import Instant, TrueAxis


class Silence:
    """From the last command on: way and time to rest (INV-1), and the rest that stays (INV-2).

    Args:
        last: what was true when the last command went out.
    """

    def __init__(self, last: Instant) -> None:
        self._last = last
        self._rest_angle: float | None = None
        self._allowed_deg: float | None = None

    def sample(self, true: TrueAxis) -> None:
        """Judge one millisecond."""
        last, passed_s = self._last, (true.ms - self._last.ms) * 1e-3
        speed = true.deg(true.speed)
        if self._rest_angle is not None:
            moved = true.deg(true.angle - self._rest_angle)
            if not -true.bounds.sag_deg <= moved <= true.bounds.sag_deg:
                true.say("INV-2", f"moved {moved:.3f} deg at rest, and nobody commands")
            return
        way = abs(true.deg(true.angle - last.angle))
        if self._allowed_deg is None:
            self._allowed_deg = true.bounds.way_deg(StopClass.SILENCE, true.deg(last.speed))
        allowed = self._allowed_deg
        if way > allowed:
            allowed = max(allowed, true.held_way_deg(last))
        if way > allowed:
            true.say("INV-1", f"{way:.3f} deg since the last command, at most {allowed:.3f}")
        if passed_s > true.bounds.rest_s[StopClass.SILENCE]:
            if abs(speed) > true.bounds.rest_deg_s:
                true.say("INV-1", f"still {speed:.3f} deg/s {passed_s:.2f} s after the last command")
            else:
                self._rest_angle = true.angle
