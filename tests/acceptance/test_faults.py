"""The suite can fail: faults of a gantry that must turn the criteria red, and what each criterion does not see.

Red is the same predicate that the other tests call green.
"""

from dataclasses import replace

import numpy as np
import pytest

from acceptance.bench import SHORT, Bench, ChordRun, chord_is_green, chord_runs, gantry, speed_is_green
from gantryctl.engineering.accuracy.job import AccuracyJob, accuracy_report, angle_errors_deg
from gantryctl.engineering.accuracy.procedure.on_batch import Readings, legs_of, lose_turns, run_procedure
from gantryctl.engineering.accuracy.procedure.procedures import StopRole, chord_procedure
from gantryctl.engineering.accuracy.report.report import AccuracyReport
from gantryctl.engineering.accuracy.speed_test import speed_test
from gantryctl.engineering.batch import ClosedLoop, run_legs
from gantryctl.machine import default_machine
from gantryctl.units import rad
from gantryctl.wiring.program import position_law
from gantryctl.wiring.simulator import gantry_sim

ECCENTRIC_TIMES_5 = {
    "plant__load__eccentricity_m": 5.0 * 0.00815,
    "plant__load__eccentric_check_moment_nm": 80e3,  # stops are proved with the moment there is,
    "brake__test_torque_nm": 100.0,  # and so is the brake
}


def test_a_slack_gear_is_red(bench: Bench) -> None:
    run = bench.chord(gantry(plant__transmission__backlash_mm=0.4))
    assert not chord_is_green(run.a_deg)
    # 0.028 deg is far inside the requirement, so the requirement alone would let a worn gear pass
    assert run.statistics.largest_deg < 0.1


def losing_turns(turns: int, before_stop: int) -> tuple[ChordRun, Readings]:
    """The reference machine, its encoder off by whole motor turns before the move to one stop of procedure A."""
    procedure = chord_procedure("A")

    def between(stop: int, loop: ClosedLoop) -> None:
        if stop == before_stop:
            lose_turns(loop, turns)

    machine = default_machine()
    readings = run_procedure([machine], procedure, between=between)
    return chord_runs([machine], procedure, readings)[0], readings


@pytest.mark.parametrize("turns", [1, pytest.param(-1, marks=pytest.mark.slow)])
def test_a_motor_turn_lost_while_powered_off_between_base_and_point_is_red(turns: int) -> None:
    stops = chord_procedure("A").stops
    point = next(k for k, stop in enumerate(stops) if stop.role is StopRole.POINT) + 1
    assert stops[point].role is StopRole.POINT
    run, _ = losing_turns(turns, point)
    assert not chord_is_green(run.a_deg)
    # one motor turn is 360/1144 deg at the gantry; the gear is another one there: 1 % of it
    turn_deg = 360.0 / run.machine.axis.ratio
    assert run.statistics.largest_deg == pytest.approx(turn_deg, abs=0.01)


def test_a_turn_lost_between_two_series_escapes_the_chords_but_not_the_verdict(
    report: AccuracyReport,
) -> None:
    stops = chord_procedure("A").stops
    approach = next(k for k, stop in enumerate(stops) if stop.role is StopRole.APPROACH)
    run, readings = losing_turns(1, approach)
    assert chord_is_green(run.a_deg), "chords are differences: this is why the angles are judged as well"
    seen = replace(report, true=run.table, angle_errors_deg=angle_errors_deg(run.procedure, readings)).verdict
    assert seen.passed is False
    assert "largest angle error at a stop" in seen.text


def test_no_feed_forward_is_red_in_the_speed_test_and_invisible_to_the_chords(bench: Bench) -> None:
    machine = gantry(control__kvf=0.0)
    runs = speed_test(machine)
    assert not speed_is_green(runs)
    # closed form of the rigid loop: a constant speed error a / Kpp while accelerating, plus the swing of the load
    lag_deg_s = machine.virtual_axis.acc_deg_s2 / machine.control.kpp_per_s
    for run in runs:
        assert not speed_is_green([run])
        assert lag_deg_s < run.motor_error_deg_s < 1.5 * lag_deg_s
        assert run.reached  # it is late, not slow
    assert chord_is_green(bench.chord(machine).a_deg)


@pytest.mark.parametrize("ring_teeth", [339, pytest.param(337, marks=pytest.mark.slow)])
def test_a_ratio_wrong_by_one_tooth_of_the_ring_is_red(ring_teeth: int) -> None:
    # the controller of one machine on the gantry of another: 338 teeth on a pinion of 26
    procedure, machine = chord_procedure("A"), gantry(axis__ring_ratio=ring_teeth / 26.0)
    loop = ClosedLoop.standing_at(
        gantry_sim(default_machine()), position_law(machine), rad(procedure.start_deg)
    )
    dwells = run_legs([loop], legs_of(machine, procedure))[1:]
    wrong = ChordRun(machine, procedure, np.array([float(d.mean_pos_load_rad[0]) for d in dwells]))
    assert not chord_is_green(wrong.a_deg)
    # every displacement comes out wrong by one part in 338, at every base: 0.059 deg at 20
    longest = np.abs(wrong.table.errors_deg[:, -1])
    assert np.all(longest > 0.75 * 20.0 / 338.0)


def test_five_times_the_eccentric_moment_is_red_through_0_deg_alone(
    bench: Bench, reference: ChordRun
) -> None:
    machine = gantry(**ECCENTRIC_TIMES_5)
    run = bench.chord(machine)
    assert not chord_is_green(run.a_deg)
    # wind-up follows the change of the moment, largest at 0; at +-90 it stays within the stiction band
    assert run.rms_deg[0.0] > 2.0 * reference.rms_deg[0.0]
    for base in (90.0, -90.0):
        assert run.rms_deg[base] == pytest.approx(reference.rms_deg[base], abs=0.0003)
    # 80 kN m are 70 N m at the motor: the loop still carries it, the motor side tells nothing
    assert speed_is_green(speed_test(machine, [0.6, 6.0]))


def test_three_times_the_gear_error_is_red_in_both_criteria(bench: Bench, reference: ChordRun) -> None:
    machine = gantry(plant__gear_error__scale=3.0 * default_machine().plant.gear_error.scale)
    run = bench.chord(machine)
    assert not chord_is_green(run.a_deg)
    assert run.a_deg > 2.0 * reference.a_deg
    assert not speed_is_green(speed_test(machine, [3.0]))


@pytest.mark.parametrize("switches", [{"gear_error": False}, {"rigid": True}], ids=["no gear error", "rigid"])
def test_a_plant_that_is_too_good_is_red(bench: Bench, switches: dict[str, bool]) -> None:
    # a simulator with its physics off must not pass for an accurate gantry
    run = bench.chord(gantry(**{f"plant__switches__{name}": value for name, value in switches.items()}))
    assert not chord_is_green(run.a_deg)


def test_a_speed_loop_on_raw_counts_is_red() -> None:
    # one count per 125 us is 6.1 rad/s: the reason why the encoder must be interpolated
    assert not speed_is_green(speed_test(gantry(drive__speed_loop__feedback="counts"), [6.0]))


def test_the_report_of_a_gantry_without_feed_forward_says_red() -> None:
    # end to end through the job that the command runs
    report = accuracy_report(gantry(control__kvf=0.0), AccuracyJob(SHORT), version="test")
    assert report.speed_passed is False
