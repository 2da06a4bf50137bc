"""Replies on their way back, by hand: those that wait for the disk, those that come late, what is looked for."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import UsageError
from gantryctl.service.clients import console_link, recorded
from gantryctl.service.clients import hub as hub_module
from gantryctl.service.clients.console_link import LinkGiver, LinkTaker
from gantryctl.service.memory.memory import Source, Word
from gantryctl.service.protocol.messages import compact, reply_to
from gantryctl.service.protocol.roles import Role
from support.marks import UNKNOWN
from support.slow_network import shared_memory
from unit.service.test_connection_by_hand import Desk, say, sent

ON = {"type": "power", "on": True, "frame": UNKNOWN, "epoch": 3}


@pytest.fixture
def desk() -> Iterator[Desk]:
    with shared_memory() as memory:
        yield Desk(memory)


def replied(desk: Desk, client: Any, seq: int, journal: int) -> None:
    record = compact([client.who.client, reply_to(seq, epoch=4, journal=journal)])
    assert desk.memory.replies[Source.WEB].put(record.encode())
    desk.hub.pass_replies()


def test_a_reply_that_waits_for_the_disk_is_for_nobody_when_its_client_has_left(desk: Desk) -> None:
    gone, client = (desk.hub.connect(user, Role.OPERATOR, "console") for user in ("ben", "anna"))
    for each in (gone, client):
        say(each, 1, **ON)
        replied(desk, each, 1, journal=1)
    assert not sent(client)
    desk.hub.leave(gone)
    desk.memory.events[Source.CONTROLLER].put(b"power on")
    desk.memory.events[Source.CONTROLLER].take()
    desk.hub.pass_replies()
    assert [(each["seq"], each["ok"], each["code"]) for each in sent(client)] == [(1, True, "")]


def test_a_reply_that_comes_when_its_client_was_told_of_silence_goes_out_at_once(desk: Desk) -> None:
    """Nobody waits for it any more."""
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    say(client, 1, **ON)
    desk.look(1.1)
    assert [each["code"] for each in sent(client)] == ["SYS-11"]
    replied(desk, client, 1, journal=1)
    assert [(each["seq"], each["ok"]) for each in sent(client)] == [(1, True)]


def test_while_a_reply_waits_for_the_disk_it_is_looked_for_every_2_ms(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    slept: list[float] = []
    client = desk.hub.connect("anna", Role.OPERATOR, "console")
    say(client, 1, **ON)
    replied(desk, client, 1, journal=1)
    assert not client.waiting

    async def sleep(time_s: float) -> None:
        slept.append(time_s)
        raise asyncio.CancelledError

    async def waits(work: Any, _: float) -> None:
        work.close()
        raise AssertionError("a reply may come at any time")

    monkeypatch.setattr(hub_module.asyncio, "wait_for", waits)
    monkeypatch.setattr(hub_module.asyncio, "sleep", sleep)
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(desk.hub._answer_on())
    assert slept == [0.002]


def test_one_press_calls_for_one_picture(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """And the loop rests again."""
    looks: list[int] = []
    monkeypatch.setattr(desk.hub, "look", lambda: looks.append(1) or 60.0)

    async def whole() -> None:
        looking = asyncio.create_task(desk.hub._look_on())
        for turn in (1, 2, 3):
            for _ in range(20):
                await asyncio.sleep(0)
            assert len(looks) == turn
            desk.hub.hurry()
        looking.cancel()

    asyncio.run(whole())


# --- a link to the console --------------------------------------------------------------------------------------------


def test_a_link_has_sixty_three_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console_link, "secrets", SimpleNamespace(randbits=lambda bits: 2**bits - 1))
    words: Any = {}
    assert LinkGiver(words, "http://localhost/", lambda: 7).give(1000).endswith(f"/{2**63:016x}")


def test_a_link_of_letters_that_there_are_not_opens_nothing() -> None:
    words: Any = {Word.LINK: 5, Word.LINK_UID: 1000, Word.LINK_UNTIL_NS: 61_000_000_000}
    assert not LinkTaker(words, lambda: 500_000_000).take("\udc80" * 16, 1000)


# --- the reader of curves ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sound", [True, False])
def test_curves_are_printed_by_a_process_that_comes_last(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], sound: bool
) -> None:
    """Fifteen steps behind the scan; what is no recording is told by the exit code."""
    did: list[Any] = []

    def columns(*asked: Any) -> dict[str, Any]:
        did.append(asked)
        if not sound:
            raise UsageError("no recording")
        return {"name": "one"}

    monkeypatch.setattr(recorded.os, "nice", did.append)
    monkeypatch.setattr(recorded, "columns_between", columns)
    assert recorded.main(["7", "one", "200", "900"]) == (0 if sound else 1)
    assert did == [15, (Path("/dev/fd/7"), "one", 200, 900)]
    said = capsys.readouterr().out
    assert (json.loads(said) == {"name": "one"}) if sound else (said == "")
