"""Object tables: what the dictionaries of drives have, by rows of a CSV or by an EDS; for drives in software.

| column        | content                                                                                  |
|---------------|------------------------------------------------------------------------------------------|
| `drive`       | name of the drive; one file may hold several                                             |
| `object`, `sub` | index in hexadecimal, sub-index in decimal                                             |
| `state`       | `present` or `absent`                                                                    |
| `data_type`   | code of CiA 301                                                                          |
| `access`      | in the spelling of CiA 306                                                               |
| `default`, `low_limit`, `high_limit` | in the notation of CiA 306, or empty                              |
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, NoReturn

from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.od.model import Access, DeviceDescription, EdsError, Entry
from gantryctl.drives.od.reading import read_eds
from gantryctl.drives.od.standard import standard_of
from gantryctl.drives.od.types import DataType
from gantryctl.drives.od.values import parse_number, parse_value

Key = tuple[int, int]

_COLUMNS: Final = (
    "drive", "object", "sub", "state", "data_type", "access", "default", "low_limit", "high_limit",
)  # fmt: skip
_MAX_ROWS: Final = 100_000


@dataclass(frozen=True, slots=True)
class ObjectTable:
    """Dictionary of one drive.

    Attributes:
        entries: what the drive has.
        absent: entries that it is known not to have.
        complete: it has nothing but `entries`; False where the rest has not been looked at.
        maps_known: whether an entry can be mapped is told; False where only its type is.
    """

    drive: str
    entries: Mapping[Key, Entry]
    absent: frozenset[Key]
    complete: bool
    maps_known: bool

    def lacks(self, index: int, sub: int) -> bool:
        """The drive does not have the entry."""
        return (index, sub) not in self.entries if self.complete else (index, sub) in self.absent


def table_of(device: DeviceDescription, name: str) -> ObjectTable:
    """Object table of an EDS, which names all that a drive has."""
    entries = {(entry.index, entry.sub): entry for entry in device.entries()}
    info = device.info
    # Many files name maker and product in [DeviceInfo] only.
    for sub, code in enumerate((info.vendor_number, info.product_number, info.revision_number), start=1):
        plate = entries.get((0x1018, sub))
        if plate is not None and plate.default is None and code is not None:
            entries[0x1018, sub] = replace(plate, default=code)
    return ObjectTable(name, entries, frozenset(), complete=True, maps_known=True)


def facts_of_table(table: ObjectTable) -> DriveFacts:
    """What a drive with this dictionary has."""
    objects = {
        key: ObjectFact(e.access.writable, e.rpdo or e.tpdo, e.default, e.low, e.high)
        for key, e in table.entries.items()
    }
    found = DriveFacts(0, 0, 0, 0, "", objects)
    vendor, product, revision = (found.value(0x1018, sub) or 0 for sub in (1, 2, 3))
    return replace(found, vendor=vendor, product=product, revision=revision)


def read_objects_of(path: Path, drive: str = "") -> ObjectTable:
    """Object table of an EDS, a DCF, or of a drive in a CSV.

    Args:
        drive: of a CSV with several drives: the beginning of a name, of any case.

    Raises:
        EdsError: no such file, not a table, or no such drive in it.
    """
    if path.suffix.lower() != ".csv":
        device = read_eds(path)
        info = device.info
        return table_of(device, info.product_name or info.vendor_name or path.stem)
    return chosen(read_object_tables(path), drive, path)


def chosen(tables: Mapping[str, ObjectTable], drive: str, path: Path) -> ObjectTable:
    """The one table whose name begins with `drive`.

    Raises:
        EdsError: none, or several.
    """
    found = [table for name, table in tables.items() if name.casefold().startswith(drive.casefold())]
    exact = [table for table in found if table.drive.casefold() == drive.casefold()]
    if len(exact or found) != 1:
        said = f"several drives begin with '{drive}'" if found else f"there is no drive '{drive}'"
        raise EdsError(str(path), 0, f"{said}; there are: {', '.join(tables)}")
    return (exact or found)[0]


def read_object_tables(path: Path) -> dict[str, ObjectTable]:
    """Object tables of a CSV by the names of their drives, in the order of the file.

    Raises:
        EdsError: no such file, or a row that cannot be used, with its line.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file)
            missing = [name for name in _COLUMNS if name not in (reader.fieldnames or ())]
            if missing:
                raise EdsError(str(path), 1, f"no object table: it has no column {', '.join(missing)}")
            rows = _Rows(path)
            for row in reader:
                rows.take(row, reader.line_num)
    except OSError as fault:
        raise EdsError(str(path), 0, f"cannot be read: {fault.strerror or fault}") from None
    except (UnicodeDecodeError, csv.Error) as fault:
        raise EdsError(str(path), 0, f"no object table: {fault}") from None
    return rows.tables()


