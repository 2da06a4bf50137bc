"""EDS and DCF files as they are: read with a note where possible, one clear error where not."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.drives.od.model import Access, EdsError, ObjectKind
from gantryctl.drives.od.reading import parse_eds, read_eds
from gantryctl.drives.od.types import DataType
from gantryctl.drives.od.values import parse_number

FILES = Path(__file__).parents[3] / "data" / "eds"
OBJECT = b"[6041]\nParameterName=Statusword\nDataType=0x0006\nAccessType=ro\nPDOMapping=1\n"


def notes(name: str) -> str:
    return "\n".join(str(note) for note in read_eds(FILES / name).notes)


def test_a_clean_file_is_read_without_a_note() -> None:
    device = read_eds(FILES / "minimal.eds", node_id=5)
    assert device.notes == ()
    assert not device.is_dcf
    assert (device.info.vendor_name, device.info.vendor_number) == ("Example Drives", 0x7FF)
    assert device.info.bit_rates == (500_000, 1_000_000)
    speed = device.entry(0x60FF)
    assert speed is not None
    assert (speed.data_type, speed.access, speed.rpdo, speed.tpdo) == (
        DataType.INTEGER32,
        Access.RWW,
        True,
        False,
    )
    cob = device.entry(0x1400, 1)
    assert cob is not None
    assert cob.default_for(5) == 0x205


@pytest.mark.parametrize(
    ("name", "note"),
    [
        ("cp1252.eds", "line 4: byte E4 is not UTF-8; the file is read as Windows-1252"),
        ("missing_fields.eds", "line 164: [6041] has no DataType; taken for U16"),
        ("missing_fields.eds", "line 186: [6064] has no AccessType; taken for ro"),
        ("doubled.eds", "line 205: [6041] is there twice (first in line 164); read as one"),
        ("doubled.eds", "line 174: ParameterName is there twice; 'Modes of operation' of line 173 counts"),
        ("orphans.eds", "line 99: [1800sub0] has no section [1800]; taken for a record"),
        ("orphans.eds", "line 31: object 605A is listed but not described"),
    ],
)
def test_an_odd_file_is_read_and_the_oddity_is_named_with_its_line(name: str, note: str) -> None:
    assert note in notes(name)


@pytest.mark.parametrize(
    "name",
    [
        "bom.eds",
        "cp1252.eds",
        "missing_fields.eds",
        "odd_comments.eds",
        "empty_numbers.eds",
        "doubled.eds",
        "orphans.eds",
        "array_mapping.eds",
        "own_types.eds",
    ],
)
def test_an_odd_file_gives_the_same_axis_objects_as_a_clean_one(name: str) -> None:
    clean, odd = read_eds(FILES / "minimal.eds"), read_eds(FILES / name)
    for index in (0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x60FF):
        want, have = clean.entry(index), odd.entry(index)
        assert want is not None
        assert have is not None
        assert (have.data_type, have.access, have.mappable) == (want.data_type, want.access, want.mappable)
    assert odd.entry(0x1800, 1) is not None


def test_umlauts_of_a_windows_file_are_kept() -> None:
    assert read_eds(FILES / "cp1252.eds").info.description == "Antriebsverstärker, 40 °C"


def test_mapping_objects_declared_as_array_keep_their_entries() -> None:
    spec = read_eds(FILES / "array_mapping.eds").objects[0x1600]
    assert spec.kind is ObjectKind.ARRAY
    assert sorted(spec.entries) == [0, 1, 2]


def test_types_of_the_file_itself_and_compact_sub_objects_are_followed() -> None:
    device = read_eds(FILES / "own_types.eds")
    mode = device.entry(0x6060)
    assert mode is not None
    assert mode.data_type is DataType.INTEGER8
    names = [device.objects[0x1016].entries[sub].name for sub in (1, 2, 3)]
    assert names == ["Consumer heartbeat time1", "Second master", "Consumer heartbeat time3"]


@pytest.mark.parametrize(("node", "rpdo", "tpdo"), [(None, 0x201, 0x40000181), (5, 0x205, 0x40000185)])
def test_the_values_of_a_dcf_are_those_of_the_node_asked_for(node: int | None, rpdo: int, tpdo: int) -> None:
    device = read_eds(FILES / "node_arithmetic.dcf", node)
    assert device.is_dcf
    assert device.node_id == (node or 1)
    receive, transmit = device.entry(0x1400, 1), device.entry(0x1800, 1)
    assert receive is not None
    assert transmit is not None
    assert (receive.value, transmit.value) == (rpdo, tpdo)
    assert receive.default_for(7) == 0x207


@pytest.mark.parametrize(
    ("name", "line", "text"),
    [
        ("empty.eds", 0, "empty.eds: the file is empty"),
        ("foreign.ini", 2, "foreign.ini:2: no EDS: it has [window] but no object such as [1000]"),
        ("notes.txt", 1, "notes.txt:1: no EDS: there is no [section] in it"),
        ("device.xdd", 1, "device.xdd:1: no EDS: this looks like XML (an XDD is not read; ask for the EDS)"),
        ("binary.eds", 1, "binary.eds:1: no EDS: binary data"),
    ],
)
def test_a_foreign_file_is_one_clear_error(name: str, line: int, text: str) -> None:
    with pytest.raises(EdsError) as caught:
        read_eds(FILES / name)
    assert str(caught.value) == text
    assert caught.value.line == line
    assert caught.value.exit_code == 2


def test_a_file_that_is_not_there_and_a_directory_are_named(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match="there is no such file"):
        read_eds(tmp_path / "none.eds")
    with pytest.raises(EdsError, match="is not a file"):
        read_eds(tmp_path)


def test_a_file_above_the_size_limit_is_not_read() -> None:
    with pytest.raises(EdsError, match="1000001 bytes; an EDS of more than 1000000 bytes is not read"):
        parse_eds(OBJECT + b";" * (1_000_001 - len(OBJECT)))


def test_too_many_objects_and_entries_end_in_an_error_with_a_line() -> None:
    many = b"".join(b"[%04X]\nDataType=7\n" % index for index in range(0x1000, 0x1000 + 5001))
    with pytest.raises(EdsError, match="more than 5000 objects") as caught:
        parse_eds(many)
    assert caught.value.line == 10_001
    compact = b"".join(
        b"[%04X]\nObjectType=8\nCompactSubObj=254\n" % index for index in range(0x2000, 0x2060)
    )
    with pytest.raises(EdsError, match="more than 4000 entries by CompactSubObj") as caught:
        parse_eds(compact)
    # 15 objects of 254 entries are 3810: the sixteenth is too many.
    assert caught.value.line == 46
    subs = b"".join(
        b"[%04Xsub%X]\n" % (index, sub) for index in range(0x2000, 0x2050) for sub in range(1, 255)
    )
    with pytest.raises(EdsError, match="more than 20000 entries"):
        parse_eds(OBJECT + subs)


def test_utf_16_is_read() -> None:
    device = parse_eds(OBJECT.decode().encode("utf-16"))
    assert device.entry(0x6041) is not None
    assert "UTF-16" in str(device.notes[0])


@pytest.mark.parametrize(
    ("text", "value", "relative"),
    [
        ("0x180", 0x180, False),
        ("0X1f", 31, False),
        ("1Fh", 31, False),
        ("010", 8, False),
        ("08", 8, False),
        ("0", 0, False),
        ("-5", -5, False),
        ("$NODEID+0x200", 0x200, True),
        ("0x200+$NODEID", 0x200, True),
        (" 0x80000000 + $NodeID + 512 ", 0x80000200, True),
        ("$NODEID", 0, True),
    ],
)
def test_numbers_in_all_spellings(text: str, value: int, relative: bool) -> None:
    assert parse_number(text) == (value, relative)


@pytest.mark.parametrize(
    "text", ["", " ", "abc", "0x", "0x_1", "1_0", "$NODEID+$NODEID", "1+", "+", "1.5", "²", "--1"]
)
def test_what_is_no_number_is_none(text: str) -> None:
    assert parse_number(text) is None


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("0x0004", "0xFFFFFFFF", -1),
        ("0x0004", "-1", -1),
        ("0x0003", "0x8000", -32768),
        ("0x0005", "0x100", None),
        ("0x0005", "-1", None),
        ("0x0001", "true", 1),
        ("0x0008", "1,5", 1.5),
        ("0x0008", "0x3FC00000", 1.5),
        ("0x0008", "nan", None),
        ("0x0009", "a ; b", "a"),
        ("0x000A", "0102FF", b"\x01\x02\xff"),
    ],
)
def test_a_default_is_of_its_type_or_left_out(kind: str, text: str, value: object) -> None:
    device = parse_eds(f"[2000]\nDataType={kind}\nAccessType=rw\nDefaultValue={text}\n".encode())
    entry = device.entry(0x2000)
    assert entry is not None
    assert entry.default == value
    assert bool(device.notes) == (value is None)


@given(st.binary(max_size=400))
def test_any_bytes_are_a_description_or_an_eds_error(data: bytes) -> None:
    for whole in (data, OBJECT + data, data + b"\n" + OBJECT):
        try:
            parse_eds(whole, node_id=3)
        except EdsError as refused:
            said = str(refused)
        else:
            said = "EDS"
        assert said.startswith("EDS")


_WORDS = [
    "[6041]",
    "[6041sub1]",
    "[1016Name]",
    "[A0sub1]",
    "SubNumber",
    "DataType",
    "CompactSubObj",
    "=",
    "0x",
    "$NODEID",
]


@given(
    st.lists(st.sampled_from([*_WORDS, "\n", "8", "254", "0xFFFFFFFF", "ObjectType=9\n", "ParameterValue="]))
)
def test_any_arrangement_of_eds_words_is_a_description_or_an_eds_error(words: list[str]) -> None:
    with contextlib.suppress(EdsError):
        parse_eds("".join(words).encode(), node_id=127)
