"""`gantryctl.move`: a whole move in one call, for scripts and notebooks."""

from __future__ import annotations

import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

import gantryctl
from gantryctl.errors import AlarmStop, CommandRefused, UsageError
from gantryctl.machine import with_values
from gantryctl.operation import scripting
from gantryctl.operation.run import AxisRun
from gantryctl.operation.scripting import load_program

IDEAL = with_values(gantryctl.default_machine(), {"drive.kind": "ideal"})


def test_a_move_returns_summary_and_trace() -> None:
    result = gantryctl.move(gantryctl.default_machine(), 2.0, speed_deg_s=3.0)
    assert result.summary.end_deg == pytest.approx(2.0, abs=1e-3)
    assert result.summary.peak_deg_s <= 3.0
    assert result.summary.following_error_load_deg is not None
    assert result.trace["pos_act_rad"][-1] == pytest.approx(0.0349, abs=1e-3)


def test_several_moves_are_one_recording_and_the_summary_is_of_the_last() -> None:
    result = gantryctl.move(gantryctl.default_machine(), 1.0, 0.5)
    assert result.summary.start_deg == pytest.approx(1.0, abs=1e-3)
    assert result.summary.end_deg == pytest.approx(0.5, abs=1e-3)
    assert result.trace["pos_ref_rad"].max() == pytest.approx(0.01745, abs=1e-4)


def test_a_target_beyond_the_travel_is_an_exception() -> None:
    with pytest.raises(CommandRefused, match="beyond"):
        gantryctl.move(gantryctl.default_machine(), 200.0)


def test_an_alarm_is_an_exception() -> None:
    tight = with_values(gantryctl.default_machine(), {"control.kvf": 0.0})
    with pytest.raises(AlarmStop, match="CTL-03"):
        gantryctl.move(tight, 60.0)


def test_every_name_of_the_api_can_be_had() -> None:
    for name in gantryctl.__all__:
        assert getattr(gantryctl, name) is not None
    assert dir(gantryctl) == sorted(gantryctl.__all__), "nothing but the public names"
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = gantryctl.nothing


def test_what_scripts_get_shows_itself_in_a_notebook() -> None:
    machine = gantryctl.default_machine()
    result = gantryctl.move(machine, 1.0)
    engine = gantryctl.build_engine(machine, recorder=gantryctl.MemoryRecorder)
    engine.run_for(0.1)
    assert len(engine.trace()) == 100
    shown = {
        "hust_gantry": machine,
        "following error": result,
        "load side": result.summary,
        "100 scans": engine,
        "jog-release": gantryctl.stop_table(machine, (1.0,)),
        "A as measured": gantryctl.run_accuracy(machine, speed_test=False),
    }
    for words, each in shown.items():
        page = each._repr_html_()
        assert words in page, page
        assert "<script" not in page
        assert len(page) < 8000


def test_an_engine_without_a_recording_in_memory_says_how_to_get_one() -> None:
    with pytest.raises(UsageError, match="recorder=MemoryRecorder"):
        gantryctl.build_engine(gantryctl.default_machine()).trace()


def test_without_a_name_the_program_is_the_shipped_one() -> None:
    assert load_program(None) is gantryctl.GantryProgram


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mine.py", "write FILE:CLASS"),
        ("mine.py:1", "write FILE:CLASS"),
        ("other.py:Mine", "there is no file"),
        ("mine.txt:Mine", "is not a Python file"),
        ("broken.py:Mine", "cannot be run: ZeroDivisionError"),
        ("leaves.py:Mine", "cannot be run: SystemExit"),
        ("mine.py:Nothing", "has no class Nothing derived from gantryctl.AxisProgram"),
        ("mine.py:NUMBER", "has no class NUMBER derived"),
        ("mine.py:Plain", "has no class Plain derived"),
    ],
)
def test_what_is_no_program_is_refused_with_the_reason(
    name: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = "from gantryctl import AxisProgram\nNUMBER = 1\nclass Plain: pass\nclass Mine(AxisProgram): pass\n"
    for file in ("mine.py", "mine.txt"):
        Path(file).write_text(text, encoding="utf-8")
    Path("broken.py").write_text("1 / 0\n", encoding="utf-8")
    Path("leaves.py").write_text("raise SystemExit\n", encoding="utf-8")
    monkeypatch.setattr(sys, "modules", dict(sys.modules))
    assert load_program("mine.py:Mine").__name__ == "make"
    with pytest.raises(UsageError, match=re.escape(words)):
        load_program(name)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("pass", "must call super().__init__(axis)"),
        ("self.axis = None", "must call super().__init__(axis)"),
        ("self.axis = axis", "must call super().__init__(axis)"),
        ("super().__init__(axis); self.axis = None", "must call super().__init__(axis)"),
        ("raise SystemExit", "(axis) failed: SystemExit"),
        ("super().__init__(axis)", ""),
    ],
)
def test_a_program_that_does_not_take_its_axis_is_refused(
    body: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        f"import gantryctl\nclass Mine(gantryctl.AxisProgram):\n  def __init__(self, axis):\n    {body}\n"
    )
    monkeypatch.setattr(sys, "modules", dict(sys.modules))
    make = load_program(f"{file}:Mine")
    axis = gantryctl.build_engine(IDEAL).program.axis
    if words:
        with pytest.raises(UsageError, match=re.escape(words)):
            make(axis)
    else:
        assert make(axis).axis is axis


@pytest.mark.parametrize("target_deg", [0.5, 200.0])
def test_a_script_leaves_the_axis_without_power_whatever_came_of_its_moves(
    target_deg: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[AxisRun] = []

    class Watched(AxisRun):
        def close(self, *given: Any) -> None:
            super().close(*given)
            runs.append(self)

    monkeypatch.setattr(scripting, "AxisRun", Watched)
    with suppress(CommandRefused):
        gantryctl.move(IDEAL, target_deg)
    assert [run.axis.is_off for run in runs] == [True]


def test_a_script_without_a_move_is_a_summary_of_standing() -> None:
    summary = gantryctl.move(IDEAL).summary
    assert (summary.start_deg, summary.duration_s, summary.peak_deg_s) == (
        pytest.approx(0.0, abs=1e-6),
        0.0,
        0.0,
    )
