"""The loop as the paper draws it, on the numbers of a machine file: eq. (5) rigid, and the two-mass sketch.

Continuous, ideal torque, inertia without wave generator (the paper's Js). `rigid_figures` and
`two_mass_figures` give every figure under a fixed name, so that a reader, a test and another program can ask
for the same one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

from gantryctl.engineering.analysis.models.linear import (
    ComplexArray,
    FloatArray,
    PhaseMargin,
    TransferFunction,
)
from gantryctl.engineering.analysis.models.rigid import RigidLoop
from gantryctl.engineering.analysis.models.two_mass import TwoMass, TwoMassLoop
from gantryctl.machine import Machine

SKETCH_STIFFNESS_NM_PER_RAD: Final = 5.0e8
# The two-mass sketch of the gantry: one stiffness at the gantry, no base, no wave generator.
SKETCH_DAMPING_RATIO: Final = 0.025

TORQUE_STEP_NM: Final = 10.0
_STEP_S: Final = (0.005, 0.01, 0.02, 0.03, 0.05, 0.075, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5)
_RAMP_S: Final = (0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)
_TORQUE_S: Final = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
_KPP_SWEEP: Final = (2, 5, 10, 15, 20, 30, 60)
_K_SWEEP: Final = (2e8, 3e8, 5e8, 1e9, 2e9)
_ZETA_SWEEP: Final = (0.01, 0.025)


def rigid_loop(machine: Machine, kvf: float | None = None, motor_only: bool = False) -> RigidLoop:
    """Eq. (5) with the machine's gains; on load and rotor, or on the rotor alone (what a drive's auto-tune
    sees).
    """
    rotor = machine.motor.inertia_kg_m2
    # Js of eq. (5): load and rotor at the motor shaft, 1.898 kg m2 for the reference machine, no wave
    # generator.
    reflected = machine.plant.load.inertia_kg_m2 / machine.axis.ratio**2
    loop, control = machine.drive.speed_loop, machine.control
    return RigidLoop(
        js_kg_m2=rotor if motor_only else reflected + rotor,
        kvp_nm_s_per_rad=loop.kvp_nm_s_per_rad,
        tvi_s=loop.tvi_ms * 1e-3,
        kpp_per_s=control.kpp_per_s,
        kvf=control.kvf if kvf is None else kvf,
    )


def two_mass_loop(
    machine: Machine, stiffness_nm_per_rad: float, damping_ratio: float, kpp_per_s: float | None = None
) -> TwoMassLoop:
    """The two-mass loop with the machine's inertias and gains."""
    load, rotor = machine.plant.load.inertia_kg_m2, machine.motor.inertia_kg_m2
    plant = TwoMass(load, rotor, machine.axis.ratio, stiffness_nm_per_rad, damping_ratio)
    gains = rigid_loop(machine)
    kpp = gains.kpp_per_s if kpp_per_s is None else kpp_per_s
    return TwoMassLoop(plant, RigidLoop(gains.js_kg_m2, gains.kvp_nm_s_per_rad, gains.tvi_s, kpp))


def rigid_figures(machine: Machine) -> dict[str, Any]:
    """Every figure of the rigid loop; angles in deg, poles as [real, imaginary] in rad/s, times in s as
    keys.
    """
    # tests/data/expected.json holds these figures under the same names, computed by another program.
    total, total0 = rigid_loop(machine, 1.0), rigid_loop(machine, 0.0)
    motor, motor0 = rigid_loop(machine, 1.0, motor_only=True), rigid_loop(machine, 0.0, motor_only=True)
    return {
        "vel_loop_wn_rad_s": total.velocity_wn_rad_s,
        "vel_loop_zeta": total.velocity_zeta,
        "vel_loop_poles": pairs(total.velocity.poles),
        "pos_loop_poles": pairs(total.position.poles),
        "zeros_Kvf0": total0.position.zeros.real.tolist(),
        "zeros_Kvf1": total.position.zeros.real.tolist(),
        **_open_figures(total, "total"),
        **_closed_figures(total0, "Kvf0_total"),
        **_closed_figures(total, "Kvf1_total"),
        **_open_figures(motor, "motor_only"),
        **_closed_figures(motor0, "Kvf0_motor_only"),
        **_closed_figures(motor, "Kvf1_motor_only"),
        "routh_Kvp_min": total.kvp_min,
        "routh_Kpp_max": total.kpp_max,
        **_following_figures(machine, total, total0),
        **_torque_figures(machine, total),
    }


def _open_figures(loop: RigidLoop, suffix: str) -> dict[str, Any]:
    velocity, position, torque = (
        _margin(cut) for cut in (loop.velocity_open, loop.position_open, loop.torque_open)
    )
    return {
        f"velocity_open_loop_PM_deg_{suffix}": velocity.margin_deg,
        f"velocity_open_loop_wgc_{suffix}": velocity.crossover_rad_s,
        f"position_open_loop_GM_{suffix}": loop.gain_margin,
        f"position_open_loop_PM_deg_{suffix}": position.margin_deg,
        f"position_open_loop_wgc_{suffix}": position.crossover_rad_s,
        f"torque_cut_PM_deg_{suffix}": torque.margin_deg,
        f"torque_cut_wgc_{suffix}": torque.crossover_rad_s,
        f"torque_cut_gain_REDUCTION_margin_{suffix}": loop.gain_reduction_margin,
        f"vel_loop_bw_-3dB_rad_s_{suffix}": loop.velocity.bandwidth_rad_s(),
    }


