"""What steps with the position loop closed make of a trace: jog release, friction, eccentric moment."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning import steps_motion
from gantryctl.commissioning.results import Outcome
from unit.commissioning.hand_drive import (
    PERIOD_S,
    context,
)

pytestmark = pytest.mark.can


def recorded(monkeypatch: pytest.MonkeyPatch, trace: dict[str, np.ndarray]) -> None:
    """What the recorder of a run has kept, whatever the run does."""

    @contextmanager
    def run(c: object, part: str) -> Iterator[tuple[Any, Any]]:
        nothing = lambda *_: SimpleNamespace(done=True)  # noqa: E731
        yield (
            SimpleNamespace(angle_deg=0.0, speed_max_deg_s=6.0, jog=nothing, move=nothing, observe=nothing),
            SimpleNamespace(trace=lambda: trace),
        )

    monkeypatch.setattr(steps_motion, "_recorded_run", run)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_way_of_a_jog_release_is_that_of_its_ramp(
    monkeypatch: pytest.MonkeyPatch, direction: float
) -> None:
    """3 deg/s for 3 s, then down at 5 deg/s2: 9/10 deg."""
    up, down = np.arange(0.0, 3.0, 0.02), np.arange(3.0, 0.0, -0.02)
    vel = direction * np.concatenate((up, np.full(750, 3.0), down, np.zeros(250)))
    way = np.cumsum(vel) * PERIOD_S
    recorded(monkeypatch, {"vel_ref_rad_s": np.radians(vel), "pos_act_rad": np.radians(way)})
    # One scan of 0.012 deg.
    assert steps_motion._jog_release(context(), 3.0) == pytest.approx(0.9, abs=0.012)


@pytest.mark.parametrize("ended", [(False, True, True), (True, False, True), (True, True, False)])
def test_a_turn_whose_move_did_not_end_in_position_fails(
    monkeypatch: pytest.MonkeyPatch, ended: tuple[bool, ...]
) -> None:
    left = list(ended)

    @contextmanager
    def run(c: object, part: str) -> Iterator[tuple[Any, Any]]:
        move = lambda *_: SimpleNamespace(done=left.pop(0))  # noqa: E731
        yield SimpleNamespace(speed_max_deg_s=6.0, move=move, observe=lambda look: None), None

    monkeypatch.setattr(steps_motion, "_recorded_run", run)
    found = steps_motion.slow_turn(context())
    assert (found.outcome, left) == (Outcome.FAILED, [])
    assert "did not end in position" in found.proof


def test_friction_and_eccentric_moment_are_told_at_the_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """5 kN m of friction, and a weight of 2 kN m beside and 1 kN m below the axis, through 1144 turns of the motor."""
    angle = np.concatenate((np.radians(np.arange(-178.0, 178.0)), np.radians(np.arange(178.0, -178.0, -1.0))))
    forward = np.repeat((1.0, -1.0), 356)
    at_load = 5000.0 * forward + 2000.0 * np.sin(angle) - 1000.0 * np.cos(angle)
    recorded(
        monkeypatch,
        {
            "vel_ref_rad_s": np.radians(3.0) * forward,
            "pos_act_rad": angle,
            "pos_err_rad": np.radians(0.002) * forward,
            "torque_act_nm": at_load / 1144.0,
        },
    )
    c = context()
    found = steps_motion.slow_turn(c)
    # In kN m: 5 of friction, the root of 5 of the moment.
    for curve in c.watch.pictures[0].panels[0].lines:
        sign = -1.0 if "back" in curve.name else 1.0
        assert (min(curve.y), max(curve.y)) == pytest.approx(
            (5.0 * sign - math.sqrt(5.0), 5.0 * sign + math.sqrt(5.0)), abs=0.01
        )
    names = ("friction_nm", "moment_sine_nm", "moment_cosine_nm", "remainder_nm", "following_error_deg")
    assert [found.number(name) for name in names] == pytest.approx(
        [5000.0, 2000.0, -1000.0, 0.0, 0.002], abs=1e-6
    )
