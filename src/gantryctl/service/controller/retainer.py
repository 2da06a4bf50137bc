"""Retained memory of a run: counted in the scan, written beside it."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import replace
from typing import Final

from gantryctl.errors import AlarmStop, GantryctlError
from gantryctl.image import DriveFeedback, DriveIdentity
from gantryctl.machine import Machine
from gantryctl.operation.opening import keep_machine
from gantryctl.operation.run_memory import ReadDrive, RunEnd, retained_after
from gantryctl.operation.store import StateStore
from gantryctl.program import AxisState
from gantryctl.runtime import Engine, Retained
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.units import rad

# Travel is counted in steps of at least this, and of more than one of the encoder: an axis at rest adds up to none.
_TRAVEL_STEP_RAD: Final = rad(0.001)
_TRAVEL_COUNTS: Final = 1.5
_MOVING: Final = (AxisState.DISCRETE_MOTION, AxisState.CONTINUOUS_MOTION)


class Retainer:
    """Retained memory of one run.

    Args:
        before: what is retained of the runs before.

    Attributes:
        retained: of the runs before, with acknowledgements and tests since.
        count_rad: step of the encoder, at the gantry.
        faults: failed writes, for the scan to report: it is the only writer of its event ring.
    """

    def __init__(
        self, machine: Machine, store: StateStore, engine: Engine, operator: ServiceOperator, before: Retained
    ) -> None:
        self._machine, self._store = machine, store
        self._engine, self._drive = engine, engine.drive
        self._operator, self._axis = operator, operator.program.axis
        self.retained = before
        self.faults: deque[str] = deque()
        self._power_ups = self._moves = 0
        self._moving = False
        self._way_rad, self._last_pos_rad = 0.0, math.nan
        law = self._axis.settings.law
        self.count_rad = math.tau / (law.counts_per_turn * law.ratio)
        self._step_rad = max(_TRAVEL_STEP_RAD, _TRAVEL_COUNTS * self.count_rad)
        self._thread: threading.Thread | None = None
        self._waiting = ""

    @property
    def power_ups(self) -> int:
        """Power-ups of the machine, this run included."""
        return self.retained.power_ups + self._power_ups

    def powered_up(self) -> None:
        """Count a power-up; the memory of a modulo axis on a bus forgets where it rests until power is off again."""
        self._power_ups += 1
        if self._axis.turns is not None and not self._machine.plant_is_local:
            self.start("power on")

    def scan(self) -> None:
        """Count motions and travelled angle; write what has waited for the disk."""
        if self._waiting:
            self.start(self._waiting)
        axis = self._axis
        moving = axis.state in _MOVING
        if moving is not self._moving:
            self._moving = moving
            self._moves += moving
        # Of the reading, not of the angle: the zero of a modulo axis moves on with its turns.
        pos = axis.feedback.counts * self.count_rad
        if abs(pos - self._last_pos_rad) > self._step_rad:
            self._way_rad += abs(pos - self._last_pos_rad)
            self._last_pos_rad = pos
        elif math.isnan(self._last_pos_rad):
            self._last_pos_rad = pos

    def start(self, why: str) -> None:
        """Write the state in a thread, behind a write that is under way: the scan does not wait for the disk."""
        if self._thread is not None and self._thread.is_alive():
            self._waiting = why
            return
        self._waiting = ""
        self._thread = threading.Thread(target=self._write, args=(self._state(why),))
        self._thread.start()

    def join(self) -> None:
        """Wait for a write that was started."""
        if self._thread is not None:
            self._thread.join()

    def finish(self, failure: AlarmStop | None) -> None:
        """Write the state at the end of the run."""
        self.join()
        result = "shut down" if failure is None else f"stopped by an alarm: {failure}"
        self._write(self._state(result, failure))

    def _write(self, record: Retained) -> None:
        try:
            keep_machine(self._machine, self._store, self._drive, record)
        except GantryctlError as fault:
            self.faults.append(str(fault))

    def _state(self, result: str, alarm: AlarmStop | None = None) -> Retained:
        """Make the retained memory of this run so far."""
        end = RunEnd(result, alarm, self._power_ups, self._moves, self._engine.time_s)
        levels, kept = self._operator.levels, self.retained
        seen: ReadDrive = LastRead(self._engine) if self._machine.on_bus else self._drive
        record = replace(
            retained_after(self._machine, kept, self._axis, seen, end),
            speed_rad_s=levels.speed_rad_s,
            increment_rad=levels.increment_rad,
            travelled_rad=kept.travelled_rad + self._way_rad,
        )
        if not self._operator.permit.blocked_by:
            return record
        if not record.error_stop:
            record = replace(record, error_stop=kept.error_stop)
        # Without a power-up nobody has confirmed the angle: the next start must ask again.
        if not self._power_ups:
            record = replace(
                record,
                rest_position_counts=kept.rest_position_counts,
                zero_offset_counts=kept.zero_offset_counts,
            )
        return record


class LastRead:
    """The drive as the last scan has read it."""

    # A drive on a bus is read once a scan and no more.

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def identity(self) -> DriveIdentity:
        """Encoder of the drive."""
        return self._engine.drive.identity()

    def read(self) -> DriveFeedback:
        """The reading of the last scan."""
        return self._engine.image.drive
