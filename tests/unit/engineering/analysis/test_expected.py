"""Every reference figure of sections 1, 2, 3 and 5, within its own tolerance.

`tests/data/expected.json` holds figures that any correct implementation must meet, computed independently.
The tables below name the function for every entry; an entry without one fails.
"""

import json
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.accuracy.paper import PAPER_TABLE
from gantryctl.engineering.accuracy.procedure.procedures import chord_between, target_points
from gantryctl.engineering.accuracy.statistics import error_range, spread, statistics
from gantryctl.engineering.analysis.models import profiles
from gantryctl.engineering.analysis.models.linear import PhaseMargin, TransferFunction
from gantryctl.engineering.analysis.models.rigid import RigidLoop
from gantryctl.engineering.analysis.models.two_mass import TwoMass, TwoMassLoop
from gantryctl.engineering.sizing import equations as eq

EXPECTED = json.loads((Path(__file__).parents[3] / "data" / "expected.json").read_text(encoding="utf-8"))

ELSEWHERE = {
    "4_sampled_rigid": "the compiled closed loop on the rigid plant",
    "6_profiles": "the planner; the closed form of its times is asserted in test_profiles.py",
}
"""Sections that other tests assert."""

TEXT_ENTRIES = {("5_linear_two_mass", "definition")}

# --- 1 sizing: the paper's machine

J, JM, N = 2.18e6, 0.232, eq.total_ratio(88.0, 13.0)
KVP, TVI, KPP = 77.6959, 0.01, 10.0
ACC_MOTOR = 450.0
ALPHA = eq.mean_acceleration_rad_s2(1.0, 1.0)
ACC = eq.gantry_acceleration_deg_s2(ACC_MOTOR, N)
JS = eq.shaft_inertia_kg_m2(J, N, JM)

SIZING: dict[str, Callable[[], Any]] = {
    "i": lambda: N,
    "n1_rpm": lambda: eq.motor_speed_r_min(1.0, N),
    "alpha2_rad_s2_exact": lambda: ALPHA,
    "T1_Nm_paper_rounding": lambda: eq.motor_torque_nm(J, 0.105, N),
    "T1_Nm_exact": lambda: eq.motor_torque_nm(J, ALPHA, N),
    "T1_with_motor_inertia_Nm": lambda: eq.complete_motor_torque_nm(J, ALPHA, N, JM),
    "P_kW": lambda: eq.power_kw(200.0, 1144.0),
    "P_rated_check_kW": lambda: eq.power_kw(257.0, 1150.0),
    "U_line_V_implied": lambda: eq.implied_line_voltage_v(31e3, 69.0, 0.89, 0.921),
    "enc_step_gantry_deg": lambda: eq.encoder_step_deg(8192, N),
    "enc_range_gantry_rev": lambda: eq.encoder_range_turns(4096, N),
    "J_over_i2": lambda: eq.reflected_inertia_kg_m2(J, N),
    "Js": lambda: JS,
    "inertia_ratio_load_to_motor": lambda: eq.inertia_ratio(J, N, JM),
    "acc_gantry_deg_s2": lambda: ACC,
    "ratio_sizing_to_tuned_acc": lambda: eq.sizing_to_tuned_acceleration(ALPHA, ACC_MOTOR, N),
    "T_acc_tuned_Nm": lambda: eq.acceleration_torque_nm(JS, ACC_MOTOR),
    "t_acc_to_6deg_s": lambda: 6.0 / ACC,
    "angle_used_by_acc_deg": lambda: profiles.shortest_trapezoid_reaching(6.0, ACC) / 2.0,
    "min_move_reaching_6deg_s_deg": lambda: profiles.shortest_trapezoid_reaching(6.0, ACC),
    **{
        f"t_trap_{d}deg_s": partial(profiles.trapezoid_time_s, d, 6.0, ACC)
        for d in (5, 10, 15, 20, 90, 180, 360)
    },
    "speed_LSB_125us_rad_s_motor": lambda: eq.speed_step_rad_s(8192, 125e-6),
    "torque_per_LSB_8192_125us_Nm": lambda: eq.torque_step_nm(8192, 125e-6, KVP),
    "torque_per_LSB_2^22_125us_Nm": lambda: eq.torque_step_nm(2**22, 125e-6, KVP),
}

# --- 2 the paper's table 2

TABLE = statistics(PAPER_TABLE)


def _a_with_population_std() -> float:
    errors = PAPER_TABLE.errors_deg
    return float(spread(errors.mean(axis=0), errors.std(axis=0, ddof=0)))


def _chord_of(angle_deg: float) -> float:
    return float(chord_between(*target_points([0.0, math.radians(angle_deg)], 2.5)))


