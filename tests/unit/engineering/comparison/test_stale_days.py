"""Days of a machine in use: the watch of the calibration in the closed loop, on plants that have changed or not.

The whole: `python -m gantryctl.engineering.comparison.stale_days days.jsonl --days 1000`.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import pytest

from gantryctl.engineering.comparison import stale_days
from gantryctl.engineering.comparison.drift_file import DriftRow, load_drift
from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.machine import Machine, with_values
from support.improved import improved_machine


def machine_of(*, encoder: bool) -> Machine:
    machine = improved_machine() if encoder else without_load_encoder(improved_machine())
    return with_values(machine, {"control.scan_period_ms": 4.0})


@cache
def rows() -> dict[str, DriftRow]:
    return {row.name: row for row in load_drift("hust", machine_of(encoder=False)).rows}


def found(name: str, moves: int, *, encoder: bool = False) -> dict[str, int]:
    row = rows().get(name, None)
    (day,) = stale_days.chain_of_days(machine_of(encoder=encoder), row, 0, days=1, moves=moves)
    return day.found


def test_backlash_is_named_by_the_torque_of_the_motor_alone_and_a_sound_machine_is_not() -> None:
    # After 13 to 24 moves, by the angles that are drawn; no encoder on the ring.
    assert set(found("backlash", 36)) == {"backlash"}
    assert found("sound", 36) == {}


def test_a_day_that_is_in_the_file_is_not_computed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    monkeypatch.setattr(stale_days, "chain_of_days", lambda *_: calls.append(1) or [stale_days.Day({}, {})])
    file = tmp_path / "days.jsonl"
    for _ in range(2):
        assert stale_days.main([str(file), "--days", "30"]) == 0
    assert len(calls) == 3
    assert [json.loads(line)["name"] for line in file.read_text().splitlines()] == [
        "sound 0",
        "sound 1",
        "sound 2",
    ]


@pytest.mark.slow  # 13 days and ten more, twice: 80 s of a quiet processor
@pytest.mark.parametrize("encoder", [False, True])
def test_moment_backlash_and_both_together_are_named_within_a_day(*, encoder: bool) -> None:
    for name, wanted in {
        "moment": {"moment"},
        "moment_sign": {"moment"},
        "backlash": {"lost_motion" if encoder else "backlash"},
        "together": {"moment"},
        "together_sign": {"moment"},
    }.items():
        assert wanted <= set(found(name, stale_days.MOVES, encoder=encoder)), name
    days = stale_days.chain_of_days(machine_of(encoder=encoder), None, 7)
    assert days[-1].found == {}
