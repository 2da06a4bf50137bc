"""A model is judged by a move that it has not seen: what it lacks is named, noise is not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.identification.fit import check_valid
from gantryctl.engineering.identification.lead import Lead, fit_lead
from gantryctl.engineering.identification.samples import Samples, joined
from gantryctl.engineering.identification.validation import Validation, validated
from gantryctl.engineering.identification.waves import Band
from gantryctl.errors import CriterionNotMet
from gantryctl.machine import default_machine, with_values
from gantryctl.units import SIGNED, Dial

FLANK_NM = 1e3
BAND = Band(0.0, 360.0)


def moved(low: float, high: float, seed: int, gears: object, noise_rad: float = 5e-7) -> Samples:
    """A move each way with a lead of `gears`, read with noise."""
    there = np.linspace(low, high, round(4000 * (high - low) / 6.28))
    act, rng = np.concatenate([there, there[::-1]]), np.random.default_rng(seed)
    vel = np.repeat([0.0175, -0.0175], len(there))
    lead = gears(act, np.sign(vel)) + rng.normal(0.0, noise_rad, len(act))
    zero = np.zeros_like(act)
    return Samples(act, act - lead, act, vel, zero, zero, np.arange(len(act)) // 340.0)


def judged(gears: object, seed: int = 1, noise_rad: float = 5e-7) -> Validation:
    turns, check = (
        moved(-3.13, 3.13, seed, gears, noise_rad),
        moved(-1.57, 1.57, seed + 100, gears, noise_rad),
    )
    torques = [1.6e4 * np.sin(each.act_rad) + 6e3 * each.direction for each in (turns, check)]
    lead = fit_lead(turns, torques[0], FLANK_NM, BAND, (22.0,))
    return validated(lead, turns, check, torques[1], FLANK_NM, 0.0, BAND.high)


def smooth(act: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return 2e-5 * np.sin(act) + 1e-5 * np.cos(5.0 * act) + 1e-5 * direction


def test_a_model_that_has_everything_leaves_noise_that_does_not_come_again() -> None:
    found = [judged(smooth, seed) for seed in range(2)]
    assert all(each.left_deg == pytest.approx(np.degrees(5e-7), rel=0.1) for each in found)
    assert not any(each.warned for each in found)


def test_a_fault_of_a_few_teeth_is_told_with_its_place() -> None:
    """Five degrees of worn teeth: too sharp for the map, and no wave."""

    def worn(act: np.ndarray, direction: np.ndarray) -> np.ndarray:
        return smooth(act, direction) + 8e-5 * np.exp(-0.5 * ((act - 0.9) / 0.004) ** 2)

    found = judged(worn)
    assert found.warned
    assert found.cycles == 0.0
    assert found.at_deg[0] < np.degrees(0.9) < found.at_deg[1]
    assert "come again at the same angle" in found.words(SIGNED)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_wrong_one_way_alone_is_told(sign: float) -> None:
    """A bump of 80 urad at 0.9 rad in one direction, before a model that knows nothing.

    Gaussian, 0.04 rad wide, over a way of 3.14 rad: its square has the mean 80^2 x 0.04 sqrt(pi) / 3.14 = 12^2 there,
    and half of that of both directions: 8.5 urad, but for the mean of the bump itself.
    """

    def bump(act: np.ndarray, direction: np.ndarray) -> np.ndarray:
        return 8e-5 * np.exp(-0.5 * ((act - 0.9) / 0.04) ** 2) * (direction == sign)

    turns, check = moved(-3.13, 3.13, 1, bump), moved(-1.57, 1.57, 2, bump)
    nothing = Lead(np.zeros(1), np.zeros(1), [], [], None, np.inf, turns.act_rad - turns.load_rad, None)
    found = validated(nothing, turns, check, np.zeros_like(check.act_rad), FLANK_NM, 0.0, BAND.high)
    assert found.repeats_deg == pytest.approx(np.degrees(8.5e-6), rel=0.1)
    assert found.refused
    assert found.at_deg[0] < np.degrees(0.9) < found.at_deg[1]


def test_the_place_is_told_as_people_read_it() -> None:
    """A display of 0..360 deg has 300 deg where the axis has -60; a tilt table has sectors of a third of a degree."""
    found = Validation(0.004, 0.003, 0.002, 22.0, (-60.0, -45.0))
    assert found.words(Dial(0.0)).endswith("a wave of 22 per turn, most of it between 300 and 315 deg")
    assert found.words(SIGNED).endswith("most of it between -60 and -45 deg")
    small = found._replace(cycles=0.0, at_deg=(3.0, 3.333))
    assert small.words(SIGNED).endswith("no single wave, most of it between 3.00 and 3.33 deg")
    machine = with_values(default_machine(), {"axis.display": "0..360"})
    refused: Any = SimpleNamespace(validation=found)
    with pytest.raises(
        CriterionNotMet, match="between 300 and 315 deg; more than a third of the lead is left"
    ):
        check_valid(machine, refused)


def test_pieces_of_two_moves_are_never_one() -> None:
    """What disturbs one piece of time disturbs no piece of another move, whatever its number was there."""
    parts = [moved(-0.3, 0.3, seed, smooth) for seed in (1, 2)]
    pieces = joined(parts).stretch
    first, second = np.split(pieces, 2)
    assert not set(first) & set(second)
    for part, own in zip(parts, (first, second), strict=True):
        assert len(set(own)) == len(set(part.stretch)) > 1


def test_maps_that_leave_most_of_the_lead_are_refused() -> None:
    """Teeth that change by 20 urad from one to the next, 900 a turn: more than the slow turns show."""

    def coarse(act: np.ndarray, direction: np.ndarray) -> np.ndarray:
        steps = np.random.default_rng(7).normal(0.0, 2e-5, 2000)
        return 1e-6 * direction + steps[np.floor((act + 3.2) * 900.0 / 6.2832).astype(int)]

    found = judged(coarse)
    assert found.refused


def test_backlash_is_told_from_friction_by_where_it_jumps() -> None:
    def loose(act: np.ndarray, direction: np.ndarray) -> np.ndarray:
        torque = 1.6e4 * np.sin(act) + 6e3 * direction
        return smooth(act, direction) + 0.5 * 8e-5 * np.clip(torque / 300.0, -1.0, 1.0)

    turns = moved(-3.13, 3.13, 1, loose)
    torque = 1.6e4 * turns.sine + 6e3 * turns.direction
    found = fit_lead(turns, torque, FLANK_NM, BAND, ())
    assert found.backlash_rad == pytest.approx(8e-5, abs=found.backlash_half_width_rad)
    assert found.backlash_half_width_rad < 1e-5
    # without it nothing is made up: friction alone is no gap
    none = fit_lead(moved(-3.13, 3.13, 1, smooth), torque, FLANK_NM, BAND, ())
    assert none.backlash_rad is None or none.backlash_rad < 1e-6
