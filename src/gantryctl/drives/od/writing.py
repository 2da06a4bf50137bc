"""Write a device description as EDS (CiA 306); the same description gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from gantryctl.drives.od.model import DeviceDescription, DeviceInfo, Entry, ObjectKind, ObjectSpec
from gantryctl.drives.od.types import INTEGERS, DataType, Value

_MANDATORY: Final = (0x1000, 0x1001, 0x1018)
_BIT_RATES_K: Final = (10, 20, 50, 125, 250, 500, 800, 1000)
# A date of the format, not of the run: equal tables give equal files.
_DATE: Final = "11-20-2026"


def write_eds(device: DeviceDescription) -> str:
    """Text of the EDS."""
    lines = [*_file_info(device.info), *_device_info(device.info), *_dummies(), "[Comments]", "Lines=0", ""]
    special = {"MandatoryObjects": _MANDATORY, "ManufacturerObjects": range(0x2000, 0x6000)}
    groups = {name: [index for index in device.objects if index in own] for name, own in special.items()}
    rest = [index for index in device.objects if not any(index in own for own in special.values())]
    for name in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        indices = groups.get(name, rest)
        lines += [f"[{name}]", f"SupportedObjects={len(indices)}"]
        lines += [f"{number}=0x{index:04X}" for number, index in enumerate(indices, start=1)]
        lines.append("")
        for index in indices:
            lines += _object(device.objects[index])
    return "\n".join(lines)


def _file_info(info: DeviceInfo) -> Iterable[str]:
    yield from (
        "[FileInfo]",
        f"FileName={info.file_name}",
        f"FileVersion={info.file_version or '1'}",
        "FileRevision=0",
        "EDSVersion=4.0",
        f"Description={info.description}",
        "CreationTime=12:00PM",
        f"CreationDate={_DATE}",
        f"CreatedBy={info.created_by}",
        "ModificationTime=12:00PM",
        f"ModificationDate={_DATE}",
        f"ModifiedBy={info.created_by}",
        "",
    )


def _device_info(info: DeviceInfo) -> Iterable[str]:
    yield from (
        "[DeviceInfo]",
        f"VendorName={info.vendor_name}",
        f"VendorNumber=0x{info.vendor_number or 0:X}",
        f"ProductName={info.product_name}",
        f"ProductNumber=0x{info.product_number or 0:X}",
        f"RevisionNumber=0x{info.revision_number or 0:X}",
        f"OrderCode={info.order_code}",
    )
    yield from (f"BaudRate_{k}={int(1000 * k in info.bit_rates)}" for k in _BIT_RATES_K)
    yield from (
        "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1",
        "Granularity=8",
        "DynamicChannelsSupported=0",
        "GroupMessaging=0",
        f"NrOfRXPDO={info.rpdos or 0}",
        f"NrOfTXPDO={info.tpdos or 0}",
        "LSS_Supported=0",
        "",
    )


def _dummies() -> Iterable[str]:
    yield "[DummyUsage]"
    yield from (f"Dummy{code:04d}=0" for code in range(1, 8))
    yield ""


def _object(spec: ObjectSpec) -> Iterable[str]:
    head = f"{spec.index:04X}"
    if spec.kind in (ObjectKind.VAR, ObjectKind.DOMAIN):
        yield from _entry(head, spec.entries[0], spec.kind)
        return
    yield from (
        f"[{head}]",
        f"ParameterName={spec.name}",
        f"ObjectType=0x{spec.kind.value:X}",
        f"SubNumber={len(spec.entries)}",
        "",
    )
    for sub, entry in spec.entries.items():
        yield from _entry(f"{head}sub{sub:X}", entry, ObjectKind.VAR)


def _entry(section: str, entry: Entry, kind: ObjectKind) -> Iterable[str]:
    yield from (
        f"[{section}]",
        f"ParameterName={entry.name}",
        f"ObjectType=0x{kind.value:X}",
        f"DataType=0x{entry.data_type.value:04X}",
        f"AccessType={entry.access.value}",
        f"DefaultValue={_default(entry)}",
        f"PDOMapping={int(entry.mappable)}",
    )
    if entry.low is not None:
        yield f"LowLimit={_number(entry.low, entry.data_type)}"
    if entry.high is not None:
        yield f"HighLimit={_number(entry.high, entry.data_type)}"
    yield ""


def _default(entry: Entry) -> str:
    if entry.default is None:
        return ""
    text = _number(entry.default, entry.data_type)
    return f"$NODEID+{text}" if entry.node_relative else text


def _number(value: Value, data_type: DataType) -> str:
    if isinstance(value, bytes):
        return value.hex()
    number = INTEGERS.get(data_type)
    if number is None or not isinstance(value, int) or number.signed:
        return str(value)
    return f"0x{value:0{number.bits // 4}X}" if number.bits >= 32 else str(value)
