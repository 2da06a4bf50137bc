"""Commands to a commissioning in the controller's place: who may what, and what stops the step under way."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import Commissioning, Outcome, StepResult
from gantryctl.commissioning.in_service.board import Board
from gantryctl.commissioning.in_service.desk import Desk
from gantryctl.operation.client import Stop
from gantryctl.service.memory.memory import JournalState, SharedMemory, Source, Word
from gantryctl.service.protocol.limits import ARMED_S, SILENCE_S, VIEW_MAX_S, WATCHED_S
from gantryctl.service.protocol.messages import Identity, to_record
from gantryctl.service.protocol.roles import Role
from unit.commissioning.desk_room import ANNA, LOOK_S, MACHINE, OTHER, REMOTE, VIEWER, Room


def test_only_service_with_control_begins_a_step(room: Room) -> None:
    for role in Role:
        who = Identity(role, role, role, "console")
        expected = "SEC-07" if role is Role.SERVICE else "SEC-01"
        assert room.ask(who, "commission_step", step="identity") == expected
        assert room.ask(who, "commission_end") == expected
    room.begun()
    assert (room.tags["commissioning"], room.tags["commissioning_step"]) == ("running", "identity")
    assert room.tags["authority_user"] == "anna"


def replies(room: Room) -> list[str]:
    """Codes of all replies that wait."""
    found = []
    while (record := room.memory.replies[Source.WEB].take()) is not None:
        found.append(str(json.loads(record)[1]["code"]))
    return found


def test_the_same_order_twice_is_one(room: Room) -> None:
    """As a network or a page repeats it: the number of a command is used once by its connection."""
    assert room.ask(ANNA, "take", over=False) == ""
    room._seq += 1
    epoch = room.desk.authority.epoch
    order = {"type": "commission_step", "seq": room._seq, "epoch": epoch, "step": "identity"}
    for code, phase in (("", "running"), ("SEC-04", "waiting")):
        order["frame"] = room.mark(ANNA)
        assert room.memory.commands[Source.WEB].put(to_record(ANNA, order))
        room.go(LOOK_S)
        assert replies(room)[0] == code
        assert room.tags["commissioning"] == phase
        room.desk.step_ended()
    assert room.desk.next_order() is not None
    assert room.desk._orders.empty()


def test_an_order_by_an_old_picture_or_from_before_a_stop_begins_nothing(room: Room) -> None:
    assert room.ask(ANNA, "take", over=False) == ""
    old, epoch = room.mark(ANNA), room.desk.authority.epoch
    room.go(VIEW_MAX_S + 0.1)
    assert room.ask(ANNA, "commission_step", step="identity", frame=old) == "SEC-02"
    assert room.ask(VIEWER, "stop") == ""
    room._seq += 1
    late: dict[str, Any] = {"type": "commission_step", "seq": room._seq, "step": "identity"}
    late |= {"frame": room.mark(ANNA), "epoch": epoch}
    assert room.memory.commands[Source.WEB].put(to_record(ANNA, late))
    room.go(LOOK_S)
    assert replies(room) == ["SEC-03"]
    assert room.desk._orders.empty()


def test_what_was_sent_to_the_controller_is_nothing_for_the_desk(work: Commissioning) -> None:
    memory = SharedMemory.create()
    for ring in memory.commands:
        assert ring.put(to_record(ANNA, {"type": "take", "seq": 1, "over": False}))
    Desk(MACHINE, memory, Board(memory), lambda: None)
    assert [len(ring) for ring in memory.commands] == [0] * len(memory.commands)
    memory.close()


def test_the_console_takes_control_from_afar_and_ends_the_step_there(room: Room) -> None:
    """What moves nothing may run from anywhere: nobody watches it any more then."""
    room.begun(who=REMOTE)
    here = Identity("l", "anna", Role.SERVICE, "local")
    assert room.ask(here, "take", over=True) == ""
    assert room.desk.halt.why == "anna took control"


def test_who_takes_control_again_ends_no_step_of_hers(room: Room) -> None:
    here = Identity("l", "anna", Role.SERVICE, "local")
    room.begun(who=here)
    room.ask(here, "take", over=False)
    assert not room.desk.halt.asked()


def test_a_stop_with_no_step_stops_none(room: Room) -> None:
    """The next one begins as if nobody had asked."""
    assert room.ask(VIEWER, "stop") == ""
    assert not room.desk.halt.asked()


def test_the_journal_says_why_a_step_was_stopped(room: Room) -> None:
    told: list[str] = []
    put = room.desk.events.put

    def keep(kind: str, text: str, *who: Any, **values: Any) -> None:
        told.append(text)
        put(kind, text, *who, **values)

    room.desk.events.put = keep  # type: ignore[method-assign, assignment]
    room.begun()
    room.ask(VIEWER, "stop")
    # A second push of the same button is no other stop, and no other reason.
    room.ask(OTHER, "stop")
    assert [text for text in told if "is stopped" in text] == ["step identity is stopped: stopped by vera"]
    assert room.desk.halt.why == "stopped by vera"
    # What the thread of the step has to tell goes there too.
    room.desk.tell("command", "step identity began")
    room.go(LOOK_S)
    assert told[-1] == "step identity began"


@pytest.mark.parametrize(("armed_by", "code"), [("otto", ""), ("anna", "SEC-10")])
def test_where_a_second_person_is_wanted_another_one_arms(
    work: Commissioning, monkeypatch: pytest.MonkeyPatch, armed_by: str, code: str
) -> None:
    anna, otto = (Identity(name, name, Role.SERVICE, "console", name) for name in ("anna", "otto"))
    room = Room(work, second_person=True)
    monkeypatch.setattr(room.board, "check_turn", lambda step: None)
    assert room.ask(anna, "take", over=False) == ""
    assert room.ask(otto if armed_by == "otto" else anna, "arm", action="commission", step="velocity") == ""
    assert room.ask(anna, "commission_step", step="velocity") == code


@pytest.mark.parametrize("second_person", [False, True])
def test_only_the_step_that_was_armed_may_run(
    work: Commissioning, monkeypatch: pytest.MonkeyPatch, second_person: bool
) -> None:
    """Who armed has read what that step could move: of the slow turn, all of the travel."""
    anna, otto = (Identity(name, name, Role.SERVICE, "console", name) for name in ("anna", "otto"))
    room = Room(work, second_person=second_person)
    monkeypatch.setattr(room.board, "check_turn", lambda step: None)
    armer = otto if second_person else anna
    assert room.ask(anna, "take", over=False) == ""
    assert room.ask(armer, "arm", action="commission", step="velocity") == ""
    assert room.ask(anna, "commission_step", step="stops") == "SEC-10"
    # The one that was armed still may: a refusal uses nothing up.
    assert room.ask(anna, "commission_step", step="velocity") == ""


def test_a_step_that_the_page_does_not_have_is_not_armed(free_room: Room) -> None:
    assert free_room.ask(ANNA, "arm", action="commission", step="accuracy") == "CTL-14"
    assert free_room.tags["armed_action"] == "none"


def test_a_note_can_be_written_while_a_step_runs(room: Room) -> None:
    room.begun()
    assert room.ask(ANNA, "note", line="the brake smells") == ""


def test_a_second_client_is_refused(room: Room) -> None:
    room.begun()
    assert room.ask(OTHER, "commission_step", step="identity") == "SEC-07"
    assert room.ask(OTHER, "take", over=False) == "SEC-07"
    assert room.ask(ANNA, "commission_step", step="identity") == "CTL-14"
    assert room.ask(ANNA, "commission_end") == "CTL-14"


def test_steps_have_their_turn_and_the_axis_no_other_commands(room: Room) -> None:
    assert room.ask(ANNA, "take", over=False) == ""
    assert room.ask(ANNA, "commission_step", step="encoder") == "CTL-14"
    assert room.ask(ANNA, "commission_step", step="nothing") == "CTL-14"
    # Hands at the inputs and an instrument at the load are beside no page.
    assert room.ask(ANNA, "commission_step", step="wiring") == "CTL-14"
    assert room.ask(ANNA, "commission_step", step="accuracy") == "CTL-14"
    for kind, values in (
        ("power", {"on": True}),
        ("move", {"target_deg": 1.0}),
        ("commission_begin", {}),
        ("reset", {}),
        ("mode", {"mode": "continuous"}),
        ("arm", {"action": "brake_test"}),
    ):
        assert room.ask(ANNA, kind, **values) == "CTL-14", kind


def test_a_step_that_only_pushes_is_armed_at_the_console_too(free_room: Room) -> None:
    for who, code in ((ANNA, "SEC-10"), (REMOTE, "CTL-14")):
        assert free_room.ask(who, "take", over=False) == ""
        assert free_room.ask(who, "commission_step", step="brake") == code
        assert free_room.ask(who, "give") == ""


def test_a_step_that_moves_is_armed_at_the_console(free_room: Room) -> None:
    room = free_room
    assert room.ask(ANNA, "take", over=False) == ""
    assert room.ask(ANNA, "commission_step", step="velocity") == "SEC-10"
    assert room.ask(ANNA, "arm", action="commission", step="velocity") == ""
    room.go(1.01 * ARMED_S)
    assert room.ask(ANNA, "commission_step", step="velocity") == "SEC-10", "too late"
    # A stop by anybody in between: what was armed is void.
    assert room.ask(ANNA, "arm", action="commission", step="velocity") == ""
    assert room.ask(VIEWER, "stop") == ""
    assert room.ask(ANNA, "commission_step", step="velocity") == "SEC-10"
    assert room.ask(ANNA, "give") == ""
    assert room.ask(REMOTE, "take", over=False) == ""
    assert room.ask(REMOTE, "arm", action="commission", step="velocity") == ""
    assert room.ask(REMOTE, "commission_step", step="velocity") == "CTL-14", "not beside the machine"
    # What moves nothing may be begun from anywhere.
    assert room.ask(REMOTE, "commission_step", step="identity") == ""
    assert room.ask(REMOTE, "give") == ""


@pytest.mark.parametrize(("kind", "urgency"), [("stop", Stop.RAMP), ("quick_stop", Stop.QUICK)])
def test_a_stop_from_any_page_ends_the_step(free_room: Room, kind: str, urgency: Stop) -> None:
    free_room.begun("velocity")
    assert free_room.ask(VIEWER, kind) == ""
    assert free_room.desk.halt.urgency is urgency
    assert "vera" in free_room.desk.halt.why


def test_a_key_that_is_let_go_stops_no_step(free_room: Room) -> None:
    """A page sends it whenever a button comes up; what was sent before stays in force."""
    free_room.begun("velocity")
    epoch = free_room.desk.authority.epoch
    assert free_room.ask(ANNA, "release", lease="00000000000000aa") == ""
    assert not free_room.desk.halt.asked()
    assert free_room.desk.authority.epoch == epoch


def test_of_two_stops_the_harder_counts(free_room: Room) -> None:
    free_room.begun("velocity")
    for kind, urgency in (("stop", Stop.RAMP), ("quick_stop", Stop.QUICK), ("stop", Stop.QUICK)):
        assert free_room.ask(VIEWER, kind) == ""
        assert free_room.desk.halt.urgency is urgency


def held(room: Room) -> tuple[SimpleNamespace, list[str]]:
    """A step whose run is closed and goes on while torque alone holds the load; the run, and what is told."""
    room.begun("velocity")
    run = SimpleNamespace(stop=Stop.NO, load_is_held=lambda: True)
    room.desk.halt._run = run  # type: ignore[assignment]
    told: list[str] = []
    room.desk.events.put = lambda kind, text, *who, **values: told.append(text)  # type: ignore[method-assign]
    room.go(LOOK_S)
    return run, told


def test_two_stops_at_the_page_let_go_a_load_that_torque_alone_holds(free_room: Room) -> None:
    run, told = held(free_room)
    # It is told once, however often the desk looks.
    free_room.go(1.0)
    assert told == ["step velocity: torque alone holds the load; two requests to stop let it go"]
    assert free_room.tags["power_phase"] == "torque_hold"
    for wanted in (Stop.RAMP, Stop.QUICK):
        assert free_room.ask(VIEWER, "stop") == ""
        assert run.stop is wanted


def test_two_people_who_press_once_each_let_no_load_go(free_room: Room) -> None:
    """Both see the alarm and press: nobody has asked twice. The next press of one of them is a second one."""
    run, _ = held(free_room)
    free_room.send(VIEWER, "stop")
    assert free_room.ask(OTHER, "stop") == ""
    assert free_room.ask(ANNA, "quick_stop") == ""
    assert run.stop is Stop.RAMP
    assert free_room.ask(OTHER, "stop") == ""
    assert run.stop is Stop.QUICK


def test_how_a_step_ended_is_told_of_whoever_began_it(free_room: Room) -> None:
    """Somebody else has taken control meanwhile; what is no step's is that of the holder."""
    free_room.begun("identity", ANNA)
    assert free_room.ask(OTHER, "take", over=True) == ""
    told: list[tuple[str, str]] = []
    free_room.desk.events.put = lambda kind, text, who, **values: told.append((text, who.user))  # type: ignore[method-assign]
    free_room.desk.tell_of_step("command", "step identity passed", step="identity", by=free_room.desk.by)
    free_room.desk.step_ended()
    free_room.desk.tell("service", "commissioning report")
    free_room.go(LOOK_S)
    assert told == [("step identity passed", "anna"), ("commissioning report", "otto")]


