"""`gantryctl state`: everything is listed before it is removed, and nothing that somebody uses or that is another's."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.machine import default_machine
from gantryctl.operation.store import StateStore
from support.command_line import cli, done, refused


def test_what_is_there_is_listed_and_then_gone(state: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = state / "hust_gantry"
    assert "nothing to remove" in done("state", "remove").out
    done("move", "0.1")
    shown = done("state", "show").out
    for name in ("plant.json", "retain", "traces"):
        assert name in shown
    assert str(folder) in shown
    assert "recordings" in shown
    assert "keep.txt" not in shown
    (state / "keep.txt").write_text("of somebody else", encoding="utf-8")
    monkeypatch.setattr("click.confirm", lambda *_, **__: False)
    answer = cli("state", "remove")
    assert answer.code == 2
    assert "plant.json" in answer.err
    assert "nothing is removed" in answer.err
    assert (folder / "plant.json").is_file()
    answer = cli("state", "remove", "--yes")
    assert answer.code == 0
    assert "removed" in answer.out
    assert not folder.exists()
    assert [path.name for path in state.iterdir()] == ["keep.txt"]


def test_a_state_that_is_used_is_not_removed(state: Path) -> None:
    done("move", "0.1")
    with StateStore(default_machine()):
        answer = cli("state", "remove", "--yes")
    assert answer.code == 3
    assert "in use by process" in answer.err
    assert (state / "hust_gantry" / "plant.json").is_file()


def test_a_directory_of_somebody_else_is_left_alone(state: Path) -> None:
    folder = state / "hust_gantry"
    folder.mkdir(parents=True)
    (folder / "thesis.txt").write_text("a year's work", encoding="utf-8")
    assert "left alone" in refused("state", "remove", "--yes")
    assert (folder / "thesis.txt").is_file()
