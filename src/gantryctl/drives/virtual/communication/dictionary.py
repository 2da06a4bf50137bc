"""The living object dictionary: values of the table, access rules, and hooks of whoever acts on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from gantryctl.drives.od.model import DeviceDescription, Entry
from gantryctl.drives.od.types import DataType, Value, decode, encode, limits
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort

Key = tuple[int, int]

_COMMUNICATION: Final = range(0x1000, 0x2000)
_NEVER_STORED: Final = frozenset({0x1003, 0x1010, 0x1011})


class Dictionary:
    """Values by index and sub-index.

    The drive behaves by the full table; what a personality hides is there for the behaviour, but neither SDO nor
    PDO reaches it.

    Args:
        full: every object the behaviour knows.
        visible: what the bus sees.
        node_id: for defaults relative to it.
    """

    def __init__(self, full: DeviceDescription, visible: DeviceDescription, node_id: int) -> None:
        self.visible = visible
        self.readers: dict[Key, Callable[[], Value]] = {}
        """Values that are made when they are read."""
        self.checks: dict[Key, Callable[[int], None]] = {}
        """Called before a value is stored; they refuse by SdoAbort."""
        self.actions: dict[Key, Callable[[int], None]] = {}
        """Called after a value was stored."""
        self._entries: dict[Key, Entry] = {(e.index, e.sub): e for e in full.entries()}
        self._defaults: dict[Key, Value] = {
            key: _default(entry, node_id) for key, entry in self._entries.items()
        }
        self._values = dict(self._defaults)

    def number(self, index: int, sub: int = 0) -> int:
        """A value for the drive itself."""
        value = self._values[index, sub]
        return value if isinstance(value, int) else 0

    def known(self, index: int, sub: int) -> bool:
        """The behaviour has such an entry, seen from the bus or not."""
        return (index, sub) in self._entries

    def value(self, index: int, sub: int) -> Value:
        """The present value, whatever the bus may see."""
        reader = self.readers.get((index, sub))
        return reader() if reader is not None else self._values[index, sub]

    def set(self, index: int, sub: int, value: int) -> None:
        """Set a value from inside: no rules, no hooks."""
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
        """An entry that the bus sees.

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
        """SDO upload.

        Raises:
            SdoAbort: not there, or write-only.
        """
        entry = self.entry(index, sub)
        if not entry.access.readable:
            raise SdoAbort(Abort.WRITE_ONLY)
        return self.packed(entry)

    def packed(self, entry: Entry) -> bytes:
        """The present value as bytes."""
        reader = self.readers.get((entry.index, entry.sub))
        value = reader() if reader is not None else self._values[entry.index, entry.sub]
        return encode(entry.data_type, value)

    def download(self, index: int, sub: int, data: bytes) -> None:
        """SDO download.

        Raises:
            SdoAbort: not there, read-only, wrong size, out of range, or refused by whoever acts on it.
        """
        entry = self.entry(index, sub)
        self.may_write(entry)
        value = _decoded(entry, data)
        if isinstance(value, int):
            self._write(entry, value)
        else:
            self._values[index, sub] = value

    def may_write(self, entry: Entry) -> None:
        """Refuse a write access early, before its data arrive."""
        if not entry.access.writable:
            raise SdoAbort(Abort.READ_ONLY)

    def receive(self, entry: Entry, data: bytes) -> None:
        """A mapped value from an RPDO; out of range is refused like an SDO (and the PDO goes on)."""
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
        """Power-on values: defaults, and over them what was stored. No hooks: everybody reads afresh."""
        for key, default in self._defaults.items():
            if not communication_only or key[0] in _COMMUNICATION:
                value = stored.get(key)
                usable = value is not None and fits(self._entries[key], value)
                self._values[key] = value if value is not None and usable else default

    def storable(self, first: int, last: int) -> dict[Key, int]:
        """What 1010 stores of a range of indices: writable numbers that are neither commands nor process data."""
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
    """A number that the entry's type and limits take."""
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
