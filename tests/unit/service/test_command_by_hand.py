"""Single commands by hand: what is left in the ring, what is armed once, what a person reads of an end or a refusal."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.image import Direction
from gantryctl.machine import with_values
from gantryctl.program import AxisState
from gantryctl.service.command import rules
from gantryctl.service.command.authority import Authority
from gantryctl.service.command.inbox import Gone, PendingCommand
from gantryctl.service.command.lease import HoldToRun
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.command.unheld import UnheldPower
from gantryctl.service.protocol.messages import Message, MessageRefused
from gantryctl.service.protocol.roles import Action, Role
from support.service_bench import LEASE, MACHINE, Bench
from unit.service.test_inbox import MARK, Link, pending, who
from unit.service.test_rules import situation


def told(bench: Bench, kind: str) -> list[str]:
    rows = [json.loads(record) for record in bench.event_ring.peek(1000) if record]
    return [row["text"] for row in rows if row["kind"] == kind]


# --- on their way in and out --------------------------------------------------------------------------


def test_commands_beyond_those_of_a_scan_wait_in_their_ring() -> None:
    """Of forty 32 come in the first scan and eight in the next one."""
    link = Link()
    for n in range(40):
        link.send(who(f"page {n}"), type="halt", seq=1, frame=MARK, epoch=7)
    assert [len(link.receive().others), len(link.receive().others)] == [32, 40]


@pytest.mark.parametrize("source", [0, 1])
def test_an_end_is_that_of_a_connection_of_its_source(source: int) -> None:
    link = Link()
    for kind in ("gone", "restart"):
        link.send(who("a"), source, type=kind)
    assert list(link.receive().gone) == [Gone(source, "a", False), Gone(source, "a", True)]
    # Nobody has asked for anything.
    assert (link.answers(source), link.events()) == ([], [])


def test_an_event_has_the_time_of_its_scan_and_a_first_command_may_be_number_0() -> None:
    link = Link()
    link.inbox.time_s = 12.5
    link.inbox.check_sequence(pending("a", seq=0))
    link.inbox.answer(pending("a", seq=0), None, 7)
    (event,) = link.events()
    assert event["values"]["time_s"] == 12.5


def test_a_refusal_of_control_names_who_has_it() -> None:
    authority = Authority(7)
    authority.take(who("page"), over=False, at_rest=True, now_s=100.0)
    for over in (False, True):
        refused = authority.take(who("other"), over=over, at_rest=False, now_s=100.0)
        assert refused is not None
        assert "page" in refused.text
        assert "other" not in refused.text


@pytest.mark.parametrize(("kind", "most_ms"), [("jog", 200), ("renew", 200), ("move", 500)])
def test_an_old_frame_is_told_against_its_own_limit(kind: str, most_ms: int) -> None:
    now = situation(time_s=1.0)
    with pytest.raises(MessageRefused) as refused:
        rules.check_fresh(Message(kind, 1, MARK, now.epoch, {}), now)
    assert "1000 ms" in str(refused.value)
    assert f"{most_ms} ms" in str(refused.value)


# --- what the operator does ---------------------------------------------------------------------------


def test_what_is_armed_is_used_up_by_its_brake_test() -> None:
    bench = Bench()
    operator, one = bench.operator, bench.who(Role.SERVICE)
    operator.arming.arm(Action.BRAKE_TEST, one, bench.epoch, bench.time_s)
    now = operator.situation(bench.time_s, one, bench.time_s)
    operator._give_edge(PendingCommand(0, one, Message("brake_test", 1, MARK, bench.epoch, {})), now)
    assert operator.levels.brake_test
    assert operator.arming.now(bench.epoch, bench.time_s) is None


def test_a_way_has_no_direction_but_its_sign() -> None:
    """Whatever the move before it has asked for."""
    bench = Bench()
    operator, one = bench.operator, bench.who()
    now = operator.situation(bench.time_s, one, bench.time_s)
    levels = []
    for kind, values in (
        ("move", {"target_deg": 10.0, "direction": "negative"}),
        ("move_by", {"distance_deg": 10.0}),
        ("move", {"target_deg": 10.0}),
    ):
        operator._give_edge(PendingCommand(0, one, Message(kind, 1, MARK, bench.epoch, values)), now)
        levels.append((operator.levels.relative, operator.levels.direction))
    assert levels == [(False, Direction.NEGATIVE), (True, None), (False, None)]


def test_a_dead_key_that_is_renewed_is_told_so() -> None:
    bench = Bench()
    one = bench.who()
    bench.powered(one)
    assert bench.refused(one, "renew", lease=LEASE) == "SEC-09"


def test_a_key_that_is_not_renewed_is_told_and_is_no_alarm() -> None:
    """The lease has run out; CTL-21 is for a key that was held for too long."""
    bench = Bench()
    one = bench.who()
    bench.powered(one)
    bench.do(one, "jog", lease=LEASE, direction="forward")
    bench.until(AxisState.STANDSTILL)
    assert [text for text in told(bench, "command") if text.startswith("hold-to-run")] == [
        "hold-to-run: the lease ran out, the axis stops"
    ]
    assert not bench.axis.alarms.history


def test_who_asks_for_control_in_vain_lets_no_key_go() -> None:
    bench = Bench()
    one = bench.who()
    bench.powered(one)
    bench.do(one, "jog", lease=LEASE, direction="forward")
    bench.hold(0.5)
    for over in (False, True):
        bench.refused(bench.who(client="another"), "take", over=over)
        assert bench.operator.hold.alive


def test_who_goes_frees_control_and_is_told() -> None:
    bench = Bench()
    one = bench.who()
    bench.powered(one)
    bench.send(one, "gone")
    bench.scans(2)
    assert bench.operator.authority.holder is None
    *_, last = (json.loads(record) for record in bench.event_ring.peek(1000) if record)
    assert (last["kind"], last["user"]) == ("authority", one.user)
    assert last["text"] == "control is free: the holder has gone"


@pytest.mark.parametrize("asks", [("remote", "console"), ("console", "remote")])
def test_who_asks_for_control_in_vain_changes_no_speed_cap(asks: tuple[str, str]) -> None:
    """The cap is that of the screen that has control, not of the one that has asked for it last."""
    bench = Bench()
    holder, other = (bench.who(client=place, place=place) for place in asks)
    bench.powered(holder)
    bench.engine.drive.faults.enabling_switch = False
    bench.do(holder, "set", tag="speed_setting_deg_s", value=3.0)
    assert bench.refused(other, "take", over=False) == "SEC-07"
    reply = bench.ask(holder, "move", target_deg=20.0)
    assert reply["code"] == ("INT-05" if holder.remote else "")


def test_a_quick_stop_is_no_other_stop_as_well() -> None:
    bench = Bench()
    one = bench.who()
    bench.powered(one)
    bench.do(one, "move", target_deg=20.0)
    bench.scans(500)
    bench.operator.stop(quick=True)
    assert (bench.operator.levels.quick_stop, bench.operator.levels.stop) == (True, False)


def test_a_quick_stop_of_a_brake_test_is_no_other_stop_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench()
    monkeypatch.setattr(ServiceOperator, "_testing", True)
    for quick in (True, False):
        bench.operator.stop(quick=quick)
        assert (bench.operator.levels.quick_stop, bench.operator.levels.stop) == (quick, not quick)
        bench.operator.levels = bench.operator.levels._replace(quick_stop=False, stop=False)


def test_a_brake_test_that_has_ended_by_itself_stops_nothing_later() -> None:
    """Neither the motion of whoever takes control next nor, once more, an axis that is shut down."""
    bench = Bench()
    one, operator = bench.who(), bench.operator
    bench.powered(one)
    operator._test_epoch, operator._test_ended = bench.epoch, False
    bench.do(one, "move", target_deg=20.0)
    operator.authority.new_epoch()
    bench.scans(20)
    assert bench.axis.state is AxisState.DISCRETE_MOTION
    bench.do(one, "stop")
    bench.until(AxisState.STANDSTILL)
    operator._test_epoch, operator._test_ended = bench.epoch, False
    bench.scans(10)
    epoch = bench.epoch
    operator.shutdown = True
    bench.scans(5)
    assert bench.epoch == epoch


def test_a_shutdown_of_a_moving_axis_is_one_stop() -> None:
    """Each stop begins an epoch."""
    bench = Bench()
    one = bench.who()
    bench.powered(one)
    bench.do(one, "move", target_deg=20.0)
    bench.scans(1500)
    epoch = bench.epoch
    bench.operator.shutdown = True
    bench.scans(200)
    assert not bench.axis.at_rest
    assert bench.epoch == epoch + 1


@pytest.mark.parametrize(("now_s", "left_s"), [(100.0, 60.0), (130.0, 30.0), (160.0, 0.0), (161.0, 0.0)])
def test_the_time_that_is_left_without_control_ends_at_zero(now_s: float, left_s: float) -> None:
    axis: Any = SimpleNamespace(at_rest=True, state=AxisState.STANDSTILL)
    authority: Any = SimpleNamespace(holder=None)
    unheld = UnheldPower(axis, authority, 60.0)
    assert math.isnan(unheld.left_s(100.0))
    assert not unheld.due(100.0, power=True)
    assert unheld.left_s(now_s) == left_s


@pytest.mark.parametrize(
    ("level", "off", "on", "done"),
    [
        (True, False, True, True), (True, True, True, False), (False, False, True, False), (False, True, True, False),
        (True, False, False, True), (False, True, False, True),
    ],
)  # fmt: skip
def test_power_that_is_on_or_goes_off_is_answered_at_once_and_power_that_comes_by_the_program(
    monkeypatch: pytest.MonkeyPatch, level: bool, off: bool, on: bool, done: bool
) -> None:
    """What is wanted on and is off has to come again: the program says whether it does."""
    bench = Bench()
    monkeypatch.setattr(type(bench.axis), "is_off", property(lambda _: off))
    bench.operator._set(power=level)
    assert bench.operator._power(on) is done
    assert bench.operator.levels.power is on


@pytest.mark.parametrize(("now_s", "ends"), [(0.0, False), (0.0625, False), (0.125, True), (0.25, True)])
def test_a_lease_ends_in_the_last_scan_before_its_time(now_s: float, ends: bool) -> None:
    """A quarter of a second and scans of an eighth: numbers that are exact. Before the first press no key is held."""
    hold = HoldToRun(0.25, 0.125)
    assert (hold.alive, hold.forward, hold.reverse) == (False, False, False)
    assert hold.begin(LEASE, "page", True, 0.0, 0.0) is None
    assert hold.check(now_s) is ends
    assert hold.alive is not ends


def test_a_key_is_let_go_in_the_last_scan_of_its_lease_whatever_a_scan_lasts() -> None:
    """250 ms, and scans of 10 ms: it may be seen for the last time at 240 ms."""
    hold = Bench(machine=with_values(MACHINE, {"control.scan_period_ms": 10.0})).operator.hold
    hold.begin(LEASE, "page", True, 0.0, 0.0)
    assert not hold.check(0.2399)
    assert hold.check(0.2401)


def test_a_key_that_is_held_is_no_event() -> None:
    bench = Bench()
    one = bench.who()
    bench.powered(one)
    bench.do(one, "jog", lease=LEASE, direction="forward")
    bench.hold(0.2)
    assert not [text for text in told(bench, "command") if text.startswith("hold-to-run")]
