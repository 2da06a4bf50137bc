"""`gantryctl trace` on a small recording."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from gantryctl.cli.main import cli
from gantryctl.errors import UsageError
from gantryctl.runtime.recorder import ArrowRecorder
from gantryctl.trace.figure import chosen, draw, overview
from gantryctl.trace.reader import read_trace
from gantryctl.units import rad

COLUMNS = ("time_s", "pos_ref_rad", "vel_ref_rad_s", "pos_load_rad", "torque_act_nm", "axis_state")


@pytest.fixture
def live(tmp_path: Path) -> ArrowRecorder:
    recorder = ArrowRecorder(tmp_path / "move_0.6", COLUMNS, {"machine": "hust", "period_s": 0.01}, 100)
    for k in range(20_001):
        angle = rad(math.sin(k * 1e-3))
        recorder.record((k * 0.01, angle, rad(0.5), angle - rad(0.002), math.nan if k == 7 else 3.0, 2))
    return recorder


@pytest.fixture
def file(live: ArrowRecorder) -> Path:
    live.close()
    return live.path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["trace", *map(str, arguments)])


def printed(*arguments: object) -> str:
    result = run(*arguments)
    assert result.exception is None, result.exception
    return result.output


def refused(kind: type[Exception], *arguments: object) -> str:
    result = run(*arguments)
    assert isinstance(result.exception, kind)
    return str(result.exception)


def test_show_tells_what_is_in_the_recording_in_degrees(file: Path) -> None:
    text = printed("show", file)
    assert f"{file}: 20001 rows, 200.000 s, hash {read_trace(file).hash()[:16]}" in text
    assert "machine: hust" in text
    (line,) = (line for line in text.splitlines() if line.startswith("pos_ref_rad"))
    assert [round(float(cell), 3) for cell in line.split()[1:3]] == [-1.0, 1.0]
    assert line.endswith("deg")
    (line,) = (line for line in text.splitlines() if line.startswith("torque_act_nm"))
    assert line.split()[1:4] == ["3", "3", "3"]
    assert line.endswith("N m  (1 values are not finite)")
    assert "not closed" not in text


def test_show_as_json_has_the_values_as_recorded(file: Path) -> None:
    data = json.loads(printed("show", file, "--json"))
    assert data["rows"] == 20_001
    assert data["complete"] is True
    assert data["hash"] == read_trace(file).hash()
    columns = {column["name"]: column for column in data["columns"]}
    assert columns["vel_ref_rad_s"]["rms"] == pytest.approx(rad(0.5))
    assert columns["vel_ref_rad_s"]["unit"] == "rad/s"
    assert columns["torque_act_nm"]["not_finite"] == 1


def test_show_of_a_run_that_was_killed_says_so(live: ArrowRecorder) -> None:
    text = printed("show", live.live_path)
    assert "20000 rows" in text
    assert "not closed" in text


def test_show_without_any_row(tmp_path: Path) -> None:
    recorder = ArrowRecorder(tmp_path / "x", COLUMNS)
    recorder.close()
    (line,) = (line for line in printed("show", recorder.path).splitlines() if line.startswith("pos_ref_rad"))
    assert line.split() == ["pos_ref_rad", "-", "-", "-", "deg"]
    json.loads(printed("show", recorder.path, "--json"))


@pytest.mark.parametrize(
    ("name", "begin"), [("x.png", b"\x89PNG"), ("x.svg", b"<?xml"), ("x.html", b"<!doctype html>")]
)
def test_plot_writes_a_picture(file: Path, name: str, begin: bytes) -> None:
    out = file.with_name(name)
    assert printed("plot", file, "--columns", "pos_ref_rad", "--out", out) == f"wrote {out}\n"
    content = out.read_bytes()
    assert content.startswith(begin)
    if name == "x.html":
        assert b"hust" in content
        assert b"://" not in content.replace(b"http://www.w3.org/", b"")  # needs nothing from outside
        assert content.count(b'class="recording"') == 1
        assert len(content) < 400_000  # 20 001 samples are drawn with 2000


def test_two_recordings_over_one_another(file: Path) -> None:
    out = file.with_name("both.html")
    printed("plot", file, "--overlay", file, "--out", out, "--columns", "pos_ref_rad,pos_load_rad")
    data = json.loads(out.read_text("utf-8").partition('class="recording">')[2].partition("</script>")[0])
    (panel,) = data["panels"]
    names = [line["name"] for line in panel["lines"]]
    assert names == [
        "pos_ref_deg",
        "pos_load_deg",
        f"pos_ref_deg ({file.name})",
        f"pos_load_deg ({file.name})",
    ]
    assert panel["lines"][0]["y"] == panel["lines"][2]["y"]
    assert "needs --out NAME.html" in refused(UsageError, "plot", file, "--overlay", file)


def test_the_same_trace_gives_the_same_svg(file: Path) -> None:
    for name in ("a.svg", "b.svg"):
        printed("plot", file, "--columns", "pos_ref_rad", "--out", file.with_name(name))
    assert file.with_name("a.svg").read_bytes() == file.with_name("b.svg").read_bytes()


def test_plot_goes_beside_the_recording_by_default(file: Path) -> None:
    printed("plot", file)
    assert file.with_name("move_0.6.png").exists()


def test_the_overview_shows_what_the_trace_has_with_its_units(file: Path) -> None:
    trace = read_trace(file)
    figure = draw(trace, overview(trace), "title")
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["Angle", "Following error (set-point minus angle)", "Speed", "Motor torque"]
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["angle in deg", "error in mdeg", "speed in deg/s", "torque in N m"]
    assert figure.axes[-1].get_xlabel() == "time in s"
    error = figure.axes[1].lines[0].get_ydata()
    assert np.allclose(error, 2.0)
    assert figure.axes[2].lines[0].get_ydata() == pytest.approx(0.5)


def test_chosen_columns_get_a_diagram_per_unit(file: Path) -> None:
    trace = read_trace(file)
    panels = chosen(trace, ["pos_ref_rad", "torque_act_nm", "pos_load_rad", "axis_state"])
    assert [panel.axis_label for panel in panels] == ["deg", "N m", "number"]
    assert [[line.label for line in panel.lines] for panel in panels] == [
        ["pos_ref_deg", "pos_load_deg"],
        ["torque_act_nm"],
        ["axis_state"],
    ]


def test_drawing_leaves_out_points_but_no_peak(file: Path) -> None:
    trace = read_trace(file)
    trace["axis_state"][12_345] = 99.0
    trace["axis_state"][4_321] = -99.0
    figure = draw(trace, chosen(trace, ["axis_state"]), "title")
    drawn = np.asarray(figure.axes[0].lines[0].get_ydata())
    assert len(drawn) < 10_000
    assert (drawn.min(), drawn.max()) == (-99.0, 99.0)


def test_plot_of_a_part(file: Path) -> None:
    printed("plot", file, "--from", 1, "--to", 2, "--columns", "pos_ref_rad, axis_state")
    assert "no row between 500.0 s and inf s" in refused(UsageError, "plot", file, "--from", 500)
    assert "from 0.000 s to 200.000 s" in refused(UsageError, "plot", file, "--from", 500)
    assert "the end must not be before" in refused(UsageError, "plot", file, "--from", 2, "--to", 1)
    assert "not a finite number" in run("plot", file, "--from", "nan").output


def test_plot_refuses_what_it_cannot_draw(file: Path) -> None:
    assert "no column 'speed'" in refused(UsageError, "plot", file, "--columns", "speed")
    assert "choose columns" in refused(UsageError, "plot", file, "--columns", ",")
    out = file.with_name("x.gif")
    assert ".png, .svg" in refused(UsageError, "plot", file, "--out", out)
    assert "nowhere" in refused(UsageError, "plot", file, "--out", file.parent / "nowhere" / "x.png")


def test_export_as_csv_in_degrees(file: Path) -> None:
    out = file.with_name("move_0.6_deg.csv")
    text = printed("export", file, "--format", "csv", "--degrees")
    assert text == f"wrote {out}: 20001 rows, 6 columns\n"
    header, first, *_ = out.read_text().splitlines()
    assert header == "time_s,pos_ref_deg,vel_ref_deg_s,pos_load_deg,torque_act_nm,axis_state"
    assert [float(cell) for cell in first.split(",")] == pytest.approx([0.0, 0.0, 0.5, -0.002, 3.0, 2.0])


def test_export_of_a_killed_run_as_parquet_is_a_recording_again(live: ArrowRecorder) -> None:
    printed("export", live.live_path, "--format", "parquet")
    again = read_trace(live.path)
    assert again.complete
    assert again.hash() == read_trace(live.live_path).hash()
    assert again.metadata["machine"] == "hust"


def test_export_never_writes_over_the_recording_itself(file: Path) -> None:
    before = file.read_bytes()
    assert "that is the recording itself" in refused(UsageError, "export", file, "--format", "parquet")
    assert file.read_bytes() == before


@pytest.mark.parametrize("arguments", [("show",), ("plot",), ("export", "--format", "csv")])
def test_a_file_that_is_no_recording_is_refused(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    (tmp_path / "x").write_text("hello")
    assert "not a recording" in refused(UsageError, *arguments, tmp_path / "x")
    assert "No such file" in refused(UsageError, *arguments, tmp_path / "missing")
