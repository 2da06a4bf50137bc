"""The position loop with compensations, and the watch over the second encoder."""

from __future__ import annotations

from gantryctl._core import PositionLaw
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings, CompensationSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg

Command = tuple[float, float, float]
"""Speed command (motor side), actual angle and following error (gantry side)."""


class LoadSide:
    """Takes the place of the bare position law where compensations are on.

    Motor encoder and maps say where the load is; the load-side encoder corrects that slowly. Where the two
    differ by more than both can be wrong, one of them lies, and nobody knows which: the position is doubted.

    Attributes:
        torque_ff_nm: torque of this scan, motor side, on top of what the power sequence asks for.
        disagreement_rad: load-side encoder minus the angle by motor encoder and maps.
    """

    __slots__ = (
        "_alarms", "_count", "_feedback", "_law", "_limit", "_run", "_run_again", "_scans", "_watched",
        "disagreement_rad", "laws", "torque_ff_nm",
    )  # fmt: skip

    def __init__(
        self,
        settings: AxisSettings,
        compensation: CompensationSettings,
        law: PositionLaw,
        feedback: Feedback,
        alarms: AlarmLog,
    ) -> None:
        self._law = law
        self._feedback = feedback
        self._alarms = alarms
        self.laws = compensation.laws.copy()
        self._run = self.laws.scan
        self._run_again = self.laws.scan_again
        self._watched = compensation.load_encoder
        self._limit = compensation.disagreement_rad
        self._scans = settings.scans(compensation.disagreement_time_s)
        self._count = 0
        self.torque_ff_nm = 0.0
        self.disagreement_rad = 0.0

    def scan(self, virtual: VirtualAxis, counts: float) -> Command:
        """The command of this scan; `counts` minus the zero offset."""
        vel, pos, error, self.torque_ff_nm, self.disagreement_rad = self._run(
            self._law,
            virtual.pos_ref_rad,
            virtual.vel_ref_rad_s,
            virtual.acc_ref_rad_s2,
            counts,
            self._feedback.pos_ring_rad,
        )
        if self._watched:
            self._watch()
        return vel, pos, error

    def scan_again(self, virtual: VirtualAxis, counts: float) -> Command:
        """The same scan with another set-point."""
        vel, pos, error, self.torque_ff_nm, _ = self._run_again(
            self._law,
            virtual.pos_ref_rad,
            virtual.vel_ref_rad_s,
            virtual.acc_ref_rad_s2,
            counts,
            self._feedback.pos_ring_rad,
        )
        return vel, pos, error

    def resting(self, counts: float) -> float:
        """Angle of the load while the axis does not follow."""
        self.torque_ff_nm = 0.0
        return self.laws.resting_position(self._law, counts)

    def begin(self) -> None:
        """The axis follows from the next scan on."""
        self.laws.restart()
        self._count = 0

    def new_reference(self, pos_rad: float) -> float:
        """What the motor stands at, at the gantry, where the load is at `pos_rad` by a new reference."""
        self.laws.forget_bias()
        return pos_rad + self.laws.lead(pos_rad)

    def _watch(self) -> None:
        limit = self._limit
        if -limit <= self.disagreement_rad <= limit:  # NaN fails
            self._count = 0
            return
        self._count = self._feedback.lasting(self._count)
        if self._count >= self._scans:
            self._feedback.position_valid = False
            self._alarms.raise_(Code.ENC_07, measured=deg(self.disagreement_rad), limit=deg(limit))
