"""The encoder on the ring of a machine, as an instrument that reads the load."""

from __future__ import annotations

from collections.abc import Callable

from gantryctl.engineering.instruments.port import Reading, checked


class RingEncoder:
    """Readings of the encoder on the ring; it measures the ring against the base, and its own errors are in them.

    Args:
        name: what it is.
        uncertainty_deg: standard uncertainty of a reading, by its calibration.
        angle_deg: the angle that it shows.
    """

    def __init__(self, name: str, uncertainty_deg: float, angle_deg: Callable[[], float]) -> None:
        self.name = name
        self._uncertainty_deg, self._angle_deg = uncertainty_deg, angle_deg

    def read(self, time_s: float) -> Reading:
        """One reading, now.

        Raises:
            InstrumentError: it shows no angle.
        """
        return checked(Reading(self._angle_deg(), self._uncertainty_deg), self.name)
