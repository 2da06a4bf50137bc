"""EDS and DCF import: sections to objects, by CiA 306 where the file keeps to it, else with a note."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

from gantryctl.drives.od.entries import Reader
from gantryctl.drives.od.lines import MAX_BYTES, Notes, Section, read_sections
from gantryctl.drives.od.model import DeviceDescription, DeviceInfo, EdsError, ObjectSpec
from gantryctl.drives.od.values import parse_number

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
