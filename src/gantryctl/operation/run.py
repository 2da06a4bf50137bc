"""One run of an axis: power up, move, power down, and leave everything so that the next run can go on.

Each run is a power cycle of the machine. Whatever ends it (done, refused, alarm, Ctrl-C), the axis is brought to rest,
the brake closed, the torque taken off and the state kept.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, Final, TypeVar

from gantryctl.errors import AlarmStop, CommandRefused, UsageError
from gantryctl.image import Direction, Mode
from gantryctl.machine import Machine
from gantryctl.operation.beside import begin
from gantryctl.operation.brake_policy import why_brake_failed
from gantryctl.operation.bus_log import AlarmFrames
from gantryctl.operation.client import (
    BRAKE_WATCH_S,
    BrakeDue,
    BrakeTestReport,
    Ending,
    MotionReport,
    Snapshot,
    Stop,
)
from gantryctl.operation.opening import close_axis, leave_bus, left_on_failure, open_axis
from gantryctl.operation.proofs import why_in_fault
from gantryctl.operation.run_memory import RunEnd, RunMemory
from gantryctl.operation.sliced_scan import SLICE_S, SlicedScan, state_words
from gantryctl.operation.store import StateStore
from gantryctl.ports import Drive
from gantryctl.program import Alarm, AxisState, BrakeTestOutcome, GantryProgram, PowerPhase, Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.axis.command_checks import (
    check_destination,
    check_direction,
    check_overdue,
    check_range,
    check_setting,
    check_target,
    inside_turn,
    require,
)
from gantryctl.runtime import Engine, FixedOperator, ScanFailure, VirtualClock, keeps_time
from gantryctl.terminal import tell
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import ProgramFactory, RecorderFactory, build_engine

_Done = TypeVar("_Done")

# A stop takes less, unless the ramps of the machine file are slow: then it is twice their time.
REST_S: Final = 120.0
# Power sequence and brake test have time limits of their own; these are only a net below them, wider where a drive may
# take long to enable.
_POWER_S: Final = 10.0
_TEST_S: Final = 30.0


class AxisRun:
    """One power cycle of the axis of one machine, for one command line or script.

    Args:
        store: the state directory, locked by the caller; None for a new machine that is forgotten afterwards.
        program: made from the axis: `GantryProgram`, or a custom program.
        recorder: makes the recorder of the run.
        observer: gets a `Snapshot` every 0.1 s of axis time. One that fails is left out from then on, and the axis
            stops: its display has no reader any more.
        brake_test: the brake is to be tested: a failed test of an earlier run does not refuse it.
        commissioning: a CAN machine needs no commissioning record, because it is being made.
        controlled_as: the machine by whose control and profile the axis runs, for an experiment: other compensations
            or ramps than `machine`, whose proofs count.

    Attributes:
        notes: what had to be done to open the machine.

    Raises:
        CommandRefused: there is a reason against switching power on.
    """

    def __init__(
        self,
        machine: Machine,
        store: StateStore | None = None,
        *,
        program: ProgramFactory = GantryProgram,
        recorder: RecorderFactory | None = None,
        real_time: bool = False,
        observer: Callable[[Snapshot], None] | None = None,
        commissioning: bool = False,
        brake_test: bool = False,
        controlled_as: Machine | None = None,
    ) -> None:
        self.machine, self._store = machine, store
        self._paced = real_time or machine.paced_by_clock
        self._open = opened = open_axis(
            machine, store, program=program, commissioning=commissioning, controlled_as=controlled_as
        )
        self.notes, self.axis, self.operator = opened.notes, opened.program.axis, FixedOperator()
        with left_on_failure(opened.drive):  # a recording that cannot be opened, for one
            failed = None if brake_test else why_brake_failed(opened.retained)
            for reason in (*opened.reasons, why_in_fault(opened.drive), failed):
                if reason is not None:
                    raise CommandRefused(reason.text)
            self.engine: Engine = build_engine(
                machine, opened.drive, opened.program, self.operator, recorder=recorder, real_time=real_time
            )
        self._memory = RunMemory(machine, self.axis, opened.retained, store)
        frames = AlarmFrames(self.axis.alarms, None if store is None else store.traces)
        self._scans = SlicedScan(self.engine, self.axis, self.operator, frames, observer)
        # Torque has held the load, and nobody has looked since whether the brake does.
        self._powered = self._unwatched = self._closed = False
        settings = self.axis.settings
        power, ramps, top = settings.power, settings.ramps, settings.speed.setting_max_rad_s
        self._power_s = max(_POWER_S, 2.0 * power.power_up_time_s)
        slowest_s = top / ramps.dec_rad_s2 + ramps.dec_rad_s2 / ramps.jerk_rad_s3
        self._rest_s = max(REST_S, 2.0 * slowest_s)
        quick_s = top / ramps.quick_dec_rad_s2
        self._failed_s = max(_POWER_S, 2.0 * (quick_s + power.brake_close_time_s))
        self._timed = ExitStack()
        if machine.paced_by_clock:
            self._timed.enter_context(keeps_time())

    # --- state ---------------------------------------------------------------------------------------------------

    @property
    def stop(self) -> Stop:
        """Raised by whoever wants the axis to stop, at any time."""
        return self._scans.stop

    @stop.setter
    def stop(self, urgency: Stop) -> None:
        self._scans.stop = urgency

    @property
    def stopped_as(self) -> Ending:
        """How a motion has ended that `stop` ends."""
        return self._scans.stopped_as

    @stopped_as.setter
    def stopped_as(self, ending: Ending) -> None:
        self._scans.stopped_as = ending

    @property
    def brake_due(self) -> BrakeDue:
        """When the next brake test is due."""
        return self._memory.brake_due

    @property
    def angle_deg(self) -> float:
        """Measured angle of the gantry, motor side."""
        if self.engine.scan:
            return deg(self.axis.settings.travel.shown_rad(self.axis.pos_act_rad))
        opened_deg = self._open.reading.angle_deg
        assert opened_deg is not None  # a machine without a zero offset is refused
        travel = self.axis.settings.travel
        return deg(travel.shown_rad(rad(opened_deg))) if travel.endless else opened_deg

    @property
    def speed_max_deg_s(self) -> float:
        """Highest speed setting in force: of the machine file, or of the ledger where that is lower."""
        return self._open.speed_max_deg_s

    @property
    def quick_dec_deg_s2(self) -> float:
        """Quick-stop deceleration: as measured of a drive with a ramp of its own, else that of the machine file."""
        return self._open.quick_dec_deg_s2

    @property
    def drive(self) -> Drive:
        """The open drive."""
        return self._open.drive

    @property
    def must_ask(self) -> bool:
        """A person must agree before a real gantry moves; a simulated one needs no question."""
        return self.machine.paced_by_clock and self.machine.can.commissioning_required

    def take(self) -> float:
        """The angle: an axis of this process is under control, and at rest between two commands."""
        return self.angle_deg

    def observe(self, observer: Callable[[Snapshot], None]) -> None:
        """Another observer from now on."""
        self._scans.observer = observer

    def snapshot(self) -> Snapshot:
        """State of the axis for a display."""
        return self._scans.snapshot()

    # --- commands ------------------------------------------------------------------------------------------------

    def power_up(self) -> None:
        """Enable, prove torque, open the brake; nothing when that was done.

        Raises:
            AlarmStop: the power sequence ended in an alarm.
        """
        if self._powered:
            return
        # One that was refused or has failed has left its level: power wants a new edge.
        if self.operator.command.power:
            self._scans.command(power=False)
            self.engine.step()
        self._powered = self._unwatched = True
        self._memory.power_ups += 1
        self._memory.forget_rest()
        refusals = self.axis.refusal_count
        self._scans.command(power=True)
        # An alarm or a refusal ends the waiting: nothing that comes later would switch the axis on.
        self._scans.until(
            lambda: self.axis.state is AxisState.STANDSTILL or self._power_refused(refusals), self._power_s
        )
        self._powered = self.axis.state is AxisState.STANDSTILL
        self._raise_alarm()
        if self._power_refused(refusals):
            require(self.axis.refusal)
        if not self._powered:
            raise AlarmStop(
                f"{Code.SYS_10} STOP · power-up did not end within {self._power_s:g} s, "
                f"the axis is {state_words(self.axis.state)} · "
                "a custom program must switch power on when the operator wants it",
                Code.SYS_10,
            )

    def _power_refused(self, refusals: int) -> bool:
        """An alarm stands against power, or it was refused since there were so many refusals."""
        axis = self.axis
        if axis.alarms.first_out is not None:
            return True
        refused = axis.refusal if axis.refusal_count > refusals else None
        return refused is not None and refused.code is Code.PWR_04

    def power_down(self) -> None:
        """Come to rest, close the brake, take the torque off, see that the brake holds; nothing when that was done.

        Raises:
            AlarmStop: an alarm on the way, as of a brake that does not hold; or a custom program keeps power on.
        """
        if not self._unwatched and self.axis.is_off:
            return
        told, known = self.axis.alarms.first_out, self._brake_alarms()
        self._go_down()
        if self.axis.alarms.first_out is not told:
            self._raise_alarm()
        for alarm in self._brake_alarms():
            if alarm not in known:  # behind the one that has been told
                raise AlarmStop(alarm.text, alarm.code)
        if told is None and not self.axis.is_off:
            raise AlarmStop(
                f"{Code.SYS_10} STOP · power-down did not end within {self._power_s:g} s, "
                f"the axis is {state_words(self.axis.state)} · "
                "a custom program must switch power off when the operator does not want it any more",
                Code.SYS_10,
            )

    def _go_down(self) -> None:
        self._powered = False
        self._scans.command(power=False, forward=False, reverse=False, move=False)
        self._scans.until(lambda: self._is_down() or self.axis.at_rest, self._rest_s, watch=False)
        self._scans.until(self._is_down, self._power_s, watch=False)
        self._scans.until(self.load_is_held, BRAKE_WATCH_S, watch=False)
        self._unwatched = False

    def _is_down(self) -> bool:
        return self.load_is_held() or (self.axis.is_off and self.axis.virtual.at_rest)

    def load_is_held(self) -> bool:
        """Whether torque alone holds it: the brake is not trusted, and the power sequence ends here."""
        # A program that has failed is in no phase any more.
        held = (
            self.axis.power.phase is PowerPhase.TORQUE_HOLD
            if self.engine.failure is None
            else self.engine.holds_load
        )
        return held and not self._closed

    def _brake_alarms(self) -> list[Alarm]:
        """Alarms of a brake that does not hold the load."""
        return [alarm for alarm in self.axis.alarms.active.values() if alarm.reaction is Reaction.HOLD]

    def move(
        self,
        target_deg: float,
        speed_deg_s: float | None = None,
        override: float = 1.0,
        direction: Direction | None = None,
    ) -> MotionReport:
        """Move to an angle and wait until the axis stands there; powers up where that was not done.

        Args:
            direction: of a modulo axis; when not given, the way that stays within its turn.

        Raises:
            CommandRefused: target or speed are not possible; nothing moved, and power was not switched on for it.
            AlarmStop: an alarm ended it; the axis is at rest.
        """
        return self._motion(**self._move_levels(target_deg, speed_deg_s, override, direction))

    def move_by(
        self, distance_deg: float, speed_deg_s: float | None = None, override: float = 1.0
    ) -> MotionReport:
        """Move by an angle from the set-point, a modulo axis also beyond a turn; else as `move`.

        Raises:
            CommandRefused, AlarmStop: as of `move`.
        """
        levels = self._speed_levels(speed_deg_s, override)
        way_rad, travel, virtual = rad(distance_deg), self.axis.settings.travel, self.axis.virtual
        # Where power is off the set-point will be where the axis stands.
        here_rad = virtual.pos_ref_rad if virtual.following else rad(self.angle_deg)
        require(
            check_range(way_rad, travel)
            if travel.endless
            else check_target(here_rad, here_rad + way_rad, travel)
        )
        return self._motion(**levels, move=True, relative=True, target_rad=way_rad, direction=None)

    def begin_move(self, target_deg: float, speed_deg_s: float, override: float = 1.0) -> None:
        """Begin a move and return while it goes on, for an experiment on the way; `follow` scans.

        Raises:
            CommandRefused: as of `move`.
        """
        self._begin(**self._move_levels(target_deg, speed_deg_s, override, None))

    def follow(self, seconds: float) -> None:
        """Scan for a time, whatever the axis does.

        Raises:
            AlarmStop: an alarm has stopped it, or somebody asked it to stop.
        """
        self._scans.until(lambda: self.axis.alarms.first_out is not None or self.stop is not Stop.NO, seconds)
        self._raise_alarm()
        if self.stop is not Stop.NO:
            self._scans.until(lambda: self.axis.at_rest, self._rest_s)
            raise AlarmStop(f"{self.stopped_as} in the middle of an experiment")

    def halt(self) -> None:
        """End a motion under way on its own ramp and wait for rest."""
        self._scans.command(halt=True)
        self.engine.step()
        self._scans.command(halt=False)
        self._scans.until(lambda: self.axis.at_rest, self._rest_s)
        self._raise_alarm()

    def _move_levels(
        self, target_deg: float, speed_deg_s: float | None, override: float, direction: Direction | None
    ) -> dict[str, Any]:
        levels = self._speed_levels(speed_deg_s, override)
        travel, here = self.axis.settings.travel, rad(self.angle_deg)
        require(check_destination(here, rad(target_deg), direction, travel))
        direction = direction or inside_turn(here, rad(target_deg), travel)
        return levels | {
            "move": True,
            "relative": False,
            "target_rad": rad(target_deg),
            "direction": direction,
        }

    def _speed_levels(self, speed_deg_s: float | None, override: float) -> dict[str, Any]:
        wanted = self.speed_max_deg_s if speed_deg_s is None else speed_deg_s
        self._check_speed(wanted)
        if not 0.0 < override <= 1.0:
            raise UsageError(f"override {override:g}: above 0 and at most 1")
        return {"speed_rad_s": rad(wanted), "override": override}

    def increment(self, step_deg: float, forward: bool, speed_deg_s: float) -> MotionReport:
        """Make one increment in the incremental mode."""
        self._check_speed(speed_deg_s)
        # Mode and key in two scans: a key that is down when the mode changes moves nothing.
        self._scans.command(mode=Mode.INCREMENTAL)
        self.engine.step()
        key = {"forward" if forward else "reverse": True}
        return self._motion(increment_rad=rad(step_deg), speed_rad_s=rad(speed_deg_s), **key)

    def jog(self, forward: bool, speed_deg_s: float, seconds: float) -> MotionReport:
        """Hold the key for a time in the continuous mode, then let go and wait for rest; powers up first.

        Raises:
            CommandRefused: the speed is outside the setting range, or the axis stands at its end; nothing moved.
            AlarmStop: an alarm ended it; the axis is at rest.
        """
        self._check_speed(speed_deg_s)
        direction = 1.0 if forward else -1.0
        require(check_direction(rad(self.angle_deg), direction, self.axis.settings.travel))
        self.power_up()
        if self.stop is not Stop.NO:
            return self._not_begun()
        self._scans.command(mode=Mode.CONTINUOUS, speed_rad_s=rad(speed_deg_s))
        self.engine.step()
        begin, refusals = self._not_begun(), self.axis.refusal_count
        self._scans.command(forward=forward, reverse=not forward)
        self._scans.until(lambda: self.axis.at_rest, seconds, held=True)
        # Whatever has ended it: a key that stays down would begin nothing when it is pressed again.
        self._scans.command(forward=False, reverse=False)
        self._raise_refusal(refusals)
        return self._finished(begin)._replace(settled_s=None, asked_deg_s=None)

    def test_brake(self) -> BrakeTestReport:
        """Give torque both ways against the closed brake, with power off; the result is retained.

        Raises:
            CommandRefused: it cannot be tested here, or not now. AlarmStop: an alarm ended it.
        """
        refusals = self.axis.refusal_count
        self._scans.command(brake_test=True)
        self.engine.step()
        self._scans.command(brake_test=False)
        self._raise_refusal(refusals)
        self._unwatched = True
        self._scans.until(lambda: not self.axis.brake_test.under_way, self._power_s + _TEST_S)
        result = self.axis.brake_test.last
        assert result is not None
        self._memory.brake_tested(result)
        self._raise_alarm()
        return self.brake_test_report()

    def brake_test_report(self) -> BrakeTestReport:
        """Report of the brake test of this run, which may not have ended."""
        test, last = self.axis.brake_test, self.axis.brake_test.last
        return BrakeTestReport(
            outcome=BrakeTestOutcome.NONE if last is None else last.outcome,
            detail="" if last is None else last.text,
            level_nm=test.level_nm,
            plus_nm=test.plus_nm,
            minus_nm=test.minus_nm,
            moved_deg=deg(test.moved_rad),
            limit_deg=deg(test.moved_max_rad),
            due=self.brake_due,
        )

    def while_standing(self, work: Callable[[], _Done], *, finish: bool = False) -> _Done | None:
        """Do what takes its time (a person, an instrument, a disk) while the axis stands and goes on scanning.

        In virtual time nothing passes meanwhile.

        Args:
            finish: the work comes to its end whatever the operator or an alarm says; else it is left alone then.

        Returns:
            What the work returned; None where the operator has stopped the axis before its end.

        Raises:
            AlarmStop: an alarm came.
        """
        if isinstance(self.engine.clock, VirtualClock):
            return work()
        done = begin(work)
        alarms = self.axis.alarms
        self._scans.until(
            lambda: (
                done.done() or (not finish and (self.stop is not Stop.NO or alarms.first_out is not None))
            ),
            math.inf,
        )
        self._raise_alarm()
        return done.result() if done.done() else None

    def rest_keeper(self) -> Callable[[], None]:
        """Work that keeps where the axis stands now: a run that is killed from then on leaves a true rest position."""
        identity = self.drive.identity()
        counts = int(self.engine.image.drive.pos_act_counts)
        return self._memory.rest_keeper(counts, identity.counts_per_turn * identity.turns)

    # --- checks and refusals -------------------------------------------------------------------------------------

    def _check_speed(self, speed_deg_s: float) -> None:
        speed = self.axis.settings.speed
        require(check_setting(rad(speed_deg_s), speed))
        reason = check_overdue(rad(speed_deg_s), speed) if self.brake_due.overdue else None
        if reason is not None:
            raise CommandRefused(f"{reason.code} · {reason.text}; `gantryctl brake-test` tests it")

    def _raise_refusal(self, before: int) -> None:
        if self.axis.refusal_count > before:
            require(self.axis.refusal)

    def _raise_alarm(self) -> None:
        first = self.axis.alarms.first_out
        if first is None:
            blocking = self.axis.alarms.blocking()
            if blocking is not None and blocking.reaction is Reaction.HLT:
                raise AlarmStop(blocking.text, blocking.code)
            return
        self._scans.until(lambda: self.axis.is_off or self.load_is_held(), self._rest_s, watch=False)
        raise AlarmStop(first.text, first.code)

    # --- motions -------------------------------------------------------------------------------------------------

    def _not_begun(self) -> MotionReport:
        """A motion of no length: stopped, unless it begins now."""
        here_deg, now_s = self.angle_deg, self.engine.time_s
        return MotionReport(self.stopped_as, here_deg, here_deg, now_s, now_s)

    def _motion(self, **levels: Any) -> MotionReport:
        self.power_up()
        if self.stop is not Stop.NO:
            return self._not_begun()
        begin = self._not_begun()
        self._begin(**levels)
        return self._finished(begin)

    def _begin(self, **levels: Any) -> None:
        refusals = self.axis.refusal_count
        self._scans.command(**levels)
        self.engine.step()
        self._scans.command(move=False, forward=False, reverse=False)
        self._raise_refusal(refusals)

    def _finished(self, begin: MotionReport) -> MotionReport:
        """Wait until the motion has ended one way or the other."""
        self._memory.moves += 1
        self._scans.until(lambda: self.axis.at_rest, self.axis.plan_end_s - self.engine.time_s + self._rest_s)
        end_s, settled_s = self.engine.time_s, max(0.0, self.engine.time_s - self.axis.plan_end_s)
        self._raise_alarm()
        if self.stop is not Stop.NO:
            ending = self.stopped_as
        else:
            reached = self.axis.at_rest and not self.axis.monitors.not_in_position
            ending = Ending.DONE if reached else Ending.NOT_IN_POSITION
        command = self.operator.command
        return begin._replace(
            ending=ending,
            end_deg=self.angle_deg,
            to_s=end_s,
            settled_s=settled_s,
            asked_deg_s=deg(command.speed_rad_s) * command.override,
        )

    # --- the end of the run --------------------------------------------------------------------------------------

    def _hold_load(self) -> None:
        """Go on while torque alone holds the load; in virtual time nobody can wait, and the load is a simulated one."""
        if not (self._paced and self.load_is_held()):
            return
        # At once, whoever has made this run: what is raised or printed at its end comes too late.
        lines = [
            "",
            *(alarm.text for alarm in self._brake_alarms()),
            "Torque holds the load while this command runs. It goes on until it is asked twice to stop, as by Ctrl-C; "
            "then the load is let go.",
        ]
        tell("\n".join(lines))
        self.stop = Stop.NO
        while self.load_is_held() and self.stop is not Stop.QUICK:
            self.engine.run_for(SLICE_S)

    def close(self, result: str, alarm: AlarmStop | None = None) -> None:
        """Power down if that was not done, finish the recording, keep the state.

        Where torque alone holds the load, the run goes on until somebody asks twice to stop: with it the torque ends.

        Args:
            result: how it ended, for `status`.
            alarm: what stopped the axis; it holds the axis until it is acknowledged.
        """
        self._scans.observer = None
        try:
            if self.engine.failure is None and (self._unwatched or not self.axis.is_off):
                self._go_down()
            self._hold_load()
        except ScanFailure as failed:
            alarm = failed
            raise
        finally:
            try:
                # After an exception in a scan the engine runs its own stop program: these scans bring the axis to rest,
                # unless torque holds the load on, which is let go now.
                if self.engine.failure is not None and not self.engine.holds_load:
                    self.engine.run_for(self._failed_s)
            finally:
                self._leave(result, alarm)

    def _leave(self, result: str, alarm: AlarmStop | None) -> None:
        if isinstance(alarm, ScanFailure):
            self.axis.alarms.raise_(Code.SYS_09, None, **alarm.values)
        self._closed = True
        self._scans.end()
        self._timed.close()
        if self.engine.scan:
            self.engine.close()
        else:  # refused before anything was switched on: the drive stays as it is
            leave_bus(self.drive)
            if self.engine.recorder is not None:
                self.engine.recorder.close()
        memory = self._memory
        end = RunEnd(result, alarm, memory.power_ups, memory.moves, self.engine.time_s)
        close_axis(self.machine, self._store, self._open._replace(retained=memory.retained), end)
