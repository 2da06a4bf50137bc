"""Days of a machine in use: the watch of the calibration in the closed loop, on plants that have changed or not.

The whole: `gantryctl compare --stale-days 1000 --out DIR`.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gantryctl.engineering.comparison import stale_days, stale_report
from gantryctl.engineering.comparison.drift_file import DriftRow, load_drift
from gantryctl.engineering.comparison.variants import without_load_encoder
from gantryctl.machine import Machine, with_values
from gantryctl.program.monitors.calibration_watch import Finding
from gantryctl.units import deg
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
    # After some 40 moves: nothing that goes with the temperature of the gears is judged before the memory is 68 % full.
    assert set(found("backlash", 60)) == {"backlash"}
    assert found("sound", 60) == {}


def days_by_hand(monkeypatch: pytest.MonkeyPatch) -> list[tuple[bool, str, int, int]]:
    """Days that nobody simulates; what was asked for: load encoder read, row, chain, length."""
    asked = []

    def chain(machine: Machine, row: DriftRow | None, number: int, length: int) -> list[stale_days.Day]:
        encoder = machine.control.compensation.load_encoder.active
        asked.append((encoder, "sound" if row is None else row.name, number, length))
        found = {"moment": 2} if row is not None and encoder else {}
        return [stale_days.Day(found, {"moment": Finding(10.0 * number + k, 100.0)}) for k in range(length)]

    monkeypatch.setattr(stale_report, "chain_of_days", chain)
    return asked


def test_days_that_are_in_the_file_are_not_computed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, machine = days_by_hand(monkeypatch), improved_machine()
    first = stale_report.stale_report(machine, 13, folder=tmp_path)
    assert asked == [(ring, "sound", *chain) for ring in (False, True) for chain in ((0, 10), (1, 3))]
    file = tmp_path / stale_report.FILE
    text = file.read_text()
    # A kill in the middle of a line, and more days than before: the torn chain and the longer ones anew.
    file.write_text(text[: text.rindex("\n", 0, -1) + 9])
    asked.clear()
    again = stale_report.stale_report(machine, 13, folder=tmp_path)
    assert asked == [(True, "sound", 1, 3)]
    assert (again, file.read_text()) == (first, text)
    asked.clear()
    longer = stale_report.stale_report(machine, 15, folder=tmp_path)
    assert asked == [(False, "sound", 1, 5), (True, "sound", 1, 5)]
    assert longer.figures[machine.name][0].days == 15
    # Days of another plant are others'.
    asked.clear()
    stale_report.stale_report(with_values(machine, {"plant.load.mass_kg": 2.1e5}), 10, folder=tmp_path)
    assert len(asked) == 2


def test_a_report_has_what_came_closest_to_its_bound_and_every_chain_that_warned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    days_by_hand(monkeypatch)
    machine = improved_machine()
    sound = stale_report.stale_report(machine, 13)
    assert sound.passed
    assert sound.figures[machine.name][0].largest == {"moment": Finding(12.0, 100.0)}
    drift = load_drift("hust", machine)
    changed = stale_report.stale_report(machine, 13, drift)
    use = changed.figures[machine.name][0]
    assert (use.days, use.found) == (13, {"moment": (2, 2)})
    assert changed.passed
    data = stale_report.stale_data(changed)["rows"][0]
    assert data["name"] == "moment"
    assert data["controls"][machine.name] == {
        "days": 13,
        "found_after_moves": {"moment": [2, 2]},
        "largest": {"moment": {"measured": 12.0, "bound": 100.0, "unit": "N m"}},
    }
    assert data["controls"]["without the load encoder"]["found_after_moves"] == {}
    cells = stale_report.stale_table(changed).rows[1]
    assert "moment after 2 to 2 moves, 2 times" in cells
    # 12 of 100 N m: a small axis reads more than 0.0 of 0.1.
    assert "moment 0.012 of 0.10 kN m" in cells
    monkeypatch.setattr(stale_report, "chain_of_days", lambda *_: [stale_days.Day({"backlash": 9}, {})])
    assert not stale_report.stale_report(machine, 1).passed


def test_a_cold_row_stays_cold_while_the_day_goes_up_and_down() -> None:
    machine = machine_of(encoder=False)
    usual, cold = (
        [
            session.machine.plant.thermal.gears_start_k
            for session in stale_days._sessions(machine, row, np.random.default_rng(3), (0,), 6)
        ]
        for row in (None, rows()["colder"])
    )
    assert max(usual) - min(usual) > 5.0
    assert cold == pytest.approx([each - 5.0 for each in usual])


@pytest.mark.parametrize(("low", "high"), [(-180.0, 180.0), (-5.0, 95.0)])
def test_a_day_in_use_stays_within_the_travel_of_its_axis_and_uses_it(low: float, high: float) -> None:
    """60 angles drawn evenly leave an end untouched by a quarter of the way once in 3e7 days (0.75 ** 60)."""
    beyond = {"pos": 0.0, "over_travel": 0.5, "limit_switch": 2.0, "mechanical_stop": 7.0}
    travel = {f"axis.{what}_min_deg": low - at for what, at in beyond.items()}
    travel |= {f"axis.{what}_max_deg": high + at for what, at in beyond.items()}
    machine = with_values(machine_of(encoder=False), travel)
    ends = [
        deg(each)
        for session in stale_days._sessions(machine, None, np.random.default_rng(3), (0,), 60)
        for each in (session.start_rad, *(leg.plan.pos_end for leg in session.legs))
    ]
    assert low < min(ends) < low + 0.25 * (high - low)
    assert high - 0.25 * (high - low) < max(ends) < high


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
