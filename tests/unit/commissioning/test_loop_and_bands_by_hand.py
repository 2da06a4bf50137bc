"""The steps loop and bands, by hand: following error, moves that must be done, bands with their reserve."""

from __future__ import annotations

from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning import steps_motion
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.machine import Machine
from support.modulo_machine import modulo_machine
from unit.commissioning.hand_drive import AWAY, MACHINE, context

pytestmark = pytest.mark.can


class Recorded(dict[str, Any]):
    """Columns of a trace."""


@pytest.mark.parametrize(
    ("error_deg", "done", "passes"),
    [(0.01, True, True), (0.2, True, False), (-0.2, True, False), (0.01, False, False)],
)
def test_the_loop_follows_on_both_sides(
    monkeypatch: pytest.MonkeyPatch, error_deg: float, done: bool, passes: bool
) -> None:

    speeds = np.array([0.0, 0.0, 0.01, 0.01, 0.0, 0.0, 0.0, 0.0])
    errors = np.radians(np.array([0.009, 0.009, error_deg, 0.0, 0.008, 0.008, 0.001, -0.002]))
    trace = Recorded(vel_ref_rad_s=speeds, pos_err_rad=errors)
    asked: list[Any] = []
    monkeypatch.setattr(
        steps_motion, "_there_and_back", lambda c, part, *given: (asked.append(given), (trace, done))[1]
    )
    found = steps_motion.loop(context())
    # By a degree and back, from where it stands, at the lowest speed.
    assert asked == [(1.0, 0.6)]
    assert (found.outcome is Outcome.PASSED) is passes
    # The second half of the rest after the move.
    assert found.number("rest_error_deg") == pytest.approx(0.002)
    assert found.number("following_error_deg") == pytest.approx(max(abs(error_deg), 0.009))
    # 0.03 deg, and 0.012 s of the lowest speed, 0.6 deg/s.
    assert found.figures["following_error_deg"].high == pytest.approx(0.0372)


class Ways:
    """A run of the axis: the ways that it was asked for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, angle_deg: float, dones: tuple[bool, ...]) -> None:
        self.angle_deg, self.asked, self._left = angle_deg, list[tuple[float, float]](), list(dones)

        @contextmanager
        def recorded(c: object, part: str) -> Any:
            yield self, SimpleNamespace(trace=Recorded)

        monkeypatch.setattr(steps_motion, "_recorded_run", recorded)

    def move_by(self, way_deg: float, speed_deg_s: float) -> Any:
        self.asked.append((way_deg, speed_deg_s))
        self.angle_deg += way_deg
        return SimpleNamespace(done=self._left.pop(0))


@pytest.mark.parametrize(
    ("dones", "done"), [((True, True), True), ((True, False), False), ((False, True), False)]
)
def test_every_move_must_be_done(
    monkeypatch: pytest.MonkeyPatch, dones: tuple[bool, ...], done: bool
) -> None:
    ways = Ways(monkeypatch, -10.0, dones)
    assert steps_motion._there_and_back(context(), "", 1.0, 0.6)[1] is done
    assert ways.asked == [(1.0, 0.6), (-1.0, 0.6)]


@pytest.mark.parametrize(
    ("machine", "angle_deg", "way_deg"),
    [
        # Within a degree of either end of -180 to 180 deg, and of 40 to 100.
        (MACHINE, 179.7, -1.0), (MACHINE, -179.7, 1.0), (AWAY, 99.7, -1.0), (AWAY, 40.3, 1.0),
        # And of the end of a turn: back to an angle would be all of it, and back by a way is not.
        (modulo_machine(None, "hust_can"), 179.7, -1.0), (modulo_machine(None, "hust_can"), -179.7, 1.0),
        (MACHINE, 0.0, 1.0),
    ],
)  # fmt: skip
def test_there_and_back_stays_within_the_travel(
    monkeypatch: pytest.MonkeyPatch, machine: Machine, angle_deg: float, way_deg: float
) -> None:
    ways = Ways(monkeypatch, angle_deg, (True, True))
    steps_motion._there_and_back(context(machine), "", 1.0, 0.6)
    assert ways.asked == [(way_deg, 0.6), (-way_deg, 0.6)]


@pytest.mark.parametrize(
    ("rest", "following", "passes"), [(0.0, 0.0, True), (1.0, 0.0, False), (0.0, 1.0, False)]
)
def test_bands_have_half_as_much_again(rest: float, following: float, passes: bool) -> None:
    """1.4 and 1.6 in parts of what would just pass at 1.5."""
    monitors = MACHINE.monitors
    at_3 = monitors.following_error_base_deg + 3.0 * monitors.following_error_per_speed_s
    results = {
        "loop": StepResult(
            "loop", Outcome.PASSED, "", {"rest_error_deg": Figure(monitors.in_position_window_deg / (1.6 - 0.2 * rest))}
        ),
        "turn": StepResult(
            "turn", Outcome.PASSED, "",
            {"following_error_deg": Figure(at_3 / (1.6 - 0.2 * following)), "speed_deg_s": Figure(3.0)},
        ),
    }  # fmt: skip
    assert (steps_motion.bands(context(**results)).outcome is Outcome.PASSED) is passes
    assert steps_motion.bands(context(loop=results["loop"])).outcome is Outcome.FAILED


@pytest.mark.parametrize("step", ["loop", "turn"])
def test_bands_are_not_proposed_from_a_step_that_has_failed(step: str) -> None:
    """It may have measured something, or nothing at all."""
    figures = {"rest_error_deg": Figure(0.0), "following_error_deg": Figure(0.0), "speed_deg_s": Figure(3.0)}
    results = {key: StepResult(key, Outcome.PASSED, "", figures) for key in ("loop", "turn")}
    assert steps_motion.bands(context(**results)).outcome is Outcome.PASSED
    for measured in (figures, {}):
        results[step] = StepResult(step, Outcome.FAILED, "", measured)
        found = steps_motion.bands(context(**results))
        assert (found.outcome, found.to_do) == (Outcome.FAILED, "run the steps loop and turn first")


def test_a_stop_is_held_against_the_computed_one_and_60_ms() -> None:
    figures: dict[str, Figure] = {}
    steps_motion._add(context(), figures, "quick stop", 3.0, 1.0, 0.833)
    assert figures["quick_stop_3_measured_deg"] == Figure(1.0, high=pytest.approx(1.013))
    assert figures["quick_stop_3_computed_deg"] == Figure(0.833)
