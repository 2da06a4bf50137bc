"""Waves are found where they are, by data alone, and noise is not taken for one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from gantryctl.engineering.identification.lead import waves_of
from gantryctl.engineering.identification.waves import Band, find_waves, spectrum

ANGLE = np.concatenate([np.linspace(-3.13, 3.13, 6000), np.linspace(3.13, -3.13, 6000)])
BAND = Band(16.5, 360.0)


def left_of(lead: np.ndarray, angle: np.ndarray = ANGLE) -> object:
    """What least squares with waves leave of a lead."""

    def left(cycles: Sequence[float]) -> np.ndarray:
        columns = waves_of(angle, cycles)
        return lead - columns @ np.linalg.lstsq(columns, lead, rcond=None)[0] if cycles else lead

    return left


def noise(seed: int, angle: np.ndarray = ANGLE) -> np.ndarray:
    """Noise that is not white: what a fit leaves of gears is larger at few waves per turn."""
    white = np.random.default_rng(seed).normal(0.0, 1e-6, len(angle))
    return white + np.convolve(white, np.exp(-np.arange(100) / 20.0), "same")


def test_noise_of_its_own_colour_is_no_wave() -> None:
    """One search in ten thousand may find one, by the test's own count; its noise is an estimate, so say a hundred."""
    assert sum(bool(find_waves(ANGLE, left_of(noise(seed)), BAND, ())) for seed in range(30)) <= 1


@pytest.mark.parametrize("cycles", [22.0, 78.0, 338.0, 133.4])
def test_a_wave_in_no_list_is_found_to_its_number(cycles: float) -> None:
    lead = noise(1) + 2e-6 * np.sin(cycles * ANGLE + 0.4)
    (found,) = find_waves(ANGLE, left_of(lead), BAND, (1144.0, 26.0))
    # whole where noise hides the difference, else where the top is: 0.4 per turn is no whole number
    assert found == pytest.approx(cycles, abs=0.0 if cycles % 1.0 == 0.0 else 0.1)


def test_the_strongest_is_found_first_and_an_expected_one_that_is_not_there_is_not() -> None:
    lead = noise(2) + 2e-6 * np.sin(78.0 * ANGLE) + 8e-6 * np.cos(190.0 * ANGLE)
    assert find_waves(ANGLE, left_of(lead), BAND, (338.0,)) == [190.0, 78.0]


def test_on_a_short_way_an_expected_wave_is_preferred_to_its_neighbours() -> None:
    """Eight degrees tell 44 waves per turn apart: 572 and 573 are one."""
    angle = np.linspace(-0.067, 0.067, 2000)
    lead = np.random.default_rng(3).normal(0.0, 1e-6, 2000) + 2e-6 * np.sin(572.0 * angle)
    assert find_waves(angle, left_of(lead, angle), Band(360.0, 4800.0), (572.0, 564.0, 1144.0)) == [572.0]


def test_the_power_of_noise_is_its_variance() -> None:
    white = np.random.default_rng(4).normal(0.0, 1e-6, len(ANGLE))
    seen = spectrum(ANGLE, white, BAND)
    # exponentially distributed, 1370 tried waves of which a quarter are independent
    assert float(seen.power.mean()) == pytest.approx(1e-12, rel=0.2)
    assert float(np.median(seen.noise)) == pytest.approx(1e-12, rel=0.2)
