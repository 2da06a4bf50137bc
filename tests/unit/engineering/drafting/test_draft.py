"""From a sheet to a machine: valid, whole, of its own numbers, each with where it comes from."""

import math

import numpy as np
import pytest

from gantryctl.engineering.analysis.models.mechanics import PlantKind, mechanics
from gantryctl.engineering.analysis.models.modes import Oscillation
from gantryctl.engineering.analysis.models.robust import Uncertainty, robust_margins
from gantryctl.engineering.drafting.choice import draft_with
from gantryctl.engineering.drafting.draft import BUS, draft
from gantryctl.engineering.drafting.gear_errors import drawn_phases, pitch_deviation_um, ring_um
from gantryctl.engineering.drafting.origin import Origin
from gantryctl.engineering.drafting.sheets import Answered, drafted_sheet, sheet_values
from gantryctl.engineering.drafting.templates import load_template, template_names
from gantryctl.engineering.drafting.writing import guess_lines, machine_text
from gantryctl.engineering.faults.physics import friction_nm
from gantryctl.engineering.sizing.checks import fit
from gantryctl.engineering.sizing.loading import default_sheet_path, load_sheet
from gantryctl.engineering.sizing.motors import delivered_motors, load_motors
from gantryctl.engineering.stops import StopClass, run_stop
from gantryctl.errors import ConfigError
from gantryctl.machine import (
    config_hash,
    configs_folder,
    default_machine,
    effective_values,
    field_specs,
    origins,
    parse_machine,
)
from gantryctl.units import rad
from gantryctl.wiring.simulator import plant_params

TEMPLATES = template_names()
# What the reference gantry was fitted, tuned or drawn to: no other machine has it by chance.
OF_THE_REFERENCE = (
    "drive.speed_loop.kvp_nm_s_per_rad",
    "control.compensation.gear_map.cycles_per_turn",
    "plant.transmission.reducer_stiffness_1_nm_per_rad",
    "plant.transmission.rest_stiffness_nm_per_rad",
    "plant.transmission.hysteresis_torque_nm",
    "plant.transmission.backlash_mm",
    "plant.gear_error.ring_radius_m",
    "plant.gear_error.ring_um",
    "plant.gear_error.phases_rad",
    "plant.base.inertia_kg_m2",
    "plant.base.frequency_hz",
    "plant.roller_friction.coulomb_nm",
    "plant.motor_friction.coulomb_nm",
    "plant.encoder.serial",
    "virtual_axis.quick_dec_deg_s2",
)


@pytest.mark.parametrize("template", TEMPLATES)
def test_every_template_is_a_machine_that_the_full_plant_accepts(made, template):
    """`draft_with` has checked rules and quick stop; the text is the same machine."""
    machine = made(template).machine()
    assert config_hash(parse_machine(machine_text(made(template)))) == config_hash(machine)
    assert machine.name == f"my_{template}"


@pytest.mark.parametrize("template", TEMPLATES)
def test_no_key_of_the_machine_is_left_to_a_default(made, template):
    """Defaults are the reference gantry's: only [can], which a simulated machine does not read, keeps them."""
    origin = origins(made(template).machine())
    assert [path for path, where in origin.items() if where == "default" and not path.startswith(BUS)] == []


@pytest.mark.parametrize("template", TEMPLATES)
def test_nothing_of_the_reference_gantry_comes_along(made, template):
    own, reference = effective_values(made(template).machine()), effective_values(default_machine())
    assert [path for path in OF_THE_REFERENCE if own[path] == reference[path]] == []


@pytest.mark.parametrize("template", TEMPLATES)
def test_the_load_swings_with_the_first_mode_of_the_sheet(made, template):
    """Stiffness follows from the mode with the base in series; its mass, left out there, moves the mode by 1 to 3 %."""
    drafted = made(template)
    plant = mechanics(drafted.machine(), PlantKind.FULL)
    found = Oscillation.of(complex(plant.held_poles()[0])).hz
    assert found == pytest.approx(drafted.fit.train.sheet.structure.first_mode_hz, rel=0.03)


