"""What a connection is told and how long it counts, by hand: limits of a key, rates, a controller that is gone."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

from gantryctl.service.clients import local
from gantryctl.service.clients.hub import Hub
from gantryctl.service.memory import snapshot
from gantryctl.service.memory.memory import Source, Word
from gantryctl.service.memory.snapshot import FAST, publish_fast
from gantryctl.service.protocol import limits
from gantryctl.service.protocol.limits import RateLimiter, key_limits
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from support.slow_network import shared_memory
from unit.service.test_local import connect, ended, run

approx = pytest.approx


@pytest.mark.parametrize(
    ("lease_s", "wanted"), [(0.250, (0.200, 0.150)), (0.1, (0.08, 0.06)), (1.0, (0.2, 0.15))]
)
def test_a_key_needs_a_view_and_a_round_trip_that_end_before_its_lease(
    lease_s: float, wanted: tuple[float, float]
) -> None:
    assert key_limits(lease_s) == approx(wanted)


def test_a_connection_is_told_the_limits_of_its_key() -> None:
    with shared_memory() as memory:
        memory.words[Word.LEASE_MS] = 100
        told = json.loads(Hub(memory, Source.LOCAL).welcome(Identity("c", "anna", Role.OPERATOR, "local")))
        assert (told["lease_ms"], told["key_view_max_ms"], told["round_trip_max_ms"]) == (100, 80, 60)


def test_a_controller_that_says_nothing_for_half_a_second_is_not_fresh(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_ns = [5_000_000_000]
    monkeypatch.setattr(snapshot, "time", SimpleNamespace(monotonic_ns=lambda: now_ns[0]))
    with shared_memory() as memory:
        hub = Hub(memory, Source.LOCAL)
        hub.look()
        assert not hub.fresh
        publish_fast(memory.fast, dict.fromkeys(FAST, 0.0), 0)
        for later_ms, fresh in ((0, True), (499, True), (2, False)):
            now_ns[0] += later_ms * 1_000_000
            hub.look()
            assert hub.fresh is fresh
            assert hub.status()["fresh"] is fresh


def test_replies_of_the_process_before_are_for_nobody() -> None:
    with shared_memory() as memory:
        memory.replies[Source.WEB].put(b'["c1", {"seq": 1, "ok": true}]')
        Hub(memory, Source.WEB)
        assert memory.replies[Source.WEB].take() is None


def test_who_was_quiet_for_longest_is_forgotten_and_not_who_asks_now(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "_SENDERS", 2)
    rate = RateLimiter(1.0, 1.0, now=lambda: 0.0)
    assert [rate.wait_s(sender) for sender in ("a", "b", "c")] == [0.0] * 3
    assert rate.wait_s("c") == 1.0
    assert rate.wait_s("b") == 1.0
    assert rate.wait_s("a") == 0.0


def test_who_asks_again_is_not_the_one_that_was_quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else a flood would begin anew with a full bucket."""
    monkeypatch.setattr(limits, "_SENDERS", 2)
    rate = RateLimiter(1.0, 1.0, now=lambda: 0.0)
    assert [rate.wait_s(sender) for sender in ("flood", "other", "flood", "third")] == [0.0, 0.0, 1.0, 0.0]
    assert rate.wait_s("flood") == 1.0


def test_who_asks_on_is_let_in_when_his_time_has_come() -> None:
    """A message in half a second, and one at once; asking too early neither shortens the wait nor begins it anew."""
    now_s = 0.0
    rate = RateLimiter(2.0, 1.0, now=lambda: now_s)
    waits = []
    for now_s in (0.0, 0.125, 0.25, 0.375, 0.5, 0.75, 10.0, 10.0):  # noqa: B007 - the limiter looks at it
        waits.append(rate.wait_s())
    assert waits == approx([0.0, 0.375, 0.25, 0.125, 0.0, 0.25, 0.0, 0.5])


def test_the_local_socket_has_so_many_places_for_all_users_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(local, "_CONNECTIONS", 2)

    async def check(hub: Hub, path: Path) -> None:
        hub.connect("somebody", Role.OPERATOR, "local")
        _, first, name = await connect(path, watch=True)
        assert name
        reader, second, none = await connect(path, watch=True)
        assert none == ""
        assert await ended(reader)
        first.close()
        second.close()

    run(tmp_path, check)
