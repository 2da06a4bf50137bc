"""A file is written whole or not at all."""

from __future__ import annotations

import errno
import gc
import json
import math
import os
import stat
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.errors import StateError
from gantryctl.files import DRAFT_S, indented_json, remove_drafts, write_whole


def test_text_and_bytes_replace_what_was_there_and_leave_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "made" / "record.toml"
    with pytest.raises(StateError, match="No such file or directory"):
        write_whole(path, "0.1 °")
    write_whole(path, "0.1 °", make_folder=True)
    assert path.read_bytes() == "0.1 °".encode()
    write_whole(path, b"\x00\r\n")
    assert path.read_bytes() == b"\x00\r\n"
    assert list(path.parent.iterdir()) == [path]


def test_only_its_user_reads_a_private_file(tmp_path: Path) -> None:
    write_whole(tmp_path / "users", "x", private=True)
    assert stat.S_IMODE((tmp_path / "users").stat().st_mode) == 0o600


@pytest.mark.parametrize("fails", ["fsync", "replace"])
def test_a_write_that_fails_leaves_the_old_file_whole_and_nothing_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    path = tmp_path / "record.toml"
    write_whole(path, "old")

    def no_space(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, fails, no_space)
    monkeypatch.setattr(Path, "replace", os.replace)
    with pytest.raises(StateError, match=r"record\.toml: cannot be written: No space left on device"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_the_file_and_its_folder_are_on_the_disk_in_this_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synchronised: list[bool] = []

    def note(handle: int) -> None:
        synchronised.append(stat.S_ISDIR(os.fstat(handle).st_mode))
        assert (tmp_path / "record").exists() == synchronised[-1]

    monkeypatch.setattr(os, "fsync", note)
    write_whole(tmp_path / "record", "x")
    assert synchronised == [False, True]


def test_what_a_killed_writer_left_is_removed_and_what_may_still_be_written_stays(tmp_path: Path) -> None:
    old, fresh, kept = (tmp_path / name for name in ("a.toml.1234.part", "b.toml.part", "c.toml"))
    for path in (old, fresh, kept):
        path.write_text("x")
    long_ago = time.time() - DRAFT_S - 1.0
    for path in (old, kept):
        os.utime(path, (long_ago, long_ago))
    remove_drafts(tmp_path)
    remove_drafts(tmp_path / "missing")
    assert sorted(tmp_path.iterdir()) == [fresh, kept]


def test_a_folder_that_is_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("x")
    with pytest.raises(StateError, match=r"state/record: cannot be written"):
        write_whole(tmp_path / "state" / "record", "x", make_folder=True)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner) | st.tuples(inner, inner),
    max_leaves=20,
)


@given(JSON)
def test_json_has_the_text_of_the_standard_library(value: object) -> None:
    """Check sums are of the text: files of the state that were written before are read."""
    assert indented_json(value) == json.dumps(value, indent=1)


def test_json_leaves_nothing_to_collect_and_refuses_what_is_none() -> None:
    gc.collect()
    gc.disable()
    try:
        indented_json({"a": [{}, [], (1.5, None)]})
        assert gc.collect() == 0
        json.dumps({}, indent=1)
        assert gc.collect() > 0, "the standard library has no cycles any more: use it"
    finally:
        gc.enable()
    with pytest.raises(ValueError, match="not JSON compliant"):
        indented_json([math.nan], allow_nan=False)
    with pytest.raises(TypeError, match="not JSON serializable"):
        indented_json({"a": b""})
