"""Anybody's table: what is read, what is refused, and what the refusal says."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.accuracy.paper import PAPER_A_DEG, PAPER_TABLE
from gantryctl.engineering.accuracy.statistics import statistics
from gantryctl.engineering.accuracy.table import Direction, ErrorTable, Layout, RowKey
from gantryctl.engineering.accuracy.table_csv import format_error_table, parse_error_table, read_error_table
from gantryctl.errors import UsageError

ROOT = Path(__file__).parents[4]
HEADER = "base_deg,direction,displacement_deg,error_deg"


def test_the_shipped_example_is_the_papers_table() -> None:
    table = read_error_table(ROOT / "configs" / "examples" / "paper_table2.csv")
    assert table == PAPER_TABLE
    assert round(statistics(table).a_deg, 4) == PAPER_A_DEG


@pytest.mark.parametrize(
    "text",
    [
        f"{HEADER}\n90,ccw,5,-0.0002\n90,cw,5,0.001\n",
        f"\ufeff{HEADER}\r\n90,ccw,5,-0.0002\r\n90,cw,5,0.001\r\n",
        "Base_Deg ; DIRECTION; displacement_deg ;Error_deg\n 90 ; CCW ;5;-0,0002\n90;cw;5; 1e-3\n",
        "sep=;\nbase_deg;direction;displacement_deg;error_deg\n90;ccw;5;-0,0002\n90;cw;5;0,001\n",
        "base_deg\tdirection\tdisplacement_deg\terror_deg\n90\tccw\t5\t-.0002\n90\tcw\t5\t+0.001\n",
        'error_deg,run,direction,displacement_deg,base_deg,who\n"-0,0002",1,+,5.0,90.0,me\n.001,1,-,5,90,\n',
        f"# May\n\n{HEADER}\n90,ccw,0,0\n90,ccw,5,-0.0002\n,,,\n\n90,clockwise,0,0.0\n90,cw,5,0.001\n",
    ],
    ids=["plain", "mark and CRLF", "semicolon", "spreadsheet", "tab", "order", "comments"],
)
def test_spellings_of_one_table(text: str) -> None:
    table = parse_error_table(text)
    assert table.rows == (RowKey(90.0, Direction.CCW), RowKey(90.0, Direction.CW))
    assert table.displacements_deg == (0.0, 5.0)
    np.testing.assert_array_equal(table.errors_deg, [[0.0, -0.0002], [0.0, 0.001]])


def test_utf16_as_spreadsheets_write_it(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    file.write_bytes(f"{HEADER}\n90,ccw,5,-0.0002\n".encode("utf-16"))
    assert read_error_table(file).errors_deg[0, 1] == -0.0002


def test_chords_become_angles() -> None:
    """218.09693682668 mm is the chord of 5 deg at 2.5 m; 4.359 um more is 1e-4 deg."""
    text = (
        "base_deg,direction,displacement_deg,chord_mm\n90,ccw,5,218.09693682668\n90,cw,5,218.1012959968932\n"
    )
    table = parse_error_table(text, radius_m=2.5)
    np.testing.assert_allclose(table.errors_deg[:, 1], [0.0, 1e-4], atol=1e-10)


def test_repeated_series_and_layout() -> None:
    text = f"{HEADER},run\n" + "".join(
        f"0,{way},5,0.00{run},{run}\n" for way in ("ccw", "cw") for run in (1, 2)
    )
    table = parse_error_table(text, layout=Layout.RETURN)
    assert table.runs == 2
    assert table.layout is Layout.RETURN


REFUSED = {
    "empty": ("", ["table: empty", HEADER]),
    "header only": (f"{HEADER}\n", ["no rows below the header"]),
    "no header": ("90,ccw,5,0.1\n", ["line 1", "column base_deg is missing"]),
    "misspelt": ("base,direction,displacement_deg,error_deg\n90,ccw,5,0\n", ["column base_deg is missing"]),
    "no value": ("base_deg,direction,displacement_deg\n90,ccw,5\n", ["neither error_deg nor chord_mm"]),
    "two value columns": (f"{HEADER},chord_mm\n90,ccw,5,0,218\n", ["both error_deg and chord_mm"]),
    "column twice": (f"{HEADER},error_deg\n90,ccw,5,0,0\n", ["column error_deg twice"]),
    "chord without radius": (
        "base_deg,direction,displacement_deg,chord_mm\n90,ccw,5,218\n", ["chord_mm needs the radius"],
    ),
    "nan": (f"{HEADER}\n90,ccw,5,nan\n", ["line 2, column error_deg = 'nan'", "not a number"]),
    "inf": (f"{HEADER}\n90,ccw,5,-inf\n", ["column error_deg = '-inf'"]),
    "overflow": (f"{HEADER}\n90,ccw,5,1e999\n", ["column error_deg = '1e999'"]),
    "huge": (f"{HEADER}\n90,ccw,5,1e300\n400,ccw,5,0\n", ["error_deg = '1e300'", "base_deg = '400'"]),
    "underscore": (f"{HEADER}\n90,ccw,5,1_0\n", ["column error_deg = '1_0'"]),
    "thousands": (f'{HEADER}\n90,ccw,5,"1,000.5"\n', ["column error_deg = '1,000.5'"]),
    "text": (f"{HEADER}\nninety,ccw,5,0\n", ["line 2, column base_deg = 'ninety'"]),
    "direction": (f"{HEADER}\n90,left,5,0\n", ["line 2, column direction = 'left': must be ccw or cw"]),
    "cell missing": (f"{HEADER}\n90,ccw,,0\n", ["line 2, column displacement_deg = '': missing"]),
    "short line": (f"{HEADER}\n90,ccw,5\n", ["line 2, column error_deg = '': missing"]),
    "decimal comma": (f"{HEADER}\n90,ccw,5,0,0012\n", ["line 2", "5 values for 4", "semicolon"]),
    "negative displacement": (f"{HEADER}\n90,cw,-5,0\n", ["column displacement_deg = '-5'", "no sign"]),
    "half a turn": (f"{HEADER}\n90,cw,180,0\n", ["column displacement_deg = '180'"]),
    "zero column": (f"{HEADER}\n90,ccw,0,0.001\n", ["'0.001'", "must be 0 at displacement 0"]),
    "twice the same": (f"{HEADER}\n90,ccw,5,0.1\n90,ccw,5,0.1\n", ["line 3", "given before in line 2"]),
    "twice": (f"{HEADER}\n90,ccw,5,0\n90,ccw,5.0,1\n", ["line 3", "given before in line 2", "column run"]),
    "gap": (f"{HEADER}\n9,ccw,5,0\n9,ccw,10,0\n9,cw,5,0\n", ["base 9 deg, cw, run 1", "displacement_deg 10"]),
    "only zero": (f"{HEADER}\n90,ccw,0,0\n", ["nothing was measured"]),
    "run": (f"{HEADER},run\n90,ccw,5,0,first\n", ["column run = 'first'"]),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_and_how(case: str) -> None:
    text, parts = REFUSED[case]
    with pytest.raises(UsageError) as caught:
        parse_error_table(text)
    for part in parts:
        assert part in str(caught.value)


def test_chords_beyond_the_diameter_and_useless_radius() -> None:
    text = "base_deg,direction,displacement_deg,chord_mm\n90,ccw,5,6000\n"
    with pytest.raises(UsageError, match="at most 2 R = 5000 mm"):
        parse_error_table(text, radius_m=2.5)
    with pytest.raises(UsageError, match="leave --radius-m out"):
        parse_error_table(f"{HEADER}\n90,ccw,5,0\n", radius_m=2.5)
    with pytest.raises(UsageError, match="above 0"):
        parse_error_table(text, radius_m=float("nan"))


def test_all_problems_are_told_at_once() -> None:
    with pytest.raises(UsageError) as caught:
        parse_error_table(f"{HEADER}\nx,ccw,5,0\n90,up,5,0\n90,cw,5,nan\n" + "90,ccw,5,?\n" * 30)
    lines = str(caught.value).splitlines()
    assert [line.split(",")[0] for line in lines[:3]] == [f"table: line {k}" for k in (2, 3, 4)]
    assert len(lines) == 22
    assert lines[-2] == "table: and 13 more"


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read"):
        read_error_table(tmp_path / "none.csv")
    with pytest.raises(UsageError, match="cannot be read"):
        read_error_table(tmp_path)
    (tmp_path / "image.csv").write_bytes(b"\x89PNG\x00\xff")
    with pytest.raises(UsageError, match="not a text file"):
        read_error_table(tmp_path / "image.csv")


@given(
    bases=st.lists(st.floats(-180, 180).map(lambda x: x + 0.0), min_size=1, max_size=3, unique=True),
    runs=st.integers(1, 3),
    columns=st.lists(st.floats(1e-3, 179.0), min_size=1, max_size=4, unique=True),
    seed=st.integers(0, 2**32 - 1),
)
def test_what_is_written_is_read_back(bases: list[float], runs: int, columns: list[float], seed: int) -> None:
    rows = tuple(RowKey(b, way, run) for b in bases for way in Direction for run in range(1, runs + 1))
    errors = np.random.default_rng(seed).normal(0.0, 0.01, (len(rows), len(columns) + 1))
    errors[:, 0] = 0.0
    table = ErrorTable(rows, (0.0, *sorted(columns)), errors)
    assert parse_error_table(format_error_table(table)) == table


@given(st.text(alphabet=" \t\n\r,;.-+0159eEnaifcw\"'#_×\ufeff\x00", max_size=80), st.booleans())
def test_rubbish_is_refused_or_read_never_a_traceback(tail: str, with_header: bool) -> None:
    try:
        table = parse_error_table((HEADER + "\n" if with_header else "") + tail)
    except UsageError:
        return
    assert np.all(np.isfinite(table.errors_deg))
