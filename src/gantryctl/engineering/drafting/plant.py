"""The simulated plant of a draft: stiffness from the first mode, friction, base and encoder by stated rules."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.drafting.basis import Basis
from gantryctl.engineering.drafting.gear_errors import gear_error_values
from gantryctl.engineering.drafting.origin import Values, chosen, computed, guessed, significant
from gantryctl.errors import ConfigError

# Slopes of a strain-wave reducer over the first, and where they end as parts of its rated torque (catalogue rows of the
# largest sizes; Harmonic Drive, CSG series).
_SLOPES: Final = (1.0, 1.4, 1.75)
_ENDS: Final = (0.105, 0.38)
# Part of the compliance between motor and load that the reducer has; pinion, ring, bearing and steel have the rest.
_REDUCER_PART: Final = 0.66
# Hysteresis of the reducer: half width over its rated torque, and its length over the wind-up at rated torque: as a
# spring beside the transmission it stays below three times that at twice the rated torque, which the step can follow.
_HYSTERESIS: Final = (0.009, 0.08)


def plant_values(basis: Basis) -> Values:
    """[plant]: what the sheet says of the load is what the simulator simulates; the rest by rules."""
    found = {
        **_load(basis),
        **_motor(basis),
        **_transmission(basis),
        **_friction(basis),
        **_base_and_brake(basis),
        **_wind_and_integration(basis),
        **_encoder(basis),
    }
    return {**{f"plant.{path}": drafted for path, drafted in found.items()}, **gear_error_values(basis)}


def _load(basis: Basis) -> Values:
    keys = ("inertia_kg_m2", "mass_kg", "eccentricity_m", "eccentric_angle_deg", "eccentric_check_moment_nm")
    return {
        **{f"load.{key}": basis.of_sheet(f"load.{key}") for key in keys},
        "load.eccentric_sign": guessed(-1.0, "the load hangs at rest at that angle"),
    }


def _motor(basis: Basis) -> Values:
    return {
        "motor.wave_generator_inertia_kg_m2": basis.of_sheet("gears.input_inertia_kg_m2"),
        "motor.torque_ripple_nm": guessed(
            significant(0.0075 * basis.motor.motor.torque_rated_nm, 3), "1.5 % of rated torque peak to peak"
        ),
        "motor.torque_ripple_order": guessed(12, "6 per pole pair and turn"),
    }


def _transmission(basis: Basis) -> Values:
    gears, ring = basis.sheet.gears, basis.sheet.gears.ring_ratio
    # 1/k = 1/K1 + 1/kb, with the base's own stiffness kb.
    compliance = 1.0 / basis.stiffness_nm_per_rad - 1.0 / basis.base_stiffness_nm_per_rad
    if compliance <= 0.0:
        raise ConfigError(
            [
                f"[structure] first_mode_hz = {basis.sheet.structure.first_mode_hz:g} Hz: the base alone is softer "
                f"({basis.base_frequency_hz:g} Hz with {basis.base_inertia_kg_m2:.4g} kg m2); raise "
                "base_frequency_ratio or base_inertia_ratio"
            ]
        )
    reducer = 1.0 / (_REDUCER_PART * compliance * ring**2)
    rest = 1.0 / ((1.0 - _REDUCER_PART) * compliance)
    by_mode = basis.follows(0.0, "", "structure.first_mode_hz").origin
    rule = "of J (2 pi first mode)^2 less the base: 2/3 of the compliance is the reducer's"
    rated = gears.torque_rated_nm * ring
    half, length = _HYSTERESIS
    at = "transmission"
    slopes = {
        f"{at}.reducer_stiffness_{n}_nm_per_rad": computed(
            significant(slope * reducer), f"{slope:g} x: {rule}"
        )
        for n, slope in enumerate(_SLOPES, start=1)
    }
    return {
        **{path: drafted._replace(origin=by_mode) for path, drafted in slopes.items()},
        **{
            f"{at}.reducer_torque_{n}_nm": guessed(
                significant(part * gears.torque_rated_nm), f"{part:g} x rated torque of the reducer"
            )
            for n, part in enumerate(_ENDS, start=1)
        },
        f"{at}.rest_stiffness_nm_per_rad": computed(significant(rest), "the other third")._replace(
            origin=by_mode
        ),
        f"{at}.damping_ratio": basis.of_sheet("structure.damping_ratio"),
        f"{at}.hysteresis_torque_nm": guessed(
            significant(half * rated, 3), f"{half:g} x rated torque at the axis"
        ),
        f"{at}.hysteresis_load_ratio": guessed(0.1, "a tenth of the load"),
        f"{at}.hysteresis_length_rad": guessed(
            significant(max(length * rated * compliance, _followed_length_rad(basis)), 3),
            f"{length:g} x wind-up at rated torque, or what a drive cycle of the simulator can follow",
        ),
        f"{at}.backlash_mm": basis.follows(
            significant(1e3 * basis.module_m * basis.sheet.teeth.backlash_ratio, 3),
            "module x backlash ratio of the sheet",
            "teeth.backlash_ratio",
        ),
    }


def _followed_length_rad(basis: Basis) -> float:
    """Shortest pre-sliding length that the simulation follows in a brake stop, a fifth added to the machine's rule."""
    # The brake's torque and the rule's stiffness are those of the machine; the first slope alone is a little softer.
    torque = max(basis.motor.brake.torque_nm, basis.motor.motor.torque_max_nm)
    acc: float = torque / (basis.train.inertia_kg_m2 * basis.ratio)
    swing = 2.0 * acc / basis.mode_rad_s
    return 1.2 * 0.5 * basis.cycle_s * swing


