"""Motion of a shaft that should stand: behind a closed brake, or under torque as the brake opens."""

from __future__ import annotations

from typing import Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.rest import REST_S
from gantryctl.program.settings import AxisSettings
from gantryctl.units import deg, rad

# A drive that owns its brake may take the torque off while the brake still closes. The gear then unwinds: 0.020 deg on
# the motor side with 16 kN m and the swing of a quick stop, 0.026 deg with 50 kN m; over after 0.3 s.
_UNWIND_RAD: Final = rad(0.03)
_UNWIND_S: Final = 0.300


class SlipWatch:
    """The angle since a phase began, against what brake or torque may let the shaft move.

    Args:
        settings: permitted angle, scan period.
    """

    __slots__ = ("_alarms", "_doubted_moving", "_feedback", "_from_rad", "_period_s", "_rest_scans",
                 "_sag_max_rad", "_unwinding")  # fmt: skip

    def __init__(self, settings: AxisSettings, feedback: Feedback, alarms: AlarmLog) -> None:
        self._feedback, self._alarms = feedback, alarms
        self._period_s, self._sag_max_rad = settings.period_s, settings.power.sag_max_rad
        self._rest_scans = settings.scans(REST_S)
        self.begin(None, unwinds=False)

    def begin(self, pos_rad: float | None, *, unwinds: bool) -> None:
        """A phase begins.

        Args:
            pos_rad: the angle counts from here; None for the next one that is judged.
            unwinds: the torque may have gone off while the brake still closed.
        """
        self._from_rad: float | None = pos_rad
        self._unwinding, self._doubted_moving = unwinds, 0

    def rebase(self) -> None:
        """The position was set anew."""
        self._from_rad = None

    def moved(self, pos_rad: float) -> float:
        """Angle since the phase began, or since the position was set anew."""
        if self._from_rad is None:
            self._from_rad = pos_rad
        return abs(pos_rad - self._from_rad)

    def slipped(self, pos_rad: float, code: Code) -> bool:
        """Raise `code` for more motion than the brake, or the torque, may allow."""
        moved = self.moved(pos_rad)
        if moved <= self._sag_max_rad:
            return False
        self._raise(code, moved)
        return True

    def slipped_without_torque(self, pos_rad: float, elapsed_s: float, code: Code) -> bool:
        """The same with torque off, where the gear may still unwind and a doubted reading may jump.

        Args:
            elapsed_s: since the phase began.
        """
        moved = self.moved(pos_rad)
        limit = self._sag_max_rad
        if self._unwinding:
            limit += _UNWIND_RAD
            if moved <= limit and elapsed_s > _UNWIND_S:
                self._unwinding, self._from_rad = False, pos_rad
        if moved <= limit or not self._believed(pos_rad):
            return False
        self._raise(code, moved)
        return True

    def _believed(self, pos_rad: float) -> bool:
        """Whether a closed brake slips, or only a doubted reading jumps: then its speed must show it too."""
        if self._feedback.position_valid:
            return True
        if self._feedback.slow:
            self._from_rad, self._doubted_moving = pos_rad, 0
            return False
        self._doubted_moving = self._feedback.lasting(self._doubted_moving)
        return self._doubted_moving >= self._rest_scans

    def _raise(self, code: Code, moved_rad: float) -> None:
        self._alarms.raise_(code, measured=deg(moved_rad), limit=deg(self._sag_max_rad))
