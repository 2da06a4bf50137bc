"""Simulated gantry of a virtual drive in another process, known by its side channel."""

from __future__ import annotations

from collections.abc import Mapping

from gantryctl.drives.base import TRUTH_COLUMNS
from gantryctl.drives.virtual.side_channel.control import ControlClient


class RemotePlant:
    """Gantry of a virtual drive in another process."""

    truth_columns: tuple[str, ...] = TRUTH_COLUMNS

    def __init__(self, channel: ControlClient) -> None:
        self._channel = channel
        self._true = self._values(channel.ask("truth"))
        self._asked = False

    def truth(self) -> tuple[float, ...]:
        """True state of load, motor and base: the last answer. A scan does not wait for a side channel."""
        # One request is under way at a time; a scan takes its answer when it is there.
        if not self._asked:
            self._channel.send("truth")
            self._asked = True
        elif (answer := self._channel.poll()) is not None:
            self._true = self._values(answer)
            self._asked = False
        return self._true

    def plant_state(self) -> dict[str, float]:
        """{}: the other process keeps its plant."""
        return {}

    def settle(self) -> None:
        """Nothing: the other process goes on by itself."""

    def _values(self, answer: Mapping[str, float]) -> tuple[float, ...]:
        return tuple(float(answer[name]) for name in self.truth_columns)
