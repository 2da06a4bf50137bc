"""Gains of the speed loop in a drive whose profile names their objects: read, never written."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.od.types import DataType, decode
from gantryctl.drives.profiles import Gain, SpeedLoop


class GainReading(NamedTuple):
    """One gain as the drive holds it.

    Attributes:
        name: kp or ki.
        value: in the unit of the object; None where the drive does not have it.
        si: in A s/rad (kp) or A/rad (ki) at the motor shaft; NaN where the unit is not known, or of another kind.
    """

    name: str
    gain: Gain
    value: float | None
    si: float


def read_gains(sdo: SdoClient, loop: SpeedLoop) -> tuple[GainReading, ...]:
    """Read the gains.

    Raises:
        DeviceError: the drive does not answer.
    """
    named = [("kp", loop.kp), *([("ki", loop.ki)] if loop.ki is not None else [])]
    return tuple(_read(sdo, name, gain) for name, gain in named)


def _read(sdo: SdoClient, name: str, gain: Gain) -> GainReading:
    try:
        data = sdo.read(*gain.key)
    except SdoError as refused:
        if refused.silent:
            raise
        return GainReading(name, gain, None, float("nan"))
    value = decode(DataType.REAL32, data) if gain.real else int.from_bytes(data, "little")
    assert isinstance(value, int | float)
    return GainReading(name, gain, float(value), value * gain.si)
