"""Stops written down by hand: what their figures are made of, what is certified of them, what a small axis reads."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from gantryctl.engineering.batch import Log
from gantryctl.engineering.stops import limits
from gantryctl.engineering.stops.certify import Certificate, QuickStops, certified_on
from gantryctl.engineering.stops.page import quick_within
from gantryctl.engineering.stops.run import (
    StopCase,
    StopClass,
    StopResult,
    StopRow,
    _evaluate,
    run_stop,
    stop_table,
)
from gantryctl.engineering.stops.silence import watch_rows
from gantryctl.engineering.stops.text import certificate_lines, key_lines, stops_text, watch_lines
from gantryctl.engineering.stops.uncertain import Factors, UncertainPlant, drawn
from gantryctl.errors import ConfigError
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.wiring.simulator import plant_params

# The package has a function of this name.
CERTIFY = sys.modules[certified_on.__module__]
# It has 1.88233 N m at the motor and 56.47 N m at the reducer.
TABLE = load_machine(configs_folder() / "rotary_table.toml")
STOP = StopResult(StopClass.QUICK, 60.0, 18.5, 0.74, 19.0, 1.8712, 56.313, 1.0, 0.0, 0.026, False, 0.05, 0.8)


def test_what_a_certificate_used_is_never_rounded_above_the_limit_beside_it() -> None:
    """1.8712 N m are not "2 of 1.88233", nor 0.056313 kN m "0.1 of 0.05647"; each beside the plant that had it."""
    motor, reducer = Factors(torque_constant=0.97), Factors(stiffness=1.2)
    found = QuickStops(292.0, 0.5, Certificate(237.0, 60.0, STOP, motor, reducer, 48, 576), None)
    told = "\n".join(certificate_lines(TABLE, found))
    assert "1.871 of 1.88233 N m (torque constant -3 %)" in told
    assert "0.05631 of 0.05647 kN m (stiffness +20 %)" in told
    assert "a load of up to 75 kg m2 (50.0 % more than the machine file)" in told


def test_a_refused_quick_stop_names_the_torque_that_a_small_reducer_gets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """61.4 N m on 56.47."""
    monkeypatch.setattr(limits, "hardest_quick_stop", lambda _: STOP._replace(torque_reducer_nm=61.4))
    with pytest.raises(ConfigError, match=r"puts 0\.0614 kN m on it, .*momentary_nm = 0\.05647 kN m"):
        limits.check_quick_stop.__wrapped__(TABLE)


def test_a_certificate_leaves_room_for_the_reaction_and_names_who_was_hardest_for_what(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Plants that take v^2 / 2a, the last 5 % more; 4 deg are permitted, 60 ms of 6 deg/s are 0.36 of them.

    18 x 1.05 / 5.2 = 3.63 and 0.36 are 3.99 deg; with 5.1 deg/s2 it would be 4.07. The first plant asks most of the
    motor, the second of the reducer.
    """
    machine = default_machine()
    some = [UncertainPlant(Factors(inertia=1.0 + 0.1 * k), machine) for k in range(3)]

    def stops(plants: list[UncertainPlant], speed: float, dec: float) -> list[StopResult]:
        return [
            STOP._replace(
                speed_deg_s=speed,
                angle_deg=speed**2 / (2.0 * dec) * (1.05 if plant is some[2] else 1.0),
                torque_motor_nm=300.0 if plant is some[0] else 100.0,
                torque_reducer_nm=3e4 if plant is some[1] else 1e4,
            )
            for plant in plants
        ]

    monkeypatch.setattr(CERTIFY, "_stops", stops)
    monkeypatch.setattr(CERTIFY, "largest_dec_deg_s2", lambda *_: 5.2)
    found = certified_on(machine, some[:2], some[2:])
    assert (found.dec_deg_s2, found.speed_deg_s) == pytest.approx((5.2, 6.0))
    assert (found.hardest_motor, found.hardest_reducer) == (some[0].factors, some[1].factors)
    monkeypatch.setattr(CERTIFY, "largest_dec_deg_s2", lambda *_: 5.1)
    lower = certified_on(machine, some[:2], some[2:])
    assert lower.dec_deg_s2 < 5.1
    assert lower.worst.angle_deg + 0.06 * lower.speed_deg_s <= 4.0


