"""Least squares with a prior, and the interval of what it finds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.identification.samples import Floats

# A model with more in it must predict better by this part: what it carries beside it is noise.
BETTER: Final = 0.98
# Groups of stretches that are left out of a fit in turn.
_GROUPS: Final = 8


class Estimate(NamedTuple):
    """Values and how sure they are.

    Attributes:
        values: shape (n,). covariance: shape (n, n).
        shares: what each piece of motion adds to the covariance if every sample errs alike, shape (pieces, n, n).
    """

    values: Floats
    covariance: Floats
    shares: Floats

    def half_width_of(self, gradient: Floats) -> float:
        """Half of the 95 % interval of a function of the values, by its gradient there.

        Student's t by the pieces that it rests on, (sum of shares)^2 / sum of their squares: the inertia shows in the
        ramps alone, and a hundred pieces at constant speed make it no surer.
        """
        from scipy.stats import t

        variance = float(gradient @ self.covariance @ gradient)
        shares = np.einsum("i,pij,j->p", gradient, self.shares, gradient)
        largest = float(shares.max())
        pieces = (
            float((shares / largest).sum() ** 2 / ((shares / largest) ** 2).sum()) if largest > 0.0 else 1.0
        )
        return float(t.ppf(0.975, max(1.0, pieces - 1.0)) * np.sqrt(max(variance, 0.0)))


def solved(columns: Floats, wanted: Floats, prior: Floats) -> Floats:
    """Least squares with a prior of mean 0: what the columns cannot tell apart stays as small as the prior lets it.

    Args:
        columns: shape (samples, n). wanted: shape (samples,).
        prior: standard deviation of one sample over that of each value before anything was measured; 0 for none.
    """
    with_prior = np.vstack([columns, np.diag(prior)])
    return np.asarray(np.linalg.lstsq(with_prior, np.append(wanted, np.zeros(len(prior))), rcond=None)[0])


class StretchSums:
    """Squares of a least-squares problem by groups of stretches: any of its columns are solved without the samples.

    Args:
        columns: shape (samples, n). wanted: shape (samples,).
        stretch: piece of motion that each sample belongs to.
    """

    def __init__(self, columns: Floats, wanted: Floats, stretch: Floats) -> None:
        # Stretches of one group lie far apart, so neither loses all that it was fitted to there.
        pieces = _pieces(np.asarray(np.unique(stretch, return_inverse=True)[1] % _GROUPS, dtype=np.float64))
        self._count = len(wanted)
        self._squares = np.array([columns[rows].T @ columns[rows] for rows in pieces])
        self._sums = np.array([columns[rows].T @ wanted[rows] for rows in pieces])
        self._wanted = np.array([wanted[rows] @ wanted[rows] for rows in pieces])
        self._whole, self._both = self._squares.sum(axis=0), self._sums.sum(axis=0)

    def solution(self, places: Sequence[int], prior: Floats) -> Floats:
        """Solution of the columns at `places`, with a prior as of `solved`."""
        square = self._whole[np.ix_(places, places)] + np.diag(prior**2)
        return np.asarray(np.linalg.solve(square, self._both[places]))

    def left_out(self, places: Sequence[int], prior: Floats) -> float:
        """R.m.s. of what the solution leaves of each group of stretches that was left out of its fit."""
        chosen = np.ix_(range(len(self._squares)), places, places)
        squares, sums = self._squares[chosen], self._sums[:, places]
        whole = self._whole[np.ix_(places, places)] + np.diag(prior**2)
        without = np.linalg.solve(whole - squares, (self._both[places] - sums)[:, :, np.newaxis])[:, :, 0]
        left = (
            self._wanted
            - 2.0 * np.einsum("pi,pi->p", without, sums)
            + np.einsum("pi,pij,pj->p", without, squares, without)
        )
        return float(np.sqrt(max(0.0, float(left.sum())) / self._count))


def _pieces(stretch: Floats) -> list[np.ndarray]:
    """Rows of each stretch."""
    order = np.argsort(stretch, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(stretch[order])) + 1)


def estimate_of(values: Floats, columns: Floats, left: Floats, stretch: Floats, spread: Floats) -> Estimate:
    """How sure a least-squares solution is.

    Samples of one stretch share what the model does not know, so its sum counts once. Each stretch is judged by what
    it leaves when it is left out of the fit: what it leaves of a fit to itself is too small where few stretches show a
    value (cluster-robust covariance, jackknife CR3; Bell and McCaffrey, Survey Methodology 28, 2002).

    Args:
        values: the solution, shape (n,). columns: slopes, shape (samples, n).
        left: what the solution leaves, shape (samples,).
        stretch: piece of motion that each sample belongs to.
        spread: standard deviation of each value before anything was measured: it bounds what nothing tells apart.
    """
    noise = float(np.mean(left**2))
    # In parts of the spread: sizes from 0.1 to 1e7 stand in one matrix.
    scaled = columns * spread
    pieces = _pieces(stretch)
    squares = np.array([scaled[rows].T @ scaled[rows] for rows in pieces])
    sums = np.array([scaled[rows].T @ left[rows] for rows in pieces])
    # What was known before counts as a source too: else a direction that no sample sees would be known exactly.
    before = noise * np.eye(len(spread))
    whole = squares.sum(axis=0) + before
    inverse = np.linalg.inv(whole)
    # X' (1 - H)^-1 r of a stretch, by the identity of Woodbury.
    outside = np.linalg.solve(whole - squares, sums[:, :, np.newaxis])
    judged = sums + (squares @ outside)[:, :, 0]
    meat = judged.T @ judged * ((len(pieces) - 1) / len(pieces))
    sizes = np.outer(spread, spread)
    covariance = inverse @ (meat + noise * before) @ inverse * sizes
    return Estimate(values, covariance, inverse @ squares @ inverse * sizes)
