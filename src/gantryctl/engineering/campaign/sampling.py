"""Designs: for every row a point in the unit cube, as a function of the seed and the number of the row alone."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Sobol's sequence is walked from its beginning for every chunk: 2^24 points take a second.
SOBOL_MAX: Final = 2**24
# A Latin hypercube exists as a whole only: 160 MB of memory in every worker.
HYPERCUBE_MAX: Final = 20_000_000


class Design(NamedTuple):
    """How the points of a campaign are drawn.

    Attributes:
        sampling: "monte_carlo", "sobol", "latin_hypercube" or "sensitivity".
        size: points; of a sensitivity analysis the size N of its base sample.
        widths: coordinates of every factor, in their order.
    """

    sampling: str
    size: int
    seed: int
    widths: tuple[int, ...]

    @property
    def dimensions(self) -> int:
        """Coordinates of a point."""
        return sum(self.widths)

    @property
    def rows(self) -> int:
        """Rows of the campaign: the points; of a sensitivity analysis N x (factors + 2)."""
        return self.size * (len(self.widths) + 2) if self.sampling == "sensitivity" else self.size


def unit_points(design: Design, first: int, count: int) -> Floats:
    """Points of rows `first` to `first + count - 1`, between 0 and 1, shape (count, dimensions)."""
    return _SAMPLERS[design.sampling](design, first, count)


def _monte_carlo(design: Design, first: int, count: int) -> Floats:
    # A stream for each row: any row can be drawn alone.
    rows = range(first, first + count)
    points = [np.random.default_rng([design.seed, row]).random(design.dimensions) for row in rows]
    return np.array(points).reshape(count, design.dimensions)


def _sobol(design: Design, first: int, count: int) -> Floats:
    return _sobol_points(design.dimensions, design.seed, first, count)


def _latin_hypercube(design: Design, first: int, count: int) -> Floats:
    return _hypercube(design.dimensions, design.seed, design.size)[first : first + count]


def _sensitivity(design: Design, first: int, count: int) -> Floats:
    """Saltelli's design (2010): A, B, and for each factor A with that factor out of B; row = base x (k + 2) + member.

    One base point after the other, so that a run that is not finished has whole ones.
    """
    per_base = len(design.widths) + 2
    rows = np.arange(first, first + count)
    bases = rows // per_base
    low, high = int(bases[0]), int(bases[-1]) + 1
    both = _sobol_points(2 * design.dimensions, design.seed, low, high - low)[bases - low]
    a, b = both[:, : design.dimensions], both[:, design.dimensions :]
    factor = np.repeat(np.arange(len(design.widths)), design.widths)
    member = (rows % per_base)[:, None]
    return np.where((member == 1) | (member == factor + 2), b, a)


def _sobol_points(dimensions: int, seed: int, first: int, count: int) -> Floats:
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed))
    if first:
        engine.fast_forward(first)
    return _all(engine, count)


@functools.lru_cache(maxsize=1)
def _hypercube(dimensions: int, seed: int, count: int) -> Floats:
    from scipy.stats import qmc

    return _all(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)), count)


def _all(engine: Any, count: int) -> Floats:
    with warnings.catch_warnings():
        # A chunk has any size; the balance of the whole depends on the size of the whole.
        warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
        return np.asarray(engine.random(count))


_SAMPLERS: Final = {
    "monte_carlo": _monte_carlo,
    "sobol": _sobol,
    "latin_hypercube": _latin_hypercube,
    "sensitivity": _sensitivity,
}


def members(design: Design, values: Floats) -> tuple[Floats, Floats, Sequence[Floats]]:
    """Values of the rows of a sensitivity analysis by member: A, B, and A with each factor out of B; (N,) each."""
    table = values.reshape(design.size, len(design.widths) + 2)
    return table[:, 0], table[:, 1], [table[:, 2 + k] for k in range(len(design.widths))]
