"""The position loop with compensations, and the monitor of the second encoder."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

from gantryctl._core import PositionLaw
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.alarms.words import Clauses, Said, Words
from gantryctl.program.feedback import Feedback
from gantryctl.program.settings import AxisSettings, CompensationSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg

if TYPE_CHECKING:
    from gantryctl.program.monitors.calibration_watch import CalibrationWatch, Finding

_TURN: Final = 2.0 * math.pi
_NEXT_RAD: Final = 1.2 * math.pi
# A swing of the load on the motor's torque is over.
_CHANGED_S: Final = 5.0

# Speed command (motor side), actual angle and following error (gantry side).
Command = tuple[float, float, float]
# The same with torque, disagreement and change of the moment, and the law that gives them.
_Answer = tuple[float, float, float, float, float, float]
_Run = Callable[[PositionLaw, float, float, float, float, float, float], _Answer]


class LoadSide:
    """Position law with compensations, in place of the bare one (decision 10).

    Motor encoder and maps give the angle of the load; the load-side encoder corrects it slowly. Where the two
    differ by more than both can be wrong, one of them is wrong and it is not known which: the position is in doubt.

    Attributes:
        torque_ff_nm: torque of this scan, motor side, on top of what the power sequence asks for.
        disagreement_rad: load-side encoder minus the angle by motor encoder and maps.
        moment_change_nm: of the eccentric moment since the calibration, as the observer sees it; 0 where it is not
            resolved.
        watch: whether the calibration still fits; None where nothing tells, or nobody asks.
    """

    __slots__ = (
        "_alarms", "_changed", "_changed_scans", "_count", "_feedback", "_law", "_limit", "_moment_limit",
        "_run", "_run_again", "_scans", "_turn_counts", "_turn_rad", "_turns", "_watched",
        "disagreement_rad", "laws", "moment_change_nm", "torque_ff_nm", "watch",
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
        # A law has memory, so every axis has its copy.
        self.laws = compensation.laws.copy()
        self._run = self.laws.scan
        self._run_again = self.laws.scan_again
        self._watched = compensation.load_encoder
        self._limit = compensation.disagreement_rad
        self._scans = settings.scans(compensation.disagreement_time_s)
        self._moment_limit = compensation.moment_limit_nm
        self._changed_scans = settings.scans(_CHANGED_S)
        self.watch: CalibrationWatch | None = None
        if compensation.watch is not None and settings.power.torque_preload:
            # A machine without a calibration does not load it.
            from gantryctl.program.monitors.calibration_watch import CalibrationWatch

            self.watch = CalibrationWatch(
                compensation.watch, settings.period_s, settings.law.ratio, load_side=compensation.load_encoder
            )
        self._count = self._changed = 0
        self._turn_rad = 0.0
        turn = settings.law.turn_counts
        self._turn_counts = None if turn is None else float(turn)
        self._turns = 0
        self.torque_ff_nm = 0.0
        self.disagreement_rad = self.moment_change_nm = 0.0

    def scan(self, virtual: VirtualAxis, counts: float) -> Command:
        """Return the command of this scan; `counts` minus the zero offset."""
        if self._turn_counts is not None:
            self._next_turn(virtual.pos_ref_rad)
        vel, pos, error, self.torque_ff_nm, self.disagreement_rad, self.moment_change_nm = self._by(
            self._run, virtual, counts
        )
        if self._watched:
            self._watch()
        if self.moment_change_nm > self._moment_limit:
            self._moment_changed()
        else:
            self._changed = 0
        watch = self.watch
        if watch is not None:
            if not virtual.at_rest:
                watch.scan(
                    virtual.pos_ref_rad,
                    virtual.vel_ref_rad_s,
                    virtual.acc_ref_rad_s2,
                    self._feedback.torque_nm,
                    self.disagreement_rad,
                    self.laws.backlash_change_rad if self._watched else 0.0,
                )
            elif watch.rest():
                self.warn_stale()
        return vel, pos, error

    def warn_stale(self) -> None:
        """Name what of the calibration no longer fits: as long as there is no other, after a reset too."""
        if self.watch is not None and self.watch.found:
            self._alarms.raise_(Code.CTL_22, measured=stale_words(self.watch.found))
            self._alarms.complete(Code.CTL_22, measured=stale_words(self.watch.found))

    def scan_again(self, virtual: VirtualAxis, counts: float) -> Command:
        """Return the command for another set-point in the same scan: a law with memory counts no scan twice."""
        vel, pos, error, self.torque_ff_nm, _, _ = self._by(self._run_again, virtual, counts)
        return vel, pos, error

    def _by(self, run: _Run, virtual: VirtualAxis, counts: float) -> _Answer:
        """One scan of the laws: of a modulo axis, within the turn that they count from."""
        ref, ring = virtual.pos_ref_rad, self._feedback.pos_ring_rad + self._turn_rad
        vel, acc, torque = virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2, self._feedback.torque_nm
        if self._turn_counts is None:
            return run(self._law, ref, vel, acc, counts, ring, torque)
        turn_rad = self._turns * _TURN
        ref -= turn_rad
        # An encoder of one turn on the ring goes round with the axis.
        if math.isfinite(ring):
            ring += _TURN * round((ref - ring) / _TURN)
        counts -= self._turns * self._turn_counts
        cmd, pos, error, torque_nm, disagreement, change = run(self._law, ref, vel, acc, counts, ring, torque)
        return cmd, pos + turn_rad, error, torque_nm, disagreement, change

    def _next_turn(self, ref_rad: float) -> None:
        """Let the laws count from the turn that the set-point is in: an angle of theirs is one of a turn."""
        # Beyond +-180 deg by a tenth of a turn: no axis that stands there goes to and fro.
        if abs(ref_rad - self._turns * _TURN) > _NEXT_RAD:
            made = round(ref_rad / _TURN) - self._turns
            self._turns += made
            self.laws.turn_back(made * _TURN)

    def turn_back(self, turns: int) -> None:
        """The zero of a modulo axis has moved on by whole turns; the angles of the laws stay what they are."""
        self._turns -= turns

    def resting(self, counts: float) -> float:
        """Return the angle of the load while the axis does not follow."""
        self.torque_ff_nm = 0.0
        pos = self.laws.resting_position(self._law, counts)
        # An encoder of one turn on the ring shows -180 deg where the motor shows +180 deg: whole turns are no
        # disagreement of two encoders, of which the motor's counts the turns.
        apart = pos - self._feedback.pos_ring_rad
        self._turn_rad = _TURN * round(apart / _TURN) if math.isfinite(apart) else 0.0
        return pos

    def begin(self) -> None:
        """Restart the laws: the axis follows from the next scan on."""
        self.laws.restart()
        self._count = 0

    def new_reference(self, pos_rad: float) -> float:
        """Angle of the motor, at the gantry, when a new reference puts the load at `pos_rad`."""
        self.laws.forget_bias()
        return pos_rad + self.laws.lead(pos_rad)

    def _moment_changed(self) -> None:
        """Warn of a moment beyond what a person expects; the laws follow it to the limit and no further."""
        self._changed = self._feedback.lasting(self._changed)
        if self._changed >= self._changed_scans:
            self._alarms.raise_(
                Code.CTL_19, measured=1e-3 * self.moment_change_nm, limit=1e-3 * self._moment_limit
            )

    def _watch(self) -> None:
        # Disagreement is TORQUE OFF: a monitor that doubts the position cannot trust a ramp on it (decision 10).
        limit = self._limit
        if -limit <= self.disagreement_rad <= limit:  # NaN fails
            self._count = 0
            return
        self._count = self._feedback.lasting(self._count)
        if self._count >= self._scans:
            self._feedback.doubt(Code.ENC_07, measured=deg(self.disagreement_rad), limit=deg(limit))


_STALE: Final = {
    "moment": Words.STALE_MOMENT,
    "friction": Words.STALE_FRICTION,
    "backlash": Words.STALE_BACKLASH,
    "lost_motion": Words.STALE_LOST_MOTION,
    "scale": Words.STALE_SCALE,
}
_TORQUES: Final = ("moment", "friction")


def stale_words(found: Mapping[str, Finding]) -> Clauses:
    """What no longer fits, with what was measured and its bound."""
    said: list[Said] = []
    for name, (measured, bound) in found.items():
        shown = (measured, bound) if name in _TORQUES else (deg(measured), deg(bound))
        said.append(_STALE[name](measured=shown[0], limit=shown[1]))
    return Clauses(said)