def test_a_page_that_falls_silent_lets_no_load_go(free_room: Room) -> None:
    run, _ = held(free_room)
    free_room.lively = False
    free_room.go(SILENCE_S + 1.0)
    assert run.stop is not Stop.QUICK


def test_a_service_that_ends_lets_a_load_go_that_torque_alone_holds(free_room: Room) -> None:
    """Killed after 25 s it would keep nothing: the next start would not know of the brake."""
    run, _ = held(free_room)
    free_room.desk.end("the service ends")
    stops = []
    for seconds in (9.9, 0.2):
        free_room.go(seconds)
        stops.append(run.stop)
    assert stops == [Stop.RAMP, Stop.QUICK]


def test_each_step_is_that_of_whoever_began_it(room: Room) -> None:
    for who in (ANNA, OTHER):
        room.begun(who=who)
        assert room.desk.by == who.user
        room.desk.step_ended()
        assert room.ask(who, "give") == ""


def test_a_step_that_ends_with_the_service_is_the_last_one(free_room: Room) -> None:
    free_room.begun("velocity")
    free_room.desk.end("the service ends")
    free_room.desk.step_ended()
    assert free_room.desk.next_order() is None
    assert free_room.tags["commissioning"] == "ending"


def test_a_stop_is_heard_behind_a_flood_of_commands(free_room: Room) -> None:
    free_room.begun("velocity")
    for _ in range(100):
        free_room.send(REMOTE, "commission_end")
    free_room.send(VIEWER, "stop")
    # 32 records of the ring in a look.
    free_room.go(4 * LOOK_S)
    assert free_room.desk.halt.asked()


