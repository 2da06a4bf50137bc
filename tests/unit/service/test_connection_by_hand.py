"""One connection at a time of its own: what of it reaches the controller, what comes back, and what is shown when."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.service.clients import hub as module
from gantryctl.service.clients.console_link import LinkGiver, LinkTaker
from gantryctl.service.clients.hub import Client, Flooded, Hub
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import FAST, publish_fast, publish_json
from gantryctl.service.protocol import messages
from gantryctl.service.protocol.messages import Identity, compact, reply_to
from gantryctl.service.protocol.roles import Role, rights_of
from support.marks import UNKNOWN
from support.slow_network import shared_memory

LEASE = "00000000000000aa"
COMMAND = {"type": "mode", "mode": "continuous", "frame": UNKNOWN, "epoch": 3}


class Desk:
    """A hub, and the controller's ends of its rings."""

    def __init__(self, memory: SharedMemory) -> None:
        self.memory, self.now_s = memory, 100.0
        memory.words[Word.LEASE_MS] = 250
        self.hub = Hub(memory, Source.WEB, lambda: self.now_s)
        self.began = self.took()

    def took(self) -> list[tuple[Identity, dict[str, Any]]]:
        """Take what has come for the controller."""
        ring, found = self.memory.commands[Source.WEB], []
        while (record := ring.take()) is not None:
            found.append(messages.from_record(record))
        return found

    def answers(self, client: Client, *numbers: int, epoch: int = 4) -> None:
        for seq in numbers:
            record = compact([client.who.client, reply_to(seq, epoch=epoch)])
            assert self.memory.replies[Source.WEB].put(record.encode())
        self.hub.pass_replies()

    def publish(self, *, issued_ms: int = 0, epoch: int = 0, **slow: Any) -> None:
        fast = {**dict.fromkeys(FAST, 0.0), "issued_ms": float(issued_ms), "epoch": float(epoch)}
        publish_fast(self.memory.fast, fast, 5)
        if slow:
            publish_json(self.memory.slow, slow)

    def look(self, later_s: float = 0.0) -> float:
        self.now_s += later_s
        return self.hub.look()


@pytest.fixture
def desk() -> Iterator[Desk]:
    with shared_memory() as memory:
        yield Desk(memory)


def sent(client: Client, kind: str = "reply") -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = [json.loads(text) for text in client.outgoing()]
    return [each for each in found if each["type"] == kind]


def say(client: Client, seq: int, **message: Any) -> None:
    client.take(json.dumps({**COMMAND, "seq": seq} if not message else {"seq": seq, **message}))


# --- on the way to the controller ---------------------------------------------------------------------


def test_a_gateway_that_starts_ends_the_connections_of_the_one_before(desk: Desk) -> None:
    """Their keys and their control with them: nobody else can let them go."""
    assert [message for _, message in desk.began] == [{"type": "restart"}]


def test_a_command_reaches_the_controller_whole_and_with_its_sender(desk: Desk) -> None:
    client = desk.hub.connect("anna.s", Role.SERVICE, "console", "anna")
    say(client, 7)
    ((who, message),) = desk.took()
    assert who == Identity(client.who.client, "anna.s", Role.SERVICE, "console", "anna")
    assert message == {**COMMAND, "seq": 7}
    assert len({desk.hub.connect("anna.s", Role.SERVICE, "console").who.client for _ in range(20)}) == 20


def test_a_command_that_finds_no_place_is_refused(desk: Desk) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    while desk.memory.commands[Source.WEB].put(b"waits"):
        pass
    say(client, 7)
    (reply,) = sent(client)
    assert (reply["seq"], reply["ok"], reply["code"]) == (7, False, "SYS-11")
    assert not client.waiting


@pytest.mark.parametrize(("seq", "answered"), [(5, 5), ("5", 0)])
def test_the_refusal_of_what_was_not_understood_names_its_number(desk: Desk, seq: Any, answered: int) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    say(client, seq, type="dance")
    (reply,) = sent(client)
    assert (reply["seq"], reply["code"]) == (answered, "SEC-05")
    (row,) = [json.loads(record) for record in desk.memory.events[Source.WEB].peek(9) if record]
    assert (row["user"], row["client"]) == ("anna", client.who.client)


def test_signs_of_life_that_are_too_many_are_dropped_and_a_flood_ends_the_connection(desk: Desk) -> None:
    """A hundred of a kind, at once; of all messages two hundred, after which it is closed."""
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    for seq in range(200):
        say(client, seq, type="alive", frame=UNKNOWN)
    assert len(desk.took()) == 100
    assert sent(client) == []
    with pytest.raises(Flooded):
        say(client, 200, type="alive", frame=UNKNOWN)


