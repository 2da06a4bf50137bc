"""An axis on the simulated drive and plant, judged by the true angle of the motor."""

from __future__ import annotations

import math
from collections.abc import Callable

from gantryctl.drives.simulated import SimDrive
from gantryctl.image import DriveFeedback
from gantryctl.machine import default_machine, with_values
from gantryctl.program import GantryProgram, PowerPhase
from gantryctl.runtime import FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine, build_program
from gantryctl.wiring.simulator import sim_drive

# Angles from the onset of a feedback fault to rest, deg, at 6, 3 and 1 deg/s.
FEEDBACK_LIMIT_DEG = {6.0: 4.5, 3.0: 2.1, 1.0: 0.8}
STANDSTILL_LIMIT_DEG = 0.35
NOMINAL_NM, CHECK_NM = 16_000.0, 50_000.0
# Slower than this the motor is at rest.
_REST_DEG_S = 0.01


class PlantRig:
    """Power, moves and faults on the reference machine; `spoil` changes what the controller reads.

    Args:
        at_deg: where the gantry stands; 90 deg is the angle of the largest moment.
        scan_ms: scan period.
        moment_nm: eccentric moment.
        learned_nm: holding torque of an earlier run.
    """

    def __init__(
        self,
        at_deg: float = 90.0,
        scan_ms: float = 1.0,
        moment_nm: float = NOMINAL_NM,
        learned_nm: float = 0.0,
    ) -> None:
        base = default_machine()
        moment = base.plant.load.mass_kg * 9.81
        self.machine = with_values(
            base, {"control.scan_period_ms": scan_ms, "plant.load.eccentricity_m": moment_nm / moment}
        )
        self.drive: SimDrive = sim_drive(self.machine, at_deg)
        self.sim = self.drive.sim
        program = build_program(self.machine, self.drive, holding_torque_nm=learned_nm)
        assert isinstance(program, GantryProgram)
        self.program, self.axis = program, program.axis
        self.operator = FixedOperator()
        self.engine = build_engine(self.machine, self.drive, program, self.operator)
        self.period_s = scan_ms * 1e-3
        self.spoil: Callable[[DriveFeedback], DriveFeedback] | None = None
        read = self.drive.read
        self.drive.read = lambda: read() if self.spoil is None else self.spoil(read())

    @property
    def true_deg(self) -> float:
        """True angle of the motor, at the gantry."""
        return deg(self.sim.state["pos_motor"]) / self.axis.settings.law.ratio

    @property
    def true_deg_s(self) -> float:
        """True speed of the motor, at the gantry."""
        return deg(self.sim.state["vel_motor"]) / self.axis.settings.law.ratio

    def op(self, **levels: object) -> None:
        """Change the operator's levels and make one scan."""
        self.operator.command = self.operator.command._replace(**levels)
        self.engine.step()

    def run(self, seconds: float) -> None:
        """Let time pass."""
        for _ in range(math.ceil(seconds / self.period_s - 1e-9)):
            self.engine.step()

    def until(self, condition: Callable[[], object], timeout_s: float) -> None:
        """Let time pass until the condition holds."""
        for _ in range(math.ceil(timeout_s / self.period_s)):
            if condition():
                return
            self.engine.step()
        raise AssertionError(f"not within {timeout_s} s: {self.axis.power.phase}, {self.texts}")

    def power_up(self, settle_s: float = 0.5) -> None:
        """Switch on and let the axis come into position."""
        self.op(power=True)
        self.until(lambda: self.axis.power.phase is PowerPhase.ON, 5.0)
        self.run(settle_s)
        assert self.first is None, self.texts

    def cruise(self, speed_deg_s: float, direction: float = 1.0) -> None:
        """Be in the middle of a long move at constant speed."""
        self.power_up(0.3)
        here = deg(self.axis.pos_act_rad)
        self.op(move=True, target_rad=rad(here + direction * 100.0), speed_rad_s=rad(speed_deg_s))
        self.op(move=False)
        self.run(speed_deg_s / 0.39 + 0.5)
        assert abs(self.true_deg_s - direction * speed_deg_s) < 0.1

    def way_to_rest(self, timeout_s: float = 6.0) -> float:
        """Largest true way of the motor from now on, until it has stood for 0.3 s; inf if it never does."""
        start, way, still = self.true_deg, 0.0, 0.0
        for _ in range(math.ceil(timeout_s / self.period_s)):
            self.engine.step()
            way = max(way, abs(self.true_deg - start))
            still = still + self.period_s if abs(self.true_deg_s) < _REST_DEG_S else 0.0
            if still > 0.3 and self.axis.power.phase is PowerPhase.OFF:
                return way
        return math.inf

    @property
    def first(self):
        return self.axis.alarms.first_out

    @property
    def texts(self) -> list[str]:
        return [alarm.text for alarm in self.axis.alarms.history]
