"""The operator's end of the rings: what goes first, what waits, what is dropped, and what is answered."""

from __future__ import annotations

import json
from typing import Any

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.service.command.arming import Arming
from gantryctl.service.command.inbox import CommandQueue, Gone, Inbox, PendingCommand
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import Source
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import Identity, Message, MessageRefused, to_record
from gantryctl.service.protocol.roles import Action, Role

MARK = "1-0000000000000000"
LEASE = "00000000000000aa"


def who(client: str, place: str = "remote") -> Identity:
    return Identity(client, client, Role.OPERATOR, place)


def pending(client: str, kind: str = "halt", source: int = 0, seq: int = 1) -> PendingCommand:
    return PendingCommand(source, who(client), Message(kind, seq, MARK, 7, {}))


class Link:
    """An inbox with rings that a test writes and reads."""

    def __init__(self, reply_slot: int = 1024) -> None:
        self.memory = [memoryview(bytearray(192 + 64 * 1024)) for _ in range(2)]
        self.commands = [Ring(each, 1024) for each in self.memory]
        self.replies = [Ring(memoryview(bytearray(192 + 64 * reply_slot)), reply_slot) for _ in range(2)]
        self.journal = Ring(memoryview(bytearray(192 + 4096 * 1024)), 1024)
        self.inbox = Inbox(self.commands, self.replies, EventLog(self.journal))

    def send(self, sender: Identity, source: int = 0, **raw: Any) -> None:
        assert self.commands[source].put(to_record(sender, raw))

    def receive(self, holder: str = "") -> Inbox:
        self.inbox.receive(7, holder)
        return self.inbox

    def answers(self, source: int = 0) -> list[dict[str, Any]]:
        found = []
        while (record := self.replies[source].take()) is not None:
            found.append(json.loads(record)[1])
        return found

    def events(self) -> list[dict[str, Any]]:
        return [json.loads(each) for each in self.journal.peek(1000) if each is not None]


@pytest.mark.parametrize("kind", ["stop", "quick_stop", "release"])
def test_what_stops_waits_behind_nothing(kind: str) -> None:
    link = Link()
    link.send(who("a"), type="halt", seq=1, frame=MARK, epoch=7)
    link.send(who("b"), type=kind, seq=1, **({"lease": LEASE} if kind == "release" else {}))
    found = link.receive()
    assert [each.who.client for each in found.first[kind]] == ["b"]
    assert len(found.others) == 1
    assert not link.receive().first


def test_each_command_is_taken_from_its_ring_once() -> None:
    link = Link()
    for seq in (1, 2, 3):
        link.send(who("a"), type="halt", seq=seq, frame=MARK, epoch=7)
    assert len(link.receive().others) == 3
    assert len(link.receive().others) == 3


def test_records_that_no_gateway_of_ours_has_written_are_passed_over() -> None:
    link = Link()
    link.commands[0].put(b"not json")
    link.commands[0].put(b"[1]")
    link.send(who("a"), type="halt", seq=1, frame=MARK, epoch=7)
    link.send(who("a"), type="halt", seq=2, frame=MARK, epoch=7)
    link.memory[0][192 + 2 * 1024 + 8] ^= 0xFF  # a bit of the third one fell over on its way
    found = link.receive()
    assert [found.others.take().message.seq for _ in range(len(found.others))] == [2]
    assert link.answers() == []


def test_a_message_that_is_not_understood_is_answered_by_its_number() -> None:
    link = Link()
    link.send(who("a"), type="dance", seq=5)
    link.send(who("a"), type="dance", seq="x")
    link.receive()
    assert [(each["seq"], each["code"]) for each in link.answers()] == [(5, "SEC-05"), (0, "SEC-05")]


def test_one_page_may_have_sixteen_waiting_and_its_source_a_hundred_and_twenty_eight() -> None:
    queue = CommandQueue()
    assert all(queue.append(pending("a")) for _ in range(16))
    assert not queue.append(pending("a"))
    assert queue.append(pending("b"))
    # One that is taken makes room for one.
    queue.take()
    assert queue.append(pending("a"))
    assert not queue.append(pending("a"))
    while len(queue):
        queue.take()
    # Places are given back.
    assert all(queue.append(pending("a")) for _ in range(16))
    while len(queue):
        queue.take()
    assert all(queue.append(pending(f"page {n}")) for n in range(128))
    assert not queue.append(pending("one more"))
    # The console of the machine is a source of its own.
    assert queue.append(pending("shell", source=1))


def test_of_signs_of_life_the_newest_waits() -> None:
    queue = CommandQueue()
    for seq in (1, 2, 3):
        assert queue.append(pending("a", "alive", seq=seq))
        assert queue.append(pending("a", "renew", seq=seq))
        assert queue.append(pending("b", "alive", seq=seq))
    found = [queue.take() for _ in range(len(queue))]
    assert [(each.who.client, each.message.kind, each.message.seq) for each in found] == [
        ("a", "alive", 3), ("a", "renew", 3), ("b", "alive", 3),
    ]  # fmt: skip


