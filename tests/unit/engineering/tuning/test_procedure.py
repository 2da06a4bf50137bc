"""The sequence of trials: order, stop criteria, resolution, refusals. On an axis whose answers are formulas."""

from dataclasses import replace

import numpy as np
import pytest

from gantryctl.engineering.tuning.bench import Bench, PositionStep, SpeedStep, TrialMove
from gantryctl.engineering.tuning.gains import POOR, poor
from gantryctl.engineering.tuning.procedure import PHASES, Criteria, paper_procedure
from gantryctl.errors import UsageError
from gantryctl.machine import default_machine

NOTHING = np.zeros(1)
CRITERIA = Criteria(speed_overshoot=0.05, integral_overshoot=0.25, load_overshoot=0.3, base_um=100.0)


class FormulaBench(Bench):
    """Speed overshoots by Kvp/1000 + 1 ms/Tvi, the load by Kpp/100; the base moves by 200 um per deg/s2."""

    torque_limit_at_kvp = 1e9
    overshoot_per_kvf = 0.0

    def speed_step(self, gains):
        overshoot = gains.kvp_nm_s_per_rad / 1000.0 + 0.001 / gains.tvi_s
        return SpeedStep(NOTHING, NOTHING, overshoot, gains.kvp_nm_s_per_rad > self.torque_limit_at_kvp)

    def position_step(self, gains):
        return PositionStep(NOTHING, NOTHING, NOTHING, 0.0, gains.kpp_per_s / 100.0, False)

    def move(self, gains, way_deg=90.0):
        base = 200.0 * gains.acc_deg_s2
        overshoot = self.overshoot_per_kvf * gains.kvf
        return TrialMove(overshoot, 0.1 * (1.0 - gains.kvf), 0.0, 0.0, base, 0.0, 0.0, 1.0, 1.0, 1.0, False)


def run(start=POOR, bench=None):
    return paper_procedure(bench or FormulaBench(default_machine()), start, CRITERIA)


def test_every_value_ends_just_below_its_criterion():
    gains = run().gains
    # Kvp with Tvi = 500 ms: Kvp/1000 + 0.002 = 0.05; then 1 ms/Tvi = 0.25 - 0.048; the edge is known within 2 %
    assert 48.0 / 1.02 <= gains.kvp_nm_s_per_rad <= 48.0
    assert 1.0 <= gains.tvi_s * (0.25 - gains.kvp_nm_s_per_rad / 1000.0) / 0.001 <= 1.03
    assert 30.0 / 1.02 <= gains.kpp_per_s <= 30.0
    assert 0.5 / 1.02 <= gains.acc_deg_s2 <= 0.5
    assert gains.kvf == 1.0


def test_inner_before_outer_feedback_before_feed_forward_then_acceleration():
    tuned = run()
    order = list(dict.fromkeys(trial.phase for trial in tuned.log))
    assert order == list(PHASES) == ["Kvp", "Tvi", "Kpp", "Kvf", "acceleration"]
    phases = [trial.phase for trial in tuned.log]
    assert phases == sorted(phases, key=order.index)


def test_the_log_says_what_was_kept_and_why():
    tuned = run()
    for name in PHASES:
        trials = tuned.phase(name)
        assert all(trial.kept == (trial.measured <= trial.limit) for trial in trials)
        assert trials[0].kept
    kvp = tuned.phase("Kvp")
    rising = [trial.value for trial in kvp[: next(k for k, trial in enumerate(kvp) if not trial.kept) + 1]]
    assert np.allclose(np.diff(np.log(rising)), np.log(1.25))
    assert "following error" in tuned.phase("Kvf")[0].note


def test_the_end_does_not_depend_on_the_start():
    other = replace(POOR, kvp_nm_s_per_rad=3.0, tvi_s=0.5, kpp_per_s=0.3, acc_deg_s2=0.02)
    first, second = run().gains, run(other).gains
    for name in ("kvp_nm_s_per_rad", "tvi_s", "kpp_per_s", "acc_deg_s2"):
        assert getattr(first, name) == pytest.approx(getattr(second, name), rel=0.03)  # twice the resolution


def test_the_torque_limit_stops_too():
    bench = FormulaBench(default_machine())
    object.__setattr__(bench, "torque_limit_at_kvp", 20.0)
    tuned = run(bench=bench)
    assert tuned.gains.kvp_nm_s_per_rad <= 20.0
    assert tuned.phase("Kvp")[-1].note in ("", "the torque limit acted")
    assert any(trial.note == "the torque limit acted" for trial in tuned.phase("Kvp"))


def test_feed_forward_stops_where_the_speed_overshoots():
    bench = FormulaBench(default_machine())
    object.__setattr__(bench, "overshoot_per_kvf", 0.012)
    tuned = run(bench=bench)
    assert tuned.gains.kvf == pytest.approx(0.8)
    assert not tuned.phase("Kvf")[-1].kept


def test_a_start_that_is_too_much_is_refused():
    with pytest.raises(
        UsageError, match=r"does not bear the starting value: Kvp = 100 .*; start with poorer gains"
    ):
        run(replace(POOR, kvp_nm_s_per_rad=100.0))


def test_the_acceleration_stays_below_the_other_ramps():
    """A base that never moves: the jog-release ramp ends the search."""
    bench = FormulaBench(default_machine())
    quiet = paper_procedure(bench, POOR, CRITERIA._replace(base_um=1e9))
    most = default_machine().virtual_axis.jog_release_dec_deg_s2
    assert most / 1.02 <= quiet.gains.acc_deg_s2 <= most
    assert "jog-release ramp" in next(trial for trial in quiet.phase("acceleration") if not trial.kept).note


def test_a_value_without_end_is_refused():
    class Endless(FormulaBench):
        def speed_step(self, gains):
            return SpeedStep(NOTHING, NOTHING, 0.0, False)

    with pytest.raises(UsageError, match="Kvp can be raised without end"):
        run(bench=Endless(default_machine()))


def test_poor_gains_are_as_poor_on_an_axis_of_any_size():
    """10 N m s/rad stall the motor of a table of 50 kg m2: its rotor turns with 0.25 g m2, not with 0.36 kg m2."""
    assert poor(0.362, 450.0 / 1144.0) == POOR
    small = poor(2.5e-4, 12.0)
    assert small.kvp_nm_s_per_rad / 2.5e-4 == pytest.approx(POOR.kvp_nm_s_per_rad / 0.362)
    assert poor(0.1, 0.1).acc_deg_s2 < 0.1
