"""Units of 60FF: each against a factor worked out by hand, and there and back."""

import math
from typing import Final, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.drives.od.velocity_units import VELOCITY_UNITS
from gantryctl.units import DriveVelocityUnit

# Units of each at 90 r/min = 1.5 turns a second, with 4096 increments a turn, by hand.
AT_90_R_MIN: Final[dict[DriveVelocityUnit, float]] = {
    "inc/s": 6144,
    "0.1 inc/s": 61440,
    "16.16 inc/ms": 402_653.184,  # 6.144 increments a millisecond, times 65 536
    "r/min": 90,
    "0.1 r/min": 900,
    "0.001 r/min": 90_000,
    "mrev/s": 1500,
}

# 60A9 by CiA 402: exponent of ten as a signed byte, numerator, denominator, 0.
PREFIX: Final = {"inc/s": 0, "0.1 inc/s": -1, "r/min": 0, "0.1 r/min": -1, "0.001 r/min": -3, "mrev/s": -3}
INCREMENTS, TURNS, SECONDS, MINUTES = 0xB5, 0xB4, 0x03, 0x47


def test_every_unit_that_a_machine_file_may_name_has_a_size() -> None:
    assert set(get_args(DriveVelocityUnit)) == set(VELOCITY_UNITS) == set(AT_90_R_MIN)


@pytest.mark.parametrize("unit", AT_90_R_MIN)
def test_size_against_a_number_worked_out_by_hand(unit: DriveVelocityUnit) -> None:
    assert 1.5 * math.tau * VELOCITY_UNITS[unit].per_rad_s(4096) == pytest.approx(
        AT_90_R_MIN[unit], rel=1e-12
    )


@pytest.mark.parametrize("unit", AT_90_R_MIN)
def test_60a9_says_the_same_as_the_size(unit: DriveVelocityUnit) -> None:
    word = VELOCITY_UNITS[unit].si_unit
    if word is None:
        assert unit == "16.16 inc/ms"
        return
    exponent, numerator, denominator, last = word.to_bytes(4, "big")
    assert last == 0
    assert (exponent + 128) % 256 - 128 == PREFIX[unit]
    per_s = {SECONDS: 1.0, MINUTES: 60.0}[denominator] / 10.0 ** PREFIX[unit]
    in_a_turn = {INCREMENTS: 4096.0, TURNS: 1.0}[numerator]
    assert per_s * in_a_turn * 1.5 == pytest.approx(AT_90_R_MIN[unit], rel=1e-12)


@given(
    st.sampled_from(sorted(VELOCITY_UNITS)),
    st.integers(64, 1 << 24),
    st.floats(-1e3, 1e3, allow_nan=False),
)
def test_there_and_back(unit: DriveVelocityUnit, increments: int, speed_rad_s: float) -> None:
    size = VELOCITY_UNITS[unit].per_rad_s(increments)
    # Rounded to whole units, a speed comes back within half a unit.
    assert abs(round(speed_rad_s * size) / size - speed_rad_s) <= 0.5 / size + 1e-12 * abs(speed_rad_s)
