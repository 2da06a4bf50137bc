"""Object tables: rows of a CSV to entries, and what is wrong with a row is told with its line."""

from pathlib import Path

import pytest

from gantryctl.drives.od.model import Access, EdsError
from gantryctl.drives.od.object_table import read_object_tables, read_objects_of
from gantryctl.drives.od.types import DataType
from gantryctl.wiring.virtual import shipped_objects

HEAD = "drive,object,sub,state,data_type,access,default,low_limit,high_limit\n"


def table_file(folder: Path, *rows: str) -> Path:
    file = folder / "drives.csv"
    file.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")
    return file


def test_the_shipped_table_has_nine_drives_of_61_rows() -> None:
    tables = read_object_tables(shipped_objects())
    assert len(tables) == 9
    assert {len(t.entries) + len(t.absent) for t in tables.values()} == {61}
    # Of nine real dictionaries none has both watches, and five have no 6072.
    assert not [t for t in tables.values() if not t.lacks(0x1016, 1) and not t.lacks(0x1400, 5)]
    assert len([t for t in tables.values() if t.lacks(0x6072, 0)]) == 5


def test_a_row_becomes_an_entry(tmp_path: Path) -> None:
    file = table_file(
        tmp_path, "a,1400,1,present,0x0007,rw,$NODEID+0x80000200,,", "a,605A,0,present,0x3,rw,2,-32768,8",
        "a,6072,0,absent,,,,,",
    )  # fmt: skip
    table = read_objects_of(file)
    cob_id, stop = table.entries[0x1400, 1], table.entries[0x605A, 0]
    assert (cob_id.default, cob_id.node_relative, cob_id.default_for(5)) == (0x80000200, True, 0x80000205)
    assert (stop.data_type, stop.access, stop.low, stop.high) == (DataType.INTEGER16, Access.RW, -32768, 8)
    assert table.lacks(0x6072, 0)
    # What nobody has looked at is not known to be missing.
    assert not table.lacks(0x6085, 0)


def test_a_drive_is_chosen_by_how_its_name_begins(tmp_path: Path) -> None:
    row = "1000,0,present,0x7,ro,,,"
    file = table_file(tmp_path, f"Alpha 1,{row}", f"Alpha 2,{row}", f"Beta,{row}")
    assert read_objects_of(file, "beta").drive == "Beta"
    assert read_objects_of(file, "ALPHA 2").drive == "Alpha 2"
    with pytest.raises(EdsError, match=r"several drives begin with 'alpha'.*Alpha 1, Alpha 2, Beta"):
        read_objects_of(file, "alpha")
    with pytest.raises(EdsError, match="there is no drive 'gamma'"):
        read_objects_of(file, "gamma")


def test_an_eds_names_all_that_a_drive_has() -> None:
    table = read_objects_of(Path("tests/data/eds/minimal.eds"))
    assert table.complete
    assert table.lacks(0x60FD, 0)


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("a,10000,0,present,0x7,ro,,,", "index 1000 to FFFF"),
        ("a,zz,0,present,0x7,ro,,,", "is no object"),
        ("a,1000,0,maybe,0x7,ro,,,", "neither present nor absent"),
        ("a,1000,0,present,0x77,ro,,,", "no data type"),
        ("a,1000,0,present,0x7,rx,,,", "is no access"),
        ("a,1000,0,present,0x5,ro,300,,", "'300' is no U8"),
        ("a,1000,0,present,0x5,ro,,x,", "'x' is no U8"),
    ],
)
def test_what_is_wrong_with_a_row_is_told_with_its_line(tmp_path: Path, row: str, told: str) -> None:
    with pytest.raises(EdsError, match=f":3: .*{told}"):
        read_object_tables(table_file(tmp_path, "a,1001,0,present,0x5,ro,,,", row))


def test_an_entry_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match=":3: a has 1000:00 twice"):
        read_object_tables(table_file(tmp_path, "a,1000,0,present,0x7,ro,,,", "a,1000,0,absent,,,,,"))


def test_no_table_and_no_file(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match="it has no rows"):
        read_object_tables(table_file(tmp_path))
    other = tmp_path / "other.csv"
    other.write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(EdsError, match="it has no column drive"):
        read_object_tables(other)
    with pytest.raises(EdsError, match="cannot be read"):
        read_object_tables(tmp_path / "nothing.csv")
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00\x81" * 40)
    with pytest.raises(EdsError, match="no object table"):
        read_object_tables(binary)
