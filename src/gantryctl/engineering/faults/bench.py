"""An axis in virtual time, brought into a phase, with the true plant watched every millisecond."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from gantryctl._core import GantrySim
from gantryctl.drives.simulated import SimDrive
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.group import Neighbours
from gantryctl.engineering.faults.case import Phase
from gantryctl.engineering.faults.inject import inject
from gantryctl.engineering.faults.injection import Injection
from gantryctl.engineering.faults.target import StallingClock, Target
from gantryctl.errors import UsageError
from gantryctl.image import DriveState, Mode
from gantryctl.machine import Machine
from gantryctl.machine.places import reach_deg
from gantryctl.ports import Drive
from gantryctl.program import AxisState, GantryProgram, PowerPhase
from gantryctl.runtime import Engine, FixedOperator, OverrunPolicy
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_program
from gantryctl.wiring.simulator import sim_drive

BrakeOwner = Literal["drive", "object_60FE", "controller_output"]
SAMPLE_S: Final = 1e-3
# Gentle enough to leave the load calm, short enough to be computed in some tenths of a second.
_RAMP_UP_S: Final = 6.0
_CRUISE_S: Final = 1.5
_POWER_S: Final = 12.0
_CALM_S: Final = 1.0
# Quick stop and brake test are well under way this long after they began.
_UNDER_WAY_S: Final = 0.05
# Before the end of travel, at most.
_TARGET_BEFORE_END_DEG: Final = 10.0

COLUMNS: Final = (
    "time_s", "pos_deg", "vel_deg_s", "pos_load_deg", "vel_load_deg_s", "torque_nm", "brake_closed", "told_deg",
    "told_deg_s", "valid", "enabled", "ref_deg_s",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class FaultLog:
    """One row each millisecond, from a little before the fault on; angles at the gantry, true motor side.

    `ref_deg_s` is the speed that the program asks of the axis; NaN where it does not move it.
    """

    table: NDArray[np.float64]

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        column: NDArray[np.float64] = self.table[:, COLUMNS.index(name)]
        return column


def bench_machine(machine: Machine, speed_deg_s: float) -> dict[str, float]:
    """Values by which a machine comes to a speed in some seconds."""
    axis = machine.virtual_axis
    # A normal stop is no harder than that of a key that is let go.
    ramp = min(abs(speed_deg_s) / _RAMP_UP_S, axis.jog_release_dec_deg_s2)
    return {
        "virtual_axis.acc_deg_s2": max(axis.acc_deg_s2, ramp),
        "virtual_axis.dec_deg_s2": max(axis.dec_deg_s2, ramp),
    }


def way_to_cruise_deg(machine: Machine, speed_deg_s: float) -> float:
    """Way of ramp and calm cruise before the place of a fault, with its sign."""
    speed = abs(speed_deg_s)
    ramp = speed * speed / (2.0 * machine.virtual_axis.acc_deg_s2)
    return math.copysign(ramp + speed * _CRUISE_S, speed_deg_s)


def _simulated(machine: Machine, angle_deg: float) -> tuple[Drive, SimDrive | DriveNode, Neighbours]:
    """Drive of a machine, the simulated device in it, and the nodes beside that."""
    if not machine.on_bus:
        device = sim_drive(machine, angle_deg)
        return device, device, Neighbours()
    # A drive in process is not on a bus, and a run without one loads none.
    from gantryctl.drives.canopen.drive import CanopenDrive
    from gantryctl.wiring.canopen import canopen_settings
    from gantryctl.wiring.virtual import virtual_bus

    link, node, neighbours = virtual_bus(machine, angle_deg)
    return CanopenDrive(link, canopen_settings(machine), node).open(), node, neighbours


class FaultBench:
    """Axis that is brought into a phase, gets its faults, and is watched.

    Args:
        machine: as it runs.
        phase: where the axis is to be.
        speed_deg_s: of phases in motion, with its sign.
        angle_deg: where the axis is when the phase is reached.

    Raises:
        UsageError: the motion does not fit into the travel.
    """

    def __init__(self, machine: Machine, phase: Phase, speed_deg_s: float, angle_deg: float) -> None:
        self.machine, self._phase = machine, phase
        self._speed, self._angle = speed_deg_s, angle_deg
        ratio = machine.axis.ratio
        self._per_rad = math.degrees(1.0) / ratio
        start = angle_deg - self._way_to_cruise() if phase.moves else angle_deg
        low, high = reach_deg(machine)
        if not low <= start <= high:
            dial = machine.axis.dial
            raise UsageError(
                f"to be at {dial.text(angle_deg)} deg with {speed_deg_s:g} deg/s the axis would start at "
                f"{dial.text(start, '.1f')} deg, the travel is {dial.span(low, high)} deg"
            )
        if machine.drive.kind != "sim" and not (machine.on_bus and machine.can.simulated):
            raise UsageError(
                f'{machine.name}: faults are injected into a simulated drive ([drive] kind = "sim", or "canopen" with '
                '[can] interface = "simulated")'
            )
        drive, device, neighbours = _simulated(machine, start)
        program = build_program(machine, drive)
        assert isinstance(program, GantryProgram)
        self.program, self.axis = program, program.axis
        period_s = self.axis.settings.period_s
        clock, operator = StallingClock(period_s), FixedOperator()
        engine = Engine(drive, program, operator, clock, period_s, overrun_policy=OverrunPolicy.QUICK_STOP)
        self.target = Target(machine, device, engine, operator, clock, neighbours)
        clock.goes_on = self.target.go_on
        self.engine, self.device = engine, device
        self._rows: list[tuple[float, ...]] = []
        self._told: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
        self._recording = False
        self._pending: list[Injection] = []
        self._ends: list[tuple[float, Callable[[], None]]] = []
        self.injected: Callable[[Injection], None] = lambda injection: None
        """Told of each injection just before it acts."""
        self.onset_s: float | None = None
        """Time of the first injection."""
        self.enables = 0
        """Times at which the drive was enabled after the first alarm that stopped the axis."""
        self._was_enabled = False
        self.offset_deg = 0.0
        """Told minus true angle of the sound axis: the zero of its encoder."""
        if isinstance(device, DriveNode):
            device.plant.watch = self._tick
        else:
            device.sample_every(SAMPLE_S)

    def close(self) -> None:
        """Leave the bus."""
        if isinstance(self.device, DriveNode):
            # A drive in process is not on a bus, and a run without one loads none.
            from gantryctl.drives.canopen.drive import CanopenDrive

            drive = self.engine.drive
            assert isinstance(drive, CanopenDrive)
            drive.link.close()

    # --- time ----------------------------------------------------------------------------------------------------

    @property
    def time_s(self) -> float:
        """Virtual time, s."""
        return self.engine.time_s

    def step(self) -> None:
        """One scan, or one period without a controller."""
        target, engine = self.target, self.engine
        if self._pending or self._ends:
            self._inject_what_is_due()
        if target.repeated:
            for act in list(target.repeated.values()):
                act()
        if target.silent:
            target.go_on(1)
            engine.scan += 1
        else:
            engine.step()
            # Acknowledged, as by the reset of a service (`service.controller.process`).
            if engine.system_stop is not None and self.axis.system_stop is None:
                engine.system_stop = None
        self._look()

    def until(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Scan until a condition holds; False when the time is over before."""
        end_s = self.time_s + timeout_s
        while not condition():
            if self.time_s >= end_s:
                return False
            self.step()
        return True

    def run_for(self, seconds: float) -> None:
        """Scan for a time."""
        self.until(lambda: False, seconds)

    # --- what is true --------------------------------------------------------------------------------------------

    def _truth(self) -> tuple[float, ...]:
        device = self.device
        return device.truth()

    @property
    def pos_deg(self) -> float:
        """True angle of the motor, at the gantry."""
        return self._truth()[2] * self._per_rad

    @property
    def vel_deg_s(self) -> float:
        """True speed of the motor, at the gantry."""
        return self._truth()[3] * self._per_rad

    @property
    def vel_load_deg_s(self) -> float:
        """True speed of the load."""
        return deg(self._truth()[1])

    @property
    def enabled(self) -> bool:
        """The drive is truly enabled."""
        device = self.device
        if isinstance(device, DriveNode):
            return device.axis.state is State.ENABLED
        return device.state is DriveState.OPERATION_ENABLED

    @property
    def brake_closed(self) -> bool:
        """The brake is truly closed."""
        return self._sim.state["brake_closed"] != 0.0

    @property
    def torque_nm(self) -> float:
        """True torque of the motor."""
        return float(self._sim.feedback(1.0)[2])

    @property
    def _sim(self) -> GantrySim:
        device = self.device
        return device.plant.sim if isinstance(device, DriveNode) else device.sim

    def _look(self) -> None:
        """After each scan: what is told, enables, samples of the simulated drive."""
        axis = self.axis
        enabled = self.enabled
        if enabled and not self._was_enabled and axis.alarms.first_out is not None:
            self.enables += 1
        self._was_enabled = enabled
        if not self._recording:
            return
        self._told = self._told_now()
        device = self.device
        if isinstance(device, SimDrive):
            begin_s, per = self.time_s - self.axis.settings.period_s, self._per_rad
            rows = device.sim.samples_taken()
            for number, (pos, vel, load, vel_load, torque, closed) in enumerate(rows, start=1):
                self._rows.append(
                    (
                        begin_s + number * SAMPLE_S, pos * per, vel * per, deg(load), deg(vel_load), torque,
                        float(closed), *self._told,
                    )
                )  # fmt: skip

    def _told_now(self) -> tuple[float, ...]:
        feedback = self.axis.feedback
        valid, enabled = float(feedback.position_valid), float(self._was_enabled)
        axis = self.axis
        ref_deg_s = deg(axis.virtual.vel_ref_rad_s) if axis.power.phase is PowerPhase.ON else math.nan
        return deg(axis.pos_act_rad), deg(feedback.vel_rad_s), valid, enabled, ref_deg_s

    def _tick(self) -> None:
        """After each tick of the virtual drive."""
        if not self._recording:
            return
        device = self.device
        assert isinstance(device, DriveNode)
        plant, per = device.plant, self._per_rad
        load, vel_load, pos, vel, *_ = plant.sim.truth()
        self._rows.append(
            (
                self._tick_s, pos * per, vel * per, deg(load), deg(vel_load), plant.torque_nm,
                float(not plant.brake_open), *self._told,
            )
        )  # fmt: skip
        self._tick_s += SAMPLE_S

    def record(self) -> None:
        """Keep a row of every millisecond from now on."""
        if not self._recording:
            self._recording, self._tick_s, self._told = True, self.time_s, self._told_now()

    def log(self) -> FaultLog:
        """What was recorded."""
        return FaultLog(np.array(self._rows, dtype=np.float64).reshape(-1, len(COLUMNS)))

    # --- faults --------------------------------------------------------------------------------------------------

    def inject(self, injections: tuple[Injection, ...]) -> None:
        """Arm injections; their time counts from now."""
        self._armed_s, self._pending = self.time_s, list(injections)
        self._last_deg = self.pos_deg
        self._phase_before = self.axis.power.phase
        self._wait()

    def _wait(self) -> None:
        """Until when nothing can be due: the first of those that come by the clock alone."""
        clocked = all(each.when.by_clock for each in self._pending)
        first_s = min((each.when.after_s or 0.0 for each in self._pending), default=math.inf)
        self._nothing_before_s = first_s if clocked else -math.inf

    def _inject_what_is_due(self) -> None:
        if self._pending and self.time_s - self._armed_s >= self._nothing_before_s - 1e-9:
            due = [each for each in self._pending if self._is_due(each)]
            self._pending = [each for each in self._pending if each not in due]
            self._last_deg, self._phase_before = self.pos_deg, self.axis.power.phase
            if due:
                self._wait()
            for each in due:
                if self.onset_s is None:
                    self.onset_s = self.time_s
                self.injected(each)
                end = inject(self.target, each)
                if each.for_s is not None and end is not None:
                    self._ends.append((self.time_s + each.for_s, end))
        if self._ends:
            for at_s, end in [row for row in self._ends if row[0] <= self.time_s + 1e-9]:
                self._ends.remove((at_s, end))
                end()

    def _is_due(self, each: Injection) -> bool:
        when = each.when
        if when.angle_deg is not None:
            low, high = sorted((self._last_deg, self.pos_deg))
            return low <= when.angle_deg <= high
        if when.state is not None:
            return self.axis.power.phase.name == when.state and self._phase_before.name != when.state
        if when.event is not None:
            return any(code.value == when.event for code in self.axis.alarms.active)
        return self.time_s - self._armed_s >= (when.after_s or 0.0) - 1e-9

    # --- phases --------------------------------------------------------------------------------------------------

    def _way_to_cruise(self) -> float:
        """Way of ramp and calm cruise before the angle, with its sign."""
        if self._phase is not Phase.ACCELERATION:
            return way_to_cruise_deg(self.machine, self._speed)
        # Half of the speed is reached after a quarter of the ramp.
        return 0.25 * self._speed * abs(self._speed) / (2.0 * self.machine.virtual_axis.acc_deg_s2)

    def command(self, **levels: Any) -> None:
        """Set levels of the operator."""
        operator = self.target.operator
        operator.command = operator.command._replace(**levels)

    def power_on(self) -> None:
        """Ask for power."""
        self.command(power=True, mode=Mode.CONTINUOUS, speed_rad_s=rad(abs(self._speed) or 1.0))

    def move(self) -> None:
        """Ask for a long move in the direction of the speed."""
        speed = self._speed or 1.0
        low, high = reach_deg(self.machine)
        spare = min(_TARGET_BEFORE_END_DEG, 0.05 * (high - low))
        end = high - spare if speed > 0.0 else low + spare
        self.command(move=True, target_rad=rad(end), speed_rad_s=rad(abs(speed)))

    def reach(self) -> None:
        """Bring the sound axis into its phase.

        Raises:
            UsageError: it does not come there, with the reason.
        """
        self.run_for(0.1)
        # At rest: in motion the reading of a scan is one period older than the truth after it.
        self.offset_deg = deg(self.axis.pos_act_rad) - self.pos_deg
        phase = self._phase
        if phase in (Phase.OFF, Phase.POWER_UP):
            return
        if phase is Phase.BRAKE_TEST:
            self.command(brake_test=True)
            self._reached(self.until(lambda: self.axis.power.phase is PowerPhase.TESTING, _POWER_S))
            self.run_for(_UNDER_WAY_S)
            return
        self.power_on()
        self._reached(self.until(lambda: self.axis.power.phase is PowerPhase.ON, _POWER_S))
        self.run_for(_CALM_S)
        if phase is Phase.HOLD:
            self._hold()
        elif phase.moves:
            self._get_going()

    def _hold(self) -> None:
        """A brake that does not hold at power-off leaves the load held by torque."""
        self.target.faults.brake_torque_share = 0.0
        self.command(power=False)
        self._reached(self.until(lambda: self.axis.power.phase is PowerPhase.TORQUE_HOLD, _POWER_S))
        self.run_for(_CALM_S)

    def _get_going(self) -> None:
        phase, speed = self._phase, abs(self._speed)
        self.move()
        half = phase is Phase.ACCELERATION
        wanted = 0.5 * speed if half else 0.999 * speed
        ref = self.axis.virtual
        self._reached(self.until(lambda: abs(deg(ref.vel_ref_rad_s)) >= wanted, 4.0 * _RAMP_UP_S + 30.0))
        self.record()
        if half:
            return
        sign = math.copysign(1.0, self._speed)
        # What is left of the way to the angle; the sound motor follows the set-point to some hundredths of a degree.
        self._reached(self.until(lambda: sign * (self._angle - self.pos_deg) <= 0.0, 4.0 * _CRUISE_S + 5.0))
        if phase is Phase.DECELERATION:
            self.command(halt=True)
            self.until(lambda: abs(deg(ref.vel_ref_rad_s)) <= 0.5 * speed, 4.0 * _RAMP_UP_S)
        elif phase is Phase.QUICK_STOP:
            self.command(quick_stop=True)
            self.until(lambda: self.axis.power.phase is PowerPhase.QUICK_STOPPING, 1.0)
            self.run_for(_UNDER_WAY_S)

    def _reached(self, there: bool) -> None:
        if there and (self.axis.alarms.first_out is None or self._phase in (Phase.HOLD, Phase.QUICK_STOP)):
            return
        first = self.axis.alarms.first_out
        refused = self.axis.refusal
        why = (
            first.text if first is not None else refused.text if refused is not None else "no reason was told"
        )
        raise UsageError(f"the sound axis does not come into the phase '{self._phase.value}': {why}")

    def go_on(self) -> None:
        """What the operator does after the injection has been armed."""
        if self._phase is Phase.POWER_UP:
            self.power_on()
        elif self._phase is Phase.FIRST_MOVE:
            self.move()

    @property
    def settled(self) -> bool:
        """Nothing is under way any more: power off, or held, and the motor stands."""
        return (
            self.axis.state in (AxisState.ERROR_STOP, AxisState.DISABLED)
            and self.axis.power.phase in (PowerPhase.OFF, PowerPhase.TORQUE_HOLD)
            and abs(self.vel_deg_s) < 0.01
        )
