"""Instruments: what each sees of a dwell, and how it errs."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.instruments import LoadEncoder, MotorSide
from gantryctl.errors import UsageError
from gantryctl.machine.tables.plant import SCALE_TERMS

DWELL = (0.5, 0.4999, 0.5001)
"""Mean angles of a dwell: load, ring against its base, motor at the gantry."""


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


MAKERS: dict[str, Callable[[], LoadEncoder | MotorSide]] = {
    "load encoder": lambda: LoadEncoder(32, 0.0, 0.0, rng()),
    "motor side": MotorSide,
}


@pytest.mark.parametrize(
    ("name", "seen", "load"),
    [
        ("load encoder", 0.4999, True),
        ("motor side", 0.5001, False),
    ],
)
def test_every_instrument_sees_its_own_side(name: str, seen: float, load: bool) -> None:
    instrument = MAKERS[name]()
    assert instrument.name == name
    assert instrument.measures_load is load
    assert instrument.reading_rad(DWELL) == pytest.approx(seen, abs=1e-9)


@given(st.floats(-4.0, 4.0), st.integers(8, 28))
def test_an_encoder_rounds_to_its_step(angle: float, bits: int) -> None:
    encoder = LoadEncoder(bits, 0.0, 0.0, rng())
    reading = encoder.reading_rad([angle])
    assert abs(reading - angle) <= encoder.step_rad / 2.0 * (1.0 + 1e-6)
    assert reading / encoder.step_rad == pytest.approx(round(reading / encoder.step_rad))


def test_scale_error_is_zero_where_it_was_zeroed() -> None:
    encoder = LoadEncoder(32, 0.0, 4e-6, rng(), zero_rad=0.3)
    assert encoder.reading_rad([0.3]) == pytest.approx(0.3, abs=2e-9)

    def error(y: float) -> float:
        return 4e-6 * sum(gain * math.sin(waves * y + phase) for waves, gain, phase in SCALE_TERMS)

    assert encoder.reading_rad([1.0]) - 1.0 == pytest.approx(error(1.0) - error(0.3), abs=2e-9)


def test_encoder_noise() -> None:
    encoder = LoadEncoder(32, 2e-7, 0.0, rng())
    errors = np.array([encoder.reading_rad([1.0]) for _ in range(4000)]) - 1.0
    assert errors.std() == pytest.approx(2e-7, rel=0.05)


@pytest.mark.parametrize(
    "make",
    [
        lambda: LoadEncoder(0, 0.0, 0.0, rng()),
        lambda: LoadEncoder(26, -1.0, 0.0, rng()),
        lambda: LoadEncoder(26, 0.0, math.inf, rng()),
    ],
)
def test_impossible_instruments_are_refused(make: Callable[[], LoadEncoder | MotorSide]) -> None:
    with pytest.raises(UsageError):
        make()
