"""Model of an object dictionary: objects, entries, and the device they belong to; data only."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum
from typing import NamedTuple

from gantryctl.drives.od.types import DataType, Value
from gantryctl.errors import UsageError


class EdsError(UsageError):
    """File that is not an EDS or DCF, or cannot be used.

    Attributes:
        source: the file.
        line: counted from 1; 0 for the whole file.
    """

    def __init__(self, source: str, line: int, problem: str) -> None:
        self.source, self.line = source, line
        super().__init__(f"{source}:{line}: {problem}" if line else f"{source}: {problem}")


class Access(StrEnum):
    """Access types in the spelling of CiA 306."""

    RO = "ro"
    WO = "wo"
    RW = "rw"
    RWR = "rwr"
    """Read and write; as process data readable (TPDO) only."""
    RWW = "rww"
    """Read and write; as process data writable (RPDO) only."""
    CONST = "const"

    @property
    def readable(self) -> bool:
        """SDO upload is allowed."""
        return self is not Access.WO

    @property
    def writable(self) -> bool:
        """SDO download is allowed."""
        return self in (Access.WO, Access.RW, Access.RWR, Access.RWW)


class ObjectKind(IntEnum):
    """Object codes (CiA 301)."""

    DOMAIN = 0x2
    VAR = 0x7
    ARRAY = 0x8
    RECORD = 0x9


@dataclass(frozen=True, slots=True)
class Entry:
    """Entry of an object, at index and sub-index."""

    index: int
    sub: int
    name: str
    data_type: DataType
    access: Access
    default: Value | None = None
    node_relative: bool = False
    """The default is an offset to the node id ($NODEID+...)."""
    mappable: bool = False
    low: int | None = None
    high: int | None = None
    value: Value | None = None
    """ParameterValue of a DCF, the configured value."""
    volatile: bool = False
    """Not stored by 1010: commands and process data. Not part of an EDS."""
    line: int = 0
    """Line of the file; 0 without a file."""

    @property
    def rpdo(self) -> bool:
        """An RPDO may write it."""
        return self.mappable and self.access in (Access.RW, Access.WO, Access.RWW)

    @property
    def tpdo(self) -> bool:
        """A TPDO may send it."""
        return self.mappable and self.access in (Access.RW, Access.RO, Access.RWR, Access.CONST)

    @property
    def place(self) -> str:
        """Index and sub-index in the usual notation."""
        return f"{self.index:04X}:{self.sub:02X}"

    def default_for(self, node_id: int) -> Value | None:
        """Default value for a node."""
        if self.node_relative and isinstance(self.default, int):
            return self.default + node_id
        return self.default


@dataclass(frozen=True, slots=True)
class ObjectSpec:
    """Object with its entries by sub-index."""

    index: int
    name: str
    kind: ObjectKind
    entries: Mapping[int, Entry]
    line: int = 0


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """Used part of [DeviceInfo] and [FileInfo]."""

    vendor_name: str = ""
    vendor_number: int | None = None
    product_name: str = ""
    product_number: int | None = None
    revision_number: int | None = None
    order_code: str = ""
    bit_rates: tuple[int, ...] = ()
    """Permitted bit rates in bit/s."""
    rpdos: int | None = None
    tpdos: int | None = None
    file_name: str = ""
    file_version: str = ""
    description: str = ""
    created_by: str = ""


class Note(NamedTuple):
    """Oddity of a file that could be read all the same."""

    line: int
    text: str

    def __str__(self) -> str:
        return f"line {self.line}: {self.text}" if self.line else self.text


@dataclass(frozen=True, slots=True)
class DeviceDescription:
    """Object dictionary of a device; `objects` is ordered by index."""

    objects: Mapping[int, ObjectSpec]
    info: DeviceInfo = DeviceInfo()
    node_id: int | None = None
    """Node of the values: the requested one, else that of the DCF."""
    is_dcf: bool = False
    notes: tuple[Note, ...] = field(default=())

    def entry(self, index: int, sub: int = 0) -> Entry | None:
        """Entry at index and sub-index, or None."""
        found = self.objects.get(index)
        return None if found is None else found.entries.get(sub)

    def entries(self) -> Iterator[Entry]:
        """Every entry by index and sub-index."""
        for spec in self.objects.values():
            yield from spec.entries.values()


def described(objects: tuple[ObjectSpec, ...], info: DeviceInfo) -> DeviceDescription:
    """Device description of objects in any order.

    Raises:
        ValueError: two objects have the same index.
    """
    by_index = {spec.index: spec for spec in sorted(objects, key=lambda spec: spec.index)}
    if len(by_index) != len(objects):
        raise ValueError("an index is there twice")
    return DeviceDescription(by_index, info)
