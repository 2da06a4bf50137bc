"""What the tuning of a small axis reads like: figures of a rotary table, made by hand."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.analysis.measured.response import Condition
from gantryctl.engineering.tuning import by_margins, on_bus
from gantryctl.engineering.tuning.bench import TrialMove
from gantryctl.engineering.tuning.by_margins import Designed
from gantryctl.engineering.tuning.gains import Gains, configured, machine_with
from gantryctl.engineering.tuning.on_bus import moves_text
from gantryctl.engineering.tuning.text import move_rows, sentences
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.machine.places import one_flank_deg

BEYOND = {"pos": 20.0, "over_travel": 20.5, "limit_switch": 22.0, "mechanical_stop": 27.0}
SHORT = with_values(
    default_machine(),
    {
        f"axis.{what}_{side}_deg": sign * at
        for what, at in BEYOND.items()
        for side, sign in (("min", -1), ("max", 1))
    },
)
MOVE = TrialMove(0.0, 0.0069, 0.5271, 0.53, 1.24, 0.031, 0.6, 0.312, 8.0, 3.91, False)


def test_a_small_axis_has_figures_and_no_zeros() -> None:
    """1.24 and 0.031 um, 0.312 N m; 165 um of a gantry have no decimals."""
    rows = move_rows(MOVE)
    assert rows["base motion, um p-p"] == "1.2"
    assert rows["residual base motion, um p-p"] == "0.031"
    assert rows["largest torque, N m"] == "0.31"
    assert move_rows(MOVE._replace(base_um=165.4))["base motion, um p-p"] == "165"


def test_what_an_encoder_step_permits_of_a_small_motor_is_no_zero() -> None:
    """1 % of 0.64 N m over one step in a drive cycle, 0.0959 rad/s: Kvp up to 0.06675."""
    designed = Designed(Gains(0.06, 0.028, 9.4, 1.0, 24.0), 24, 0.06675)
    tuning: Any = SimpleNamespace(tuned=None, designed=designed, candidates=())
    assert sentences(tuning)[0].endswith("one encoder step permits Kvp up to 0.06675.")


def test_a_person_is_told_where_a_measurement_goes_on_this_axis_and_how_hard() -> None:
    """0.15 of the rated torque, 257 and 0.64 N m; at 1 and 1.195 deg/s for 100 s at most, from 60 deg on."""
    gantry, table, tilt = (
        moves_text(each)
        for each in (default_machine(), load_machine(configs_folder() / "rotary_table.toml"), SHORT)
    )
    assert gantry.startswith("moves to 60 deg, turns slowly to 160 deg at most and stands at 75 deg")
    assert "+-38.5 N m" in gantry
    assert "to 179.5 deg at most" in table
    assert "+-0.096 N m" in table
    begin, end, stands = (float(each) for each in re.findall(r"(-?\d+\.?\d*) deg", tilt))
    low, high = SHORT.axis.pos_min_deg, SHORT.axis.pos_max_deg
    assert low < begin < end < high
    assert low < stands < high


def test_the_position_loop_is_measured_where_the_gears_of_this_axis_stay_on_one_flank(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """75 deg on the reference gantry, which an axis of -20 to 20 deg does not reach."""
    asked: list[float] = []

    def measured(machine: Machine, run: object, condition: Condition) -> Any:
        asked.append(condition.angle_deg)
        return SimpleNamespace(
            trusted=np.ones(1),
            measured=SimpleNamespace(position_open=np.array([0.5]), hz=np.array([1.0])),
        )

    run: Any = SimpleNamespace(**dict.fromkeys(("move", "begin_move", "follow", "halt"), lambda *_: None))
    monkeypatch.setattr(on_bus, "measure_on", measured)
    monkeypatch.setattr(on_bus, "EngineProbe", lambda *_: None)
    monkeypatch.setattr(on_bus, "measured_speed_loop", lambda *_: None)
    for machine in (default_machine(), SHORT):
        on_bus.measured_drive(machine, run)
    assert asked == [75.0, one_flank_deg(SHORT)]
    assert SHORT.axis.pos_min_deg < asked[1] < SHORT.axis.pos_max_deg


def test_the_dead_time_of_a_bus_is_no_lag_of_the_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    """What scan and speed loop of the model have of their own is not had once more in its current loop."""
    machine = load_machine(configs_folder() / "hust_can.toml")
    numbers = {"motor_inertia_kg_m2": 0.4, "inertia_kg_m2": 600_000.0}
    calibration = SimpleNamespace(number=numbers.__getitem__)
    monkeypatch.setattr(on_bus, "check_calibration", lambda *_: calibration)
    cycle_s, latency_s = 1e-6 * machine.drive.speed_loop.cycle_us, 1e-6 * machine.plant.encoder.latency_us
    own_s = 1.5 * cycle_s + latency_s
    assert machine.control.scan_period_ms == 4.0
    assert machine.drive.speed_loop.delay_cycles == 1
    loop: Any = SimpleNamespace(kvp_nm_s_per_rad=50.0, tvi_s=0.02, dead_time_s=0.004 + own_s + 0.001)
    found = on_bus.measured_machine(machine, loop, "")
    # A lag of 1 ms is a bandwidth of 159 Hz.
    assert found.drive.current_loop.bandwidth_hz == pytest.approx(159.155, rel=1e-4)
    assert found.drive.speed_loop.tvi_ms == pytest.approx(20.0)


def test_a_tuned_acceleration_is_that_of_both_ends_of_a_move() -> None:
    machine = default_machine()
    tuned = machine_with(machine, replace(configured(machine), acc_deg_s2=0.123))
    assert (tuned.virtual_axis.acc_deg_s2, tuned.virtual_axis.dec_deg_s2) == (0.123, 0.123)
    apart = with_values(machine, {"virtual_axis.dec_deg_s2": 0.2})
    kept = machine_with(apart, configured(apart)).virtual_axis
    assert (kept.acc_deg_s2, kept.dec_deg_s2) == (machine.virtual_axis.acc_deg_s2, 0.2)


@pytest.mark.parametrize("kpp_per_s", [5.0, 20.0])
def test_the_second_half_judges_the_proposed_kpp_and_no_other(kpp_per_s: float) -> None:
    machine = with_values(default_machine(), {"control.kpp_per_s": kpp_per_s})
    run: Any = SimpleNamespace(drive=SimpleNamespace(identity=lambda: SimpleNamespace(encoder_serial="e")))
    session: Any = SimpleNamespace(
        machine=machine.name, drive="e", proposal=replace(configured(machine), kpp_per_s=10.0)
    )
    with pytest.raises(UsageError, match=f"kpp_per_s = {kpp_per_s:g}, proposed are 10 /s"):
        on_bus.end(machine, run, session)


def test_the_plant_that_breaks_a_condition_most_is_searched_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """What holds on it holds on the others too: one round more, not one for each of them."""

    class Search:
        def __init__(self, *_: object) -> None:
            self.plants: list[float] = []

        def best(self) -> float:
            return max(self.plants, default=0.0)

        def excess(self, gains: float, plants: list[float]) -> float:
            return plants[0] - gains

    monkeypatch.setattr(by_margins, "_Search", Search)
    monkeypatch.setattr(by_margins, "_encoder_limit", lambda *_: None)
    monkeypatch.setattr(by_margins, "uncertain_plants", lambda *_: [])
    plants: Any = [0.2, 0.3, 0.1]
    found = by_margins.by_margins(default_machine(), plants=plants)
    assert found[:2] == (0.3, 1)
