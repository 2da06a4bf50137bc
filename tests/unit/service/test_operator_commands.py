"""What the operator makes of single commands: levels that fall, refusals that leave nothing behind, loss of control."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest

from gantryctl.image import Mode
from gantryctl.program import AxisState
from gantryctl.program.alarms.codes import Code
from gantryctl.service.command.arming import Armed
from gantryctl.service.command.inbox import Inbox
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.memory.memory import JournalState, Word
from gantryctl.service.protocol.roles import Action, Role
from gantryctl.units import deg, rad
from support.service_bench import LEASE, MACHINE, Bench

OTHER_LEASE = "00000000000000bb"


def moving(bench: Bench, mode: Mode = Mode.CONTINUOUS) -> None:
    bench.powered(bench.who(), mode)
    bench.do(bench.who(), "move", target_deg=20.0)
    bench.scans(1500)
    assert bench.axis.state is AxisState.DISCRETE_MOTION


def jogging(bench: Bench) -> None:
    bench.powered(bench.who())
    bench.do(bench.who(), "jog", lease=LEASE, direction="forward")
    bench.hold(1.0)
    assert bench.operator.hold.alive


def stays(bench: Bench, seconds: float = 2.0) -> bool:
    """Whether the set-point stands still from now on."""
    here = bench.axis.virtual.pos_ref_rad
    bench.scans(round(1000 * seconds))
    return bench.axis.virtual.pos_ref_rad == here


def test_a_refused_mode_leaves_the_one_before() -> None:
    bench = Bench()
    moving(bench)
    assert bench.refused(bench.who(), "mode", mode="incremental")
    assert (bench.operator.levels.mode, bench.program.mode) == (Mode.CONTINUOUS, Mode.CONTINUOUS)


def test_halt_ends_a_motion_with_power_on_and_its_level_falls() -> None:
    bench = Bench()
    moving(bench)
    bench.do(bench.who(), "halt")
    assert not bench.operator.levels.halt
    bench.until(AxisState.STANDSTILL)
    assert abs(deg(bench.axis.pos_act_rad)) < 19.0
    assert bench.operator.levels.power


def test_a_refused_acceleration_leaves_the_one_before() -> None:
    bench = Bench()
    who = bench.who(Role.PHYSICIST)
    bench.powered(who)
    before = bench.operator.setting("acc_setting_deg_s2")
    bench.do(who, "move", target_deg=20.0)
    bench.scans(1500)
    assert bench.refused(who, "set", tag="acc_setting_deg_s2", value=0.1) == "CTL-14"
    assert bench.operator.setting("acc_setting_deg_s2") == before


def test_an_override_is_in_percent() -> None:
    bench = Bench()
    bench.powered(bench.who())
    bench.do(bench.who(), "set", tag="override_percent", value=40.0)
    assert bench.operator.levels.override == pytest.approx(0.4)
    assert bench.operator.setting("override_percent") == pytest.approx(40.0)


def test_a_way_an_angle_and_a_way_again() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    for kind, name, value, wanted in (
        ("move_by", "distance_deg", 0.5, 0.5),
        ("move_by", "distance_deg", -0.2, 0.3),
        ("move", "target_deg", 0.4, 0.4),
        ("move_by", "distance_deg", 0.2, 0.6),
    ):
        bench.do(who, kind, **{name: value})
        bench.until(AxisState.STANDSTILL)
        assert deg(bench.axis.virtual.pos_ref_rad) == pytest.approx(wanted, abs=1e-6)


def test_two_commands_of_one_scan_are_two_commands() -> None:
    """The second waits a scan: its level must be seen to fall before it rises again."""
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.send(who, "move_by", distance_deg=0.3)
    bench.send(who, "move_by", distance_deg=0.5)
    for _ in range(6):
        bench.scans(1)
        assert not bench.operator.levels.move  # taken back after each scan
    bench.until(AxisState.STANDSTILL)
    assert deg(bench.axis.virtual.pos_ref_rad) == pytest.approx(0.5, abs=1e-4)


def test_no_level_of_an_edge_outlasts_its_scan() -> None:
    bench = Bench()
    who = bench.who(Role.PHYSICIST)
    bench.do(who, "take", over=False)
    bench.do(who, "arm", action="brake_test")
    bench.do(who, "brake_test")
    levels = bench.operator.levels
    assert (levels.brake_test, levels.move, levels.halt, levels.reset) == (False, False, False, False)


def test_a_refused_press_starts_nothing_later() -> None:
    bench = Bench()
    who = bench.who()
    bench.do(who, "take", over=False)
    assert bench.refused(who, "jog", lease=LEASE, direction="forward")  # no power
    assert not bench.operator.hold.alive
    assert not bench.operator.levels.forward


def test_refused_power_does_not_come_when_its_reason_goes() -> None:
    bench = Bench()
    who = bench.who()
    bench.do(who, "take", over=False)
    bench.engine.drive.faults.estop_ok = False
    bench.scans(50)
    assert bench.refused(who, "power", on=True)
    assert not bench.operator.levels.power
    bench.engine.drive.faults.estop_ok = True
    bench.scans(1000)
    assert bench.axis.state is not AxisState.STANDSTILL


def test_power_that_is_refused_while_it_goes_off_comes_with_the_next_command_and_not_before() -> None:
    """A level that stayed up would make the next command no edge: answered as done, with the power off."""
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "power", on=False)
    assert bench.refused(who, "power", on=True) == "PWR-04"
    assert not bench.operator.levels.power
    bench.until(AxisState.DISABLED)
    bench.scans(1000)
    assert bench.axis.is_off
    bench.do(who, "power", on=True)
    bench.until(AxisState.STANDSTILL)


def test_an_alarm_takes_key_and_power_and_a_reset_gives_neither_back() -> None:
    bench = Bench()
    jogging(bench)
    bench.engine.drive.faults.estop_ok = False
    bench.scans(20)
    assert not bench.operator.hold.alive
    bench.until(AxisState.ERROR_STOP, 5.0)
    assert not bench.operator.levels.power
    bench.engine.drive.faults.estop_ok = True
    bench.scans(3000)
    epoch = bench.epoch
    bench.do(bench.who(), "reset")
    # What was sent under the alarm was meant for another state.
    assert bench.epoch == epoch + 1
    assert bench.refused(bench.who(), "mode", mode="none", epoch=epoch) == "SEC-03"
    bench.scans(1000)
    assert bench.axis.state is AxisState.DISABLED


def test_commands_of_others_and_old_ones_keep_nobody_in_control() -> None:
    for stale in (False, True):
        bench = Bench()
        who, viewer = bench.who(), bench.who(Role.VIEWER)
        bench.do(who, "take", over=False)
        bench.lively = False
        old = bench.frame(who)
        for _ in range(30):
            bench.scans(100)
            if stale:
                bench.send(who, "halt", frame=old)
            else:
                bench.send(viewer, "acknowledge", id=1)
        assert bench.operator.authority.holder is None


def test_a_paused_motion_ends_with_its_holder() -> None:
    bench = Bench()
    who = bench.who()
    moving(bench)
    bench.do(who, "set", tag="override_percent", value=0.0)
    bench.scans(3000)
    assert bench.axis.paused
    bench.do(who, "give")
    other = bench.who(client="another")
    bench.scans(500)
    assert bench.axis.state is AxisState.STANDSTILL
    bench.do(other, "take", over=False)
    bench.do(other, "set", tag="override_percent", value=100.0)
    assert stays(bench)


def test_control_given_back_lets_the_key_go() -> None:
    bench = Bench()
    jogging(bench)
    bench.do(bench.who(), "give")
    assert not bench.operator.hold.alive
    bench.until(AxisState.STANDSTILL, 5.0)


def test_every_release_of_a_scan_counts() -> None:
    bench = Bench()
    jogging(bench)
    bench.send(bench.who(), "release", lease=OTHER_LEASE)
    bench.send(bench.who(), "release", lease=LEASE)
    bench.scans(1)
    assert not bench.operator.hold.alive


@pytest.mark.parametrize(
    ("kind", "state"), [("stop", AxisState.STANDSTILL), ("quick_stop", AxisState.ERROR_STOP)]
)
def test_stop_keeps_power_and_quick_stop_does_not(kind: str, state: AxisState) -> None:
    bench = Bench()
    moving(bench)
    epoch = bench.epoch
    bench.do(bench.who(Role.VIEWER), kind)
    assert bench.epoch == epoch + 1
    bench.until(state, 5.0)


def test_a_stop_while_power_comes_takes_it_back() -> None:
    bench = Bench()
    who = bench.who()
    bench.do(who, "take", over=False)
    bench.send(who, "power", on=True)
    bench.scans(10)
    bench.do(bench.who(Role.VIEWER), "stop")
    assert not bench.operator.levels.power
    bench.scans(2000)
    assert bench.axis.state is AxisState.DISABLED


def test_the_console_stops_a_jog_before_it_takes_control() -> None:
    bench = Bench()
    jogging(bench)
    epoch = bench.epoch
    bench.do(bench.who(Role.SERVICE, place="local"), "take", over=False)
    assert bench.epoch == epoch + 2  # of the stop, and of the new holder
    assert not bench.operator.hold.alive
    bench.until(AxisState.STANDSTILL, 5.0)


def test_the_console_takes_control_of_an_axis_at_rest_and_stops_nothing() -> None:
    bench = Bench()
    bench.powered(bench.who())
    epoch = bench.epoch
    bench.do(bench.who(Role.SERVICE, place="local"), "take", over=False)
    assert bench.epoch == epoch + 1  # of the new holder, and of no stop


def test_a_shutdown_brakes_on_its_ramp_and_carries_nothing_out() -> None:
    bench = Bench()
    moving(bench)
    bench.operator.shutdown = True
    bench.scans(1)
    # Of the epoch that the stop has begun: nothing but the shutdown stands against it, and who asks is told so.
    speed = bench.operator.levels.speed_rad_s
    assert bench.refused(bench.who(), "set", tag="speed_setting_deg_s", value=1.0) == "SYS-07"
    bench.scans(5)
    assert bench.operator.levels.power  # not while it moves
    assert bench.operator.levels.speed_rad_s == speed
    bench.until(AxisState.DISABLED, 20.0)
    assert bench.axis.at_rest


def test_a_service_reset_uses_what_was_armed() -> None:
    bench = Bench()
    who = bench.who(Role.SERVICE)
    bench.do(who, "take", over=False)
    bench.words[Word.JOURNAL_STATE] = JournalState.LOCKED
    assert bench.refused(who, "reset") == "SEC-10"
    bench.do(who, "arm", action="reset_locked")
    armed = bench.operator.arming.now(bench.epoch, bench.time_s)
    assert isinstance(armed, Armed)
    assert armed.action is Action.RESET_LOCKED
    bench.do(who, "reset")
    assert bench.operator.arming._armed is None


def test_commissioning_begins_with_power_off_and_a_journal_only() -> None:
    bench = Bench()
    who = bench.who(Role.SERVICE)
    bench.operator._on_bus = True
    bench.powered(who)
    assert bench.refused(who, "commission_begin") == "CTL-14"
    bench.do(who, "power", on=False)
    bench.until(AxisState.DISABLED)
    bench.scans(1000)
    assert bench.refused(who, "commission_step", step="identity") == "CTL-14"
    bench.words[Word.JOURNAL_STATE] = JournalState.FAILED
    assert bench.refused(who, "commission_begin") == "JRN-02"
    bench.words[Word.JOURNAL_STATE] = JournalState.OK
    assert not bench.operator.shutdown
    bench.do(who, "commission_begin")
    assert bench.operator.hands_over


def test_a_key_held_too_long_ends_with_that_alarm() -> None:
    bench = Bench()
    jogging(bench)
    bench.operator.hold._began_s -= 29.0
    bench.hold(0.5)
    assert not bench.operator.hold.alive
    assert any(row.code is Code.CTL_21 for row in bench.axis.alarms.history)


def test_a_page_that_goes_without_control_takes_none_along() -> None:
    bench = Bench()
    jogging(bench)
    assert bench.commands[0].put(b'["viewer","viewer","viewer","remote","",{"type":"gone"}]')
    bench.scans(2)
    assert bench.operator.authority.holder == bench.who()
    assert bench.operator.hold.alive
    rows = [json.loads(record) for record in bench.event_ring.peek(100) if record]
    assert not [row for row in rows if "control is free" in row["text"]]


def test_an_increment_goes_the_way_of_its_key() -> None:
    """The other way: `test_an_increment_is_one_edge_and_a_jog_key_never_makes_one`."""
    bench = Bench()
    bench.powered(bench.who(), Mode.INCREMENTAL)
    bench.do(bench.who(), "set", tag="increment_deg", value=0.5)
    bench.do(bench.who(), "increment", direction="forward")
    bench.scans(3000)
    assert deg(bench.axis.virtual.pos_ref_rad) == pytest.approx(0.5, abs=1e-6)


def test_who_takes_control_again_keeps_the_key_that_is_held() -> None:
    """Another screen that takes control ends it; the holder's own page may ask twice."""
    bench = Bench()
    jogging(bench)
    bench.do(bench.who(), "take", over=False)
    assert bench.operator.hold.alive
    bench.do(bench.who(Role.SERVICE, place="local"), "take", over=False)
    assert not bench.operator.hold.alive


