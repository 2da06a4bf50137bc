"""Every stop on the full plant: closed forms where there are any, ratings, and the machine file held to them."""

from __future__ import annotations

import pytest

from gantryctl.engineering.stops import (
    StopClass,
    check_quick_stop,
    find_quick_dec,
    run_stop,
    stop_table,
    worst_stop,
)
from gantryctl.engineering.stops.held_key import key_rows
from gantryctl.engineering.stops.limits import hardest_quick_stop
from gantryctl.engineering.stops.run import StopCase, log_stop, within_ratings, worst_of, worst_stops
from gantryctl.engineering.stops.silence import watch_rows
from gantryctl.engineering.stops.text import key_lines, watch_lines
from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.machine.rules.reaction import REACTION_S

MACHINE = default_machine()
TOP = MACHINE.speed.setting_max_deg_s
# A base that weighs nothing on its springs of 7 Hz.
TOO_STIFF = {"plant.base.inertia_kg_m2": 1.0}


def test_the_table_has_every_class_at_three_speeds() -> None:
    rows = stop_table(MACHINE)
    assert [(row.stop.stop_class, row.stop.speed_deg_s) for row in rows] == [
        (stop_class, pytest.approx(speed)) for stop_class in StopClass for speed in (0.6, 3.0, 6.0)
    ]
    for row in rows:
        assert row.angle_with_reaction_deg == pytest.approx(
            row.stop.angle_deg + row.stop.speed_deg_s * REACTION_S
        )


def test_other_speeds_may_be_asked_for() -> None:
    rows = stop_table(MACHINE, (1.0,))
    assert {row.stop.speed_deg_s for row in rows} == {1.0}
    assert len(rows) == len(StopClass)