@pytest.mark.parametrize("template", TEMPLATES)
def test_gains_are_stable_with_margins_on_plants_around_the_machine(made, template):
    """Stiffness 0.8 to 1.3 times, inertia 0.9 to 1.1: inside the set of the search, so 30 deg must be left."""
    machine = made(template).machine()
    around = Uncertainty(
        stiffness_parts=(0.8, 1.3),
        stiffness_steps=4,
        damping_ratio=(machine.plant.transmission.damping_ratio,),
        load_inertia=(0.9, 1.0, 1.1),
        motor_inertia=(1.0,),
    )
    margins = robust_margins(machine, around)
    # The set lies around the machine's own plant.
    stiffness = [case.variation.stiffness_nm_per_rad for case in margins.cases]
    assert min(stiffness) < plant_params(machine).stiffness_1_nm_per_rad < max(stiffness)
    assert margins.stable
    assert margins.worst_phase.phase_margin_deg > 30.0


@pytest.mark.parametrize("template", TEMPLATES)
def test_what_a_motion_may_need_is_in_the_file_where_friction_is_above_the_brake_test(made, template):
    """Of the plant at its highest speed; a yaw drive alone has so much friction (`wiring.program`, BRK-02)."""
    machine = made(template).machine()
    needs = machine.plant.load.eccentric_check_moment_nm / machine.axis.ratio
    needs += friction_nm(machine, rad(machine.speed.setting_max_deg_s) * machine.axis.ratio)
    given = max(machine.brake.test_torque_nm, machine.monitors.running_torque_nm)
    assert given >= 0.99 * needs
    assert (machine.monitors.running_torque_nm > 0.0) is (template == "wind_turbine_yaw")
    # Mean, and 3.5 times gusts of twice the turbulence.
    wind = machine.plant.wind
    wind_nm = abs(wind.moment_nm) * (1.0 + 7.0 * wind.turbulence) / machine.axis.ratio
    assert machine.monitors.wind_torque_nm == pytest.approx(wind_nm, rel=0.006)
    assert (wind_nm > 0.0) is (template in ("telescope_azimuth", "wind_turbine_yaw", "crane_slew"))


@pytest.mark.parametrize("template", TEMPLATES)
def test_gear_waves_follow_from_the_machine_s_own_ratios_and_teeth(made, template):
    machine = made(template).machine()
    ratio, teeth = machine.axis.ratio, machine.plant.gear_error.pinion_teeth * machine.axis.ring_ratio
    waves = machine.control.compensation.gear_map.cycles_per_turn
    assert waves == pytest.approx((teeth, ratio, 2.0 * ratio, 4.0 * ratio))


def test_the_ring_has_the_pitch_deviation_of_its_grade():
    """Module 14, 4.73 m, grade 8: 0.27 mm, the reference ring (`machine.tables.plant`); the sum of waves has it too."""
    total = pitch_deviation_um(14.0, 4732.0, 8.0)
    assert total == pytest.approx(270.0, rel=0.03)
    assert pitch_deviation_um(14.0, 4732.0, 9.0) == pytest.approx(math.sqrt(2.0) * total)
    phases = drawn_phases("any")
    turn = np.linspace(0.0, 2.0 * math.pi, 5000)
    waves = enumerate(ring_um(total, phases), start=1)
    whole = sum(um * np.sin(n * turn + phases[n - 1]) for n, um in waves)
    # Amplitudes have three digits, and 5000 points miss a peak of 12 waves by less than 0.1 %.
    assert np.ptp(whole) == pytest.approx(total, rel=0.01)
    assert drawn_phases("any") == phases != drawn_phases("other")


def test_the_reference_sheet_needs_only_what_it_gives(made):
    """A sheet without guesses: every value of it stands in the machine as the sheet's."""
    (motor,) = load_motors([configs_folder() / "motors" / "im_31kw_1150.toml"])
    drafted = draft(fit(load_sheet(default_sheet_path()), motor), "other")
    assert drafted.values["plant.load.inertia_kg_m2"].origin is Origin.SHEET
    assert drafted.values["axis.ring_ratio"].origin is Origin.SHEET
    assert drafted.values["motor.inertia_kg_m2"].origin is Origin.CATALOGUE
    # Nobody says where the switches stand, and the sheet leaves the base open.
    assert {"axis.limit_switch_max_deg", "plant.base.frequency_hz"} <= set(drafted.guesses)
    assert "plant.transmission.rest_stiffness_nm_per_rad" not in drafted.guesses


