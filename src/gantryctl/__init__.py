"""Soft motion controller for big, slow, unbalanced rotary axes.

Twenty names for scripts and notebooks; everything else is in the packages they come from.

    machine = load_machine("my_machine.toml")     # or default_machine()
    move(machine, 90.0)                           # power up, move, power down, summary
    engine = build_engine(machine, program=MyProgram, recorder=MemoryRecorder)
    engine.run_for(10.0)
    engine.trace().plot()                         # a picture in a notebook

`gantryctl.client` drives a running service from Python.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gantryctl.lazy import importer

if TYPE_CHECKING:
    from gantryctl.engineering.accuracy.job import run_accuracy as run_accuracy
    from gantryctl.engineering.stops import stop_table as stop_table
    from gantryctl.errors import GantryctlError as GantryctlError
    from gantryctl.image import InputImage as InputImage
    from gantryctl.image import Mode as Mode
    from gantryctl.image import OperatorCommand as OperatorCommand
    from gantryctl.machine import Machine as Machine
    from gantryctl.machine import default_machine as default_machine
    from gantryctl.machine import load_machine as load_machine
    from gantryctl.machine import with_values as with_values
    from gantryctl.operation.scripting import move as move
    from gantryctl.program import Axis as Axis
    from gantryctl.program import AxisProgram as AxisProgram
    from gantryctl.program import AxisState as AxisState
    from gantryctl.program import GantryProgram as GantryProgram
    from gantryctl.runtime import Engine as Engine
    from gantryctl.runtime.recorder import MemoryRecorder as MemoryRecorder
    from gantryctl.trace.reader import read_trace as read_trace
    from gantryctl.trace.table import Trace as Trace
    from gantryctl.wiring.engine import build_engine as build_engine

_HOME = {
    "Axis": "gantryctl.program",
    "AxisProgram": "gantryctl.program",
    "AxisState": "gantryctl.program",
    "Engine": "gantryctl.runtime",
    "GantryProgram": "gantryctl.program",
    "GantryctlError": "gantryctl.errors",
    "InputImage": "gantryctl.image",
    "Machine": "gantryctl.machine",
    "MemoryRecorder": "gantryctl.runtime.recorder",
    "Mode": "gantryctl.image",
    "OperatorCommand": "gantryctl.image",
    "Trace": "gantryctl.trace.table",
    "build_engine": "gantryctl.wiring.engine",
    "default_machine": "gantryctl.machine",
    "load_machine": "gantryctl.machine",
    "move": "gantryctl.operation.scripting",
    "read_trace": "gantryctl.trace.reader",
    "run_accuracy": "gantryctl.engineering.accuracy.job",
    "stop_table": "gantryctl.engineering.stops",
    "with_values": "gantryctl.machine",
}

__all__ = list(_HOME)
# `import gantryctl` alone costs nothing.
if not TYPE_CHECKING:  # so that mypy refuses other names
    __getattr__ = importer(globals(), _HOME)


def __dir__() -> list[str]:
    return sorted(_HOME)
