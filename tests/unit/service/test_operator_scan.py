"""One scan of the operator: who has gone, then stops, then commands; and whose words count for what."""

from __future__ import annotations

import json

import pytest

from gantryctl.machine import with_values
from gantryctl.program import AxisState, Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.service.memory.memory import JournalState, Word
from gantryctl.service.protocol.messages import Identity, to_record
from gantryctl.service.protocol.roles import Role
from support.service_bench import LEASE, MACHINE, Bench


def replied(bench: Bench) -> dict[int, str]:
    """Codes of the replies that came, by number of their message."""
    found = {}
    for ring in bench.replies:
        while (record := ring.take()) is not None:
            reply = json.loads(record)[1]
            found[reply["seq"]] = reply["code"]
    return found


def test_a_stop_voids_a_move_of_its_own_scan() -> None:
    """It comes first, whichever was put into the ring first: the move is of the epoch before."""
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    sent = bench.send(who, "move", target_deg=5.0)
    stop = bench.send(bench.who(Role.VIEWER), "stop")
    bench.scans(3)
    found = replied(bench)
    assert (found[sent], found[stop]) == ("SEC-03", "")
    bench.scans(50)
    assert bench.axis.state is AxisState.STANDSTILL
    here = bench.axis.virtual.pos_ref_rad
    bench.scans(2000)
    assert bench.axis.virtual.pos_ref_rad == here


def test_a_stop_acts_in_the_scan_without_edges_behind_a_command() -> None:
    """Other commands wait there, so that each level is seen to fall; a stop waits for nothing."""
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.send(who, "move", target_deg=20.0)
    bench.scans(1)
    waits = bench.send(who, "set", tag="increment_deg", value=2.0)
    stop = bench.send(bench.who(Role.VIEWER), "stop")
    bench.scans(1)
    assert bench.operator.levels.stop
    found = replied(bench)
    assert found[stop] == ""
    assert waits not in found


def test_a_command_that_comes_twice_is_carried_out_once() -> None:
    """Repeated by the network, or by somebody who has seen it: its number is used."""
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "set", tag="increment_deg", value=2.0)
    first = bench.send(who, "set", tag="speed_setting_deg_s", value=3.0)
    bench.scans(3)
    assert replied(bench)[first] == ""
    bench.do(who, "set", tag="speed_setting_deg_s", value=1.0)
    bench.seq = first - 1
    assert bench.send(who, "set", tag="speed_setting_deg_s", value=3.0) == first
    bench.scans(3)
    assert replied(bench)[first] == "SEC-04"
    assert bench.operator.setting("speed_setting_deg_s") == pytest.approx(1.0)


def test_who_has_gone_does_not_keep_control_while_others_send() -> None:
    bench = Bench()
    who = bench.who()
    bench.do(who, "take", over=False)
    bench.send(bench.who(Role.VIEWER), "acknowledge", id=1)
    assert bench.commands[0].put(to_record(who, {"type": "gone"}))
    bench.scans(1)
    assert bench.operator.authority.holder is None


@pytest.mark.parametrize("end", ["gone", "restart"])
def test_who_has_gone_gets_no_control_and_arms_nothing(end: str) -> None:
    """A page is closed behind its last click, or its gateway dies: both come in one scan."""
    bench = Bench(second_person=True)
    tuner = bench.who(Role.PHYSICIST)
    page = Identity("page", "anna", Role.PHYSICIST, "remote", "anna")
    ended = page if end == "gone" else Identity("", "", Role.VIEWER, "web")
    bench.do(tuner, "take", over=False)
    bench.send(page, "arm", action="brake_test")
    assert bench.commands[0].put(to_record(ended, {"type": end}))
    bench.scans(3)
    assert bench.operator.arming.now(bench.epoch, bench.time_s) is None
    bench.ask(tuner, "give")
    bench.send(page, "take", over=False)
    bench.send(page, "power", on=False)
    assert bench.commands[0].put(to_record(ended, {"type": end}))
    bench.scans(5)
    assert bench.operator.authority.holder is None
    # What is no claim of the page is done: it was sent while the page was there.
    assert any(record and b'"power False: done"' in record for record in bench.event_ring.peek(100))


def test_the_end_of_a_page_lets_its_own_key_go_and_no_other() -> None:
    bench = Bench()
    bench.powered(bench.who())
    bench.do(bench.who(), "jog", lease=LEASE, direction="forward")
    bench.hold(1.0)
    assert bench.commands[0].put(to_record(bench.who(Role.VIEWER), {"type": "gone"}))
    bench.scans(2)
    assert bench.operator.hold.alive
    assert bench.commands[0].put(to_record(bench.who(), {"type": "gone"}))
    bench.scans(2)
    assert not bench.operator.hold.alive
    assert not bench.operator.levels.forward


