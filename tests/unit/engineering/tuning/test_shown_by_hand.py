"""What the tuning of a small axis reads like: figures of a rotary table, made by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from gantryctl.engineering.tuning.bench import TrialMove
from gantryctl.engineering.tuning.by_margins import Designed
from gantryctl.engineering.tuning.gains import Gains
from gantryctl.engineering.tuning.text import move_rows, sentences

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
