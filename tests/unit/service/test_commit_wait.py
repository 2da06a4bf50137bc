"""Replies wait for the commit of their event, for a time with an end; what stops the axis is answered at once."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.service.clients.commit_wait import CommitWait
from gantryctl.service.clients.hub import Client, Hub
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.limits import ANSWER_S, KEEP_S
from gantryctl.service.protocol.messages import FIELDS, KEPT_FIRST, SILENT, MessageRefused, compact, reply_to
from gantryctl.service.protocol.roles import Role
from support.marks import UNKNOWN

LEASE = "00000000000000aa"
VALUES: dict[str, dict[str, Any]] = {
    "take": {"over": False},
    "power": {"on": True},
    "mode": {"mode": "continuous"},
    "jog": {"lease": LEASE, "direction": "forward"},
    "renew": {"lease": LEASE},
    "release": {"lease": LEASE},
    "increment": {"direction": "forward"},
    "move": {"target_deg": 1.0},
    "move_by": {"distance_deg": 1.0},
    "acknowledge": {"id": 1},
    "commission_step": {"step": "identity"},
    "set": {"tag": "increment_deg", "value": 1.0},
    "arm": {"action": "brake_test"},
    "note": {"line": "the couch was changed"},
}
AT_ONCE = sorted(set(FIELDS) - KEPT_FIRST - SILENT)


@pytest.fixture
def memory() -> Iterator[SharedMemory]:
    made = SharedMemory.create()
    yield made
    made.close()


def texts(client: Client) -> list[dict[str, Any]]:
    """Replies that have gone out to it."""
    found = [json.loads(text) for text in client.outgoing()]
    return [each for each in found if each["type"] == "reply"]


def after_a_command(
    memory: SharedMemory, kind: str, values: dict[str, Any], then: Callable[[], None] = lambda: None
) -> list[dict[str, Any]]:
    """Replies 50 ms after a command was carried out; the recorder keeps its event only if `then` says so."""

    async def whole() -> list[dict[str, Any]]:
        hub = Hub(memory, Source.WEB)
        client = hub.connect("anna", Role.SERVICE, "console")
        serving = asyncio.create_task(hub.run())
        epoch = {} if kind in ("stop", "quick_stop", "release") else {"epoch": 1}
        client.take(json.dumps({"type": kind, "seq": 7, "frame": UNKNOWN, **epoch, **values}))
        number = EventLog(memory.events[Source.CONTROLLER]).put("command", f"{kind}: done")
        memory.replies[Source.WEB].put(compact([client.who.client, reply_to(7, journal=number)]).encode())
        then()
        await asyncio.sleep(0.05)
        serving.cancel()
        return texts(client)

    return asyncio.run(whole())


@pytest.mark.parametrize("kind", sorted(KEPT_FIRST))
def test_the_reply_to_what_lasts_waits_for_the_disk(memory: SharedMemory, kind: str) -> None:
    assert after_a_command(memory, kind, VALUES.get(kind, {})) == []


@pytest.mark.parametrize("kind", sorted(KEPT_FIRST))
def test_it_comes_when_its_event_is_kept(memory: SharedMemory, kind: str) -> None:
    events = memory.events[Source.CONTROLLER]
    (reply,) = after_a_command(memory, kind, VALUES.get(kind, {}), lambda: events.advance(1))
    assert (reply["ok"], reply["code"], reply["journal"]) == (True, "", 1)


@pytest.mark.parametrize(
    ("kind", "values"), [*((k, VALUES.get(k, {})) for k in AT_ONCE), ("power", {"on": False})]
)
def test_what_stops_prepares_or_holds_a_key_is_answered_without_the_disk(
    memory: SharedMemory, kind: str, values: dict[str, Any]
) -> None:
    (reply,) = after_a_command(memory, kind, values)
    assert (reply["ok"], reply["code"]) == (True, "")


def test_every_command_is_answered_at_once_or_kept_first() -> None:
    """What a stop is must never be among those that wait."""
    assert {"stop", "quick_stop", "release", "halt", "give", "jog"} <= set(AT_ONCE)
    assert {"power", "reset", "brake_test", "set"} <= KEPT_FIRST


def test_a_refusal_waits_for_nothing(memory: SharedMemory) -> None:
    async def whole() -> list[dict[str, Any]]:
        hub = Hub(memory, Source.WEB)
        client = hub.connect("anna", Role.SERVICE, "console")
        serving = asyncio.create_task(hub.run())
        client.take('{"type":"reset","seq":7,"frame":"0-0000000000000000","epoch":1}')
        reply = reply_to(7, MessageRefused(Code.SEC_03), journal=1)
        memory.replies[Source.WEB].put(compact([client.who.client, reply]).encode())
        await asyncio.sleep(0.05)
        serving.cancel()
        return texts(client)

    (reply,) = asyncio.run(whole())
    assert (reply["ok"], reply["code"]) == (False, "SEC-03")


def test_after_its_time_the_reply_says_that_the_event_is_not_kept(memory: SharedMemory) -> None:
    now_s = [100.0]
    ring = memory.events[Source.CONTROLLER]
    waiting = CommitWait(ring, lambda: now_s[0])
    first, second = (EventLog(ring).put("command", "power on: done") for _ in range(2))
    waiting.add("a", reply_to(1, journal=first))
    now_s[0] += 0.5 * KEEP_S
    waiting.add("b", reply_to(2, journal=second))
    assert waiting.take() == []
    now_s[0] += 0.5 * KEEP_S
    ((client, reply),) = waiting.take()
    assert (client, reply["ok"], reply["code"], reply["journal"]) == ("a", True, "JRN-03", 1)
    assert "event 1 is not on the disk after 1 s, it waits in memory" in reply["text"]
    assert reply["values"]["reason"]["words"] == "EVENT_WAITS"
    ring.advance(2)
    assert waiting.take() == [("b", reply_to(2, journal=second))]
    assert len(waiting) == 0


def test_an_event_that_found_no_place_is_not_waited_for(memory: SharedMemory) -> None:
    waiting = CommitWait(memory.events[Source.CONTROLLER], lambda: 100.0)
    waiting.add("a", reply_to(1, journal=0))
    ((_, reply),) = waiting.take()
    assert (reply["ok"], reply["code"], reply["values"]) == (
        True,
        "JRN-03",
        {"reason": {"words": "EVENT_LOST", "values": {}}},
    )


def test_a_reply_that_waits_for_the_disk_does_not_count_as_a_silent_controller(memory: SharedMemory) -> None:
    hub = Hub(memory, Source.WEB)
    client = hub.connect("anna", Role.SERVICE, "console")
    client.take('{"type":"reset","seq":7,"frame":"0-0000000000000000","epoch":1}')
    assert client.waits_for_disk(reply_to(7, journal=1))
    client.overdue(client.used_s + ANSWER_S + 1.0)
    assert texts(client) == []
