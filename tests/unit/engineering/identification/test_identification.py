"""What identification finds, how near to the truth, and that nothing in the controller knows the plant."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gantryctl.engineering.accuracy.procedure.on_batch import random_gear
from gantryctl.engineering.comparison.key_figures import chord_tests
from gantryctl.engineering.comparison.variants import ending_gently, without_load_encoder
from gantryctl.engineering.identification import (
    CalibrationFit,
    LoadInstrument,
    SimulatedAxis,
    calibrate,
    calibration_of,
    comparisons,
    fit,
    record,
)
from gantryctl.engineering.identification.samples import Samples, joined
from gantryctl.engineering.identification.torque_balance import TorqueBalance
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, Unknown, calibration_toml, with_values
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.simulator import plant_params
from support.improved import improved_machine

EVERYTHING_OFF = {
    f"plant.switches.{name}": False
    for name in (
        "gear_error", "backlash", "hysteresis", "roller_friction", "motor_friction", "torque_ripple", "three_slopes",
    )
}  # fmt: skip


def error_percent(machine: Machine, seed: int = 0) -> dict[str, float]:
    return {
        c.name: c.error_percent for c in comparisons(machine, calibrate(SimulatedAxis(machine, seed=seed)))
    }


@pytest.fixture(scope="module")
def found() -> CalibrationFit:
    return fit(improved_machine(), record(SimulatedAxis(improved_machine())))


def test_without_friction_and_gear_errors_every_number_is_found() -> None:
    """Nothing disturbs the fit: what is left is the tracker's noise. The wave generator's inertia, which stands on
    no name plate, is left out: it would count as load, and with it 8 % more stiffness.
    """
    machine = with_values(
        improved_machine(), EVERYTHING_OFF | {"plant.motor.wave_generator_inertia_kg_m2": 0.0}
    )
    found = error_percent(machine)
    assert abs(found["eccentric moment, sine"]) < 0.1
    # the delay of the current loop and the base's own inertia are not in the torque balance
    assert abs(found["inertia of load and motor"]) < 1.0
    assert abs(found["wind-up per acceleration"]) < 0.1
    assert abs(found["stiffness, small loads, base included"]) < 1.0


def test_on_the_full_plant_the_numbers_are_right_to_their_worth(found: CalibrationFit) -> None:
    """What the fit does not know: breakaway and hysteresis, three slopes of the spring, gear error that swings at the
    ends of a ramp. They leave some 0.5 %; the measures of the issue are 3 % (moment, inertia) and 10 %.
    """
    calibration = calibration_of(improved_machine(), found, "2026-01-01", 1)
    nominal = {c.name: c.error_percent for c in comparisons(improved_machine(), calibration)}
    assert abs(nominal["eccentric moment, sine"]) < 1.0
    assert abs(nominal["inertia of load and motor"]) < 1.5
    # what a speed loop of 50 Hz shows of a rotor behind a spring
    assert abs(nominal["inertia at the motor"]) < 3.0
    assert abs(nominal["stiffness, small loads, base included"]) < 5.0
    assert abs(nominal["wind-up per acceleration"]) < 5.0
    assert abs(nominal["Coulomb friction, unloaded"]) < 3.0
    # a tenth of a torque of 20 kN m in the balance of 30
    assert abs(nominal["friction per load"]) < 10.0
    assert found.identified.dead_time_s == pytest.approx(0.000515, abs=0.05 * 1e-3)  # 5 % of a cycle


@pytest.mark.slow
def test_friction_that_grows_with_the_load_is_no_moment() -> None:
    """The same samples without the motor's load-dependent friction: a linear balance says 5 % more moment."""
    machine = with_values(improved_machine(), {"plant.motor_friction.load_ratio": 0.25})
    found = calibrate(SimulatedAxis(machine)).identified
    assert found.moment_sine_nm == pytest.approx(15_990.0, rel=0.015)
    assert found.friction_load_ratio == pytest.approx(0.25, rel=0.1)


def test_the_lean_of_the_base_is_found_where_ring_and_tracker_are_read(found: CalibrationFit) -> None:
    """A base that rocks at 7 Hz answers ramps of half a second by 2 % more than it does at rest."""
    lean = found.maps.lean_rad_per_nm
    assert lean is not None
    assert lean == pytest.approx(1.0 / plant_params(improved_machine()).base_stiffness_nm_per_rad, rel=0.05)
    # It is the sine of the scale map: 14 urad under 16 kN m.
    assert lean * 16e3 == pytest.approx(found.maps.scale_rad[1], rel=0.05)


def test_the_map_of_another_gear_is_another_map() -> None:
    machine = random_gear(improved_machine(), 5)
    own, other = calibrate(SimulatedAxis(machine)), improved_machine().calibration
    assert other is not None
    found = {c.name: c for c in comparisons(machine, own)}
    wrong = {c.name: c for c in comparisons(machine, other)}
    rms = found["gear map, rms"].truth
    # the wind-up of three slopes, the backlash and the base go into the map: they are of the size of its error
    assert found["gear map, rms of its error"].identified < 0.3 * rms
    assert wrong["gear map, rms of its error"].identified > rms


