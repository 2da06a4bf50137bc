"""What a drive has: each object that it knows, whether it takes a value, and which one it holds.

From an EDS and from a drive on the bus alike, so that whoever judges a drive cannot say two things of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gantryctl.drives.od.model import DeviceDescription, Entry
from gantryctl.drives.od.standard import standard_of
from gantryctl.drives.od.types import Value, bit_length


@dataclass(frozen=True, slots=True)
class ObjectFact:
    """What is known of one object.

    Attributes:
        writable: it takes a value by SDO.
        mappable: a telegram of process data can carry it.
        default: value that it holds; None where nobody has said which.
        low, high: limits of its value, None where there are none.
    """

    writable: bool
    mappable: bool
    default: Value | None = None
    low: int | None = None
    high: int | None = None

    def takes(self, value: int) -> bool:
        """The value can be written."""
        above = self.low is None or value >= self.low
        return self.writable and above and (self.high is None or value <= self.high)


@dataclass(frozen=True, slots=True)
class DriveFacts:
    """Identity of a drive and its objects by index and sub-index.

    Attributes:
        vendor, product, revision, serial: object 1018; 0 where it does not say. An EDS knows no serial number.
        software: object 100A, "" where it is missing.
    """

    vendor: int
    product: int
    revision: int
    serial: int
    software: str
    objects: Mapping[tuple[int, int], ObjectFact]

    @property
    def key(self) -> str:
        """Vendor, product and serial number: distinguishes one drive from another."""
        return f"{self.vendor:08X}-{self.product:08X}-{self.serial}"

    def has(self, index: int, sub: int = 0) -> bool:
        """The drive has the object."""
        return (index, sub) in self.objects

    def writable(self, index: int, sub: int = 0) -> bool:
        """The drive has the object and takes a value for it."""
        found = self.objects.get((index, sub))
        return found is not None and found.writable

    def can_hold(self, index: int, sub: int, value: int) -> bool:
        """The drive holds the value, or takes it."""
        found = self.objects.get((index, sub))
        return found is not None and (found.default == value or found.takes(value))

    def value(self, index: int, sub: int = 0) -> int | None:
        """Whole number that the object holds; None without the object, or where nobody has said which."""
        found = self.objects.get((index, sub))
        return found.default if found is not None and isinstance(found.default, int) else None


def facts_of(device: DeviceDescription) -> DriveFacts:
    """Facts by an EDS or a DCF, whose configured values count before defaults; a promise, until the drive is asked."""
    info = device.info
    software = device.entry(0x100A)
    name = None if software is None else _value(software, device.node_id)
    return DriveFacts(
        _plate(device, 1) or info.vendor_number or 0,
        _plate(device, 2) or info.product_number or 0,
        _plate(device, 3) or info.revision_number or 0,
        0,
        name if isinstance(name, str) else "",
        {(entry.index, entry.sub): _fact(entry, device.node_id) for entry in device.entries()},
    )


def _plate(device: DeviceDescription, sub: int) -> int:
    entry = device.entry(0x1018, sub)
    return entry.default if entry is not None and isinstance(entry.default, int) else 0


def _fact(entry: Entry, node: int | None) -> ObjectFact:
    high, known = entry.high, standard_of(entry.index, entry.sub)
    # Telegrams are laid out by the standard: an object of another size fits into none of them.
    fits = known is None or bit_length(known.data_type) == bit_length(entry.data_type)
    mappable = fits and (entry.rpdo or entry.tpdo)
    # 1016 is a node id and a time in one word; a file that limits it to 16 bits means the time (a DCF of Elmo).
    if entry.index == 0x1016 and high is not None and high <= 0xFFFF:
        high = None
    return ObjectFact(entry.access.writable, mappable, _value(entry, node), entry.low, high)


def _value(entry: Entry, node: int | None) -> Value | None:
    return entry.value if entry.value is not None else entry.default_for(node or 0)