def test_a_load_that_swings_out_and_a_base_that_leans() -> None:
    """From 80 deg on the load goes to 82, 2 deg, and comes to rest at 81; the base leans as 50 kN m of the check make
    it: over its stiffness, by the sine of the angle. That is no motion of the base.
    """
    machine = default_machine()
    plant = plant_params(machine)
    load = np.radians([80.0, 81.0, 82.0, 81.5, 81.0, 81.0])
    lean = -50_000.0 * np.sin(load) / plant.base_stiffness_nm_per_rad
    speed = np.radians([6.0, 5.0, 3.0, 0.0, 0.0, 0.0]) * machine.axis.ratio
    columns = {
        "pos_motor_rad": np.cumsum(speed), "vel_motor_rad_s": speed, "pos_load_rad": load,
        "vel_load_rad_s": np.zeros(6), "pos_base_rad": lean + 1e-5, "torque_act_nm": np.zeros(6),
        "torque_mesh_nm": np.zeros(6), "torque_limited": np.zeros(6),
    }  # fmt: skip
    log = Log(np.stack(list(columns.values())), 0.1, tuple(columns))
    found = _evaluate(StopCase(machine, StopClass.QUICK, 6.0), log)
    assert found.load_angle_deg == pytest.approx(2.0)
    # 43 urad of lean at 2.366 m are 100 um; with the moment of the file instead some um would be left.
    assert found.base_um == pytest.approx(0.0, abs=1e-6)


def test_the_angle_of_a_stop_is_the_farthest_of_the_motor_while_it_turns() -> None:
    """A load that swings turns it back by 0.1 deg before it stands; behind its rest nothing counts."""
    machine = default_machine()
    angle = np.radians([0.0, 0.4, 0.6, 0.5, 0.5, 0.9]) * machine.axis.ratio
    speed = np.radians([6.0, 3.0, -1.0, -0.1, 0.0, 0.0]) * machine.axis.ratio
    columns = {
        "pos_motor_rad": angle, "vel_motor_rad_s": speed, "pos_load_rad": angle / machine.axis.ratio,
        **{name: np.zeros(6) for name in
           ("vel_load_rad_s", "pos_base_rad", "torque_act_nm", "torque_mesh_nm", "torque_limited")},
    }  # fmt: skip
    log = Log(np.stack(list(columns.values())), 0.1, tuple(columns))
    found = _evaluate(StopCase(machine, StopClass.QUICK, 6.0), log)
    assert found.angle_deg == pytest.approx(0.6)
    assert found.time_s == pytest.approx(0.4)


def test_the_motor_takes_out_what_its_torque_is_and_not_what_its_drive_believes() -> None:
    """-100 N m at 10 rad/s for 0.1 s are 100 J of a motor with its whole torque constant; this one has 0.9 of it."""
    machine = with_values(default_machine(), {"plant.motor.torque_constant_ratio": 0.9})
    speed = np.array([10.0, 0.0, 0.0])
    columns = {
        "pos_motor_rad": np.zeros(3), "vel_motor_rad_s": speed, "torque_act_nm": np.array([-100.0, -100.0, 0.0]),
        **{name: np.zeros(3) for name in
           ("pos_load_rad", "vel_load_rad_s", "pos_base_rad", "torque_mesh_nm", "torque_limited")},
    }  # fmt: skip
    log = Log(np.stack(list(columns.values())), 0.1, tuple(columns))
    assert _evaluate(StopCase(machine, StopClass.QUICK, 6.0), log).motor_energy_kj == pytest.approx(0.090)


def test_the_wind_of_an_axis_does_not_blow_on_top_of_the_moment_of_the_check() -> None:
    dish = load_machine(configs_folder() / "azimuth_dish.toml")
    calm = with_values(dish, {"plant.switches.wind": False})
    assert dish.plant.switches.wind
    assert run_stop(dish, StopClass.QUICK, 0.5, 20.0) == run_stop(calm, StopClass.QUICK, 0.5, 20.0)


def test_plants_that_are_drawn_have_gears_of_their_own() -> None:
    """The seeds of their gears follow that of the draw; 0 would be the gear of the file."""
    assert [each.gear for each in drawn(TABLE, 3, 7)] == [8, 9, 10]


@pytest.mark.parametrize(("angle_deg", "refused"), [(3.6390, False), (3.6401, True), (3.6449, True)])
def test_a_stop_beyond_the_permitted_angle_is_not_passed_by_rounding(
    monkeypatch: pytest.MonkeyPatch, angle_deg: float, refused: bool
) -> None:
    """4 deg are permitted, of which 60 ms of 6 deg/s are 0.36."""
    stop = STOP._replace(torque_motor_nm=100.0, torque_reducer_nm=1e3, angle_deg=angle_deg)
    monkeypatch.setattr(limits, "hardest_quick_stop", lambda _: stop)
    check = limits.check_quick_stop.__wrapped__
    if not refused:
        assert check(default_machine()) is stop
        return
    with pytest.raises(ConfigError, match=r"takes 4\.01 deg including 60 ms"):
        check(default_machine())


