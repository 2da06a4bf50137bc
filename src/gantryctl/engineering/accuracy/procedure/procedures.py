"""The chord test as data: stops, their order, and the earlier stop from which every chord is measured.

Nothing here knows how the axis is moved. A driver visits `Procedure.stops` in one continuous run, takes one
reading per stop (the mean angle over the last part of the dwell) and hands all readings to `evaluate`.

A   per base B and direction s: B - 10 s, B, then a staircase B + d s (recommended); 10: the approach
B   per base and direction: B, then out and back B + d s, B for every d
C   per base: B - 10, B, staircase up, and back down the same stops; the cw row is measured from the turning
    point
D   as B, with B - 5 (half of the approach), B before every d, so that the base is always approached counter-clockwise
E   short: per base and direction B, B + d s for one d, in the order that needs no way back; no reading of the
    paper's text (docs/explanation/accuracy.md)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gantryctl.engineering.accuracy.table import Direction, ErrorTable, FloatArray, Layout, RowKey
from gantryctl.errors import UsageError

PAPER_BASES_DEG = (90.0, 0.0, -90.0)
PAPER_DISPLACEMENTS_DEG = (5.0, 10.0, 15.0, 20.0)
# Procedure E: of the single displacements the one whose figures lie nearest to those of the whole test.
SHORT_DISPLACEMENTS_DEG = (15.0,)
# Procedure A finds at most this many times the A and the largest chord error of procedure E with 19 of 20 gears of
# the same grade: 1.29 and 1.35 of 120 random ones (tests/acceptance/test_chord.py).
WHOLE_BY_SHORT = 1.4
# Procedures A, C and E come to a base from at least this far away, procedure D from half of it below.
APPROACH_DEG = 10.0


class StopRole(Enum):
    """Purpose of a stop."""

    # Where the axis stands before the first move; held like every other stop, not measured.
    START = "start"
    # Gives the base its direction of approach; not measured.
    APPROACH = "approach"
    # One end of the chords that follow.
    BASE = "base"
    # The other end: one value of the table.
    POINT = "point"


class Chord(Enum):
    """Origin of a point's chord."""

    # From the base of its series: the error of the whole displacement.
    BASE = "base"
    # From the stop before: the error of that one step, not added up.
    ADJACENT = "adjacent"


@dataclass(frozen=True)
class ChordStop:
    """One standstill of the axis with a reading.

    Attributes:
        target_deg: where to go.
        base_deg, direction, run: the row of the table this stop belongs to.
        displacement_deg: the column; 0 for a base and for what is not measured.
        reference: index of the earlier stop at the other end of the chord; None for all but points.
    """

    target_deg: float
    role: StopRole
    base_deg: float
    direction: Direction
    displacement_deg: float = 0.0
    run: int = 1
    reference: int | None = None


@dataclass(frozen=True)
class Procedure:
    """A chord test, ready to be driven.

    Attributes:
        name: "A", "B", "C", "D" or "E".
        stops: in the order of the visit, runs after one another; the encoder zero is never touched in
            between.
        layout: where the stops of the rows lie (ISO 230-2 needs to know).
        whole_ratio: the whole test finds at most this many times the figures of this one, 95 %; 1 for a whole test.
    """

    name: str
    bases_deg: tuple[float, ...]
    displacements_deg: tuple[float, ...]
    runs: int
    chord: Chord
    stops: tuple[ChordStop, ...]
    layout: Layout
    whole_ratio: float = 1.0

    @property
    def start_deg(self) -> float:
        """Angle before the run begins."""
        return self.stops[0].target_deg

    @property
    def travel_deg(self) -> tuple[float, float]:
        """Smallest and largest target."""
        targets = [stop.target_deg for stop in self.stops]
        return min(targets), max(targets)

    @property
    def targets_rad(self) -> FloatArray:
        """Target of every stop, rad, shape (stops,)."""
        return np.radians([stop.target_deg for stop in self.stops])

    @property
    def rows(self) -> tuple[RowKey, ...]:
        """The rows of the error table in the order of their first point."""
        points = (stop for stop in self.stops if stop.role is StopRole.POINT)
        return tuple(dict.fromkeys(RowKey(stop.base_deg, stop.direction, stop.run) for stop in points))

    def nominal_deg(self, stop: ChordStop) -> float:
        """The displacement this chord should show, deg, always positive."""
        assert stop.reference is not None
        return abs(stop.target_deg - self.stops[stop.reference].target_deg)


