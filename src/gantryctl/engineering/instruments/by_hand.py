"""A person who reads an instrument and gives the number."""

from __future__ import annotations

from collections.abc import Callable

from gantryctl.engineering.instruments.port import Reading, checked


class ByHand:
    """Readings that a person takes and gives.

    Args:
        who: who reads.
        uncertainty_deg: standard uncertainty of a reading.
        ask: gives the number.
    """

    def __init__(self, who: str, uncertainty_deg: float, ask: Callable[[], float]) -> None:
        self._uncertainty_deg, self._ask = uncertainty_deg, ask
        self.name = f"read by {who}"

    def read(self, time_s: float) -> Reading:
        """One reading, when the person gives it.

        Raises:
            InstrumentError: what was given is no angle.
        """
        return checked(Reading(self._ask(), self._uncertainty_deg), self.name)
