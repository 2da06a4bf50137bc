"""EDS and DCF import: sections to objects, by CiA 306 where the file keeps to it, else with a note."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Final

from gantryctl.drives.od.lines import MAX_BYTES, Notes, Section, read_sections, shown
from gantryctl.drives.od.model import (
    Access,
    DeviceDescription,
    DeviceInfo,
    EdsError,
    Entry,
    ObjectKind,
    ObjectSpec,
)
from gantryctl.drives.od.standard import standard_of
from gantryctl.drives.od.types import DataType, Value
from gantryctl.drives.od.values import parse_number, parse_value

_SUB: Final = re.compile(r"([0-9a-f]{4})sub([0-9a-f]{1,2})")
# The last static data type of CiA 301; sub-index 255 describes the structure and is no entry.
_MAX_TYPE: Final = 0x1B
_MAX_SUBS: Final = 254
MAX_ENTRIES: Final = 20_000
# Twenty bytes of CompactSubObj stand for up to 254 entries; the maps and lists that it is for have some hundred in all.
MAX_COMPACT: Final = 4_000


class Reader:
    """Reader of sections.

    Args:
        source: name of the file, for errors.
        sections: the whole file.
        notes: takes oddities.
        own_node: node id for which the values of a DCF were written.
        node_id: node id of the requested values.
    """

    def __init__(
        self,
        source: str,
        sections: dict[str, Section],
        notes: Notes,
        own_node: int | None,
        node_id: int | None,
    ) -> None:
        self.node_id = node_id
        self.saw_values = False
        self._source = source
        self._count = self._compacted = 0
        self._sections, self._notes, self._own_node = sections, notes, own_node
        self._subs: dict[int, dict[int, Section]] = {}
        for name, section in sections.items():
            found = _SUB.fullmatch(name)
            if found:
                self._subs.setdefault(int(found[1], 16), {})[int(found[2], 16)] = section

    def object_of(self, index: int, section: Section) -> ObjectSpec:
        """Object of a section such as [6040]."""
        subs = self._subs.pop(index, {})
        kind = self._kind(section, bool(subs))
        compact = self._number(section, "compactsubobj")
        if kind in (ObjectKind.VAR, ObjectKind.DOMAIN):
            entries = {0: self._entry(index, 0, section, section, kind)}
            if subs:
                self._note(section, "", f"object {index:04X} is a variable, yet it has sub-objects; ignored")
        elif compact:
            self._compacted += min(compact, _MAX_SUBS)
            if self._compacted > MAX_COMPACT:
                raise EdsError(
                    self._source, section.line,
                    f"more than {MAX_COMPACT} entries by CompactSubObj are not read",
                )  # fmt: skip
            entries = self._compact(index, section, min(compact, _MAX_SUBS))
        else:
            entries = {
                sub: self._entry(index, sub, part, section, kind) for sub, part in sorted(subs.items())
            }
            self._check_count(index, section, len(entries))
        name = section.text("parametername") or self._standard_name(index, 0)
        return ObjectSpec(index, name, kind, entries, section.line)

    def orphans(self, objects: dict[int, ObjectSpec]) -> None:
        """Make objects of sub-objects without an object, so that nothing is lost."""
        for index, subs in sorted(self._subs.items()):
            first = next(iter(subs.values()))
            self._notes.add(first.line, f"[{first.name}] has no section [{index:04X}]; taken for a record")
            entries = {
                sub: self._entry(index, sub, part, part, ObjectKind.RECORD)
                for sub, part in sorted(subs.items())
            }
            objects[index] = ObjectSpec(
                index, self._standard_name(index, 0), ObjectKind.RECORD, entries, first.line
            )
        self._subs.clear()

    def _kind(self, section: Section, has_subs: bool) -> ObjectKind:
        number = self._number(section, "objecttype")
        try:
            kind = ObjectKind(ObjectKind.VAR if number is None else number)
        except ValueError:
            self._note(section, "objecttype", f"ObjectType {shown(section.text('objecttype'))} is unknown")
            kind = ObjectKind.VAR
        if kind is ObjectKind.VAR and has_subs and "datatype" not in section.keys:
            self._note(section, "", f"[{section.name}] has sub-objects but no ObjectType; taken for a record")
            return ObjectKind.RECORD
        return kind

    def _compact(self, index: int, section: Section, count: int) -> dict[int, Entry]:
        """Entries of CompactSubObj: one description for all sub-indices, names and values in separate sections."""
        names = self._sections.get(f"{index:04x}name")
        values = self._sections.get(f"{index:04x}value")
        first = standard_of(index, 0)
        entries = {
            0: Entry(
                index, 0, first.name if first else "Number of entries", DataType.UNSIGNED8, Access.RO, count,
                line=section.line,
            )
        }  # fmt: skip
        for sub in range(1, count + 1):
            part = Section(section.name, section.line, dict(section.keys))
            name = names.text(str(sub)) if names else ""
            part.keys.pop("parametername", None)
            if values and str(sub) in values.keys:
                part.keys["parametervalue"] = values.keys[str(sub)]
            entry = self._entry(index, sub, part, section, ObjectKind.ARRAY)
            label = name or f"{section.text('parametername')}{sub}"
            entries[sub] = replace(entry, name=label)
        return entries

    def _entry(self, index: int, sub: int, section: Section, parent: Section, kind: ObjectKind) -> Entry:
        place = f"{index:04X}:{sub:02X}"
        self._count += 1
        if self._count > MAX_ENTRIES:
            raise EdsError(self._source, section.line, f"more than {MAX_ENTRIES} entries are not read")
        data_type = self._data_type(index, sub, section, kind)
        access = self._access(index, sub, section)
        default = self._value(section, "defaultvalue", data_type, place)
        value = self._value(section, "parametervalue", data_type, place)
        relative = bool(default and default[1])
        return Entry(
            index=index,
            sub=sub,
            name=section.text("parametername") or self._standard_name(index, sub),
            data_type=data_type,
            access=access,
            default=default[0] if default else None,
            node_relative=relative,
            mappable=bool(self._number(section, "pdomapping") or 0),
            low=self._limit(section, "lowlimit", data_type, place),
            high=self._limit(section, "highlimit", data_type, place),
            value=self._configured(value, default, relative),
            line=section.line or parent.line,
        )

    def _data_type(self, index: int, sub: int, section: Section, kind: ObjectKind) -> DataType:
        number = self._number(section, "datatype")
        # From [A0] on a type of the manufacturer, whose sub-index 1 names its base.
        if number is not None and number > _MAX_TYPE:
            base = self._sections.get(f"{number:x}sub1")
            found = self._number(base, "defaultvalue") if base else None
            number = found if found is not None else number
        try:
            if number is not None:
                return DataType(number)
        except ValueError:
            self._note(section, "datatype", f"[{section.name}]: DataType 0x{number:X} is unknown")
            return DataType.DOMAIN
        known = standard_of(index, sub)
        guess = known.data_type if known else DataType.UNSIGNED8 if sub == 0 else DataType.DOMAIN
        if kind is ObjectKind.VAR and known is None:
            guess = DataType.DOMAIN
        if kind is not ObjectKind.DOMAIN:
            self._note(section, "", f"[{section.name}] has no DataType; taken for {guess.label}")
        return guess

    def _access(self, index: int, sub: int, section: Section) -> Access:
        text = section.text("accesstype").lower()
        try:
            return Access(text)
        except ValueError:
            known = standard_of(index, sub)
            guess = known.access if known else Access.RO
            said = f"AccessType {shown(text)}" if text else "no AccessType"
            self._note(section, "accesstype", f"[{section.name}] has {said}; taken for {guess.value}")
            return guess

    def _value(
        self, section: Section, key: str, data_type: DataType, place: str
    ) -> tuple[Value, bool] | None:
        text = section.text(key)
        if not text or data_type is DataType.DOMAIN:
            return None
        if key == "parametervalue":
            self.saw_values = True
        found = parse_value(text, data_type)
        if found is None:
            name = "DefaultValue" if key == "defaultvalue" else "ParameterValue"
            self._note(section, key, f"{place}: {name} {shown(text)} is no {data_type.label}; left out")
        return found

    def _limit(self, section: Section, key: str, data_type: DataType, place: str) -> int | None:
        found = self._value(section, key, data_type, place)
        return found[0] if found and isinstance(found[0], int) else None

    def _configured(
        self, value: tuple[Value, bool] | None, default: tuple[Value, bool] | None, relative: bool
    ) -> Value | None:
        """ParameterValue for the requested node."""
        # A library keeps node 1's COB-IDs whatever node is asked for (decision 0008). Here $NODEID is resolved, and a
        # plain number written for the DCF's own node moves along if the default says that it belongs to the node.
        if value is None:
            return None
        number, is_relative = value
        if not isinstance(number, int):
            return number
        if is_relative:
            return number + (self.node_id or 0)
        own, wanted = self._own_node, self.node_id
        if relative and own is not None and wanted is not None and number & 0x7F == own:
            return number - own + wanted
        return number

    def _check_count(self, index: int, section: Section, found: int) -> None:
        said = self._number(section, "subnumber")
        if said is not None and said != found:
            self._note(
                section, "subnumber", f"object {index:04X}: SubNumber is {said}, described are {found}"
            )

    def _number(self, section: Section, key: str) -> int | None:
        text = section.text(key)
        if not text:
            return None
        found = parse_number(text)
        if found is None:
            self._note(section, key, f"[{section.name}]: {key} {shown(text)} is no number; left out")
            return None
        return found.value

    def _note(self, section: Section, key: str, text: str) -> None:
        self._notes.add(section.line_of(key), text)

    def _standard_name(self, index: int, sub: int) -> str:
        known = standard_of(index, sub)
        return known.name if known else ""


# A bound against files that are not an EDS (decision 0008).
MAX_OBJECTS: Final = 5000
_OBJECT: Final = re.compile(r"[0-9a-f]{4}")
_BIT_RATES_K: Final = (10, 20, 50, 125, 250, 500, 800, 1000)
# CiA 306 spells the section with one m.
_COMMISSIONING: Final = ("devicecomissioning", "devicecommissioning")
_LISTS: Final = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")


def read_eds(path: Path | str, node_id: int | None = None) -> DeviceDescription:
    """Read an EDS or DCF.

    Args:
        path: the file.
        node_id: node of the values; that of the DCF when not given.

    Raises:
        EdsError: no such file, not an EDS, or too large.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise EdsError(str(path), 0, "is not a file" if path.exists() else "there is no such file")
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as fault:
        raise EdsError(str(path), 0, f"cannot be read: {fault.strerror or fault}") from None
    return parse_eds(data, path.name, node_id)