def test_a_full_queue_is_told() -> None:
    link = Link()
    for seq in range(17):
        link.send(who("a"), type="halt", seq=seq, frame=MARK, epoch=7)
    link.receive()
    assert [(each["seq"], each["code"], each["epoch"]) for each in link.answers()] == [(16, "SEC-06", 7)]


def test_signs_of_life_count_from_the_holder_only_and_a_dead_key_is_told() -> None:
    link = Link()
    link.send(who("a"), type="alive", seq=1, frame=MARK)
    link.send(who("a"), type="renew", seq=2, frame=MARK, epoch=7, lease=LEASE)
    assert len(link.receive("b").others) == 0
    # There is no event of it that the answer would have to wait for.
    assert [(each["seq"], each["code"], each["journal"]) for each in link.answers()] == [(2, "SEC-09", 0)]
    link.send(who("a"), type="alive", seq=3, frame=MARK)
    assert len(link.receive("a").others) == 1


@pytest.mark.parametrize(("seq", "taken"), [(4, False), (5, False), (6, True)])
def test_a_number_counts_once_and_only_upwards(seq: int, taken: bool) -> None:
    link = Link()
    for before in (3, 5):
        link.inbox.check_sequence(pending("a", seq=before))
    link.inbox.check_sequence(pending("b", seq=1))  # every connection counts for itself
    if taken:
        link.inbox.check_sequence(pending("a", seq=seq))
        return
    with pytest.raises(MessageRefused) as refused:
        link.inbox.check_sequence(pending("a", seq=seq))
    assert refused.value.refusal.code == "SEC-04"


def test_the_numbers_of_a_thousand_connections_are_kept_and_those_of_one_that_has_gone_are_not() -> None:
    link = Link()
    for n in range(1025):
        link.inbox.check_sequence(pending(f"page {n}", seq=1))
    with pytest.raises(MessageRefused):
        link.inbox.check_sequence(pending("page 1", seq=1))
    link.inbox.check_sequence(pending("page 0", seq=1))  # forgotten: it was quiet for longest
    link.send(who("page 5"), type="gone")
    assert link.receive().gone[0] == Gone(0, "page 5", False)
    link.inbox.check_sequence(pending("page 5", seq=1))


def test_a_page_that_goes_on_commanding_is_not_forgotten_for_others() -> None:
    """Of 1024 connections that are remembered the one that was quiet for longest goes, not the one that came first."""
    link = Link()
    link.inbox.check_sequence(pending("first", seq=1))
    for n in range(1023):
        link.inbox.check_sequence(pending(f"page {n}", seq=1))
    link.inbox.check_sequence(pending("first", seq=2))
    link.inbox.check_sequence(pending("newcomer", seq=1))
    with pytest.raises(MessageRefused):
        link.inbox.check_sequence(pending("first", seq=2))


def test_the_end_of_a_gateway_is_the_end_of_all_its_connections() -> None:
    link = Link()
    link.send(who("page"), type="restart")
    gone = link.receive().gone.popleft()
    assert gone.everyone
    page, shell = who("page"), who("shell", "local")
    for holder, ended in ((page, "page"), (shell, None), (None, None)):
        assert gone.end(Arming(), holder) == ended
    local = Gone(Source.LOCAL, "", True)
    assert local.end(Arming(), shell) == "shell"
    assert local.end(Arming(), page) is None


def test_a_connection_that_ends_takes_along_what_it_has_armed() -> None:
    for gone, armed in (
        (Gone(Source.WEB, "page", False), False),
        (Gone(Source.WEB, "other", False), True),
        (Gone(Source.WEB, "", True), False),
        (Gone(Source.LOCAL, "", True), True),
    ):
        arming = Arming()
        arming.arm(Action.BRAKE_TEST, who("page"), 7, 100.0)
        assert gone.end(arming, None) == (None if gone.everyone else gone.client)
        assert (arming.now(7, 101.0) is not None) is armed


def test_signs_of_life_get_no_reply_while_all_is_well_and_no_row_of_the_journal() -> None:
    link = Link()
    link.inbox.answer(pending("a", "renew"), None, 7)
    assert (link.answers(), link.events()) == ([], [])
    link.inbox.answer(pending("a", "renew"), MessageRefused(Code.SEC_09, reason="gone"), 7)
    assert [each["code"] for each in link.answers()] == ["SEC-09"]
    assert link.events() == []


def test_the_lease_of_a_press_is_in_no_event() -> None:
    link = Link()
    message = Message("jog", 1, MARK, 7, {"lease": LEASE, "direction": "forward"})
    link.inbox.answer(PendingCommand(0, who("a"), message), None, 7)
    (event,) = link.events()
    assert event["values"]["direction"] == "forward"
    assert LEASE not in json.dumps(event)


