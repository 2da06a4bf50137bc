"""Operators without a person: a script by time, and a command that the caller sets."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from gantryctl.errors import UsageError
from gantryctl.image import OperatorCommand

# k x period may fall short of the time in the script by a rounding error.
_TOLERANCE_S = 1e-9


class FixedOperator:
    """Operator that gives what the caller put into `command`, from the next scan on.

    Hold-to-run still needs a new `lease` every 250 ms: the holder renews it, not this class.
    """

    def __init__(self, command: OperatorCommand | None = None) -> None:
        self.command = command or OperatorCommand()

    def poll(self, time_s: float) -> OperatorCommand:
        return self.command


class ScriptedOperator:
    """Commands by time, each valid until the next one; no demand before the first."""

    def __init__(self, script: Sequence[tuple[float, OperatorCommand]]) -> None:
        times = [time_s for time_s, _ in script]
        for before, after in zip([-math.inf, *times], times, strict=False):
            if not (math.isfinite(after) and after >= before):
                raise UsageError(f"script: times must be finite and rise, got {after} s after {before} s")
        self._times = [time_s - _TOLERANCE_S for time_s in times]
        self._commands = [OperatorCommand(), *(command for _, command in script)]

    def poll(self, time_s: float) -> OperatorCommand:
        return self._commands[bisect_right(self._times, time_s)]
