"""Gains of the speed loop in a drive whose profile names their objects: read, and written with read back."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.canopen.setup.parameters import refuse_energised
from gantryctl.drives.od.types import DataType, decode
from gantryctl.drives.profiles import Gain, SpeedLoop
from gantryctl.errors import CommandRefused, DeviceError

# Of a whole number: with larger steps the drive would have another gain than was asked for.
_ROUNDING: Final = 0.01
# Part of a motor turn that a standing shaft does not pass within the time that is watched.
_STANDS_TURN: Final = 1e-3
_WATCHED_S: Final = 0.2


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


class GainChange(NamedTuple):
    """A gain to be written, in the unit of its object."""

    name: str
    gain: Gain
    before: float
    after: float


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
        return GainReading(name, gain, None, math.nan)
    value = decode(DataType.REAL32, data) if gain.real else int.from_bytes(data, "little")
    assert isinstance(value, int | float)
    return GainReading(name, gain, float(value), value * gain.si)


# --- what is to be written -----------------------------------------------------------------------------------------


def planned_changes(
    found: tuple[GainReading, ...], wanted_si: Mapping[str, float], times: Mapping[str, float]
) -> tuple[GainChange, ...]:
    """New values of gains in the units of their objects.

    Args:
        wanted_si: gains in A s/rad (kp) and A/rad (ki) at the motor shaft, by name.
        times: factors of the proportional and the integral gain, by name. Where the object of the integral part is a
            rate (kp times it is the integral gain), it gets the factor that gives the same integral gain.

    Raises:
        CommandRefused: the drive has no such gain, its unit is not known, or it cannot hold the value.
    """
    changes: list[GainChange] = []
    for reading in found:
        name = reading.name
        if name not in wanted_si and name not in times:
            continue
        if reading.value is None:
            raise CommandRefused(
                f"{name}: the drive has no {reading.gain.object}; set it with the maker's tool"
            )
        if name in wanted_si:
            if math.isnan(reading.gain.si):
                raise CommandRefused(
                    f"--{name}: the unit of {reading.gain.object} is not one of current per angle "
                    f"({reading.gain.unit or 'not known'}): give --{name}-times"
                )
            after = wanted_si[name] / reading.gain.si
        else:
            after = reading.value * times[name]
            if name == "ki" and reading.gain.rate and changes:
                after *= changes[0].before / changes[0].after
        changes.append(GainChange(name, reading.gain, reading.value, _held(name, reading.gain, after)))
    missing = (set(wanted_si) | set(times)) - {reading.name for reading in found}
    if missing:
        raise CommandRefused(
            f"{', '.join(sorted(missing))}: the profile of this drive names no object for it"
        )
    return tuple(changes)


def _held(name: str, gain: Gain, value: float) -> float:
    """The value as the object can hold it."""
    if not value > 0.0 or not math.isfinite(value):
        raise CommandRefused(f"{name}: {value:g} is no gain: must be above 0")
    if gain.real:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    whole = float(round(value))
    if abs(whole - value) > _ROUNDING * value:
        raise CommandRefused(
            f"{name}: {gain.object} takes whole numbers, and {value:.4g} is not within {100.0 * _ROUNDING:g} % of one"
        )
    return whole


# --- writing -------------------------------------------------------------------------------------------------------


def write_gains(node: RemoteNode, changes: tuple[GainChange, ...], increments_per_turn: int) -> None:
    """Write gains and read them back; when one is not taken, those written before it get their old value again.

    Raises:
        CommandRefused: the drive has torque, or its shaft turns. DeviceError: it does not take a value.
    """
    refuse_energised(node)
    _refuse_turning(node, increments_per_turn)
    done: list[GainChange] = []
    for change in changes:
        try:
            _write(node.sdo, change.name, change.gain, change.after)
        except DeviceError:
            for each in (*done, change):
                _write_back(node.sdo, each)
            raise
        done.append(change)


def _refuse_turning(node: RemoteNode, increments_per_turn: int) -> None:
    begun = node.sdo.number(0x6064)
    node.link.pause(_WATCHED_S)
    passed = abs((node.sdo.number(0x6064) - begun + (1 << 31)) % (1 << 32) - (1 << 31))
    if passed > _STANDS_TURN * increments_per_turn:
        raise CommandRefused(
            f"the motor turns: {passed} increments within {1e3 * _WATCHED_S:g} ms; gains wait until it stands"
        )


def _write(sdo: SdoClient, name: str, gain: Gain, value: float) -> None:
    index, sub = gain.key
    size = len(sdo.read(index, sub))
    if gain.real:
        data = struct.pack("<f", value)
    else:
        # A signed object holds half of it; no gain comes near that.
        if not value < 1 << (8 * size - 1):
            raise DeviceError(f"{name}: {value:g} does not fit into {gain.object}, {size} bytes")
        data = int(value).to_bytes(size, "little")
    sdo.write(index, sub, data)
    kept = sdo.read(index, sub)
    if kept != data:
        raise DeviceError(
            f"{name}: {gain.object} was written {value:g} and holds {_shown(gain, kept):g}: the drive does not take it"
        )


def _write_back(sdo: SdoClient, change: GainChange) -> None:
    try:
        _write(sdo, change.name, change.gain, change.before)
    except DeviceError as fault:
        raise DeviceError(
            f"{fault} · {change.gain.object} was {change.before:g}: look at the gains with the maker's tool"
        ) from None


def _shown(gain: Gain, data: bytes) -> float:
    return float(struct.unpack("<f", data)[0]) if gain.real else float(int.from_bytes(data, "little"))
