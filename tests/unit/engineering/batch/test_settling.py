"""The envelope of a swing against its closed form, and without jumps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.batch import settling_s

PERIOD_S = 0.001
TIME = np.arange(6000) * PERIOD_S


def swing(amplitude: float, rate: float = 0.8, hz: float = 2.0, phase: float = 0.3) -> np.ndarray:
    return amplitude * np.exp(-rate * TIME) * np.sin(2.0 * math.pi * hz * TIME + phase)


def last_crossing_s(deviation: np.ndarray, limit: float) -> float:
    outside = np.flatnonzero(np.abs(deviation) > limit)
    return float(outside[-1] + 1) * PERIOD_S if len(outside) else 0.0


@pytest.mark.parametrize("amplitude", [2.0, 5.0, 12.0, 30.0])
def test_it_is_the_closed_form_of_a_damped_swing(amplitude: float) -> None:
    """A e^(-r t) = 1 at t = ln(A)/r; the extremes lie arctan(r/w)/w after the envelope's touch: 3 ms of 250."""
    assert settling_s(swing(amplitude), PERIOD_S, 1.0) == pytest.approx(math.log(amplitude) / 0.8, abs=0.004)


def test_a_little_more_swing_takes_a_little_longer() -> None:
    """0.1 % more amplitude is 1.25 ms; the last crossing jumps by a half swing of 250 ms, which this would show."""
    amplitudes = np.geomspace(1.2, 20.0, 2800)
    found = [settling_s(swing(a), PERIOD_S, 1.0) for a in amplitudes]
    crossings = [last_crossing_s(swing(a), 1.0) for a in amplitudes]
    assert max(np.diff(crossings)) > 0.2
    assert max(np.diff(found)) < 0.006
    assert min(np.diff(found)) > -0.003
    assert all(a >= b for a, b in zip(found, crossings, strict=True))


def test_what_never_leaves_the_limit_is_calm_from_the_beginning() -> None:
    assert settling_s(swing(0.5), PERIOD_S, 1.0) == 0.0
    assert settling_s(np.zeros(1000), PERIOD_S, 1.0) == 0.0


def test_a_swing_that_the_record_ends_before_is_extended() -> None:
    """From two seconds of it to where the envelope falls below 1: ln(20)/0.8 = 3.74 s."""
    assert settling_s(swing(20.0)[:2000], PERIOD_S, 1.0) == pytest.approx(math.log(20.0) / 0.8, abs=0.02)


def test_a_swing_that_grows_never_settles() -> None:
    assert settling_s(swing(1.5, rate=-0.5), PERIOD_S, 1.0) == math.inf


def test_a_creep_settles_when_it_is_inside() -> None:
    creep = 10.0 * np.exp(-2.0 * TIME)
    assert settling_s(creep, PERIOD_S, 1.0) == pytest.approx(math.log(10.0) / 2.0, abs=0.002)
    assert settling_s(creep[:500], PERIOD_S, 1.0) == math.inf