def parse_eds(data: bytes, source: str = "EDS", node_id: int | None = None) -> DeviceDescription:
    """Read the bytes of an EDS or DCF; `source` names the file in errors.

    Raises:
        EdsError: not an EDS, or too large; with the line where there is one.
    """
    notes = Notes()
    sections = read_sections(data, source, notes)
    own_node = _own_node(sections, notes)
    reader = Reader(source, sections, notes, own_node, own_node if node_id is None else node_id)
    objects: dict[int, ObjectSpec] = {}
    for name, section in sections.items():
        if _OBJECT.fullmatch(name) is None:
            continue
        if len(objects) == MAX_OBJECTS:
            raise EdsError(
                source, section.line, f"more than {MAX_OBJECTS} objects; an EDS of this size is not read"
            )
        spec = reader.object_of(int(name, 16), section)
        objects[spec.index] = spec
    if not objects:
        first = next(iter(sections.values()))
        raise EdsError(source, first.line, f"no EDS: it has [{first.name[:40]}] but no object such as [1000]")
    reader.orphans(objects)
    _check_lists(sections, objects, notes)
    return DeviceDescription(
        objects=dict(sorted(objects.items())),
        info=_device_info(sections),
        node_id=reader.node_id,
        is_dcf=reader.saw_values or own_node is not None,
        notes=notes.all(),
    )


