"""What a trial of the tuning is made of, and what ends one, by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.batch import Log
from gantryctl.engineering.tuning import bench, judge
from gantryctl.engineering.tuning.bench import Bench, PositionStep, SpeedStep, TrialMove
from gantryctl.engineering.tuning.by_margins import STATED, _Search
from gantryctl.engineering.tuning.gains import POOR, Gains, configured
from gantryctl.engineering.tuning.procedure import Tuned, paper_procedure
from gantryctl.machine import configs_folder, default_machine, load_machine
from gantryctl.units import rad

NOTHING = np.zeros(1)


class Quiet(Bench):
    """An axis that bears everything but an acceleration above 0.5 deg/s2, by its base."""

    reducer_nm_per_deg_s2 = 0.0
    limited_from_kvf = 2.0

    def speed_step(self, gains: Gains) -> SpeedStep:
        return SpeedStep(NOTHING, NOTHING, gains.kvp_nm_s_per_rad / 1e3 + 1e-3 / gains.tvi_s, False)

    def position_step(self, gains: Gains) -> PositionStep:
        return PositionStep(NOTHING, NOTHING, NOTHING, 0.0, gains.kpp_per_s / 100.0, False)

    def move(self, gains: Gains, way_deg: float = 90.0) -> TrialMove:
        acc, limited = gains.acc_deg_s2, gains.kvf >= self.limited_from_kvf
        reducer = self.reducer_nm_per_deg_s2 * acc
        return TrialMove(0.0, 0.0, 0.0, 0.0, 300.0 * acc, 0.0, 0.0, 1.0, reducer, 1.0, limited)


def tuned(**of_bench: float) -> Tuned:
    bench = Quiet(default_machine())
    for name, value in of_bench.items():
        object.__setattr__(bench, name, value)
    return paper_procedure(bench, POOR)


def test_an_acceleration_ends_where_the_reducer_has_its_rated_torque() -> None:
    """17.6 kN m are rated, 35.2 momentary: 60 kN m for each deg/s2 end at 0.293 of them, the base at 0.5."""
    found = tuned(reducer_nm_per_deg_s2=60e3)
    assert 17.6 / 60.0 / 1.03 <= found.gains.acc_deg_s2 <= 17.6 / 60.0
    last = next(trial for trial in reversed(found.log) if not trial.kept)
    assert last.note.startswith("reducer 17.")


def test_feed_forward_ends_before_the_torque_limit_acts() -> None:
    """From 70 % on it acts: 60 % are left, though nothing overshoots."""
    found = tuned(limited_from_kvf=0.7)
    assert found.gains.kvf == 0.6
    assert found.phase("Kvf")[-1].note == "the torque limit acted"


def test_ramps_of_a_trial_keep_their_shape() -> None:
    """A rotary table with 24 deg/s2 and 720 deg/s3: with 48 deg/s2 the ramp takes 33 ms as before, by 1440 deg/s3."""
    machine = load_machine(configs_folder() / "rotary_table.toml")
    limits = Bench(machine)._limits(replace(configured(machine), acc_deg_s2=48.0))
    assert (limits.acc_rad_s2, limits.dec_rad_s2) == pytest.approx((rad(48.0), rad(48.0)))
    assert limits.jerk_rad_s3 == pytest.approx(rad(1440.0))


def test_the_plant_that_loses_most_damping_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three the second has a third of its damping left."""
    cases = ("first", "second", "third")
    left: Any = dict(zip(cases, (0.9, 0.33, 0.5), strict=True))
    monkeypatch.setattr(judge, "robust_margins", lambda *_, **__: SimpleNamespace(cases=cases))
    monkeypatch.setattr(judge, "damping_left", lambda case, _: left[case])
    monkeypatch.setattr(judge, "bands_by_damping", lambda *_: {})
    plants: Any = [None] * 3
    found = judge.judge_gains(default_machine(), configured(default_machine()), plants)
    assert (found.damping_left, found.left_on) == (0.33, "second")


def test_a_load_overshoots_where_it_comes_to_rest_and_not_its_last_sample(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It rises to 1.3 and swings by 0.1 about 0.9 in the last 2 s of 4, which end on a crest: 0.4 beyond its rest."""
    machine = default_machine()
    size = rad(machine.monitors.in_position_window_deg)
    time_s = 0.01 * np.arange(1.0, 401.0)
    load = np.where(time_s < 2.005, 1.3, 0.9 + 0.1 * np.cos(2.0 * np.pi * (time_s - 4.0)))

    def rest(_: float, seconds: float) -> Log:
        moved = np.zeros(100) if seconds == 1.0 else size * load
        columns = ("pos_act_rad", "pos_load_rad", "torque_limited")
        return Log(np.stack([0.5 * moved, moved, np.zeros(len(moved))]), 0.01, columns)

    standing: Any = SimpleNamespace(rest=rest)
    monkeypatch.setattr(Bench, "_standing", lambda *some, **more: standing)
    found = Bench(machine).position_step(configured(machine))
    assert (found.load_overshoot, found.motor_overshoot) == pytest.approx((0.4, 0.0), abs=1e-3)


@pytest.mark.parametrize("sides", [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
def test_a_following_error_counts_on_either_side(sides: tuple[float, float]) -> None:
    """3 and 1 mdeg in the half second about the middle of a move of 4 s: 2 in the mean, whichever sign they have."""
    machine = default_machine()
    columns = {name: np.zeros(1000) for name in (
        "vel_ref_rad_s", "vel_motor_rad_s", "vel_load_rad_s", "pos_base_rad", "pos_load_rad", "pos_err_rad",
        "torque_act_nm", "torque_mesh_nm", "torque_limited",
    )}  # fmt: skip
    columns["vel_ref_rad_s"][:] = 0.1
    middle = np.abs(0.01 * np.arange(1.0, 1001.0) - 2.0) < 0.25
    columns["pos_err_rad"][middle] = rad(1e-3) * np.resize([3.0 * sides[0], 1.0 * sides[1]], middle.sum())
    log = Log(np.stack(list(columns.values())), 0.01, tuple(columns))
    plan: Any = SimpleNamespace(duration=4.0)
    found = bench._evaluate(machine, log, plan)
    assert 1e3 * found.cruise_error_deg == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize("kvp", [100.0, 300.0])
def test_a_position_loop_is_held_against_the_speed_loop_that_is_tried_with_it(kvp: float) -> None:
    """Four times slower than the speed loop on load and rotor: 5 % faster than Kvp / 4 J is 0.05 too much."""
    search = _Search(default_machine(), STATED, [], None, lambda _: None)
    fastest = kvp / (4.0 * search.inertia)
    for share in (1.05, 1.0, 0.7):
        gains = replace(search.base, kvp_nm_s_per_rad=kvp, kpp_per_s=share * fastest)
        assert search.excess(gains) == pytest.approx(share - 1.0, abs=1e-12)