@pytest.mark.parametrize(("place", "remote"), [("console", False), ("local", False), ("remote", True)])
def test_the_axis_knows_whether_its_holder_stands_beside_it(place: str, remote: bool) -> None:
    """A screen elsewhere moves slowly without an enabling switch; whoever is at the machine does not."""
    bench = Bench()
    other = bench.who(Role.PHYSICIST, place="console" if remote else "remote")
    bench.do(other, "take", over=False)
    assert bench.operator.levels.remote is not remote
    bench.do(other, "give")
    bench.do(bench.who(place=place), "take", over=False)
    assert bench.operator.levels.remote is remote


def test_the_level_of_a_quick_stop_falls_so_that_the_next_one_is_seen() -> None:
    bench = Bench()
    moving(bench)
    bench.send(bench.who(), "quick_stop")
    levels = []
    for _ in range(6):
        bench.scans(1)
        levels.append(bench.operator.levels.quick_stop)
    assert (any(levels), levels[-1]) == (True, False)


def test_the_level_of_a_stop_stays_until_the_axis_rests() -> None:
    """PLCopen: as long as the level of a stop is up, no other motion begins."""
    bench = Bench()
    moving(bench)
    bench.do(bench.who(), "stop")
    while not bench.axis.virtual.at_rest:
        assert bench.operator.levels.stop
        bench.scans(1)
    bench.scans(4)
    assert not bench.operator.levels.stop
    assert bench.axis.state is AxisState.STANDSTILL


