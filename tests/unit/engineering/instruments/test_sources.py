"""Sources of error against geometry done without series or projections, and what is drawn against what is stated."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.instruments.sources import (
    INSTRUMENTS,
    Acting,
    SimulatedInstrument,
    Source,
    TrackerStand,
    autocollimator_sources,
    ring_encoder_sources,
    sources_of,
)
from gantryctl.errors import InstrumentError, UsageError

ROUND = np.arange(0.0, 360.0, 1.0)
STAND = TrackerStand()


def scale_reading(theta: np.ndarray, offset: float, head: float) -> np.ndarray:
    """Angle that a head sees on a ring of radius 1 whose centre lies `offset` beside the axis, turned by theta."""
    x, y = offset * np.cos(theta), offset * np.sin(theta)
    seen = np.arctan2(math.sin(head) - y, math.cos(head) - x) - theta - head
    return np.asarray(-((seen + math.pi) % (2.0 * math.pi) - math.pi))


def wave(values: np.ndarray, cycles: int) -> float:
    """Amplitude of a wave over one turn."""
    return float(2.0 * abs(np.mean(values * np.exp(-1j * cycles * np.radians(ROUND)))))


def test_an_eccentric_ring_is_wrong_once_a_turn_and_with_two_heads_twice() -> None:
    """50 um on 2 m and, to see the square, on 0.02 m: e/R, and (e/R)^2/2 of the mean of two heads."""
    theta = np.radians(ROUND)
    for off in (2.5e-5, 2.5e-3):
        one = scale_reading(theta, off, 0.0) - theta
        error = (one + math.pi) % (2.0 * math.pi) - math.pi
        assert wave(error, 1) == pytest.approx(off, rel=1e-3)
        two = scale_reading(theta, off, math.pi) - theta
        mean = 0.5 * (error + (two + math.pi) % (2.0 * math.pi) - math.pi)
        assert wave(mean, 1) < 1e-6 * off
        assert wave(mean, 2) == pytest.approx(0.5 * off**2, rel=1e-3)
    limit = math.sqrt(3.0)
    for heads, amplitude in ((1, 2.5e-5), (2, 0.5 * 2.5e-5**2)):
        source = ring_encoder_sources(radius_m=2.0, eccentricity_um=50.0, heads=heads)[0]  # type: ignore[arg-type]
        rms = source.value * math.sqrt(float(np.mean(np.diag(source.covariance(ROUND, ROUND)))))
        # Root mean square of a wave of that amplitude, uniform up to it: 1/sqrt(2) x 1/sqrt(3).
        assert math.radians(rms) == pytest.approx(amplitude / math.sqrt(2.0) / limit, rel=1e-9)


def through_the_tracker(angles_deg: np.ndarray, azimuth: float, elevation: float, far: float) -> np.ndarray:
    """Angles about the fitted centre, deg: points to range and angles, errors added, and back; no derivative."""

    def seen(theta: np.ndarray) -> np.ndarray:
        x = STAND.radius_m * np.cos(theta) - STAND.aside_m
        y, z = STAND.radius_m * np.sin(theta), np.full_like(theta, STAND.before_m)
        r = np.sqrt(x * x + y * y + z * z)
        az, el = np.arctan2(x, z), np.arcsin(y / r)
        # As eccentric encoders: one sine in azimuth, one double sine in elevation.
        az, el, r = az + azimuth * np.sin(az), el + elevation * np.sin(2.0 * el), r + far
        return np.stack([r * np.cos(el) * np.sin(az), r * np.sin(el)], axis=-1)

    centre = seen(np.linspace(0.0, 2.0 * math.pi, 72, endpoint=False)).mean(axis=0)
    points = seen(np.radians(angles_deg)) - centre
    return np.degrees(np.unwrap(np.arctan2(points[:, 1], points[:, 0])))


def test_a_tracker_s_errors_are_those_of_its_geometry() -> None:
    """The azimuth is an angle, its error as a length is range x cos(elevation) x that: the wave of 1 um/m is larger."""
    angles = np.arange(-110.0, 111.0, 10.0)

    def made(far: np.ndarray, azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
        found = np.zeros((len(far), 3, 3))
        found[:, 1, 0] = 1e-6 * far * np.cos(elevation) * np.sin(azimuth)
        found[:, 2, 1] = 1e-6 * far * np.sin(2.0 * elevation)
        found[:, 0, 2] = 1e-6
        return found

    linear = STAND.tangential(made)(angles, angles)
    for k, errors in enumerate(((1e-6, 0.0, 0.0), (0.0, 1e-6, 0.0), (0.0, 0.0, 1e-6))):
        exact = through_the_tracker(angles, *errors) - through_the_tracker(angles, 0.0, 0.0, 0.0)
        assert linear[:, k] == pytest.approx(exact, abs=2e-3 * float(np.abs(exact).max()) + 1e-12)


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_what_is_drawn_has_the_covariance_that_is_stated(name: str) -> None:
    angles, times = np.array([0.0, 15.0, 30.0, 90.0, 105.0]), np.array([0.0, 3.0, 60.0, 90.0, 2000.0])
    rng = np.random.default_rng(4)
    for source in sources_of(name):
        stated = source.value**2 * source.covariance(angles, times)
        drawn = source.draws(angles, times, 20_000, rng)
        # 20,000 draws: a covariance is known to 1 % of the largest variance, 4 % are four standard deviations.
        assert np.cov(drawn.T) == pytest.approx(stated, abs=0.04 * float(stated.max()) + 1e-24)


def test_drift_forgets_with_its_time() -> None:
    drift = Source(
        "d", 1.0, "deg", "normal", lambda a, _: np.ones((len(a), 1)), Acting.DRIFTING, correlation_s=100.0
    )
    covariance = drift.covariance(np.zeros(3), np.array([0.0, 100.0, 1000.0]))
    assert covariance[0].tolist() == pytest.approx([1.0, math.exp(-1.0), math.exp(-10.0)])


def test_a_polygon_shows_its_faces_and_nothing_between() -> None:
    face = autocollimator_sources()[0]
    seen = face.covariance(np.array([0.0, 15.02, -345.0, 30.0]), np.zeros(4))
    # 15 deg and -345 deg are one face: the same error.
    assert seen.tolist() == [[1, 0, 0, 0], [0, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 1]]
    faces = [each for each in autocollimator_sources() if each.name.startswith("polygon")]
    angle = iter((0.0, 15.0, 0.0))
    instrument = SimulatedInstrument("polygon", lambda _: next(angle), faces, 1)
    first, other, again = (instrument.read(t).angle_deg for t in (0.0, 1.0, 2.0))
    assert first == again
    assert other - 15.0 != pytest.approx(first, abs=1e-6)
    with pytest.raises(UsageError, match=r"at 95\.0 deg it sees no face .* every 15 deg"):
        face.covariance(np.array([90.0, 95.0]), np.zeros(2))
    with pytest.raises(InstrumentError, match="sees no face"):
        SimulatedInstrument("polygon", lambda _: 95.0, faces, 1).read(0.0)


def test_an_indexing_base_errs_at_every_quarter_on_either_side_of_zero() -> None:
    """-90 and 270 deg are one place, with one error; 0, 90 and 180 deg have theirs."""
    (base,) = (each for each in sources_of("level") if each.name.startswith("indexing base"))
    angles = np.array([-90.0, 270.0, 0.0, 90.0, -180.0])
    seen = base.covariance(angles, np.zeros(5))
    expected = np.eye(5)
    expected[0, 1] = expected[1, 0] = 1.0
    assert seen.tolist() == expected.tolist()


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_a_simulated_instrument_states_what_it_is_wrong_by(name: str) -> None:
    readings = [
        SimulatedInstrument(name, lambda _: 30.0, sources_of(name), seed).read(10.0) for seed in range(150)
    ]
    wrong = np.array([reading.angle_deg - 30.0 for reading in readings])
    # 150 draws know a standard deviation to 6 %.
    assert math.sqrt(float(np.mean(wrong**2))) == pytest.approx(readings[0].uncertainty_deg, rel=0.18)


def test_the_systematic_part_is_the_same_at_every_reading_of_a_set_up() -> None:
    systematic = [each for each in sources_of("tracker") if each.acting is Acting.SETUP]
    one = SimulatedInstrument("tracker", lambda t: 10.0 * t, systematic, 3)
    first, other, again = one.read(1.0), one.read(2.0), one.read(1.0)
    assert first.angle_deg == again.angle_deg
    assert other.angle_deg - 20.0 != pytest.approx(first.angle_deg - 10.0, abs=1e-7)
    whole = [SimulatedInstrument("tracker", lambda t: t, sources_of("tracker"), 3) for _ in range(2)]
    assert [each.read(t) for each in whole[:1] for t in (1.0, 9.0)] == [
        each.read(t) for each in whole[1:] for t in (1.0, 9.0)
    ]


def test_what_cannot_be_is_refused() -> None:
    for wrong in (-1.0, math.nan, math.inf):
        with pytest.raises(UsageError, match="must be 0 or above"):
            sources_of("tracker", noise_um=wrong)
        with pytest.raises(UsageError, match="must be above 0"):
            sources_of("tracker", radius_m=wrong)
        with pytest.raises(UsageError, match="must be above 0"):
            ring_encoder_sources(radius_m=wrong)
    with pytest.raises(UsageError, match="there are tracker, level"):
        sources_of("theodolite")


def test_a_drift_goes_to_and_fro_and_not_away() -> None:
    """Of 1 deg within a second: at one moment the same twice, a minute later another, and 1 deg in the mean square.

    600 of them tell a standard deviation to 3 %.
    """
    source = Source(
        "drift", 1.0, "deg", "normal", lambda a, _: np.ones((len(a), 1)), Acting.DRIFTING, correlation_s=1.0
    )
    instrument = SimulatedInstrument("drifting", lambda _: 0.0, [source], 3)
    read = np.array([[instrument.read(60.0 * k).angle_deg for _ in range(2)] for k in range(600)])
    assert read[:, 0].tolist() == read[:, 1].tolist()
    assert np.std(read[:, 0]) == pytest.approx(1.0, rel=0.1)
    assert abs(np.corrcoef(read[1:, 0], read[:-1, 0])[0, 1]) < 0.15


@pytest.mark.parametrize("angle_deg", [10.0, 45.0, 80.0, -30.0, 90.0])
def test_a_level_whose_plane_leans_reads_less_than_the_angle(angle_deg: float) -> None:
    """atan(tan a cos t) - a for a tilt t of 0.1 deg; half a second of arc at 45 deg, nothing at 0 and 90."""
    (lean,) = (each for each in sources_of("level") if each.name.startswith("level, tilt"))
    pattern = lean.value * lean.pattern(np.array([angle_deg]), np.zeros(1))[0, 0]
    a, tilt = np.radians(angle_deg), np.radians(0.1)
    seen = np.degrees(np.arctan2(np.sin(a) * np.cos(tilt), np.cos(a)) - a)
    assert pattern == pytest.approx(seen, abs=1e-9)
