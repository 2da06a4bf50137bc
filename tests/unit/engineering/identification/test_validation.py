"""A model is judged by a move that it has not seen: what it lacks is named, noise is not."""

from __future__ import annotations

import numpy as np
import pytest

from gantryctl.engineering.identification.lead import fit_lead
from gantryctl.engineering.identification.samples import Samples
from gantryctl.engineering.identification.validation import Validation, validated
from gantryctl.engineering.identification.waves import Band

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
    assert "come again at the same angle" in found.words


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