def chord_procedure(
    name: str = "A",
    *,
    bases_deg: Sequence[float] = PAPER_BASES_DEG,
    displacements_deg: Sequence[float] | None = None,
    runs: int = 1,
    chord: Chord = Chord.BASE,
    approach_deg: float = APPROACH_DEG,
) -> Procedure:
    """The stop points of procedure `name`, with the paper's bases and displacements unless others are given; the short
    procedure E has one displacement of its own.

    Raises:
        UsageError: an unknown name, no base, displacements that do not ascend inside 0..180 deg, or no run.
    """
    if name not in _SERIES:
        raise UsageError(f"chord procedure {name!r}: there are {', '.join(_SERIES)}")
    if displacements_deg is None:
        displacements_deg = SHORT_DISPLACEMENTS_DEG if name == "E" else PAPER_DISPLACEMENTS_DEG
    _check(bases_deg, displacements_deg, runs)
    middle = 0.5 * (min(bases_deg) + max(bases_deg))
    stops: list[ChordStop] = []
    for run in range(1, runs + 1):
        for base in bases_deg:
            before = stops[-1].target_deg if stops else None
            way = _Way(float(base), tuple(map(float, displacements_deg)), approach_deg, before, middle)
            for stop in _SERIES[name](way):
                stops.append(replace(stop, run=run, reference=_reference(stop, stops, chord)))
    if stops[0].role is StopRole.APPROACH:
        stops[0] = replace(stops[0], role=StopRole.START)
    return Procedure(
        name=name,
        bases_deg=tuple(map(float, bases_deg)),
        displacements_deg=tuple(map(float, displacements_deg)),
        runs=runs,
        chord=chord,
        stops=tuple(stops),
        layout=_layout(name, chord),
        whole_ratio=WHOLE_BY_SHORT if name == "E" else 1.0,
    )


def _layout(name: str, chord: Chord) -> Layout:
    if chord is Chord.ADJACENT and name in ("A", "C"):
        return Layout.STEPS
    # Only procedure C comes back over the same stops: its reversal is a real one.
    return Layout.RETURN if name == "C" else Layout.APART


def _reference(stop: ChordStop, before: Sequence[ChordStop], chord: Chord) -> int | None:
    """Index of the stop the chord of `stop` is measured from, given all stops before it."""
    if stop.role is not StopRole.POINT:
        return None
    if chord is Chord.ADJACENT:
        return len(before) - 1
    # The latest visit counts: procedures B and D come back to the base before every displacement. Targets are
    # sums of the same decimals in another order, hence the tolerance.
    wanted = stop.target_deg - stop.direction.sign * stop.displacement_deg
    return next(k for k in reversed(range(len(before))) if abs(before[k].target_deg - wanted) < 1e-9)


class _Way(NamedTuple):
    """Series of one base, deg; `before`: the stop before, None for the first base; `middle`: of all bases."""

    base: float
    displacements: tuple[float, ...]
    approach: float
    before: float | None
    middle: float


def _staircase(way: _Way) -> Iterator[ChordStop]:
    """Procedure A."""
    base = way.base
    for direction in Direction:
        s = direction.sign
        # From the side of the following moves: lost motion is taken up before the series starts.
        yield ChordStop(base - way.approach * s, StopRole.APPROACH, base, direction)
        yield ChordStop(base, StopRole.BASE, base, direction)
        for d in way.displacements:
            yield ChordStop(base + d * s, StopRole.POINT, base, direction, d)


def _out_and_back(way: _Way) -> Iterator[ChordStop]:
    """Procedure B."""
    base = way.base
    for direction in Direction:
        yield ChordStop(base, StopRole.BASE, base, direction)
        for d in way.displacements:
            yield ChordStop(base + d * direction.sign, StopRole.POINT, base, direction, d)
            yield ChordStop(base, StopRole.BASE, base, direction)


def _up_and_down(way: _Way) -> Iterator[ChordStop]:
    """Procedure C: the cw row comes back over the stops of the ccw row and is measured from the farthest."""
    base = way.base
    top = base + way.displacements[-1]
    yield ChordStop(base - way.approach, StopRole.APPROACH, base, Direction.CCW)
    yield ChordStop(base, StopRole.BASE, base, Direction.CCW)
    for d in way.displacements:
        yield ChordStop(base + d, StopRole.POINT, base, Direction.CCW, d)
    for d in way.displacements:
        yield ChordStop(top - d, StopRole.POINT, base, Direction.CW, d)


def _from_below(way: _Way) -> Iterator[ChordStop]:
    """Procedure D."""
    base = way.base
    for direction in Direction:
        for d in way.displacements:
            yield ChordStop(base - 0.5 * way.approach, StopRole.APPROACH, base, direction)
            yield ChordStop(base, StopRole.BASE, base, direction)
            yield ChordStop(base + d * direction.sign, StopRole.POINT, base, direction, d)


