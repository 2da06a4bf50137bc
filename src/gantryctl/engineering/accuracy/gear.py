"""What a chord table tells of the gear: a linear Gaussian model with its priors from the grade, that can be refuted.

Chord errors are e = s [f(B + s d) - f(B)] with f(theta) = sum of a_n sin(n theta) + b_n cos(n theta) over the waves
that a gear has: twelve of the ring, pinion, tooth mesh, three of the reducer. A wave of amplitude A and unknown phase
has a, b ~ N(0, A^2/2): amplitude by Rayleigh, phase uniform. Wind-up of the eccentric moment is one more sine of one
cycle.
Every reading has an error of its own besides, so the chords of a series share the one of their base. With that the
coefficients given a table, what they predict of chords that were not used, and the evidence of a table are closed forms
(MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapters 28 and 45; conjugate regression).
Grade and size of the readings' error are not known: they are averaged over a grid, weighted by their evidence.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.accuracy.table import ErrorTable, FloatArray, Layout, RowKey
from gantryctl.errors import UsageError
from gantryctl.machine import Machine
from gantryctl.units import Dial, rad
from gantryctl.wiring.simulator import plant_params

# Grades of ISO 1328-1 that are weighed, equally likely before; tolerances grow by sqrt(2) a grade.
GRADES: Final = (5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
# Standard deviations of a reading: lost motion and instrument, 2.5 to 40 um at 2.5 m.
READING_DEG: Final = (0.00005, 0.0001, 0.0002, 0.0004, 0.0008)
Flags = NDArray[np.bool_]
COVERED: Final = 0.95
# 24 standard deviations halved so often are 2e-11 of one.
_HALVINGS: Final = 40
_ERF: Final = np.frompyfunc(math.erf, 1, 1)


class Wave(NamedTuple):
    """A wave of the gear error: cycles per turn of the axis, and the amplitude that grade 8 has, rad."""

    cycles: float
    amplitude_rad: float


class Place(NamedTuple):
    """A chord of a table."""

    row: RowKey
    displacement_deg: float


@dataclass(frozen=True, eq=False)
class Prediction:
    """Chords that were predicted, deg: arrays of shape (chords,).

    Attributes:
        low_deg, high_deg: ends of the 95 % interval of a chord that is measured there.
    """

    places: tuple[Place, ...]
    measured_deg: FloatArray
    mean_deg: FloatArray
    low_deg: FloatArray
    high_deg: FloatArray

    @property
    def r_squared(self) -> float:
        """Part of the variance of the measured chords that is predicted; negative where their mean would be nearer."""
        return r_squared(self.measured_deg, self.mean_deg)

    @property
    def covered(self) -> int:
        """Chords within their interval."""
        inside = (self.low_deg <= self.measured_deg) & (self.measured_deg <= self.high_deg)
        return int(np.count_nonzero(inside))


def r_squared(measured: FloatArray, predicted: FloatArray) -> float:
    """1 - sum of squared residuals / sum of squares about the mean of what was measured."""
    about = float(np.sum((measured - measured.mean()) ** 2))
    return 1.0 - float(np.sum((measured - predicted) ** 2)) / about if about > 0.0 else math.nan


def waves_of(machine: Machine) -> tuple[Wave, ...]:
    """Waves of a machine's gear, with the amplitudes of its file at [plant.gear_error] scale = 1: grade 8."""
    gear, ring, ratio = machine.plant.gear_error, machine.axis.ring_ratio, machine.axis.ratio
    per_um = 1e-6 / gear.ring_radius_m
    return (
        *(Wave(float(n), um * per_um) for n, um in enumerate(gear.ring_um, 1)),
        Wave(ring, gear.output_1x_rad / ring + gear.pinion_1x_um * per_um),
        Wave(ring * gear.pinion_teeth, gear.mesh_um * per_um),
        Wave(ratio, gear.reducer_1x_rad / ring),
        Wave(2.0 * ratio, gear.reducer_2x_rad / ring),
        Wave(4.0 * ratio, gear.reducer_4x_rad / ring),
    )