# --- and back -----------------------------------------------------------------------------------------


def test_a_command_is_unanswered_after_a_second_and_a_sign_of_life_never(desk: Desk) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    say(client, 7)
    for seq, kind in enumerate(("alive", "renew"), 8):
        say(
            client, seq, type=kind, frame=UNKNOWN, **({"lease": LEASE, "epoch": 3} if kind == "renew" else {})
        )
    desk.look(0.95)
    assert sent(client) == []
    desk.look(0.1)
    assert [(each["seq"], each["code"]) for each in sent(client)] == [(7, "SYS-11")]
    say(client, 10)
    desk.answers(client, 10)
    desk.look(2.0)
    assert [(each["seq"], each["ok"]) for each in sent(client)] == [(10, True)]


def test_replies_go_out_at_once_in_their_order_and_once(desk: Desk) -> None:
    other, client = (desk.hub.connect(user, Role.OPERATOR, "console") for user in ("ben", "anna"))
    for page in (client, other):
        page.outgoing()
    say(client, 1)
    say(client, 2)
    desk.answers(client, 1, 2)
    assert client.wake.is_set()
    assert not other.wake.is_set()
    assert [each["seq"] for each in sent(client)] == [1, 2]
    assert not client.wake.is_set()
    assert client.outgoing() == other.outgoing() == []


def test_a_damaged_reply_takes_no_other_along(desk: Desk) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    say(client, 1)
    desk.memory.replies[Source.WEB].put(b"torn")
    desk.answers(client, 1)
    assert [each["seq"] for each in sent(client)] == [1]


# --- what is shown ------------------------------------------------------------------------------------


def test_a_frame_goes_out_once_and_what_is_sent_on_change_when_it_has_changed(desk: Desk) -> None:
    client = desk.hub.connect("anna", Role.VIEWER, "console")
    found = []
    for issued_ms, slow in ((50, {"machine": "a"}), (100, {}), (150, {"machine": "b"}), (200, {})):
        desk.publish(issued_ms=issued_ms, **slow)
        desk.look(0.05)
        (status,) = sent(client, "status")
        assert sent(client, "status") == []
        assert int(status["frame"].split("-")[0]) == status["tags"]["issued_ms"] == issued_ms
        found.append(status["tags"].get("machine"))
    assert found == ["a", None, "b", None]


def test_before_the_first_picture_nothing_is_fresh_and_an_old_one_has_its_age(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.look()
    assert (desk.hub.status()["fresh"], desk.hub.status()["age_ms"]) == (False, None)
    monkeypatch.setattr(desk.hub._snapshot, "fast", lambda: ({}, 1234.56))
    desk.look()
    assert (desk.hub.status()["fresh"], desk.hub.status()["age_ms"]) == (False, 1234.6)


def test_frames_come_every_50_ms_and_in_no_burst_behind_a_pause(desk: Desk) -> None:
    client = desk.hub.connect("anna", Role.VIEWER, "console")
    due = []
    for later_s in (0.0, 0.02, 0.03, 10.0, 0.001, 0.05):
        left_s = desk.look(later_s)
        due.append((client._due, round(left_s, 3)))
        client.outgoing()
    # Behind the pause one comes at once, the next with the next look, and then again one in 50 ms.
    assert due == [(True, 0.05), (False, 0.03), (True, 0.05), (True, 0.0), (True, 0.049), (True, 0.049)]


@pytest.mark.parametrize(
    ("holder", "kind", "quick"), [(True, "jog", True), (True, "renew", True), (False, "jog", False)]
)
def test_only_the_screen_that_has_control_gets_quick_frames_while_it_holds_a_key(
    desk: Desk, holder: bool, kind: str, quick: bool
) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    other = desk.hub.connect("ben", Role.OPERATOR, "console")
    desk.publish(authority_client=(client if holder else other).who.client)
    desk.look()
    direction = {"direction": "forward"} if kind == "jog" else {}
    say(client, 1, type=kind, frame=UNKNOWN, epoch=3, lease=LEASE, **direction)
    assert desk.hub._hurried.is_set() is (kind == "jog")
    for page in (client, other):
        page.outgoing()
    assert desk.look() == pytest.approx(0.02 if quick else 0.05)
    assert [client._due, other._due] == [quick, False]
    say(client, 2, type="release", lease=LEASE)
    assert not client.holds_key(desk.now_s)
    assert desk.look(0.01) == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("behind", "shown"),
    [(1, False), (9, False), (0, True), (-1, True), (-7, True), (2**39, True), (-(2**39), True)],
    ids=[
        "made before it",
        "long before",
        "of its scan",
        "a stop since",
        "more since",
        "anew, lower",
        "anew, higher",
    ],
)
def test_no_frame_that_was_made_before_a_reply_is_sent_behind_it(
    desk: Desk, behind: int, shown: bool
) -> None:
    """A command that follows a reply at once would name the epoch of that frame: one of 150 was refused so, at load."""
    client, other = (desk.hub.connect(user, Role.OPERATOR, "console") for user in ("anna", "ben"))
    replied = 2**39 + 300
    epoch = replied - behind
    say(client, 7)
    desk.publish(epoch=epoch)
    desk.look(0.05)
    desk.answers(client, 7, epoch=replied)
    frames = [json.loads(text) for text in client.outgoing()]
    assert [frame["seq"] for frame in frames if frame["type"] == "reply"] == [7]
    assert [frame["tags"]["epoch"] for frame in frames if frame["type"] == "status"] == [epoch] * shown
    # It has been told nothing yet, so the frame is the newest that it knows.
    assert [frame["tags"]["epoch"] for frame in sent(other, "status")] == [epoch]
    desk.publish(epoch=replied + 10, mode="continuous")
    desk.look(0.05)
    (frame,) = sent(client, "status")
    # What is sent on change was in the frame that it did not get.
    assert (frame["tags"]["epoch"], frame["tags"]["mode"]) == (replied + 10, "continuous")


