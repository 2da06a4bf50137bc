"""Custom programs named on the command line, and a whole move in one call for scripts and notebooks."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import NamedTuple

from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.operation.run import AxisRun
from gantryctl.operation.summary import MotionSummary, summarise
from gantryctl.program import Axis, AxisProgram, GantryProgram
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace
from gantryctl.wiring.engine import ProgramFactory


class MoveResult(NamedTuple):
    """A finished move: its summary, and the recording of the whole run."""

    summary: MotionSummary
    trace: Trace

    def _repr_html_(self) -> str:
        return self.summary._repr_html_() + self.trace._repr_html_()


def move(machine: Machine, *targets_deg: float, speed_deg_s: float | None = None) -> MoveResult:
    """Take a new machine standing at 0 deg through one or more moves, in virtual time; nothing is kept.

    Returns:
        The summary of the last move and the recording of everything.

    Raises:
        CommandRefused: a target or the speed is not possible.
        AlarmStop: an alarm stopped the axis.
    """
    session = AxisRun(machine, recorder=MemoryRecorder)
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
    summary = summarise(trace, begin, end, machine.axis)
    assert summary is not None  # what makes rows useless raises before
    return MoveResult(summary, trace)


def load_program(name: str | None) -> ProgramFactory:
    """Load the class behind FILE:CLASS; the shipped program without a name.

    Raises:
        UsageError: no such file or class, an error in the file, or a class that is no `AxisProgram`; when it is made,
            an error in its constructor.
    """
    if name is None:
        return GantryProgram
    file, colon, kind = name.rpartition(":")
    path = Path(file)
    if not colon or not kind.isidentifier():
        raise UsageError(f"--program {name}: write FILE:CLASS, for example my_program.py:MyProgram")
    if not path.is_file():
        raise UsageError(f"--program {name}: there is no file {path}")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise UsageError(f"--program {name}: {path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    # A dataclass looks its own module up there.
    sys.modules.setdefault(path.stem, module)
    try:
        spec.loader.exec_module(module)
    # SystemExit too: a file with a `main` at its end may leave the process.
    except (Exception, SystemExit) as error:
        raise UsageError(
            f"--program {name}: {path} cannot be run: {type(error).__name__}: {error}"
        ) from error
    found = getattr(module, kind, None)
    if not (isinstance(found, type) and issubclass(found, AxisProgram)):
        raise UsageError(f"--program {name}: {path} has no class {kind} derived from gantryctl.AxisProgram")

    def make(axis: Axis) -> AxisProgram:
        try:
            made = found(axis)
        except (Exception, SystemExit) as error:
            raise UsageError(
                f"--program {name}: {kind}(axis) failed: {type(error).__name__}: {error}"
            ) from error
        if getattr(made, "axis", None) is not axis or not hasattr(made, "trace_columns"):
            raise UsageError(f"--program {name}: {kind}.__init__ must call super().__init__(axis)")
        return made

    return make
