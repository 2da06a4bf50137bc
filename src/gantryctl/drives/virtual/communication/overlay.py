"""Dictionary of a real drive model over the behaviour of the virtual one: what the bus sees is as in its table.

The behaviour reads every object that it needs; an object that the model lacks keeps the value that the maker's tool
has set, and the bus does not see it. An object that the behaviour does not know is a value and nothing more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from gantryctl.drives.od.model import Entry, ObjectKind, ObjectSpec
from gantryctl.drives.od.object_table import Key, ObjectTable
from gantryctl.drives.od.types import DataType
from gantryctl.drives.virtual.personality import Personality

_PDOS: Final = 4
# The first index of each group of PDO parameters (CiA 301); communication parameters, then mappings.
_COMMUNICATION: Final = (0x1400, 0x1800)
_MAPPING: Final = (0x1600, 0x1A00)
_COB_ID: Final = 1
_COMMUNICATION_AREA: Final = range(0x1000, 0x2000)
_MANUFACTURER: Final = range(0x2000, 0x6000)
# Motor and encoder: the maker's tool enters them before anything turns, whatever the file gives as default.
_ENTERED_BY_TOOL: Final = (0x6075, 0x6076, 0x608F)
_MODES: Final = 0x6502
# Every useful value has a node id in bits 16 to 22 (CiA 301); a smaller limit is that of the time alone.
_CONSUMER_HEARTBEAT: Final = 0x1016
_LEAST_CONSUMER: Final = 1 << 16

Specs = tuple[ObjectSpec, ...]


def lay_over(plain: Specs, kind: Personality) -> tuple[Specs, Specs]:
    """Objects of the behaviour with the values of the table, and those that the bus sees.

    Args:
        plain: objects of the plain drive.
        kind: with a table; the objects as they are without one.
    """
    if kind.table is None:
        return plain, plain
    table = _for_all_pdos(kind.table)
    behaviour = {(e.index, e.sub): e for spec in plain for e in spec.entries.values()}
    seen: dict[Key, Entry] = {}
    for key, entry in table.entries.items():
        # The brake and the load of the virtual drive live in the maker's range: no other object can stand there.
        if key[0] in _MANUFACTURER and key in behaviour:
            continue
        seen[key] = behaviour[key] = _entry(entry, behaviour.get(key), table, kind)
    if not table.complete:
        # Nobody has looked at the rest: communication objects, and further sub-indices, are as in the plain drive.
        named = {index for index, _ in table.entries}
        seen |= {
            key: entry
            for key, entry in behaviour.items()
            if key not in seen
            and key not in table.absent
            and (key[0] in _COMMUNICATION_AREA or key[0] in named)
        }
    kinds = {spec.index: spec for spec in plain}
    return _specs(behaviour, kinds), _specs(_without_empty(seen), kinds)


def _entry(entry: Entry, plain: Entry | None, table: ObjectTable, kind: Personality) -> Entry:
    """Entry of the table, completed by that of the behaviour."""
    low, high = entry.low, entry.high
    if entry.index == _CONSUMER_HEARTBEAT and high is not None and high < _LEAST_CONSUMER:
        high = None
    default, relative = _default(entry, plain, kind)
    return replace(
        entry,
        name=entry.name or (plain.name if plain is not None else f"Object {entry.place}"),
        default=default,
        node_relative=relative,
        mappable=entry.mappable if table.maps_known else plain is not None and plain.mappable,
        low=low,
        high=high,
        volatile=plain is not None and plain.volatile,
    )


def _default(
    entry: Entry, plain: Entry | None, kind: Personality
) -> tuple[int | float | str | bytes | None, bool]:
    given = entry.value if entry.value is not None else entry.default
    if entry.index == _MODES and given is None:
        return sum(1 << (mode - 1) for mode in kind.modes if mode > 0), False
    if plain is None:
        empty: bytes | None = b"" if entry.data_type in (DataType.DOMAIN, DataType.OCTET_STRING) else None
        return (given, entry.node_relative) if given is not None else (empty, False)
    # The count of a mapping belongs to its entries, which no table names.
    counts = entry.sub == 0 and _group(entry.index, _MAPPING) is not None
    entered = entry.index in _ENTERED_BY_TOOL and entry.access.writable
    if given is None or counts or entered:
        return plain.default, plain.node_relative
    return given, entry.node_relative


def _for_all_pdos(table: ObjectTable) -> ObjectTable:
    """The table with what it says of the first PDO of each direction said of all, unless it names all itself."""
    if table.complete:
        return table
    entries, absent = dict(table.entries), set(table.absent)
    for number in range(1, _PDOS):
        for first in (*_COMMUNICATION, *_MAPPING):
            for (index, sub), entry in table.entries.items():
                if index == first and (index + number, sub) not in entries:
                    entries[index + number, sub] = _of_other_pdo(entry, number)
            absent |= {(index + number, sub) for index, sub in table.absent if index == first}
    return replace(table, entries=entries, absent=frozenset(absent))


def _of_other_pdo(entry: Entry, number: int) -> Entry:
    # Each PDO has an identifier of its own: that of the plain drive.
    own_id = entry.sub == _COB_ID and _group(entry.index, _COMMUNICATION) is not None
    default = None if own_id else entry.default
    return replace(entry, index=entry.index + number, default=default, node_relative=False)


def _group(index: int, firsts: tuple[int, int]) -> int | None:
    return next((first for first in firsts if first <= index < first + _PDOS), None)


def _without_empty(entries: Mapping[Key, Entry]) -> dict[Key, Entry]:
    """Entries without those of records and arrays of which nothing but the count of sub-indices is left."""
    used = {index for index, sub in entries if sub > 0}
    records = {0x1010, 0x1011, 0x1016, 0x1018, 0x1029, 0x60C2, 0x60FE, 0x608F, 0x6091, 0x6092, 0x6096}
    return {key: e for key, e in entries.items() if key[0] in used or key[0] not in records}


def _specs(entries: Mapping[Key, Entry], kinds: Mapping[int, ObjectSpec]) -> Specs:
    by_index: dict[int, dict[int, Entry]] = {}
    for index, sub in sorted(entries):
        by_index.setdefault(index, {})[sub] = entries[index, sub]
    found = []
    for index, subs in by_index.items():
        plain = kinds.get(index)
        if plain is None:
            form = ObjectKind.VAR if set(subs) == {0} else ObjectKind.RECORD
            found.append(ObjectSpec(index, subs[min(subs)].name, form, subs))
        else:
            found.append(replace(plain, entries=subs))
    return tuple(found)
