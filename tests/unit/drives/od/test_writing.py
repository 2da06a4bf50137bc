"""An EDS that is written can be read again, by us and by canopen."""

import io

import canopen

from gantryctl.drives.od.model import Access, DeviceInfo, Entry, ObjectKind, ObjectSpec, described
from gantryctl.drives.od.reading import parse_eds
from gantryctl.drives.od.types import DataType, decode, encode
from gantryctl.drives.od.writing import write_eds

ENTRIES = (
    Entry(0x1000, 0, "Device type", DataType.UNSIGNED32, Access.RO, 0x20192),
    Entry(0x1008, 0, "Name", DataType.VISIBLE_STRING, Access.CONST, "axis"),
    Entry(0x1014, 0, "COB-ID EMCY", DataType.UNSIGNED32, Access.RW, 0x80, node_relative=True),
    Entry(0x2000, 0, "Gain", DataType.REAL32, Access.RW, 1.5),
    Entry(
        0x60FF, 0, "Target velocity", DataType.INTEGER32, Access.RWW, -7, mappable=True, low=-100, high=100
    ),
    Entry(0x6502, 0, "Supported drive modes", DataType.UNSIGNED32, Access.RO),
)
RECORD = ObjectSpec(
    0x1018,
    "Identity",
    ObjectKind.RECORD,
    {
        0: Entry(0x1018, 0, "Count", DataType.UNSIGNED8, Access.CONST, 1),
        1: Entry(0x1018, 1, "Vendor", DataType.UNSIGNED32, Access.RO, 0x7FF),
    },
)
DEVICE = described(
    (RECORD, *(ObjectSpec(e.index, e.name, ObjectKind.VAR, {0: e}) for e in ENTRIES)),
    DeviceInfo(vendor_name="V", product_name="P", vendor_number=7, bit_rates=(500_000,), rpdos=1, tpdos=2),
)


def test_what_is_written_is_read_again_the_same() -> None:
    again = parse_eds(write_eds(DEVICE).encode())
    assert again.notes == ()
    assert (again.info.vendor_name, again.info.vendor_number, again.info.tpdos) == ("V", 7, 2)
    for want, have in zip(DEVICE.entries(), again.entries(), strict=True):
        assert (have.place, have.data_type, have.access, have.default) == (
            want.place,
            want.data_type,
            want.access,
            want.default,
        )
        assert (have.node_relative, have.mappable, have.low, have.high) == (
            want.node_relative,
            want.mappable,
            want.low,
            want.high,
        )


def test_canopen_reads_it_too() -> None:
    file = io.StringIO(write_eds(DEVICE))
    file.name = "device.eds"
    od = canopen.import_od(file, node_id=4)
    assert od[0x1014].default == 0x84
    assert od[0x60FF].min == -100
    assert od[0x1018][1].default == 0x7FF


def test_values_of_every_type_survive_their_bytes() -> None:
    for data_type, value in (
        (DataType.INTEGER24, -5),
        (DataType.UNSIGNED64, 2**64 - 1),
        (DataType.REAL64, 0.1),
        (DataType.VISIBLE_STRING, "text"),
        (DataType.UNICODE_STRING, "ä"),
        (DataType.DOMAIN, b"\x00\x01"),
        (DataType.BOOLEAN, 1),
    ):
        assert decode(data_type, encode(data_type, value)) == value
