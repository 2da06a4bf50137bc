"""Operators without a person: a script by time, and a command held by the caller."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence

from gantryctl.errors import UsageError
from gantryctl.image import OperatorCommand

_TOLERANCE_S = 1e-9  # k * period may fall short of the written time by a rounding error


class FixedOperator:
    """Gives what the caller put into `command`, from the next scan on.

    Hold-to-run still needs a new `lease` every 250 ms: the holder renews it, not this class.
    """

    def __init__(self, command: OperatorCommand | None = None) -> None:
        self.command = command or OperatorCommand()

    def poll(self, time_s: float) -> OperatorCommand:
        """The command held now."""
        return self.command


class ScriptedOperator:
    """Commands by time, each valid until the next one; before the first, nothing is wanted."""

    def __init__(self, script: Sequence[tuple[float, OperatorCommand]]) -> None:
        times = [time_s for time_s, _ in script]
        for before, after in zip([-math.inf, *times], times, strict=False):
            if not (math.isfinite(after) and after >= before):
                raise UsageError(f"script: times must be finite and rise, got {after} s after {before} s")
        self._times = [time_s - _TOLERANCE_S for time_s in times]
        self._commands = [OperatorCommand(), *(command for _, command in script)]

    def poll(self, time_s: float) -> OperatorCommand:
        """The command valid at `time_s`."""
        return self._commands[bisect_right(self._times, time_s)]
