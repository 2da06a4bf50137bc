"""The last stop by an alarm: which came first, what followed from it, and what the recording shows of the moment."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gantryctl.errors import GantryctlError
from gantryctl.image import DriveState
from gantryctl.machine import Machine
from gantryctl.program.alarms.codes import Code, Severity
from gantryctl.program.alarms.table import ALARMS, describe_reaction
from gantryctl.runtime import AlarmEntry
from gantryctl.trace.files import Floats
from gantryctl.trace.naming import begun_at, oldest_first
from gantryctl.trace.reader import read_trace
from gantryctl.trace.table import Trace
from gantryctl.units import deg
from gantryctl.wiring.program import rest_speed_deg_s

# What is shown before the alarm; after it, to rest and so much more.
BEFORE_S: Final = 5.0
AFTER_S: Final = 2.0
# A row of the recording that belongs to the scan of the alarm.
_SAME_SCAN_S: Final = 1e-6


class DriveChange(NamedTuple):
    """A state of the drive by CiA 402, and when it was first read."""

    time_s: float
    state: DriveState


class Moment(NamedTuple):
    """What the recording shows of a stop: motor side, at the gantry.

    Attributes:
        speed_deg_s, torque_nm: read in the scan of the alarm; the torque is the motor's.
        error_deg: set-point minus angle in the scan before, the last one that followed the set-point.
        drive: its state in that scan, and every other one until the end of the recording.
        rest_s: from the alarm until the axis stood; None where the recording ends before, or the reading is in doubt.
        way_deg: turned meanwhile, with sign; None likewise.
    """

    file: Path
    speed_deg_s: float
    torque_nm: float
    error_deg: float
    drive: tuple[DriveChange, ...]
    rest_s: float | None
    way_deg: float | None


class LastStop(NamedTuple):
    """The last stop.

    Attributes:
        first: the alarm that stopped the axis. followed: those that came from it, in order.
        before: other alarms and notes of the same run before it.
        holds: it still holds the axis.
    """

    first: AlarmEntry
    before: tuple[AlarmEntry, ...]
    followed: tuple[AlarmEntry, ...]
    holds: bool


def last_stop(alarms: Sequence[AlarmEntry], holds: Sequence[str]) -> LastStop | None:
    """Find the newest alarm that stopped the axis.

    Args:
        alarms: newest first. holds: codes of what holds the axis.
    """
    index = next((number for number, alarm in enumerate(alarms) if _stopped(alarm)), None)
    if index is None:
        return None
    first = alarms[index]
    followed = tuple(alarm for alarm in reversed(alarms[:index]) if alarm.follows == first.code)
    before = tuple(
        alarm
        for alarm in reversed(alarms[index + 1 :])
        if alarm.at == first.at and alarm.time_s <= first.time_s and not alarm.follows
    )
    return LastStop(first, before, followed, first.code in holds)


def _stopped(alarm: AlarmEntry) -> bool:
    """An alarm that stopped the axis and follows from no other one."""
    severity = alarm.severity
    if not severity:
        row = ALARMS.get(Code(alarm.code)) if alarm.code in set(Code) else None
        severity = row.severity.value if row is not None else ""
    return severity == Severity.STOP.value and not alarm.follows


def moment_of(machine: Machine, stop: AlarmEntry, folder: Path) -> Moment | None:
    """What the recordings of a folder show of a stop; None where none of them has it.

    It is the newest one that was begun before the alarm, has its time, and counts one alarm more from that scan on.
    """
    at, rest_deg_s = _time(stop.at), rest_speed_deg_s(machine)
    files = oldest_first([*folder.glob("*.parquet"), *folder.glob("*.arrows")])
    for file in reversed(files):
        begun = begun_at(file)
        # Dates of alarms are whole seconds, and a run in virtual time may take less than one.
        if begun is None or (at is not None and begun - at >= timedelta(seconds=1)):
            continue
        try:
            trace = read_trace(file)
        except GantryctlError:
            continue
        row = _row_of(trace, stop.time_s)
        if row is not None:
            return _moment(trace, row, file, rest_deg_s, doubted=stop.pos_act_rad is None)
    return None


def _time(at: str) -> datetime | None:
    try:
        return datetime.fromisoformat(at)
    except ValueError:
        return None


def _row_of(trace: Trace, time_s: float) -> int | None:
    """Row of the scan in which an alarm came; None where the recording does not have it."""
    if not len(trace) or "alarm_count" not in trace:
        return None
    row = int(np.searchsorted(trace.time_s, time_s - _SAME_SCAN_S))
    if row >= len(trace) or abs(trace.time_s[row] - time_s) > _SAME_SCAN_S + 1e-3:
        return None
    count = trace["alarm_count"]
    came = count[row] > (count[row - 1] if row else 0.0)
    return row if came else None


def _moment(trace: Trace, row: int, file: Path, rest_deg_s: float, *, doubted: bool) -> Moment:
    time_s, speed = trace.time_s, np.abs(deg(1.0) * trace["vel_act_rad_s"])
    moving = np.flatnonzero(speed[row:] > rest_deg_s)
    rest = row + int(moving[-1]) + 1 if len(moving) else row
    known = (
        not doubted
        and rest < len(trace)
        and bool(np.isfinite(trace["pos_act_rad"][[row, min(rest, len(trace) - 1)]]).all())
    )
    way = deg(_way_rad(trace["pos_act_rad"][row : rest + 1])) if known else None
    state = trace["drive_state"]
    changes = [row, *(row + 1 + np.flatnonzero(np.diff(state[row:])))]
    return Moment(
        file,
        deg(float(trace["vel_act_rad_s"][row])),
        float(trace["torque_act_nm"][row]),
        deg(float(trace["pos_err_rad"][max(row - 1, 0)])),
        tuple(DriveChange(float(time_s[each]), DriveState(int(state[each]))) for each in changes),
        float(time_s[rest] - time_s[row]) if known else None,
        way,
    )


def _way_rad(pos_rad: Floats) -> float:
    """Way from the first row to the last, without the whole turns by which the zero of a modulo axis moves on."""
    turns = np.nansum(np.round(np.diff(pos_rad) / math.tau))
    return float(pos_rad[-1] - pos_rad[0] - math.tau * turns)


def sentences(machine: Machine, stop: LastStop, moment: Moment | None) -> Iterator[str]:
    """Tell what happened in sentences, a line each."""
    first = stop.first
    row = ALARMS[Code(first.code)] if first.code in set(Code) else None
    title = f" ({row.english.title})" if row is not None else ""
    when = f" on {first.at}" if first.at else ""
    yield f"{machine.name} was stopped{when}, {first.time_s:.3f} s after the run began, by {first.code}{title}."
    yield f"The alarm said: {first.text}"
    for alarm in stop.before:
        yield f"Before it, at {alarm.time_s:.3f} s: {alarm.text}"
    yield _where(machine, first, moment)
    if moment is not None:
        yield from _motion(first, moment)
    if not stop.followed:
        yield "No other alarm followed from it."
    for alarm in stop.followed:
        yield f"It was followed, {1e3 * (alarm.time_s - first.time_s):.0f} ms later, by: {alarm.text}"
    if row is not None:
        yield f"What it means: {row.english.cause}"
        yield f"What the axis does then: {describe_reaction(row).english}."
        yield f"What to do: {row.english.to_do}"


def _where(machine: Machine, first: AlarmEntry, moment: Moment | None) -> str:
    if first.pos_act_rad is None:
        return "Where the axis was is not known: its reading was in doubt."
    angle = f"The axis was at {machine.axis.dial.text(deg(first.pos_act_rad), '.3f')} deg (motor encoder)"
    if moment is None:
        return f"{angle}. No recording of that moment is left."
    return (
        f"{angle}, turning at {moment.speed_deg_s:+.3f} deg/s, the set-point {moment.error_deg:+.4f} deg ahead of it, "
        f"with {moment.torque_nm:+.1f} N m at the motor."
    )


def _motion(first: AlarmEntry, moment: Moment) -> Iterator[str]:
    if moment.rest_s is not None and moment.way_deg is not None:
        yield (
            f"It stood {moment.rest_s:.2f} s later, {moment.way_deg:+.3f} deg from there."
            if moment.rest_s
            else "It stood already."
        )
    else:
        yield "How far it went on is not known: the recording ends before, or the reading was in doubt."
    begun, *later = ((change.time_s, change.state.name.lower().replace("_", " ")) for change in moment.drive)
    then = "".join(f", {1e3 * (time_s - first.time_s):.0f} ms later {name}" for time_s, name in later)
    yield f"The drive said: {begun[1]}{then}."


def window_s(stop: AlarmEntry, moment: Moment) -> tuple[float, float]:
    """Begin and end of what a picture of the moment shows."""
    return stop.time_s - BEFORE_S, stop.time_s + (moment.rest_s or 0.0) + AFTER_S
