"""A program of one's own, named on the command line as FILE:CLASS."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from gantryctl.errors import UsageError
from gantryctl.program import Axis, AxisProgram, GantryProgram
from gantryctl.wiring.engine import ProgramFactory


def load_program(name: str | None) -> ProgramFactory:
    """What makes the class behind FILE:CLASS, or the shipped program.

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
    sys.modules.setdefault(path.stem, module)
    try:
        spec.loader.exec_module(module)
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
