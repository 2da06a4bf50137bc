"""Rational transfer functions with real coefficients, by polynomials alone.

Crossovers and resonance peaks are roots of polynomials in w^2, so they are exact; time responses are inverse
Laplace transforms by the matrix exponential of a companion form, which takes multiple poles (ramps,
parabolas) as they come.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

MINUS_3_DB = 10.0 ** (-3.0 / 20.0)
# Points of the search for the largest value of a response.
GRID = 4000


class PhaseMargin(NamedTuple):
    """Phase margin, deg, and the gain crossover it belongs to, rad/s."""

    margin_deg: float
    crossover_rad_s: float


@dataclass(frozen=True)
class TransferFunction:
    """num(s)/den(s); coefficients from the highest power down, as `numpy.polyval` takes them."""

    num: tuple[float, ...]
    den: tuple[float, ...]

    @classmethod
    def of(cls, num: ArrayLike, den: ArrayLike) -> TransferFunction:
        """From any sequences; leading zeros and common roots at s = 0 are dropped."""
        n, d = _trim(num), _trim(den)
        # 0/0 at rest would spoil every bandwidth.
        while len(n) > 1 and len(d) > 1 and n[-1] == 0.0 and d[-1] == 0.0:
            n, d = n[:-1], d[:-1]
        return cls(tuple(n.tolist()), tuple(d.tolist()))

    def __mul__(self, other: TransferFunction) -> TransferFunction:
        return TransferFunction.of(np.polymul(self.num, other.num), np.polymul(self.den, other.den))

    def __call__(self, s: complex) -> complex:
        """Value at a complex frequency, rad/s."""
        return complex(np.polyval(self.num, s) / np.polyval(self.den, s))

    @property
    def poles(self) -> ComplexArray:
        """Roots of the denominator, rad/s, by rising real part."""
        return roots(self.den)

    @property
    def zeros(self) -> ComplexArray:
        """Roots of the numerator, rad/s, by rising real part."""
        return roots(self.num)

    def gain_crossings_rad_s(self, gain: float = 1.0) -> FloatArray:
        """All w > 0 with |G(jw)| = gain, ascending."""
        difference = np.polysub(_square(self.num), gain**2 * _square(self.den))
        return _positive_frequencies(difference)

    def phase_margin(self) -> PhaseMargin | None:
        """The smallest phase margin over all gain crossovers; None when |G| never passes 1."""
        margins = [
            PhaseMargin(_wrap_deg(180.0 + math.degrees(np.angle(self(1j * w)))), float(w))
            for w in self.gain_crossings_rad_s()
        ]
        return min(margins, key=lambda margin: abs(margin.margin_deg), default=None)

    def gain_margins(self) -> FloatArray:
        """1/|G| at every w > 0 where G is real and negative: factors on the gain that reach the stability
        limit.

        Above 1: how much the gain may rise; below 1: how far it may fall (conditional stability). Ascending.
        """
        # G(jw) is real where the imaginary part of num(jw) den(-jw) vanishes.
        product = np.polymul(self.num, _mirror(self.den))
        frequencies = _positive_frequencies(_even_powers_as_x(product, odd=True))
        values = np.array([self(1j * w) for w in frequencies], dtype=np.complex128)
        return np.sort(1.0 / np.abs(values[values.real < 0.0]))

    def bandwidth_rad_s(self) -> float | None:
        """Lowest w where |G| is 3 dB below |G(0)| (a factor 10^-0.15 exactly); None when it never is."""
        crossings = self.gain_crossings_rad_s(abs(self(0j)) * MINUS_3_DB)
        return float(crossings[0]) if crossings.size else None

    def resonance_peak(self) -> float:
        """Largest |G(jw)| over w >= 0 (Mr of a closed loop)."""
        n, d = _square(self.num), _square(self.den)
        # |G|^2 = n(x)/d(x) with x = w^2 peaks where n' d - n d' = 0.
        rise, fall = np.asarray(np.polyder(n)), np.asarray(np.polyder(d))
        slope = np.polysub(np.polymul(rise, d), np.polymul(n, fall))
        return max(abs(self(1j * w)) for w in [0.0, *_positive_frequencies(slope)])


def roots(coefficients: ArrayLike) -> ComplexArray:
    """Roots of a polynomial, sorted by real then imaginary part; frequencies are scaled for a good
    condition.
    """
    c = _trim(coefficients)
    degree = len(c) - 1
    trailing = len(c) - len(np.trim_zeros(c, "b"))
    body = c[: len(c) - trailing]
    if len(body) < 2:
        return np.zeros(degree, dtype=np.complex128)
    # The geometric mean of the roots: in units of it the companion matrix is balanced, although poles of the
    # loop lie decades apart.
    scale = abs(body[-1] / body[0]) ** (1.0 / (len(body) - 1))
    powers = scale ** np.arange(len(body) - 1, -1, -1, dtype=np.float64)
    found = scale * np.roots(body * powers)
    return np.sort_complex(np.concatenate([found, np.zeros(trailing)]))


def inverse_laplace(function: TransferFunction, times_s: ArrayLike) -> FloatArray:
    """f(t) of a strictly proper F(s) = num/den at t > 0: shape of the times.

    The step response of G is `inverse_laplace(G * TransferFunction.of([1], [1, 0]), t)`, and so on for ramps.
    """
    a, c, scale = _companion(function)
    times = np.asarray(times_s, dtype=np.float64)
    values = [float(c @ expm(a * (scale * t))[:, 0]) for t in times.ravel()]
    return np.array(values).reshape(times.shape)


def largest(function: TransferFunction) -> tuple[float, float]:
    """Time and value of the largest f(t), t > 0, of a strictly proper F(s) that settles: (t, f)."""
    decaying = [-pole.real for pole in function.poles if pole.real < -1e-12]
    # After twelve time constants of the slowest pole exp(-12) = 6e-6 of it is left.
    horizon = 12.0 / min(decaying)
    step = horizon / GRID
    a, c, scale = _companion(function)
    transition = expm(a * (scale * step))
    state = np.eye(len(a))[:, 0]
    values = np.empty(GRID + 1)
    for k in range(GRID + 1):
        values[k] = c @ state
        state = transition @ state
    best = int(values.argmax())
    if best in (0, GRID):
        return best * step, float(values[best])

    def value_at(t: float) -> float:
        return float(inverse_laplace(function, [t])[0])

    return _golden_maximum(value_at, (best - 1) * step, (best + 1) * step)


def expm(matrix: FloatArray) -> FloatArray:
    """Matrix exponential by scaling and squaring of a Taylor series (small well-scaled matrices)."""
    # Not scipy.linalg.expm: its import takes 0.6 s, and the tests hold this one against it.
    norm = float(np.linalg.norm(matrix, 1))
    squarings = max(0, math.ceil(math.log2(norm / 0.25))) if norm > 0.0 else 0
    scaled = matrix / 2.0**squarings
    term = np.eye(len(matrix))
    total = term.copy()
    # At a norm of 0.25 the first term left out is below 0.25^16/16! = 1e-23.
    for k in range(1, 16):
        term = term @ scaled / k
        total += term
    for _ in range(squarings):
        total = total @ total
    return total


def integrator(order: int = 1, gain: float = 1.0) -> TransferFunction:
    """gain / s^order: the transform of a step (1), ramp (2), parabola (3) of this size."""
    return TransferFunction.of([gain], [1.0] + [0.0] * order)


def _companion(function: TransferFunction) -> tuple[FloatArray, FloatArray, float]:
    """Controllable form in scaled time: A, C with B = first unit vector, and the factor on t."""
    num, den = np.array(function.num), np.array(function.den)
    order = len(den) - 1
    if len(num) > order:
        raise ValueError("the response of this transfer function starts with an impulse")
    body = np.trim_zeros(den, "b")
    scale = abs(body[-1] / body[0]) ** (1.0 / max(len(body) - 1, 1))
    powers = scale ** np.arange(order, -1, -1, dtype=np.float64)
    den_scaled = den * powers
    num_scaled = np.concatenate([np.zeros(order - len(num)), num]) * powers[1:]
    a = np.diag(np.ones(order - 1), -1)
    a[0, :] = -den_scaled[1:] / den_scaled[0]
    return a, scale * num_scaled / den_scaled[0], float(scale)


def _golden_maximum(f: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    # Golden section: 60 steps shrink the bracket to 0.618^60 = 3e-13 of it.
    ratio = (math.sqrt(5.0) - 1.0) / 2.0
    for _ in range(60):
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        if f(left) < f(right):
            low = left
        else:
            high = right
    middle = (low + high) / 2.0
    return middle, f(middle)


def _trim(coefficients: ArrayLike) -> FloatArray:
    trimmed = np.trim_zeros(np.atleast_1d(np.asarray(coefficients, dtype=np.float64)), "f")
    return trimmed if trimmed.size else np.zeros(1)


def _mirror(coefficients: Sequence[float]) -> FloatArray:
    """p(-s)."""
    c = np.array(coefficients, dtype=np.float64)
    return np.asarray(c * (-1.0) ** np.arange(len(c) - 1, -1, -1))


def _even_powers_as_x(coefficients: ArrayLike, odd: bool = False) -> FloatArray:
    """The real (or, with `odd`, imaginary) part of p(jw) as a polynomial in x = w^2, up to a factor w."""
    rising = np.asarray(coefficients, dtype=np.float64)[::-1][int(odd) :: 2]
    signs = (-1.0) ** np.arange(len(rising))
    return np.asarray((rising * signs)[::-1])


def _square(coefficients: Sequence[float]) -> FloatArray:
    """|p(jw)|^2 as a polynomial in x = w^2."""
    return _even_powers_as_x(np.polymul(coefficients, _mirror(coefficients)))


def _positive_frequencies(polynomial_in_x: ArrayLike) -> FloatArray:
    """sqrt of the real positive roots, ascending."""
    x = roots(polynomial_in_x)
    # Real to rounding: numpy gives roots that coincide with small imaginary parts.
    real = x.real[(np.abs(x.imag) <= 1e-9 * np.abs(x)) & (x.real > 0.0)]
    return np.sort(np.sqrt(real))


def _wrap_deg(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0
