"""Key figures of a log that is written by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.accuracy.procedure.plan import chord_test
from gantryctl.engineering.batch.loop import Log
from gantryctl.engineering.comparison import key_figures, on_bus, profiles, stale_report, text
from gantryctl.engineering.comparison.drift_file import Change, DriftRow
from gantryctl.engineering.comparison.stale_days import Day
from gantryctl.engineering.identification.samples import MoveLog
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.program.monitors.calibration_watch import Finding


def test_the_figures_of_a_move() -> None:
    """1 s rest, 1 s motion, 6 s rest at 10 ms. The load swings by 0.01 deg 0.1 s and 0.5 s after the end."""
    machine = default_machine()
    columns = key_figures._COLUMNS
    log = {name: np.zeros(802) for name in columns}
    # The move ends with row 201: row 100 is its first.
    log["pos_load_rad"][[201 + 10, 201 + 50]] = math.radians(0.01)
    log["vel_load_rad_s"][150] = math.radians(-2.0)
    log["vel_motor_rad_s"][160] = math.radians(-3.0) * machine.axis.ratio
    log["torque_mesh_nm"][[140, 170]] = 1e6, -4e6
    found = key_figures._evaluate(machine, Log(np.stack(list(log.values())), 0.01, columns), 1.0)
    assert found.settling_s == pytest.approx(0.51)
    assert found.load_error_deg_s == pytest.approx(2.0)
    assert found.motor_error_deg_s == pytest.approx(3.0)
    # 4000 kN m at the gantry; the output of the reducer turns faster by the ratio of ring and pinion.
    assert found.reducer_knm == pytest.approx(4e3 / machine.axis.ring_ratio)


@pytest.mark.parametrize(("lost", "motor_nm"), [("none", 155.0), ("second", 260.0)])
def test_the_torque_of_a_move_is_that_of_one_motor(lost: str, motor_nm: float) -> None:
    """Two motors share 260 N m and push against each other with 25; one that is alone has all of it."""
    machine = with_values(
        default_machine(),
        {
            "plant.switches.second_pinion": True,
            "plant.second_pinion.preload_nm": 25.0,
            "plant.second_pinion.lost": lost,
        },
    )
    log = {name: np.zeros(802) for name in key_figures._COLUMNS}
    log["torque_act_nm"][[150, 160]] = 120.0, -260.0
    found = key_figures._evaluate(machine, Log(np.stack(list(log.values())), 0.01, key_figures._COLUMNS), 1.0)
    assert found.motor_nm == pytest.approx(motor_nm)


def chords_of(
    monkeypatch: pytest.MonkeyPatch, errors_deg: dict[int, float], noise_um: float
) -> key_figures.ChordTest:
    """Procedure A of a gantry that stands beside its targets by so much at these stops, and exactly at all others."""
    machine = with_values(default_machine(), {"accuracy.tracker_noise_um": noise_um})
    angles = chord_test(machine, "A").targets_rad.copy()
    for stop, error_deg in errors_deg.items():
        angles[stop] += math.radians(error_deg)
    seen = SimpleNamespace(load_rad=angles[None, :])
    monkeypatch.setattr(key_figures, "run_procedure", lambda *some, **more: seen)
    (found,) = key_figures.chord_tests([machine], "A", [7])
    return found


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_largest_angle_error_counts_in_both_directions(
    monkeypatch: pytest.MonkeyPatch, side: float
) -> None:
    found = chords_of(monkeypatch, {2: side * 0.02, 4: -side * 0.005}, 0.0)
    assert found.largest_angle_deg == pytest.approx(0.02)
    # A chord from a stop at its target to one that is 0.02 deg beside it.
    assert found.largest_chord_deg >= 0.019


def test_the_largest_chord_is_also_that_which_an_instrument_would_have_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A gantry without any error: what is left is the noise of the tracker, at the radius of its reflector."""
    machine = default_machine()
    one_deg = math.degrees(20e-6 / machine.accuracy.chord_radius_m)
    found = chords_of(monkeypatch, {}, 20.0)
    assert found.a_true_deg == pytest.approx(0.0, abs=1e-9)
    assert found.largest_angle_deg == 0.0
    # The largest of tens of readings of two points each: beyond one standard deviation, not beyond ten.
    assert one_deg < found.largest_chord_deg < 10.0 * one_deg


