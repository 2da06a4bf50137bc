"""The scan engine with the shipped program and the compiled closed loop give the same bits while no monitor acts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, event, given, settings
from hypothesis import strategies as st

from gantryctl import _core
from gantryctl.drives.simulated import SimDrive
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.program import GantryProgram, PowerPhase
from gantryctl.runtime import Engine, FixedOperator
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.units import rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import sim_drive
from parity.machines import factor

COLUMNS = (
    "pos_ref_rad", "vel_ref_rad_s", "acc_ref_rad_s2", "pos_act_rad", "pos_err_rad", "torque_act_nm", "pos_load_rad",
    "vel_load_rad_s", "pos_motor_rad", "vel_motor_rad_s", "pos_base_rad", "torque_mesh_nm",
)  # fmt: skip
"""In the same unit in both; the speed command is compared at the gantry."""


@dataclass
class Rig:
    """A powered engine, and the plant as it was when the axis began to follow."""

    machine: Machine
    engine: Engine
    program: GantryProgram
    recorder: MemoryRecorder
    plant: _core.GantrySim
    first_scan: int
    dithers: int = 0
    """How often the shaft was moved to try the reading, before the axis began to follow."""

    def command(self, **levels: object) -> None:
        operator = self.engine.operator
        assert isinstance(operator, FixedOperator)
        operator.command = operator.command._replace(**levels)


def powered(machine: Machine, angle_deg: float = 0.0) -> Rig:
    """Power up to the scan in which the axis begins to follow."""
    drive = sim_drive(machine, angle_deg)
    engine = build_engine(machine, drive=drive, keep_plans=True, recorder=MemoryRecorder)
    recorder = engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    program = engine.program
    assert isinstance(program, GantryProgram)
    rig = Rig(machine, engine, program, recorder, drive.sim, 0)
    rig.command(power=True)
    # the scan before the axis follows ends with the plant that the compiled loop starts from
    axis = program.axis
    while not axis.virtual.following:
        rig.plant, rig.first_scan = drive.sim.copy(), engine.scan
        engine.step()
        assert engine.scan < 20_000, axis.alarms.history
    assert axis.plans[0][0] == rig.first_scan
    rig.dithers = axis.liveness.dithers
    return rig


def calm(rig: Rig) -> bool:
    """No monitor has acted: the axis followed in every scan from the first on, and its reading never stood still."""
    axis = rig.program.axis
    if axis.liveness.dithers != rig.dithers:
        return False
    return axis.power.phase is PowerPhase.ON and axis.alarms.first_out is None


def replay(rig: Rig) -> dict[str, np.ndarray]:
    """The kept plans through the compiled loop, from the plant as it was."""
    axis, machine, drive = rig.program.axis, rig.machine, rig.engine.drive
    assert isinstance(drive, SimDrive)
    count_rad = 2.0 * np.pi / machine.counts_per_turn
    wrapped = drive.sim.feedback(count_rad)[0] - drive.read().pos_act_counts
    starts = [scan for scan, _ in axis.plans] + [rig.engine.scan]
    parts = []
    for (start, plan), end in zip(axis.plans, starts[1:], strict=True):
        if end == start:
            continue  # replaced within its own scan
        out = np.empty((len(_core.LOG_COLUMNS), end - start))
        _core.run_closed_loop(
            rig.plant, position_law(machine), plan, axis.zero_counts + wrapped, out, axis.power.torque_ff_nm
        )
        parts.append(out)
    return dict(zip(_core.LOG_COLUMNS, np.concatenate(parts, axis=1), strict=True))


def assert_same_bits(rig: Rig) -> None:
    trace = rig.recorder.trace()
    log = replay(rig)
    for column in COLUMNS:
        assert np.array_equal(trace[column][rig.first_scan :], log[column]), column
    ratio = position_law(rig.machine).ratio
    assert np.array_equal(trace["vel_cmd_rad_s"][rig.first_scan :], log["vel_cmd_rad_s"] / ratio)
    drive = rig.engine.drive
    assert isinstance(drive, SimDrive)
    assert drive.sim.state == rig.plant.state


def test_a_move_through_the_engine_is_the_move_of_the_compiled_loop() -> None:
    rig = powered(default_machine())
    rig.command(move=True, target_rad=rad(1.5), speed_rad_s=rad(6.0))
    rig.engine.run_for(4.0)
    assert calm(rig)
    assert len(rig.program.axis.plans) == 2
    assert_same_bits(rig)


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    """Gains, plants, drives and scans under which the monitors mostly stay quiet."""
    base = default_machine()
    switches = ("gear_error", "backlash", "hysteresis", "roller_friction", "base", "torque_ripple")
    changes: dict[str, object] = {
        "control.scan_period_ms": draw(st.sampled_from([1.0, 2.0, 4.0])),
        "control.kpp_per_s": draw(factor(2.0, 15.0)),
        "control.kvf": draw(factor(0.9, 1.05)),
        "drive.speed_loop.kvp_nm_s_per_rad": 77.7 * draw(factor(0.5, 1.2)),
        "drive.speed_loop.delay_cycles": draw(st.sampled_from([0, 1])),
        "drive.current_loop.ideal": draw(st.booleans()),
        "plant.load.inertia_kg_m2": 2.18e6 * draw(factor(0.6, 1.2)),
        "plant.load.eccentricity_m": draw(factor(0.0, 0.012)),
        "plant.transmission.backlash_mm": draw(factor(0.0, 0.3)),
        "plant.gear_error.phases_rad": draw(st.tuples(*[factor(0.0, 6.28)] * 18)),
        "plant.encoder.mounting_turns": draw(st.sampled_from([1000, 2048, 3000])),
        "virtual_axis.profile": draw(st.sampled_from(["trapezoid", "jerk_limited"])),
    }
    changes |= {f"plant.switches.{name}": draw(st.booleans()) for name in switches}
    return with_values(base, changes)


# What an operator may do while the axis moves: every one of these is a new plan from the present set-point.
_VALUES = (st.floats(-3.0, 3.0), st.floats(0.6, 6.0), st.floats(0.0, 1.0), st.floats(0.05, 1.0))
_MOVE = st.tuples(st.just("move"), *_VALUES)
_ANY = st.tuples(st.sampled_from(["move", "halt", "stop", "override"]), *_VALUES)
ACTIONS = st.builds(lambda first, rest: [first, *rest], _MOVE, st.lists(_ANY, min_size=1, max_size=4))


@settings(max_examples=40)
@given(machine=machines(), start=st.floats(-170.0, 170.0), actions=ACTIONS)
def test_engine_equals_the_compiled_loop_for_random_machines_and_commands(
    machine: Machine, start: float, actions: list[tuple[str, float, float, float, float]]
) -> None:
    rig = powered(machine, start)
    for what, way_deg, speed_deg_s, override, seconds in actions:
        if what == "move":
            target, speed = rad(start + way_deg), rad(speed_deg_s)
            rig.command(move=True, target_rad=target, speed_rad_s=speed)
        elif what == "override":
            rig.command(override=override)
        else:
            rig.command(**{what: True})
        rig.engine.run_for(seconds / 2.0)
        rig.command(move=False, halt=False, stop=False)
        rig.engine.run_for(seconds / 2.0)
    event("calm" if calm(rig) else str(rig.program.axis.alarms.first_out))
    event(f"{len(rig.program.axis.plans)} plans")
    assume(calm(rig))
    assert_same_bits(rig)


def test_a_second_move_after_standstill_goes_on_with_the_same_bits() -> None:
    rig = powered(default_machine(), 20.0)
    for target in (20.4, 19.9):
        rig.command(move=True, target_rad=rad(target), speed_rad_s=rad(3.0))
        rig.engine.run_for(2.0)
        rig.command(move=False)
        rig.engine.run_for(1.5)
    assert calm(rig)
    assert len(rig.program.axis.plans) == 3
    assert_same_bits(rig)


def test_the_comparison_can_fail() -> None:
    """Another gain in the compiled loop, by one part in 10^15, is seen."""
    rig = powered(default_machine())
    rig.command(move=True, target_rad=rad(1.0), speed_rad_s=rad(6.0))
    rig.engine.run_for(1.0)
    other = with_values(default_machine(), {"control.kpp_per_s": np.nextafter(10.0, 11.0).item()})
    with pytest.raises(AssertionError):
        assert_same_bits(replace(rig, machine=other))
