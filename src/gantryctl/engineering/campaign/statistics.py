"""What a population says: quantiles, probabilities of passing, sensitivity; each with its confidence interval."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.campaign.job import REFUSED
from gantryctl.engineering.campaign.order_statistics import order_statistics
from gantryctl.engineering.campaign.result import ResultFolder, ResultHead, ResultRows
from gantryctl.engineering.campaign.sampling import Design, members
from gantryctl.errors import UsageError

Floats = NDArray[np.float64]

LEVEL: Final = 0.95
PARTS: Final = (0.05, 0.5, 0.95, 0.99)
CURVE: Final = tuple(percent / 100.0 for percent in range(101))
# More values of one key are a law without steps.
_VALUES_MAX: Final = 40
# Values that Sobol indices are made of, 16 MB: 2^17 base points of a dozen factors leave an error of 0.001.
_VALUES_OF_INDICES: Final = 2**21
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
        plants: number of them.
        curve: value below which 0, 1, ... 100 % of the plants are.
        sensitivity: empty for a campaign that is no sensitivity analysis.
    """

    column: str
    plants: int
    mean: float
    deviation: float
    smallest: float
    largest: float
    quantiles: tuple[Quantile, ...]
    curve: tuple[float, ...]
    passing: tuple[Passing, ...]
    sensitivity: tuple[Sensitivity, ...]


class Population(NamedTuple):
    """A result, or a part of one, evaluated.

    Attributes:
        rows: of the campaign. there: rows that are computed. refused: rows without figures, by name of the reason.
        base_points: of a sensitivity analysis, that its indices are made of; 0 where there are none.
        part: key and value that all plants share; None for all of them.
    """

    head: ResultHead
    rows: int
    there: int
    refused: dict[str, int]
    figures: tuple[FigureStatistics, ...]
    base_points: int
    part: tuple[str, float] | None = None


def population_of(folder: ResultFolder) -> Population:
    """Evaluate a result; one that is not finished gives what is there.

    Raises:
        UsageError: there is no result, or fewer than two plants have figures. StateError: it is damaged.
    """
    rows = folder.rows()
    head, refused = rows.head, _refused(rows)
    base = _base_sample(rows)
    figures = []
    for column in head.outputs:
        values = partial(_plants, rows, column)
        sensitivity = _sensitivity(rows, column, base) if base else ()
        figures.append(figure_statistics(column, values, head.limits_of(column), sensitivity))
    if figures[0].plants < 2:
        raise UsageError(
            f"{folder.path}: {figures[0].plants} of {head.design.rows} plants have figures, quantiles need two; run "
            "the campaign first"
        )
    points = base.size if base else 0
    return Population(head, head.design.rows, rows.there, refused, tuple(figures), points)


def parts_of(folder: ResultFolder, key: str) -> list[tuple[str, Population]]:
    """A result by the values of a key that has few, such as the grade of its gears; each part with a name.

    Raises:
        UsageError: as `population_of`; or the key does not vary, or takes more than 40 values.
    """
    whole = population_of(folder)
    keys = whole.head.scalar_keys
    if key not in keys:
        raise UsageError(f"--by {key}: does not vary here; {', '.join(keys) or 'no single number'} does")
    rows = folder.rows()
    values: Floats = np.empty(0)
    for batch in _plants(rows, key):
        values = np.unique(np.concatenate([values, batch]))
        if len(values) > _VALUES_MAX:
            raise UsageError(f"--by {key}: has more than {_VALUES_MAX} values here; it is no discrete law")
    parts = []
    for value in values.tolist():
        figures = tuple(
            figure_statistics(
                column, partial(_plants, rows, column, (key, value)), whole.head.limits_of(column)
            )
            for column in whole.head.outputs
        )
        part = whole._replace(figures=figures, base_points=0, part=(key, value))
        parts.append((f"{key.rpartition('.')[2]} {value:.4g}", part))
    return parts


def _plants(rows: ResultRows, column: str, part: tuple[str, float] | None = None) -> Iterator[Floats]:
    """A column of the plants that have figures; those of a part only, by a key and its value."""
    figure = next(iter(rows.head.outputs))
    design = rows.head.design
    names = dict.fromkeys([column, figure] if part is None else [column, figure, part[0]])
    for first, batch in rows.batches(list(names)):
        chosen = ~np.isnan(batch[figure])
        if design.sampling == "sensitivity":
            # The design repeats its points: the first member of each base point is the population.
            chosen &= np.arange(first, first + len(chosen)) % (len(design.widths) + 2) == 0
        if part is not None:
            chosen &= batch[part[0]] == part[1]
        yield np.asarray(batch[column][chosen], dtype=np.float64)


def _refused(rows: ResultRows) -> dict[str, int]:
    counted: Counter[str] = Counter()
    for _, batch in rows.batches([REFUSED]):
        counted.update(batch[REFUSED].tolist())
    del counted[""]
    return dict(counted.most_common())


