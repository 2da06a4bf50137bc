"""Least squares with a prior, and the interval of what it finds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gantryctl.engineering.identification.samples import Floats


class Estimate(NamedTuple):
    """Values and their covariance.

    Attributes:
        values: shape (n,). covariance: shape (n, n).
        pieces: number of pieces of motion that it rests on.
    """

    values: Floats
    covariance: Floats
    pieces: int

    def half_width_of(self, gradient: Floats) -> float:
        """Half of the 95 % interval of a function of the values, by its gradient there; Student's t by the pieces."""
        from scipy.stats import t

        variance = float(gradient @ self.covariance @ gradient)
        return float(t.ppf(0.975, max(1, self.pieces - 1)) * np.sqrt(max(variance, 0.0)))


def solved(columns: Floats, wanted: Floats, prior: Floats) -> Floats:
    """Least squares with a prior of mean 0: what the columns cannot tell apart stays as small as the prior lets it.

    Args:
        columns: shape (samples, n). wanted: shape (samples,).
        prior: standard deviation of one sample over that of each value before anything was measured; 0 for none.
    """
    with_prior = np.vstack([columns, np.diag(prior)])
    return np.asarray(np.linalg.lstsq(with_prior, np.append(wanted, np.zeros(len(prior))), rcond=None)[0])


def covariance_of(columns: Floats, left: Floats, stretch: Floats, spread: Floats) -> tuple[Floats, int]:
    """Covariance of a least-squares solution, and the number of stretches.

    Samples of one stretch share what the model does not know, so its sum counts once (cluster-robust covariance; Liang
    and Zeger, Biometrika 73, 1986, with the factor for few clusters).

    Args:
        columns: slopes, shape (samples, n). left: what the solution leaves, shape (samples,).
        stretch: piece of motion that each sample belongs to.
        spread: standard deviation of each value before anything was measured: it bounds what nothing tells apart.
    """
    pieces = np.unique(stretch, return_inverse=True)[1]
    count = int(pieces.max()) + 1
    noise = float(np.mean(left**2))
    # In parts of the spread: sizes from 0.1 to 1e7 stand in one matrix.
    scaled = columns * spread
    inverse = np.linalg.inv(scaled.T @ scaled + noise * np.eye(len(spread)))
    sums = np.zeros((count, len(spread)))
    np.add.at(sums, pieces, scaled * left[:, np.newaxis])
    meat = sums.T @ sums * (count / max(1, count - 1))
    # What was known before counts as a source too: else a direction that no sample sees would be known exactly.
    parts = inverse @ (meat + noise * noise * np.eye(len(spread))) @ inverse
    return parts * np.outer(spread, spread), count
