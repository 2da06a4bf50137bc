"""Commands of the axis: status, order and end of motions and stops."""

from __future__ import annotations

import math
from enum import Enum
from typing import Protocol

from gantryctl.image import Direction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog, Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.command_checks import (
    check_destination,
    check_direction,
    check_overdue,
    check_range,
    check_speed,
    check_way,
    way_to,
)
from gantryctl.program.axis.states import AxisState
from gantryctl.program.monitors.interlocks import Interlocks
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from gantryctl.program.settings import AxisSettings
from gantryctl.program.virtual_axis import VirtualAxis
from gantryctl.units import deg


class CommandStatus(Enum):
    """Status of a command.

    WAITING: accepted, and the brake opens first. ABORTED: another command, a stop or power-off took over.
    ERROR: refused, or ended by an alarm; `refusal` has the reason.
    """

    WAITING = 0
    ACTIVE = 1
    DONE = 2
    ABORTED = 3
    ERROR = 4


class Follower(Protocol):
    """Whoever shows the status of a command.

    Attributes:
        attention: there is something new to show.
    """

    attention: bool


class MotionCommand:
    """One command and its status. A block keeps it; the axis changes the status.

    Attributes:
        settles: done only when the axis is in position, not when the set-point has arrived.
        endless: a motion with a speed only; it ends at the end of the travel or by a stop.
        refusal: the reason of an error, or of an end at the travel limit.
        follower: gets `attention` when the status changes.
    """

    __slots__ = (
        "_status", "endless", "follower", "refusal", "settles", "speed_rad_s", "state", "target_rad",
    )  # fmt: skip

    def __init__(
        self,
        state: AxisState,
        target_rad: float,
        speed_rad_s: float,
        *,
        settles: bool,
        endless: bool = False,
    ) -> None:
        self.state, self.target_rad, self.speed_rad_s = state, target_rad, speed_rad_s
        self.settles, self.endless = settles, endless
        self._status = CommandStatus.ACTIVE
        self.refusal: Refusal | None = None
        self.follower: Follower | None = None

    @property
    def status(self) -> CommandStatus:
        """Where it is between accepted and ended."""
        return self._status

    @status.setter
    def status(self, status: CommandStatus) -> None:
        self._status = status
        if self.follower is not None:
            self.follower.attention = True

    @property
    def alive(self) -> bool:
        """Waiting or active."""
        return self.status in (CommandStatus.WAITING, CommandStatus.ACTIVE)

    def fail(self, reason: Refusal) -> MotionCommand:
        """End it with an error."""
        self.status, self.refusal = CommandStatus.ERROR, reason
        return self


