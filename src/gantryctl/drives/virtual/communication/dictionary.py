"""Object dictionary at run time: values, access rules, hooks for what acts on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from gantryctl.drives.od.model import DeviceDescription, Entry
from gantryctl.drives.od.types import INTEGERS, DataType, Value, decode, encode, limits
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort

Key = tuple[int, int]

_COMMUNICATION: Final = range(0x1000, 0x2000)
_NEVER_STORED: Final = frozenset({0x1003, 0x1010, 0x1011})


class Dictionary:
    """Values by index and sub-index.

    Args:
        full: every object of the behaviour. Those that a personality hides act by their defaults.
        visible: objects that SDO and PDO reach.
        node_id: for defaults relative to it.
    """

    def __init__(self, full: DeviceDescription, visible: DeviceDescription, node_id: int) -> None:
        self.visible = visible
        self.readers: dict[Key, Callable[[], Value]] = {}
        """Values computed when they are read."""
        self.checks: dict[Key, Callable[[int], None]] = {}
        """Called before a value is stored; they refuse it by SdoAbort."""
        self.actions: dict[Key, Callable[[int], None]] = {}
        """Called after a value was stored."""
        self._entries: dict[Key, Entry] = {(e.index, e.sub): e for e in full.entries()}
        self._defaults = {key: _default(entry, node_id) for key, entry in self._entries.items()}
        self._values = dict(self._defaults)

    def number(self, index: int, sub: int = 0) -> int:
        """Stored number for the behaviour of the drive."""
        value = self._values[index, sub]
        return value if isinstance(value, int) else 0

    def known(self, index: int, sub: int) -> bool:
        """Whether the entry exists, visible to the bus or not."""
        return (index, sub) in self._entries

    def value(self, index: int, sub: int) -> Value:
        """Present value, whatever the bus may see."""
        reader = self.readers.get((index, sub))
        return reader() if reader is not None else self._values[index, sub]

    def set(self, index: int, sub: int, value: int) -> None:
        """Set a value from inside, without rules and hooks."""
        self._values[index, sub] = value

    def force(self, index: int, sub: int, value: int) -> None:
        """Set a value past the access rules (side channel); ranges hold, and the action follows.

        Raises:
            SdoAbort: out of range.
        """
        entry = self._entries[index, sub]
        if not fits(entry, value):
            raise SdoAbort(Abort.VALUE)
        self._write(entry, value)

    def entry(self, index: int, sub: int) -> Entry:
        """Entry that the bus sees.

        Raises:
            SdoAbort: no such object or sub-index.
        """
        spec = self.visible.objects.get(index)
        if spec is None:
            raise SdoAbort(Abort.NO_OBJECT)
        entry = spec.entries.get(sub)
        if entry is None:
            raise SdoAbort(Abort.NO_SUB)
        return entry

    def upload(self, index: int, sub: int) -> bytes:
        """Bytes of an SDO upload.

        Raises:
            SdoAbort: missing, or write-only.
        """
        entry = self.entry(index, sub)
        if not entry.access.readable:
            raise SdoAbort(Abort.WRITE_ONLY)
        return self.packed(entry)

    def packed(self, entry: Entry) -> bytes:
        """Present value as bytes."""
        value = self.value(entry.index, entry.sub)
        try:
            return encode(entry.data_type, value)
        except ValueError:
            # The dictionary of a real model may give an object less room than the behaviour fills: the low bits go out.
            number = INTEGERS.get(entry.data_type)
            if number is None or not isinstance(value, int):
                raise
            low = value & (1 << number.bits) - 1
            return low.to_bytes(number.bits // 8, "little")

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write the bytes of an SDO download.

        Raises:
            SdoAbort: missing, read-only, wrong size, out of range, or refused by a check.
        """
        entry = self.entry(index, sub)
        self.may_write(entry)
        value = _decoded(entry, data)
        if isinstance(value, int):
            self._write(entry, value)
        else:
            self._values[index, sub] = value

    def may_write(self, entry: Entry) -> None:
        """Refuse a write access before its data arrive.

        Raises:
            SdoAbort: read-only.
        """
        if not entry.access.writable:
            raise SdoAbort(Abort.READ_ONLY)

    def receive(self, entry: Entry, data: bytes) -> None:
        """Write a mapped value from an RPDO; refused out of range, as by SDO."""
        value = decode(entry.data_type, data)
        if isinstance(value, int):
            self._write(entry, value)

    def _write(self, entry: Entry, value: int) -> None:
        if entry.high is not None and value > entry.high:
            raise SdoAbort(Abort.VALUE_HIGH)
        if entry.low is not None and value < entry.low:
            raise SdoAbort(Abort.VALUE_LOW)
        key = (entry.index, entry.sub)
        check = self.checks.get(key)
        if check is not None:
            check(value)
        self._values[key] = value
        action = self.actions.get(key)
        if action is not None:
            action(value)

    def reset(self, stored: Mapping[Key, int], communication_only: bool) -> None:
        """Set power-on values without hooks: the stored ones where they fit, else the defaults."""
        for key, default in self._defaults.items():
            if not communication_only or key[0] in _COMMUNICATION:
                value = stored.get(key)
                usable = value is not None and fits(self._entries[key], value)
                self._values[key] = value if value is not None and usable else default

    def storable(self, first: int, last: int) -> dict[Key, int]:
        """Values that 1010 stores of a range of indices."""
        # Writable numbers; commands and process data are volatile, and history and storage objects hold no parameter.
        return {
            key: value
            for key, entry in self._entries.items()
            if first <= key[0] <= last
            and entry.access.writable
            and not entry.volatile
            and key[0] not in _NEVER_STORED
            and isinstance(value := self._values[key], int)
        }


def fits(entry: Entry, value: int) -> bool:
    """Whether a number is within type and limits of an entry."""
    span = limits(entry.data_type)
    if span is None or not span[0] <= value <= span[1]:
        return False
    return (entry.low is None or value >= entry.low) and (entry.high is None or value <= entry.high)


def _default(entry: Entry, node_id: int) -> Value:
    default = entry.default_for(node_id)
    if default is not None:
        return default
    return "" if entry.data_type is DataType.VISIBLE_STRING else 0


def _decoded(entry: Entry, data: bytes) -> Value:
    try:
        return decode(entry.data_type, data)
    except ValueError:
        size = len(encode(entry.data_type, 0))
        raise SdoAbort(Abort.SIZE_HIGH if len(data) > size else Abort.SIZE_LOW) from None