def test_a_silent_controller_costs_the_delay_of_the_watch_that_sees_it() -> None:
    """50 ms are 0.30 deg of 6 deg/s, 150 ms 0.90 deg: 4.23 deg, and v^2 / 10.8 + 0.15 v = 4 ends at 5.81 deg/s."""
    machine = with_values(
        MACHINE, {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.heartbeat_alone_ms": 150.0}
    )
    table = stop_table(machine, (6.0,))
    (quick,) = [row.stop for row in table if row.stop.stop_class is StopClass.QUICK]
    deadline, heartbeat = watch_rows(machine, table)
    assert (deadline.watch, heartbeat.watch) == ("1400:05", "1016")
    assert deadline.angle_deg - quick.angle_deg == pytest.approx(0.30)
    assert heartbeat.angle_deg - quick.angle_deg == pytest.approx(0.90)
    assert (deadline.speed_max_deg_s, heartbeat.speed_max_deg_s) == (None, 5.8)
    assert (
        "4.23 deg from 6.0 deg/s: a drive with this watch alone is held to 5.8 deg/s"
        in watch_lines(machine, table)[1]
    )
    # A simulated drive has no bus and no watch.
    assert watch_rows(MACHINE, table) == ()


def test_a_held_key_without_its_page_goes_on_for_the_lease() -> None:
    """0.25 s are 1.50 deg of 6 deg/s."""
    table = stop_table(MACHINE, (6.0,))
    (jog,) = [row.stop for row in table if row.stop.stop_class is StopClass.JOG_RELEASE]
    (row,) = key_rows(MACHINE, table)
    assert row.angle_deg - jog.angle_deg == pytest.approx(1.5)
    assert row.time_s - jog.time_s == pytest.approx(0.25)
    assert f"{row.angle_deg:.2f} deg" in key_lines(MACHINE, table)[0]


@pytest.mark.parametrize("speed", [0.6, 3.0, 6.0])
def test_the_normal_ramp_takes_v_squared_over_2a(speed: float) -> None:
    stop = worst_stop(MACHINE, StopClass.NORMAL, speed)
    dec = MACHINE.virtual_axis.dec_deg_s2
    assert stop.angle_deg == pytest.approx(speed**2 / (2.0 * dec), rel=0.02)
    assert stop.time_s == pytest.approx(speed / dec, rel=0.15)


@pytest.mark.parametrize("speed", [3.0, 6.0])
def test_the_jog_release_ramp_takes_its_deceleration_and_its_jerk(speed: float) -> None:
    axis = MACHINE.virtual_axis
    dec, jerk = axis.jog_release_dec_deg_s2, axis.jog_release_jerk_deg_s3
    stop = worst_stop(MACHINE, StopClass.JOG_RELEASE, speed)
    assert stop.angle_deg == pytest.approx(speed**2 / (2.0 * dec) + speed * dec / (2.0 * jerk), rel=0.02)


def test_the_quick_stop_of_the_reference_machine_is_about_3_3_deg_from_full_speed() -> None:
    stop = worst_stop(MACHINE, StopClass.QUICK, TOP)
    assert stop.angle_deg == pytest.approx(3.33, abs=0.15)
    assert stop.angle_deg + TOP * REACTION_S < MACHINE.required.stopping_angle_deg
    assert within_ratings(MACHINE, stop)
    assert stop.brake_energy_kj == 0.0


def test_a_slow_axis_is_at_rest_below_a_120th_of_its_highest_speed() -> None:
    """2 deg/s at the most: of 0.06 deg/s it takes v^2 / 2a to 0.017, and not to 0.05, 4 % less by friction."""
    dish = load_machine(configs_folder() / "azimuth_dish.toml")
    stop = worst_stop(dish, StopClass.QUICK, 0.06)
    assert stop.angle_deg == pytest.approx(0.06**2 / (2.0 * dish.virtual_axis.quick_dec_deg_s2), rel=0.08)


def test_a_brake_stop_is_shorter_and_above_the_ratings_of_the_reducer() -> None:
    stop = worst_stop(MACHINE, StopClass.BRAKE, TOP)
    assert stop.angle_deg < worst_stop(MACHINE, StopClass.QUICK, TOP).angle_deg
    assert stop.time_s == pytest.approx(0.8, abs=0.15)
    assert stop.torque_reducer_nm > MACHINE.reducer.torque_momentary_nm
    assert not within_ratings(MACHINE, stop)


def test_stops_of_several_machines_are_those_of_each_alone() -> None:
    """Every class in one batch: other ramps, brakes and lengths side by side, and one that does not stay finite."""
    heavy = with_values(MACHINE, {"plant.load.inertia_kg_m2": 2.5e6})
    stiff = with_values(MACHINE, TOO_STIFF)
    cases = [StopCase(machine, each, 3.0) for machine in (MACHINE, stiff, heavy) for each in StopClass]
    found = worst_stops(cases)
    for case, stop in zip(cases, found, strict=True):
        if case.machine is stiff:
            assert isinstance(stop, ConfigError)
            assert "does not stay finite" in str(stop)
            continue
        runs = [
            run_stop(case.machine, case.stop_class, sign * 3.0, at)
            for at in (90.0, -90.0)
            for sign in (1.0, -1.0)
        ]
        assert stop == worst_of(case.stop_class, 3.0, runs)
    assert found[0] != found[-4]


def test_the_energy_of_a_brake_stop_is_the_kinetic_energy_and_no_more() -> None:
    """All that turns, at 6 deg/s; friction takes a part of it, the eccentric moment gives or takes a little."""
    stop = run_stop(MACHINE, StopClass.BRAKE, TOP, 0.0)
    inertia = MACHINE.plant.load.inertia_kg_m2 + 0.362 * 1144.0**2
    kinetic_kj = 0.5 * inertia * 0.10472**2 * 1e-3
    assert 0.6 * kinetic_kj < stop.brake_energy_kj < 1.2 * kinetic_kj


def test_a_harder_quick_stop_is_shorter_and_costs_more() -> None:
    soft, hard = (run_stop(MACHINE, StopClass.QUICK, TOP, 90.0, dec) for dec in (3.0, 5.0))
    assert hard.angle_deg < soft.angle_deg
    assert hard.torque_motor_nm > soft.torque_motor_nm
    assert hard.torque_reducer_nm > soft.torque_reducer_nm


def test_the_worst_of_four_is_the_worst_of_four() -> None:
    four = [
        run_stop(MACHINE, StopClass.QUICK, sign * 3.0, at) for sign in (1.0, -1.0) for at in (90.0, -90.0)
    ]
    worst = worst_stop(MACHINE, StopClass.QUICK, 3.0)
    assert worst.angle_deg == max(stop.angle_deg for stop in four)
    assert worst.torque_reducer_nm == max(stop.torque_reducer_nm for stop in four)


def test_the_reference_machine_keeps_what_it_promises() -> None:
    """With a load as heavy as an identified one may be."""
    heavy = with_values(MACHINE, {"plant.load.inertia_kg_m2": 2.18e6 * 1.005})
    assert check_quick_stop(MACHINE)[2:] == hardest_quick_stop(heavy)[2:]


def test_the_default_is_the_largest_that_can_be_found() -> None:
    found = find_quick_dec(MACHINE)
    assert found == pytest.approx(MACHINE.virtual_axis.quick_dec_deg_s2)
    assert within_ratings(MACHINE, hardest_quick_stop(MACHINE, found))
    assert not within_ratings(MACHINE, hardest_quick_stop(MACHINE, found + 0.1))


def changed(**changes: object) -> Machine:
    return with_values(MACHINE, {path.replace("__", "."): value for path, value in changes.items()})


@pytest.mark.parametrize(
    ("machine", "words"),
    [
        (changed(virtual_axis__quick_dec_deg_s2=6.5), "the motor cannot give it"),
        (changed(virtual_axis__quick_dec_deg_s2=6.5), "the reducer cannot give it"),
        # 60 ms of reaction are left, which a velocity deviation of 0.5 deg/s would not keep.
        (
            changed(virtual_axis__quick_dec_deg_s2=4.6, monitors__velocity_deviation_deg_s=0.2),
            "stopping_angle_deg = 4 deg",
        ),
        (
            changed(required__stopping_angle_deg=3.5, monitors__velocity_deviation_deg_s=0.2),
            "stop harder, go slower or permit more",
        ),
    ],
)
def test_a_quick_stop_that_cannot_be_is_refused_with_the_key_and_the_way_out(
    machine: Machine, words: str
) -> None:
    with pytest.raises(ConfigError) as refused:
        check_quick_stop(machine)
    assert words in str(refused.value)
    for line in refused.value.problems:
        assert line.startswith("hust_gantry: [virtual_axis] quick_dec_deg_s2 = ")


def test_a_motor_that_cannot_stop_the_load_at_all_is_said() -> None:
    # the eccentric moment of the check alone, with next to no reducer torque left for stopping
    weak = changed(
        reducer__torque_momentary_nm=17600.0,
        plant__load__eccentric_check_moment_nm=220e3,
        motor__torque_max_nm=500.0,  # enough to test a brake for such a load
        brake__test_torque_nm=260.0,
        brake__torque_nm=700.0,
    )
    with pytest.raises(ConfigError, match="choose a larger motor or reducer"):
        find_quick_dec(weak)


def test_a_gentle_quick_stop_is_watched_to_its_end() -> None:
    """0.5 deg/s2 from 6 deg/s: 36 deg in 12 s, ten times as long as that of the file; compliance adds little."""
    stop = run_stop(MACHINE, StopClass.QUICK, 6.0, 0.0, quick_dec_deg_s2=0.5)
    assert stop.angle_deg == pytest.approx(36.0, rel=0.01)
    assert stop.time_s == pytest.approx(12.0, rel=0.02)


def test_torque_of_a_stop_is_that_of_the_motor_that_has_more_of_it() -> None:
    """Of two motors braced by 25 N m each has half, and the one 25 N m more."""
    two = with_values(MACHINE, {"plant.switches.second_pinion": True, "plant.second_pinion.preload_nm": 25.0})
    case = (StopClass.QUICK, 3.0, 0.0)
    torque = max(abs(log_stop(two, *case)["torque_act_nm"]))
    assert run_stop(two, *case).torque_motor_nm == pytest.approx(0.5 * torque + 25.0)