def figure_statistics(
    column: str,
    values: Callable[[], Iterable[Floats]],
    limits: Sequence[float],
    sensitivity: tuple[Sensitivity, ...] = (),
) -> FigureStatistics:
    """Statistics of one figure of independent plants, in memory that does not grow with them.

    Args:
        values: begins a pass over all values; the same ones each time.
    """
    count, mean, squares = 0, 0.0, 0.0
    smallest, largest = math.inf, -math.inf
    passed = [0] * len(limits)
    for batch in values():
        if not len(batch):
            continue
        # Two samples as one (Chan, Golub, LeVeque 1983).
        own = float(batch.mean())
        step, count = own - mean, count + len(batch)
        squares += float(np.sum((batch - own) ** 2)) + step * step * len(batch) * (count - len(batch)) / count
        mean += step * len(batch) / count
        smallest, largest = min(smallest, float(batch.min())), max(largest, float(batch.max()))
        for k, limit in enumerate(limits):
            passed[k] += int(np.count_nonzero(np.abs(batch) <= limit))
    quantiles, curve = quantiles_of(values, count) if count else ((), ())
    return FigureStatistics(
        column=column,
        plants=count,
        mean=mean,
        deviation=math.sqrt(squares / (count - 1)) if count > 1 else 0.0,
        smallest=smallest,
        largest=largest,
        quantiles=quantiles,
        curve=curve,
        passing=tuple(passing_of(part, count, limit) for part, limit in zip(passed, limits, strict=True)),
        sensitivity=sensitivity,
    )


def quantiles_of(
    values: Callable[[], Iterable[Floats]], count: int, level: float = LEVEL
) -> tuple[tuple[Quantile, ...], tuple[float, ...]]:
    """Quantiles of `PARTS` and the curve of all percentiles: between order statistics, linear, as numpy.quantile.

    The interval of a quantile lies between two order statistics, valid for every distribution (binomial ranks).

    Args:
        values: begins a pass over all values. count: their number.
    """
    from scipy.stats import binom

    # The number of plants below the true quantile is binomial: ranks between which it lies with this level.
    ends = [
        (int(binom.ppf(0.5 - 0.5 * level, count, part)) - 1, int(binom.ppf(0.5 + 0.5 * level, count, part)))
        for part in PARTS
    ]
    places = [part * (count - 1) for part in (*PARTS, *CURVE)]
    ranks = {rank for place in places for rank in (math.floor(place), math.ceil(place))}
    ranks |= {rank for pair in ends for rank in pair if 0 <= rank < count}
    ordered = sorted(ranks)
    found = dict(zip(ordered, order_statistics(values, count, ordered).tolist(), strict=True))

    def between(place: float) -> float:
        low, high = found[math.floor(place)], found[math.ceil(place)]
        return float(low + (high - low) * (place - math.floor(place)))

    quantiles = tuple(
        Quantile(part, between(place), found.get(low), found.get(high))
        for part, place, (low, high) in zip(PARTS, places, ends, strict=False)
    )
    return quantiles, tuple(between(place) for place in places[len(PARTS) :])


def passing_of(passed: int, count: int, limit: float, level: float = LEVEL) -> Passing:
    """Probability of a magnitude at or below a limit, with the interval of Clopper and Pearson.

    Args:
        passed: plants of `count` that keep the limit.
    """
    from scipy.stats import binomtest

    if not count:
        return Passing(limit, math.nan, 0.0, 1.0)
    interval = binomtest(passed, count).proportion_ci(level, "exact")
    return Passing(limit, passed / count, float(interval.low), float(interval.high))


def _base_sample(rows: ResultRows) -> Design | None:
    """The design of the first base points, as many as are there whole and Sobol indices are made of.

    A power of 2 of them is a design too; None for fewer than 2, and for a campaign that is no sensitivity analysis.
    """
    design = rows.head.design
    if design.sampling != "sensitivity":
        return None
    whole = 0
    figure = next(iter(rows.head.outputs))
    for first, batch in rows.batches([figure]):
        lacking = np.flatnonzero(np.isnan(batch[figure]))
        if first == whole:
            whole += int(lacking[0]) if len(lacking) else len(batch[figure])
        if first + len(batch[figure]) > min(whole, _VALUES_OF_INDICES):
            break
    while design.rows > min(whole, _VALUES_OF_INDICES):
        design = design._replace(size=design.size // 2)
    return design if design.size >= 2 else None


def _sensitivity(rows: ResultRows, column: str, design: Design) -> tuple[Sensitivity, ...]:
    """Sobol indices of a figure by the rows of a design, all of which are there."""
    taken = np.empty(design.rows)
    for first, batch in rows.batches([column]):
        if first >= len(taken):
            break
        part = batch[column][: len(taken) - first]
        taken[first : first + len(part)] = part
    return sensitivity_of(taken, design, rows.head.factors)


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
