"""What makes an instrument's angle wrong: sources of error with size, distribution and pattern over angle and time.

A source is a standard uncertainty (JCGM 100:2008, 4.2 and 4.3) and what one unit of it does to a reading. Its draws act
in one of three ways: one value for the whole set-up (the systematic part of a tracker's MPE, a centre, a radius), one
value for each reading (noise), or a value that drifts (turbulence, a stand that creeps: a first-order Gauss-Markov
process, whose correlation is e^(-|dt| / tau)). The same sources make the budget, the Monte Carlo and a simulated
instrument.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.instruments.port import Reading, checked
from gantryctl.errors import InstrumentError, UsageError

Floats = NDArray[np.float64]
# (angles_deg, times_s), both of shape (readings,), to deg per unit, shape (readings, draws).
Pattern = Callable[[Floats, Floats], Floats]
Distribution = Literal["normal", "rectangular"]
# Degrees of freedom of an estimate that may be a quarter wrong: 1/2 (0.25)^-2 (JCGM 100, G.4.2).
ESTIMATED: Final = 8.0


class Acting(Enum):
    """How the draws of a source act."""

    SETUP = "set-up"
    READING = "reading"
    DRIFTING = "drifting"


@dataclass(frozen=True)
class Source:
    """One source of error.

    Attributes:
        name: for the budget. value: standard uncertainty, in `unit`. distribution: of what is drawn.
        pattern: what one unit does, deg; a source that acts on each reading or drifts has one column.
        degrees_of_freedom: of `value`; infinite for a limit that a maker guarantees.
        correlation_s: time over which a drifting one stays alike.
    """

    name: str
    value: float
    unit: str
    distribution: Distribution
    pattern: Pattern
    acting: Acting = Acting.SETUP
    degrees_of_freedom: float = math.inf
    correlation_s: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and self.value >= 0.0):
            raise UsageError(f"{self.name}: {self.value:g} {self.unit}: must be 0 or above")
        if self.acting is Acting.DRIFTING and not (
            math.isfinite(self.correlation_s) and self.correlation_s > 0.0
        ):
            raise UsageError(f"{self.name}: correlation time {self.correlation_s:g} s: must be above 0")

    def covariance(self, angles_deg: Floats, times_s: Floats) -> Floats:
        """Of readings at these places and times for one unit, deg2 per unit2, shape (readings, readings)."""
        pattern = self.pattern(angles_deg, times_s)
        if self.acting is Acting.SETUP:
            return np.asarray(pattern @ pattern.T)
        one = pattern[:, 0]
        if self.acting is Acting.READING:
            return np.diag(one**2)
        apart = np.abs(times_s[:, None] - times_s[None, :])
        return np.asarray(np.outer(one, one) * np.exp(-apart / self.correlation_s))

    def draws(self, angles_deg: Floats, times_s: Floats, count: int, rng: np.random.Generator) -> Floats:
        """Errors of readings in so many set-ups, deg, shape (count, readings); times must not fall."""
        pattern = self.value * self.pattern(angles_deg, times_s)
        if self.acting is Acting.SETUP:
            return np.asarray(self.standard(rng, (count, pattern.shape[1])) @ pattern.T)
        fresh = self.standard(rng, (count, len(angles_deg)))
        if self.acting is Acting.DRIFTING:
            kept = np.exp(-np.diff(times_s) / self.correlation_s)
            for k, part in enumerate(kept, 1):
                fresh[:, k] = part * fresh[:, k - 1] + math.sqrt(1.0 - part * part) * fresh[:, k]
        return np.asarray(fresh * pattern[:, 0])

    def standard(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
        """Values of this distribution with a standard deviation of 1."""
        if self.distribution == "normal":
            return rng.normal(0.0, 1.0, shape)
        return rng.uniform(-math.sqrt(3.0), math.sqrt(3.0), shape)


def _along(scale_deg: float) -> Pattern:
    """The same at every reading."""
    return lambda angles, _: np.full((len(angles), 1), scale_deg)


def _waves(cycles: float, size_deg: float) -> Pattern:
    """A wave of unknown phase: a sine and a cosine, each of this size; everywhere that is its root mean square."""
    return lambda angles, _: (
        size_deg
        * np.stack([np.sin(cycles * np.radians(angles)), np.cos(cycles * np.radians(angles))], axis=-1)
    )


_MPE: Final = 1.0 / math.sqrt(3.0)
_ARCSEC: Final = 1.0 / 3600.0


@dataclass(frozen=True)
class TrackerStand:
    """Place of a laser tracker, and the circle on which its target moves, m.

    Attributes:
        radius_m: of the circle. before_m: of its plane, along the axis. aside_m: beside the axis, horizontally.
    """

    radius_m: float = 2.5
    before_m: float = 4.0
    aside_m: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius_m) and self.radius_m > 0.0):
            raise UsageError(f"tracker: radius {self.radius_m:g} m: must be above 0")

    @property
    def range_m(self) -> float:
        """Mean distance to the target."""
        return math.hypot(self.radius_m, self.before_m, self.aside_m)

    def tangential(self, errors: Callable[[Floats, Floats, Floats], Floats]) -> Pattern:
        """What errors of range, azimuth and elevation do to the angle about the centre that the tracker has fitted.

        Args:
            errors: (range in m, azimuth, elevation in rad), each (points,), to errors of the same three as lengths in
                m along range, azimuth and elevation, shape (points, 3, draws).
        """

        def shifts(theta: Floats) -> Floats:
            """Errors in the plane of the circle, m: (points,) -> (points, 2, draws)."""
            x = self.radius_m * np.cos(theta) - self.aside_m
            y = self.radius_m * np.sin(theta)
            flat = np.hypot(x, self.before_m)
            far = np.hypot(flat, y)
            made = errors(far, np.arctan2(x, self.before_m), np.arcsin(y / far))
            # Unit vectors of range, azimuth and elevation, as far as they lie in the plane.
            to_x = np.stack([x / far, self.before_m / flat, -x * y / (flat * far)], axis=-1)
            to_y = np.stack([y / far, np.zeros_like(far), flat / far], axis=-1)
            return np.stack([np.einsum("pk,pkd->pd", each, made) for each in (to_x, to_y)], axis=1)

        whole = np.linspace(0.0, 2.0 * math.pi, 72, endpoint=False)
        # A circle through points all round takes their mean error for its centre.
        centre = shifts(whole).mean(axis=0)

        def along_deg(angles_deg: Floats, times_s: Floats) -> Floats:
            theta = np.radians(angles_deg)
            moved = shifts(theta) - centre
            along = -np.sin(theta)[:, None] * moved[:, 0] + np.cos(theta)[:, None] * moved[:, 1]
            return np.asarray(np.degrees(along / self.radius_m))

        return along_deg


def tracker_sources(stand: TrackerStand = TrackerStand(), noise_um: float = 10.0) -> tuple[Source, ...]:
    """A laser tracker by the maximum permissible errors of its parts, ISO 10360-10:2021, annex D: MPE = A + K L.

    The figures are those of a current absolute tracker (its manual: e_T +-15 um + 6 um/m across the beam, e_ADM +-10 um
    + 0.3 um/m along it). A acts as an offset of the beam, K as eccentric angle encoders (waves of one and two cycles in
    azimuth and elevation): one value for a set-up, uniform within its limit.
    """

    def offset(far: Floats, azimuth: Floats, elevation: Floats) -> Floats:
        made = np.zeros((len(far), 3, 2))
        made[:, 1, 0] = made[:, 2, 1] = 1e-6
        return made

    def encoders(far: Floats, azimuth: Floats, elevation: Floats) -> Floats:
        made = np.zeros((len(far), 3, 8))
        for axis, angle in ((1, azimuth), (2, elevation)):
            first = 4 * (axis - 1)
            for k, wave in enumerate(
                (np.sin(angle), np.cos(angle), np.sin(2.0 * angle), np.cos(2.0 * angle))
            ):
                # Two waves of both kinds make up the whole of the limit.
                made[:, axis, first + k] = 1e-6 * far * wave / math.sqrt(2.0)
        return made

    def distance(far: Floats, azimuth: Floats, elevation: Floats) -> Floats:
        made = np.zeros((len(far), 3, 1))
        made[:, 0, 0] = 1e-6 * (10.0 + 0.3 * far) / (10.0 + 0.3 * stand.range_m)
        return made

    um = math.degrees(1e-6 / stand.radius_m)
    return (
        Source("tracker, offset of the beam (MPE A = 15 um)", 15.0 * _MPE, "um", "rectangular",
               stand.tangential(offset)),
        Source("tracker, angle encoders (MPE K = 6 um/m)", 6.0 * _MPE, "um/m", "rectangular",
               stand.tangential(encoders)),
        Source("tracker, distance (MPE 10 um + 0.3 um/m)", (10.0 + 0.3 * stand.range_m) * _MPE, "um",
               "rectangular", stand.tangential(distance)),
        # A circle through some dozen points of 10 um on two thirds of a turn.
        Source("centre of the circle", 10.0, "um", "normal", _waves(1.0, um), degrees_of_freedom=ESTIMATED),
        # Steel grows by 11.5 ppm a kelvin, and the gantry is not measured warmer than half a kelvin.
        Source("radius, temperature", 5.0, "ppm", "normal", lambda a, _: 1e-6 * a[:, None],
               degrees_of_freedom=ESTIMATED),
        Source("noise of a reading", noise_um, "um", "normal", _along(um), Acting.READING),
        # Some 0.5 um/m over some metres of room air.
        Source("turbulence of the air", 0.5 * stand.range_m, "um", "normal", _along(um), Acting.DRIFTING,
               ESTIMATED, 5.0),
        # Stands in air-conditioned rooms creep by some 0.01 mm an hour.
        Source("drift of the stand", 10.0, "um", "normal", _along(um), Acting.DRIFTING, ESTIMATED, 3600.0),
    )  # fmt: skip


def level_sources() -> tuple[Source, ...]:
    """An electronic level on an indexing base, set to zero at each base: estimates of the class of 0.05 % and 2 urad.

    Its plane that does not contain gravity reads atan(tan a cos t) for a tilt t: - t^2/4 sin 2a to second order.
    """
    urad = math.degrees(1e-6)
    return (
        Source("level, scale (+-0.05 % of its way)", 5e-4 * _MPE, "-", "rectangular",
               lambda a, _: _from_quarter(a)[:, None], degrees_of_freedom=ESTIMATED),
        Source("level, linearity (+-10 urad)", 10.0 * _MPE, "urad", "rectangular", _waves(12.0, urad),
               degrees_of_freedom=ESTIMATED),
        Source("level, tilt of its plane (0.1 deg)", math.radians(0.1) ** 2 / 4.0, "-", "normal",
               lambda a, _: -math.degrees(1.0) * np.sin(2.0 * np.radians(a))[:, None],
               degrees_of_freedom=ESTIMATED),
        Source("indexing base (+-0.5 arcsec)", 0.5 * _ARCSEC * _MPE, "deg", "rectangular",
               lambda a, _: _by_place(np.round(a / 90.0) % 4.0, 4), degrees_of_freedom=ESTIMATED),
        Source("noise of a reading", 2.0, "urad", "normal", _along(urad), Acting.READING),
        Source("drift of its zero", 5.0, "urad", "normal", _along(urad), Acting.DRIFTING, ESTIMATED, 3600.0),
    )  # fmt: skip


def _from_quarter(angles_deg: Floats) -> Floats:
    return np.asarray(angles_deg - 90.0 * np.round(angles_deg / 90.0))


def _by_place(places: Floats, count: int) -> Floats:
    """One draw for each place, numbered from 0: (readings,) -> (readings, count)."""
    return np.asarray((places[:, None] == np.arange(count)[None, :]).astype(np.float64))


# Faces of the polygon, and the way from one to the next.
FACES: Final = 24
_FACE_DEG: Final = 360.0 / FACES


def autocollimator_sources() -> tuple[Source, ...]:
    """An autocollimator on a polygon of 24 faces, one every 15 deg: it reads how far a face stands beside its place."""
    return (
        Source("polygon, angle of a face (+-0.25 arcsec)", 0.25 * _ARCSEC * _MPE, "deg",
               "rectangular", lambda a, _: _by_place(_faces(a), FACES)),
        Source("autocollimator, scale (+-1 % of what it reads)", 0.01 * _MPE, "-", "rectangular",
               lambda a, _: _beside_face(a)[:, None]),
        Source("autocollimator, periodic error (+-0.1 arcsec)", 0.1 * _ARCSEC * _MPE, "deg", "rectangular",
               _along(1.0), Acting.READING),
        Source("noise of a reading", 0.05 * _ARCSEC, "deg", "normal", _along(1.0), Acting.READING),
        Source("turbulence of the air", 0.1 * _ARCSEC, "deg", "normal", _along(1.0), Acting.DRIFTING, ESTIMATED, 5.0),
        Source("drift of its stand", 0.5 * _ARCSEC, "deg", "normal", _along(1.0), Acting.DRIFTING, ESTIMATED,
               3600.0),
    )  # fmt: skip


def _faces(angles_deg: Floats) -> Floats:
    """Number of the face that is seen.

    Raises:
        UsageError: no face is.
    """
    # An autocollimator sees a tenth of a degree at most.
    beside = np.abs(_beside_face(angles_deg)) > 0.1
    if np.any(beside):
        raise UsageError(
            f"autocollimator: at {angles_deg[beside][0]:.1f} deg it sees no face of the polygon, which has one every "
            f"{_FACE_DEG:g} deg: choose bases and displacements that are multiples of it (--displacement 15)"
        )
    return np.asarray(np.round(angles_deg / _FACE_DEG) % FACES)


def _beside_face(angles_deg: Floats) -> Floats:
    """What the autocollimator reads: how far the axis stands beside the next place of a face."""
    return np.asarray(angles_deg - _FACE_DEG * np.round(angles_deg / _FACE_DEG))


def ring_encoder_sources(
    radius_m: float = 2.0, eccentricity_um: float = 50.0, heads: Literal[1, 2] = 1
) -> tuple[Source, ...]:
    """An encoder on a ring: eccentricity e of its scale on the radius R.

    One head reads theta + sum of (-1)^(n+1)/n (e/R)^n sin n(theta - phase): once a turn, with e/R. The mean of two
    heads that face each other has the even terms alone: twice a turn, with (e/R)^2 / 2.

    Args:
        radius_m: of the scale. eccentricity_um: largest; its direction is not known.
    """
    if not (math.isfinite(radius_m) and radius_m > 0.0):
        raise UsageError(f"ring encoder: radius {radius_m:g} m: must be above 0")
    if heads not in (1, 2):
        raise UsageError(f"ring encoder: {heads} heads: 1 or 2")
    off = eccentricity_um * 1e-6 / radius_m
    eccentric = (
        Source(f"eccentricity of the scale ({eccentricity_um:g} um)", eccentricity_um * _MPE, "um", "rectangular",
               _waves(1.0, math.degrees(1e-6 / radius_m) / math.sqrt(2.0)), degrees_of_freedom=ESTIMATED)
        if heads == 1
        else Source(f"eccentricity of the scale ({eccentricity_um:g} um), two heads", 0.5 * off**2 * _MPE, "rad",
                    "rectangular", _waves(2.0, math.degrees(1.0) / math.sqrt(2.0)), degrees_of_freedom=ESTIMATED)
    )  # fmt: skip
    return (
        eccentric,
        # What two heads leave: a ring that is bent oval, lines that are laid on it.
        Source("graduation, waves of a turn (+-2 arcsec)", 2.0 * _ARCSEC * _MPE, "deg", "rectangular",
               lambda a, t: np.hstack([_waves(n, 1.0 / math.sqrt(3.0))(a, t) for n in (2.0, 4.0, 6.0)]),
               degrees_of_freedom=ESTIMATED),
        Source("interpolation of a line (+-0.1 arcsec)", 0.1 * _ARCSEC * _MPE, "deg", "rectangular", _along(1.0),
               Acting.READING, ESTIMATED),
        Source("noise of a reading", 2e-7, "rad", "normal", _along(math.degrees(1.0)), Acting.READING),
        Source("ring against the base, temperature", 2.0, "urad", "normal", _along(math.degrees(1e-6)),
               Acting.DRIFTING, ESTIMATED, 3600.0),
    )  # fmt: skip


INSTRUMENTS: Final = ("tracker", "level", "autocollimator", "ring-encoder", "ring-encoder-2-heads")


def sources_of(instrument: str, radius_m: float = 2.5, noise_um: float = 10.0) -> tuple[Source, ...]:
    """Sources of an instrument by its name, of `INSTRUMENTS`.

    Args:
        radius_m, noise_um: of a tracker's target circle and of its reading.

    Raises:
        UsageError: another name, or a radius or noise that cannot be.
    """
    match instrument:
        case "tracker":
            return tracker_sources(TrackerStand(radius_m), noise_um)
        case "level":
            return level_sources()
        case "autocollimator":
            return autocollimator_sources()
        case "ring-encoder":
            return ring_encoder_sources()
        case "ring-encoder-2-heads":
            return ring_encoder_sources(heads=2)
    raise UsageError(f"instrument {instrument!r}: there are {', '.join(INSTRUMENTS)}")


class SimulatedInstrument:
    """Reads the true angle of a simulated load through sources of error, and states their uncertainty.

    Args:
        name: what it is. truth_deg: true angle at a time, deg. seed: of the set-up and of every reading.
    """

    def __init__(
        self, name: str, truth_deg: Callable[[float], float], sources: Sequence[Source], seed: int
    ) -> None:
        self.name = f"simulated {name}, seed {seed}"
        self._truth_deg, self._sources, self._seed = truth_deg, tuple(sources), seed
        self._rng = np.random.default_rng([seed, 1])
        self._setup: dict[int, Floats] = {}
        self._drifts: dict[int, tuple[float, float]] = {}

    def read(self, time_s: float) -> Reading:
        """One reading at a time of the axis, s; times must not fall.

        Raises:
            InstrumentError: the true angle is not one that can be read, or it sees nothing there.
        """
        true_deg = self._truth_deg(time_s)
        angles, times = np.array([true_deg]), np.array([time_s])
        error = variance = 0.0
        for k, source in enumerate(self._sources):
            try:
                pattern = source.value * source.pattern(angles, times)[0]
            except UsageError as blind:
                raise InstrumentError(f"{self.name}: {blind}") from None
            error += float(pattern @ self._drawn(k, source, len(pattern), time_s))
            variance += float(pattern @ pattern)
        return checked(Reading(true_deg + error, math.sqrt(variance)), self.name)

    def _drawn(self, number: int, source: Source, size: int, time_s: float) -> Floats:
        """Draws of a source for a reading at a time."""
        if source.acting is Acting.SETUP:
            if number not in self._setup:
                own = np.random.default_rng([self._seed, 2, number])
                self._setup[number] = source.standard(own, (size,))
            return self._setup[number]
        fresh = source.standard(self._rng, (1,))
        if source.acting is Acting.DRIFTING:
            if number in self._drifts:
                last_s, last = self._drifts[number]
                part = math.exp(-max(0.0, time_s - last_s) / source.correlation_s)
                fresh = part * last + math.sqrt(1.0 - part * part) * fresh
            self._drifts[number] = (time_s, float(fresh[0]))
        return fresh
