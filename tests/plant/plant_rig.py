"""The shipped program on the simulated gantry, in virtual time, with faults and the true motor angle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import pytest

from gantryctl._core import GantrySim
from gantryctl.engineering.faults.inject import inject
from gantryctl.engineering.faults.injection import injection
from gantryctl.engineering.faults.kinds.kind import Value
from gantryctl.image import DriveFeedback, OutputImage
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.program import GantryProgram, PowerPhase
from gantryctl.program.alarms.log import Alarm
from gantryctl.runtime import Engine, FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine, build_program
from gantryctl.wiring.simulator import sim_drive
from support.fault_rows import target_of

SCANS_MS = (1.0, 4.0, 10.0)
AT_EVERY_SCAN_MS = pytest.mark.parametrize("scan_ms", [1.0, pytest.param(4.0, marks=pytest.mark.slow), 10.0])
"""The shortest and the longest find what a monitor counts in scans; the one between them is in the slow set."""
_SOME = 7
NOMINAL_NM, CHECK_NM = 16_000.0, 50_000.0
# From the onset of a feedback fault to rest, motor side, at 6, 3 and 1 deg/s.
FEEDBACK_LIMIT_DEG = {6.0: 4.5, 3.0: 2.1, 1.0: 0.8}
CYCLES_PER_MS = 8
# A ramp that reaches 6 deg/s within 3 s, as on the bus; what is judged begins in cruise.
_FAST = {"virtual_axis.acc_deg_s2": 2.0, "virtual_axis.dec_deg_s2": 2.0}


def at_scans(*whole_ms: float, **values: Sequence[Any]) -> pytest.MarkDecorator:
    """All of these values with each other at the periods `whole_ms`, and some of them at 1 ms; the others are slow.

    A run at 1 ms costs four to ten times as much as one at 10 ms. Every seventh is run, and the last: seven has no
    factor in common with two, three and four values, so all of each have their turn.
    """
    rows = list(product(*values.values()))
    some = {*range(0, len(rows), _SOME), len(rows) - 1}
    return pytest.mark.parametrize(
        (*values, "scan_ms"),
        [
            pytest.param(*row, scan_ms, marks=() if brief else pytest.mark.slow)
            for scan_ms in sorted({*SCANS_MS, *whole_ms})
            for number, row in enumerate(rows)
            for brief in [scan_ms in whole_ms or (scan_ms == min(SCANS_MS) and number in some)]
        ],
    )


def machine_at(scan_ms: float, moment_nm: float = NOMINAL_NM, **changes: object) -> Machine:
    """The reference machine with another scan period and another eccentric moment."""
    load = default_machine().plant.load
    values: dict[str, object] = {
        "control.scan_period_ms": scan_ms,
        "plant.load.eccentricity_m": moment_nm / (load.mass_kg * 9.81),
        **_FAST,
    }
    return with_values(default_machine(), values | changes)


class PlantRig:
    """Engine, program and plant of one run; `faults` are those of the simulated drive, `spoil` changes what is read.

    Args:
        machine: from `machine_at`.
        angle_deg: where the load stands, brake closed.
        holding_nm: learned holding torque of an earlier run.
    """

    def __init__(self, machine: Machine, angle_deg: float = 90.0, *, holding_nm: float = 0.0) -> None:
        self.machine = machine
        self.drive = sim_drive(machine, angle_deg)
        self.faults = self.drive.faults
        program = build_program(machine, self.drive, holding_torque_nm=holding_nm)
        assert isinstance(program, GantryProgram)
        self.engine: Engine = build_engine(machine, self.drive, program)
        self.axis = program.axis
        self.ratio = machine.axis.ratio
        self.outputs: list[OutputImage] = []
        self.spoil: Callable[[DriveFeedback], DriveFeedback] | None = None
        read = self.drive.read
        self.drive.read = lambda: read() if self.spoil is None else self.spoil(read())
        self._target = target_of(machine, self.drive, self.engine)
        self.onset_deg = 0.0
        self.reach_deg = 0.0
        self.torque_most_nm = self.brake_work_j = 0.0
        self.mark()

    @property
    def sim(self) -> GantrySim:
        """The compiled plant; a fault of brake or torque limit puts another one in its place."""
        return self.drive.sim

    @property
    def op(self) -> FixedOperator:
        assert isinstance(self.engine.operator, FixedOperator)
        return self.engine.operator

    @property
    def motor_deg(self) -> float:
        """True angle of the motor, at the gantry."""
        return deg(self.sim.truth()[2]) / self.ratio

    @property
    def motor_deg_s(self) -> float:
        return deg(self.sim.truth()[3]) / self.ratio

    @property
    def phase(self) -> PowerPhase:
        return self.axis.power.phase

    @property
    def codes(self) -> list[str]:
        return [str(code) for code in self.axis.alarms.active]

    @property
    def first(self) -> str:
        first = self.axis.alarms.first_out
        return "" if first is None else str(first.code)

    @property
    def first_alarm(self) -> Alarm | None:
        return self.axis.alarms.first_out

    @property
    def texts(self) -> list[str]:
        return [alarm.text for alarm in self.axis.alarms.history]

    @property
    def period_s(self) -> float:
        return self.axis.settings.period_s

    @property
    def feedback(self) -> DriveFeedback:
        return self.drive.read()

    def inject(self, where: str, kind: str, /, **args: Value) -> None:
        """Let a fault act, and tell it the oracle."""
        inject(self._target, injection(where, kind, **args))

    def mark(self) -> None:
        """The onset of a fault: `reach_deg`, `torque_most_nm` and `brake_work_j` count from here."""
        self.onset_deg = self.motor_deg
        self.reach_deg = self.torque_most_nm = self.brake_work_j = 0.0

    def step(self) -> None:
        self.sim.sample_every(CYCLES_PER_MS)
        self.engine.step()
        for motor_rad, vel_rad_s, _, _, torque_nm, closed in self.sim.samples_taken():
            if closed:
                self.brake_work_j += abs(vel_rad_s) * self.machine.brake.torque_nm * 1e-3
            self.reach_deg = max(self.reach_deg, abs(deg(motor_rad) / self.ratio - self.onset_deg))
            self.torque_most_nm = max(self.torque_most_nm, abs(torque_nm))

    def run(self, seconds: float) -> None:
        for _ in range(math.ceil(seconds / self.engine.program.axis.settings.period_s - 1e-9)):
            self.step()

    def until(self, condition, timeout_s: float = 30.0) -> None:
        for _ in range(math.ceil(timeout_s / self.axis.settings.period_s)):
            if condition():
                return
            self.step()
        raise AssertionError(f"not within {timeout_s} s: {self.phase}, {self.codes}")

    def say(self, **levels: object) -> None:
        """Change the operator's levels and make one scan."""
        self.op.command = self.op.command._replace(**levels)
        self.step()

    def power_up(self, settle_s: float = 1.0) -> None:
        self.say(power=True)
        self.until(lambda: self.phase is PowerPhase.ON, 5.0)
        self.run(settle_s)

    def cruise_to(self, at_deg: float, speed_deg_s: float, sign: float) -> None:
        """Begin a move that passes `at_deg` at full speed, and run until it does."""
        target = at_deg + sign * 60.0
        self.say(move=True, target_rad=rad(target), speed_rad_s=rad(speed_deg_s))
        self.say(move=False)
        self.until(lambda: (self.motor_deg - at_deg) * sign >= 0.0, 120.0)

    def cruise(self, speed_deg_s: float, sign: float = 1.0) -> None:
        """Switch on and be in the middle of a long move at constant speed."""
        self.power_up(0.5)
        here = deg(self.axis.pos_act_rad)
        self.say(move=True, target_rad=rad(here + sign * 100.0), speed_rad_s=rad(speed_deg_s))
        self.say(move=False)
        self.run(speed_deg_s / self.machine.virtual_axis.acc_deg_s2 + 0.5)
        assert abs(self.motor_deg_s - sign * speed_deg_s) < 0.1

    def way_to_rest(self, timeout_s: float = 6.0) -> float:
        """Largest way of the motor from now on, until it has stood for 0.3 s with power off; inf if it never does."""
        self.mark()
        still = 0.0
        for _ in range(math.ceil(timeout_s / self.period_s)):
            self.step()
            still = still + self.period_s if abs(self.motor_deg_s) < 0.01 else 0.0
            if still > 0.3 and self.phase is PowerPhase.OFF:
                return self.reach_deg
        return math.inf

    def rest(self, timeout_s: float = 6.0) -> None:
        """Until the shaft has stood for 0.5 s."""
        still = 0.0
        for _ in range(math.ceil(timeout_s / self.axis.settings.period_s)):
            self.step()
            still = still + self.axis.settings.period_s if abs(self.motor_deg_s) < 0.01 else 0.0
            if still > 0.5:
                return
        raise AssertionError(f"still moving: {self.motor_deg_s} deg/s")