def test_stops_of_one_scan_are_one_event_for_each_user_and_a_reply_for_each_page() -> None:
    link = Link()
    together = [pending("a", "stop", seq=n) for n in (1, 2)] + [pending("b", "stop", source=1, seq=9)]
    link.inbox.answer_all(together, 8)
    assert [(each["user"], each["values"].get("count")) for each in link.events()] == [("a", 2), ("b", None)]
    assert [(each["seq"], each["ok"], each["epoch"]) for each in link.answers()] == [
        (1, True, 8), (2, True, 8),
    ]  # fmt: skip
    assert [each["seq"] for each in link.answers(1)] == [9]


def test_stops_of_two_pages_of_a_user_in_one_scan_are_one_event() -> None:
    """Else a user with sixteen pages fills the journal sixteen times as fast."""
    link = Link()
    page, other = pending("a", "stop", seq=1), pending("a2", "stop", seq=5)
    link.inbox.answer_all([page, other._replace(who=other.who._replace(user="a"))], 8)
    assert [(each["user"], each["values"].get("count")) for each in link.events()] == [("a", 2)]
    assert [each["seq"] for each in link.answers()] == [1, 5]


@pytest.mark.parametrize("length", [300, 1000])
def test_a_reply_that_fits_no_slot_goes_without_its_values(length: int) -> None:
    link = Link(reply_slot=512)
    link.inbox.answer(pending("a"), MessageRefused(Code.SEC_05, reason="x" * length), 7)
    (reply,) = link.answers()
    assert (reply["code"], reply["values"]) == ("SEC-05", {})


def test_a_refused_sign_of_life_waits_for_no_event() -> None:
    link = Link()
    refused = MessageRefused(Code.SEC_09, reason="ended")
    link.inbox.answer(pending("a", "renew"), refused, 7)
    assert [(each["code"], each["journal"]) for each in link.answers()] == [("SEC-09", 0)]
    assert not link.events()


def test_a_reply_of_300_characters_is_whole_and_a_longer_one_is_cut() -> None:
    link = Link(reply_slot=2048)
    for length in (200, 1000):
        link.inbox.answer(pending("a"), MessageRefused(Code.SEC_05, reason="x" * length), 7)
    whole, cut = (each["text"] for each in link.answers())
    assert whole.endswith("x" * 200)
    assert len(cut) == 300


@pytest.mark.parametrize(("more", "values"), [(0, True), (1, False)])
def test_a_reply_as_long_as_its_slot_keeps_its_values(more: int, values: bool) -> None:
    """A character of the reason stands in the text and in the values, one of the client's name once."""
    probe = Link(reply_slot=2048)
    probe.inbox.answer(pending("a"), MessageRefused(Code.SEC_05, reason="x"), 7)
    record = probe.replies[0].peek(1)[0]
    assert record is not None
    link = Link(reply_slot=512)
    reason, name = divmod(512 - 8 - len(record), 2)
    client = "a" * (1 + name + more)
    link.inbox.answer(pending(client), MessageRefused(Code.SEC_05, reason="x" * (1 + reason)), 7)
    (reply,) = link.answers()
    assert bool(reply["values"]) is values


def test_a_refusal_has_the_time_of_its_scan_and_its_reply_the_number_of_the_event() -> None:
    link = Link()
    link.inbox.time_s = 12.5
    link.send(who("a"), type="dance", seq=5)
    link.receive()
    link.inbox.answer(pending("b"), MessageRefused(Code.SEC_05, reason="no"), 7)
    assert [(each["user"], each["values"]["time_s"]) for each in link.events()] == [("a", 12.5), ("b", 12.5)]
    assert [(each["seq"], each["journal"]) for each in link.answers()] == [(5, 1), (1, 2)]


def test_a_note_is_an_event_with_its_line_and_the_time_of_its_scan() -> None:
    link = Link()
    link.inbox.time_s = 12.5
    link.inbox.answer(
        PendingCommand(0, who("a"), Message("note", 1, MARK, 7, {"line": "oil changed"})), None, 7
    )
    (event,) = link.events()
    assert (event["kind"], event["text"], event["values"]) == ("note", "oil changed", {"time_s": 12.5})
    assert [each["journal"] for each in link.answers()] == [1]


def test_the_end_of_a_connection_frees_no_number_of_another_one() -> None:
    link = Link()
    link.inbox.check_sequence(pending("a", seq=5))
    link.send(who("b"), type="gone")
    link.receive()
    with pytest.raises(MessageRefused):
        link.inbox.check_sequence(pending("a", seq=5))


def test_a_sign_of_life_that_a_newer_one_replaces_gives_its_place_back() -> None:
    queue = CommandQueue()
    for seq in range(40):
        assert queue.append(pending("a", "alive", seq=seq))
    for seq in range(15):
        assert queue.append(pending("a", "halt", seq=seq))
    assert not queue.append(pending("a", "halt", seq=15))
    assert len(queue) == 16
