"""What goes on moving and who lets it: pauses by the override, the enabling switch, a key that is never released."""

from __future__ import annotations

import pytest

from gantryctl.image import Mode
from gantryctl.program import AxisState, Code
from gantryctl.service.memory.memory import JournalState, Word
from gantryctl.service.protocol.limits import HELD_S
from gantryctl.service.protocol.messages import Identity, to_record
from gantryctl.units import deg
from support.service_bench import LEASE, RAMP_S, SPEED_DEG_S, Bench

# --- paused by the override, and who goes on ------------------------------------------------------


def paused(bench: Bench, who: Identity, target_deg: float = 20.0) -> None:
    """A move that stands still because the override is 0."""
    bench.powered(who)
    bench.do(who, "set", tag="speed_setting_deg_s", value=SPEED_DEG_S)
    bench.do(who, "move", target_deg=target_deg)
    bench.scans(3000)
    bench.do(who, "set", tag="override_percent", value=0)
    bench.scans(5000)
    assert bench.axis.state is AxisState.DISCRETE_MOTION
    assert bench.axis.virtual.vel_ref_rad_s == 0.0


@pytest.mark.parametrize("how", ["give", "gone", "silent", "local"])
def test_what_stands_still_at_override_0_does_not_wait_for_the_next_holder(how: str) -> None:
    bench = Bench()
    first, second = bench.who(client="first"), bench.who(client="second")
    paused(bench, first)
    match how:
        case "give":
            bench.do(first, "give")
        case "gone":
            assert bench.commands[0].put(to_record(first, {"type": "gone"}))
        case "silent":
            bench.lively = False
            bench.scans(2100)
            bench.lively = True
        case "local":
            second = bench.who(place="local")
    bench.scans(5)
    bench.do(second, "take", over=False)
    bench.scans(100)
    assert bench.axis.state is AxisState.STANDSTILL
    here = bench.axis.virtual.pos_ref_rad
    bench.do(second, "set", tag="override_percent", value=100)
    bench.scans(1000)
    assert bench.axis.virtual.pos_ref_rad == here
    bench.do(second, "move", target_deg=1.0)


def test_raising_the_override_from_0_is_new_motion() -> None:
    bench = Bench()
    who = bench.who()
    paused(bench, who)
    bench.words[Word.JOURNAL_STATE] = JournalState.FULL
    assert bench.refused(who, "set", tag="override_percent", value=100) == "JRN-02"
    bench.words[Word.JOURNAL_STATE] = JournalState.OK
    bench.axis.judge_brake(overdue=True)
    assert bench.refused(who, "set", tag="override_percent", value=100) == "BRK-12"
    assert bench.operator.levels.override == 0.0  # what is shown is what holds
    bench.scans(1000)
    assert bench.axis.virtual.vel_ref_rad_s == 0.0
    bench.axis.judge_brake(overdue=False)
    bench.do(who, "set", tag="override_percent", value=100)
    bench.until(AxisState.STANDSTILL)
    assert deg(bench.axis.pos_act_rad) == pytest.approx(20.0, abs=0.01)  # in-position window


# --- the enabling switch, from the start to the end -----------------------------------------------


def switch(bench: Bench, on: bool) -> None:
    bench.engine.drive.faults.enabling_switch = on


@pytest.mark.parametrize("begun", ["increment", "move"])
def test_letting_go_of_the_enabling_switch_stops_what_is_faster_than_the_cap(begun: str) -> None:
    """An increment from anywhere, and a move that was begun from a remote screen."""
    bench = Bench()
    who = bench.who(place="remote" if begun == "move" else "console")
    bench.powered(who, Mode.INCREMENTAL)
    bench.do(who, "set", tag="speed_setting_deg_s", value=SPEED_DEG_S)
    bench.do(who, "set", tag="increment_deg", value=100.0)
    if begun == "move":
        bench.do(who, "move", target_deg=100.0)
    else:
        bench.do(who, "increment", direction="forward")
    bench.scans(12_000)
    switch(bench, False)
    assert bench.rest_after_s() <= RAMP_S + 0.005
    assert bench.axis.alarms.history[-1].code is Code.INT_05
    assert bench.axis.power.status  # power stays on


def test_a_move_begun_from_a_remote_screen_stays_one_when_control_has_changed() -> None:
    bench = Bench()
    remote, local = bench.who(place="remote"), bench.who()
    bench.powered(remote)
    bench.do(remote, "set", tag="speed_setting_deg_s", value=SPEED_DEG_S)
    bench.do(remote, "move", target_deg=100.0)
    bench.do(remote, "give")
    bench.do(local, "take", over=False)
    bench.scans(5000)
    switch(bench, False)
    assert bench.rest_after_s() <= RAMP_S + 0.005
    bench.do(local, "move", target_deg=0.0)  # a page of this machine needs no switch for a move
    bench.scans(5000)
    assert bench.axis.state is AxisState.DISCRETE_MOTION


def test_slow_motion_needs_no_enabling_switch_and_the_speed_setting_counts_not_the_override() -> None:
    bench = Bench()
    who = bench.who(place="remote")
    bench.powered(who)
    switch(bench, False)
    bench.do(who, "set", tag="speed_setting_deg_s", value=1.0)
    bench.do(who, "move", target_deg=100.0)
    bench.scans(5000)
    assert bench.axis.state is AxisState.DISCRETE_MOTION
    bench.do(who, "stop")
    bench.until(AxisState.STANDSTILL)
    bench.do(who, "set", tag="speed_setting_deg_s", value=6.0)
    bench.do(who, "set", tag="override_percent", value=10)
    assert bench.refused(who, "move", target_deg=100.0) == "INT-05"
    assert bench.refused(who, "jog", lease=LEASE, direction="forward") == "INT-05"


# --- a key that is never released -----------------------------------------------------------------


def test_a_page_that_is_stuck_and_goes_on_renewing_stops_after_30_s() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "jog", lease=LEASE, direction="forward")
    bench.hold(HELD_S - 0.2)
    assert bench.axis.state is AxisState.CONTINUOUS_MOTION
    bench.hold(0.2 + RAMP_S)
    assert bench.axis.state is AxisState.STANDSTILL
    assert bench.axis.alarms.history[-1].code is Code.CTL_21
    reply = bench.ask(who, "renew", lease=LEASE)
    assert (reply["code"], "30 s" in reply["text"]) == ("SEC-09", True)
    bench.do(who, "jog", lease=LEASE[::-1], direction="forward")  # pressed again
