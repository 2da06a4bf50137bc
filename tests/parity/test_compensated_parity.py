"""With compensations on, engine, compiled loop and batch still give the same bits; with all off, the old ones."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gantryctl import _core
from gantryctl.drives.simulated import SimDrive
from gantryctl.engineering.batch import ClosedLoop, Leg, run_legs
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import rad
from gantryctl.wiring.compensation import compensation
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim
from parity.test_engine_parity import COLUMNS, Rig, calm, powered
from support.improved import improved_machine

SWITCHES = (
    "torque.eccentric", "torque.acceleration", "gear_map.active", "windup.active", "windup.reversal",
    "load_encoder.own_errors", "damping.active", "moment_observer.active", "backlash_observer.active",
)  # fmt: skip


def replay(rig: Rig) -> dict[str, np.ndarray]:
    axis, machine, drive = rig.program.axis, rig.machine, rig.engine.drive
    assert isinstance(drive, SimDrive)
    wrapped = drive.sim.feedback(2.0 * np.pi / machine.counts_per_turn)[0] - drive.read().pos_act_counts
    laws = compensation(machine)
    starts = [scan for scan, _ in axis.plans] + [rig.engine.scan]
    parts = []
    for (start, plan), end in zip(axis.plans, starts[1:], strict=True):
        if end == start:
            continue
        out = np.empty((len(_core.LOG_COLUMNS), end - start))
        _core.run_closed_loop(
            rig.plant,
            position_law(machine),
            plan,
            axis.zero_counts + wrapped,
            out,
            axis.power.torque_ff_nm,
            laws,
        )
        parts.append(out)
    return dict(zip(_core.LOG_COLUMNS, np.concatenate(parts, axis=1), strict=True))


def assert_same_bits(rig: Rig) -> None:
    trace, log = rig.recorder.trace(), replay(rig)
    for column in COLUMNS:
        assert np.array_equal(trace[column][rig.first_scan :], log[column]), column
    drive = rig.engine.drive
    assert isinstance(drive, SimDrive)
    assert drive.sim.state == rig.plant.state


def test_a_move_with_everything_on_is_the_move_of_the_compiled_loop() -> None:
    rig = powered(improved_machine(), 89.0)
    rig.command(move=True, target_rad=rad(90.5), speed_rad_s=rad(6.0))
    rig.engine.run_for(4.0)
    assert calm(rig)
    assert_same_bits(rig)


@st.composite
def machines(draw: st.DrawFn) -> Machine:
    changes: dict[str, object] = {f"control.compensation.{name}": draw(st.booleans()) for name in SWITCHES}
    # Without an encoder on the ring the backlash is followed by the torque, with it by the lost motion.
    ring = draw(st.booleans())
    changes["control.compensation.load_encoder.active"] = ring
    for needs in ("load_encoder.own_errors", "damping.active"):
        changes[f"control.compensation.{needs}"] &= ring
    changes["control.compensation.moment_observer.limit_nm"] = 30e3
    changes["control.compensation.backlash_observer.limit_deg"] = 0.007
    for needed in ("moment_observer.active", "windup.active", "windup.reversal"):
        changes["control.compensation.backlash_observer.active"] &= bool(
            changes[f"control.compensation.{needed}"]
        )
    changes["virtual_axis.gentle_end"] = draw(st.booleans())
    changes["control.compensation.latency_us"] = draw(st.sampled_from([0.0, 62.5]))
    changes["control.scan_period_ms"] = draw(st.sampled_from([1.0, 2.0]))
    changes["plant.gear_error.phases_rad"] = draw(st.tuples(*[st.floats(0.0, 6.28)] * 18))
    return with_values(improved_machine(), changes)


@settings(max_examples=20)
@given(
    machine=machines(),
    start=st.floats(-170.0, 170.0),
    ways=st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=3),
)
def test_engine_equals_the_compiled_loop_for_any_choice_of_compensations(
    machine: Machine, start: float, ways: list[float]
) -> None:
    rig = powered(machine, start)
    for way in ways:
        rig.command(move=True, target_rad=rad(start + way), speed_rad_s=rad(3.0))
        rig.engine.run_for(0.7)  # most of these moves are still under way: the next one replans in mid-scan
        rig.command(move=False)
        rig.engine.run_for(0.3)
    assume(calm(rig))
    assert_same_bits(rig)


def test_legs_are_those_of_the_logged_run_and_do_not_depend_on_threads() -> None:
    machine = improved_machine()
    plan = plan_move(SetPoint(0.5, 0.0, 0.0), 0.51, motion_limits(machine))
    legs = [Leg(hold(0.5), 0.2, 0.1), Leg(plan, plan.duration + 0.5, 0.2)]

    def loop() -> ClosedLoop:
        return ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.5, compensation(machine))

    logged = loop()
    logged.run(hold(0.5), 0.2)
    log = logged.run(plan, plan.duration + 0.5)
    one = run_legs([loop(), loop(), loop()], legs, 1)
    two = run_legs([loop(), loop(), loop()], legs, 3)
    assert all(np.array_equal(a, b) for x, y in zip(one, two, strict=True) for a, b in zip(x, y, strict=True))
    assert one[1].max_torque_motor_nm[1] == np.max(np.abs(log["torque_act_nm"]))
    # numpy adds pairwise, the batch in order: the last bits of the mean may differ
    assert one[1].mean_pos_load_rad[2] == pytest.approx(float(np.mean(log["pos_load_rad"][-200:])), abs=1e-14)


def test_all_switches_off_give_the_bits_of_the_bare_law() -> None:
    machine = default_machine()
    plan = plan_move(SetPoint(0.3, 0.0, 0.0), 0.31, motion_limits(machine))
    bare = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.3)
    none = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.3, _core.Compensation({}, {}))
    first, second = bare.run(plan, 2.0), none.run(plan, 2.0)
    assert all(np.array_equal(first[name], second[name]) for name in _core.LOG_COLUMNS)
    assert compensation(machine) is None


def test_the_same_compensation_for_two_plants_is_refused() -> None:
    machine = improved_machine()
    laws = compensation(machine)
    loops = [ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.0, laws) for _ in range(2)]
    with pytest.raises(ValueError, match="every plant needs its own"):
        run_legs(loops, [Leg(hold(0.0), 0.1, 0.1)])
