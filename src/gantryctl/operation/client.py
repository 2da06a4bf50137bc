"""Client side of an axis: commands of a command line, and reports, in this process or through the service."""

from __future__ import annotations

import math
from enum import IntEnum, StrEnum
from typing import Final, NamedTuple, Protocol

from gantryctl.errors import AlarmStop
from gantryctl.image import Direction
from gantryctl.machine import Machine
from gantryctl.program import BrakeTestOutcome

BRAKE_WATCH_S: Final = 1.0
"""How long a run or a service looks at the load behind its last power-down, s: a brake that lets go shows it only once
the torque is off. A moment of 1.5 kN m beyond friction turns 2.18e6 kg m2 by the 0.02 deg of BRK-03 within it."""


class Stop(IntEnum):
    """Urgency of a request to stop the axis."""

    NO = 0
    RAMP = 1
    QUICK = 2


class Snapshot(NamedTuple):
    """State of the axis for a display. Angles at the gantry, measured by the motor encoder.

    Attributes:
        angle_deg, speed_deg_s: None while the reading is in doubt or too old.
        time_left_s: of a motion that has an end.
    """

    time_s: float
    angle_deg: float | None
    speed_deg_s: float | None
    following_error_deg: float
    state: str
    time_left_s: float | None


class Ending(StrEnum):
    """End of a motion without an alarm."""

    DONE = "done"
    STOPPED = "stopped by the operator"
    UNREAD = "stopped: nobody reads its lines any more"
    HUNG_UP = "stopped: its terminal is gone"
    NOT_IN_POSITION = "not in position"


class MotionReport(NamedTuple):
    """A motion that has ended. Angles at the gantry, measured by the motor encoder.

    Attributes:
        from_s, to_s: its time in the recording.
        settled_s: from the end of the set-point's motion until in position; None where that is not known.
        asked_deg_s: the speed that was asked for, times override; None where the time decides (jog).
    """

    ending: Ending
    start_deg: float
    end_deg: float
    from_s: float
    to_s: float
    settled_s: float | None = None
    asked_deg_s: float | None = None

    @property
    def done(self) -> bool:
        """The motion ran to its end: not stopped, and in position where it has a target."""
        return self.ending is Ending.DONE

    @property
    def stopped(self) -> bool:
        """Somebody, or what became of the command, has ended it before its end."""
        return self.ending in (Ending.STOPPED, Ending.UNREAD, Ending.HUNG_UP)

    @property
    def text(self) -> str:
        """For `status`."""
        return self.ending.value


class BrakeDue(NamedTuple):
    """When the next brake test is due.

    Attributes:
        at: UTC, or "" where only the power-ups count, or nothing is ever due.
        power_ups_left: until it is due; None where the brake cannot be tested here.
        overdue: nothing moves faster than `overdue_deg_s` until the brake has passed a test.
    """

    at: str
    power_ups_left: int | None
    overdue: bool
    overdue_deg_s: float = math.nan

    @property
    def words(self) -> str:
        """For people."""
        if self.power_ups_left is None:
            return "not testable here"
        if self.overdue:
            return f"overdue: nothing moves faster than {self.overdue_deg_s:g} deg/s"
        cycles = f"after {self.power_ups_left} more power-ups"
        return f"due {self.at}, or {cycles}" if self.at else f"due {cycles}"


class BrakeTestReport(NamedTuple):
    """A brake test that has ended.

    Attributes:
        outcome: NONE when an alarm or a refusal ended it.
        detail: the same in a sentence, with what was measured.
        plus_nm, minus_nm: torque that the brake bore; not finite where it was not held.
        due: the next test.
    """

    outcome: BrakeTestOutcome
    detail: str
    level_nm: float
    plus_nm: float
    minus_nm: float
    moved_deg: float
    limit_deg: float
    due: BrakeDue

    @property
    def done(self) -> bool:
        """The brake has passed."""
        return self.outcome is BrakeTestOutcome.PASSED

    @property
    def text(self) -> str:
        """For `status`."""
        return f"brake test {self.outcome.name.lower()}"


# Implemented by `operation.run.AxisRun` in this process and by `cli.axis.service_axis.ServiceAxis` through the socket.
class AxisClient(Protocol):
    """The axis of one machine, for one command.

    Attributes:
        stop: raised by whoever wants the axis to stop, at any time.
        stopped_as: how a motion has ended that `stop` ends.
    """

    machine: Machine
    stop: Stop
    stopped_as: Ending

    @property
    def must_ask(self) -> bool:
        """A person must agree before something moves."""
        ...

    @property
    def speed_max_deg_s(self) -> float:
        """Highest speed setting in force: of the machine file, or of the ledger where that is lower."""
        ...

    @property
    def quick_dec_deg_s2(self) -> float:
        """Quick-stop deceleration: as measured of a drive with a ramp of its own, else that of the machine file."""
        ...

    @property
    def angle_deg(self) -> float:
        """Measured angle, motor side; to look at, without any claim on the axis."""
        ...

    def take(self) -> float:
        """Take control of an axis at rest; its angle, deg.

        Raises:
            CommandRefused: control is not to be had, or the axis moves.
        """
        ...

    def power_up(self) -> None:
        """Enable, prove torque, open the brake; nothing when that was done."""
        ...

    def power_down(self) -> None:
        """Come to rest and take the torque off, where it was switched on here."""
        ...

    def move(
        self,
        target_deg: float,
        speed_deg_s: float | None = None,
        override: float = 1.0,
        direction: Direction | None = None,
    ) -> MotionReport:
        """Move to an angle and wait until the axis stands there.

        Args:
            direction: of a modulo axis; when not given, the way that stays within its turn.

        Raises:
            CommandRefused: target or speed are not possible; nothing moved. AlarmStop: an alarm ended it.
        """
        ...

    def move_by(
        self, distance_deg: float, speed_deg_s: float | None = None, override: float = 1.0
    ) -> MotionReport:
        """Move by an angle, a modulo axis also beyond a turn; else as `move`."""
        ...

    def jog(self, forward: bool, speed_deg_s: float, seconds: float) -> MotionReport:
        """Hold the key for a time, then let go and wait for rest.

        Raises:
            CommandRefused: the speed is not possible, or the axis stands at its end. AlarmStop: an alarm ended it.
        """
        ...

    def test_brake(self) -> BrakeTestReport:
        """Give torque both ways against the closed brake, with power off.

        Raises:
            CommandRefused: it cannot be tested here, or not now. AlarmStop: an alarm ended it.
        """
        ...

    def brake_test_report(self) -> BrakeTestReport:
        """Report of a test that may not have ended."""
        ...

    def close(self, result: str, alarm: AlarmStop | None = None) -> None:
        """Leave the axis at rest, without torque that was switched on here.

        Args:
            result: how the command ended, for `status`.
        """
        ...
