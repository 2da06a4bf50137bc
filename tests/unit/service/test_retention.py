"""Retention of journal and recordings: which room is short, which options contradict each other, whose disk it is."""

from __future__ import annotations

import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.errors import UsageError
from gantryctl.service.recorder.retention import MB, RetentionPolicy, free_of


@pytest.mark.parametrize(("free_mb", "shortage"), [(64.0, 0), (63.9, 1), (16.0, 1), (15.9, 2), (0.0, 2)])
def test_recordings_end_before_events(free_mb: float, shortage: int) -> None:
    assert RetentionPolicy().shortage(free_mb) == shortage


@pytest.mark.parametrize(("reserve", "events", "right"), [(17, 16, True), (16, 16, True), (15, 16, False)])
def test_a_reserve_of_recordings_below_that_of_events_is_refused(
    reserve: int, events: int, right: bool
) -> None:
    policy = RetentionPolicy(reserve_mb=reserve, event_reserve_mb=events)
    if right:
        assert policy.checked() is policy
    else:
        with pytest.raises(UsageError, match="recordings must end before events"):
            policy.checked()


def test_the_recorder_reads_what_the_service_wrote() -> None:
    policy = RetentionPolicy(1, 2, 3, 4, 5, 6, 7)
    assert RetentionPolicy.from_json(policy.to_json()) == policy


def test_the_disk_is_that_of_the_directory_or_of_what_is_left_above_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []

    def usage(place: Path) -> SimpleNamespace:
        asked.append(place)
        return SimpleNamespace(free=7)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    directory = tmp_path / "state" / "machine"
    free = free_of(directory)
    directory.mkdir(parents=True)
    assert free() == 7
    directory.rmdir()
    assert free() == 7
    assert asked == [directory, tmp_path / "state"]


def test_sizes_are_in_mb_of_2_to_the_20_bytes() -> None:
    """As the files that they limit are counted, and the free room of a disk."""
    assert MB == 1_048_576