class GearModel:
    """The model over the chords of a table.

    Args:
        table: chords from their base; not of single steps.
        waves: of the gear. windup_rad: size of the wind-up of the eccentric moment, whose sign is left open.

    Raises:
        UsageError: a table of another layout.
    """

    def __init__(self, table: ErrorTable, waves: tuple[Wave, ...], windup_rad: float) -> None:
        if table.layout is not Layout.APART:
            raise UsageError(
                "gear model: the table must have chords from the base of their series (procedures A, B and D)"
            )
        columns = table.displacements_deg[1:]
        self.places = tuple(Place(row, d) for row in table.rows for d in columns)
        self.errors_deg: FloatArray = table.errors_deg[:, 1:].ravel()
        self._bases = np.array([rad(place.row.base_deg) for place in self.places])
        signs = np.array([place.row.direction.sign for place in self.places])
        stops = self._bases + signs * np.array([rad(place.displacement_deg) for place in self.places])
        self._cycles = np.array([wave.cycles for wave in waves])
        self._stops, self._signs = stops, signs
        self.basis = self._chords(np.sin, np.cos)
        amplitudes = np.array([wave.amplitude_rad for wave in waves])
        self._per_grade_8 = np.degrees(np.concatenate((amplitudes, amplitudes))) ** 2 / 2.0
        first = np.flatnonzero(self._cycles == 1.0)
        self._fixed = np.zeros(2 * len(waves))
        self._fixed[first] = math.degrees(windup_rad) ** 2
        rows = np.array([table.rows.index(place.row) for place in self.places])
        # A chord has the error of its own reading and that of its base.
        self._readings = np.eye(len(rows)) + (rows[:, None] == rows[None, :])

    def _chords(self, *functions: np.ufunc) -> FloatArray:
        """Chords of unit waves, shape (chords, functions x waves)."""
        at, base = np.outer(self._stops, self._cycles), np.outer(self._bases, self._cycles)
        return np.hstack([self._signs[:, None] * (f(at) - f(base)) for f in functions])

    def covariance(self, grade: float, reading_deg: float) -> FloatArray:
        """Of the chords before anything is measured, deg2: prior waves and readings."""
        variance = self._per_grade_8 * 2.0 ** (grade - 8.0) + self._fixed
        return np.asarray((self.basis * variance) @ self.basis.T + reading_deg**2 * self._readings)

    def log_evidence(self, grade: float, reading_deg: float, used: Flags | None = None) -> float:
        """ln p(errors | grade, readings) of the chords that are used (all): a Gaussian of that covariance."""
        keep = np.ones(len(self.places), dtype=bool) if used is None else used
        errors = self.errors_deg[keep]
        factor = np.linalg.cholesky(self.covariance(grade, reading_deg)[np.ix_(keep, keep)])
        whitened = np.linalg.solve(factor, errors)
        determinant = float(np.sum(np.log(np.diag(factor))))
        return -0.5 * float(whitened @ whitened) - determinant - 0.5 * len(errors) * math.log(2.0 * math.pi)

    def weights(self, used: Flags | None = None) -> dict[tuple[float, float], float]:
        """Probability of each grade and size of the readings' error, given the chords that are used."""
        grid = list(product(GRADES, READING_DEG))
        logs = np.array([self.log_evidence(*each, used) for each in grid])
        parts = np.exp(logs - logs.max())
        return dict(zip(grid, (parts / parts.sum()).tolist(), strict=True))

    def predict(self, held_out: Flags) -> Prediction:
        """Chords that are held out, shape (chords,) of bool, from all the others."""
        used = ~held_out
        means, deviations, weights = [], [], []
        for (grade, reading_deg), weight in self.weights(used).items():
            whole = self.covariance(grade, reading_deg)
            gain = np.linalg.solve(whole[np.ix_(used, used)], whole[np.ix_(used, held_out)])
            means.append(gain.T @ self.errors_deg[used])
            variance = whole[np.ix_(held_out, held_out)] - whole[np.ix_(held_out, used)] @ gain
            deviations.append(np.sqrt(np.diag(variance)))
            weights.append(weight)
        share, mean, spread = np.array(weights), np.array(means), np.array(deviations)
        low, high = (_quantile(share, mean, spread, 0.5 + half * COVERED) for half in (-0.5, 0.5))
        places = tuple(place for place, held in zip(self.places, held_out, strict=True) if held)
        return Prediction(places, self.errors_deg[held_out], share @ mean, low, high)

    def fitted(self) -> FloatArray:
        """The chords as the model sees them without the readings' error, deg, given all of them."""
        found = np.zeros(len(self.places))
        for (grade, reading_deg), weight in self.weights().items():
            whole = self.covariance(grade, reading_deg)
            waves = whole - reading_deg**2 * self._readings
            found += weight * (waves @ np.linalg.solve(whole, self.errors_deg))
        return found


def _quantile(weights: FloatArray, means: FloatArray, deviations: FloatArray, part: float) -> FloatArray:
    """Quantile of a mixture of Gaussians, shape (components, values) -> (values,), by bisection."""
    low, high = (means - 12.0 * deviations).min(axis=0), (means + 12.0 * deviations).max(axis=0)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        below = weights @ _below((middle - means) / deviations) < part
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.asarray(0.5 * (low + high))