def test_a_silent_controller_lets_the_motor_go_until_a_brake_that_is_not_the_drives_has_closed() -> None:
    """Behind a ramp from 0.6 deg/s the load of 2 Hz swings with 0.48 deg/s, and its gear is twisted by 0.038 deg.

    In 150 ms the motor goes with the load, at half of its speed at least, and at most with all of it and to the other
    side of that twist: 0.036 to 0.15 deg more. A drive that owns its brake holds the motor until it has closed.
    """
    machine = with_values(default_machine(), {"drive.kind": "canopen", "control.scan_period_ms": 4.0})
    rows = [row for row in stop_table(machine, (0.6,)) if row.stop.stop_class is StopClass.QUICK]
    by_drive, _ = watch_rows(machine, rows)
    by_hand, _ = watch_rows(with_values(machine, {"brake.owner": "object_60FE"}), rows)
    assert by_drive.angle_deg == pytest.approx(rows[0].stop.angle_deg + 0.6 * 0.050)
    assert 0.036 <= by_hand.angle_deg - by_drive.angle_deg <= 0.15


def test_a_yaw_drive_reads_its_speeds_and_not_zero() -> None:
    """0.048 to 0.48 deg/s: a table from "0.0", and a drive that is held to 0.0 deg/s, were of no use."""
    row = StopRow(STOP._replace(speed_deg_s=0.048, stop_class=StopClass.JOG_RELEASE), 0.03, inspect=False)
    fast = StopRow(STOP._replace(speed_deg_s=0.48), 0.67, inspect=False)
    assert [cells[1] for cells in stops_text([row, fast]).rows] == ["0.05", "0.48"]
    # A motor without torque that takes nothing: no minus before a zero.
    table = stops_text([row._replace(stop=row.stop._replace(motor_energy_kj=-1e-9))])
    assert dict(zip(table.heads, table.rows[0], strict=True))["motor\nkJ"].strip("0") == "."
    assert "from 0.048 deg/s (lease of 250 ms" in key_lines(TABLE, [row])[0]
    # v^2 / 2a + 0.15 v = 0.05 deg ends at 0.272 deg/s with 4 deg/s2: to two digits below.
    slow = with_values(
        default_machine(),
        {
            "drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.heartbeat_alone_ms": 150.0,
        },
    )  # fmt: skip
    slow = slow.model_copy(
        update={
            "required": slow.required.model_copy(update={"stopping_angle_deg": 0.05}),
            "virtual_axis": slow.virtual_axis.model_copy(update={"quick_dec_deg_s2": 4.0}),
        }
    )
    assert [watch.speed_max_deg_s for watch in watch_rows(slow, [fast])][1] == 0.27
    assert watch_lines(slow, [fast])[1].endswith(
        "from 0.48 deg/s: a drive with this watch alone is held to 0.27 deg/s"
    )


@pytest.mark.parametrize(
    ("kvp", "told"), [(2000.0, "this loop is unstable"), (77.6959, "the motor cannot give it")]
)
def test_a_loop_that_is_unstable_is_told_and_no_gentler_stop_proposed(
    monkeypatch: pytest.MonkeyPatch, kvp: float, told: str
) -> None:
    """Small delays of 0.58 ms turn a quarter of a circle at 2700 rad/s: the rotor of 0.362 kg m2 bears Kvp = 980."""
    machine = with_values(default_machine(), {"drive.speed_loop.kvp_nm_s_per_rad": kvp})
    monkeypatch.setattr(
        limits, "hardest_quick_stop", lambda _: STOP._replace(torque_limited=True, angle_deg=3.0)
    )
    with pytest.raises(ConfigError) as refused:
        limits.check_quick_stop.__wrapped__(machine)
    (problem,) = refused.value.problems
    assert told in problem


@pytest.mark.parametrize(
    ("quick_deg", "kept"), [((3.6, 1.0), True), ((3.7, 1.0), False), ((1.0, float("nan")), False)]
)
def test_every_quick_stop_is_judged_with_the_way_before_it_begins(
    quick_deg: tuple[float, float], kept: bool
) -> None:
    """60 ms of 6 deg/s are 0.36 deg: 3.7 deg are 4.06 of the 4 that the reference gantry permits."""
    stops = [STOP._replace(speed_deg_s=6.0, angle_deg=angle) for angle in quick_deg]
    # What the other classes take is shown, and judges nothing.
    stops.append(STOP._replace(stop_class=StopClass.NORMAL, angle_deg=46.0))
    rows = [StopRow(stop, stop.angle_deg + 0.36, inspect=False) for stop in stops]
    assert quick_within(default_machine(), rows) is kept


def test_the_swing_of_a_load_is_a_speed_and_not_its_way() -> None:
    """0.07 deg/s behind a stop whose load goes 19.4 deg."""
    table = stops_text(
        [StopRow(STOP._replace(load_angle_deg=19.4, load_swing_deg_s=0.07), 22.1, inspect=False)]
    )
    assert dict(zip(table.heads, table.rows[0], strict=True))["load swing\ndeg/s"] == "0.07"
