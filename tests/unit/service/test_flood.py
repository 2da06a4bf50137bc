"""Whoever sends too much harms nobody else: not their commands, not their stop, not the journal.

INV-9: whoever floods the service delays nobody, and no stop.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from gantryctl.service.clients.hub import Client, Flooded, Hub
from gantryctl.service.command.inbox import OF_CLIENT, OF_SOURCE
from gantryctl.service.memory.memory import SharedMemory, Source
from gantryctl.service.protocol.limits import RateLimiter
from gantryctl.service.protocol.roles import Role
from support.marks import UNKNOWN
from support.service_bench import Bench

LEASE = "00000000000000aa"


@pytest.mark.parametrize("kind", ["alive", "renew"])
def test_signs_of_life_of_those_without_control_leave_control_to_others(kind: str) -> None:
    bench = Bench()
    crowd = [bench.who(Role.OPERATOR, f"tab{n}") for n in range(12)]
    console = bench.who(place="local")
    values = {} if kind == "alive" else {"lease": LEASE}
    for _ in range(200):
        for who in crowd:
            bench.send(who, kind, **values)  # 12 a scan: the scan judges 8
        bench.scans(1)
        while bench.replies[0].take() is not None:
            pass
    bench.do(console, "take", over=False)
    bench.do(console, "give")


def test_of_one_holders_signs_of_life_only_the_newest_waits() -> None:
    bench = Bench()
    who = bench.who()
    bench.do(who, "take", over=False)
    for _ in range(100):  # before, 100 of them needed 13 scans
        bench.send(who, "alive")
    bench.scans(4)  # 32 are read in a scan
    bench.do(who, "give")


def outcomes(bench: Bench, source: int = 0) -> list[tuple[str, str]]:
    """Client and code of every reply."""
    found = []
    while (record := bench.replies[source].take()) is not None:
        client, reply = json.loads(record)
        found.append((client, reply["code"]))
    return found


def test_so_many_commands_of_a_client_wait_and_no_more_and_others_go_on() -> None:
    bench = Bench()
    wild, calm = bench.who(client="wild"), bench.who(client="calm")
    for _ in range(30):
        bench.send(wild, "reset")  # refused one by one, 8 in a scan
    bench.send(calm, "take", over=False)
    bench.scans(10)
    found = outcomes(bench)
    assert found.count(("wild", "SEC-06")) == 30 - OF_CLIENT
    assert found.count(("wild", "SEC-07")) == OF_CLIENT
    assert ("calm", "") in found


def test_a_full_queue_of_pages_leaves_the_console_its_place() -> None:
    bench = Bench()
    for n in range(3 * OF_SOURCE):
        bench.send(bench.who(client=f"tab{n % 40}"), "reset")
    bench.send(bench.who(place="local"), "take", over=False)
    waited = 0
    while not bench.replies[1].written and waited < 100:
        bench.scans(1)
        waited += 1
        outcomes(bench)
    # 32 messages are read and 8 judged in a scan: 128 pages' commands are before it at most.
    assert waited <= 128 / 8 + 3
    assert bench.operator.authority.holder is not None


@pytest.mark.parametrize("kind", ["stop", "quick_stop"])
def test_all_stops_of_a_scan_are_one_and_everybody_gets_a_reply(kind: str) -> None:
    bench = Bench()
    epoch, events = bench.epoch, bench.events.written
    for _ in range(20):
        bench.send(bench.who(Role.VIEWER, "wild"), kind)
    calm = bench.who(Role.OPERATOR, "calm")
    bench.send(calm, kind)
    bench.scans(1)
    assert outcomes(bench) == [("wild", "")] * 20 + [("calm", "")]
    assert bench.epoch == epoch + 1
    assert bench.events.written == events + 2  # one for each user


def test_a_release_among_many_lets_its_key_go() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "jog", lease=LEASE, direction="forward")
    for n in range(5):
        bench.send(bench.who(Role.VIEWER, "wild"), "release", lease=f"{n:016x}")
    bench.send(who, "release", lease=LEASE)
    bench.scans(1)
    assert not bench.operator.hold.alive


@pytest.fixture
def hub() -> Iterator[Hub]:
    memory = SharedMemory.create()
    found = Hub(memory, Source.WEB)
    yield found
    memory.close()


def flood(client: Client) -> None:
    for n in range(100_000):
        client.take(f'{{"type":"alive","seq":{n},"frame":"{UNKNOWN}"}}')


def test_a_connection_sends_so_many_of_each_kind_and_what_is_more_does_not_reach_the_scan(hub: Hub) -> None:
    client = hub.connect("eve", Role.VIEWER, "console")
    before = hub._commands.written
    for n in range(140):
        client.take(f'{{"type":"alive","seq":{n},"frame":"{UNKNOWN}"}}')
    alive = hub._commands.written - before
    assert 100 <= alive < 140  # a few come back while the loop runs
    for n in range(40):
        client.take(f'{{"type":"stop","seq":{n + 140},"frame":1}}')
    stops = hub._commands.written - before - alive
    assert 20 <= stops < 40
    client.take('{"type":"quick_stop","seq":300,"frame":1}')
    assert hub._commands.written == before + alive + stops + 1
    assert any("SEC-06" in text for text in client.outgoing())
    with pytest.raises(Flooded):
        flood(client)


@pytest.mark.parametrize(("size", "taken"), [(200, 200), (1023, 200), (1024, 100), (16_384, 11)])
def test_a_long_message_counts_for_each_kib(size: int, taken: int) -> None:
    """14 connections with 190 messages of 16 KiB a second kept the Stop of another page waiting for 0.2 to 0.35 s."""
    memory = SharedMemory.create()
    client = Hub(memory, Source.WEB, lambda: 5.0).connect("eve", Role.VIEWER, "console")
    text = f'{{"type":"alive","seq":1,"frame":"{UNKNOWN}"}}'.ljust(size)
    for _ in range(taken):
        client.take(text)
    with pytest.raises(Flooded):
        client.take(text)
    memory.close()


def test_a_rate_limiter_gives_its_rate() -> None:
    now_s = [0.0]
    limiter = RateLimiter(10.0, now=lambda: now_s[0])
    assert [limiter.wait_s() == 0.0 for _ in range(11)] == [True] * 10 + [False]
    now_s[0] = 0.25  # two and a half come back
    assert [limiter.wait_s() == 0.0 for _ in range(3)] == [True, True, False]
    now_s[0] = 100.0
    assert sum(limiter.wait_s() == 0.0 for _ in range(20)) == 10
