"""A brake that does not even bear the load: the motor is not taken off it."""

from __future__ import annotations

import pytest

from gantryctl.machine import default_machine
from gantryctl.program import BrakeTestOutcome, PowerPhase
from gantryctl.runtime import Engine, HeldOperator
from gantryctl.units import deg, rad
from gantryctl.wiring import build_engine, delivered_zero_counts, drive_around, gantry_sim, plant_params

MACHINE = default_machine()
ANGLE_DEG = 90.0
HOLDING_NM = 14.0
"""16 kN m of eccentric moment over 1144, where it is largest."""


def with_brake_of(brake_torque_nm: float) -> Engine:
    """The gantry after a brake test with a brake that bears so much, and 3 s more."""
    plant = plant_params(MACHINE)
    plant.brake_torque = brake_torque_nm
    sim = gantry_sim(MACHINE, plant)
    sim.static_start(rad(ANGLE_DEG), False)
    engine = build_engine(
        MACHINE,
        drive=drive_around(MACHINE, sim),
        zero_counts=float(delivered_zero_counts(MACHINE)),
        holding_torque_nm=HOLDING_NM,
    )
    assert isinstance(engine.operator, HeldOperator)
    engine.run_for(0.1)
    for wanted in (True, False):
        engine.operator.command = engine.operator.command._replace(brake_test=wanted)
        engine.step()
    axis = engine.program.axis  # type: ignore[attr-defined]
    assert axis.power.testing
    assert engine.run_until(lambda _: not axis.power.testing, 12.0)
    engine.run_for(3.0)
    return engine


@pytest.mark.parametrize(
    ("brake_torque_nm", "phase"), [(400.0, PowerPhase.OFF), (30.0, PowerPhase.OFF), (0.5, PowerPhase.HOLDING)]
)
def test_the_load_is_always_held(brake_torque_nm: float, phase: PowerPhase) -> None:
    engine = with_brake_of(brake_torque_nm)
    power = engine.program.axis.power  # type: ignore[attr-defined]
    wanted = (
        BrakeTestOutcome.PASSED if brake_torque_nm > MACHINE.brake.test_torque_nm else BrakeTestOutcome.FAILED
    )
    assert power.brake_test_result.outcome is wanted
    assert power.phase is phase
    assert engine.truth is not None
    # A brake that slips at rest is caught by the motor within 0.15 deg; wind-up of the gear is some 0.01.
    assert deg(engine.truth.truth()[0]) == pytest.approx(ANGLE_DEG, abs=0.15)
