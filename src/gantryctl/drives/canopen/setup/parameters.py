"""All parameters of a drive: read, backed up to a file, restored, stored in the drive (1010)."""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.canopen.cia402 import ENERGISED, decode_statusword
from gantryctl.drives.canopen.setup.opening import write_restart_marker
from gantryctl.drives.od.model import DeviceDescription, Entry
from gantryctl.drives.od.standard import STANDARD
from gantryctl.drives.od.types import decode
from gantryctl.drives.profiles import Saving, key_of
from gantryctl.errors import CommandRefused, DeviceError

# What 1010 says of itself when it is read (CiA 301).
_ON_COMMAND: Final = 1
_BY_ITSELF: Final = 2
_LONGEST: Final = 4096
# Commands, actual values, and what acts when it is written: never kept and never written back.
_LEFT_OUT: Final = frozenset(
    {0x1003, 0x1010, 0x1011, 0x1016, 0x1017, 0x6040, 0x6060, 0x60B1, 0x60B2, 0x60FE, 0x60FF, 0x607A, 0x6071}
)


class ObjectValue(NamedTuple):
    """Entry and its value.

    Attributes:
        raw: bytes in hexadecimal; "" for a refused read.
        shown: the value for people.
    """

    obj: int
    sub: int
    name: str
    raw: str
    shown: str


def _entries(device: DeviceDescription | None) -> list[Entry]:
    """Entries of an EDS, or of a speed axis by CiA 301 and CiA 402."""
    if device is not None:
        return list(device.entries())
    return [Entry(i, s, e.name, e.data_type, e.access) for (i, s), e in STANDARD.items()]


def read_objects(sdo: SdoClient, device: DeviceDescription | None) -> tuple[ObjectValue, ...]:
    """Read every entry; a refusal stands in place of its value.

    Raises:
        DeviceError: the drive does not answer any more.
    """
    return tuple(_read(sdo, entry) for entry in _entries(device))


def _read(sdo: SdoClient, entry: Entry) -> ObjectValue:
    try:
        data = sdo.read(entry.index, entry.sub)
    except SdoError as refused:
        if refused.silent:
            raise
        return ObjectValue(entry.index, entry.sub, entry.name, "", f"- ({str(refused).partition(': ')[2]})")
    try:
        value = decode(entry.data_type, data)
    except ValueError:
        value = data
    shown = f"{value} ({value:X}h)" if isinstance(value, int) and value > 9 else str(value)
    return ObjectValue(entry.index, entry.sub, entry.name, data.hex(), shown)


def backup(node: RemoteNode, device: DeviceDescription | None) -> dict[str, Any]:
    """Read all writable entries as plain values for a JSON file."""
    who = node.identity()
    entries = [e for e in _entries(device) if e.access.writable and e.index not in _LEFT_OUT]
    found = [_read(node.sdo, entry) for entry in entries]
    values = {f"{v.obj:04X}:{v.sub:02X}": v.raw for v in found if v.raw}
    return {"drive": who.key, "name": who.name, "software": who.software, "values": values}


def check_backup(data: object) -> dict[str, Any]:
    """Check that data are a backup and return them.

    Raises:
        ValueError: they are not.
    """
    if not isinstance(data, dict) or not isinstance(data.get("values"), dict) or "drive" not in data:
        raise ValueError("drive and values are missing")
    for place, raw in data["values"].items():
        _place_of(place)
        if not isinstance(raw, str) or not 0 < len(bytes.fromhex(raw)) <= _LONGEST:
            raise ValueError(f"{place}: the value is hexadecimal bytes")
    return data


def _place_of(text: str) -> tuple[int, int]:
    index, _, sub = text.partition(":")
    found = int(index, 16), int(sub, 16)
    if not (0x1000 <= found[0] <= 0xFFFF and 0 <= found[1] <= 0xFF):
        raise ValueError(f"{text}: an object is written 6085:00")
    return found


def refuse_energised(node: RemoteNode) -> None:
    """Refuse a drive that has torque.

    Raises:
        CommandRefused: it has.
    """
    state = decode_statusword(node.sdo.number(0x6041))
    if state in ENERGISED:
        raise CommandRefused(
            f"the drive is in {state.name.lower().replace('_', ' ')}: parameters wait until it is off"
        )


def restore(node: RemoteNode, kept: dict[str, Any]) -> tuple[str, ...]:
    """Write a backup and read it back; return a line for each value that the drive did not take.

    Raises:
        CommandRefused: the drive has torque, or it is another kind of drive.
    """
    refuse_energised(node)
    key = node.identity().key
    if key.rpartition("-")[0] != str(kept["drive"]).rpartition("-")[0]:
        raise CommandRefused(f"the backup is of {kept['drive']}, the drive is {key}: another kind of drive")
    node.enter_pre_operational()
    wrong = []
    for place, raw in kept["values"].items():
        index, sub = _place_of(place)
        # The controller writes mapping and communication objects of the process data at every start.
        if 0x1400 <= index < 0x1C00 or index in _LEFT_OUT:
            continue
        try:
            if node.sdo.read(index, sub).hex() == raw:
                continue
            node.sdo.write(index, sub, bytes.fromhex(raw))
            if node.sdo.read(index, sub).hex() != raw:
                wrong.append(f"{place}: written {raw}, reads otherwise")
        except SdoError as refused:
            if refused.silent:
                raise
            wrong.append(str(refused))
    return tuple(wrong)


class Saved(NamedTuple):
    """Parameters stored in a drive.

    Attributes:
        remark: why that may not be believed; "" for nothing.
    """

    seconds: float
    remark: str


def save(node: RemoteNode, saving: Saving) -> Saved:
    """Store all parameters in the drive, as its profile says.

    Raises:
        CommandRefused: the drive has torque, stores by itself, or does not store what the bus writes. DeviceError: it
            does not store.
    """
    if not saving.object:
        raise CommandRefused(f"this drive stores nothing on a command of the bus: {saving.remark}")
    refuse_energised(node)
    index, sub = key_of(saving.object)
    told = node.sdo.optional(index, sub)
    if told is None:
        raise DeviceError(
            f"the drive has no {saving.object}: it forgets at power off what the bus has written; the controller "
            "writes its own parameters at every start, what else must last is stored with the maker's tool"
        )
    if told & _BY_ITSELF and not told & _ON_COMMAND:
        raise CommandRefused(
            f"{saving.object} = {told:X}h: the drive stores by itself and takes no command for it"
        )
    # A stored marker would outlive the boot-ups that it is to reveal.
    write_restart_marker(node.sdo, node.node, None)
    # Some drives leave the bus for 0.4 s while they store.
    before, timeout = node.link.now_s(), node.sdo.timeout_s
    node.sdo.timeout_s = saving.longest_s
    try:
        node.sdo.write(index, sub, saving.signature.to_bytes(4, "little"))
    except SdoError as refused:
        raise DeviceError(f"the drive does not store its parameters: {refused}") from None
    finally:
        node.sdo.timeout_s = timeout
    doubt = f"{saving.object} = 0 says that it does not store on command: switch it off and on, and compare"
    return Saved(node.link.now_s() - before, "" if told & _ON_COMMAND else doubt)