def _friction(basis: Basis) -> Values:
    load, gears = basis.sheet.load, basis.sheet.gears
    roller, motor = "roller_friction", "motor_friction"
    return {
        f"{roller}.coulomb_nm": basis.of_sheet("load.friction_coulomb_nm"),
        f"{roller}.breakaway_nm": guessed(
            significant(1.13 * load.friction_coulomb_nm), "1.13 x running friction"
        ),
        f"{roller}.stribeck_deg_s": guessed(
            significant(min(1.0, max(1e-4, basis.speed_deg_s / 300.0)), 3), "highest setting / 300"
        ),
        f"{roller}.viscous_nm_s_per_rad": basis.of_sheet("load.friction_viscous_nm_s_per_rad"),
        f"{roller}.presliding_rad": guessed(3e-5, "rolling bearing"),
        f"{roller}.micro_damping": guessed(0.3, "fades with the pre-sliding"),
        f"{motor}.coulomb_nm": basis.of_sheet("gears.friction_coulomb_nm"),
        f"{motor}.breakaway_nm": guessed(
            significant(1.18 * gears.friction_coulomb_nm), "1.18 x running friction"
        ),
        f"{motor}.stribeck_rad_s": guessed(1.0, "grease"),
        f"{motor}.viscous_nm_s_per_rad": basis.of_sheet("gears.friction_viscous_nm_s_per_rad"),
        f"{motor}.load_ratio": basis.of_sheet("gears.load_loss_ratio"),
        f"{motor}.presliding_rad": guessed(0.005, "seals and bearings"),
        f"{motor}.micro_damping": guessed(0.3, "fades with the pre-sliding"),
    }


def _base_and_brake(basis: Basis) -> Values:
    return {
        "base.inertia_kg_m2": basis.follows(
            significant(basis.base_inertia_kg_m2),
            "part of the load's inertia, [structure] of the sheet",
            "structure.base_inertia_ratio",
        ),
        "base.frequency_hz": basis.follows(
            significant(basis.base_frequency_hz),
            "multiple of the first mode, [structure] of the sheet",
            "structure.base_frequency_ratio",
        ),
        "base.damping_ratio": guessed(0.03, "anchored steel on concrete"),
        "brake.presliding_rad": guessed(5e-4, "lining"),
    }


def _wind_and_integration(basis: Basis) -> Values:
    wind = basis.sheet.wind
    blows = wind.moment_nm != 0.0
    return {
        **{f"wind.{key}": basis.of_sheet(f"wind.{key}") if blows else chosen(value) for key, value in wind},
        "switches.wind": chosen(blows),
        "integration.scheme": computed(
            "rk4" if basis.rk4_steps else "one_evaluation", "as fast as rotor and transmission swing"
        ),
        "integration.rk4_steps": chosen(max(2, min(64, basis.rk4_steps))),
    }


def _encoder(basis: Basis) -> Values:
    travel = basis.sheet.range
    # The encoder of a modulo axis may wrap anywhere.
    centre_deg = 0.0 if travel.kind == "modulo" else 0.5 * (travel.pos_min_deg + travel.pos_max_deg)
    middle = centre_deg / 360.0 * basis.ratio
    return {
        "encoder.latency_us": guessed(62.5, "half a drive cycle"),
        "encoder.mounting_turns": computed(
            round(0.5 * basis.motor.encoder.turns - middle), "the middle of its turns at the middle of travel"
        ),
        "encoder.serial": computed(f"SIM-{basis.sheet.sheet.name}"[:40], "of the simulation"),
    }