def test_guesses_are_in_the_file_its_list_and_the_printed_lines(made):
    drafted = made("tilt_table")
    text, machine = machine_text(drafted), drafted.machine()
    assert set(machine.machine.guesses) == set(drafted.guesses)
    assert {path for path, where in origins(machine).items() if where == "guess"} == set(drafted.guesses)
    lines = guess_lines(drafted.values)
    for path, line in zip(drafted.guesses, lines, strict=True):
        spec = field_specs()[path]
        assert line.startswith(f"[{spec.table}] {spec.key} = ")
        assert drafted.values[path].rule in line
        assert f"guess: {drafted.values[path].rule}" in text


def test_a_motor_that_does_not_fit_gives_no_draft(made):
    (small,) = load_motors([configs_folder() / "motors" / "pm_200w_3000.toml"])
    sheet = made("gantry").fit.train.sheet
    with pytest.raises(ConfigError, match="pm_200w_3000 does not fit my_gantry: "):
        draft(fit(sheet, small), "x")


# 160 kg m2 that turn 3 m/s at the rim: the motor of 200 W has the torque for it, and 65 times less inertia.
HEAVY_TABLE = {
    "acc_time_s": 5.421, "first_mode_hz": 38.52, "inertia_kg_m2": 157.6, "speed_max_r_min": 4.741,
    "stopping_angle_deg": 12.62, "unbalance_nm": 5.088,
}  # fmt: skip


def test_a_motor_with_enough_torque_and_too_soft_a_loop_is_passed_over():
    """The next one is taken; where there is none the draft says what its loop cannot do.

    By hand, of the small one: 0.181 N m of friction that turns round at 0.0334 N m s/rad and 0.04 s is 0.217 rad of the
    motor, 0.0667 deg of the axis behind 186:1. With 0.203 /s an error of 0.009 deg, 0.3 of what is required, takes
    0.0667 / (0.203 x 0.009) = 36.5 s until the motor turns; 55 with the reserve of a half.
    """
    values = sheet_values(Answered.of(load_template("rotary_table"), HEAVY_TABLE), "heavy")
    sheet = drafted_sheet(values, "heavy")
    made = draft_with(sheet, load_motors(delivered_motors()), "heavy")
    assert made.soft_loop is None
    assert made.fit.motor.name == "pm_400w_3000"
    assert made.machine().monitors.in_position_tolerance_time_s < 10.0
    (small,) = load_motors([configs_folder() / "motors" / "pm_200w_3000.toml"])
    alone = draft_with(sheet, [small], "heavy")
    soft = alone.soft_loop
    assert soft is not None
    assert soft.window_deg == pytest.approx(0.009)
    assert 1.5 * 36.5 < soft.arrives_s < 4.0 * 36.5
    assert soft.following_error_deg > soft.band_deg
    monitors = alone.machine().monitors
    assert monitors.in_position_window_deg == pytest.approx(soft.window_deg)
    # the most that a machine file permits
    assert monitors.in_position_tolerance_time_s == 100.0
    assert " is within 0.009 deg of its target 103 s behind a motion: " in soft.text


@pytest.mark.parametrize("first_mode_hz", [30.0, 60.0, 150.0])
def test_a_stiff_small_table_is_simulated_with_a_step_that_follows_it(first_mode_hz):
    """A brake stop loads the hysteresis most: with 125 us and one evaluation it swings up from 50 Hz on."""
    values = sheet_values(
        Answered.of(load_template("rotary_table"), {"first_mode_hz": first_mode_hz}), "stiff"
    )
    machine = draft_with(drafted_sheet(values, "s"), load_motors(delivered_motors()), "stiff").machine()
    stop = run_stop(machine, StopClass.BRAKE, 0.1 * machine.speed.setting_max_deg_s, 90.0)
    assert math.isfinite(stop.angle_deg)


def test_a_base_softer_than_the_first_mode_is_refused():
    sheet = load_sheet(default_sheet_path())
    soft = sheet.model_copy(
        update={"structure": sheet.structure.model_copy(update={"base_inertia_ratio": 0.05})}
    )
    (motor,) = load_motors([configs_folder() / "motors" / "im_31kw_1150.toml"])
    with pytest.raises(ConfigError, match="first_mode_hz = 2 Hz: the base alone is softer"):
        draft(fit(soft, motor), "x")