def test_the_highest_speed_setting_is_that_in_force() -> None:
    """Here the axis is limited to 2.5 deg/s, less than the machine file allows; and one person is enough."""
    bench = Bench()
    assert bench.operator.ranges["speed_setting_deg_s"].high == MACHINE.speed.setting_max_deg_s > 2.5
    limited = SimpleNamespace(speed=SimpleNamespace(setting_max_rad_s=rad(2.5)))
    operator = ServiceOperator(
        MACHINE,
        SimpleNamespace(axis=SimpleNamespace(settings=limited)),  # type: ignore[arg-type]
        Inbox(bench.commands, bench.replies, bench.events),
        bench.operator.permit,
        lambda *_: None,
        bench.operator.levels,
        epoch=1,
    )
    assert operator.ranges["speed_setting_deg_s"].high == 2.5
    assert not operator.arming.second_person


def test_power_off_lets_the_key_go() -> None:
    """A page that goes on renewing must not move the axis when power comes again."""
    bench = Bench()
    jogging(bench)
    bench.do(bench.who(), "power", on=False)
    assert not bench.operator.hold.alive
    bench.hold(3.0)
    assert bench.axis.state is AxisState.DISABLED
    bench.do(bench.who(), "power", on=True)
    bench.until(AxisState.STANDSTILL)
    here = bench.axis.virtual.pos_ref_rad
    bench.hold(1.0)
    assert bench.axis.virtual.pos_ref_rad == here
