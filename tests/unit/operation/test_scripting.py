"""`gantryctl.move`: a whole move in one call, for scripts and notebooks."""

from __future__ import annotations

import pytest

import gantryctl
from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.machine import with_values


def test_a_move_returns_summary_and_trace() -> None:
    result = gantryctl.move(gantryctl.default_machine(), 2.0, speed_deg_s=3.0)
    assert result.summary.end_deg == pytest.approx(2.0, abs=1e-3)
    assert result.summary.peak_deg_s <= 3.0
    assert result.summary.following_error_load_deg is not None
    assert result.trace["pos_act_rad"][-1] == pytest.approx(0.0349, abs=1e-3)


def test_several_moves_are_one_recording_and_the_summary_is_of_the_last() -> None:
    result = gantryctl.move(gantryctl.default_machine(), 1.0, 0.5)
    assert result.summary.start_deg == pytest.approx(1.0, abs=1e-3)
    assert result.summary.end_deg == pytest.approx(0.5, abs=1e-3)
    assert result.trace["pos_ref_rad"].max() == pytest.approx(0.01745, abs=1e-4)


def test_a_target_beyond_the_travel_is_an_exception() -> None:
    with pytest.raises(CommandRefused, match="beyond"):
        gantryctl.move(gantryctl.default_machine(), 200.0)


def test_an_alarm_is_an_exception() -> None:
    tight = with_values(gantryctl.default_machine(), {"control.kvf": 0.0})
    with pytest.raises(AlarmStop, match="CTL-03"):
        gantryctl.move(tight, 60.0)


def test_every_name_of_the_api_can_be_had() -> None:
    for name in gantryctl.__all__:
        assert getattr(gantryctl, name) is not None
        assert name in dir(gantryctl)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = gantryctl.nothing