def _own_node(sections: dict[str, Section], notes: Notes) -> int | None:
    for name in _COMMISSIONING:
        section = sections.get(name)
        if section is None:
            continue
        found = parse_number(section.text("nodeid"))
        if found is not None and 1 <= found.value <= 127:
            return found.value
        notes.add(section.line_of("nodeid"), f"[{section.name}] has no usable NodeID")
    return None


def _device_info(sections: dict[str, Section]) -> DeviceInfo:
    device = sections.get("deviceinfo", Section("DeviceInfo", 0))
    file = sections.get("fileinfo", Section("FileInfo", 0))

    def number(key: str) -> int | None:
        found = parse_number(device.text(key))
        return None if found is None else found.value

    return DeviceInfo(
        vendor_name=device.text("vendorname"),
        vendor_number=number("vendornumber"),
        product_name=device.text("productname"),
        product_number=number("productnumber"),
        revision_number=number("revisionnumber"),
        order_code=device.text("ordercode"),
        bit_rates=tuple(1000 * k for k in _BIT_RATES_K if number(f"baudrate_{k}")),
        rpdos=number("nrofrxpdo"),
        tpdos=number("nroftxpdo"),
        file_name=file.text("filename"),
        file_version=file.text("fileversion"),
        description=file.text("description"),
        created_by=file.text("createdby"),
    )


def _check_lists(sections: dict[str, Section], objects: dict[int, ObjectSpec], notes: Notes) -> None:
    """Note objects that the lists name and the file does not describe; the lists are not needed otherwise."""
    for name in _LISTS:
        section = sections.get(name)
        for key, (text, line) in section.keys.items() if section else ():
            listed = parse_number(text) if key.isdigit() else None
            if listed is not None and listed.value not in objects:
                notes.add(line, f"object {listed.value:04X} is listed but not described")