def _below(standard: FloatArray) -> FloatArray:
    """Distribution function of the standard Gaussian, any shape."""
    return 0.5 + 0.5 * np.asarray(_ERF(standard / math.sqrt(2.0)), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class GearStudy:
    """What a table tells of the gear, and how far that can be believed.

    Attributes:
        name: of the table.
        in_sample_r2: of the fit to the whole table.
        by_row, by_base: every row, every base, predicted from the others; in the order of the table.
        grades: probability of each grade given the whole table.
    """

    name: str
    in_sample_r2: float
    by_row: Prediction
    by_base: tuple[Prediction, ...]
    grades: dict[float, float]

    @property
    def of_bases(self) -> Prediction:
        """All bases, each predicted from the others, in one."""
        return _joined(self.by_base)


def gear_study(table: ErrorTable, machine: Machine, name: str = "") -> GearStudy:
    """Fit, evidence and predictions of what was left out.

    Raises:
        UsageError: the table has chords of single steps, or fewer than two bases.
    """
    if len(table.bases_deg) < 2:
        raise UsageError(
            "gear model: a base is predicted from the others: the table needs two bases at least"
        )
    plant = plant_params(machine)
    stiffness = 1.0 / (1.0 / plant.stiffness_1_nm_per_rad + 1.0 / plant.base_stiffness_nm_per_rad)
    windup_rad = abs(plant.eccentric_moment_nm) / stiffness
    model = GearModel(table, waves_of(machine), windup_rad)
    rows = [np.array([place.row == row for place in model.places]) for row in table.rows]
    bases = [np.array([place.row.base_deg == base for place in model.places]) for base in table.bases_deg]
    grades = dict.fromkeys(GRADES, 0.0)
    for (grade, _), weight in model.weights().items():
        grades[grade] += weight
    return GearStudy(
        name,
        r_squared(model.errors_deg, model.fitted()),
        _joined([model.predict(row) for row in rows]),
        tuple(model.predict(base) for base in bases),
        grades,
    )


def worth_of_the_fit(study: GearStudy) -> str:
    """A sentence on what a fit of the gear to a table is worth."""
    rows, bases = study.by_row, study.of_bases
    chords = len(bases.measured_deg)
    half_deg = 0.5 * float(np.mean(bases.high_deg - bases.low_deg))
    return (
        f"A gear that is fitted to the {chords} chords explains them with R2 {study.in_sample_r2:.2f}; what is left "
        f"out it predicts with R2 {rows.r_squared:.2f} (a row) and {bases.r_squared:.2f} (a base; below 0 the mean "
        f"would be nearer). {bases.covered} of {chords} then lie in their 95 % intervals, +-{half_deg:.4f} deg in the "
        "mean (`gantryctl accuracy gear`)"
    )


def study_text(study: GearStudy, dial: Dial) -> str:
    """The study for a terminal."""
    lines = ["every base predicted from the others, deg"]
    lines.append(f"{'base, way':<12}{'chord':>8}{'measured':>11}{'predicted':>11}   95 % interval")
    for part in study.by_base:
        for k, place in enumerate(part.places):
            way = f"{dial.text(place.row.base_deg)} {place.row.direction.value}"
            outside = "" if part.low_deg[k] <= part.measured_deg[k] <= part.high_deg[k] else "   outside"
            lines.append(
                f"{way:<12}{place.displacement_deg:>8g}{part.measured_deg[k]:>+11.4f}{part.mean_deg[k]:>+11.4f}   "
                f"{part.low_deg[k]:+.4f} .. {part.high_deg[k]:+.4f}{outside}"
            )
    grades = ", ".join(f"{grade:g}: {100.0 * share:.0f} %" for grade, share in study.grades.items())
    return "\n".join(
        [*lines, f"grade of ISO 1328-1, by the evidence of the table: {grades}", worth_of_the_fit(study)]
    )


def study_data(study: GearStudy) -> dict[str, Any]:
    """The study as plain data for JSON."""
    return {
        "table": study.name,
        "in_sample_r2": study.in_sample_r2,
        "row_left_out": _prediction_data(study.by_row),
        "base_left_out": _prediction_data(study.of_bases),
        "grades": {f"{grade:g}": share for grade, share in study.grades.items()},
    }


def _prediction_data(found: Prediction) -> dict[str, Any]:
    columns = zip(
        found.places, found.measured_deg, found.mean_deg, found.low_deg, found.high_deg, strict=True
    )
    return {
        "r2": found.r_squared,
        "covered": found.covered,
        "chords": [
            {
                "base_deg": place.row.base_deg,
                "direction": place.row.direction.value,
                "run": place.row.run,
                "displacement_deg": place.displacement_deg,
                "measured_deg": float(measured),
                "predicted_deg": float(mean),
                "low_deg": float(low),
                "high_deg": float(high),
            }
            for place, measured, mean, low, high in columns
        ],
    }


def _joined(parts: list[Prediction] | tuple[Prediction, ...]) -> Prediction:
    return Prediction(
        tuple(place for part in parts for place in part.places),
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("measured_deg", "mean_deg", "low_deg", "high_deg")
        ),
    )
