"""The watch over the files of the journal, and what a copy of it may show, by hand."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.service.recorder.journal.reading import copy_journal
from gantryctl.service.recorder.journal.watch import Change, FileWatch, _identity
from gantryctl.service.recorder.journal.writer import Journal


def test_a_file_that_grew_and_was_cut_back_is_cut(tmp_path: Path) -> None:
    """None of these files ever shrinks while it is open: the size of the last look counts, not that of the start."""
    path = tmp_path / "mirror"
    path.write_bytes(b"x" * 10)
    watch = FileWatch(tmp_path, [path, tmp_path / "not there"])
    for size, changes in ((20, []), (20, []), (15, [Change.CUT]), (15, []), (30, [])):
        os.truncate(path, size)
        assert [each.change for each in watch.look()] == changes
    watch.close()


def test_a_directory_that_is_moved_while_it_is_looked_at_is_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its files are gone too then: written anew, they would begin a second state directory in its place."""
    state = tmp_path / "state"
    state.mkdir()
    (state / "journal").write_bytes(b"x")
    watch, look_at = FileWatch(state, [state / "journal"]), os.lstat

    def moved(path: Path) -> os.stat_result:
        if state.exists():
            state.rename(tmp_path / "away")
        return look_at(path)

    monkeypatch.setattr(os, "lstat", moved)
    for _ in range(2):
        assert [(each.change, each.path) for each in watch.look()] == [(Change.MOVED, state)]
    (tmp_path / "away").rename(state)
    monkeypatch.undo()
    assert watch.look() == []
    (state / "journal").unlink()
    assert [each.change for each in watch.look()] == [Change.GONE]
    watch.close()


def test_a_file_of_another_disk_may_have_the_same_number() -> None:
    one, other = (SimpleNamespace(st_dev=device, st_ino=7) for device in (1, 2))
    found: list[Any] = [_identity(each) for each in (one, other)]  # type: ignore[arg-type]
    assert found[0] != found[1]
    assert _identity(SimpleNamespace(st_dev=1, st_ino=8)) != found[0]  # type: ignore[arg-type]


@pytest.mark.usefixtures("keys")
def test_a_copy_is_for_its_owner_and_its_group(tmp_path: Path) -> None:
    Journal(tmp_path).close()
    before = os.umask(0)
    try:
        copy_journal(tmp_path / "journal.sqlite", tmp_path / "copy.sqlite")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "copy.sqlite").stat().st_mode) == 0o640
