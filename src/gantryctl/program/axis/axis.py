"""The axis: its scan, its commands and its status."""

from __future__ import annotations

import math
from typing import Final, assert_never

from gantryctl._core import PositionLaw, new_image
from gantryctl.image import InputImage, OutputImage, StopCause, SystemStop
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import AlarmLog, Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import check_ramp
from gantryctl.program.axis.commands import MotionCommands
from gantryctl.program.axis.load_side import LoadSide
from gantryctl.program.axis.motion_command import CommandStatus, MotionCommand
from gantryctl.program.axis.permission import why_no_brake_test, why_no_torque
from gantryctl.program.axis.reference import Reference
from gantryctl.program.axis.states import AxisEvents, AxisState, next_state
from gantryctl.program.axis.turns import Turns
from gantryctl.program.feedback import Feedback
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.monitors.liveness import Liveness
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.monitors.recovery import Recovery
from gantryctl.program.monitors.site import SiteInterlocks
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import AxisSettings, StandstillPolicy
from gantryctl.program.virtual_axis import OVERRIDE_MIN, VirtualAxis

# All at the gantry but the torque, which is the motor's.
TRACE_COLUMNS: Final = (
    "pos_ref_rad", "vel_ref_rad_s", "acc_ref_rad_s2", "pos_act_rad", "vel_act_rad_s", "vel_cmd_rad_s",
    "torque_act_nm", "pos_err_rad", "axis_state", "drive_state", "alarm_count",
)  # fmt: skip

_OFF: Final = PowerPhase.OFF
_ON: Final = PowerPhase.ON
_TORQUE_HOLD: Final = PowerPhase.TORQUE_HOLD
# Where the reading is tried: by speed commands, while the drive ramps by itself, and by its torque where it holds zero
# speed. A drive that ramps turns the shaft against its torque, and HOLD has a watch of its own.
_TRIED: Final = (PowerPhase.ON, PowerPhase.SAG_WATCH)
# A contact that goes on saying closed keeps the axis in RELEASING with its brake open (random seed 102094).
# A drive that owns its brake holds the load on its own ramp in DISABLING, until its brake has closed.
_HELD: Final = (*_TRIED, PowerPhase.RELEASING, PowerPhase.CLOSING, PowerPhase.UNLOADING, PowerPhase.DISABLING)
_OPENING: Final = (PowerPhase.RELEASING, PowerPhase.SAG_WATCH)
# A drive that owns its brake closes it in DISABLING: with power off in the middle of a question it had -385 N m for
# 0.16 s on a frozen reading (random seed 200015).
_BRAKE_CLOSING: Final = (PowerPhase.CLOSING, PowerPhase.DISABLING)
_NO_TORQUE: Final = (PowerPhase.OFF, PowerPhase.PARKED, PowerPhase.TORQUE_OFF)


