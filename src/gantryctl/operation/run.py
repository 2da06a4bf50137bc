"""One run of an axis: power up, scan, power down, and leave everything so that the next run can go on.

Each run is a power cycle of the machine. Whatever ends it (done, refused, alarm, Ctrl-C), the axis is brought to rest,
the brake closed, the torque taken off and the state kept.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Final

from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.machine import Machine
from gantryctl.operation.brake_policy import judge_due, restore_failure
from gantryctl.operation.bus import judge_bus, leave_bus
from gantryctl.operation.ending import RunEnd, retained_after
from gantryctl.operation.home_reference import (
    ACCEPTED_DEG,
    SHOWN_DEG,
    AbsoluteReading,
    evaluate,
    refusal,
    unwrapped,
)
from gantryctl.operation.motions import Snapshot, Stop, state_words
from gantryctl.operation.state import now_text
from gantryctl.operation.store import StateStore
from gantryctl.operation.virtual import encoder_scale, keep_machine, open_machine
from gantryctl.ports import Drive
from gantryctl.program import AxisState, GantryProgram, PowerPhase, Reaction
from gantryctl.runtime import AlarmEntry, Engine, FixedOperator, keeps_time
from gantryctl.units import deg
from gantryctl.wiring.engine import ProgramFactory, RecorderFactory, build_engine, build_program

SLICE_S: Final = 0.1
"""Axis time between two looks at observer and stop request."""
LEASE_SLICE_S: Final = 0.03
"""The same while a hold-to-run command is renewed."""
_POWER_S: Final = 10.0  # the power sequence has time limits of its own; this is only a net below them
REST_S: Final = 120.0  # a stop on the slowest ramp from the highest speed


class AxisRun:
    """One power cycle of the axis of one machine: opened, scanned, switched on and off, kept. `AxisSession` moves it.

    Args:
        store: the state directory, locked by the caller; None for a new machine that is forgotten afterwards.
        program: made from the axis, `GantryProgram` unless it is a program of one's own.
        recorder: makes the recorder of the run.
        observer: gets a `Snapshot` every 0.1 s of axis time. One that fails is left out from then on, and the axis
            stops: nobody is looking any more.
        brake_test: the brake is to be tested: a failed test of an earlier run does not refuse it.
        commissioning: a CAN machine needs no commissioning record, because it is being made.

    Attributes:
        stop: raised by whoever wants the axis to stop, at any time.
        notes: what had to be done to open the machine.
        angle_deg: measured angle of the gantry, motor side.
        brake_due: when the next brake test is due.

    Raises:
        CommandRefused: an alarm of an earlier run is not acknowledged, or the encoder cannot be believed.
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
    ) -> None:
        self.machine = machine
        self._commissioning, self._for_brake_test = commissioning, brake_test
        self.stop = Stop.NO
        self._store = store
        self._observer = observer
        virtual = open_machine(machine, store)
        self.notes, self._retained, self._drive = virtual.notes, virtual.retained, virtual.drive
        try:
            self._prepare(program, recorder, real_time)
        except BaseException:
            leave_bus(self._drive)
            raise
        self._power_ups = self._moves = 0
        self._powered = False
        self._timed = ExitStack()
        if machine.paced_by_clock:
            self._timed.enter_context(keeps_time())

    def _prepare(self, program: ProgramFactory, recorder: RecorderFactory | None, real_time: bool) -> None:
        """Judge the encoder's reading and make the engine."""
        machine, drive = self.machine, self._drive
        judge_bus(machine, self._store, drive, self._commissioning)
        scale = encoder_scale(machine, drive)
        counts = drive.read().pos_act_counts
        reading = evaluate(scale, counts, self._retained)
        self._refuse(refusal(reading))
        self._record_accepted(reading)
        zero = self._retained.zero_offset_counts
        assert zero is not None
        assert reading.angle_deg is not None
        self._opened_deg = reading.angle_deg
        made = build_program(
            machine,
            drive,
            program,
            zero_counts=zero + counts - unwrapped(scale, counts, zero),
            holding_torque_nm=self._retained.holding_torque_nm or 0.0,
        )
        self.axis, self.operator = made.axis, FixedOperator()
        self.engine: Engine = build_engine(
            machine, drive, made, self.operator, recorder=recorder, real_time=real_time
        )
        restore_failure(self.axis, self._retained)
        self.brake_due = judge_due(machine, self.axis, self._retained, self._retained.power_ups)

    def _refuse(self, reason: str | None) -> None:
        held = self._retained.error_stop
        if held:
            raise CommandRefused(
                f"{held} stopped the axis in an earlier run and is not acknowledged: look at it "
                f"(`gantryctl alarms --last`, `gantryctl explain {held}`), then `gantryctl reset`"
            )
        if reason is not None:
            raise CommandRefused(reason)
        failed = self._retained.brake_failed
        if failed and not self._for_brake_test:
            raise CommandRefused(
                f"BRK-08 · the last brake test failed ({failed}): nothing moves until one passes "
                "(`gantryctl brake-test`), or service resets (`gantryctl reset`)"
            )

    def _record_accepted(self, reading: AbsoluteReading) -> None:
        """A small motion while off is accepted, but not in silence."""
        moved = reading.moved_deg
        if moved is not None and abs(moved) >= SHOWN_DEG:
            text = f"ENC-09 INFO · the gantry moved {moved:+.3f} deg while off · within {ACCEPTED_DEG:g} deg: accepted"
            self.notes = (*self.notes, text)
            alarms = (*self._retained.alarms, AlarmEntry("ENC-09", text, now_text()))
            self._retained = replace(self._retained, alarms=alarms)

    # --- what the axis does --------------------------------------------------------------------------------------

    @property
    def angle_deg(self) -> float:
        """Measured angle of the gantry, motor side."""
        return deg(self.axis.pos_act_rad) if self.engine.scan else self._opened_deg

    @property
    def drive(self) -> Drive:
        """The drive that is run."""
        return self._drive

    def snapshot(self) -> Snapshot:
        """What a display shows now."""
        axis, virtual = self.axis, self.axis.virtual
        time_s = self.engine.time_s
        end_s = virtual.start_scan * self.engine.period_s + virtual.plan.duration
        vel = self.engine.image.drive.vel_act_rad_s / axis.settings.law.ratio
        return Snapshot(
            time_s=time_s,
            angle_deg=deg(axis.pos_act_rad),
            speed_deg_s=deg(vel),
            following_error_deg=deg(axis.pos_err_rad),
            state=state_words(axis.state),
            time_left_s=max(0.0, end_s - time_s) if axis.state is AxisState.DISCRETE_MOTION else None,
        )

    def power_up(self) -> None:
        """Enable, prove torque, open the brake; nothing when that was done.

        Raises:
            AlarmStop: the power sequence ended in an alarm.
        """
        if self._powered:
            return
        self._powered = True
        self._power_ups += 1
        self._command(power=True)
        self._follow(lambda: self.axis.state is AxisState.STANDSTILL, _POWER_S)
        self._raise_alarm()
        if self.axis.state is not AxisState.STANDSTILL:
            raise AlarmStop(
                f"SYS-10 STOP · power-up did not end within {_POWER_S:g} s, the axis is "
                f"{state_words(self.axis.state)} · torque off, brake closed · a program of one's own must switch "
                "power on when the operator wants it"
            )

    def power_down(self) -> None:
        """Come to rest, close the brake, take the torque off; keep what the next run needs to know."""
        self._powered = False
        self._command(power=False, forward=False, reverse=False, move=False)
        self._follow(lambda: self._off() and self.axis.virtual.at_rest, REST_S, watch=False)

    # --- how it does it ------------------------------------------------------------------------------------------

    def _command(self, **levels: Any) -> None:
        self.operator.command = self.operator.command._replace(**levels)

    def _renew(self) -> None:
        self._command(lease=self.operator.command.lease + 1)

    def _off(self) -> bool:
        return self.axis.power.phase is PowerPhase.OFF

    def _raise_alarm(self) -> None:
        first = self.axis.alarms.first_out
        late = self.engine.overrun_stop
        if first is None and late is None:
            blocking = self.axis.alarms.blocking()
            if blocking is not None and blocking.reaction is Reaction.HLT:
                raise AlarmStop(blocking.text)
            return
        self._follow(self._off, REST_S, watch=False)
        raise AlarmStop(late or (first.text if first is not None else ""))

    def _follow(
        self,
        done: Callable[[], bool],
        timeout_s: float,
        *,
        held: bool = False,
        lease: bool = False,
        watch: bool = True,
    ) -> None:
        """Scan until something is done, in slices: between them stop requests, lease and display.

        Args:
            held: a key is held: the lease is renewed, and a request to stop ends the waiting, which lets go.
            lease: the lease is renewed.
            watch: stop requests go to the program.
        """
        engine = self.engine
        end = engine.time_s + timeout_s
        slice_s = LEASE_SLICE_S if held or lease else SLICE_S
        while engine.time_s < end - 1e-9:
            if watch and self._asked_to_stop() and held:
                return
            if held or lease:
                self._renew()
            reached = engine.run_until(lambda _: done(), min(slice_s, end - engine.time_s))
            self._observe()
            if reached:
                return

    def _observe(self) -> None:
        if self._observer is None:
            return
        try:
            self._observer(self.snapshot())
        except Exception:
            self._observer = None
            self.stop = max(self.stop, Stop.RAMP)

    def _asked_to_stop(self) -> bool:
        """Hand a stop request to the program."""
        if self.stop is Stop.QUICK:
            self._command(quick_stop=True)
        elif self.stop is Stop.RAMP:
            self._command(stop=True)
        return self.stop is not Stop.NO

    # --- the end of the run --------------------------------------------------------------------------------------

    def close(self, result: str, alarm: AlarmStop | None = None) -> None:
        """Power down if that was not done, finish the recording, keep the state.

        After a failure inside the scan the engine itself brings the axis to rest.

        Args:
            result: how it ended, for `status`.
            alarm: what stopped the axis; it holds the axis until it is acknowledged.
        """
        self._observer = None
        try:
            if self.engine.failure is not None:
                self.engine.run_for(_POWER_S)
            elif not self._off():
                self.power_down()
        finally:
            self._timed.close()
            if self.engine.scan:
                self.engine.close()
            else:  # refused before anything was switched on: the drive stays as it is
                leave_bus(self._drive)
                if self.engine.recorder is not None:
                    self.engine.recorder.close()
            self._keep(result, alarm)

    def _keep(self, result: str, alarm: AlarmStop | None) -> None:
        end = RunEnd(result, alarm, self._power_ups, self._moves, self.engine.time_s)
        retained = retained_after(self.machine, self._retained, self.axis, self._drive, end)
        keep_machine(self.machine, self._store, self._drive, retained)
