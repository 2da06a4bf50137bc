"""Least squares over what goes on: sums that fade, and at any time the values with their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple


class Fitted(NamedTuple):
    """Values of the unknowns and their standard deviations."""

    values: list[float]
    deviations: list[float]


class RunningFit:
    """Normal equations of y = sum c_k x_k with fading memory and a prior of mean 0, which never fades.

    Args:
        count: of unknowns.
        ridge: variance of one sample over that of an unknown before anything was seen.
        kept: share of the sums that one sample leaves.
        alike: samples in a row that say the same once: what disturbs one disturbs its neighbours.
    """

    __slots__ = ("_alike", "_count", "_kept", "_ridge", "_sums")

    def __init__(self, count: int, ridge: float, kept: float, alike: float) -> None:
        self._count, self._ridge, self._kept, self._alike = count, ridge, kept, alike
        # Samples, then the upper triangle of the products of (c_1 .. c_n, y), row by row.
        self._sums = [0.0] * (1 + (count + 1) * (count + 2) // 2)

    @property
    def sums(self) -> list[float]:
        """What is to be retained."""
        return self._sums

    @property
    def filled(self) -> float:
        """How full the memory is: 0 of a new one, 1 - 1/e after as many samples as it keeps, towards 1."""
        return self._sums[0] * (1.0 - self._kept)

    def fits(self, sums: Sequence[float]) -> bool:
        """Whether retained sums are of such a fit."""
        return len(sums) == len(self._sums) and all(map(math.isfinite, sums))

    def restore(self, sums: Sequence[float]) -> None:
        """Go on from retained sums."""
        self._sums = list(sums)

    def add(self, columns: Sequence[float], y: float) -> None:
        """Add one sample."""
        row, kept = (*columns, y), self._kept
        products = [a * b for i, a in enumerate(row) for b in row[i:]]
        self._sums = [kept * old + new for old, new in zip(self._sums, (1.0, *products), strict=True)]

    def solved(self) -> Fitted | None:
        """Solve the equations; None before they have one finite solution."""
        n = self._count
        samples, products = self._sums[0], iter(self._sums[1:])
        full = [[0.0] * (n + 1) for _ in range(n + 1)]
        for i in range(n + 1):
            for j in range(i, n + 1):
                full[i][j] = full[j][i] = next(products)
        for i in range(n):
            full[i][i] += self._ridge
        inverse = _inverted([row[:n] for row in full[:n]])
        # As many samples as unknowns leave nothing to judge them by.
        if inverse is None or samples <= self._alike * n:
            return None
        values = [sum(inverse[i][j] * full[j][n] for j in range(n)) for i in range(n)]
        left = full[n][n] - sum(values[i] * full[i][n] for i in range(n))
        variance = max(0.0, left) / samples * self._alike
        fitted = Fitted(values, [math.sqrt(variance * inverse[i][i]) for i in range(n)])
        return fitted if all(map(math.isfinite, (*fitted.values, *fitted.deviations))) else None


def _inverted(matrix: list[list[float]]) -> list[list[float]] | None:
    """The inverse of a positive definite matrix by Gauss and Jordan; None where it has none."""
    n = len(matrix)
    rows = [[*row, *(float(i == j) for j in range(n))] for i, row in enumerate(matrix)]
    for i in range(n):
        pivot = rows[i][i]
        if not pivot > 1e-12 * matrix[i][i]:  # 0 and NaN are refused
            return None
        rows[i] = [value / pivot for value in rows[i]]
        for k in range(n):
            if k != i:
                factor = rows[k][i]
                rows[k] = [a - factor * b for a, b in zip(rows[k], rows[i], strict=True)]
    inverse = [row[n:] for row in rows]
    return inverse if all(inverse[i][i] > 0.0 for i in range(n)) else None
