"""The steps that compare the encoder on the ring with the motor's: a wrong one passes none of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gantryctl.commissioning import Commissioning, Outcome, StepResult
from gantryctl.commissioning.load_side.ring import over_the_travel
from gantryctl.commissioning.results import Figure
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.group import Neighbours
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.store import StateStore
from gantryctl.wiring import virtual as virtual_wiring

pytestmark = pytest.mark.can

BARE = load_machine(configs_folder() / "hust_can.toml")
MACHINE = with_values(BARE, {"can.load_encoder.source": "node", "can.load_encoder.node": 4})
TURN_COUNTS = MACHINE.can.load_encoder.counts_per_turn
LIMIT_DEG = MACHINE.control.compensation.load_encoder.disagreement_deg

# The count that a lying encoder shows, of the true one.
Lie = Callable[[int], int]


def signed(counts: int) -> int:
    """Within half a turn of 0."""
    return (counts + TURN_COUNTS // 2) % TURN_COUNTS - TURN_COUNTS // 2


def slipping() -> Lie:
    """The coupling goes with the ring in one direction and loses 2 % of the way in the other."""
    before, lost = None, 0.0

    def reading(true: int) -> int:
        nonlocal before, lost
        step = 0 if before is None else signed(true - before)
        before = true
        lost += 0.015 * max(0, -step)
        return round(true + lost)

    return reading


def ring_step(folder: Path, monkeypatch: pytest.MonkeyPatch, lie: Lie) -> tuple[StepResult, float]:
    """Result of the step, and how far the true gantry was turned, deg."""
    made, far = virtual_wiring.virtual_bus, [0.0]

    def bus(*args: object, **named: object) -> object:
        link, drive, neighbours = made(*args, **named)
        spoil(drive, neighbours)
        begun = drive.truth()[0]

        def look() -> None:
            far[0] = max(far[0], abs(math.degrees(drive.truth()[0] - begun)))

        drive.plant.watch = look
        return link, drive, neighbours

    def spoil(drive: DriveNode, neighbours: Neighbours) -> None:
        assert neighbours.encoder is not None
        neighbours.encoder._reading = lambda: lie(drive.plant.ring_counts()) % TURN_COUNTS

    monkeypatch.setattr(virtual_wiring, "virtual_bus", bus)
    with StateStore(MACHINE, folder) as store:
        work = Commissioning(MACHINE, store, folder, lambda line: None, lambda step: True)
        work.start(again=True)
        result = work.do(work.left("ring")[0])
    assert result is not None
    return result, far[0]


def test_an_encoder_that_turns_with_the_ring_passes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result, far_deg = ring_step(tmp_path, monkeypatch, lambda true: true)
    assert result.outcome is Outcome.PASSED, result.proof
    # Gear error and lost motion of 1.5 deg.
    assert result.number("ratio_forward") == pytest.approx(1.0, abs=0.006)
    assert far_deg == pytest.approx(1.5, abs=0.05)


@pytest.mark.parametrize(
    ("lie", "to_do"),
    [
        pytest.param(lambda true: -true, "inverted", id="wrong direction"),
        pytest.param(lambda true: signed(true) * 25 // 24, "counts_per_turn", id="wrong counts"),
        pytest.param(slipping(), "coupling", id="slipping"),
        pytest.param(lambda true: 0, "coupling", id="frozen"),
    ],
)
def test_a_wrong_one_is_refused_before_a_loop_goes_through_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lie: Lie, to_do: str
) -> None:
    result, far_deg = ring_step(tmp_path, monkeypatch, lie)
    assert result.outcome is Outcome.FAILED, result.proof
    assert to_do in result.to_do
    assert "zero_proposed_counts" not in result.figures
    # The position loop is open: nothing but the commanded way.
    assert far_deg < 1.6


@pytest.mark.parametrize("turn_deg", [33.0, -179.0])
def test_a_zero_that_is_off_is_proposed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, turn_deg: float
) -> None:
    counts = round(turn_deg / 360.0 * TURN_COUNTS)
    result, _ = ring_step(tmp_path, monkeypatch, lambda true: true + counts)
    assert result.outcome is Outcome.FAILED
    # A step of a thousandth of a degree is what the gear lies between both encoders.
    assert result.number("zero_proposed_counts") == pytest.approx(counts, abs=0.005 / 360.0 * TURN_COUNTS)
    assert f"zero_counts = {result.number('zero_proposed_counts'):.0f} is proposed" in result.to_do


def test_a_machine_without_one_has_nothing_to_compare(tmp_path: Path) -> None:
    with StateStore(BARE, tmp_path) as store:
        work = Commissioning(BARE, store, tmp_path, lambda line: None, lambda step: True)
        work.start(again=True)
        result = work.do(work.left("ring")[0])
    assert result is not None
    assert result.outcome is Outcome.NOT_TESTABLE


def over(ring_of_motor: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> tuple[str, dict[str, Figure]]:
    """Both ways through the travel; the ring as a function of the motor's angle and the direction."""
    up = np.linspace(-178.0, 178.0, 500)
    motor, way = np.concatenate((up, up[::-1])), np.repeat((1.0, -1.0), 500)
    ring = (ring_of_motor(motor, way) + 180.0) % 360.0 - 180.0
    return over_the_travel(MACHINE, motor, ring, way > 0.0)


def test_over_the_travel_offset_scale_and_reversal_are_told_apart() -> None:
    text, figures = over(lambda motor, way: motor * (1.0 + 50e-6) + 0.01 + 0.002 * way)
    assert figures["ring_offset_deg"].value == pytest.approx(0.01, abs=1e-6)
    assert figures["ring_reversal_deg"].value == pytest.approx(0.004, abs=1e-6)
    assert "+50 ppm" in text
    assert figures["ring_most_apart_deg"].within
    assert figures["ring_zero_proposed_counts"].value == round(0.01 / 360.0 * TURN_COUNTS)


@pytest.mark.parametrize(
    "lie",
    [
        pytest.param(lambda motor, way: motor * (1.0 + 5e-4), id="0.05 % too many counts"),
        pytest.param(
            lambda motor, way: motor + np.where(way < 0.0, 1.2 * LIMIT_DEG, 0.0), id="slips on the way back"
        ),
        pytest.param(lambda motor, way: -motor, id="wrong direction"),
        pytest.param(lambda motor, way: np.full_like(motor, np.nan), id="no reading"),
    ],
)
def test_over_the_travel_a_wrong_ring_is_outside_of_its_limit(lie: Callable[..., np.ndarray]) -> None:
    assert not over(lie)[1]["ring_most_apart_deg"].within
