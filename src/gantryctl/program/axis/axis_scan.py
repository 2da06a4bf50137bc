"""One scan of an axis: feedback, alarms, power, set-point, position loop, output guard."""

from __future__ import annotations

import math
from typing import Final

from gantryctl._core import PositionLaw
from gantryctl.image import InputImage, OutputImage
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog, Refusal
from gantryctl.program.axis.commands import MotionCommands
from gantryctl.program.axis.load_side import LoadSide
from gantryctl.program.axis.states import AxisEvents, AxisState, next_state
from gantryctl.program.feedback import Feedback
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.monitors.recovery import Recovery
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import AxisSettings, StandstillPolicy
from gantryctl.program.virtual_axis import VirtualAxis

_OFF: Final = PowerPhase.OFF
_ON: Final = PowerPhase.ON
_new = tuple.__new__  # builds an image in half the time of its constructor


class AxisScan:
    """What an axis does every scan; `Axis` adds what a program may ask of it."""

    __slots__ = (
        "_error", "_events", "_hold_scans", "_law", "_ratio", "_settled", "_switching_off", "_torque_max",
        "_vel_max", "_vel_next", "alarms", "brake_test", "feedback", "interlocks", "load_side", "monitors", "motion",
        "pos_act_rad", "pos_err_rad", "power", "recovery", "refusal", "refusal_count", "scan", "settings", "state",
        "time_s", "vel_cmd_rad_s", "virtual", "zero_counts",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, zero_counts: float, *, keep_plans: bool = False) -> None:
        law = settings.law
        self.settings = settings
        self.zero_counts = zero_counts
        self._ratio = law.ratio
        self._vel_max = settings.speed.command_clamp_rad_s * law.ratio
        self._torque_max = settings.power.torque_max_nm
        position_law = PositionLaw(law.kpp_per_s, law.kvf, law.ratio, law.counts_per_turn, self._vel_max)
        self._law = position_law.scan
        self.alarms = AlarmLog()
        self.feedback = Feedback(settings, self.alarms)
        self.load_side = (
            None
            if settings.compensation is None
            else LoadSide(settings, settings.compensation, position_law, self.feedback, self.alarms)
        )
        self.virtual = VirtualAxis(settings, keep_plans=keep_plans)
        self.power = PowerSequence(settings, self.feedback, self.alarms)
        self.brake_test = self.power.brake_test
        self.interlocks = Interlocks(settings, self.feedback, self.alarms)
        self.monitors = Monitors(settings, self.feedback, self.virtual, self.power.holding, self.alarms)
        self.motion = MotionCommands(
            settings, self.virtual, self.power, self.monitors, self.interlocks, self.alarms
        )
        self.recovery = Recovery(settings, self.feedback, self.power, self.alarms)
        self.state = AxisState.DISABLED
        self.scan = -1
        self.time_s = 0.0
        self.pos_act_rad = self.pos_err_rad = self.vel_cmd_rad_s = self._vel_next = 0.0
        power = settings.power
        self._hold_scans = (
            settings.scans(power.hold_brake_after_s)
            if power.standstill is StandstillPolicy.BRAKE
            else math.inf
        )
        self.refusal: Refusal | None = None
        self.refusal_count = 0
        self._error = self._switching_off = False
        self._settled = True
        self._events = AxisEvents(False, False, False, None)

    def begin(self, image: InputImage) -> None:
        """Take the image: feedback, set-point, monitors, reactions, power."""
        scan, time_s, drive, _ = image
        alarms, feedback, virtual, power = self.alarms, self.feedback, self.virtual, self.power
        feedback.periods = scan - self.scan
        self.scan = self.motion.scan = alarms.scan = scan
        self.time_s = alarms.time_s = time_s
        feedback.scan(drive, self.vel_cmd_rad_s)
        counts = feedback.counts - self.zero_counts
        virtual.changed = False
        if virtual.following:
            virtual.sample(scan)
            if self.load_side is None:
                self._vel_next, pos, self.pos_err_rad = self._law(
                    virtual.pos_ref_rad, virtual.vel_ref_rad_s, counts
                )
            else:
                self._vel_next, pos, self.pos_err_rad = self.load_side.scan(virtual, counts)
            self.pos_act_rad = alarms.pos_rad = pos
            self.monitors.scan(pos, self.pos_err_rad, self.vel_cmd_rad_s)
        else:
            if self.load_side is None:
                _, pos, _ = self._law(0.0, 0.0, counts)
            else:
                pos = self.load_side.resting(counts)
            self.pos_act_rad = alarms.pos_rad = pos
            virtual.release(pos)
            self.monitors.scan_released(pos)
        self.interlocks.scan(pos, power.phase is not _OFF)
        power.step(pos)
        if alarms.pending or self._error or self._switching_off or self.recovery.resetting:
            self._interrupted()
        if power.phase is _ON:
            if not virtual.following:
                self._follow()
            elif self.monitors.rest_scans >= self._hold_scans:
                self._hold_with_brake()
        elif virtual.following:
            self._unfollow()
        self.motion.progress()

    def end(self) -> OutputImage:
        """What this scan says to the drive, after the program's logic; decides on the axis state."""
        virtual, power, motion = self.virtual, self.power, self.motion
        vel_cmd = 0.0
        torque = power.torque_ff_nm
        if virtual.following:
            if virtual.changed:
                self._control_again()
            vel_cmd = self._vel_next
            if self.load_side is not None:
                torque += self.load_side.torque_ff_nm
        vel_max, torque_max = self._vel_max, self._torque_max
        if not (-vel_max <= vel_cmd <= vel_max and -torque_max <= torque <= torque_max):
            vel_cmd, torque = self._guard(vel_cmd, torque)
        self.vel_cmd_rad_s = vel_cmd
        current = motion.current
        events = (
            self._error,
            power.status,
            motion.stop_command is not None or (self._switching_off and not virtual.at_rest),
            None if current is None else current.state,
        )
        if events != self._events or not self._settled:
            self._decide(AxisEvents(*events))
        return _new(OutputImage, (power.request, vel_cmd, torque, power.brake_open))

    def _control_again(self) -> None:
        """The program took a new plan in this scan: the position loop once more, for its set-point."""
        virtual, counts = self.virtual, self.feedback.counts - self.zero_counts
        self._vel_next, self.pos_act_rad, self.pos_err_rad = (
            self._law(virtual.pos_ref_rad, virtual.vel_ref_rad_s, counts)
            if self.load_side is None
            else self.load_side.scan_again(virtual, counts)
        )

    # --- the slow paths ---------------------------------------------------------------------------

    def _guard(self, vel_cmd: float, torque_nm: float) -> tuple[float, float]:
        """Nothing that is no number or over its limit reaches the drive: stop, command 0."""
        what = f"speed command {vel_cmd}" if not -self._vel_max <= vel_cmd <= self._vel_max else (
            f"torque command {torque_nm}"
        )  # fmt: skip
        self.alarms.raise_(Code.CTL_02, measured=what)
        self._react()
        self._unfollow()
        torque = torque_nm if -self._torque_max <= torque_nm <= self._torque_max else 0.0
        return 0.0, torque

    def _interrupted(self) -> None:
        """An alarm to act on, an alarm latched, power going off, or a reset under way."""
        if self.alarms.pending:
            self._react()
        if self._error:
            self.recovery.scan(self.scan, self.pos_act_rad)
        if self._switching_off and self.virtual.at_rest:
            self._switching_off = False
            self.power.switch_off()
        if self.recovery.resetting and self.recovery.finished():
            self._reset_now()

    def _react(self) -> None:
        """Take the strongest reaction that waits; what it stops ends with the first alarm as its error."""
        reaction, self.alarms.pending = self.alarms.pending, Reaction.W
        first = self.alarms.first_out
        if reaction is Reaction.HLT and (blocking := self.alarms.blocking()) is not None:
            self.motion.stop_by(blocking.refusal)
        if first is None or reaction < Reaction.QUICK_STOP:
            return
        self._error = True
        self._switching_off = False
        self.motion.fail_all(first.refusal)
        self.recovery.stop_begun(first)
        self.power.react(reaction)

    def _reset_now(self) -> None:
        """Forget the alarms; the axis stays as it is: Reset never enables."""
        if self.recovery.service:
            self.feedback.accept_position()
            self.power.rebase()
        self.alarms.clear()
        self.monitors.reset()
        self._error = False
        self.power.release_hold()

    def _follow(self) -> None:
        """Power is on: the set-point is where the axis is, and the axis follows from now on."""
        self.virtual.follow_from(self.pos_act_rad, self.scan)
        if self.load_side is not None:
            self.load_side.begin()
        self.monitors.reset()
        self.monitors.open_the_way_back(self.pos_act_rad)

    def _unfollow(self) -> None:
        """The drive ramps by itself or is going off: the set-point is where the axis is."""
        self.virtual.release(self.pos_act_rad)
        self.pos_err_rad = 0.0

    def _hold_with_brake(self) -> None:
        motion = self.motion
        if motion.current is None and motion.stop_command is None and not self._switching_off:
            self.power.park()
            self._unfollow()

    def _decide(self, events: AxisEvents) -> None:
        self._events = events
        before, self.state = self.state, next_state(self.state, events)
        self._settled = before is self.state
        self.motion.state = self.state