def test_the_eccentric_moment_of_a_tilted_load_has_both_parts() -> None:
    machine = with_values(improved_machine(), {"plant.load.eccentric_angle_deg": 30.0})
    found = calibrate(SimulatedAxis(machine)).identified
    angle = math.degrees(math.atan2(found.moment_cosine_nm, found.moment_sine_nm))
    assert angle == pytest.approx(-30.0, abs=2.0)


@pytest.mark.slow
def test_the_encoder_on_the_ring_does_as_an_instrument_but_knows_nothing_of_its_own_errors() -> None:
    found = calibrate(SimulatedAxis(improved_machine(), LoadInstrument.LOAD_ENCODER))
    by_tracker = improved_machine().calibration
    assert by_tracker is not None
    assert found.maps.scale_rad == ()
    assert found.origin.instrument == "load-encoder"
    # scale errors of 4 urad and a base that leans by 14 urad go into this map
    difference = np.array(found.maps.gear_rad[1:7]) - np.array(by_tracker.maps.gear_rad[1:7])
    assert 1e-7 < np.max(np.abs(difference)) < 3e-5


@pytest.mark.slow
def test_noise_of_the_tracker_hardly_matters(found: CalibrationFit) -> None:
    """4 urad of noise over 17 000 samples of 40 readings each and some 90 unknowns: far below 0.1 urad."""
    other = calibrate(SimulatedAxis(improved_machine(), seed=2)).maps.gear_rad
    assert 0.0 < np.max(np.abs(np.subtract(found.maps.gear_rad, other))) < 1e-7


def test_the_packaged_calibration_is_what_identify_gives(found: CalibrationFit) -> None:
    packaged = improved_machine().calibration
    assert packaged is not None
    # The same core gives the same values to the place that they are rounded to. A core that rounds otherwise shifts
    # encoder steps by a cycle: 0.07 % of the moment, 1.2e-8 rad of the map were seen.
    for name, value in packaged.identified.model_dump().items():
        # The cosine of the moment is 2 N m of 16 000: noise.
        room = {"abs": 1.0} if name == "moment_cosine_nm" else {"rel": 2e-3}
        assert getattr(found.identified, name) == pytest.approx(value, **room), name
    for name, table in packaged.maps:
        if name not in ("fast", "lean_rad_per_nm"):
            assert getattr(found.maps, name) == pytest.approx(table, abs=1e-7), name
    assert found.maps.lean_rad_per_nm == pytest.approx(packaged.maps.lean_rad_per_nm, rel=2e-3)
    for wave, known in zip(found.maps.fast, packaged.maps.fast, strict=True):
        assert wave == pytest.approx(known, rel=1e-6, abs=1e-7)


def test_backlash_is_identified_as_such(found: CalibrationFit) -> None:
    """0.05 mm at the ring are 21 urad; 3 urad of interval, and 25 % for what the model leaves out of hysteresis."""
    true = 0.05e-3 / improved_machine().plant.gear_error.ring_radius_m
    assert found.identified.backlash_rad == pytest.approx(true, abs=found.half_width["backlash_rad"])
    assert found.half_width["backlash_rad"] < 0.35 * true


@pytest.mark.slow
def test_without_backlash_none_is_made_up() -> None:
    """Hysteresis of 2 kN m and friction of 6 are no gap of more than 2 urad, a tenth of the nominal one."""
    machine = with_values(improved_machine(), {"plant.switches.backlash": False})
    assert (calibrate(SimulatedAxis(machine)).identified.backlash_rad or 0.0) < 2e-6


WITHOUT_ENCODER_DEG = {
    "backlash": (0.0169, {"plant.transmission.backlash_mm": 0.2}),
    "a wave in no list": (0.0135, {"plant.gear_error.pinion_teeth": 6, "plant.gear_error.mesh_um": 30.0}),
    "22 x 52": (0.0106, {"axis.reducer_ratio": 52.0, "axis.ring_ratio": 22.0}),
    "single teeth": (0.0094, {"plant.switches.tooth_pitch": True, "plant.tooth_pitch.scale": 0.8}),
}
"""A of the paper's loop by procedure A, on machines whose gear is in no list."""


# The others take 5 s each.
SLOW_MACHINES = [pytest.param(name, marks=pytest.mark.slow) for name in list(WITHOUT_ENCODER_DEG)[1:]]


@pytest.mark.parametrize("name", ["backlash", *SLOW_MACHINES])
def test_machines_that_no_list_knows_are_better_than_a_third_of_the_papers_loop(name: str) -> None:
    paper_deg, changes = WITHOUT_ENCODER_DEG[name]
    machine = with_values(improved_machine(), changes)
    own = without_load_encoder(machine.calibrated(calibrate(SimulatedAxis(machine))))
    # A gentle end belongs to the encoder on the ring: by the motor alone it leaves 0.0058 deg with a gap of 0.2 mm.
    (found,) = chord_tests([ending_gently(own, gently=False)], "A", [0])
    assert found.a_true_deg < paper_deg / 3.0