def test_who_takes_control_over_lets_go_the_key_that_is_held_at_the_end_of_travel() -> None:
    """The axis stands there with its key held: nothing else ends the key before its lease."""
    bench = Bench(machine=with_values(MACHINE, {"axis.pos_max_deg": 0.1}))
    bench.powered(bench.who())
    bench.do(bench.who(), "jog", lease=LEASE, direction="forward")
    bench.hold(1.5)
    assert bench.axis.at_rest
    assert bench.operator.levels.forward
    bench.send(bench.who(client="other"), "take", over=True)
    bench.scans(1)
    assert not bench.operator.levels.forward


def test_what_service_may_reset_nobody_resets_after_it() -> None:
    bench = Bench()
    service, operator = bench.who(Role.SERVICE), bench.who()
    bench.do(service, "take", over=False)
    bench.words[Word.JOURNAL_STATE] = JournalState.LOCKED
    bench.do(service, "arm", action="reset_locked")
    bench.do(service, "reset")
    assert bench.program.service
    bench.words[Word.JOURNAL_STATE] = JournalState.OK
    bench.do(service, "give")
    bench.do(operator, "take", over=False)
    bench.do(operator, "reset")
    assert not bench.program.service


def test_power_that_is_on_is_no_new_command() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "mode", mode="none")
    for _ in range(2):
        bench.do(who, "power", on=True)
    assert bench.axis.state is AxisState.STANDSTILL


def test_the_console_that_has_control_does_not_stop_itself() -> None:
    bench = Bench()
    console = bench.who(Role.SERVICE, place="local")
    bench.powered(console)
    bench.do(console, "move", target_deg=20.0)
    bench.scans(1500)
    epoch = bench.epoch
    bench.do(console, "take", over=False)
    assert bench.axis.state is AxisState.DISCRETE_MOTION
    assert bench.epoch - epoch <= 1


def test_who_only_asks_for_control_stops_nobody() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    bench.scans(1500)
    assert bench.refused(bench.who(client="another"), "take", over=True) == "SEC-08"
    bench.scans(100)
    assert bench.axis.state is AxisState.DISCRETE_MOTION


def test_commands_of_several_people_in_one_scan_are_all_answered() -> None:
    """Ten notes of one scan: eight are looked at in it, the others in the next."""
    bench = Bench()
    who = bench.who()
    bench.do(who, "take", over=False)
    replied(bench)
    sent = [bench.send(who, "note", line=f"line {number}") for number in range(10)]
    bench.scans(1)
    assert len(set(sent) & set(replied(bench))) == 8
    bench.scans(1)
    assert len(set(sent) & set(replied(bench))) == 2


def test_the_round_trip_is_that_of_the_holder() -> None:
    """Who has no control says nothing of how old the commands of the holder are."""
    bench = Bench()
    who, other = bench.who(), bench.who(Role.VIEWER)
    bench.do(who, "take", over=False)
    trip = bench.operator.authority.round_trip
    before = trip.shortest_s(bench.time_s)
    bench.operator.situation(bench.time_s, other, bench.time_s - 0.0001)
    assert trip.shortest_s(bench.time_s) == before
    now = bench.operator.situation(bench.time_s, who, bench.time_s - 0.0001)
    assert now.round_trip_s == pytest.approx(0.0001)
    assert trip.shortest_s(bench.time_s) == pytest.approx(0.0001)


def test_a_stop_lets_the_key_go() -> None:
    bench = Bench()
    bench.powered(bench.who())
    bench.do(bench.who(), "jog", lease=LEASE, direction="forward")
    bench.hold(1.0)
    bench.send(bench.who(Role.VIEWER), "stop")
    bench.scans(1)
    assert not bench.operator.hold.alive
    assert not bench.operator.levels.forward


def test_a_stop_without_power_asks_nothing_of_the_program() -> None:
    bench = Bench()
    bench.scans(5)
    refusals = bench.axis.refusal_count
    bench.send(bench.who(Role.VIEWER), "stop")
    for _ in range(4):
        bench.scans(1)
        assert not bench.operator.levels.stop
    assert bench.axis.refusal_count == refusals


def test_only_a_row_that_is_there_is_marked_as_seen() -> None:
    bench = Bench()
    who = bench.who()
    assert bench.refused(who, "acknowledge", id=1) == "SEC-05"
    seen: list[tuple[int, str]] = []
    bench.operator._acknowledge = lambda number, by: seen.append((number, by.user))
    bench.do(who, "acknowledge", id=7)
    assert seen == [(7, who.user)]


def test_a_shutdown_hands_over_to_nobody() -> None:
    bench = Bench()
    assert not bench.operator.hands_over
    bench.operator.shutdown = True
    bench.scans(5)
    assert not bench.operator.hands_over


