"""The simulated tracker: what it states must be what it errs by."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.instruments import SimulatedTracker, TrackerErrors
from gantryctl.errors import InstrumentError, UsageError

ONLY_NOISE = TrackerErrors(eccentricity_um=0.0, scale_ppm=0.0, drift_um_h=0.0)
# Far below everything that these tests look for.
QUIET = 1e-6


def errors_deg(errors: TrackerErrors, angle_deg: float, time_s: float, seeds: int) -> list[float]:
    """First readings of many set-ups, less the true angle."""
    return [
        SimulatedTracker(lambda _: angle_deg, seed, errors).read(time_s).angle_deg - angle_deg
        for seed in range(seeds)
    ]


@pytest.mark.parametrize(("angle_deg", "time_s"), [(0.0, 0.0), (110.0, 0.0), (-90.0, 7200.0), (35.0, 3600.0)])
def test_the_stated_uncertainty_is_the_spread_over_many_set_ups(angle_deg: float, time_s: float) -> None:
    errors = TrackerErrors(drift_um_h=15.0, scale_ppm=8.0)
    spread = np.std(errors_deg(errors, angle_deg, time_s, 3000))
    # A standard deviation of 3000 draws is known to 1 / sqrt(6000) = 1.3 %; three of them.
    assert spread == pytest.approx(errors.standard_uncertainty_deg(angle_deg, time_s), rel=0.04)


def test_noise_is_drawn_anew_and_the_same_by_seed() -> None:
    first, second = (SimulatedTracker(lambda _: 10.0, 4, ONLY_NOISE) for _ in range(2))
    readings = [first.read(0.0).angle_deg for _ in range(2000)]
    assert readings == [second.read(0.0).angle_deg for _ in range(2000)]
    # 10 um at 2.5 m; 2000 draws give a standard deviation to 1.6 %.
    assert np.std(readings) == pytest.approx(math.degrees(10e-6 / 2.5), rel=0.05)
    assert np.mean(readings) == pytest.approx(10.0, abs=3e-5)


def test_eccentricity_is_one_wave_a_turn() -> None:
    tracker_at = lambda a: SimulatedTracker(  # noqa: E731
        lambda _: a, 1, TrackerErrors(noise_um=QUIET, eccentricity_um=30.0, scale_ppm=0.0, drift_um_h=0.0)
    )
    angles = np.arange(-180.0, 180.0, 10.0)
    error = np.array([tracker_at(float(a)).read(0.0).angle_deg - a for a in angles])
    wave = np.column_stack((np.sin(np.radians(angles)), np.cos(np.radians(angles))))
    _, rest, *_ = np.linalg.lstsq(wave, error, rcond=None)
    assert np.max(np.abs(error)) > 1e-4
    assert math.sqrt(float(rest[0]) / len(angles)) < 1e-6


def test_scale_and_drift_go_with_angle_and_time() -> None:
    errors = TrackerErrors(noise_um=QUIET, eccentricity_um=0.0, scale_ppm=20.0, drift_um_h=0.0)
    scaled = [
        SimulatedTracker(lambda _, a=a: a, 2, errors).read(0.0).angle_deg - a for a in (0.0, 50.0, 100.0)
    ]
    assert scaled[0] == pytest.approx(0.0, abs=1e-9)
    assert scaled[2] == pytest.approx(2.0 * scaled[1], rel=1e-3)
    errors = TrackerErrors(noise_um=QUIET, eccentricity_um=0.0, scale_ppm=0.0, drift_um_h=20.0)
    tracker = SimulatedTracker(lambda _: 5.0, 2, errors)
    drifted = [tracker.read(time_s).angle_deg - 5.0 for time_s in (0.0, 1800.0, 3600.0)]
    assert drifted[2] == pytest.approx(2.0 * drifted[1], rel=1e-3)
    assert abs(drifted[2]) > 1e-5


def test_an_angle_that_is_no_number_is_no_reading() -> None:
    with pytest.raises(InstrumentError, match="angle nan deg"):
        SimulatedTracker(lambda _: math.nan, 0, TrackerErrors()).read(0.0)


@pytest.mark.parametrize(
    "wrong", [{"radius_m": 0.0}, {"noise_um": -1.0}, {"scale_ppm": math.nan}, {"drift_um_h": math.inf}]
)
def test_impossible_errors_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(UsageError, match="tracker"):
        TrackerErrors(**wrong)


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 90.0, -135.0, 170.0])
def test_a_target_is_seen_from_where_the_circle_was_fitted(angle_deg: float) -> None:
    """Its direction from a centre that lies beside the axis, by its own coordinates: exact to (x / R)^2, 2e-9 deg."""
    errors = TrackerErrors(noise_um=0.0, eccentricity_um=10.0, scale_ppm=0.0, drift_um_h=0.0)
    tracker = SimulatedTracker(lambda _: angle_deg, 3, errors)
    x, y = (1e-6 * each for each in tracker._centre_um)
    theta = math.radians(angle_deg)
    seen = math.atan2(2.5 * math.sin(theta) - y, 2.5 * math.cos(theta) - x)
    assert min(abs(x), abs(y), abs(x - y), abs(x + y)) > 1e-6
    assert tracker.read(0.0).angle_deg == pytest.approx(math.degrees(seen), abs=1e-7)
