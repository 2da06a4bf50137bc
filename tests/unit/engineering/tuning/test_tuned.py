"""Both methods on the gantry, and what the uncertain plant says to them."""

import pytest

from gantryctl.engineering.tuning.by_margins import Conditions, by_margins
from gantryctl.engineering.tuning.gains import PAPER
from gantryctl.engineering.tuning.judge import RUNNING, SKETCH
from gantryctl.engineering.tuning.procedure import QUARTERS
from gantryctl.engineering.tuning.result import differences
from gantryctl.engineering.tuning.text import verdict_sentences
from gantryctl.errors import UsageError
from gantryctl.machine import default_machine, with_values


@pytest.mark.parametrize("name", ["Kvp", "Tvi", "Kpp"])
def test_on_the_axis_that_the_paper_s_drive_saw_the_procedure_ends_at_the_paper_s_gains(as_paper, name):
    """The measure of the requirement: within 20 %, from poor gains. The criteria were settled with the paper's gains in
    sight (docs/explanation/tuning.md), so this guards the result, it does not confirm the paper.
    """
    assert abs(differences(as_paper)[name]) <= 0.2


def test_all_of_the_feed_forward_and_an_acceleration_that_the_base_bears(as_paper):
    assert as_paper.proposal.gains.kvf == 1.0
    assert as_paper.proposal.move.base_um <= QUARTERS.base_um
    # the paper's 0.393 deg/s2 moves this base by 165 um, a little more than the 150 um permitted
    assert 0.3 < as_paper.proposal.gains.acc_deg_s2 < PAPER.acc_deg_s2


def test_the_procedure_sees_one_plant_only(as_paper):
    """It tunes the plant that is there; on others of the uncertain set its gains swing up, as the paper's do."""
    found, paper = as_paper.proposal.verdict, as_paper.paper.verdict
    assert 0 < len(found.margins.unstable) < len(paper.margins.unstable)
    assert found.bands[SKETCH][0.025] == found.bands[RUNNING][0.025] == []
    worst = found.margins.worst_damping
    assert worst.variation.damping_ratio == 0.01


def test_where_the_paper_s_gains_are_unstable(designed):
    """Structural damping 1 %: stiffness 0.65..1.6e9 N m/rad on two masses; 0.5 %: 0.25..2.3e9 (to the digits given)."""
    verdict = designed.paper.verdict
    ((low, high),) = verdict.bands[SKETCH][0.01]
    assert (low / 1e9, high / 1e9) == (pytest.approx(0.65, abs=0.03), pytest.approx(1.6, abs=0.03))
    ((low, high),) = verdict.bands[SKETCH][0.005]
    assert (low / 1e9, high / 1e9) == (pytest.approx(0.25, abs=0.03), pytest.approx(2.3, abs=0.05))
    assert verdict.bands[SKETCH][0.025] == []
    assert not verdict.stable
    assert verdict.margins.worst_damping.zeta < 0.0
    words = " ".join(verdict_sentences("paper", verdict))
    assert "paper: UNSTABLE on 12 of 156 uncertain plants" in words
    assert "1 % damping: k = 0.63..1.60e9 N m/rad" in words


def test_gains_by_margins_keep_what_they_state_on_every_plant(designed):
    verdict, wanted = designed.proposal.verdict, Conditions()
    assert verdict.stable
    assert verdict.damping_left >= wanted.damping_left
    assert verdict.margins.worst_sensitivity.sensitivity <= wanted.sensitivity
    assert verdict.margins.worst_phase.phase_margin_deg > 30.0
    assert len(verdict.margins.cases) == 156
    assert verdict.bands[RUNNING] == {0.005: [], 0.01: [], 0.025: []}


def test_gains_by_margins_are_stiffer_and_follow_better(designed):
    assert designed.proposal.gains.stiffness > designed.paper.gains.stiffness
    assert designed.proposal.move.motor_error_deg_s < 0.5 * designed.paper.move.motor_error_deg_s
    assert designed.proposal.move.base_um <= designed.paper.move.base_um
    # the rest of the machine is left alone
    assert designed.proposal.gains.acc_deg_s2 == designed.configured.gains.acc_deg_s2
    assert designed.proposal.gains.kvf == 1.0


def test_one_encoder_step_limits_the_gain(designed):
    # 1 % of 257 N m over one of 2^22 steps in 125 us
    assert designed.designed.kvp_max == pytest.approx(214.4, abs=0.1)
    assert designed.proposal.gains.kvp_nm_s_per_rad <= designed.designed.kvp_max


@pytest.mark.slow  # a tuning of its own
def test_narrower_conditions_are_paid_with_stiffness(designed):
    narrow = by_margins(default_machine(), Conditions(sensitivity=1.5, damping_left=0.9)).gains
    assert narrow.stiffness < 0.5 * designed.proposal.gains.stiffness


@pytest.mark.parametrize(
    ("machine", "conditions", "message"),
    [
        ({}, Conditions(damping_left=9.0), "no gains meet the conditions"),
        ({"drive.speed_loop.feedback": "counts"}, Conditions(), "take an interpolated encoder"),
    ],
)
def test_what_cannot_be_met_is_refused(machine, conditions, message):
    with pytest.raises(UsageError, match=message):
        by_margins(with_values(default_machine(), machine), conditions)
