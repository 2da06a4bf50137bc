"""The axis with compensations: two encoders that disagree, a reading of NaN, a new reference."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import DriveFeedback, OutputImage
from gantryctl.machine import Machine, with_values
from gantryctl.program import Code, GantryProgram
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.simulator import sim_drive
from parity.test_engine_parity import Rig, powered
from support.improved import improved_machine


class Spoilt:
    """A drive whose second encoder reads what a test wants."""

    def __init__(self, rig: Rig, change: object) -> None:
        self._drive = rig.engine.drive
        self.change = change

    def read(self) -> DriveFeedback:
        feedback = self._drive.read()
        return feedback._replace(pos_ring_rad=self.change(feedback.pos_ring_rad))

    def write(self, output: OutputImage) -> None:
        self._drive.write(output)


def spoil(rig: Rig, change: object) -> None:
    rig.engine.drive = Spoilt(rig, change)


def codes(rig: Rig) -> set[Code]:
    return set(rig.program.axis.alarms.active)


def test_encoders_that_agree_raise_nothing() -> None:
    rig = powered(improved_machine(), 30.0)
    rig.command(move=True, target_rad=rad(31.0), speed_rad_s=rad(6.0))
    rig.engine.run_for(5.0)
    assert not rig.program.axis.alarms.active
    load_side = rig.program.axis.load_side
    assert load_side is not None
    assert abs(deg(load_side.disagreement_rad)) < 0.005  # a tenth of the limit


@pytest.mark.parametrize("off_deg", [0.06, -0.06])
def test_a_second_encoder_that_disagrees_stops_the_axis(off_deg: float) -> None:
    rig = powered(improved_machine(), 30.0)
    spoil(rig, lambda ring: ring + rad(off_deg))
    rig.engine.run_for(0.1)
    axis = rig.program.axis
    assert codes(rig) == {Code.ENC_07}
    assert not axis.feedback.position_valid
    assert not rig.engine.output.brake_open


def test_a_short_disagreement_is_forgiven() -> None:
    rig = powered(improved_machine(), 30.0)
    spoil(rig, lambda ring: ring + rad(0.06))
    rig.engine.run_for(0.015)
    spoil_off = rig.engine.drive
    assert isinstance(spoil_off, Spoilt)
    spoil_off.change = lambda ring: ring
    rig.engine.run_for(0.2)
    assert not codes(rig)


@pytest.mark.parametrize("reading", [math.nan, math.inf, -1e300])
def test_a_lost_reading_is_reckoned_for_a_moment_and_then_stops_the_axis(reading: float) -> None:
    rig = powered(improved_machine(), 30.0)
    spoil(rig, lambda _: reading)
    rig.engine.run_for(0.015)
    assert not codes(rig)
    for _ in range(100):
        rig.engine.step()
        assert math.isfinite(rig.engine.output.vel_cmd_rad_s)
        assert math.isfinite(rig.engine.output.torque_ff_nm)
    assert codes(rig) == {Code.ENC_07}
    assert deg(rig.program.axis.pos_act_rad) == pytest.approx(30.0, abs=0.01)


def test_the_angle_shown_is_that_of_the_load_at_every_angle() -> None:
    """Without maps the angle by the motor is off by up to 0.005 deg; both encoders were zeroed at 0 deg."""
    for angle in (-90.0, 40.0, 90.0):
        drive = sim_drive(improved_machine(), angle)
        engine = build_engine(improved_machine(), drive=drive)
        engine.step()
        program = engine.program
        assert isinstance(program, GantryProgram)
        assert deg(program.axis.pos_act_rad) == pytest.approx(deg(drive.sim.truth()[0]), abs=0.0015)


def test_a_new_reference_counts_the_lead_of_the_motor() -> None:
    rig = powered(improved_machine(), 60.0)
    rig.engine.run_for(1.0)
    axis = rig.program.axis
    assert axis.set_position(rad(60.0)) is None
    rig.engine.step()
    assert deg(axis.pos_act_rad) == pytest.approx(60.0, abs=1e-6)
    assert abs(deg(axis.pos_err_rad)) < 1e-3


def test_feed_forward_of_the_wrong_sign_is_bounded_and_nothing_runs_away() -> None:
    """A calibration with every sign turned round: as wrong as the maps are large, and inside every limit."""
    machine = turned_round(improved_machine())
    rig = powered(machine, 30.0)
    rig.command(move=True, target_rad=rad(36.0), speed_rad_s=rad(6.0))
    limit = machine.control.compensation.torque.limit_nm + 40.0  # and the preload of the brake's release
    for _ in range(12_000):
        rig.engine.step()
        assert abs(rig.engine.output.torque_ff_nm) <= limit
    assert not rig.program.axis.alarms.active
    load = deg(rig.engine.truth.truth()[0])
    assert load == pytest.approx(36.0, abs=0.02)


def turned_round(machine: Machine) -> Machine:
    calibration = machine.calibration
    assert calibration is not None
    found, maps = calibration.identified, calibration.maps
    wrong = calibration.model_copy(
        update={
            "identified": found.model_copy(update={"moment_sine_nm": -found.moment_sine_nm}),
            "maps": maps.model_copy(
                update={
                    "gear_rad": tuple(-x for x in maps.gear_rad),
                    "reversal_rad": tuple(-x for x in maps.reversal_rad),
                    "fast": tuple((c, -s, -k) for c, s, k in maps.fast),
                }
            ),
        }
    )
    return with_values(machine, {}).calibrated(wrong)