@pytest.mark.parametrize(
    ("name", "wind_um", "base_um", "acc_deg_s2", "kept"),
    [
        # A base that moves by 10 um for 1 deg/s2.
        ("rotary_table", 0.0, 240.0, 24.0, True),
        # Nothing binds but the quick stop, beyond which the rules of a machine let no normal ramp.
        ("rotary_table", 0.0, 2400.0, 97.06, True),
        # In a wind that moves it by 48 um no acceleration keeps 39 um.
        ("azimuth_dish", 48.0, 39.0, 0.02 * 1.168, False),
    ],
)
def test_profiles_are_searched_between_nothing_and_the_quick_stop_of_their_axis(
    monkeypatch: pytest.MonkeyPatch, name: str, wind_um: float, base_um: float, acc_deg_s2: float, kept: bool
) -> None:
    """Twelve halvings of a factor of 50 find an acceleration to 0.1 %."""
    machine = load_machine(configs_folder() / f"{name}.toml")

    def moved(moves: list[key_figures.Move]) -> list[key_figures.MoveFigures]:
        # Each is a machine that its rules let pass.
        accs = [move.machine.virtual_axis.acc_deg_s2 for move in moves]
        return [key_figures.MoveFigures(1.0, 0.0, 0.0, max(wind_um, 10.0 * acc), *4 * [0.0]) for acc in accs]

    monkeypatch.setattr(profiles, "moves_figures", moved)
    for row in profiles.profiles_at_equal_base_motion(machine, machine, base_um):
        assert row.acc_deg_s2 == pytest.approx(acc_deg_s2, rel=2e-3)
        assert row.kept is kept


def test_a_small_axis_has_figures_and_no_zeros_in_the_table_of_the_rows() -> None:
    """0.0106 kN m and 0.44 um; a column of a large axis has the digits that it always had."""
    small = key_figures.KeyFigures._make(1.0 for _ in key_figures.KEY_FIGURES)
    small = small._replace(reducer_knm=0.0106, base_um=0.44)
    report: Any = SimpleNamespace(first="a", second="b", rows=(("one", small), ("two", small)))
    table = text._rows(report)
    cells = dict(zip(table.heads, table.rows[0], strict=True))
    assert cells["reducer\nkN m"] == "0.011"
    assert cells["base\num p-p"] == "0.44"
    assert cells["A true\nproc. A"] == "1.0000"


def test_two_changes_of_one_key_are_made_one_after_the_other() -> None:
    """2.18e6 kg m2, a tenth more, and 1e5 on top."""
    key = "plant.load.inertia_kg_m2"
    row = DriftRow("heavier", "", (Change(key, "times", 1.1), Change(key, "plus", 1e5)))
    assert row.on(default_machine()).plant.load.inertia_kg_m2 == pytest.approx(1.1 * 2.18e6 + 1e5)


@pytest.mark.parametrize(("lag_deg", "error_deg_s"), [(0.0, 0.0), (0.002, 0.05)])
def test_a_load_that_goes_with_its_set_point_has_no_speed_error_on_a_bus(
    lag_deg: float, error_deg_s: float
) -> None:
    """0.9 deg/s2 for 1 s in scans of 4 ms, read every tenth: a t^2 / 2 is on the way. 2 mdeg behind at one reading are
    0.05 deg/s over the 40 ms from the one before.
    """
    time_s = 0.004 * np.arange(251)
    load = np.radians(0.45 * time_s**2)
    load[100] -= math.radians(lag_deg)
    read = np.where(np.arange(251) % 10 == 0, load, np.nan)
    still = np.zeros(251)
    log = MoveLog(0.004, still, read, still, np.radians(0.9 * time_s), still, still, 20, 1e-6)
    assert on_bus._load_error_deg_s(log) == pytest.approx(error_deg_s, abs=1e-9)


def test_a_day_tells_of_the_last_one_of_its_chain_what_was_found() -> None:
    """Nothing on the first day, the moment after 70 moves on the second; another chain never."""
    found = Day({"moment": 70}, {})
    use = stale_report._in_use([[Day({}, {}), found], [Day({}, {}), Day({}, {})]])
    assert (use.days, use.found) == (4, {"moment": (70,)})


def test_what_came_nearest_to_its_bound_may_be_negative_and_its_bound_its_own() -> None:
    """0.5 of 1, -0.9 of 1 and 0.6 of 0.625 days later: the last, 0.96 of its bound, whatever is larger."""
    days = [
        Day({}, {"backlash": Finding(*each)}) for each in ((0.5, 1.0), (-0.9, 1.0), (0.6, 0.625), (0.8, 1.0))
    ]
    assert stale_report._in_use([days]).largest == {"backlash": Finding(0.6, 0.625)}
    assert stale_report._in_use([days[:2]]).largest == {"backlash": Finding(-0.9, 1.0)}


def test_a_person_is_told_all_of_the_way_that_a_comparison_on_a_bus_goes() -> None:
    """Chords from -30 to 30 deg, then moves from -90 to 90. Of the paper 537 s of chords and 2 x 75.5 of moves."""
    machine = default_machine()
    assert on_bus.moves_text(machine).startswith("moves from -110 to 110 deg and back for 11 minutes")
    near = with_values(
        machine, {"accuracy.bases_deg": [10.0, -10.0], "accuracy.displacements_deg": [10.0, 20.0]}
    )
    assert chord_test(near, "A").travel_deg == (-30.0, 30.0)
    assert on_bus.moves_text(near).startswith("moves from -90 to 90 deg and back")
