"""Refused commands are journaled: each cause once at once, repeats as counts that add up, and no flood fills the disk.

INV-9: whoever floods the service harms nobody else.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.hub import Client, Hub
from gantryctl.service.memory import refusals
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.memory.refusals import FIRST_S, LONGEST_S, RESERVE, ROW_S, RefusalLog
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import (
    SETTABLE,
    Identity,
    Message,
    MessageRefused,
    action_of,
)
from gantryctl.service.protocol.roles import ARMABLE, Role, may
from support.marks import UNKNOWN
from support.service_bench import Bench, ring

LEASE = "00000000000000aa"
MESSAGES: tuple[dict[str, Any], ...] = (
    {"type": "take", "over": False},
    {"type": "take", "over": True},
    {"type": "give"},
    *({"type": "power", "on": on} for on in (True, False)),
    *({"type": "mode", "mode": mode} for mode in ("none", "continuous", "incremental")),
    {"type": "jog", "lease": LEASE, "direction": "forward"},
    {"type": "renew", "lease": LEASE},
    {"type": "increment", "direction": "forward"},
    {"type": "move", "target_deg": 1.0},
    {"type": "move_by", "distance_deg": 1.0},
    {"type": "halt"},
    {"type": "reset"},
    {"type": "acknowledge", "id": 1},
    {"type": "note", "line": "the door is repaired"},
    *({"type": "set", "tag": tag, "value": 1.0} for tag in SETTABLE),
    *({"type": "arm", "action": action} for action in ARMABLE if action != "commission"),
    {"type": "arm", "action": "commission", "step": "velocity"},
    {"type": "brake_test"},
)


def taken(events: Ring) -> list[dict[str, Any]]:
    """Events of a ring, which is empty then."""
    found = []
    while (record := events.take()) is not None:
        found.append(json.loads(record))
    return found


def counted(rows: list[dict[str, Any]]) -> int:
    """Refusals that rows stand for."""
    return sum(row["values"].get("count", 1) for row in rows)


@pytest.fixture
def memory() -> Iterator[SharedMemory]:
    made = SharedMemory.create()
    yield made
    made.close()


def sent(client: Client, seq: int, values: dict[str, Any]) -> Message:
    client._commands._buckets.clear()  # the rate is another refusal
    client.take(json.dumps({"seq": seq, "frame": UNKNOWN, "epoch": 1, **values}))
    rest = {name: value for name, value in values.items() if name != "type"}
    return Message(values["type"], seq, 0, 1, rest)


@pytest.mark.parametrize("role", list(Role))
def test_every_message_that_a_role_may_not_send_is_journaled(memory: SharedMemory, role: Role) -> None:
    hub = Hub(memory, Source.WEB)
    client = hub.connect("anna", role, "console")
    refused = Counter[str]()
    for seq, values in enumerate(MESSAGES, 1):
        action = action_of(sent(client, seq, values))
        refused[action] += not may(role, action)
    hub.refusals.close()
    rows = taken(memory.events[Source.WEB])
    found = Counter[str]()
    for row in rows:
        assert (row["user"], row["role"], row["values"]["code"]) == ("anna", str(role), "SEC-01")
        assert f"refused: SEC-01 the role {role} may not do this" in row["text"]
        found[row["values"]["action"]] += row["values"].get("count", 1)
    assert found == +refused


def test_messages_that_are_not_understood_and_too_many_are_journaled(memory: SharedMemory) -> None:
    hub = Hub(memory, Source.WEB)
    client = hub.connect("anna", Role.OPERATOR, "console")
    client.take("[]")
    client.take('{"type":"move","seq":1,"frame":"0-0000000000000000","epoch":1,"target_deg":"a"}')
    for seq in range(2, 30):
        client.take(f'{{"type":"reset","seq":{seq},"frame":"{UNKNOWN}","epoch":1}}')
    hub.refusals.close()
    rows = taken(memory.events[Source.WEB])
    assert {row["values"]["code"] for row in rows} == {"SEC-05", "SEC-06"}
    assert counted(rows) >= 2 + 28 - 20 - 1  # 20 at once; one token may come back meanwhile


class Clock:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def log_on(events: Ring, clock: Clock) -> RefusalLog:
    return RefusalLog(EventLog(events), clock)


ANNA, BEN = (Identity("c", name, Role.VIEWER, "console") for name in ("anna", "ben"))
HALT, RESET = (Message(kind, 1, 0, 1, {}) for kind in ("halt", "reset"))
NOT_YOURS = MessageRefused(Code.SEC_07, reason=Words.TAKE_CONTROL_FIRST)
TOO_MANY = MessageRefused(Code.SEC_06, reason=Words.NO_COMMANDS_NOW)


def test_the_first_is_written_at_once_and_repeats_as_one_row_with_their_number() -> None:
    events, clock = ring(512), Clock()
    log = log_on(events, clock)
    assert log.put(ANNA, HALT, NOT_YOURS) == 1
    for _ in range(500):
        assert log.put(ANNA, HALT, NOT_YOURS) == 0
    assert log.put(ANNA, RESET, NOT_YOURS) == 2  # another action
    assert log.put(ANNA, HALT, TOO_MANY) == 3  # another cause
    assert log.put(BEN, HALT, NOT_YOURS) == 4  # another account
    log.look()
    assert [row["values"].get("count") for row in taken(events)] == [None] * 4
    clock.now_s += FIRST_S
    log.look()
    (row,) = taken(events)
    assert (row["user"], row["values"]["count"], row["values"]["action"]) == ("anna", 500, "halt")
    assert row["text"] == "halt: refused: SEC-07 take control first; 500 times in 10 s"


def test_the_row_that_is_due_first_is_written_first() -> None:
    events, clock = ring(512), Clock()
    log = log_on(events, clock)
    for who in (ANNA, BEN):
        for _ in range(3):
            log.put(who, HALT, NOT_YOURS)
        clock.now_s += 4.0
    taken(events)
    # 10 s after the first refusal of Anna, 6 s after that of Ben.
    clock.now_s += 2.0
    log.look()
    assert [row["user"] for row in taken(events)] == ["anna"]
    clock.now_s += 4.0
    log.look()
    assert [row["user"] for row in taken(events)] == ["ben"]


def test_after_a_quiet_time_the_next_one_is_a_first_again() -> None:
    events, clock = ring(512), Clock()
    log = log_on(events, clock)
    log.put(ANNA, HALT, NOT_YOURS)
    clock.now_s += FIRST_S
    log.look()
    assert log.put(ANNA, HALT, NOT_YOURS) == 2


def test_a_flood_writes_less_and_less_often() -> None:
    events, clock = ring(4096), Clock()
    log, puts = log_on(events, clock), 0
    for _ in range(3600 * 4):
        log.put(ANNA, HALT, NOT_YOURS)
        puts += 1
        log.look()
        clock.now_s += 0.25
    rows = taken(events)
    # After 10, 20, 40 ... 640 s in all six windows, then one row in ten minutes.
    assert len(rows) <= 8 + 3600.0 / LONGEST_S
    log.close()
    assert counted(rows) + counted(taken(events)) == puts


Step = tuple[int, int, float]


@given(
    st.lists(
        st.tuples(st.integers(0, 300), st.integers(0, 1), st.sampled_from([0.0, 0.3, 11.0, 700.0])),
        max_size=400,
    )
)
def test_nothing_is_lost_from_the_counts_and_an_account_has_so_many_rows(steps: list[Step]) -> None:
    events, clock = ring(4096), Clock()
    log, began_s = log_on(events, clock), clock.now_s
    rows: list[dict[str, Any]] = []
    for cause, account, wait_s in steps:
        log.put_text((ANNA, BEN)[account], "command", "what", f"action {cause}", NOT_YOURS)
        clock.now_s += wait_s
        log.look()
        rows += taken(events)
    for account in ("anna", "ben", ""):  # the last for causes beyond the places
        most = RESERVE + (clock.now_s - began_s) / ROW_S + 1
        assert sum(row["user"] == account for row in rows) <= most
    log.close()
    assert counted(rows + taken(events)) == len(steps)


def test_a_flood_of_refused_commands_leaves_its_places_to_events_of_others() -> None:
    bench = Bench()
    wild, calm = bench.who(client="wild"), Identity("calm", "calm", Role.OPERATOR, "console")
    refused = 0
    for _ in range(100):
        for _ in range(8):
            bench.send(wild, "move", target_deg=1.0)
            refused += 1
        bench.scans(2)
        while bench.replies[0].take() is not None:
            pass
    bench.do(calm, "take", over=False)
    bench.operator.refusals.close()
    rows = taken(bench.event_ring)
    assert [row["text"] for row in rows if row["user"] == "calm"] == ["take False: done"]
    of_wild = [row for row in rows if row["user"] == wild.user]
    assert len(of_wild) <= 4  # by cause: no control, no place in the queue
    assert counted(of_wild) == refused


def test_causes_beyond_the_places_share_one_row_and_those_that_are_there_keep_theirs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two places; anna and ben have them."""
    monkeypatch.setattr(refusals, "_CAUSES", 2)
    events = ring(64)
    log = RefusalLog(EventLog(events), lambda: 100.0)
    for user in ("anna", "ben", "carl", "anna", "carl", "dora"):
        who = Identity(user, user, Role.VIEWER, "console")
        log.put_text(who, "command", "what", "move", NOT_YOURS)
    log.close()
    assert [(row["user"], row["values"].get("count", 1)) for row in taken(events)] == [
        ("anna", 1), ("ben", 1), ("", 1), ("anna", 1), ("", 2)
    ]  # fmt: skip