def test_a_key_that_is_not_renewed_is_let_go_after_its_lease() -> None:
    """[monitors] lease_ms = 250, from the issue of the frame that the last renewal named: at most 30 ms before it."""
    bench = Bench()
    bench.powered(bench.who())
    bench.do(bench.who(), "jog", lease=LEASE, direction="forward")
    bench.hold(1.0)
    silent_ms = 0
    while bench.operator.hold.alive:
        bench.scans(1)
        silent_ms += 1
    assert 190 <= silent_ms <= 251


def test_a_reset_clears_what_stood_against_power_before_this_run() -> None:
    bench = Bench()
    who = bench.who()
    bench.operator.permit.reasons = (Reason(Code.SYS_12, {"stopped_by": "CTL-03"}, ClearedBy.RESET),)
    bench.do(who, "take", over=False)
    assert bench.refused(who, "power", on=True) == "PWR-04"
    bench.do(who, "reset")
    assert (bench.operator.permit.resets, bench.operator.permit.reasons) == (1, ())
    bench.do(who, "power", on=True)


@pytest.mark.parametrize("moving", [True, False])
def test_a_shutdown_lets_the_key_go(moving: bool) -> None:
    """Also the key of an axis that stands: nothing moves it in its last scans."""
    bench = Bench()
    bench.powered(bench.who())
    if moving:
        bench.do(bench.who(), "jog", lease=LEASE, direction="forward")
        bench.hold(0.5)
    else:
        bench.operator.hold.begin(LEASE, bench.who().client, True, bench.time_s, bench.time_s)
    assert bench.operator.hold.alive
    bench.operator.shutdown = True
    bench.scans(1)
    assert not bench.operator.hold.alive
    assert not bench.operator.levels.forward


def test_a_shutdown_while_power_goes_stops_nothing_more() -> None:
    """Its power is off already: another stop would void commands again and again, and end no sooner."""
    bench = Bench()
    bench.powered(bench.who())
    bench.do(bench.who(), "move", target_deg=20.0)
    bench.scans(3000)
    bench.do(bench.who(), "power", on=False)
    bench.scans(20)
    assert not bench.operator.levels.power
    assert not bench.axis.at_rest
    epoch = bench.epoch
    bench.operator.shutdown = True
    bench.scans(20)
    assert bench.epoch == epoch


def test_refusals_that_repeat_are_told_with_their_number() -> None:
    """The first at once, the four others as one row ten seconds later."""
    bench = Bench(machine=with_values(MACHINE, {"control.scan_period_ms": 10.0}))
    for _ in range(5):
        bench.refused(bench.who(), "power", on=True)
    bench.scans(1010)
    rows = [json.loads(record) for record in bench.event_ring.peek(100) if record]
    refused = [row["values"].get("count") for row in rows if "power" in row["text"]]
    assert refused == [None, 4]


def test_what_needs_no_answer_of_the_program_holds_nothing_up() -> None:
    """Settings, a mode that is chosen already and power that goes are answered in their scan."""
    bench = Bench()
    who = bench.who(Role.PHYSICIST)
    bench.powered(who)
    replied(bench)
    sent = [
        bench.send(who, "set", tag="speed_setting_deg_s", value=1.0),
        bench.send(who, "set", tag="acc_setting_deg_s2", value=0.3),
        bench.send(who, "mode", mode="continuous"),
        bench.send(who, "power", on=True),
        bench.send(who, "power", on=False),
        bench.send(who, "note", line="the last one"),
    ]
    bench.scans(1)
    assert replied(bench) == dict.fromkeys(sent, "")


def test_a_setting_is_told_with_its_time_and_with_what_it_was_to_six_places() -> None:
    bench = Bench()
    who = bench.who(Role.PHYSICIST)
    bench.do(who, "take", over=False)
    for value in (2.0 / 3.0, 1.0):
        bench.do(who, "set", tag="increment_deg", value=value)
    rows = [json.loads(record) for record in bench.event_ring.peek(100) if record]
    assert rows[-1]["values"]["before"] == 0.666667
    # With the time of its scan, by which a run can be done again; two more have passed until the reply was read.
    assert rows[-1]["values"]["time_s"] == pytest.approx(bench.time_s - 0.003)


def test_a_sign_of_life_behind_an_old_picture_is_as_good_as_not_sent() -> None:
    """No refusal either: after a freeze of the network they come in a burst, and a newer one comes with them."""
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "jog", lease=LEASE, direction="forward")
    old = bench.frame(who)
    for kind, later_ms, values in (("renew", 210, {"lease": LEASE}), ("alive", 300, {})):
        bench.scans(later_ms)
        number = bench.send(who, kind, frame=old, **values)
        bench.scans(1)
        assert number not in replied(bench)
    assert not bench.operator.hold.alive
