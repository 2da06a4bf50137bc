"""What a population says: quantiles, probabilities of passing, sensitivity; each with its confidence interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.campaign.job import INDEX, REFUSED
from gantryctl.engineering.campaign.result import ResultFolder, ResultHead
from gantryctl.engineering.campaign.sampling import Design, members
from gantryctl.errors import UsageError
from gantryctl.machine import field_specs

Floats = NDArray[np.float64]

LEVEL: Final = 0.95
PARTS: Final = (0.05, 0.5, 0.95, 0.99)
# More values of one key are a law without steps.
_VALUES_MAX: Final = 40
# Resamples for the interval of a Sobol index.
_RESAMPLES: Final = 300


class Quantile(NamedTuple):
    """Quantile with its interval; an end is None where the sample is too small for it.

    Attributes:
        part: of the population that is below.
    """

    part: float
    value: float
    low: float | None
    high: float | None


class Passing(NamedTuple):
    """Probability that a plant keeps a limit, with its interval."""

    limit: float
    probability: float
    low: float
    high: float


class Sensitivity(NamedTuple):
    """Sobol indices of one figure for one factor, with their intervals.

    Attributes:
        first: part of the variance that the factor makes alone. total: with all its interactions.
    """

    factor: str
    first: float
    first_low: float
    first_high: float
    total: float
    total_low: float
    total_high: float


class FigureStatistics(NamedTuple):
    """One figure over the population.

    Attributes:
        plants: number of them. sensitivity: empty for a campaign that is no sensitivity analysis.
    """

    column: str
    plants: int
    mean: float
    deviation: float
    smallest: float
    largest: float
    quantiles: tuple[Quantile, ...]
    passing: tuple[Passing, ...]
    sensitivity: tuple[Sensitivity, ...]


class Population(NamedTuple):
    """A result, evaluated.

    Attributes:
        rows: of the campaign. there: rows that are computed. refused: rows without figures, by name of the reason.
        values: figures of all plants that have them, by column. keys: their varied keys.
    """

    head: ResultHead
    rows: int
    there: int
    refused: dict[str, int]
    figures: tuple[FigureStatistics, ...]
    values: dict[str, Floats]
    keys: dict[str, Floats]


def population_of(folder: ResultFolder) -> Population:
    """Evaluate a result; one that is not finished gives what is there.

    Raises:
        UsageError: there is no result, or fewer than two plants have figures. StateError: it is damaged.
    """
    head = folder.head()
    keys = _scalar_keys(head)
    table = folder.read([*head.outputs, *keys])
    good = table[REFUSED] == ""
    design, there = head.design, len(good)
    whole = design.sampling == "sensitivity" and there == design.rows and bool(good.all())
    sensitivity = {
        name: sensitivity_of(np.asarray(table[name]), design, head.factors) if whole else ()
        for name in head.outputs
    }
    if design.sampling == "sensitivity":
        # The design repeats its points: the first member of each base point is the population.
        good &= table[INDEX] % (len(design.widths) + 2) == 0
    if int(good.sum()) < 2:
        raise UsageError(
            f"{folder.path}: {int(good.sum())} of {design.rows} plants have figures, quantiles need two; run "
            "the campaign first"
        )
    values = {name: np.asarray(table[name][good], dtype=np.float64) for name in head.outputs}
    return Population(
        head=head,
        rows=design.rows,
        there=there,
        refused=dict(Counter(str(name) for name in table[REFUSED] if name).most_common()),
        figures=tuple(
            figure_statistics(name, column, head.limits_of(name), sensitivity[name])
            for name, column in values.items()
        ),
        values=values,
        keys={name: np.asarray(table[name][good]) for name in keys},
    )


def split_by(found: Population, key: str) -> list[tuple[str, Population]]:
    """A population by the values of a key that has few, such as the grade of its gears; each with a name.

    Raises:
        UsageError: the key does not vary, or takes more than 40 values.
    """
    if key not in found.keys:
        raise UsageError(
            f"--by {key}: does not vary here; {', '.join(found.keys) or 'no single number'} does"
        )
    values = np.unique(found.keys[key])
    if len(values) > _VALUES_MAX:
        raise UsageError(
            f"--by {key}: has {len(values)} values here, at most {_VALUES_MAX}; it is no discrete law"
        )
    parts = []
    for value in values:
        chosen = found.keys[key] == value
        own = {name: column[chosen] for name, column in found.values.items()}
        figures = tuple(
            figure_statistics(name, column, found.head.limits_of(name)) for name, column in own.items()
        )
        keys = {name: column[chosen] for name, column in found.keys.items()}
        name = f"{key.rpartition('.')[2]} {value:.4g}"
        parts.append((name, found._replace(figures=figures, values=own, keys=keys)))
    return parts


def _scalar_keys(head: ResultHead) -> list[str]:
    return [key for key in head.keys if field_specs()[key].kind != "numbers"]


def figure_statistics(
    column: str, values: Floats, limits: Sequence[float], sensitivity: tuple[Sensitivity, ...] = ()
) -> FigureStatistics:
    """Statistics of one figure of independent plants, shape (plants,)."""
    return FigureStatistics(
        column=column,
        plants=len(values),
        mean=float(values.mean()),
        deviation=float(values.std(ddof=1)) if len(values) > 1 else 0.0,
        smallest=float(values.min()),
        largest=float(values.max()),
        quantiles=tuple(quantile_of(values, part) for part in PARTS),
        passing=tuple(passing_of(values, limit) for limit in limits),
        sensitivity=sensitivity,
    )


def quantile_of(values: Floats, part: float, level: float = LEVEL) -> Quantile:
    """Quantile with the interval between two order statistics, valid for every distribution (binomial ranks)."""
    from scipy.stats import binom

    ordered, count = np.sort(values), len(values)
    # The number of plants below the true quantile is binomial: ranks between which it lies with this level.
    low = int(binom.ppf(0.5 - 0.5 * level, count, part))
    high = int(binom.ppf(0.5 + 0.5 * level, count, part)) + 1
    return Quantile(
        part,
        float(np.quantile(values, part)),
        float(ordered[low - 1]) if low >= 1 else None,
        float(ordered[high - 1]) if high <= count else None,
    )


def passing_of(values: Floats, limit: float, level: float = LEVEL) -> Passing:
    """Probability of a magnitude at or below a limit, with the interval of Clopper and Pearson."""
    from scipy.stats import binomtest

    passed = int(np.count_nonzero(np.abs(values) <= limit))
    interval = binomtest(passed, len(values)).proportion_ci(level, "exact")
    return Passing(limit, passed / len(values), float(interval.low), float(interval.high))


def sensitivity_of(
    values: Floats, design: Design, factors: Sequence[str], level: float = LEVEL
) -> tuple[Sensitivity, ...]:
    """Sobol indices of all factors by Saltelli's estimators (scipy.stats.sobol_indices), intervals by resampling.

    Args:
        values: of all rows of a sensitivity analysis. factors: their names.
    """
    a, b, mixed = members(design, values)
    whole = np.stack(mixed)
    first, total = _indices(a, b, whole)
    rng = np.random.default_rng(design.seed)
    picks = (rng.integers(0, design.size, design.size) for _ in range(_RESAMPLES))
    again = np.array([_indices(a[pick], b[pick], whole[:, pick]) for pick in picks])
    low, high = np.quantile(again, (0.5 - 0.5 * level, 0.5 + 0.5 * level), axis=0)
    return tuple(
        Sensitivity(
            name,
            float(first[k]),
            float(low[0, k]),
            float(high[0, k]),
            float(total[k]),
            float(low[1, k]),
            float(high[1, k]),
        )
        for k, name in enumerate(factors)
    )


def _indices(a: Floats, b: Floats, mixed: Floats) -> tuple[Floats, Floats]:
    from scipy.stats import sobol_indices

    # Twice the same figure: of a single figure and a single factor scipy makes a number and then fails (1.17).
    twice = [np.stack([member, member], axis=-2) for member in (a, b, mixed)]
    found = sobol_indices(func=dict(zip(("f_A", "f_B", "f_AB"), twice, strict=True)), n=len(a))
    first, total = (np.reshape(part, (2, len(mixed)))[0] for part in (found.first_order, found.total_order))
    return first, total
