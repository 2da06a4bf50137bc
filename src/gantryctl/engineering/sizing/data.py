"""A sizing as plain data for JSON; the figures of the tables, unrounded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gantryctl.engineering.sizing import equations as eq
from gantryctl.engineering.sizing.chain import machine_values
from gantryctl.engineering.sizing.checks import Fit, usable_torque_nm, wrap_margin_deg
from gantryctl.engineering.sizing.loading import is_reference_sheet
from gantryctl.engineering.sizing.paper_figures import paper_figures
from gantryctl.engineering.sizing.train import over_angle
from gantryctl.machine.tables.drive import SpeedLoopTable
from gantryctl.units import deg


def sizing_data(shown: Fit, fits: Sequence[Fit], loop: SpeedLoopTable | None) -> dict[str, Any]:
    """Everything `size --json` prints.

    Args:
        shown: the motor of the complete figures. fits: all motors. loop: the drive's speed loop; None where no
            machine follows.
    """
    sheet = shown.train.sheet
    return {
        "sheet": sheet.sheet.name,
        "motor": shown.motor.name,
        "figures": _figures(shown, loop),
        "complete": _complete(shown),
        "over_angle": [row._asdict() for row in over_angle(shown.train)],
        "duty": shown.duty._asdict(),
        "motors": [_motor(fitted) for fitted in fits],
        "machine_values": machine_values(sheet, shown.motor),
    }


def _figures(shown: Fit, loop: SpeedLoopTable | None) -> dict[str, float]:
    """Equations (1) to (3) and the encoder: under the names of the paper's figures for the reference sheet."""
    sheet, motor = shown.train.sheet, shown.motor
    if is_reference_sheet(sheet) and loop is not None:
        return paper_figures(sheet, motor, loop)
    ratio, inertia = sheet.gears.ratio, sheet.load.inertia_kg_m2
    speed = eq.motor_speed_r_min(sheet.motion.speed_max_r_min, ratio)
    torque = eq.motor_torque_nm(inertia, shown.train.sizing_acc_rad_s2, ratio)
    return {
        "ratio": ratio,
        "motor_speed_r_min": speed,
        "acc_rad_s2": shown.train.sizing_acc_rad_s2,
        "torque_load_alone_nm": torque,
        "power_load_alone_kw": eq.power_kw(torque, speed),
        "inertia_load_at_motor_kg_m2": eq.reflected_inertia_kg_m2(inertia, ratio),
        "encoder_step_deg": eq.encoder_step_deg(motor.encoder.counts_per_turn, ratio),
        "encoder_range_turns": eq.encoder_range_turns(motor.encoder.turns, ratio),
    }


def _complete(fitted: Fit) -> dict[str, Any]:
    train = fitted.train
    cases = {"sizing": train.sizing_acc_rad_s2, "normal": train.normal_acc_rad_s2}
    return {
        **{
            name: {
                "acc_deg_s2": deg(acc),
                "parts_nm": {part.name: part.torque_nm for part in train.parts(acc)},
                "torque_nm": train.largest_nm(acc),
                "efficiency": train.efficiency(acc),
                "torque_reducer_nm": train.reducer_nm(acc),
                "torque_reducer_swinging_nm": train.reducer_nm(acc, 2.0),
            }
            for name, acc in cases.items()
        },
        "torque_usable_nm": usable_torque_nm(train.sheet, fitted.motor),
        "quick_dec_deg_s2": deg(train.quick_dec_rad_s2),
        "quick_stop_nm": train.quick_stop_nm,
        "hold_nm": train.hold_nm,
        "wrap_margin_deg": wrap_margin_deg(train.sheet, fitted.motor),
        "kinetic_energy_j": train.kinetic_energy_j,
        "braking_power_w": train.braking_power_w,
    }


def _motor(fitted: Fit) -> dict[str, Any]:
    return {
        "name": fitted.motor.name,
        "source": fitted.motor.identity.source,
        "fits": fitted.fits,
        "reasons": fitted.reasons,
        "checks": [check._asdict() | {"fits": check.fits} for check in fitted.checks],
    }
