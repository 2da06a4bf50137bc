"""The reference machine with everything switched off that the rigid job has not, and closed loops standing at 0 deg."""

from __future__ import annotations

from typing import Final

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import drive_params, plant_params

_EFFECTS: Final = (
    "gear_error", "backlash", "hysteresis", "roller_friction", "motor_friction", "base", "torque_ripple",
    "three_slopes",
)  # fmt: skip


def rigid_machine() -> Machine:
    """Rigid with eccentric moment, ideal encoder and current, no friction, no delay."""
    changes: dict[str, object] = {f"plant.switches.{name}": False for name in _EFFECTS}
    changes |= {
        "plant.switches.rigid": True,
        "drive.speed_loop.feedback": "ideal",
        "drive.speed_loop.delay_cycles": 0,
        "drive.current_loop.ideal": True,
        "plant.encoder.latency_us": 0.0,
    }
    return with_values(default_machine(), changes)


def standing(machine: Machine, scheme: str = "one_evaluation", steps: int = 2) -> ClosedLoop:
    """Servo on at 0 deg."""
    period_s = machine.control.scan_period_ms * 1e-3
    sim = _core.GantrySim(plant_params(machine), drive_params(machine), period_s, scheme, steps)
    return ClosedLoop.standing_at(sim, position_law(machine), 0.0)