def _closed_figures(loop: RigidLoop, suffix: str) -> dict[str, Any]:
    return {
        f"closed_loop_bw_-3dB_rad_s_{suffix}": loop.position.bandwidth_rad_s(),
        f"closed_loop_peak_Mr_{suffix}": loop.position.resonance_peak(),
        f"unit_step_y_{suffix}": _at(_STEP_S, loop.step),
        f"unit_step_overshoot_pct_{suffix}": loop.step_overshoot_percent,
    }


def _following_figures(machine: Machine, total: RigidLoop, total0: RigidLoop) -> dict[str, Any]:
    """Errors behind a ramp at the highest speed setting and behind the configured acceleration."""
    speed, acc = machine.speed.setting_max_deg_s, machine.virtual_axis.acc_deg_s2
    ramp, parabola = f"ramp_{speed:g}deg_s", f"acc_{acc:.5g}"
    return {
        f"{ramp}_position_error_deg_Kvf0": _at(_RAMP_S, lambda t: total0.error_behind(1, speed, t)),
        f"{ramp}_position_error_deg_Kvf1": _at(_RAMP_S, lambda t: total.error_behind(1, speed, t)),
        f"{ramp}_speed_error_deg_s_Kvf1": _at(_RAMP_S, lambda t: total.error_behind(0, speed, t)),
        f"{parabola}_speed_error_deg_s_Kvf1": _at(_RAMP_S, lambda t: total.error_behind(1, acc, t)),
        f"{parabola}_position_error_deg_Kvf1": _at(_RAMP_S, lambda t: total.error_behind(2, acc, t)),
        f"{parabola}_position_error_deg_Kvf0": _at(_RAMP_S, lambda t: total0.error_behind(2, acc, t)),
        "speed_error_peak_at_acc_corner_deg_s": total.largest_error_behind(1, acc)[1],
        "speed_error_peak_at_acc_reversal_deg_s": total.largest_error_behind(1, 2.0 * acc)[1],
        "position_error_peak_at_acc_corner_deg": total.largest_error_behind(2, acc)[1],
        "speed_error_const_Kvf0_deg_s": total0.steady_speed_error(acc),
        "jerk_j_position_error_deg_per_unit_jerk": total.jerk_error_per_jerk,
    }


def _torque_figures(machine: Machine, total: RigidLoop) -> dict[str, Any]:
    return {
        f"torque_step_{TORQUE_STEP_NM:g}Nm_motor_angle_rad": _at(
            _TORQUE_S, lambda t: total.torque_step(TORQUE_STEP_NM, t)
        ),
        "torque_step_peak_gantry_deg_per_Nm": math.degrees(total.torque_step_peak_rad_per_nm())
        / machine.axis.ratio,
        "torque_ramp_1Nm_s_steady_motor_angle_rad": total.torque_ramp_error_rad_per_nm_s,
    }


def two_mass_figures(machine: Machine) -> dict[str, Any]:
    """Every figure of the two-mass sketch, and how the load mode depends on Kpp and on the stiffness."""

    def loop(
        k: float = SKETCH_STIFFNESS_NM_PER_RAD, zeta: float = SKETCH_DAMPING_RATIO, kpp: float | None = None
    ) -> TwoMassLoop:
        return two_mass_loop(machine, k, zeta, kpp)

    sketch = loop()
    return {
        "definition": (
            f"J={sketch.plant.load_inertia_kg_m2:g}, Jm={sketch.plant.motor_inertia_kg_m2:g} (no wave "
            f"generator), k={SKETCH_STIFFNESS_NM_PER_RAD:g} N m/rad, zeta={SKETCH_DAMPING_RATIO:g}, no base, "
            "no friction, ideal torque, continuous"
        ),
        "c_Nms_rad": sketch.plant.damping_nm_s_per_rad,
        "f_antiresonance_Hz": sketch.plant.antiresonance_hz,
        "f_resonance_Hz": sketch.plant.resonance_hz,
        "closed_loop_poles": pairs(sketch.poles),
        "load_mode_Hz": sketch.load_mode_hz,
        "load_mode_zeta": sketch.load_mode_zeta,
        "max_real_part_k1e9_zeta0.01": loop(1e9, 0.01).max_real_part,
        "load_mode_zeta_vs_Kpp_k5e8_z0.025": {
            f"{kpp}": loop(kpp=float(kpp)).load_mode_zeta for kpp in _KPP_SWEEP
        },
        "load_mode_zeta_vs_k_paper_gains": {
            f"{k:.0e}": {f"{zeta:g}": loop(k, zeta).load_mode_zeta for zeta in _ZETA_SWEEP} for k in _K_SWEEP
        },
        "locked_motor_gravity_windup_deg_per_10kNm_k5e8": sketch.plant.windup_deg(1e4),
    }


def pairs(roots: ComplexArray) -> list[list[float]]:
    """Complex numbers as [real, imaginary]."""
    return [[root.real, root.imag] for root in roots.tolist()]


def _margin(cut: TransferFunction) -> PhaseMargin:
    """Phase margin of a loop with an integrator: its gain always passes 1."""
    margin = cut.phase_margin()
    assert margin is not None
    return margin


def _at(times_s: Sequence[float], response: Callable[[list[float]], FloatArray]) -> dict[str, float]:
    values = response(list(times_s)).tolist()
    return {f"{t:.3f}": value for t, value in zip(times_s, values, strict=True)}
