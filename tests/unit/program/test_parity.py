"""What a compiled closed loop must repeat bit for bit: set-points and speed commands follow from the plans alone."""

import itertools
import math

import pytest

from gantryctl._core import PositionLaw
from gantryctl.image import Mode
from gantryctl.program import PowerPhase
from gantryctl.units import rad
from unit.program.rig import COUNTS_PER_TURN, RATIO, ZERO_COUNTS, Rig, settings


def script(rig):
    """Everything that makes plans: moves, a move aborted, override, jog, increment, halt."""
    rig.power_up()
    rig.move(12.0)
    rig.run(1.7)
    rig.move(-7.0)
    rig.run(2.0)
    rig.op(override=0.4)
    rig.run(1.0)
    rig.op(override=1.0)
    rig.until(lambda: not rig.program.move.busy)
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(3.0))
    rig.op(forward=True, lease=1)
    rig.hold_key(1.3)
    rig.op(forward=False)
    rig.run(2.0)
    rig.op(mode=Mode.INCREMENTAL, increment_rad=rad(0.7))
    rig.op(reverse=True)
    rig.run(2.0)
    rig.move(50.0)
    rig.run(1.0)
    rig.op(halt=True)
    rig.run(3.0)


@pytest.mark.parametrize("jerk", [math.inf, 20.0])
@pytest.mark.parametrize("period_s", [0.001, 0.004])
def test_set_point_and_command_follow_from_the_plans_alone(jerk, period_s):
    rig = Rig(config=settings(period_s=period_s, jerk=jerk))
    counts, commands, refs = [], [], []
    read = rig.drive.read

    def noted():
        feedback = read()
        counts.append(feedback.pos_act_counts)
        return feedback

    write = rig.drive.write

    def written(output):
        write(output)
        commands.append(output.vel_cmd_rad_s)
        virtual = rig.axis.virtual
        refs.append((virtual.pos_ref_rad, virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2))

    rig.drive.read, rig.drive.write = noted, written
    script(rig)
    assert not rig.codes
    assert rig.axis.power.phase is PowerPhase.ON

    law = PositionLaw(10.0, 1.0, RATIO, COUNTS_PER_TURN, rad(6.3) * RATIO)
    plans = rig.axis.plans
    assert len(plans) >= 10
    index = 0
    for scan in range(plans[0][0], rig.scan):
        while index + 1 < len(plans) and plans[index + 1][0] <= scan:
            index += 1
        start, plan = plans[index]
        ref = plan.sample((scan - start) * period_s)
        assert refs[scan] == ref
        assert commands[scan] == law.scan(ref[0], ref[1], counts[scan] - ZERO_COUNTS)[0]


def test_plans_join_without_a_jump():
    rig = Rig()
    script(rig)
    plans = rig.axis.plans
    for (start, plan), (next_start, following) in itertools.pairwise(plans):
        end = plan.sample((next_start - start) * rig.period_s)
        begin = following.sample(0.0)
        assert begin[0] == pytest.approx(end[0], abs=1e-9)
        assert begin[1] == pytest.approx(end[1], abs=1e-9)


def test_plans_are_not_kept_unless_asked_for():
    rig = Rig()
    rig.axis.virtual.keep_plans = False
    rig.power_up()
    before = len(rig.axis.plans)
    rig.move(5.0)
    assert len(rig.axis.plans) == before


def test_the_trace_row_fits_its_columns():
    rig = Rig()
    rig.power_up()
    rig.move(5.0)
    rig.run(0.5)
    row = dict(zip(rig.program.trace_columns, rig.program.trace_row(), strict=True))
    assert all(type(value) is float for value in row.values())
    assert row["pos_ref_rad"] == rig.axis.virtual.pos_ref_rad
    assert row["vel_cmd_rad_s"] == rig.output.vel_cmd_rad_s / RATIO
    assert row["axis_state"] == 3.0
    assert row["drive_state"] == 5.0
    assert row["alarm_count"] == 0.0
    assert row["pos_err_rad"] == pytest.approx(row["pos_ref_rad"] - row["pos_act_rad"], abs=1e-15)