class Axis:
    """One axis. A program calls `begin(image)`, then its own logic, then `end()`, once per scan.

    The order inside a scan is fixed: (edges,) alarms, interlocks, power, the program's mode logic, virtual
    axis, position loop, output guard. While no monitor acts and the axis follows, the set-point of scan k
    is `plan.sample((k - start_scan) x period)` and the speed command is `PositionLaw.scan` of it, bit for
    bit (decision 5); at rest `liveness.vel_rad_s` comes on top where a reading stands still.

    Args:
        settings: the machine, in SI.
        zero_counts: encoder count at 0 deg (retained memory).
        keep_plans: keep every plan with its start scan in `plans`.

    Attributes:
        state: PLCopen axis state.
        scan, time_s: of the present image.
        pos_act_rad, pos_err_rad: measured angle; set-point minus measured angle, 0 while not following.
        vel_cmd_rad_s: the last speed command, motor side.
        zero_counts: encoder count at 0 deg; SetPosition and Home change it, and then it is to be retained. That of a
            modulo axis moves on with its turns.
        turns: those of a modulo axis; None for a linear one.
        alarms: active alarms, first-out, history.
        refusal, refusal_count: the last command that was refused, and how many there were.
        system_stop: what the engine stopped the axis for, until a reset; or None.
        brake_test: the brake test and its last result.
        plans: every plan taken with its start scan, if asked for with `keep_plans`.
        power, virtual, motion, monitors, thermal, feedback, recovery: the parts, for reading.
    """

    __slots__ = (
        "_drives_against", "_error", "_events", "_law", "_park_scans", "_ratio", "_reference", "_settled",
        "_site", "_torque_max", "_vel_max", "_vel_next", "alarms", "brake_test", "feedback",
        "interlocks", "liveness", "load_side", "monitors", "motion", "plans", "pos_act_rad", "pos_err_rad",
        "power", "recovery", "refusal", "refusal_count", "scan", "settings", "state", "system_stop", "thermal",
        "time_s", "turns", "vel_cmd_rad_s", "virtual", "zero_counts",
    )  # fmt: skip

    trace_columns = TRACE_COLUMNS

    def __init__(self, settings: AxisSettings, zero_counts: float, *, keep_plans: bool = False) -> None:
        law = settings.law
        self.settings = settings
        self.turns = None if law.turn_counts is None else Turns(law.turn_counts, zero_counts)
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
        self.plans = self.virtual.plans
        self.power = PowerSequence(settings, self.feedback, self.alarms)
        self.brake_test = self.power.brake_test
        self.interlocks = Interlocks(settings, self.feedback, self.alarms)
        self._site = SiteInterlocks(settings, self.feedback, self.alarms)
        self.thermal = MotorThermal(settings, self.feedback, self.alarms)
        self.monitors = Monitors(settings, self.feedback, self.virtual, self.power.holding, self.alarms)
        self.liveness = Liveness(settings, self.feedback, self.power.holding, self.alarms)
        self._drives_against = self.liveness.against
        self.motion = MotionCommands(
            settings, self.virtual, self.power, self.monitors, self.interlocks, self.alarms
        )
        self.recovery = Recovery(settings, self.feedback, self.power, self.alarms)
        self._reference = Reference(settings, self.feedback, self.load_side)
        self.state = AxisState.DISABLED
        self.scan = -1
        self.time_s = 0.0
        self.pos_act_rad = self.pos_err_rad = self.vel_cmd_rad_s = self._vel_next = 0.0
        parks = settings.power.standstill is StandstillPolicy.BRAKE
        self._park_scans = settings.scans(settings.power.hold_brake_after_s) if parks else math.inf
        self.system_stop: SystemStop | None = None
        self.refusal: Refusal | None = None
        self.refusal_count = 0
        self._error = False
        self._settled = True
        self._events: AxisEvents | None = None

    def begin(self, image: InputImage) -> None:
        """Take the image: feedback, set-point, monitors, reactions, power."""
        scan, time_s, drive, _, stop = image
        alarms, feedback, virtual, power = self.alarms, self.feedback, self.virtual, self.power
        feedback.periods = scan - self.scan
        self.scan = self.motion.scan = alarms.scan = scan
        self.time_s = alarms.time_s = time_s
        # Before the feedback is judged: what a stall has done to the bus is a consequence of it.
        if stop is not None:
            self._stopped_by_engine(stop)
        feedback.scan(drive, self.vel_cmd_rad_s)
        counts = feedback.counts - self.zero_counts
        virtual.changed = False
        if virtual.following:
            # Sampled by the scan number, never summed: missed scans need no catching up (decision 5).
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
                # Only the angle of the law is used: there is no command while the drive ramps by itself or is off.
                _, pos, _ = self._law(0.0, 0.0, counts)
            else:
                pos = self.load_side.resting(counts)
            self.pos_act_rad = alarms.pos_rad = pos
            virtual.release(pos)
            self.monitors.scan_released(pos)
        powered = power.phase is not _OFF
        if self.interlocks.scan(pos, powered):
            self._site.scan(pos, powered, not self.at_rest)
        self.thermal.scan(time_s)
        self._step_power(pos)
        # An alarm raised in this scan acts on the output of this scan.
        if alarms.pending or self._error or self.motion.switching_off or self.recovery.resetting:
            self._interrupted()
        if power.phase is _ON:
            if not virtual.following:
                self._follow()
            # Behind the brake nobody could ask any more whether the reading lives.
            elif self.monitors.rest_scans >= self._park_scans and not self.liveness.asking:
                self._park()
        elif virtual.following:
            self._unfollow()
        self.motion.progress()

    def end(self) -> OutputImage:
        """Return the command to the drive, after the program's logic; decide on the axis state."""
        virtual, power, motion = self.virtual, self.power, self.motion
        vel_cmd = 0.0
        torque = power.torque_ff_nm
        # The one place that decides the speed command; 0 unless the axis follows.
        if virtual.following:
            if self.turns is not None:
                self._turn_back(self.turns)
            if virtual.changed:
                self._control_again()
            vel_cmd = self._vel_next
            if self.load_side is not None:
                torque += self.load_side.torque_ff_nm
        if self.liveness.vel_rad_s and virtual.at_rest and power.phase in _TRIED:
            vel_cmd += self.liveness.vel_rad_s
        vel_max, torque_max = self._vel_max, self._torque_max
        if not (-vel_max <= vel_cmd <= vel_max and -torque_max <= torque <= torque_max):
            vel_cmd, torque = self._guard(vel_cmd, torque)
        self.vel_cmd_rad_s = vel_cmd
        current = motion.current
        events = (
            self._error,
            power.status,
            motion.stop_command is not None or (motion.switching_off and not virtual.at_rest),
            None if current is None else current.state,
        )
        # A plain tuple: the state table is entered only when one of its inputs has changed.
        if events != self._events or not self._settled:
            self._decide(AxisEvents(*events))
        at_rest = virtual.at_rest and self.feedback.slow and self.feedback.speed_known
        return new_image(
            OutputImage,
            power.request,
            vel_cmd,
            torque,
            power.brake_open,
            self.alarms.horn,
            power.phase is not _OFF,
            virtual.following and self.monitors.in_position,
            at_rest,
            power.phase is _TORQUE_HOLD,
            power.phase is PowerPhase.TORQUE_OFF,
        )

    def _control_again(self) -> None:
        """Run the position loop again, for the set-point of a plan that the program took in this scan."""
        virtual, counts = self.virtual, self.feedback.counts - self.zero_counts
        self._vel_next, self.pos_act_rad, self.pos_err_rad = (
            self._law(virtual.pos_ref_rad, virtual.vel_ref_rad_s, counts)
            if self.load_side is None
            else self.load_side.scan_again(virtual, counts)
        )

    # --- asked for by programs and blocks ---------------------------------------------------------

    def power_on(self) -> Refusal | None:
        """Begin to switch on; None when it was accepted. `power.status` tells when it is on."""
        if self.brake_test.under_way:
            return refusal(Code.PWR_04, reason=Words.TEST_UNDER_WAY)
        if not self.is_off:
            if self.motion.switching_off or self.power.falling or self.power.phase is PowerPhase.TORQUE_HOLD:
                return refusal(Code.PWR_04, reason=Words.SWITCHING_OFF)
            return None
        refused = why_no_torque(self.feedback, self.alarms)
        if refused is None:
            self.power.switch_on()
        return refused

    def begin_brake_test(self) -> Refusal | None:
        """Begin a brake test; None when it was accepted. `brake_test.under_way` tells when it has ended."""
        refused = why_no_brake_test(self.settings.power, self.power, self.feedback, self.alarms)
        if refused is None:
            self.power.begin_test()
        return refused

    def judge_brake(self, *, overdue: bool) -> None:
        """Limit the speed of later commands while the brake test is overdue (BRK-12).

        The program has no calendar (decision 14): the caller judges date and power-ups.
        """
        self.motion.brake_overdue = overdue

    def abort_brake_test(self, why: Words) -> None:
        """End a brake test that is under way: torque back, off, drive disabled."""
        self.power.abort_test(why)

    def stop(self) -> MotionCommand:
        """Come to rest on the jog-release ramp, held until released; end a brake test under way."""
        if self.brake_test.under_way:
            self.abort_brake_test(Words.STOPPED)
            command = MotionCommand(AxisState.STOPPING)
            command.status = CommandStatus.DONE
            return command
        return self.motion.stop()

    def power_off(self) -> None:
        """Come to rest on the jog-release ramp, close the brake, take the torque off."""
        if self.brake_test.under_way:
            self.abort_brake_test(Words.POWER_SWITCHED_OFF)
            return
        # After an alarm there is nothing to stop, and no phase that this ends.
        if not self.is_off:
            self.motion.abort_for_power_off()

    def reset(self, *, service: bool = False) -> Refusal | None:
        """Clear alarms whose cause is gone; None when accepted. Never enables, never shortens a stop."""
        if not self.alarms.active and self.feedback.position_valid:
            return None
        return self.recovery.request(service)

    def quick_stop(self, code: Code = Code.INT_06, /, **values: object) -> None:
        """Stop on the quick-stop ramp of the drive; ErrorStop afterwards.

        Args:
            code: why; a person has asked for it.
            values: of its message.
        """
        if not self.is_off:
            self.alarms.raise_(
                code, None, **(values or {"measured": self.feedback.where_moving(self.pos_act_rad)})
            )
            self._interrupted()
            self._unfollow()

    def stop_by(self, code: Code, /, **values: object) -> None:
        """End the present motion on the jog-release ramp with `code` as its error (HLT); power stays on."""
        self.motion.stop_by(self.alarms.note(code, **values))

    def set_override(self, override: float) -> Refusal | None:
        """Set the speed override 0..1 of this motion and all later ones; 0 stops, and it goes on when raised.

        Raised from 0 it is judged like a new motion: when that would be refused, so is the override.
        """
        if not 0.0 <= override <= 1.0:
            return refusal(
                Code.CTL_01, name=Words.NAME_OVERRIDE, allowed=Words.WITHIN_ZERO_AND_ONE, measured=override
            )
        if override == self.virtual.override:
            return None
        refused = self.motion.check_resume() if override >= OVERRIDE_MIN else None
        if refused is not None:
            return refused
        return self.virtual.set_override(override, self.scan)

    def set_acceleration(self, acc_rad_s2: float) -> Refusal | None:
        """Set the acceleration of later motions, at most that of the settings; deceleration in proportion.

        Only at standstill. Halt and every other stop keep the ramps of the settings.
        """
        ramps = self.settings.ramps
        refused = check_ramp(Words.NAME_ACCELERATION, acc_rad_s2, ramps.acc_rad_s2)
        if refused is not None:
            return refused
        if not self.virtual.at_rest or self.motion.current is not None:
            return refusal(Code.CTL_14, reason=Words.ACCELERATION_AT_REST)
        # Deceleration keeps its ratio to acceleration, as in the machine file.
        dec = ramps.dec_rad_s2 * acc_rad_s2 / ramps.acc_rad_s2
        # A program may have lowered the jerk.
        self.virtual.ramps = self.virtual.ramps.below(acc_rad_s2, dec, None)
        return None

    def set_position(self, position_rad: float) -> Refusal | None:
        """Call the present angle `position_rad`; only at standstill, and never so that the encoder wraps."""
        resting = self.state in (AxisState.STANDSTILL, AxisState.DISABLED) and not self.brake_test.under_way
        refused = self._reference.check(position_rad, resting and self.at_rest)
        if refused is not None:
            return refused
        self.zero_counts = self._reference.zero_counts(position_rad)
        if self.turns is not None:
            self.zero_counts = self.turns.begin(self.zero_counts)
        self.power.rebase()
        # An angle that was not known (NaN) says nothing of the new one.
        by_rad = position_rad - self.pos_act_rad
        if math.isfinite(by_rad):
            self.monitors.drag.model.turn(by_rad)
        else:
            self.monitors.drag.model.forget()
        self.pos_act_rad = position_rad
        if self.virtual.following:
            self._follow()
        else:
            self._unfollow()
        return None

    def home(self, position_rad: float) -> MotionCommand:
        """Set the position as a command, one scan in state Homing: the direct form of homing. Nothing moves."""
        command = MotionCommand(AxisState.HOMING)
        if self.state is not AxisState.STANDSTILL:
            return command.fail(refusal(Code.CTL_14, reason=Words.HOME_AT_REST))
        refused = self.set_position(position_rad)
        if refused is not None:
            return command.fail(refused)
        self.motion.take(command)
        return command

    def report_refusal(self, reason: Refusal) -> None:
        """Keep the last refused command, for displays."""
        self.refusal = reason
        self.refusal_count += 1

    # --- slow paths of a scan ---------------------------------------------------------------------

    def _guard(self, vel_cmd: float, torque_nm: float) -> tuple[float, float]:
        """Stop instead of sending a command that is not finite or above its limit (B2); command 0."""
        torque_ok = -self._torque_max <= torque_nm <= self._torque_max
        speed_ok = -self._vel_max <= vel_cmd <= self._vel_max
        what = Words.TORQUE_COMMAND(value=torque_nm) if speed_ok else Words.SPEED_COMMAND(value=vel_cmd)
        self.alarms.raise_(Code.CTL_02, measured=what)
        self._react()
        self._unfollow()
        return 0.0, torque_nm if torque_ok else 0.0

    def _stopped_by_engine(self, stop: SystemStop) -> None:
        """Raise the alarm of a stop that the engine asks for; `_react` gives it the angle of this scan."""
        self.system_stop = stop
        match stop.cause:
            case StopCause.FROZEN:
                self.alarms.raise_(Code.SYS_03, late_s=stop.measured, limit_s=stop.limit)
            case StopCause.SCAN_LATE:
                late = Words.SCAN_LATE(late_ms=stop.measured * 1e3, limit_ms=stop.limit * 1e3)
                self.alarms.raise_(Code.SYS_02, measured=late)
            case StopCause.OVERRUNS:
                self.alarms.raise_(
                    Code.SYS_02, measured=Words.OVERRUNS(count=stop.measured, limit=stop.limit)
                )
            case _:
                assert_never(stop.cause)

    def _step_power(self, pos_rad: float) -> None:
        power = self.power
        if power.phase in _OPENING:
            # Before the step judges how far the shaft has moved: that follows from a sign that is wrong.
            self._ask_torque()
        power.step(pos_rad)
        if power.phase is not _OFF:
            self._try_reading()

    def _try_reading(self) -> None:
        """Ask whether the reading lives, wherever the drive holds the axis or brings it to rest."""
        power, feedback = self.power, self.feedback
        if not self.virtual.at_rest:
            if power.phase is _ON:
                self.liveness.move()
            return
        self._ask_torque()
        if power.phase is _ON:
            self.liveness.stand(proven=True)
        elif power.phase is PowerPhase.SAG_WATCH:
            self.liveness.stand(proven=power.reading_shown)
        elif (power.phase is PowerPhase.QUICK_STOPPING and feedback.brake_off) or (
            power.phase in _BRAKE_CLOSING and feedback.brake_open
        ):
            self.liveness.stop()

    def _ask_torque(self) -> None:
        """Ask whether the drive pushes the shaft the way that the reading tells; asked twice in a scan it counts once.

        In motion the resonance of the load may turn the shaft against the torque; there a wrong sign is a leap. So it
        may in a quick stop, but a sound one never leaves its ramp.
        """
        power, feedback = self.power, self.feedback
        if feedback.torque_nm * feedback.vel_rad_s < self._drives_against:
            if power.phase in _HELD:
                self.liveness.drive_against()
            elif power.phase is PowerPhase.QUICK_STOPPING:
                self.liveness.ramp_against(left=power.ramp_left)

    def _interrupted(self) -> None:
        """Act on a pending or latched alarm, on power that goes off, or on a reset under way."""
        if self.alarms.pending:
            self._react()
        # Whatever phase another alarm has led to: no torque on a reading in doubt.
        if self.feedback.in_doubt and self.power.phase not in _NO_TORQUE:
            self.power.react(Reaction.TORQUE_OFF)
        if self._error:
            self.recovery.scan(self.scan, self.pos_act_rad)
        if self.motion.switching_off and self.virtual.at_rest:
            self.motion.switching_off = False
            self.power.switch_off()
        if self.recovery.finished():
            self._reset_now()

    def _react(self) -> None:
        """Take the strongest pending reaction; what it stops ends with the first alarm as its error."""
        reaction, self.alarms.pending = self.alarms.pending, Reaction.W
        self.alarms.locate(math.nan if self.feedback.in_doubt else self.alarms.pos_rad)
        first = self.alarms.first_out
        if reaction is Reaction.HLT and (blocking := self.alarms.blocking()) is not None:
            self.motion.stop_by(blocking.refusal)
        # One cause, one first-out alarm; what follows from it is folded under it.
        if first is None or reaction < Reaction.QUICK_STOP:
            return
        self._error = True
        self.motion.switching_off = False
        self.motion.fail_all(first.refusal)
        self.recovery.stop_begun(first)
        self.power.react(reaction)

    def _reset_now(self) -> None:
        """Clear the alarms; the axis stays as it is: Reset never enables."""
        if self.recovery.service:
            # A doubted position counts again only after service has compared the angle.
            self.feedback.accept_position()
            self.power.rebase()
            if Code.BRK_02 in self.alarms.active:
                self.monitors.drag.model.forget()
        self.alarms.clear()
        self.monitors.reset()
        self._error = False
        self.system_stop = None
        self.power.release_hold()

    def _follow(self) -> None:
        """Follow from now on, from a set-point at the measured angle."""
        self.virtual.follow_from(self.pos_act_rad, self.scan)
        if self.load_side is not None:
            self.load_side.begin()
        self.monitors.reset()
        self.monitors.open_the_way_back(self.pos_act_rad)

    def _unfollow(self) -> None:
        """Stop following: the drive ramps by itself or goes off, and the set-point is the measured angle."""
        self.virtual.release(self.pos_act_rad)
        self.pos_err_rad = 0.0

    def _turn_back(self, turns: Turns) -> None:
        """Move the zero of a modulo axis on by the turns that it has made, where nothing is planned to an angle."""
        virtual = self.virtual
        made = turns.due(virtual.pos_ref_rad, resting=self.at_rest, cruising=virtual.cruising)
        if made:
            self.zero_counts = turns.move_on(made)
            virtual.turn_back(made, self.scan)
            self.monitors.turn_back(made)
            self.pos_act_rad -= made * math.tau
            if self.load_side is not None:
                self.load_side.turn_back(made)

    def _park(self) -> None:
        motion = self.motion
        if motion.current is None and motion.stop_command is None:
            self.power.park()
            self._unfollow()

    def _decide(self, events: AxisEvents) -> None:
        self._events = events
        before, self.state = self.state, next_state(self.state, events)
        self._settled = before is self.state

    # --- status -------------------------------------------------------------------------------------

    @property
    def at_rest(self) -> bool:
        """No motion under way or waiting for the brake, and the set-point at rest."""
        motion = self.motion
        return motion.current is None and motion.waiting is None and self.virtual.at_rest

    @property
    def is_off(self) -> bool:
        """Power is off: drive disabled, brake closed."""
        return self.power.phase is _OFF

    @property
    def plan_end_s(self) -> float:
        """Axis time at which the set-point comes, or came, to rest; infinite on a plan without an end."""
        if self.virtual.plan.vel_end != 0.0:
            return math.inf
        return self.virtual.start_scan * self.settings.period_s + self.virtual.plan.duration

    @property
    def in_position(self) -> bool:
        """At rest within the window for the dwell time."""
        return self.virtual.following and self.monitors.in_position

    @property
    def holding_torque_nm(self) -> float:
        """Learned torque that holds the load at standstill, motor side: for retained memory."""
        return self.power.holding.mean_nm

    @property
    def torque_weights(self) -> tuple[float, ...]:
        """Learned torque model of motions: for retained memory; () until learned."""
        return self.monitors.drag.model.weights

    @property
    def calibration_memory(self) -> dict[str, object]:
        """What the watch of the calibration has seen and found: for retained memory; {} where nothing is watched."""
        watch = None if self.load_side is None else self.load_side.watch
        return {} if watch is None else watch.memory

    @property
    def paused(self) -> bool:
        """A motion is under way or waits for the brake, and override 0 holds it back."""
        motion, virtual = self.motion, self.virtual
        return virtual.paused or (motion.waiting is not None and virtual.override < OVERRIDE_MIN)

    def stopping_angle_rad(self) -> float:
        """Angle that the set-point would still travel if a hold-to-run key were released now."""
        return self.virtual.stopping_angle_rad(
            self.settings.ramps.jog_release(self.settings.speed.setting_max_rad_s)
        )

    def trace_row(self) -> tuple[float, ...]:
        """This scan in the order of `trace_columns`."""
        virtual, feedback = self.virtual, self.feedback
        return (
            virtual.pos_ref_rad,
            virtual.vel_ref_rad_s,
            virtual.acc_ref_rad_s2,
            self.pos_act_rad,
            feedback.vel_rad_s,
            self.vel_cmd_rad_s / self._ratio,
            feedback.torque_nm,
            self.pos_err_rad,
            float(self.state),
            float(feedback.state),
            float(len(self.alarms.active)),
        )
