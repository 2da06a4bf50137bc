"""What one run adds to the retained memory: its power-ups and moves, its brake test, where it rests."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import NamedTuple, Protocol

from gantryctl.errors import AlarmStop
from gantryctl.image import DriveFeedback, DriveIdentity
from gantryctl.machine import Machine
from gantryctl.operation.brake_policy import after_test, judge_due, still_failed
from gantryctl.operation.store import StateStore, now_text
from gantryctl.program import Axis, BrakeTestResult, Code
from gantryctl.runtime import AlarmEntry, Retained
from gantryctl.units import rad


class ReadDrive(Protocol):
    """Encoder and reading of a drive at the end of a run."""

    def identity(self) -> DriveIdentity:
        """Encoder."""
        ...

    def read(self) -> DriveFeedback:
        """Reading."""
        ...


class RunEnd(NamedTuple):
    """End of a run, for the retained memory.

    Attributes:
        result: in words, for `status`.
        alarm: what stopped the axis, if anything did.
        power_ups, moves: how many there were.
    """

    result: str
    alarm: AlarmStop | None
    power_ups: int
    moves: int
    time_s: float


class RunMemory:
    """Retained memory of a run.

    Args:
        retained: as the last run left it.
        store: the state directory; None where nothing is kept.

    Attributes:
        retained: with the brake tests of this run.
        power_ups, moves: of this run.
        brake_due: when the next brake test is due.
    """

    def __init__(self, machine: Machine, axis: Axis, retained: Retained, store: StateStore | None) -> None:
        self._machine, self._axis, self._store = machine, axis, store
        self.retained = retained
        self.power_ups = self.moves = 0
        self.brake_due = judge_due(machine, axis, retained, retained.power_ups)

    def brake_tested(self, result: BrakeTestResult) -> None:
        """Keep the result of a brake test, and judge when the next one is due."""
        power_ups = self.retained.power_ups + self.power_ups
        self.retained = after_test(self.retained, result, power_ups, datetime.now(UTC))
        self.brake_due = judge_due(self._machine, self._axis, self.retained, power_ups)

    def forget_rest(self) -> None:
        """Power comes on: from now on nobody who finds this memory knows where the axis rests, if it may turn on."""
        if self._store is not None and _may_turn_on(self._machine, self._axis):
            self._store.store_retained(replace(self.retained, rest_position_counts=None))

    def rest_keeper(self, counts: int, range_counts: int) -> Callable[[], None]:
        """Work that keeps where the axis stands.

        Args:
            counts: of the encoder, continuous. range_counts: within all its turns.
        """
        store = self._store
        # A simulated plant of this process is killed with the run, and comes back where it was before.
        if store is None or self._machine.plant_is_local:
            return lambda: None
        kept = replace(self.retained, rest_position_counts=counts % range_counts)
        if self._axis.turns is not None:
            kept = replace(kept, zero_offset_counts=self._axis.turns.kept_zero(counts, range_counts))
        return partial(store.store_retained, kept)


def retained_after(machine: Machine, before: Retained, axis: Axis, drive: ReadDrive, end: RunEnd) -> Retained:
    """The retained memory after a run."""
    identity = drive.identity()
    counts_range = identity.counts_per_turn * identity.turns
    # The way is that between two rests; the service, which runs for days, counts its way in the scan.
    counts = drive.read().pos_act_counts
    rest = before.rest_position_counts
    way = abs(counts - (counts if rest is None else rest)) / machine.counts_per_turn
    alarms, held = _alarms(axis, end, before.brake_failed)
    return replace(
        before,
        rest_position_counts=None
        if _may_turn_on(machine, axis) and not axis.is_off
        else int(counts) % counts_range,
        zero_offset_counts=axis.turns.kept_zero(int(counts), counts_range)
        if axis.turns
        else int(axis.zero_counts) % counts_range,
        holding_torque_nm=axis.holding_torque_nm,
        torque_weights=json.dumps(axis.torque_weights) if axis.torque_weights else before.torque_weights,
        calibration_watch=json.dumps(axis.calibration_memory)
        if axis.calibration_memory
        else before.calibration_watch,
        emergency_brake_stops=before.emergency_brake_stops + axis.power.wear.stops,
        emergency_brake_energy_j=before.emergency_brake_energy_j + axis.power.wear.energy_j,
        power_ups=before.power_ups + end.power_ups,
        moves=before.moves + end.moves,
        travelled_rad=before.travelled_rad + way * rad(360.0) / axis.settings.law.ratio,
        error_stop=held,
        doubted_by=(before.doubted_by or held or "-") if axis.feedback.in_doubt else "",
        brake_failed=still_failed(axis, before),
        last_result=end.result,
        alarms=(*before.alarms, *alarms),
    )


def _may_turn_on(machine: Machine, axis: Axis) -> bool:
    """A modulo axis whose controller dies may come to rest any number of encoder ranges further on.

    A simulated plant of this process dies with it.
    """
    return axis.turns is not None and not machine.plant_is_local


def _alarms(axis: Axis, end: RunEnd, failed_before: str) -> tuple[tuple[AlarmEntry, ...], str]:
    """The alarms of this run for the record, and the code that holds the axis, or ""."""
    when = now_text()
    alarms = tuple(
        AlarmEntry(
            str(alarm.code),
            alarm.text,
            when,
            alarm.time_s,
            _known(alarm.pos_rad),
            severity=alarm.severity.value,
            follows=str(alarm.follows or ""),
        )
        for alarm in axis.alarms.history
        if not (failed_before and alarm.code is Code.BRK_08 and alarm.scan == 0)  # known from an earlier run
    )
    first = axis.alarms.first_out
    if first is not None:
        return alarms, str(first.code)
    if end.alarm is None:
        return alarms, ""
    # What the program has not raised itself: a power-up that did not end, a drive that left.
    code = end.alarm.code
    return (
        *alarms,
        AlarmEntry(code, str(end.alarm), when, end.time_s, _angle_rad(axis), severity="STOP"),
    ), code


def _angle_rad(axis: Axis) -> float | None:
    """The angle, None while its reading is in doubt."""
    return axis.pos_act_rad if axis.feedback.position_valid else None


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
