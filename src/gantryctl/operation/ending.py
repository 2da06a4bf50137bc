"""The end of a run: what the controller has to remember of it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from gantryctl.errors import AlarmStop
from gantryctl.machine import Machine, config_hash
from gantryctl.operation.brake_policy import still_failed
from gantryctl.operation.state import now_text
from gantryctl.operation.virtual import ReadDrive
from gantryctl.program import Axis, Code
from gantryctl.runtime import AlarmEntry, Retained
from gantryctl.units import rad


class RunEnd(NamedTuple):
    """How a run ended.

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


def retained_after(machine: Machine, before: Retained, axis: Axis, drive: ReadDrive, end: RunEnd) -> Retained:
    """The retained memory after a run."""
    identity = drive.identity()
    counts_range = identity.counts_per_turn * identity.turns
    counts = drive.read().pos_act_counts
    rest = before.rest_position_counts
    way = abs(counts - (counts if rest is None else rest)) / machine.counts_per_turn
    alarms, held = _alarms(axis, end, before.brake_failed)
    return replace(
        before,
        config_hash=config_hash(machine),
        rest_position_counts=int(counts) % counts_range,
        zero_offset_counts=int(axis.zero_counts) % counts_range,
        holding_torque_nm=axis.holding_torque_nm,
        power_ups=before.power_ups + end.power_ups,
        moves=before.moves + end.moves,
        travelled_rad=before.travelled_rad + way * rad(360.0) / axis.settings.law.ratio,
        error_stop=held,
        brake_failed=still_failed(axis, before),
        last_result=end.result,
        alarms=(*before.alarms, *alarms),
    )


def _alarms(axis: Axis, end: RunEnd, failed_before: str) -> tuple[tuple[AlarmEntry, ...], str]:
    """The alarms of this run for the record, and the code that holds the axis, or nothing."""
    when = now_text()
    alarms = tuple(
        AlarmEntry(str(alarm.code), alarm.text, when, alarm.time_s, alarm.pos_rad)
        for alarm in axis.alarms.history
        if not (failed_before and alarm.code is Code.BRK_08 and alarm.scan == 0)  # known from an earlier run
    )
    first = axis.alarms.first_out
    if first is not None:
        return alarms, str(first.code)
    if end.alarm is None:
        return alarms, ""
    code = str(end.alarm).partition(" ")[0]  # of the engine: an exception in the program, scans too late
    return (*alarms, AlarmEntry(code, str(end.alarm), when, end.time_s, axis.pos_act_rad)), code
