"""Judgement of HOLD: whether the drive may be asked for torque, and whether its torque really holds the load."""

from __future__ import annotations

from typing import Final

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import Alarm, AlarmLog
from gantryctl.program.feedback import ENABLED, Feedback
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg, rad

# A sound drive without a brake catches 50 kN m at 0.13 to 0.21 deg/s and stops it within 0.3 s; a brake that
# slips at rest moves the load by 0.15 deg at most until then, where a slip of 0.02 deg is told. A rotary table tells
# one of 0.19 deg.
_MOVED_RAD: Final = rad(0.15)
_SAG_RAD: Final = rad(0.02)
_SPEED_RAD_S: Final = rad(0.1)
_CATCH_S: Final = 0.300
# A drive with a wrong sign doubles its speed in some 20 ms; a load of 50 kN m that falls freely gains 0.06 deg/s in 50.
_DRIVEN_S: Final = 0.050
# After these nobody gives torque back by itself: the drive does not obey, or another master may command it.
_NO_HOLD_AFTER: Final = frozenset(
    {Code.CAN_12, Code.CAN_14, Code.CTL_05, Code.DRV_05, Code.DRV_07, Code.DRV_13}
)
_ABLE: Final = (
    *ENABLED,
    DriveState.SWITCH_ON_DISABLED,
    DriveState.READY_TO_SWITCH_ON,
    DriveState.SWITCHED_ON,
)


class HoldWatch:
    """Raise BRK-13 for a load that moves in HOLD, and take the torque off where it drives the load.

    Args:
        settings: scan period, torque of the brake test, permitted sag.
        feedback: state, speed and torque of the drive.
        alarms: where the alarm is raised.
    """

    __slots__ = (
        "_alarms", "_driven", "_feedback", "_held", "_moved_max_rad", "_period_s", "_speed_before", "_test_torque_nm",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        self._feedback, self._alarms = feedback, alarms
        self._period_s, self._test_torque_nm = settings.period_s, settings.power.test_torque_nm
        self._moved_max_rad = _MOVED_RAD * max(1.0, settings.power.sag_max_rad / _SAG_RAD)
        self.begin()

    def begin(self) -> None:
        """A phase begins."""
        self._held = self._driven = 0
        self._speed_before = 0.0

    def possible(self) -> bool:
        """Whether the drive can be asked for torque at zero speed."""
        feedback = self._feedback
        # Torque is never given back by itself with the emergency stop open, also when the brake slips (C4).
        inputs = feedback.inputs
        ready = inputs.estop_closed and inputs.mains_ready and feedback.position_valid
        if not ready or feedback.state not in _ABLE:
            return False
        return not any(map(_forbids_hold, self._alarms.active.values()))

    @property
    def has_held(self) -> bool:
        """The drive has had torque in this HOLD."""
        return self._held > 0

    def scan(self, moved_rad: float) -> None:
        """Judge one scan of HOLD.

        Args:
            moved_rad: angle since HOLD began.
        """
        feedback = self._feedback
        if feedback.state in ENABLED:
            self._held += feedback.periods
        # Written so that NaN is a load that moves.
        slow = abs(feedback.vel_rad_s) <= _SPEED_RAD_S
        late = self._held * self._period_s > _CATCH_S
        if late and not slow:
            self._tell(moved_rad)
        else:
            self.tell_if_moved(moved_rad)
        if slow or not self._held:
            self._driven = 0
        else:
            self._watch_drive(moved_rad)

    def tell_if_moved(self, moved_rad: float) -> None:
        """Raise BRK-13 where the load has moved further than a brake that slips at rest moves it."""
        if not moved_rad <= self._moved_max_rad:
            self._tell(moved_rad)

    def _watch_drive(self, moved_rad: float) -> None:
        """Take the torque off where it drives the load instead of holding it."""
        feedback = self._feedback
        torque_nm, speed = feedback.torque_nm, abs(feedback.vel_rad_s)
        # No load needs more than the brake is tested with. More torque against a motion that grows is a reading of
        # the wrong sign: the drive then pushes where it means to brake.
        against = torque_nm * feedback.vel_rad_s <= 0.0
        wrong_reading = against and abs(torque_nm) > self._test_torque_nm
        if self._driven == 0:
            self._speed_before = speed
        if speed < self._speed_before or (against and not wrong_reading):
            self._driven = 0
            return
        self._driven = feedback.lasting(self._driven)
        if self._driven * self._period_s >= _DRIVEN_S:
            if wrong_reading:
                feedback.doubt(Code.BRK_13, measured=deg(moved_rad), speed=deg(speed))
            else:
                self._tell(moved_rad, Reaction.TORQUE_OFF)

    def _tell(self, moved_rad: float, reaction: Reaction | None = None) -> None:
        speed = deg(abs(self._feedback.vel_rad_s))
        self._alarms.raise_(Code.BRK_13, reaction, measured=deg(moved_rad), speed=speed)


def _forbids_hold(alarm: Alarm) -> bool:
    """Whether torque may not come back by itself: feedback or drive are in doubt, or it drove the load."""
    if alarm.code in _NO_HOLD_AFTER:
        return True
    doubt = alarm.code is Code.BRK_13 or alarm.code.startswith("ENC-")
    return doubt and alarm.reaction >= Reaction.TORQUE_OFF