TABLE2: dict[str, Callable[[], Any]] = {
    "mean_deg": lambda: TABLE.mean_deg,
    "three_sigma_deg_ddof1": lambda: TABLE.three_s_deg,
    "mean_plus_3s": lambda: TABLE.upper_deg,
    "mean_minus_3s": lambda: TABLE.lower_deg,
    "A_deg": lambda: TABLE.a_deg,
    "A_deg_if_ddof0": _a_with_population_std,
    "rms_pose_deg": lambda: {f"{base:g}": rms for base, rms in TABLE.rms_deg.items()},
    "range_pose0": lambda: TABLE.range_deg[0.0],
    "range_pose90": lambda: error_range(PAPER_TABLE, [90.0, -90.0]),
    **{f"chord_R2.5_{d}_m": partial(_chord_of, d) for d in (5, 10, 15, 20)},
    "chord_error_um_for_1e-4deg_at_5_R2.5": lambda: (
        1e6 * math.radians(1e-4) * 2.5 * math.cos(math.radians(2.5))
    ),
}

# --- 3 the rigid loop

TOTAL = RigidLoop(JS, KVP, TVI, KPP, kvf=1.0)
TOTAL0 = RigidLoop(JS, KVP, TVI, KPP, kvf=0.0)
MOTOR = RigidLoop(JM, KVP, TVI, KPP, kvf=1.0)
MOTOR0 = RigidLoop(JM, KVP, TVI, KPP, kvf=0.0)


def _times(name: str) -> list[float]:
    """The instants an entry of section 3 lists."""
    return [float(t) for t in EXPECTED["3_linear_rigid"][name]["value"]]


def _at(name: str, response: Callable[[list[float]], Any]) -> dict[str, float]:
    keys = EXPECTED["3_linear_rigid"][name]["value"]
    return dict(zip(keys, response(_times(name)).tolist(), strict=True))


def _margin(loop: TransferFunction) -> PhaseMargin:
    margin = loop.phase_margin()
    assert margin is not None
    return margin


def _margins(loop: RigidLoop, suffix: str) -> dict[str, Callable[[], Any]]:
    velocity, position, torque = loop.velocity_open, loop.position_open, loop.torque_open
    return {
        f"velocity_open_loop_PM_deg_{suffix}": lambda: _margin(velocity)[0],
        f"velocity_open_loop_wgc_{suffix}": lambda: _margin(velocity)[1],
        f"position_open_loop_GM_{suffix}": lambda: loop.gain_margin,
        f"position_open_loop_PM_deg_{suffix}": lambda: _margin(position)[0],
        f"position_open_loop_wgc_{suffix}": lambda: _margin(position)[1],
        f"torque_cut_PM_deg_{suffix}": lambda: _margin(torque)[0],
        f"torque_cut_wgc_{suffix}": lambda: _margin(torque)[1],
        f"torque_cut_gain_REDUCTION_margin_{suffix}": lambda: loop.gain_reduction_margin,
        f"vel_loop_bw_-3dB_rad_s_{suffix}": loop.velocity.bandwidth_rad_s,
    }


def _closed(loop: RigidLoop, suffix: str) -> dict[str, Callable[[], Any]]:
    step = f"unit_step_y_{suffix}"
    return {
        f"closed_loop_bw_-3dB_rad_s_{suffix}": loop.position.bandwidth_rad_s,
        f"closed_loop_peak_Mr_{suffix}": loop.position.resonance_peak,
        step: lambda: _at(step, loop.step),
        f"unit_step_overshoot_pct_{suffix}": lambda: loop.step_overshoot_percent,
    }


def _response(name: str, response: Callable[[list[float]], Any]) -> dict[str, Callable[[], Any]]:
    return {name: lambda: _at(name, response)}


RIGID: dict[str, Callable[[], Any]] = {
    "vel_loop_wn_rad_s": lambda: TOTAL.velocity_wn_rad_s,
    "vel_loop_zeta": lambda: TOTAL.velocity_zeta,
    "vel_loop_poles": lambda: TOTAL.velocity.poles,
    "pos_loop_poles": lambda: TOTAL.position.poles,
    "zeros_Kvf0": lambda: TOTAL0.position.zeros.real,
    "zeros_Kvf1": lambda: TOTAL.position.zeros.real,
    **_margins(TOTAL, "total"),
    **_margins(MOTOR, "motor_only"),
    **_closed(TOTAL0, "Kvf0_total"),
    **_closed(TOTAL, "Kvf1_total"),
    **_closed(MOTOR0, "Kvf0_motor_only"),
    **_closed(MOTOR, "Kvf1_motor_only"),
    "routh_Kvp_min": lambda: TOTAL.kvp_min,
    "routh_Kpp_max": lambda: TOTAL.kpp_max,
    **_response("ramp_6deg_s_position_error_deg_Kvf0", lambda t: TOTAL0.error_behind(1, 6.0, t)),
    **_response("ramp_6deg_s_position_error_deg_Kvf1", lambda t: TOTAL.error_behind(1, 6.0, t)),
    **_response("ramp_6deg_s_speed_error_deg_s_Kvf1", lambda t: TOTAL.error_behind(0, 6.0, t)),
    **_response("acc_0.39336_speed_error_deg_s_Kvf1", lambda t: TOTAL.error_behind(1, ACC, t)),
    **_response("acc_0.39336_position_error_deg_Kvf1", lambda t: TOTAL.error_behind(2, ACC, t)),
    **_response("acc_0.39336_position_error_deg_Kvf0", lambda t: TOTAL0.error_behind(2, ACC, t)),
    "speed_error_peak_at_acc_corner_deg_s": lambda: TOTAL.largest_error_behind(1, ACC)[1],
    "speed_error_peak_at_acc_reversal_deg_s": lambda: TOTAL.largest_error_behind(1, 2.0 * ACC)[1],
    "position_error_peak_at_acc_corner_deg": lambda: TOTAL.largest_error_behind(2, ACC)[1],
    "speed_error_const_Kvf0_deg_s": lambda: TOTAL0.steady_speed_error(ACC),
    "jerk_j_position_error_deg_per_unit_jerk": lambda: TOTAL.jerk_error_per_jerk,
    **_response("torque_step_10Nm_motor_angle_rad", lambda t: TOTAL.torque_step(10.0, t)),
    "torque_step_peak_gantry_deg_per_Nm": lambda: math.degrees(TOTAL.torque_step_peak_rad_per_nm()) / N,
    "torque_ramp_1Nm_s_steady_motor_angle_rad": lambda: TOTAL.torque_ramp_error_rad_per_nm_s,
}

