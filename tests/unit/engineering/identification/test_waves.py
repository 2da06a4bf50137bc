"""Waves, single ones and those of teeth, are found where they are, by data alone, and noise is not taken for one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from gantryctl.engineering.identification.samples import Samples
from gantryctl.engineering.identification.waves import (
    Band,
    ToothWaves,
    find_waves,
    spectrum,
    tooth_waves,
    waves_of,
)

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


# One sample each 0.3 deg, both ways; the last 2.4 deg of the travel are not read.
TURNS = np.concatenate([np.linspace(-3.1, 3.1, 1200), np.linspace(3.1, -3.1, 1200)])
WAYS = np.repeat([1.0, -1.0], 1200)
BEYOND = range(9, 193)


def judged(left: np.ndarray) -> ToothWaves:
    zero = np.zeros_like(TURNS)
    turns = Samples(TURNS, TURNS - left, TURNS, WAYS, zero, zero, np.arange(len(TURNS)) // 100.0)
    return tooth_waves(turns, left, BEYOND)


def teeth(seed: int, size_rad: float, at: np.ndarray = TURNS) -> np.ndarray:
    """What 338 teeth of independent deviations add to the lead."""
    deviations = np.random.default_rng(seed).normal(0.0, size_rad, 338)
    return np.interp((at + np.pi) / (2.0 * np.pi) * 338.0, np.arange(338), deviations)


def read(seed: int) -> np.ndarray:
    """Noise of a tracker, 4 urad over ten readings."""
    return np.random.default_rng(seed).normal(0.0, 1.2e-6, len(TURNS))


@pytest.mark.parametrize("size_rad", [4e-6, 1e-6])
def test_teeth_that_come_again_are_found(size_rad: float) -> None:
    """10 um at 2.4 m and a quarter of it; what runs from tooth to tooth has a tenth of its power beyond 192 waves."""
    found = judged(teeth(5, size_rad) + read(1))
    assert found.come_again
    assert found.left_part + found.half_width < 1.0
    at = np.linspace(-3.0, 3.0, 5001)
    wrong = waves_of(at, BEYOND) @ found.sines_rad - teeth(5, size_rad, at)
    assert np.std(wrong) < 0.5 * size_rad


def test_where_nothing_was_measured_teeth_are_not_made_up() -> None:
    """Two teeth at either end of the travel. Fitted to what was read alone, waves reach 16 times the teeth."""
    found = judged(teeth(5, 4e-6) + read(1))
    ends = np.concatenate([np.linspace(-np.pi, -3.1, 50), np.linspace(3.1, np.pi, 50)])
    assert np.max(np.abs(waves_of(ends, BEYOND) @ found.sines_rad)) < 3.0 * 4e-6


def lasting(seed: int, samples: float) -> np.ndarray:
    """Noise of 4 urad that lasts."""
    white = np.random.default_rng(seed).normal(0.0, 1.0, 4400)
    smooth = np.convolve(white, np.exp(-np.arange(2000) / samples))[2000:4400]
    return np.asarray(4e-6 * smooth / np.std(smooth))


def slipped(seed: int) -> np.ndarray:
    """A load that slips a hundred times, by 12 um each at 2.4 m."""
    rng = np.random.default_rng(seed)
    return np.cumsum(np.where(rng.uniform(size=2400) < 100.0 / 2400.0, rng.normal(0.0, 5e-6, 2400), 0.0))


@pytest.mark.parametrize(
    "liar",
    [
        lambda seed: 0.0 * TURNS,
        lambda seed: lasting(seed, 3.0),
        lambda seed: lasting(seed, 30.0),
        slipped,
        lambda seed: np.where(WAYS > 0.0, teeth(seed, 4e-6), teeth(seed + 100, 4e-6)),
    ],
    ids=["none", "lasts 1 deg", "lasts 10 deg", "slips", "other teeth each way"],
)
def test_what_does_not_come_again_is_not_taken_for_teeth(liar: Callable[[int], np.ndarray]) -> None:
    """By its own count the test would err once in ten thousand."""
    assert not any(judged(liar(seed) + read(seed + 50)).come_again for seed in range(6))


def test_one_wave_that_both_turns_show_is_no_row_of_teeth() -> None:
    """As large as teeth are, and not one of 368 that chance could have made alike."""
    assert not judged(4e-6 * np.sin(78.0 * TURNS) + read(1)).come_again