class MotionCommands:
    """Takes commands for the virtual axis. Nothing is queued: a new command aborts the one before.

    A command that is refused changes nothing. While the brake holds the axis at standstill, an accepted
    command waits until the brake is open again; a stop, an alarm or power-off drops it.

    Attributes:
        current: the command under way, or None.
        brake_overdue: the brake test is overdue, so the speed is limited (`Axis.judge_brake`).
        stop_command: the Stop that holds the axis, or None.
        state, scan: of the axis, set by `Axis`.
        waiting: the command that waits for the brake, or None.
    """

    __slots__ = (
        "_alarms", "_interlocks", "_monitors", "_power", "_settings", "_sign", "_stop_execute", "_virtual",
        "brake_overdue", "current", "scan", "state", "stop_command", "waiting",
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
        self.stop_command: MotionCommand | None = None
        self._stop_execute = self.brake_overdue = False
        # Direction of the last motion.
        self._sign = 1.0
        self.state = AxisState.DISABLED
        self.scan = 0

    # --- commands ---------------------------------------------------------------------------------

    def move_absolute(
        self, target_rad: float, speed_rad_s: float, direction: Direction | None = None
    ) -> MotionCommand:
        """Begin a motion to `target_rad` with `speed_rad_s`.

        Args:
            direction: of a modulo axis, the shortest way unless given; a linear axis has one way and takes none.
        """
        travel = self._settings.travel
        refused = (
            check_destination(self._virtual.pos_ref_rad, target_rad, direction, travel)
            if travel.endless or direction is not None
            else check_range(target_rad, travel)
        )
        if travel.endless and refused is None:
            target_rad = self._branch(target_rad, direction or Direction.SHORTEST)
        command = MotionCommand(AxisState.DISCRETE_MOTION, target_rad, speed_rad_s, settles=True)
        return self._begin(command, refused)

    def _branch(self, target_rad: float, direction: Direction) -> float:
        """Where a modulo axis comes to rest at an angle of its turn: that angle and some whole turns."""
        virtual = self._virtual
        # From where it can be at rest: on from there no direction asks for a way back.
        here = virtual.rest_point_rad()
        if direction is Direction.CURRENT:
            direction = (
                Direction.NEGATIVE if (virtual.vel_ref_rad_s or self._sign) < 0.0 else Direction.POSITIVE
            )
        way = way_to(here, target_rad, direction, self._settings.monitors.in_position_window_rad)
        # The angle itself and not here plus way: rounding errors of many moves must not add up.
        return target_rad + math.tau * round((here + way - target_rad) / math.tau)

    def move_relative(self, distance_rad: float, speed_rad_s: float) -> MotionCommand:
        """Begin a motion by `distance_rad` from the set-point."""
        target = self._virtual.pos_ref_rad + distance_rad
        command = MotionCommand(AxisState.DISCRETE_MOTION, target, speed_rad_s, settles=True)
        return self._begin(command, check_range(target, self._settings.travel))

    def move_velocity(self, vel_rad_s: float) -> MotionCommand:
        """Begin a motion with `vel_rad_s`, its sign the direction, until stopped or at the end of the travel."""
        travel = self._settings.travel
        # A plan to the end of the travel, so that the set-point comes to rest at the limit by itself; a modulo axis has
        # none, and its plan no end.
        stretch = travel.stretch(self._virtual.pos_ref_rad)
        end = stretch.high_rad if vel_rad_s > 0.0 else stretch.low_rad
        command = MotionCommand(AxisState.CONTINUOUS_MOTION, end, abs(vel_rad_s), settles=False, endless=True)
        return self._begin(command, check_direction(self._virtual.pos_ref_rad, vel_rad_s, travel))

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
        command = MotionCommand(AxisState.DISCRETE_MOTION, 0.0, 0.0, settles=False)
        refused = self._check_state()
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
        command = MotionCommand(AxisState.STOPPING, 0.0, 0.0, settles=False)
        # With power off and in ErrorStop the axis is stopped already.
        if self.state is AxisState.ERROR_STOP or not self._power.status:
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
        # Buffer mode Aborting: nothing is queued, so nothing old can run after a stop.
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
            self.current = MotionCommand(state, 0.0, 0.0, settles=False)

    def abort_for_power_off(self) -> None:
        """Come to rest before power goes off."""
        self._stop_on_jog_ramp()
        self.take(None)

    def fail_all(self, reason: Refusal) -> None:
        """End every command with an error, by an alarm."""
        for command in (self.current, self.waiting, self.stop_command):
            if command is not None and command.alive:
                command.fail(reason)
        self.current = self.waiting = self.stop_command = None
        self._stop_execute = False

    def drop_waiting(self) -> None:
        """Forget a command that waits for the brake."""
        if self.waiting is not None:
            self.waiting.status = CommandStatus.ABORTED
            self.waiting = None

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

    def _begin_waiting(self, command: MotionCommand) -> None:
        """Begin a command that waits for the brake; one that came while it was closing opens it only now."""
        self._power.wake()
        if self._power.phase is PowerPhase.ON:
            self.waiting = None
            command.status = CommandStatus.ACTIVE
            self._begin(command, None)

    def _arrived(self, command: MotionCommand) -> None:
        if command.settles and not self._monitors.in_position:
            # A window that is not reached in time ends the command, not the power (B12, CTL-11).
            if self._monitors.not_in_position:
                command.fail(self._alarms.active[Code.CTL_11].refusal)
                self.current = None
            return
        command.status = CommandStatus.DONE
        self.current = None
        if command.endless:
            end_rad = self._settings.travel.read_rad(self._virtual.pos_ref_rad)
            command.refusal = self._alarms.note(Code.LIM_01, measured=deg(end_rad))

    def _begin(self, command: MotionCommand, refused: Refusal | None) -> MotionCommand:
        target_rad, speed_rad_s, parked = command.target_rad, command.speed_rad_s, self._power.parked
        refused = refused or self._check(command)
        refused = refused or self._virtual.move_to(target_rad, speed_rad_s, self.scan, take=not parked)
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
        return None if self.current is None or not self._virtual.paused else self._check(self.current)

    def check_speed(self, speed_rad_s: float) -> Refusal | None:
        """Judge a speed: above 0, at most the highest setting, and low while the brake test is overdue."""
        speed = self._settings.speed
        refused = check_speed(speed_rad_s, speed)
        return check_overdue(speed_rad_s, speed) if refused is None and self.brake_overdue else refused

    def _check(self, command: MotionCommand) -> Refusal | None:
        here = self._virtual.pos_ref_rad
        return (
            self.check_speed(command.speed_rad_s)
            or self._check_state()
            or self._check_permit()
            or self._check_way(here, command.target_rad)
        )

    def _check_way(self, here_rad: float, target_rad: float) -> Refusal | None:
        travel = self._settings.travel
        # A motion without an end.
        if travel.endless and math.isinf(target_rad):
            return None
        return check_way(here_rad, target_rad, travel, self._interlocks)

    def _check_state(self) -> Refusal | None:
        stopped = self.state is AxisState.ERROR_STOP or self._alarms.first_out is not None
        if stopped or not self._power.status:
            return self._not_ready()
        if self.stop_command is not None:
            return refusal(Code.CTL_14, reason=Words.HELD_BY_STOP)
        blocking = self._alarms.blocking()
        if blocking is not None:
            return refusal(Code.CTL_14, reason=blocking.active_words)
        return None

    def _check_permit(self) -> Refusal | None:
        return None if self._interlocks.permitted else refusal(Code.CTL_14, reason=Words.PERMIT_MISSING)

    def _not_ready(self) -> Refusal:
        first = self._alarms.first_out
        if first is not None:
            return refusal(Code.CTL_14, reason=Words.ERROR_STOP(code=first.code, measured=first.refusal))
        return refusal(Code.PWR_03)