def _there_and_on(way: _Way) -> Iterator[ChordStop]:
    """Procedure E: the direction in which the base is reached first, then the other; a stop on the way only where the
    base lies too near for lost motion to be taken up.
    """
    base, at = way.base, way.before
    if at is None:
        # The middle of the bases, or beyond the base.
        at = min(way.middle, base - way.approach)
        yield ChordStop(at, StopRole.APPROACH, base, Direction.CCW)
    first = Direction.CCW if at < base else Direction.CW
    for direction in (first, *(d for d in Direction if d is not first)):
        s = direction.sign
        if (base - at) * s < way.approach:
            yield ChordStop(base - way.approach * s, StopRole.APPROACH, base, direction)
        yield ChordStop(base, StopRole.BASE, base, direction)
        for d in way.displacements:
            yield ChordStop(base + d * s, StopRole.POINT, base, direction, d)
        at = base + way.displacements[-1] * s


# The paper names bases and displacements but neither the order of the stops nor where a chord begins: four
# readings of its text (docs/explanation/accuracy.md), A to D.
_SERIES: dict[str, Callable[[_Way], Iterator[ChordStop]]] = {
    "A": _staircase,
    "B": _out_and_back,
    "C": _up_and_down,
    "D": _from_below,
    "E": _there_and_on,
}


def _check(bases: Sequence[float], displacements: Sequence[float], runs: int) -> None:
    if runs < 1:
        raise UsageError(f"runs = {runs}: at least 1")
    if not bases or not np.all(np.isfinite(bases)):
        raise UsageError(f"bases = {list(bases)}: at least one angle, deg")
    if len(set(bases)) != len(bases):
        raise UsageError(f"bases = {list(bases)}: the same base twice")
    ascending = all(b > a for a, b in zip([0.0, *displacements], displacements, strict=False))
    if not displacements or not ascending or not displacements[-1] < 180.0:
        raise UsageError(f"displacements = {list(displacements)}: ascending, above 0 and below 180 deg")


def target_points(angles_rad: ArrayLike, radius_m: float) -> FloatArray:
    """Coordinates of a target on the gantry, m: shape (...) of angles -> (..., 2)."""
    return np.asarray(radius_m * np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=-1))


def chord_between(points_m: FloatArray, others_m: FloatArray) -> FloatArray:
    """Distance of two points, m: (..., 2) and (..., 2) -> (...)."""
    difference = points_m - others_m
    return np.asarray(np.hypot(difference[..., 0], difference[..., 1]))


def chord_angle_rad(chord_m: ArrayLike, radius_m: float) -> FloatArray:
    """The angle of a chord, rad: 2 asin(c / 2R)."""
    # Noise may lengthen a chord of nearly 180 deg beyond the diameter: it counts as the diameter.
    return np.asarray(2.0 * np.arcsin(np.minimum(np.asarray(chord_m) / (2.0 * radius_m), 1.0)))


def evaluate(
    procedure: Procedure, readings_rad: ArrayLike, radius_m: float, sigma_m: float = 0.0, seed: int = 0
) -> ErrorTable:
    """The error table of one chord test as an instrument of this noise sees it.

    Args:
        procedure: what was driven.
        readings_rad: one angle per stop, rad, shape (stops,).
        radius_m: radius of the circle the target moves on.
        sigma_m: Gaussian noise on x and on y of every point, 1 sigma; 0 gives the exact angles.
        seed: of the noise.
    """
    readings = _readings(procedure, readings_rad)
    points = target_points(readings, radius_m)
    if sigma_m > 0.0:
        # Both coordinates of every point, independently: what a tracker's data sheet states.
        points = points + np.random.default_rng(seed).normal(0.0, sigma_m, points.shape)
    return ErrorTable(
        procedure.rows,
        (0.0, *procedure.displacements_deg),
        errors_from_points(procedure, points, radius_m),
        procedure.layout,
    )


def errors_from_points(procedure: Procedure, points_m: FloatArray, radius_m: float) -> FloatArray:
    """Chord errors of measured points: (..., stops, 2) in m -> (..., rows, columns) in deg, zero column
    included.
    """
    row_of = {key: k for k, key in enumerate(procedure.rows)}
    column_of = {d: k + 1 for k, d in enumerate(procedure.displacements_deg)}
    errors = np.zeros((*points_m.shape[:-2], len(row_of), len(column_of) + 1))
    for index, stop in enumerate(procedure.stops):
        if stop.reference is None:
            continue
        chord = chord_between(points_m[..., index, :], points_m[..., stop.reference, :])
        row = row_of[RowKey(stop.base_deg, stop.direction, stop.run)]
        # Positive: moved too far.
        error = np.degrees(chord_angle_rad(chord, radius_m)) - procedure.nominal_deg(stop)
        errors[..., row, column_of[stop.displacement_deg]] = error
    return errors


def _readings(procedure: Procedure, readings_rad: ArrayLike) -> FloatArray:
    readings = np.asarray(readings_rad, dtype=np.float64)
    if readings.shape != (len(procedure.stops),):
        raise UsageError(f"{readings.size} readings for the {len(procedure.stops)} stops of {procedure.name}")
    if not np.all(np.isfinite(readings)):
        raise UsageError("a reading is not finite")
    return readings
