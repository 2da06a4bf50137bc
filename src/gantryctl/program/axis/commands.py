"""Commands of the axis: order, begin and end of motions and stops."""

from __future__ import annotations

import math
from typing import assert_never

from gantryctl.image import BufferMode, Direction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog, Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import (
    check_destination,
    check_direction,
    check_dynamics,
    check_overdue,
    check_range,
    check_speed,
    check_way,
    way_to,
)
from gantryctl.program.axis.motion_command import (
    MACHINE_DYNAMICS,
    Aim,
    CommandStatus,
    Dynamics,
    Goal,
    MotionCommand,
)
from gantryctl.program.axis.states import AxisState
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import AxisSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg


class MotionCommands:
    """Takes commands for the virtual axis. A new command aborts the one before, unless it is to wait for its end.

    A command that is refused changes nothing. While the brake holds the axis at standstill, an accepted
    command waits until the brake is open again. A stop, an alarm or power-off drops whatever waits, so nothing
    old can run after them.

    Attributes:
        current: the command under way, or None.
        brake_overdue: the brake test is overdue, so the speed is limited (`Axis.judge_brake`).
        buffered: the command that waits for the end of the one before, or None: there is one such place.
        speed_max_rad_s: highest speed of later motions, at most the highest setting.
        stop_command: the Stop that holds the axis, or None.
        switching_off: power goes off as soon as the axis is at rest; until then it takes no command.
        scan: of the axis, set by `Axis`.
        waiting: the command that waits for the brake, or None.
    """

    __slots__ = (
        "_alarms", "_interlocks", "_monitors", "_power", "_settings", "_sign", "_stop_execute", "_virtual",
        "brake_overdue", "buffered", "current", "scan", "speed_max_rad_s", "stop_command",
        "switching_off", "waiting",
    )  # fmt: skip

    def __init__(
        self,
        settings: AxisSettings,
        virtual: VirtualAxis,
        power: PowerSequence,
        monitors: Monitors,
        interlocks: Interlocks,
        alarms: AlarmLog,
    ) -> None:
        self._settings = settings
        self._virtual, self._power, self._monitors = virtual, power, monitors
        self._interlocks, self._alarms = interlocks, alarms
        self.current: MotionCommand | None = None
        self.waiting: MotionCommand | None = None
        self.buffered: MotionCommand | None = None
        self.speed_max_rad_s = settings.speed.setting_max_rad_s
        self.stop_command: MotionCommand | None = None
        self._stop_execute = self.brake_overdue = self.switching_off = False
        # Direction of the last motion.
        self._sign = 1.0
        self.scan = 0

    # --- commands ---------------------------------------------------------------------------------

    def move_absolute(
        self,
        target_rad: float,
        speed_rad_s: float,
        direction: Direction | None = None,
        dynamics: Dynamics = MACHINE_DYNAMICS,
        buffer_mode: BufferMode = BufferMode.ABORTING,
    ) -> MotionCommand:
        """Begin a motion to `target_rad` with `speed_rad_s`.

        Args:
            direction: of a modulo axis, the shortest way unless given; a linear axis has one way and takes none.
        """
        aim = Aim(Goal.ANGLE, target_rad, direction)
        return self._ask(MotionCommand(AxisState.DISCRETE_MOTION, aim, speed_rad_s, dynamics), buffer_mode)

    def move_relative(
        self,
        distance_rad: float,
        speed_rad_s: float,
        dynamics: Dynamics = MACHINE_DYNAMICS,
        buffer_mode: BufferMode = BufferMode.ABORTING,
    ) -> MotionCommand:
        """Begin a motion by `distance_rad` from the set-point."""
        aim = Aim(Goal.WAY, distance_rad)
        return self._ask(MotionCommand(AxisState.DISCRETE_MOTION, aim, speed_rad_s, dynamics), buffer_mode)

    def move_additive(
        self,
        distance_rad: float,
        speed_rad_s: float,
        dynamics: Dynamics = MACHINE_DYNAMICS,
        buffer_mode: BufferMode = BufferMode.ABORTING,
    ) -> MotionCommand:
        """Begin a motion by `distance_rad` on from the target of the motion under way, else from the set-point."""
        aim = Aim(Goal.WAY_ON, distance_rad)
        return self._ask(MotionCommand(AxisState.DISCRETE_MOTION, aim, speed_rad_s, dynamics), buffer_mode)

    def move_velocity(
        self,
        vel_rad_s: float,
        dynamics: Dynamics = MACHINE_DYNAMICS,
        buffer_mode: BufferMode = BufferMode.ABORTING,
        *,
        held: bool = False,
    ) -> MotionCommand:
        """Begin a motion with `vel_rad_s`, its sign the direction, until stopped or at the end of the travel.

        Args:
            held: it lasts while a key is held.
        """
        aim = Aim(Goal.SPEED, vel_rad_s)
        command = MotionCommand(AxisState.CONTINUOUS_MOTION, aim, abs(vel_rad_s), dynamics, held=held)
        return self._ask(command, buffer_mode)

    def change_speed(self, command: MotionCommand, speed_rad_s: float) -> Refusal | None:
        """Change the speed of a command under way."""
        refused = self.check_speed(speed_rad_s)
        if refused is None and command is self.current:
            refused = self._virtual.change_speed(speed_rad_s, self.scan)
        if refused is None:
            command.speed_rad_s = speed_rad_s
        return refused

    def halt(self) -> MotionCommand:
        """Come to rest on the normal ramp; another motion may take over before."""
        command = MotionCommand(AxisState.DISCRETE_MOTION)
        # What forbids a new motion does not forbid to end the present one.
        refused = self._check_ready()
        if refused is not None:
            return command.fail(refused)
        self._virtual.stop(self._settings.ramps.normal(self._settings.speed.setting_max_rad_s), self.scan)
        self.take(command)
        return command

    def release(self, command: MotionCommand) -> None:
        """Come to rest on the jog-release ramp: a hold-to-run key was released."""
        if command is self.waiting:
            self.drop_waiting()
        elif command is self.current:
            command.endless = False
            self._stop_on_jog_ramp()

    def stop(self) -> MotionCommand:
        """Come to rest on the jog-release ramp and take no other command until `release_stop`."""
        command = MotionCommand(AxisState.STOPPING)
        # With power off and in ErrorStop the axis is stopped already.
        if not self._power.status:
            return command.fail(self._not_ready())
        self._stop_on_jog_ramp()
        self.take(None)
        if self.stop_command is not None:
            self.stop_command.status = CommandStatus.ABORTED
        self.stop_command = command
        self._stop_execute = True
        return command

    def release_stop(self, command: MotionCommand) -> None:
        """End Stopping as soon as the axis is at rest: Execute of Stop is FALSE."""
        if command is self.stop_command:
            self._stop_execute = False

    def take(self, command: MotionCommand | None) -> None:
        """Abort what is under way and let `command` take over."""
        self.drop_waiting()
        if self.current is not None:
            self.current.status = CommandStatus.ABORTED
        self.current = command

    # --- the end of commands ----------------------------------------------------------------------

    def stop_by(self, reason: Refusal) -> None:
        """End the motion with an error on the jog-release ramp (HLT); power stays on."""
        if self.current is None and self.waiting is None:
            return
        state = AxisState.DISCRETE_MOTION if self.current is None else self.current.state
        self._stop_on_jog_ramp()
        self.fail_all(reason)
        # PLCopen: the motion state lasts until the axis is at rest.
        if not self._virtual.at_rest:
            self.current = MotionCommand(state)

    def abort_for_power_off(self) -> None:
        """Come to rest before power goes off."""
        self._stop_on_jog_ramp()
        self.take(None)
        self.switching_off = True

    def fail_all(self, reason: Refusal) -> None:
        """End every command with an error, by an alarm."""
        for command in (self.current, self.waiting, self.buffered, self.stop_command):
            if command is not None and command.alive:
                command.fail(reason)
        self.current = self.waiting = self.buffered = self.stop_command = None

    def drop_waiting(self) -> None:
        """Forget what waits: for the brake, or for the end of the motion before."""
        if self.waiting is not None:
            self.waiting.status = CommandStatus.ABORTED
            self.waiting = None
        self._drop_buffered()

    def _drop_buffered(self) -> None:
        if self.buffered is not None:
            self.buffered.status = CommandStatus.ABORTED
            self.buffered = None

    def progress(self) -> None:
        """Begin what waited and end what has arrived; every scan, after the monitors."""
        if self.waiting is not None:
            self._begin_waiting(self.waiting)
        # At override 0 the set-point rests, but the command goes on.
        if self._virtual.at_rest and not self._virtual.paused:
            if self.current is not None:
                self._arrived(self.current)
            if self.stop_command is not None:
                self.stop_command.status = CommandStatus.DONE
                if not self._stop_execute:
                    self.stop_command = None
        if self.buffered is not None:
            self._begin_buffered(self.buffered)

    def _begin_waiting(self, command: MotionCommand) -> None:
        """Begin a command that waits for the brake; one that came while it was closing opens it only now."""
        self._power.wake()
        if self._power.phase is PowerPhase.ON:
            # What waits behind it goes on waiting.
            behind, self.waiting, self.buffered = self.buffered, None, None
            command.status = CommandStatus.ACTIVE
            self._begin(command, None)
            self.buffered = behind
            if not command.alive:
                self._drop_buffered()

    def _begin_buffered(self, command: MotionCommand) -> None:
        """Begin a command that waits for the motion before: once that is done, or has reached its speed."""
        before = self.current or self.waiting
        if before is not None and not self.in_velocity(before):
            return
        self.buffered = None
        command.status = CommandStatus.ACTIVE
        self._begin(command, self._aim(command, self._virtual.pos_ref_rad))

    def in_velocity(self, command: MotionCommand) -> bool:
        """Whether the set-point has the speed of a motion without an end, times override."""
        virtual = self._virtual
        return (
            command is self.current
            and command.endless
            and not virtual.paused
            # Rounding of the constant speed in a plan.
            and abs(virtual.vel_ref_rad_s) >= command.speed_rad_s * virtual.override * (1.0 - 1e-9)
        )

    def _arrived(self, command: MotionCommand) -> None:
        if command.settles and not self._monitors.in_position:
            # A window that is not reached in time ends the command, not the power (B12, CTL-11).
            if self._monitors.not_in_position:
                command.fail(self._alarms.active[Code.CTL_11].refusal)
                self.current = None
                self._drop_buffered()
            return
        command.status = CommandStatus.DONE
        self.current = None
        if command.endless:
            command.refusal = self._note_end(command)
            self._drop_buffered()

    def _note_end(self, command: MotionCommand) -> Refusal:
        """Note where a motion with a speed only has come to its end: at that of travel, or before a no-go sector."""
        travel, here_rad = self._settings.travel, self._virtual.pos_ref_rad
        assert command.aim is not None  # it was asked for
        stretch = travel.stretch(here_rad)
        sector = stretch.above if command.aim.value > 0.0 else stretch.below
        if sector is None:
            at = deg(travel.read_end_rad(here_rad))
            return self._alarms.note(Code.LIM_01, measured=at, end=Words.END_OF_TRAVEL)
        at, begin, end = (deg(travel.read_rad(angle)) for angle in (here_rad, *sector))
        return self._alarms.note(Code.LIM_01, measured=at, end=Words.BEFORE_SECTOR(begin=begin, end=end))

    def _ask(self, command: MotionCommand, buffer_mode: BufferMode) -> MotionCommand:
        """Begin a command at once, or let it wait for the one before."""
        before = self.current or self.waiting
        if buffer_mode is BufferMode.BUFFERED and before is not None:
            return self._buffer(command, before)
        return self._begin(command, self._aim(command, self._virtual.pos_ref_rad))

    def _buffer(self, command: MotionCommand, before: MotionCommand) -> MotionCommand:
        """Let a command wait; it is judged now from where the motion before ends, and again when it begins."""
        if before.held:
            return command.fail(refusal(Code.CTL_14, reason=Words.NOTHING_BEHIND_KEY))
        if self.buffered is not None:
            return command.fail(refusal(Code.CTL_14, reason=Words.BUFFER_FULL))
        here = before.target_rad if before.settles else self._virtual.rest_point_rad()
        refused = self._aim(command, here, rest_rad=here) or self._check(command, here)
        if refused is not None:
            return command.fail(refused)
        command.status = CommandStatus.WAITING
        self.buffered = command
        return command

    def _aim(
        self, command: MotionCommand, here_rad: float, *, rest_rad: float | None = None
    ) -> Refusal | None:
        """Set the target of a command that begins at `here_rad`; None, or the reason of a refusal.

        Args:
            rest_rad: where the axis will be at rest by then; None asks the motion under way.
        """
        aim, travel = command.aim, self._settings.travel
        assert aim is not None  # only a motion is asked for
        match aim.goal:
            case Goal.ANGLE:
                command.target_rad = aim.value
                if not travel.endless and aim.direction is None:
                    return check_range(aim.value, travel)
                refused = check_destination(here_rad, aim.value, aim.direction, travel)
                if refused is None:
                    direction = aim.direction or Direction.SHORTEST
                    command.target_rad = self._branch(aim.value, direction, rest_rad)
                return refused
            case Goal.WAY | Goal.WAY_ON:
                before = self.current or self.waiting
                if aim.goal is Goal.WAY_ON and before is not None and before.settles:
                    here_rad = before.target_rad
                command.target_rad = here_rad + aim.value
                return check_range(command.target_rad, travel)
            case Goal.SPEED:
                # A plan to the end of the travel, so that the set-point comes to rest at the limit by itself; a modulo
                # axis has none, and its plan no end.
                stretch = travel.stretch(here_rad)
                command.target_rad = stretch.high_rad if aim.value > 0.0 else stretch.low_rad
                return check_direction(here_rad, aim.value, travel)
            case _:
                assert_never(aim.goal)

    def _branch(self, target_rad: float, direction: Direction, rest_rad: float | None) -> float:
        """Where a modulo axis comes to rest at an angle of its turn: that angle and some whole turns."""
        virtual = self._virtual
        # From where it can be at rest: on from there no direction asks for a way back.
        here = virtual.rest_point_rad() if rest_rad is None else rest_rad
        if direction is Direction.CURRENT:
            direction = (
                Direction.NEGATIVE if (virtual.vel_ref_rad_s or self._sign) < 0.0 else Direction.POSITIVE
            )
        way = way_to(here, target_rad, direction, self._settings.monitors.in_position_window_rad)
        # The angle itself and not here plus way: rounding errors of many moves must not add up.
        return target_rad + math.tau * round((here + way - target_rad) / math.tau)

    def _begin(self, command: MotionCommand, refused: Refusal | None) -> MotionCommand:
        target_rad, speed_rad_s, parked = command.target_rad, command.speed_rad_s, self._power.parked
        refused = refused or self._check(command, self._virtual.pos_ref_rad)
        ramps = self._virtual.ramps.below(*command.dynamics)
        refused = refused or self._virtual.move_to(target_rad, speed_rad_s, ramps, self.scan, take=not parked)
        if refused is not None:
            return command.fail(refused)
        self.take(None if parked else command)
        if target_rad != self._virtual.pos_ref_rad:
            self._sign = math.copysign(1.0, target_rad - self._virtual.pos_ref_rad)
        if parked:
            command.status = CommandStatus.WAITING
            self.waiting = command
            self._power.wake()
        return command

    def _stop_on_jog_ramp(self) -> None:
        speed = self._settings.speed.setting_max_rad_s
        self._virtual.stop(self._settings.ramps.jog_release(speed), self.scan)

    # --- checks: None, or the reason of a refusal -------------------------------------------------

    def check_resume(self) -> Refusal | None:
        """Judge the motion that override 0 holds back like a new one, before it goes on."""
        if self.current is None or not self._virtual.paused:
            return None
        return self._check(self.current, self._virtual.pos_ref_rad)

    def check_speed(self, speed_rad_s: float) -> Refusal | None:
        """Judge a speed: above 0, at most the highest setting, and low while the brake test is overdue."""
        speed = self._settings.speed
        refused = check_speed(speed_rad_s, self.speed_max_rad_s)
        return check_overdue(speed_rad_s, speed) if refused is None and self.brake_overdue else refused

    def _check(self, command: MotionCommand, here_rad: float) -> Refusal | None:
        return (
            self.check_speed(command.speed_rad_s)
            or check_dynamics(command.dynamics, self._virtual.ramps)
            or self._check_state()
            or self._check_permit()
            or self._check_way(here_rad, command.target_rad)
        )

    def _check_way(self, here_rad: float, target_rad: float) -> Refusal | None:
        # A motion without an end: of a modulo axis, a linear one has ends.
        if math.isinf(target_rad):
            return None
        return check_way(here_rad, target_rad, self._settings.travel, self._interlocks)

    def _check_ready(self) -> Refusal | None:
        if self._alarms.first_out is not None or not self._power.status:
            return self._not_ready()
        # A motion taken over from that ramp would be made to its end.
        if self.switching_off:
            return refusal(Code.CTL_14, reason=Words.SWITCHING_OFF)
        if self.stop_command is not None:
            return refusal(Code.CTL_14, reason=Words.HELD_BY_STOP)
        return None

    def _check_state(self) -> Refusal | None:
        refused = self._check_ready()
        blocking = self._alarms.blocking()
        if refused is None and blocking is not None:
            return refusal(Code.CTL_14, reason=blocking.active_words)
        return refused

    def _check_permit(self) -> Refusal | None:
        return None if self._interlocks.permitted else refusal(Code.CTL_14, reason=Words.PERMIT_MISSING)

    def _not_ready(self) -> Refusal:
        first = self._alarms.first_out
        if first is not None:
            return refusal(Code.CTL_14, reason=Words.ERROR_STOP(code=first.code, measured=first.refusal))
        return refusal(Code.PWR_03)
