"""Connections of OPC UA, by hand: places, chunks, floods, and who is swept away."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua.ua.ua_binary import struct_to_binary  # noqa: E402

from gantryctl.gateway.opcua import listener as listener_module  # noqa: E402
from gantryctl.gateway.opcua.listener import Connection, Listener  # noqa: E402
from gantryctl.gateway.opcua.reading import Bounded  # noqa: E402
from support.opcua_by_hand import S  # noqa: E402


class Wall:
    """Stands for what all channels share; `refused` and `over` are what was written."""

    def __init__(self) -> None:
        self.refused, self.over = list[tuple[str, int]](), list[str]()
        self.trust = SimpleNamespace(refresh=lambda: None)
        self.people = SimpleNamespace(
            all=dict, refused=lambda address, count, why: self.refused.append((address, count)),
            ended=lambda reader, why: self.over.append(why),
        )  # fmt: skip


class Client:
    """A connection of a sweep."""

    def __init__(self, readers: int, why: str = "") -> None:
        self.aborted, self.said, self.ended = False, list[int](), False
        self.transport = SimpleNamespace(abort=lambda: setattr(self, "aborted", True))
        self.channel = SimpleNamespace(readers=[object()] * readers, lapsed=lambda users: why, end=self.end)
        self.idle_s, self.stuck_s = 100.0, None

    async def end(self) -> None:
        self.ended = True

    def refuse(self, status: int) -> None:
        self.said.append(status)


def swept(monkeypatch: pytest.MonkeyPatch, client: Client, now_s: float) -> Wall:
    wall = Wall()
    listener = Listener(wall, "127.0.0.1", 0)  # type: ignore[arg-type]
    listener.connections = {client}  # type: ignore[arg-type]
    monkeypatch.setattr(listener_module.time, "monotonic", lambda: now_s)
    asyncio.run(listener.sweep())
    return wall


@pytest.mark.parametrize(("now_s", "goes"), [(105.0, False), (105.1, True)])
def test_who_has_not_logged_in_for_5_s_loses_its_place(
    monkeypatch: pytest.MonkeyPatch, now_s: float, goes: bool
) -> None:
    client = Client(0)
    swept(monkeypatch, client, now_s)
    assert client.aborted is goes
    reader = Client(1)
    swept(monkeypatch, reader, now_s)
    assert (reader.aborted, reader.idle_s) == (False, now_s)


@pytest.mark.parametrize(("now_s", "goes"), [(105.0, False), (105.1, True)])
def test_who_takes_no_answer_for_5_s_loses_its_place_logged_in_or_not(
    monkeypatch: pytest.MonkeyPatch, now_s: float, goes: bool
) -> None:
    client = Client(1)
    client.stuck_s = 100.0
    swept(monkeypatch, client, now_s)
    assert client.aborted is goes


def test_who_is_trusted_no_more_is_ended_with_all_its_sessions(monkeypatch: pytest.MonkeyPatch) -> None:
    client = Client(2, "the certificate is revoked")
    wall = swept(monkeypatch, client, 101.0)
    assert (client.ended, client.said, client.aborted) == (True, [S.BadSecureChannelClosed], False)
    assert wall.over == ["the certificate is revoked"] * 2


def test_refused_channels_are_counted_by_network_and_a_thousand_networks_are_remembered() -> None:
    wall = Wall()
    listener = Listener(wall, "127.0.0.1", 0)  # type: ignore[arg-type]
    for address in ("192.0.2.7", "192.0.2.8", "192.0.2.7", "2001:db8::1", "2001:db8::2"):
        listener.journal(address, "")
    assert [count for _, count in wall.refused] == [1, 1, 2, 1, 2]
    for n in range(997):
        listener.journal(f"10.0.{n // 250}.{n % 250}", "")
    assert len(listener._refused) == 1000
    listener.journal("192.0.2.7", "")
    assert wall.refused[-1][1] == 3
    listener.journal("192.0.2.9", "")
    assert len(listener._refused) == 1


def test_one_remote_address_has_four_connections_and_this_machine_sixteen() -> None:
    for address, most in (("192.0.2.7", 4), ("127.0.0.1", 16)):
        places = Listener(Wall(), "127.0.0.1", 0).places  # type: ignore[arg-type]
        assert [places.take(address) is not None for _ in range(most + 1)] == [True] * most + [False]


def test_no_request_is_looked_at_while_the_client_takes_no_answers() -> None:
    connection = Connection(Listener(Wall(), "127.0.0.1", 0))  # type: ignore[arg-type]
    assert (connection._writable.is_set(), connection.stuck_s) == (True, None)
    connection.pause_writing()
    assert not connection._writable.is_set()
    assert connection.stuck_s is not None
    connection.resume_writing()
    assert (connection._writable.is_set(), connection.stuck_s) == (True, None)


class Wire:
    """The transport of a connection: what was done to it."""

    def __init__(self) -> None:
        self.did: list[str] = []
        self.closing = False

    def get_extra_info(self, _: str) -> tuple[str, int]:
        return ("192.0.2.7", 7)

    def set_write_buffer_limits(self, most: int) -> None:
        self.did.append(f"buffer {most}")

    def is_closing(self) -> bool:
        return self.closing

    def write(self, _: bytes) -> None:
        self.did.append("told")

    def __getattr__(self, name: str) -> Any:
        def did() -> None:
            self.did.append(name)
            self.closing = self.closing or name in ("abort", "close")

        return did


def on_a_wire(
    monkeypatch: pytest.MonkeyPatch, check: Any, *, full: bool = False, answers: Any = None
) -> None:
    """Run a check of a connection whose channel answers as the test says."""

    async def whole() -> None:
        wall: Any = Wall()
        wall.limits = SimpleNamespace(max_recv_buffer=100)
        listener = Listener(wall, "127.0.0.1", 0)
        taken: list[bytes] = []
        place = SimpleNamespace(leave=lambda: wire.did.append("left"))
        listener.places = SimpleNamespace(take=lambda _: None if full else place)  # type: ignore[assignment]

        async def take(_: Any, body: Any) -> bool:
            taken.append(bytes(body.read(len(body))))
            if isinstance(answers, Exception):
                raise answers
            return answers is not False

        async def end() -> None:
            wire.did.append("sessions ended")

        channel = SimpleNamespace(take=take, end=end)
        monkeypatch.setattr(listener_module, "Channel", lambda *_: channel)
        connection, wire = Connection(listener), Wire()
        connection.connection_made(wire)
        await check(connection, wire, taken, wall)
        if connection._work is not None:
            connection._work.cancel()

    asyncio.run(whole())


def chunk(body: bytes, kind: bytes = b"MSGF") -> bytes:
    """Kind and final part, length of the whole, channel 1."""
    return kind + (12 + len(body)).to_bytes(4, "little") + (1).to_bytes(4, "little") + body


async def turns() -> None:
    for _ in range(5):
        await asyncio.sleep(0)


def test_who_finds_no_place_is_not_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        connection.data_received(chunk(b"hello"))
        await turns()
        connection.connection_lost(None)
        assert (wire.did, taken) == (["abort"], [])

    on_a_wire(monkeypatch, check, full=True)


def test_a_connection_that_ends_gives_its_place_back_and_ends_its_sessions(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        connection.connection_lost(None)
        await turns()
        assert wire.did == [f"buffer {2**20}", "left", "sessions ended"]
        assert connection not in connection._listener.connections

    on_a_wire(monkeypatch, check)


def test_chunks_are_taken_in_their_order_as_they_become_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        both = chunk(b"one") + chunk(b"two")
        connection.data_received(both[:17])
        await turns()
        assert taken == [b"one"]
        connection.data_received(both[17:])
        await turns()
        assert taken == [b"one", b"two"]
        # While the client takes no answers nothing further is looked at.
        connection.pause_writing()
        connection.data_received(chunk(b"three"))
        await turns()
        assert taken == [b"one", b"two"]
        connection.resume_writing()
        await turns()
        assert taken[2:] == [b"three"]

    on_a_wire(monkeypatch, check)


@pytest.mark.parametrize(
    ("head", "refused"),
    [
        (b"MSGF" + (100).to_bytes(4, "little"), False), (b"MSGF" + (101).to_bytes(4, "little"), True),
        (b"MSGF" + (9).to_bytes(4, "little"), False), (b"MSGF" + (8).to_bytes(4, "little"), True),
        (b"MSGX" + (50).to_bytes(4, "little"), True), (b"HELC" + (50).to_bytes(4, "little"), True),
        (b"XXXF" + (50).to_bytes(4, "little"), True), (b"MSGA" + (50).to_bytes(4, "little"), False),
    ],
)  # fmt: skip
def test_only_chunks_of_a_kind_and_a_length_that_were_announced_are_waited_for(
    monkeypatch: pytest.MonkeyPatch, head: bytes, refused: bool
) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        connection.data_received(head)
        assert wire.did[1:] == (["told", "close"] if refused else [])

    on_a_wire(monkeypatch, check)


def test_a_flood_is_read_no_further_until_half_of_it_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        connection.data_received(chunk(b"x") * 32)
        assert "pause_reading" not in wire.did
        connection.data_received(chunk(b"x"))
        assert wire.did[-1] == "pause_reading"
        while "resume_reading" not in wire.did:
            await asyncio.sleep(0)
        # 33 wait; from 16 on it is read again.
        assert len(taken) in (16, 17)

    on_a_wire(monkeypatch, check)


@pytest.mark.parametrize(
    ("answers", "did", "written"),
    [
        (True, [], []),
        (False, ["close"], []),
        (
            listener_module.ChannelRefused(S.BadSecurityChecksFailed, "a stranger"),
            ["told", "close"],
            [("192.0.2.7", 1)],
        ),
        (listener_module.ChannelRefused(S.BadSecureChannelClosed), ["told", "close"], []),
        (ValueError("no chunk"), ["told", "close"], []),
    ],
)
def test_a_channel_that_is_refused_is_told_and_closed_and_an_attack_is_in_the_journal(
    monkeypatch: pytest.MonkeyPatch, answers: Any, did: list[str], written: list[tuple[str, int]]
) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        connection.data_received(chunk(b"x"))
        await turns()
        assert [each for each in wire.did[1:] if each != "resume_reading"] == did
        assert wall.refused == written

    on_a_wire(monkeypatch, check, answers=answers)


def test_a_sweep_reads_the_trust_list_first(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    wall = Wall()
    wall.trust = SimpleNamespace(refresh=lambda: read.append("list"))
    asyncio.run(Listener(wall, "127.0.0.1", 0).sweep())  # type: ignore[arg-type]
    assert read == ["list"]


def test_nothing_is_read_from_a_connection_that_ends_already(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        connection.data_received(chunk(b"one"))
        wire.closing = True
        await turns()
        assert (taken, wire.did[1:]) == ([b"one"], [])

    on_a_wire(monkeypatch, check)


def test_nothing_is_written_to_a_connection_that_ends_already(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        wire.closing = True
        connection.refuse(S.BadDecodingError, "a stranger")
        assert wire.did[1:] == []
        assert wall.refused == [("192.0.2.7", 1)]

    on_a_wire(monkeypatch, check)


def body(found: Any) -> Bounded:
    return Bounded(struct_to_binary(found))


def test_the_end_cuts_all_connections_off_and_waits_for_their_sessions() -> None:
    """Before the library stops."""
    did: list[str] = []
    wall: Any = Wall()

    async def stop() -> None:
        did.append("library stopped")

    async def sessions_end() -> None:
        await asyncio.sleep(0)
        did.append("sessions ended")

    wall.internal = SimpleNamespace(stop=stop)

    async def whole() -> None:
        listener = Listener(wall, "127.0.0.1", 0)
        listener._server = SimpleNamespace(close=lambda: did.append("closed"))  # type: ignore[assignment]
        client = SimpleNamespace(transport=SimpleNamespace(abort=lambda: did.append("cut off")))
        listener.connections = [client]  # type: ignore[assignment, list-item]
        listener.keep(sessions_end())
        await listener.__aexit__()

    asyncio.run(whole())
    assert did == ["closed", "cut off", "sessions ended", "library stopped"]


def test_what_a_lost_connection_has_sent_is_not_carried_out(monkeypatch: pytest.MonkeyPatch) -> None:
    async def check(connection: Connection, wire: Wire, taken: list[bytes], wall: Wall) -> None:
        connection.data_received(chunk(b"one"))
        connection.connection_lost(None)
        await turns()
        assert not taken

    on_a_wire(monkeypatch, check)
