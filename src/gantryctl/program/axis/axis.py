"""The axis as a program sees it: commands, status, trace."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from gantryctl._core import Segments
from gantryctl.image import DriveState
from gantryctl.motion import SetPoint, stop_point
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.axis.axis_scan import AxisScan
from gantryctl.program.axis.command import CommandStatus, MotionCommand
from gantryctl.program.axis.states import AxisState
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.virtual_axis import OVERRIDE_MIN
from gantryctl.units import deg

TRACE_COLUMNS: Final = (
    "pos_ref_rad",
    "vel_ref_rad_s",
    "acc_ref_rad_s2",
    "pos_act_rad",
    "vel_act_rad_s",
    "vel_cmd_rad_s",
    "torque_act_nm",
    "pos_err_rad",
    "axis_state",
    "drive_state",
    "alarm_count",
)
"""What every axis writes per scan; all at the gantry but the torque, which is the motor's."""

_NO_POWER: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE, DriveState.UNKNOWN)


class Axis(AxisScan):
    """One axis. A program calls `begin(image)`, then its own logic, then `end()`, once per scan.

    The order inside a scan is fixed: (edges,) alarms, interlocks, power, the program's mode logic, virtual
    axis, position loop, output guard. While no monitor acts and the axis follows, the set-point of scan k
    is `plan.sample((k - start_scan) x period)` and the speed command is `PositionLaw.scan` of it, bit for
    bit.

    Args:
        settings: the machine, in SI.
        zero_counts: encoder count at 0 deg (retained memory).
        keep_plans: keep every plan with its start scan in `plans`.

    Attributes:
        state: PLCopen axis state.
        scan, time_s: of the present image.
        pos_act_rad, pos_err_rad: measured angle; set-point minus measured angle, 0 while not following.
        vel_cmd_rad_s: the last speed command, motor side.
        zero_counts: encoder count at 0 deg; SetPosition and Home change it, and then it is to be retained.
        alarms: what is wrong, first-out, history.
        refusal, refusal_count: the last command that was refused, and how many there were.
        power, virtual, motion, monitors, feedback: its parts, to look at.
    """

    __slots__ = ()

    trace_columns = TRACE_COLUMNS

    # --- asked for by programs and blocks ---------------------------------------------------------

    def power_on(self) -> Refusal | None:
        """Begin to switch on; None when it was accepted. `power.status` tells when it is on."""
        if self.power.brake_test.under_way:
            return refusal(Code.PWR_04, measured="a brake test is under way")
        if self.power.phase is not PowerPhase.OFF:
            if self._switching_off or self.power.falling or self.power.phase is PowerPhase.TORQUE_HOLD:
                return refusal(Code.PWR_04, measured="the axis is still being switched off")
            return None
        reason = self._no_torque(None)
        if reason is not None:
            return refusal(Code.PWR_04, measured=reason)
        self.power.switch_on()
        return None

    def begin_brake_test(self) -> Refusal | None:
        """Begin a brake test; None when it was accepted. `brake_test.under_way` tells when it has ended."""
        power = self.power
        if self.brake_test.under_way:
            return refusal(Code.CTL_14, measured="a brake test is under way already")
        if self.settings.power.untestable:
            return refusal(Code.CTL_14, measured=f"not testable here: {self.settings.power.untestable}")
        if power.phase is not PowerPhase.OFF:
            return refusal(Code.CTL_14, measured="a brake test begins with power off: switch it off first")
        room = self.settings.power.torque_max_nm - abs(power.holding.mean_nm)
        level = self.brake_test.level_nm
        if not level <= room:
            text = f"a brake test with {level:.1f} N m and the load are more than the motor's torque limit"
            return refusal(Code.CTL_14, measured=text)
        reason = self._no_torque(Code.BRK_08)
        if reason is not None:
            return refusal(Code.PWR_04, measured=reason)
        power.begin_test()
        return None

    def judge_brake(self, *, overdue: bool) -> None:
        """Limit the speed of later commands while the brake test is overdue (BRK-12).

        The program has no calendar (decision 14): the caller judges date and power-ups.
        """
        self.motion.brake_overdue = overdue

    def abort_brake_test(self, why: str) -> None:
        """End a brake test that is under way: torque back, off, drive disabled."""
        self.power.abort_test(why)

    def stop(self) -> MotionCommand:
        """To rest on the jog-release ramp, held until released; a brake test under way ends."""
        if self.power.brake_test.under_way:
            self.abort_brake_test("stopped")
            command = MotionCommand(AxisState.STOPPING, 0.0, 0.0, settles=False)
            command.status = CommandStatus.DONE
            return command
        return self.motion.stop()

    def _no_torque(self, but: Code | None) -> str | None:
        """Why the drive may not be enabled now; the alarm `but` does not count."""
        inputs, first = self.feedback.inputs, self.alarms.first_out
        reason = None
        blocking = self.alarms.blocking(but)
        if first is not None:
            reason = f"{first.code} is latched ({first.measured}): reset first"
        elif blocking is not None:
            reason = f"{blocking.code} is active ({blocking.measured}): {blocking.definition.before_motion}"
        elif not inputs.estop_ok:
            reason = "the emergency-stop chain is open"
        elif not inputs.mains_ready:
            reason = "the mains are not ready"
        elif self.feedback.state in _NO_POWER:
            reason = "the drive is in fault or its state is unknown: reset first"
        elif not self.feedback.position_valid:
            reason = "the position is not valid: service must compare the angle and reset"
        return reason

    def power_off(self) -> None:
        """Come to rest on the jog-release ramp, close the brake, take the torque off."""
        if self.power.brake_test.under_way:
            self.abort_brake_test("power was switched off")
            return
        if self.power.phase is PowerPhase.OFF or self._error or self._switching_off:
            return
        self.motion.abort_for_power_off()
        self._switching_off = True

    def reset(self, *, service: bool = False) -> Refusal | None:
        """Clear alarms whose cause is gone; None when accepted. Never enables, never shortens a stop."""
        if not self.alarms.active and self.feedback.position_valid:
            return None
        return self.recovery.request(service)

    def quick_stop(self) -> None:
        """QUICK STOP asked for by a person: ErrorStop afterwards."""
        if self.power.phase is not PowerPhase.OFF:
            speed = deg(self.feedback.vel_rad_s)
            self.alarms.raise_(Code.INT_06, measured=deg(self.pos_act_rad), speed=speed)
            self._interrupted()
            self._unfollow()

    def stop_by(self, code: Code, /, **values: object) -> Refusal:
        """HLT: end the present motion on the jog-release ramp with `code` as its error; power stays on."""
        reason = self.alarms.note(code, **values)
        self.motion.stop_by(reason)
        return reason

    def set_override(self, override: float) -> Refusal | None:
        """Speed override 0..1 for this motion and all later ones; 0 stops, and it goes on when raised.

        Raised from 0 it is judged like a new motion: when that would be refused, so is the override.
        """
        if not 0.0 <= override <= 1.0:
            return refusal(Code.CTL_01, name="override", allowed="within 0 and 1", measured=override)
        if override == self.virtual.override:
            return None
        refused = self.motion.check_resume() if override >= OVERRIDE_MIN else None
        if refused is not None:
            return refused
        return self.virtual.set_override(override, self.scan)

    def set_acceleration(self, acc_rad_s2: float) -> Refusal | None:
        """Acceleration of the normal motions from now on, at most that of the settings; deceleration in proportion.

        Only at standstill. Halt and every other stop keep the ramps of the settings.
        """
        ramps = self.settings.ramps
        if not 0.0 < acc_rad_s2 <= ramps.acc_rad_s2:
            allowed = f"above 0 and at most {deg(ramps.acc_rad_s2):.4g} deg/s2"
            return refusal(
                Code.CTL_01, name="acceleration", allowed=allowed, measured=f"{deg(acc_rad_s2):.6g} deg/s2"
            )
        if not self.virtual.at_rest or self.motion.current is not None:
            return refusal(Code.CTL_14, measured="the acceleration changes at standstill only")
        dec = ramps.dec_rad_s2 * acc_rad_s2 / ramps.acc_rad_s2
        self.virtual.use_ramps(replace(ramps, acc_rad_s2=acc_rad_s2, dec_rad_s2=dec))
        return None

    def set_position(self, position_rad: float) -> Refusal | None:
        """Call the present angle `position_rad`; only at standstill, and never so that the encoder wraps."""
        refused = self._check_reference(position_rad)
        if refused is not None:
            return refused
        counts_per_rad = self.settings.law.counts_per_turn * self.settings.law.ratio / (2.0 * math.pi)
        motor_rad = position_rad if self.load_side is None else self.load_side.new_reference(position_rad)
        self.zero_counts = self.feedback.counts - motor_rad * counts_per_rad
        self.power.rebase()
        self.pos_act_rad = position_rad
        if self.virtual.following:
            self._follow()
        else:
            self._unfollow()
        return None

    def home(self, position_rad: float) -> MotionCommand:
        """The direct form of homing: `set_position` as a command, one scan in state Homing. Nothing moves."""
        command = MotionCommand(AxisState.HOMING, position_rad, 0.0, settles=False)
        if self.state is not AxisState.STANDSTILL:
            return command.fail(refusal(Code.CTL_14, measured="Home needs Standstill"))
        refused = self.set_position(position_rad)
        if refused is not None:
            return command.fail(refused)
        self.motion.take(command)
        return command

    def report_refusal(self, reason: Refusal) -> None:
        """Remember the last refused command, for whoever shows it."""
        self.refusal = reason
        self.refusal_count += 1

    def _check_reference(self, position_rad: float) -> Refusal | None:
        travel, law = self.settings.travel, self.settings.law
        if not travel.pos_min_rad <= position_rad <= travel.pos_max_rad:
            allowed = f"within {deg(travel.pos_min_rad):.2f} and {deg(travel.pos_max_rad):.2f} deg"
            measured = f"{deg(position_rad):.6g} deg"
            return refusal(Code.CTL_01, name="position", allowed=allowed, measured=measured)
        standing = (
            self.state in (AxisState.STANDSTILL, AxisState.DISABLED) and not self.power.brake_test.under_way
        )
        if not standing or self.motion.current is not None or self.motion.waiting is not None:
            return refusal(Code.CTL_14, measured="a new reference needs standstill")
        if not self.virtual.at_rest or abs(self.feedback.vel_rad_s) > self.settings.speed.creep_rad_s:
            return refusal(Code.CTL_14, measured="a new reference needs standstill")
        turn_rad = 2.0 * math.pi / law.ratio  # one motor turn at the gantry
        raw_rad = self.feedback.counts / law.counts_per_turn * turn_rad
        low = raw_rad - position_rad + travel.pos_min_rad
        high = raw_rad - position_rad + travel.pos_max_rad
        margin = min(low, law.turns * turn_rad - high)
        if margin < law.wrap_margin_rad:
            text = (
                f"the encoder would wrap {deg(margin):.2f} deg from the travel, "
                f"at least {deg(law.wrap_margin_rad):.2f} deg wanted"
            )
            return refusal(Code.CTL_14, measured=text)
        return None

    # --- looked at --------------------------------------------------------------------------------

    @property
    def plans(self) -> list[tuple[int, Segments]]:
        """Every plan taken with its start scan, if asked for with `keep_plans`."""
        return self.virtual.plans

    @property
    def in_position(self) -> bool:
        """At rest within the window for the dwell time."""
        return self.virtual.following and self.monitors.in_position

    @property
    def holding_torque_nm(self) -> float:
        """Learned torque that holds the load at standstill, motor side: for retained memory."""
        return self.power.holding.mean_nm

    @property
    def paused(self) -> bool:
        """A motion is under way or waits for the brake, and override 0 holds it back."""
        motion, virtual = self.motion, self.virtual
        return virtual.paused or (motion.waiting is not None and virtual.override < OVERRIDE_MIN)

    @property
    def switching_off(self) -> bool:
        """Power was taken back and the axis is coming to rest before it goes down."""
        return self._switching_off

    @property
    def resetting(self) -> bool:
        """A reset is under way."""
        return self.recovery.resetting

    def stopping_angle_rad(self) -> float:
        """How far the set-point would still go if a hold-to-run key were released now."""
        virtual = self.virtual
        start = SetPoint(virtual.pos_ref_rad, virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2)
        limits = self.settings.ramps.jog_release(self.settings.speed.setting_max_rad_s)
        return abs(stop_point(start, limits) - start.pos_rad)

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