def test_identified_twice_is_the_same_to_the_byte(found: CalibrationFit) -> None:
    machine = improved_machine()
    again = fit(machine, record(SimulatedAxis(machine)))
    first, second = (
        calibration_toml(calibration_of(machine, each, "2026-01-01", 1)) for each in (found, again)
    )
    assert first == second


def test_the_torque_balance_has_come_to_its_least_squares(found: CalibrationFit) -> None:
    """Whole steps of Gauss and Newton went round: 0.1 % of the moment, another end for the slightest change."""
    samples = joined([found.recording.turns, found.recording.swings])
    ratio, machine = improved_machine().axis.ratio, improved_machine()
    loop = found.recording.speed_loop
    lack = loop.sampled_torque_lack_kg_m2(machine.control.scan_period_ms * 1e-3)
    wanted = samples.torque_nm * ratio + ratio * ratio * lack * samples.acc_rad_s2

    def left_nm(balance: TorqueBalance) -> float:
        return float(np.sqrt(np.mean((wanted - balance.torque_nm(samples)) ** 2)))

    least = left_nm(found.balance)
    for name in ("moment_sine_nm", "friction_load_side_nm", "friction_motor_side_nm", "friction_load_ratio"):
        for part in (0.999, 1.001):
            assert left_nm(found.balance._replace(**{name: part * getattr(found.balance, name)})) > least


def test_friction_that_drives_the_load_is_no_friction(found: CalibrationFit) -> None:
    """So the torques of a sound machine with a moment of 1 kN m came out (-291 N m), and flanks were planned by it."""
    driven = found.balance._replace(friction_load_side_nm=-300.0)

    def with_it(samples: Samples) -> Samples:
        more_nm = driven.torque_nm(samples) - found.balance.torque_nm(samples)
        return replace(samples, torque_nm=samples.torque_nm + more_nm / improved_machine().axis.ratio)

    recording = found.recording
    again = fit(
        improved_machine(),
        replace(recording, turns=with_it(recording.turns), swings=with_it(recording.swings)),
    )
    assert again.balance.friction_load_side_nm < 0.0
    assert again.unknown["friction_load_nm"] is Unknown.TOO_WIDE
    assert again.identified.friction_load_nm is None
    assert again.identified.friction_nm == pytest.approx(
        found.balance.friction_motor_side_nm - 300.0, rel=0.01
    )


def test_the_fit_says_how_well_it_fits(found: CalibrationFit) -> None:
    # 10 um at 2.5 m over 40 readings are 0.00004 deg; the rest are waves that are not in the map
    assert 0.00004 < found.residual_deg < 0.0005


def test_changing_the_plant_leaves_every_number_of_the_controller() -> None:
    changes = {
        "plant.load.inertia_kg_m2": 1.9e6,
        "plant.load.eccentricity_m": 0.011,
        "plant.transmission.rest_stiffness_nm_per_rad": 8e8,
        "plant.gear_error.scale": 0.4,
        "plant.roller_friction.coulomb_nm": 3000.0,
        "plant.load_encoder.scale_error_rad": 1e-5,
        "plant.load_encoder.latency_us": 500.0,
        "plant.encoder.latency_us": 500.0,
        "plant.base.frequency_hz": 5.0,
    }
    before, after = compensation(improved_machine()), compensation(with_values(improved_machine(), changes))
    assert before is not None
    assert after is not None
    assert before.parameters == after.parameters
    assert all(before.lead(x) == after.lead(x) for x in np.linspace(-3.1, 3.1, 101))


def test_a_rigid_machine_has_no_windup_and_everything_else_is_identified() -> None:
    rigid = with_values(improved_machine(), {"plant.switches.rigid": True})
    calibration = calibrate(SimulatedAxis(rigid))
    windup = {"windup_per_acc_s2", "stiffness_nm_per_rad", "swing_hz"}
    assert dict(calibration.unknown) == {
        **dict.fromkeys(windup, Unknown.NO_WINDUP),
        "backlash_rad": Unknown.NO_GAP,
    }
    assert calibration.identified.moment_sine_nm == pytest.approx(15_990.0, rel=0.02)
    with pytest.raises(ConfigError, match="swing_hz could not be identified: the load shows no wind-up"):
        calibration.number("swing_hz")
    # the laws that live on it are refused by name, the others run
    calibrated = rigid.calibrated(calibration)
    with pytest.raises(
        ConfigError, match=r"windup.active lives on stiffness_nm_per_rad.*switch windup.active off"
    ):
        compensation(calibrated)
    laws = ("windup.active", "damping.active", "moment_observer.active")
    off = {f"control.compensation.{law}": False for law in laws}
    assert compensation(with_values(calibrated, off).calibrated(calibration)) is not None