# --- 5 two masses


def _two_mass(k: float = 5e8, zeta: float = 0.025, kpp: float = KPP) -> TwoMassLoop:
    return TwoMassLoop(TwoMass(J, JM, N, k, zeta), RigidLoop(JS, KVP, TVI, kpp))


FLEXIBLE = _two_mass()

TWO_MASS: dict[str, Callable[[], Any]] = {
    "c_Nms_rad": lambda: FLEXIBLE.plant.damping_nm_s_per_rad,
    "f_antiresonance_Hz": lambda: FLEXIBLE.plant.antiresonance_hz,
    "f_resonance_Hz": lambda: FLEXIBLE.plant.resonance_hz,
    "closed_loop_poles": lambda: FLEXIBLE.poles,
    "load_mode_Hz": lambda: FLEXIBLE.load_mode_hz,
    "load_mode_zeta": lambda: FLEXIBLE.load_mode_zeta,
    "max_real_part_k1e9_zeta0.01": lambda: _two_mass(1e9, 0.01).max_real_part,
    "load_mode_zeta_vs_Kpp_k5e8_z0.025": lambda: {
        f"{kpp}": _two_mass(kpp=kpp).load_mode_zeta for kpp in (2, 5, 10, 15, 20, 30, 60)
    },
    "load_mode_zeta_vs_k_paper_gains": lambda: {
        f"{k:.0e}": {f"{z:g}": _two_mass(k, z).load_mode_zeta for z in (0.01, 0.025)}
        for k in (2e8, 3e8, 5e8, 1e9, 2e9)
    },
    "locked_motor_gravity_windup_deg_per_10kNm_k5e8": lambda: FLEXIBLE.plant.windup_deg(1e4),
}

CHECKS = {"1_sizing": SIZING, "2_table2": TABLE2, "3_linear_rigid": RIGID, "5_linear_two_mass": TWO_MASS}


def _entries() -> list[tuple[str, str]]:
    return [
        (section, name)
        for section in EXPECTED
        if section not in ELSEWHERE
        for name in EXPECTED[section]
        if (section, name) not in TEXT_ENTRIES
    ]


def _numbers(value: Any) -> np.ndarray:
    """A nested entry as one flat array; a pair of numbers in a list of pairs is a complex number."""
    if isinstance(value, dict):
        return np.concatenate([_numbers(value[key]) for key in value])
    array = np.asarray(value)
    if array.ndim == 2:
        return np.sort_complex(array[:, 0] + 1j * array[:, 1])
    return np.atleast_1d(array)


def _same_keys(actual: Any, expected: Any) -> bool:
    if isinstance(expected, dict):
        same = list(actual) == list(expected)
        return same and all(_same_keys(actual[key], expected[key]) for key in expected)
    return True


@pytest.mark.parametrize(("section", "name"), _entries())
def test_reference_figure(section: str, name: str) -> None:
    entry = EXPECTED[section][name]
    assert name in CHECKS[section], f"no check for {section}: {name}"
    actual = CHECKS[section][name]()
    if entry["value"] is None:
        assert actual is None
        return
    assert _same_keys(actual, entry["value"])
    expected, found = _numbers(entry["value"]), _numbers(actual)
    assert found.shape == expected.shape
    limit = entry.get("atol", 0.0) + entry.get("rtol", 0.0) * np.abs(expected)
    # a figure printed with all its digits cannot be met closer than its last bits
    assert np.all(np.abs(found - expected) <= np.maximum(limit, 4.0 * np.finfo(float).eps)), found - expected


def test_nothing_is_checked_that_is_not_there() -> None:
    for section, checks in CHECKS.items():
        assert set(checks) <= set(EXPECTED[section])
    assert set(CHECKS) | set(ELSEWHERE) == set(EXPECTED)