@pytest.mark.parametrize("key", ["identity", "velocity"])
def test_a_page_that_is_gone_or_silent_ends_the_step(free_room: Room, key: str) -> None:
    room = free_room
    room.begun(key)
    room.leave(ANNA)
    room.go(LOOK_S)
    assert room.desk.halt.asked()
    room.desk.step_ended()

    room.begun(key)
    room.go(3.0)
    assert not room.desk.halt.asked(), "its page is alive"
    room.lively = False
    room.send(ANNA, "alive")
    room.go(WATCHED_S - 2 * LOOK_S)
    assert not room.desk.halt.asked()
    room.go(4 * LOOK_S)
    assert room.desk.halt.asked()
    room.go(SILENCE_S)
    assert room.desk.authority.holder is None


def test_a_gateway_that_starts_again_ends_the_step(free_room: Room) -> None:
    free_room.begun("velocity")
    nobody = Identity("", "", Role.VIEWER, "web")
    assert free_room.memory.commands[Source.WEB].put(to_record(nobody, {"type": "restart"}))
    free_room.go(LOOK_S)
    assert free_room.desk.halt.asked()


def test_control_that_is_given_back_ends_the_step_and_cannot_be_taken_over_in_motion(free_room: Room) -> None:
    room = free_room
    room.begun("velocity")
    assert room.ask(OTHER, "take", over=True) == "SEC-08"
    assert not room.desk.halt.asked()
    assert room.ask(ANNA, "give") == ""
    assert room.desk.halt.asked()


