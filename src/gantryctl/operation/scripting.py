"""For scripts and notebooks: a whole move in one call."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.machine import Machine
from gantryctl.operation.session import AxisSession
from gantryctl.operation.summary import MotionSummary, summarise
from gantryctl.runtime import MemoryRecorder
from gantryctl.trace import Trace


class MoveResult(NamedTuple):
    """A finished move: its summary, and the recording of the whole run."""

    summary: MotionSummary
    trace: Trace


def move(machine: Machine, *targets_deg: float, speed_deg_s: float | None = None) -> MoveResult:
    """Take a new machine standing at 0 deg through one or more moves, in virtual time; nothing is kept.

    Returns:
        The summary of the last move and the recording of everything.

    Raises:
        CommandRefused: a target or the speed is not possible.
        AlarmStop: an alarm stopped the axis.
    """
    session = AxisSession(machine, recorder=MemoryRecorder)
    recorder = session.engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    try:
        session.power_up()
        motions = [session.move(target, speed_deg_s) for target in targets_deg]
    finally:
        session.close("script")
    trace = recorder.trace()
    last = motions[-1] if motions else None
    begin, end = (last.from_s, last.to_s) if last is not None else (0.0, session.engine.time_s)
    summary = summarise(trace, begin, end, machine.axis.ratio)
    assert summary is not None  # what makes rows useless raises before
    return MoveResult(summary, trace)