def test_a_controller_that_ended_behind_its_reply_is_shown_as_silent(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    say(client, 7)
    desk.publish(epoch=3)
    desk.answers(client, 7)
    monkeypatch.setattr(module.limits, "STALE_S", 0.0)
    desk.look(0.05)
    (frame,) = sent(client, "status")
    assert (frame["fresh"], frame["tags"]["epoch"]) == (False, 3)


def test_the_welcome_says_what_it_counts_by(desk: Desk) -> None:
    who = Identity("c1", "anna.s", Role.PHYSICIST, "console", "anna")
    found = json.loads(desk.hub.welcome(who))
    assert found.pop("version")
    assert found == {
        "type": "welcome", "client": "c1", "user": "anna.s", "person": "anna", "role": "physicist", "place": "console",
        "may": rights_of(Role.PHYSICIST), "frame_ms": 50, "key_frame_ms": 20, "lease_ms": 250, "renew_ms": 30,
        "view_max_ms": 500, "key_view_max_ms": 200, "round_trip_max_ms": 150, "stale_ms": 500,
    }  # fmt: skip


@pytest.mark.parametrize(("source", "process"), [(Source.LOCAL, "supervisor"), (Source.WEB, "gateway")])
def test_each_turn_looks_whether_it_was_held_up_and_for_refusals_that_were_counted(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, source: Source, process: str
) -> None:
    did: list[str] = []

    class Turned(Exception):
        pass

    def refusals() -> None:
        did.append("refusals")
        if len(did) > 4:
            raise Turned

    monkeypatch.setattr(
        module, "HeldUp", lambda name, tell: SimpleNamespace(look=lambda: did.append(f"{name} held up?"))
    )
    hub = Hub(desk.memory, source, lambda: desk.now_s)
    monkeypatch.setattr(hub.refusals, "look", refusals)
    monkeypatch.setattr(hub, "look", lambda: did.append("frames") or 0.0)
    with pytest.raises(Turned):
        asyncio.run(hub._look_on())
    assert did == [f"{process} held up?", "frames", "refusals"] * 2


def test_commissioning_is_told_as_it_is_now(desk: Desk) -> None:
    assert desk.hub.commissioning() is None
    for steps in (1, 2):
        publish_json(desk.memory.commissioning, {"steps": steps})
        assert desk.hub.commissioning() == {"steps": steps}


# --- who makes room -----------------------------------------------------------------------------------


def test_of_the_pages_of_one_user_the_one_that_was_unused_for_longest_makes_room_once(desk: Desk) -> None:
    """Three pages of one user, of which the first one works, and an older one of somebody else."""
    other = desk.hub.connect("ben", Role.OPERATOR, "console")
    pages = []
    for _ in range(3):
        desk.now_s += 1.0
        pages.append(desk.hub.connect("anna", Role.OPERATOR, "console"))
    desk.now_s += 10.0
    say(pages[0], 1)
    for page in pages:
        page.wake.clear()
    assert desk.hub.make_room("anna", 4, 5.0)
    assert not any(page.displaced for page in pages)
    assert desk.hub.make_room("anna", 3, 5.0)
    assert [page.displaced for page in (*pages, other)] == [False, True, False, False]
    assert pages[1].wake.is_set()
    # It has not gone yet, and counts no more.
    assert desk.hub.make_room("anna", 3, 5.0)
    assert [page.displaced for page in pages] == [False, True, False]
    assert desk.hub.make_room("anna", 2, 5.0)
    assert [page.displaced for page in pages] == [False, True, True]


def test_who_leaves_is_told_to_the_controller_once(desk: Desk) -> None:
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    desk.hub.leave(client)
    desk.hub.leave(client)
    assert [(who.client, message) for who, message in desk.took()] == [(client.who.client, {"type": "gone"})]


# --- a link to the console ----------------------------------------------------------------------------


def test_a_link_is_there_when_all_of_it_is() -> None:
    """Whoever reads in between finds none, and not the user of another one."""
    did: list[tuple[Word, int]] = []

    class Words(dict[int, int]):
        def __setitem__(self, word: int, value: int) -> None:
            did.append((Word(word), value))

    words: Any = Words()
    url = LinkGiver(words, "http://localhost/", lambda: 7).give(1000)
    token = did[-1][1]
    assert did == [
        (Word.LINK, 0),
        (Word.LINK_UID, 1000),
        (Word.LINK_UNTIL_NS, 60_000_000_007),
        (Word.LINK, token),
    ]
    assert url == f"http://localhost/api/v1/console/{token:016x}"


def test_the_number_of_no_link_opens_nothing() -> None:
    """It is 0 while the next link is made, with user and time of the one before."""
    words: Any = {Word.LINK: 5, Word.LINK_UID: 1000, Word.LINK_UNTIL_NS: 61_000_000_000}
    taker = LinkTaker(words, lambda: 500_000_000)
    assert taker.take(f"{5:016x}", 1000)
    words[Word.LINK] = 0
    assert not taker.take("0" * 16, 1000)


def test_a_link_opens_once_for_its_own_user_alone() -> None:
    words: Any = {Word.LINK: 5, Word.LINK_UID: 1000, Word.LINK_UNTIL_NS: 61_000_000_000}
    taker = LinkTaker(words, lambda: 500_000_000)
    assert [taker.take(f"{5:016x}", uid) for uid in (0, 1001)] == [False, False]
    assert [taker.take(f"{5:016x}", 1000) for _ in range(2)] == [True, False]
    words[Word.LINK] = 6
    assert taker.take(f"{6:016x}", 1000)


def test_a_sign_of_life_is_no_use_of_a_connection(desk: Desk) -> None:
    """A page that nobody looks at gives them: its session must end all the same."""
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    begun_s = desk.now_s
    desk.look(5.0)
    say(client, 1, type="alive", frame=UNKNOWN)
    say(client, 2, type="renew", frame=UNKNOWN, epoch=3, lease=LEASE)
    assert client.used_s == begun_s
    say(client, 3)
    assert client.used_s == begun_s + 5.0


def test_before_the_first_picture_a_frame_has_the_mark_of_time_0(desk: Desk) -> None:
    desk.look()
    (status,) = sent(desk.hub.connect("anna", Role.OPERATOR, "console"), "status")
    assert re.fullmatch("0-[0-9a-f]{16}", status["frame"])
    # All tags, of which there are none but the lists of alarms.
    assert status["tags"] == {"alarms": [], "alarm_history": []}


@pytest.mark.parametrize("source", [Source.WEB, Source.LOCAL])
def test_each_door_writes_its_own_events(desk: Desk, monkeypatch: pytest.MonkeyPatch, source: Source) -> None:
    """A ring has one writer. What was held up is an event of the service."""
    tells: list[Any] = []
    hub = Hub(desk.memory, source, lambda: desk.now_s)

    def looked() -> None:
        raise asyncio.CancelledError

    monkeypatch.setattr(
        module, "HeldUp", lambda name, tell: tells.append(tell) or SimpleNamespace(look=looked)
    )
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(hub._look_on())
    tells[0]("it was held up for 2.0 s")
    found = [[json.loads(record or b"") for record in ring.peek(9)] for ring in desk.memory.events]
    assert [len(rows) for rows in found] == [int(ring is source) for ring in sorted(Source)]
    assert (found[source][0]["kind"], found[source][0]["text"]) == ("service", "it was held up for 2.0 s")