def test_signs_of_life_with_an_old_picture_do_not_count(free_room: Room) -> None:
    room = free_room
    room.begun("velocity")
    old = room.mark(ANNA)
    room.lively = False
    for _ in range(30):
        room.go(0.05)
        room.send(ANNA, "alive", frame=old)
    assert room.desk.halt.asked()


def test_a_command_with_an_old_picture_is_no_sign_of_life_either(free_room: Room) -> None:
    """Whatever it is: a page that hangs repeats what it has, and nobody looks at it."""
    room = free_room
    room.begun("velocity")
    old = room.mark(ANNA)
    room.lively = False
    for _ in range(30):
        room.go(0.05)
        room.send(ANNA, "note", line="as before", frame=old)
    assert "was silent" in room.desk.halt.why


def test_a_desk_that_has_failed_ends_the_step(free_room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    free_room.begun("velocity")

    def fails() -> None:
        raise RuntimeError("planted")

    monkeypatch.setattr(free_room.desk, "look", fails)
    with pytest.raises(RuntimeError):
        free_room.desk.run()
    assert free_room.desk.halt.asked()
    assert free_room.desk.next_order() is None


def test_what_was_told_before_the_end_is_looked_at(room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    looks: list[str] = []
    monkeypatch.setattr(room.desk, "look", lambda: looks.append("look"))
    room.desk._ended.set()
    room.desk.run()
    assert looks == ["look"]


def test_the_end_is_an_order(room: Room) -> None:
    assert room.ask(ANNA, "take", over=False) == ""
    assert room.ask(ANNA, "commission_end") == ""
    assert room.desk.next_order() is None
    assert room.tags["commissioning"] == "ending"
    assert room.ask(ANNA, "commission_step", step="identity") == "CTL-14"


def test_what_was_armed_is_for_one_step(free_room: Room) -> None:
    free_room.begun("velocity")
    free_room.desk.step_ended()
    assert free_room.ask(ANNA, "commission_step", step="velocity") == "SEC-10"


def test_behind_a_step_that_moved_control_is_taken_over_as_before_it(free_room: Room) -> None:
    free_room.begun("velocity")
    free_room.desk.step_ended()
    assert free_room.ask(OTHER, "take", over=True) == ""


def test_only_round_trips_of_who_has_control_are_measured(
    room: Room, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert room.ask(ANNA, "take", over=False) == ""
    taken: list[float] = []
    round_trip = SimpleNamespace(take=lambda trip_s, now_s: taken.append(trip_s))
    monkeypatch.setattr(room.desk.authority, "round_trip", round_trip)
    for who, issued_s in ((VIEWER, 99.5), (ANNA, 99.75)):
        room.desk._situation(who, issued_s, 100.0)
    assert taken == [0.25]


def test_an_end_stays_an_end_when_the_drive_is_set_up_behind_it(work: Commissioning) -> None:
    """A signal comes while the drive is being set up."""
    room = Room(work)
    desk = Desk(MACHINE, room.memory, room.board, lambda: None, now=lambda: room.now_s)
    assert not desk._situation(ANNA, 100.0, 100.0).shutdown
    desk.end("the service ends")
    desk.set_up()
    assert desk._situation(ANNA, 100.0, 100.0).shutdown


def test_a_step_ends_when_nobody_listens_any_more(free_room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    free_room.begun("velocity")
    halt = free_room.desk.halt
    later_s = halt._now_s() + 60.0
    monkeypatch.setattr(halt, "_now_s", lambda: later_s)
    assert halt.asked()


def test_a_desk_that_looks_is_heard(free_room: Room) -> None:
    """Each look is a sign of life for the step."""
    halt = free_room.desk.halt
    halt._now_s = lambda: 7000.0
    free_room.desk.look()
    assert halt._listened_s == 7000.0


def test_without_a_journal_no_step_begins(room: Room) -> None:
    assert room.ask(ANNA, "take", over=False) == ""
    room.memory.words[Word.JOURNAL_STATE] = JournalState.FAILED
    assert room.ask(ANNA, "commission_step", step="identity") == "JRN-02"


def test_without_room_for_its_events_no_step_begins(room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    assert room.ask(ANNA, "take", over=False) == ""
    monkeypatch.setattr(type(room.desk.events), "room", False)
    assert room.ask(ANNA, "commission_step", step="identity") == "JRN-02"


@pytest.mark.parametrize(("outcome", "code"), [(Outcome.PASSED, ""), (Outcome.FAILED, "CTL-14")])
def test_no_step_rests_on_a_failed_one(
    work: Commissioning, monkeypatch: pytest.MonkeyPatch, outcome: Outcome, code: str
) -> None:
    monkeypatch.setitem(work.progress.results, "identity", StepResult("identity", outcome, ""))
    room = Room(work)
    assert room.ask(ANNA, "take", over=False) == ""
    assert room.ask(ANNA, "commission_step", step="encoder") == code
