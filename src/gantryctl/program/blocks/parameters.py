"""PLCopen blocks that read and write parameters of the axis; `gantryctl.program.axis.parameters` has the table."""

from __future__ import annotations

import math

from gantryctl.program.alarms.log import Refusal
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.parameters import read_bool_parameter, read_parameter, write_parameter
from gantryctl.program.blocks.base import Block


class ReadParameter(Block):
    """`value` of a parameter, rad and seconds; `error` for a number that has none."""

    __slots__ = ("valid", "value")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.valid = False
        self.value = math.nan

    def __call__(self, *, enable: bool = True, parameter_number: int) -> None:
        found = read_parameter(self.axis, parameter_number) if enable else math.nan
        refused = found if isinstance(found, Refusal) else None
        self.valid = enable and refused is None
        self.value = math.nan if isinstance(found, Refusal) else found
        self._fail(refused)


class ReadBoolParameter(Block):
    """`value` of a parameter that is TRUE or FALSE; `error` for a number that has none."""

    __slots__ = ("valid", "value")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.valid = self.value = False

    def __call__(self, *, enable: bool = True, parameter_number: int) -> None:
        found = read_bool_parameter(self.axis, parameter_number) if enable else False
        refused = found if isinstance(found, Refusal) else None
        self.valid = enable and refused is None
        self.value = found is True
        self._fail(refused)


class WriteParameter(Block):
    """Set a limit of later motions on the rising edge of Execute, at most that of the machine; only at standstill."""

    __slots__ = ("_execute", "done")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.done = self._execute = False

    def __call__(self, *, execute: bool, parameter_number: int, value: float) -> None:
        if execute != self._execute:
            self._execute = execute
            self._fail(None)
            self.done = execute and self._accepted(write_parameter(self.axis, parameter_number, value))
