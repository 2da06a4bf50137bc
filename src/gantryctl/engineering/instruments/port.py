"""What is asked of an instrument at the load: a tracker, an electronic level, a simulated one."""

from __future__ import annotations

import math
from typing import Final, NamedTuple, Protocol

from gantryctl.errors import InstrumentError

# Beyond these a reading has another unit, not another angle: 1 turn is 400 gon, 1 deg is 3600 arcsec.
ANGLE_MAX_DEG: Final = 360.0
UNCERTAINTY_MAX_DEG: Final = 1.0


class Reading(NamedTuple):
    """One reading of the load angle.

    Attributes:
        angle_deg: counter-clockwise positive; its zero is the instrument's.
        uncertainty_deg: standard uncertainty (k = 1) that the instrument states, everything that it knows of included.
    """

    angle_deg: float
    uncertainty_deg: float


class Instrument(Protocol):
    """An instrument that measures the load from outside the control loop."""

    @property
    def name(self) -> str:
        """What it is, for reports: type, serial number, calibration."""
        ...

    def read(self, time_s: float) -> Reading:
        """One reading, now.

        Args:
            time_s: time of the axis. A simulated instrument needs it; a real one reads when it is asked.

        Raises:
            InstrumentError: no reading that can be used; it may be asked again.
        """
        ...


def checked(reading: Reading, source: str) -> Reading:
    """The reading, if it can be one.

    Raises:
        InstrumentError: angle or uncertainty is no number, or outside its limits.
    """
    angle, uncertainty = reading
    if not abs(angle) <= ANGLE_MAX_DEG:
        raise InstrumentError(
            f"{source}: angle {angle:g} deg: must be a number within +-{ANGLE_MAX_DEG:g} deg; check its unit"
        )
    if not (0.0 < uncertainty <= UNCERTAINTY_MAX_DEG and math.isfinite(uncertainty)):
        raise InstrumentError(
            f"{source}: standard uncertainty {uncertainty:g} deg: must be above 0 and at most "
            f"{UNCERTAINTY_MAX_DEG:g} deg"
        )
    return reading