class _Rows:
    """Rows of one file, gathered by drive."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._line = 0
        self._entries: dict[str, dict[Key, Entry]] = {}
        self._absent: dict[str, set[Key]] = {}

    def take(self, row: Mapping[str, str | None], line: int) -> None:
        self._line = line
        if line > _MAX_ROWS:
            self._refuse(f"more than {_MAX_ROWS} lines are not read")
        text = {name: (row.get(name) or "").strip() for name in _COLUMNS}
        key = self._key(text)
        entries = self._entries.setdefault(text["drive"], {})
        absent = self._absent.setdefault(text["drive"], set())
        if key in entries or key in absent:
            self._refuse(f"{text['drive']} has {key[0]:04X}:{key[1]:02X} twice")
        if text["state"] == "present":
            entries[key] = self._entry(key, text)
        elif text["state"] == "absent":
            absent.add(key)
        else:
            self._refuse(f"state '{text['state']}' is neither present nor absent")

    def _key(self, text: Mapping[str, str]) -> Key:
        try:
            index, sub = int(text["object"], 16), int(text["sub"])
        except ValueError:
            self._refuse(
                f"'{text['object']}:{text['sub']}' is no object: hexadecimal index, decimal sub-index"
            )
        if not (0x1000 <= index <= 0xFFFF and 0 <= sub <= 0xFE):
            self._refuse(f"object {index:X}:{sub:02X}: index 1000 to FFFF, sub-index 0 to 254")
        return index, sub

    def _entry(self, key: Key, text: Mapping[str, str]) -> Entry:
        index, sub = key
        number = parse_number(text["data_type"])
        try:
            data_type = DataType(number.value if number is not None else -1)
        except ValueError:
            self._refuse(f"{index:04X}:{sub:02X}: '{text['data_type']}' is no data type of CiA 301")
        try:
            access = Access(text["access"].lower())
        except ValueError:
            self._refuse(f"{index:04X}:{sub:02X}: '{text['access']}' is no access")
        values = {name: self._value(text[name], data_type) for name in ("default", "low_limit", "high_limit")}
        known = standard_of(index, sub)
        return Entry(
            index=index,
            sub=sub,
            name=known.name if known is not None else "",
            data_type=data_type,
            access=access,
            default=None if (default := values["default"]) is None else default[0],
            node_relative=default is not None and default[1],
            low=_number(values["low_limit"]),
            high=_number(values["high_limit"]),
            line=self._line,
        )

    def _value(self, text: str, data_type: DataType) -> tuple[int | float | str | bytes, bool] | None:
        if not text:
            return None
        found = parse_value(text, data_type)
        if found is None:
            self._refuse(f"'{text}' is no {data_type.label}")
        return found

    def _refuse(self, problem: str) -> NoReturn:
        raise EdsError(str(self._path), self._line, problem)

    def tables(self) -> dict[str, ObjectTable]:
        if not self._entries:
            raise EdsError(str(self._path), 0, "it has no rows")
        return {
            name: ObjectTable(name, entries, frozenset(self._absent[name]), complete=False, maps_known=False)
            for name, entries in self._entries.items()
        }


def _number(found: tuple[int | float | str | bytes, bool] | None) -> int | None:
    return found[0] if found is not None and isinstance(found[0], int) else None
