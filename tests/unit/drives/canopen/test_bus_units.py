"""Every unit on the bus against numbers worked out by hand, both directions of the motor."""

import math
from dataclasses import replace
from typing import Final

import pytest

from gantryctl.drives.canopen.scaling import BusUnits
from gantryctl.drives.canopen.settings import drive_identity
from gantryctl.units import DriveVelocityUnit
from gantryctl.wiring.canopen import canopen_settings
from unit.drives.canopen.canopen_bench import machine

pytestmark = pytest.mark.can

# 2 pi rad/s is one turn a second: 60 r/min, or as many increments as a turn has.
# Worked out by hand: 5 242 880 tenths of an increment; 524 288 x 65 536 / 1000 of 16.16 increments a millisecond.
TURN: Final[dict[DriveVelocityUnit, float]] = {
    "inc/s": 524288,
    "0.1 inc/s": 5242880,
    "16.16 inc/ms": 34359738.368,
    "r/min": 60,
    "0.1 r/min": 600,
    "0.001 r/min": 60000,
    "mrev/s": 1000,
}


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("unit", TURN)
def test_a_turn_a_second_and_the_rated_torque(unit: DriveVelocityUnit, inverted: bool) -> None:
    settings = replace(
        canopen_settings(machine()), velocity_unit=unit, inverted=inverted, torque_reference=1.0
    )
    units, sign = BusUnits(settings, 250.0), -1 if inverted else 1
    assert units.velocity(math.tau) == sign * round(TURN[unit])
    assert units.rad_s_per_unit * TURN[unit] == pytest.approx(sign * math.tau, rel=1e-12)
    # 6085 has no sign: 5.4 deg/s2 are what they are whichever way the motor turns.
    assert units.ramp(math.tau) == round(TURN[unit])
    assert units.ramp(-math.tau) == round(TURN[unit])
    # 0 would be no ramp at all.
    assert units.ramp(1e-9) == 1
    # Per mille of the rated torque: 25 N m of 250.
    assert units.torque(25.0) == sign * 100
    assert units.nm_per_unit * 100 == pytest.approx(sign * 25.0, rel=1e-12)
    assert units.rad_per_increment * 524288 == pytest.approx(math.tau, rel=1e-12)


@pytest.mark.parametrize(("turns", "seen"), [(4096, 4096), (8192, 8192), (65_536, 8192)])
def test_the_bus_carries_no_more_turns_than_32_bits_hold(turns: int, seen: int) -> None:
    """2^32 counts are 8192 turns of 2^19, whatever the encoder counts beyond them."""
    assert drive_identity(replace(canopen_settings(machine()), turns=turns), "a drive", "1-2-3").turns == seen


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_zero(value: float) -> None:
    units = BusUnits(canopen_settings(machine()), 250.0)
    assert (units.velocity(value), units.torque(value)) == (0, 0)
