"""OPC UA without a server: who is let in, what is shown as good, and which connections go on."""

from __future__ import annotations

import asyncio
import logging
import math
import os
from collections import defaultdict
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402
from asyncua.common.utils import NotEnoughData, ServiceError  # noqa: E402
from asyncua.crypto.permission_rules import UserRole  # noqa: E402
from asyncua.ua.ua_binary import struct_from_binary, struct_to_binary  # noqa: E402

from gantryctl.errors import StateError  # noqa: E402
from gantryctl.gateway.opcua import channel as channel_module  # noqa: E402
from gantryctl.gateway.opcua import listener as listener_module  # noqa: E402
from gantryctl.gateway.opcua import people as people_module  # noqa: E402
from gantryctl.gateway.opcua import server as server_module  # noqa: E402
from gantryctl.gateway.opcua import services as services_module  # noqa: E402
from gantryctl.gateway.opcua import space as space_module  # noqa: E402
from gantryctl.gateway.opcua import trust  # noqa: E402
from gantryctl.gateway.opcua.listener import Connection, Listener  # noqa: E402
from gantryctl.gateway.opcua.people import People, Reader  # noqa: E402
from gantryctl.gateway.opcua.reading import Bounded  # noqa: E402
from gantryctl.gateway.opcua.server import _SAID, POLICIES  # noqa: E402
from gantryctl.gateway.opcua.space import AddressSpace, _status, _value  # noqa: E402
from gantryctl.gateway.opcua.units import information, normal_range  # noqa: E402
from gantryctl.program import AxisState  # noqa: E402
from gantryctl.service.protocol.roles import Role  # noqa: E402
from gantryctl.service.protocol.tags import BY_NAME, TAGS  # noqa: E402
from gantryctl.service.supervisor.users import User  # noqa: E402

ANNA = User("anna", Role.VIEWER, "Anna", "", "", 1, 1, 1, "")
S = ua.StatusCodes


class Door:
    """People with one user, whose password is "right", at a time that the test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.written: list[tuple[str, str]] = []
        users: Any = SimpleNamespace(check=lambda name, password: ANNA if password == "right" else None)
        events: Any = SimpleNamespace(put=lambda kind, text, who=None, **_: self.written.append((kind, text)))

        async def here(work: Any, *values: Any) -> Any:
            return work(*values)

        monkeypatch.setattr(people_module.asyncio, "to_thread", here)
        self.people, self.now_s = People(users, events), 100.0
        self.people._rate._now = self.people._locks._now = lambda: self.now_s

    def admit(self, password: str, client: str = "c", name: str = "anna") -> bool:
        return asyncio.run(self.people.admit(name, password, b"certificate", client, "192.0.2.7"))


@pytest.fixture
def door(monkeypatch: pytest.MonkeyPatch) -> Door:
    return Door(monkeypatch)


def test_a_client_has_ten_tries_and_one_more_a_second_and_takes_none_from_others(door: Door) -> None:
    assert [door.admit("right") for _ in range(11)] == [True] * 10 + [False]
    assert door.admit("right", "other")
    door.now_s += 1.0
    assert [door.admit("right") for _ in range(2)] == [True, False]
    assert not door.admit("right", "third", name="")


def test_a_right_password_is_no_failure_and_forgets_those_before(door: Door) -> None:
    tries = [*["wrong"] * 4, "right", *["wrong"] * 4, "right"]
    assert [door.admit(each) for each in tries] == [each == "right" for each in tries]
    door.now_s += 20.0
    # Five wrong ones lock, also for the right one.
    assert [door.admit(each) for each in [*["wrong"] * 5, "right"]] == [False] * 6
    assert door.admit("right", "other")


def test_of_an_account_64_letters_are_remembered(door: Door) -> None:
    """Names from outside must not fill the memory."""
    assert not door.admit("wrong", name="v" * 1000)
    assert list(door.people._locks._failures) == [("v" * 64, "c")]


def test_whoever_is_let_in_reads_as_the_user_of_now(door: Door) -> None:
    assert door.admit("right")
    reader = door.people.get_user(None, "anna", "right", b"certificate")
    assert reader == Reader(UserRole.User, "anna", ANNA)
    assert door.written == [("login", "OPC UA session")]


def test_of_wrong_passwords_and_refused_clients_some_are_written(door: Door) -> None:
    for count in range(1, 13):
        door.people.refused("192.0.2.7", count, "a stranger")
    assert [text.partition(" times")[0].rpartition(" ")[2] for _, text in door.written] == [*"12345", "10"]


def test_without_a_file_of_users_there_are_none() -> None:
    def damaged() -> None:
        raise StateError("users.json")

    users: Any = SimpleNamespace(all=damaged)
    assert People(users, None).all() == {}  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("age_ms", "status"),
    [
        (0.0, S.Good), (500.0, S.Good), (500.1, S.UncertainNoCommunicationLastUsableValue),
        (5000.0, S.UncertainNoCommunicationLastUsableValue), (5000.1, S.BadNoCommunication),
        (math.nan, S.BadNoCommunication),
    ],
)  # fmt: skip
def test_a_value_is_good_for_half_a_second_and_shown_for_5_s(age_ms: float, status: int) -> None:
    assert _status(age_ms) == status


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("pos_act_deg", None, (None, S.BadSensorFailure)), ("vel_act_deg_s", None, (None, S.BadSensorFailure)),
        ("torque_act_nm", None, (None, S.BadSensorFailure)), ("target_deg", None, (None, S.BadOutOfService)),
        ("pos_act_deg", 5, (5.0, 0)), ("alarms", None, ("[]", 0)), ("brake_open", True, (True, 0)),
    ],
)  # fmt: skip
def test_what_is_not_believed_and_what_nobody_measures_are_told_apart(
    name: str, value: object, shown: tuple[object, int]
) -> None:
    assert _value(BY_NAME[name], value) == shown


class Node:
    """What was written into one variable, with its status."""

    def __init__(self) -> None:
        self.written: list[tuple[object, int]] = []

    async def write_value(self, data: Any) -> None:
        self.written.append((data.Value.Value, data.StatusCode.value))


def space() -> tuple[AddressSpace, dict[str, Node]]:
    nodes: dict[str, Node] = {}

    class All(dict[str, Any]):
        def __missing__(self, key: str) -> Any:
            return nodes.setdefault(key, Node())

    made = AddressSpace(None)  # type: ignore[arg-type]
    made._nodes = All()
    # The library finds the type of a value by itself.
    made._kinds = defaultdict(lambda: None)  # type: ignore[arg-type]
    return made, nodes


def test_an_angle_that_gets_old_loses_its_good_status_though_it_stays_the_same() -> None:
    made, nodes = space()
    tags = {"pos_act_deg": 12.5, "vel_act_deg_s": -0.5, "torque_act_nm": 7.0}
    for age_ms in (0.0, 400.0, 600.0, 6000.0):
        asyncio.run(made.show(tags, age_ms))
    statuses = [S.Good, S.UncertainNoCommunicationLastUsableValue, S.BadNoCommunication]
    assert nodes["ReadActualPosition.Position"].written == [(12.5, status) for status in statuses]
    assert nodes["ReadActualVelocity.Velocity"].written[0] == (-0.5, S.Good)
    assert nodes["ReadActualTorque.Torque"].written[0] == (7.0, S.Good)


def test_an_angle_that_is_not_believed_has_no_value() -> None:
    made, nodes = space()
    asyncio.run(made.show({"pos_act_deg": None, "vel_act_deg_s": 1.5}, 0.0))
    assert nodes["ReadActualPosition.Position"].written == [(None, S.BadSensorFailure)]
    assert nodes["ReadActualVelocity.Velocity"].written == [(1.5, S.Good)]


def test_before_the_first_picture_nothing_is_shown() -> None:
    made, nodes = space()
    for tags, age_ms in (({}, 0.0), ({"pos_act_deg": 0.0}, math.inf)):
        asyncio.run(made.show(tags, age_ms))
    assert not nodes


def test_units_are_those_of_recommendation_20_and_ranges_those_of_the_machine() -> None:
    """Common codes as bytes of a number: DD, E96, NU."""
    ids = {
        name: information(BY_NAME[name]).UnitId for name in ("pos_act_deg", "vel_act_deg_s", "torque_act_nm")
    }
    assert ids == {"pos_act_deg": 17476, "vel_act_deg_s": 4536630, "torque_act_nm": 20053}
    limits = {tag.name: None for tag in TAGS}
    wide = normal_range(BY_NAME["pos_act_deg"], limits)
    assert (wide.Low, wide.High) == (-360.0, 360.0)
    own = {"over_travel_min_deg": -190.0, "over_travel_max_deg": 185.0, "limit_switch_max_deg": 183.0}
    narrow = normal_range(BY_NAME["pos_act_deg"], limits | own)
    assert (narrow.Low, narrow.High) == (-190.0, 190.0)


def test_every_policy_signs_and_encrypts_and_none_has_sha_1() -> None:
    assert {policy.name for policy in POLICIES} == {
        "Basic256Sha256_SignAndEncrypt", "Aes128Sha256RsaOaep_SignAndEncrypt", "Aes256Sha256RsaPss_SignAndEncrypt",
    }  # fmt: skip
    assert (_SAID["MaxNodesPerRead"], _SAID["MaxNodesPerBrowse"], _SAID["MaxMonitoredItemsPerCall"]) == (
        1000, 100, 1000
    )  # fmt: skip


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


def test_every_row_of_a_list_is_revoked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two lists with two certificates each."""
    rows = {b"one": (5, 7), b"two": (7, 9)}
    monkeypatch.setattr(
        trust, "_revoked", lambda data: [SimpleNamespace(serial_number=each) for each in rows[data]]
    )
    events: Any = SimpleNamespace(put=lambda *_: None)
    known = trust.TrustList(tmp_path, events)
    for name in (b"one", b"two"):
        (tmp_path / "revoked" / name.decode()).write_bytes(name)
    assert known.refresh()
    assert known._serials == {5, 7, 9}
    assert not known.refresh()


@pytest.mark.parametrize(
    ("revoked", "trusted"),
    [({}, 1), ({"list": b"good"}, 1), ({".list": b"bad"}, 1), ({"a": b"bad", "b": b"good"}, 0), ({"b": b"bad"}, 0)],
)  # fmt: skip
def test_a_list_of_revoked_ones_that_cannot_be_read_voids_the_other_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, revoked: dict[str, bytes], trusted: int
) -> None:
    """Whatever is read behind it; a file with a dot is one that is being copied here."""

    def rows(data: bytes) -> list[Any]:
        if data == b"bad":
            raise ValueError("no list")
        return [SimpleNamespace(serial_number=5)]

    monkeypatch.setattr(trust, "_revoked", rows)
    monkeypatch.setattr(trust, "_certificate", lambda data: data)
    monkeypatch.setattr(trust, "_der", lambda data: data)
    monkeypatch.setattr(trust, "_is_authority", lambda data: False)
    known = trust.TrustList(tmp_path, SimpleNamespace(put=lambda *_: None))  # type: ignore[arg-type]
    (tmp_path / "trusted" / "client").write_bytes(b"client")
    for name, data in revoked.items():
        (tmp_path / "revoked" / name).write_bytes(data)
    assert known.refresh()
    assert len(known._known) == trusted


def test_a_certificate_in_letters_may_stand_behind_a_text(monkeypatch: pytest.MonkeyPatch) -> None:
    """As `openssl x509 -text` writes it."""
    read = {
        f"load_{kind}_x509_{what}": lambda _, kind=kind: kind
        for kind in ("pem", "der")
        for what in ("certificate", "crl")
    }
    monkeypatch.setattr(trust, "x509", SimpleNamespace(**read))
    for data, kind in (
        (b"Certificate:\n  Version: 3\n-----BEGIN CERTIFICATE-----", "pem"),
        (b"0\x82", "der"),
    ):
        assert (trust._certificate(data), trust._revoked(data)) == (kind, kind)


def test_no_request_is_looked_at_while_the_client_takes_no_answers() -> None:
    connection = Connection(Listener(Wall(), "127.0.0.1", 0))  # type: ignore[arg-type]
    assert (connection._writable.is_set(), connection.stuck_s) == (True, None)
    connection.pause_writing()
    assert not connection._writable.is_set()
    assert connection.stuck_s is not None
    connection.resume_writing()
    assert (connection._writable.is_set(), connection.stuck_s) == (True, None)


# --- one connection -----------------------------------------------------------------------------------


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


# --- what is shown ------------------------------------------------------------------------------------


def test_the_error_is_the_alarm_that_stopped_the_axis_with_its_code_and_its_text() -> None:
    made, nodes = space()
    rows = [
        {"code": "CTL-02", "text": "a consequence", "first_out": False},
        {"code": "INT-06", "text": "the cause", "first_out": True},
        {"code": "CTL-03", "text": "another one", "first_out": False},
    ]
    asyncio.run(made.show({"alarms": rows}, 0.0))
    asyncio.run(made.show({"alarms": rows[:1]}, 0.0))
    assert [value for value, _ in nodes["AxisErrorID"].written] == ["INT-06", ""]
    assert [value for value, _ in nodes["Text"].written] == ["the cause", ""]


def test_one_state_of_the_axis_is_true_and_all_others_are_not() -> None:
    made, nodes = space()
    for state in ("standstill", "error_stop"):
        asyncio.run(made.show({"axis_state": state}, 0.0))
    names = [space_module._words(each.name) for each in AxisState]
    assert {name: [value for value, _ in nodes[name].written] for name in names} == {
        name: {"Standstill": [True, False], "ErrorStop": [False, True]}.get(name, [False]) for name in names
    }
    assert {"Standstill", "ErrorStop", "Disabled"} <= set(names)


def test_without_limits_of_the_machine_a_range_is_that_of_its_unit() -> None:
    limits = {tag.name: None for tag in TAGS}
    ranges = {
        unit: normal_range(next(t for t in TAGS if t.kind == "float" and t.unit == unit), limits)
        for unit in ("deg", "deg/s", "deg/s2", "N m", "s", "ms", "us", "%", "")
    }
    assert {unit: (each.Low, each.High) for unit, each in ranges.items()} == {
        "deg": (-360.0, 360.0), "deg/s": (-10.0, 10.0), "deg/s2": (-10.0, 10.0), "N m": (-1000.0, 1000.0),
        "s": (0.0, 3600.0), "ms": (0.0, 1000.0), "us": (0.0, 1e5), "%": (0.0, 100.0), "": (0.0, 1.0),
    }  # fmt: skip
    eccentric = normal_range(BY_NAME["eccentric_moment_nm"], limits)
    assert (eccentric.Low, eccentric.High) == (-1e5, 1e5)


def test_a_value_has_the_time_in_which_it_was_measured() -> None:
    made, _ = space()
    times: list[Any] = []

    class Timed(Node):
        async def write_value(self, data: Any) -> None:
            times.append(data.SourceTimestamp)

    made._nodes = defaultdict(Timed)  # type: ignore[arg-type]
    begun = datetime.now(UTC)
    asyncio.run(made.show({"pos_act_deg": 1.0}, 400.0))
    ended = datetime.now(UTC)
    old = timedelta(milliseconds=400.0)
    assert all(begun - old <= each.replace(tzinfo=UTC) <= ended - old for each in times)


def test_ranges_are_written_where_a_limit_of_the_machine_has_changed() -> None:
    made, _ = space()
    written: list[Any] = []

    async def write(found: Any) -> None:
        written.append((found.Low, found.High))

    made._ranges = {"pos_act_deg": (BY_NAME["pos_act_deg"], SimpleNamespace(write_value=write))}  # type: ignore[dict-item]
    for limit in (185.0, 185.0, 190.0):
        asyncio.run(made.show({"over_travel_max_deg": limit}, 0.0))
    assert written == [(-185.0, 185.0), (-190.0, 190.0)]


def test_every_unit_has_its_sign_and_its_name() -> None:
    shown = {tag.unit: information(tag) for tag in TAGS if tag.kind == "float"}
    assert {unit: each.DisplayName.Text for unit, each in shown.items()} == {
        "deg": "°", "deg/s": "°/s", "deg/s2": "°/s²", "N m": "N·m", "s": "s", "ms": "ms", "us": "µs", "%": "%", "": "",
    }  # fmt: skip
    # Common codes of Recommendation 20, as bytes of a number.
    codes = {
        "deg": b"DD",
        "deg/s": b"E96",
        "deg/s2": b"M45",
        "N m": b"NU",
        "s": b"SEC",
        "ms": b"C26",
        "us": b"B98",
    }
    for unit, code in {**codes, "%": b"P1", "": b"C62"}.items():
        assert shown[unit].UnitId == int.from_bytes(code)


# --- sessions of a channel ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("logged_in", "closed"),
    [
        ((True, False, True, False), 1),
        ((False, False, True, True), 0),
        ((True, True, True), None),
        ((), None),
    ],
)
def test_the_oldest_session_that_is_not_logged_in_makes_room_for_a_fifth(
    monkeypatch: pytest.MonkeyPatch, logged_in: tuple[bool, ...], closed: int | None
) -> None:
    ended: list[int] = []

    def one(number: int, activated: bool) -> Any:
        async def close() -> None:
            ended.append(number)

        return SimpleNamespace(
            number=number, close=close, session=SimpleNamespace(is_activated=lambda: activated)
        )

    monkeypatch.setattr(channel_module, "Answers", lambda *_: SimpleNamespace(number=9))
    made: Any = object.__new__(channel_module.Channel)
    made._sessions = [one(number, activated) for number, activated in enumerate(logged_in)]
    made._wall, made._transport, made._secure = SimpleNamespace(internal=None, limits=None), None, "secure"
    asyncio.run(made._room())
    assert ended == ([] if closed is None else [closed])
    left = [number for number in range(len(logged_in)) if number != closed]
    assert [each.number for each in made._sessions] == [*left, 9]
    assert made._sessions[-1]._connection == "secure"


def test_four_sessions_that_are_logged_in_leave_no_room() -> None:
    made: Any = object.__new__(channel_module.Channel)
    made._sessions = [SimpleNamespace(session=SimpleNamespace(is_activated=lambda: True))] * 4
    with pytest.raises(ServiceError) as refused:
        asyncio.run(made._room())
    assert refused.value.code == S.BadTooManySessions


@pytest.mark.parametrize("name", ["_monitor", "_modify"])
def test_filters_are_judged_before_anything_else_is_read(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """In a copy: what is judged is read again by the service."""
    judged: list[tuple[str, bool]] = []

    def judge(body: str, *, new: bool) -> None:
        judged.append((body, new))
        raise ServiceError(S.BadMonitoredItemFilterUnsupported)

    monkeypatch.setattr(services_module, "judge_filters", judge)
    body: Any = SimpleNamespace(copy=lambda: "a copy")
    with pytest.raises(ServiceError):
        getattr(services_module, name)(None, body)
    assert judged == [("a copy", name == "_monitor")]


# --- the end of a channel ---------------------------------------------------------------------------------------


class Held:
    """A session of a channel: of a user, and whether it was activated; what ended is in `did`."""

    def __init__(self, did: list[str], user: Reader | None, activated: bool = True) -> None:
        async def closes(what: str) -> None:
            did.append(what)

        self.close = lambda: closes("answers")
        self.session: Any = None
        if user is not None:
            self.session = SimpleNamespace(
                user=user,
                is_activated=lambda: activated,
                close_session=lambda with_subscriptions: closes(f"session, {with_subscriptions}"),
            )


def channel_of(certificate: bytes, *sessions: Held, judge: Any = None) -> Any:
    channel: Any = object.__new__(channel_module.Channel)
    channel.certificate, channel._sessions = certificate, list(sessions)
    channel._wall = SimpleNamespace(trust=SimpleNamespace(judge=judge))
    return channel


def test_the_readers_of_a_channel_are_those_who_are_logged_in() -> None:
    anna = Reader(UserRole.User, "anna", ANNA)
    channel = channel_of(b"", Held([], None), Held([], anna, activated=False), Held([], anna))
    assert channel.readers == [anna]


def test_a_channel_goes_on_while_its_certificate_is_trusted_and_its_user_is_as_before() -> None:
    def refuses(certificate: bytes) -> None:
        raise trust.NotTrusted("the certificate is revoked")

    anna = Reader(UserRole.User, "anna", ANNA)
    for judge, certificate, users, why in (
        (lambda _: None, b"c", {"anna": ANNA}, ""),
        (refuses, b"c", {"anna": ANNA}, "the certificate is revoked"),
        (refuses, b"", {"anna": ANNA}, ""),
        (lambda _: None, b"c", {"anna": ANNA._replace(role=Role.ADMIN)}, "the user has changed"),
        (lambda _: None, b"c", {}, "the user has changed"),
    ):
        assert channel_of(certificate, Held([], anna), judge=judge).lapsed(users) == why


def test_the_end_of_a_channel_ends_its_subscriptions_too() -> None:
    """Nobody may find them on another channel."""
    did: list[str] = []
    asyncio.run(channel_of(b"", Held(did, Reader(UserRole.User, "anna", ANNA)), Held(did, None)).end())
    assert did == ["answers", "session, True", "answers"]


@pytest.mark.parametrize(("known", "name"), [(ANNA, "anna"), (None, None)])
def test_the_journal_names_whose_session_has_ended(
    door: Door, monkeypatch: pytest.MonkeyPatch, known: User | None, name: str | None
) -> None:
    whose: list[Any] = []
    monkeypatch.setattr(door.people._events, "put", lambda kind, text, who: whose.append((text, who)))
    door.people.ended(Reader(UserRole.User, "anna", known), "the user has changed")
    ((text, who),) = whose
    assert text == "OPC UA session ended: the user has changed"
    assert (who and who.user) == name


# --- requests of a channel --------------------------------------------------------------------------------------


def test_a_client_that_closes_its_channel_is_let_go() -> None:
    channel = channel_of(b"certificate")
    channel._greeted, channel._open, channel._until_s = True, True, math.inf
    channel._received = lambda header, body: None
    for kind, goes_on in ((ua.MessageType.SecureMessage, True), (ua.MessageType.SecureClose, False)):
        assert asyncio.run(channel.take(SimpleNamespace(MessageType=kind), None)) is goes_on
    channel._until_s = 0.0
    with pytest.raises(channel_module.ChannelRefused):
        asyncio.run(channel.take(SimpleNamespace(MessageType=ua.MessageType.SecureMessage), None))


def test_nothing_comes_before_hello() -> None:
    """By it the lengths of chunks are agreed on."""
    channel = channel_of(b"")
    channel._greeted = channel._open = False
    opened: list[Any] = []
    channel._open_channel = lambda *what: opened.append(what)
    for kind in (ua.MessageType.SecureOpen, ua.MessageType.SecureMessage, ua.MessageType.SecureClose):
        with pytest.raises(channel_module.ChannelRefused) as refused:
            asyncio.run(channel.take(SimpleNamespace(MessageType=kind), None))
        assert refused.value.status == S.BadTcpMessageTypeInvalid
    assert not opened


@pytest.mark.parametrize(
    ("request_", "parameters", "name", "item", "most"),
    [
        ("Read", ua.ReadParameters, "NodesToRead", ua.ReadValueId, 1000),
        ("Browse", ua.BrowseParameters, "NodesToBrowse", ua.BrowseDescription, 100),
        (
            "TranslateBrowsePathsToNodeIds",
            ua.TranslateBrowsePathsToNodeIdsParameters,
            "BrowsePaths",
            ua.BrowsePath,
            100,
        ),
        ("RegisterNodes", ua.RegisterNodesParameters, "NodesToRegister", ua.NodeId, 1000),
        ("UnregisterNodes", ua.UnregisterNodesParameters, "NodesToUnregister", ua.NodeId, 1000),
    ],
)
def test_each_service_takes_so_many_at_once(
    request_: str, parameters: Any, name: str, item: Any, most: int
) -> None:
    """Answers to browse are long: a hundred."""
    rule = services_module.READING[getattr(ua.ObjectIds, f"{request_}Request_Encoding_DefaultBinary")]
    for count in (most, most + 1):
        asked = parameters()
        setattr(asked, name, [item() for _ in range(count)])
        body = Bounded(struct_to_binary(asked))
        if count == most:
            assert len(rule(None, body)) > most  # type: ignore[arg-type]
            continue
        with pytest.raises(ServiceError) as refused:
            rule(None, body)  # type: ignore[arg-type]
        assert refused.value.code == S.BadTooManyOperations


def test_a_session_that_was_closed_takes_no_room() -> None:
    channel = channel_of(b"certificate")
    for state in ("Closed", "Activated", "Created"):
        session = SimpleNamespace(state=SimpleNamespace(name=state))
        channel._sessions.append(SimpleNamespace(session=session))
    channel._sessions.append(SimpleNamespace(session=None))
    channel._may_create = lambda body: None

    async def room() -> str:
        return "room"

    channel._room = room
    assert asyncio.run(channel._judged(channel_module.CREATE, None, None)) == ("room", None)
    assert [each.session.state.name for each in channel._sessions] == ["Activated", "Created"]


@pytest.mark.parametrize(
    ("token", "activated", "user", "status"),
    [
        ("other", True, Reader(UserRole.User, "anna", ANNA), S.BadSessionIdInvalid),
        ("own", False, Reader(UserRole.User, "anna", ANNA), S.BadSessionNotActivated),
        ("own", True, SimpleNamespace(name="somebody"), S.BadSessionNotActivated),
        ("own", True, Reader(UserRole.User, "anna", ANNA), S.BadServiceUnsupported),
    ],
)
def test_only_a_session_of_a_reader_asks(token: str, activated: bool, user: Any, status: int) -> None:
    session = SimpleNamespace(
        state=SimpleNamespace(name="Activated"), auth_token="own", user=user, is_activated=lambda: activated
    )
    channel = channel_of(b"certificate")
    channel._sessions.append(SimpleNamespace(session=session))
    with pytest.raises(ServiceError) as refused:
        asyncio.run(channel._judged(99_999, SimpleNamespace(AuthenticationToken=token), None))
    assert refused.value.code == status


def test_a_refusal_answers_its_request(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(channel_module, "nodeid_from_binary", lambda _: ua.NodeId(1, 0))
    monkeypatch.setattr(channel_module, "read_header", lambda _: SimpleNamespace(RequestHandle=4711))
    channel, said = channel_of(b"certificate"), list[Any]()
    faults = [ServiceError(S.BadUserAccessDenied), ValueError("no request")]

    async def judged(*_: Any) -> Any:
        raise faults.pop()

    channel._judged = judged
    channel._answers = SimpleNamespace(send_response=lambda handle, *_: said.append(handle))
    for _ in range(2):
        asyncio.run(channel._request(None, None))
    assert said == [4711, 4711]


def test_a_client_is_known_by_its_certificate(monkeypatch: pytest.MonkeyPatch) -> None:
    """By 16 digits of SHA-256: "abc" begins with ba7816bf 8f01cfea (FIPS 180-4, appendix)."""
    asked: list[Any] = []

    async def admit(*what: Any) -> bool:
        asked.append(what)
        return True

    token = ua.UserNameIdentityToken()
    monkeypatch.setattr(channel_module, "judge_identity", lambda _: None)
    wanted = SimpleNamespace(UserIdentityToken=token, ClientSignature=SimpleNamespace(Signature=b""))
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: wanted)
    channel = channel_of(b"abc")
    channel.address = "192.0.2.7"
    channel._secure = SimpleNamespace(
        security_policy=SimpleNamespace(
            host_certificate=b"", AsymmetricEncryptionURI="", peer_certificate=b"abc",
            asymmetric_cryptography=SimpleNamespace(verify=lambda *_: None),
        )
    )  # fmt: skip
    channel._wall.people = SimpleNamespace(admit=admit)
    channel._wall.internal = SimpleNamespace(decrypt_user_token=lambda *_: ("anna", "right"))
    asyncio.run(channel._may_activate(SimpleNamespace(nonce=b""), SimpleNamespace(copy=lambda: None)))
    assert asked == [("anna", "right", b"abc", "ba7816bf8f01cfea", "192.0.2.7")]


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


def test_the_opening_of_a_channel_has_one_chunk(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = SimpleNamespace(SecurityPolicyURI=channel_module.SecurityPolicyNone.URI, SenderCertificate=None)
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: asked)
    channel = channel_of(b"")
    channel._open, channel._received = False, lambda *_: None
    header, body = SimpleNamespace(body_size=0), SimpleNamespace(copy=lambda _: None)
    with pytest.raises(channel_module.ChannelRefused) as refused:
        channel._open_channel(header, body)
    assert refused.value.status == S.BadTcpMessageTypeInvalid


# --- the process ------------------------------------------------------------------------------------------------


def test_each_turn_shows_the_newest_tags_and_sweeps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five times a second, and a turn that came late is told."""
    did: list[Any] = []

    class Open:
        async def __aenter__(self) -> None:
            did.append("open")

        async def __aexit__(self, *_: object) -> None:
            did.append("closed")

        async def sweep(self) -> None:
            did.append("swept")

    async def show(tags: dict[str, Any], age_ms: float) -> None:
        did.append((tags, age_ms))

    async def made(settings: Any, events: Any) -> Any:
        return Open(), SimpleNamespace(show=show)

    async def sleep(time_s: float) -> None:
        did.append(time_s)
        raise asyncio.CancelledError

    picture = SimpleNamespace(fast=lambda: ({"pos_act_deg": 1.5}, 7.0), slow=lambda: {"machine": "a"})
    monkeypatch.setattr(server_module, "make_server", made)
    monkeypatch.setattr(server_module, "Snapshot", lambda memory: picture)
    monkeypatch.setattr(
        server_module, "HeldUp", lambda name, tell: SimpleNamespace(look=lambda: did.append(f"{name} looked"))
    )
    monkeypatch.setattr(server_module.asyncio, "sleep", sleep)
    memory: Any = SimpleNamespace(events={server_module.Source.OPCUA: None})
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(server_module.serve(server_module.Settings("", 1, "", ""), memory))
    assert did == [
        "open",
        "opcua looked",
        ({"pos_act_deg": 1.5, "machine": "a"}, 7.0),
        "swept",
        0.2,
        "closed",
    ]


def test_limits_of_opcua_are_those_of_the_manual() -> None:
    """The table of docs/explanation/security.md, in numbers, bytes, s and ms."""
    wanted: dict[Any, dict[str, float]] = {
        listener_module: {
            "CONNECTIONS": 32, "CONNECTIONS_LOOPBACK": 16, "CONNECTIONS_REMOTE": 4, "LOGIN_S": 5.0, "STUCK_S": 5.0,
            "_WAITING": 32, "_OUT_MAX": 1_048_576,
        },
        services_module: {
            "NODES_MAX": 1000, "PATHS_MAX": 100, "SUBSCRIPTIONS_MAX": 8, "ITEMS_MAX": 1000,
            "INTERVAL_MAX_MS": 60_000.0,
        },
        channel_module: {
            "BUFFER_MIN": 8192, "MESSAGE_MAX": 1_048_576, "LIFETIME_MIN_MS": 60_000, "LIFETIME_MAX_MS": 3_600_000,
            "NONCE_MIN": 32, "SESSIONS_MAX": 4,
        },
        people_module: {"CHECKS_PER_S": 1.0, "CHECKS_RESERVE": 10.0},
        server_module: {"SESSION_MAX_MS": 60_000.0, "_QUEUE_MAX": 10, "_UNACKNOWLEDGED_MAX": 20},
        space_module: {"PERIOD_S": 0.2, "GONE_S": 5.0},
    }  # fmt: skip
    for module, limits in wanted.items():
        assert {name: getattr(module, name) for name in limits} == limits


def test_a_variable_says_what_it_means_and_waits_for_its_first_value() -> None:
    """OPC UA Part 8: before the first picture no value is good."""
    written: list[Any] = []

    async def write_attribute(which: Any, data: Any) -> None:
        written.append((which, data.Value.Value.Text))

    async def write_value(data: Any) -> None:
        written.append((data.Value.Value, data.StatusCode.value))

    async def add_variable(*what: Any) -> Any:
        written.append((what[0].Identifier, what[1].Name))
        return SimpleNamespace(write_attribute=write_attribute, write_value=write_value)

    made = AddressSpace(None)  # type: ignore[arg-type]
    parent = SimpleNamespace(add_variable=add_variable)
    asyncio.run(made._add(parent, 2, "Text", ua.VariantType.String, "The whole line."))
    assert written == [
        ("Axis.Text", "Text"), (ua.AttributeIds.Description, "The whole line."), ("", S.BadWaitingForInitialData)
    ]  # fmt: skip
    assert [space_module._words(each) for each in ("ERROR_STOP", "STANDSTILL")] == ["ErrorStop", "Standstill"]


def test_the_library_is_told_its_limits_and_makes_nobody_an_administrator(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    internal, told = SimpleNamespace(), list[Any]()

    class Server(SimpleNamespace):
        def __init__(self, inner: Any) -> None:
            super().__init__(limits=SimpleNamespace(), _policies=[])
            assert inner is internal

        async def init(self) -> None:
            pass

        async def set_application_uri(self, uri: str) -> None:
            told.append(uri)

        async def _setup_server_nodes(self) -> None:
            pass

        def set_endpoint(self, where: str) -> None:
            told.append(where)

        def set_security_policy(self, policies: list[Any]) -> None:
            told.append(len(policies))

    async def nothing(*_: Any) -> None:
        pass

    monkeypatch.setattr(server_module, "Sessions", lambda user_manager: internal)
    monkeypatch.setattr(server_module, "Server", Server)
    monkeypatch.setattr(server_module, "AddressSpace", lambda _: SimpleNamespace(build=nothing))
    monkeypatch.setattr(server_module, "_say_limits", nothing)
    monkeypatch.setattr(server_module, "_identify", nothing)
    settings = server_module.Settings("127.0.0.1", 4840, str(tmp_path), str(tmp_path))
    listener, _ = asyncio.run(server_module.make_server(settings, SimpleNamespace(put=lambda *_: None)))  # type: ignore[arg-type]
    assert vars(internal) == {
        "allow_remote_admin": False, "supported_tokens": (ua.UserNameIdentityToken,),
        "max_session_timeout_ms": 60_000.0, "max_monitored_item_queue_size": 10,
        "max_unacked_messages_per_subscription": 20,
    }  # fmt: skip
    limits: Any = listener.wall.limits
    assert (limits.max_message_size, limits.max_chunk_count) == (1_048_576, 16)
    assert told == ["urn:gantryctl:server", "opc.tcp://127.0.0.1:4840/gantryctl", 3]


@pytest.mark.parametrize("fails", [False, True])
def test_the_private_key_is_of_its_owner_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, fails: bool
) -> None:
    """The library writes it with the umask of the process, which is the one of before afterwards."""
    masks: list[int] = []

    async def made(*_: Any) -> None:
        masks.append(os.umask(0o077))
        if fails:
            raise OSError("disk full")

    async def load(_: str) -> None:
        pass

    monkeypatch.setattr(server_module, "setup_self_signed_certificate", made)
    server: Any = SimpleNamespace(load_certificate=load, load_private_key=load)
    before = os.umask(0o027)
    try:
        if fails:
            with pytest.raises(OSError, match="disk full"):
                asyncio.run(server_module._identify(server, tmp_path, "127.0.0.1"))
        else:
            asyncio.run(server_module._identify(server, tmp_path, "127.0.0.1"))
        masks.append(os.umask(0o027))
    finally:
        os.umask(before)
    assert masks == [0o077, 0o027]


def test_the_process_ends_with_its_parent_and_leaves_the_processor_to_the_scan(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    did: list[Any] = []
    memory = SimpleNamespace(words={server_module.Word.SUPERVISOR: 4711})
    monkeypatch.setattr(server_module, "SharedMemory", lambda handle: did.append(handle) or memory)
    monkeypatch.setattr(server_module, "die_with_parent", did.append)
    monkeypatch.setattr(server_module.os, "nice", lambda by: did.append(f"nice {by}"))

    async def serve(settings: Any, _: Any) -> None:
        did.append(settings)

    monkeypatch.setattr(server_module, "serve", serve)
    level = logging.getLogger("asyncua").level
    try:
        said = '{"host":"h","port":1,"root":"r","directory":"d"}'
        assert server_module.main([said, "7"]) == 0
        assert logging.getLogger("asyncua").level == logging.CRITICAL
    finally:
        logging.getLogger("asyncua").setLevel(level)
    assert did == [7, 4711, "nice 5", server_module.Settings("h", 1, "r", "d")]


# --- the opening of a channel -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("receives", "sends", "taken"), [(8192, 8192, True), (8191, 8192, False), (8192, 8191, False)]
)
def test_hello_announces_buffers_of_8_kib_both_ways_and_comes_once(
    receives: int, sends: int, taken: bool
) -> None:
    channel, wrote = channel_of(b""), list[Any]()
    channel._greeted = False
    channel._answers = SimpleNamespace(
        _limits=SimpleNamespace(create_acknowledge_and_set_limits=lambda _: ua.Acknowledge())
    )
    channel._transport = SimpleNamespace(write=wrote.append)
    hello = ua.Hello(0, receives, sends, 0, 0, "")
    if not taken:
        with pytest.raises(channel_module.ChannelRefused) as refused:
            channel._hello(hello)
        assert (refused.value.status, wrote) == (S.BadConnectionRejected, [])
        return
    channel._hello(hello)
    assert len(wrote) == 1
    with pytest.raises(channel_module.ChannelRefused):
        channel._hello(hello)


POLICY = "http://opcfoundation.org/UA/SecurityPolicy#Basic256Sha256"
NONE = channel_module.SecurityPolicyNone.URI
RENEW, ISSUE = ua.SecurityTokenRequestType.Renew, ua.SecurityTokenRequestType.Issue
SIGN, BOTH, PLAIN = (
    ua.MessageSecurityMode.Sign,
    ua.MessageSecurityMode.SignAndEncrypt,
    ua.MessageSecurityMode.None_,
)


@pytest.mark.parametrize(
    ("before", "policy", "certificate", "mode", "nonce", "kind", "refused"),
    [
        (None, POLICY, b"one", BOTH, 32, ISSUE, None), (None, NONE, b"", PLAIN, 0, ISSUE, None),
        (None, POLICY, b"one", SIGN, 32, ISSUE, S.BadSecurityModeRejected),
        (None, POLICY, b"one", PLAIN, 32, ISSUE, S.BadSecurityModeRejected),
        (None, NONE, b"", BOTH, 0, ISSUE, S.BadSecurityModeRejected),
        (None, POLICY, b"one", BOTH, 31, ISSUE, S.BadNonceInvalid),
        (None, POLICY, b"one", BOTH, 33, ISSUE, S.BadNonceInvalid),
        (None, POLICY, b"one", BOTH, 32, RENEW, S.BadRequestTypeInvalid),
        (None, "urn:other", b"one", BOTH, 32, ISSUE, S.BadSecurityPolicyRejected),
        ((POLICY, b"one"), POLICY, b"one", BOTH, 32, RENEW, None),
        ((POLICY, b"one"), POLICY, b"one", BOTH, 32, ISSUE, S.BadRequestTypeInvalid),
        ((POLICY, b"one"), POLICY, b"two", BOTH, 32, RENEW, S.BadSecurityChecksFailed),
        ((POLICY, b"one"), NONE, b"", PLAIN, 0, RENEW, S.BadSecurityChecksFailed),
        ((NONE, b""), POLICY, b"one", BOTH, 32, RENEW, S.BadSecurityChecksFailed),
    ],
)  # fmt: skip
def test_a_channel_is_opened_signed_and_encrypted_and_renewed_by_its_client(
    monkeypatch: pytest.MonkeyPatch, before: Any, policy: str, certificate: bytes, mode: Any, nonce: int, kind: Any,
    refused: int | None,
) -> None:  # fmt: skip
    asked = SimpleNamespace(SecurityPolicyURI=policy, SenderCertificate=certificate)
    wanted = SimpleNamespace(
        SecurityMode=mode, ClientNonce=b"n" * nonce, RequestType=kind, RequestedLifetime=5
    )
    found = {ua.AsymmetricAlgorithmHeader: asked, ua.OpenSecureChannelParameters: wanted}
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda which, _: found[which])
    monkeypatch.setattr(channel_module, "first_of", lambda given: given)
    monkeypatch.setattr(channel_module, "bounded", lambda _: None)
    monkeypatch.setattr(channel_module, "nodeid_from_binary", lambda _: None)
    monkeypatch.setattr(channel_module, "read_header", lambda _: SimpleNamespace(RequestHandle=4711))
    monkeypatch.setattr(channel_module, "time", SimpleNamespace(monotonic=lambda: 100.0))
    channel, sent = channel_of(b"" if before is None else before[1], judge=lambda _: None), list[Any]()
    channel._open = before is not None
    channel._secure = SimpleNamespace(
        security_policy=SimpleNamespace(URI="" if before is None else before[0]),
        open=lambda *_: ua.OpenSecureChannelResult(),
    )
    channel._wall.policies, channel._wall.internal = {POLICY: None}, None
    message = SimpleNamespace(body=lambda: None, SequenceHeader=lambda: None)
    channel._received = lambda *_: message
    channel._answers = SimpleNamespace(send_response=lambda handle, *_: sent.append(handle))
    opens = lambda: channel._open_channel(SimpleNamespace(body_size=0), SimpleNamespace(copy=lambda _: None))  # noqa: E731
    if refused is not None:
        with pytest.raises(channel_module.ChannelRefused) as why:
            opens()
        assert (why.value.status, sent) == (refused, [])
        return
    opens()
    # A minute at the least, and a quarter more.
    assert (channel._open, channel.certificate, channel._until_s, sent) == (True, certificate, 175.0, [4711])


@pytest.mark.parametrize(("size", "left"), [(-1, b"cdef"), (0, b""), (2, b"cd"), (4, b"cdef"), (9, b"cdef")])
def test_a_copy_is_of_what_is_left_and_no_longer_than_asked_for(size: int, left: bytes) -> None:
    """And it leaves the message as it was."""
    message = Bounded(b"abcdef")
    assert message.read(2) == b"ab"
    copied = message.copy(size)
    assert copied.read(len(left)) == left
    with pytest.raises(NotEnoughData):
        copied.read(1)
    assert message.read(4) == b"cdef"


# --- subscriptions ----------------------------------------------------------------------------------------------


def held(*owners: str, items: int = 0) -> Any:
    """What session "own" holds beside "other" on its channel: subscriptions 1, 2, ... of these owners."""
    service = SimpleNamespace(_monitored_items=range(items))
    each = {
        number: SimpleNamespace(session_id=owner, monitored_item_srv=service)
        for number, owner in enumerate(owners, 1)
    }
    internal = SimpleNamespace(subscription_service=SimpleNamespace(subscriptions=each))
    return services_module.Holdings(internal, "own", {"own", "other"})


def body(found: Any) -> Bounded:
    return Bounded(struct_to_binary(found))


def status_of(work: Any) -> int:
    with pytest.raises(ServiceError) as refused:
        work()
    return int(refused.value.code)


def test_a_session_works_on_its_own_subscriptions_alone() -> None:
    """1 is its own, 2 that of another session of its channel, 3 of another channel."""
    mine, ids = held("own", "other", "stranger"), ua.ObjectIds
    reading = services_module.READING
    modify = reading[ids.ModifySubscriptionRequest_Encoding_DefaultBinary]
    delete = reading[ids.DeleteSubscriptionsRequest_Encoding_DefaultBinary]
    for number in (2, 3, 4):
        one = ua.ModifySubscriptionParameters(number)
        assert status_of(lambda one=one: modify(mine, body(one))) == S.BadSubscriptionIdInvalid
        many = ua.DeleteSubscriptionsParameters([1, number])
        assert status_of(lambda many=many: delete(mine, body(many))) == S.BadSubscriptionIdInvalid
        items = ua.CreateMonitoredItemsParameters(number, ua.TimestampsToReturn.Both, [])
        assert (
            status_of(lambda it=items: services_module._monitor(mine, body(it))) == S.BadSubscriptionIdInvalid
        )
    modify(mine, body(ua.ModifySubscriptionParameters(1)))
    delete(mine, body(ua.DeleteSubscriptionsParameters([1])))
    assert (list(mine.subscriptions()), list(mine.of_channel())) == ([1], [1, 2])


def test_a_channel_has_eight_subscriptions_and_a_thousand_items() -> None:
    asked = ua.CreateSubscriptionParameters()
    assert status_of(lambda: services_module._subscribe(held(*["own", "other"] * 4), body(asked))) == (
        S.BadTooManySubscriptions
    )
    services_module._subscribe(held(*["own", "other", "stranger"] * 3), body(asked))
    one = ua.CreateMonitoredItemsParameters(1, ua.TimestampsToReturn.Both, [ua.MonitoredItemCreateRequest()])
    assert services_module._monitor(held("own", "other", items=499), body(one))
    assert status_of(lambda: services_module._monitor(held("own", "other", items=500), body(one))) == (
        S.BadTooManyMonitoredItems
    )


@pytest.mark.parametrize(
    ("asked_ms", "given_ms"),
    [(0.001, 200.0), (200.0, 200.0), (500.0, 500.0), (1e9, 60_000.0), (math.nan, 200.0)],
)
def test_an_interval_is_no_shorter_than_a_turn_and_no_longer_than_a_minute(
    asked_ms: float, given_ms: float
) -> None:
    asked = ua.CreateSubscriptionParameters(asked_ms)
    made = services_module._subscribe(held(), body(asked))
    assert struct_from_binary(ua.CreateSubscriptionParameters, made).RequestedPublishingInterval == given_ms


def test_who_has_no_subscription_waits_for_nothing_and_acknowledges_its_own_alone() -> None:
    rows = [ua.SubscriptionAcknowledgement(number, 7) for number in (1, 2, 3)]
    asked = ua.PublishParameters(rows)
    assert status_of(lambda: services_module._publish(held("other"), body(asked))) == S.BadNoSubscription
    made = services_module._publish(held("own", "other", "own"), body(asked))
    found = struct_from_binary(ua.PublishParameters, made).SubscriptionAcknowledgements
    assert [row.SubscriptionId for row in found] == [1, 0, 3]


def test_a_null_list_is_an_empty_one() -> None:
    """OPC UA Part 6, section 5.2.5; the library fails on it."""
    delete = services_module.READING[ua.ObjectIds.DeleteMonitoredItemsRequest_Encoding_DefaultBinary]
    made = delete(held("own"), body(ua.DeleteMonitoredItemsParameters(1, None)))
    assert struct_from_binary(ua.DeleteMonitoredItemsParameters, made).MonitoredItemIds == []


def test_a_channel_without_a_certificate_finds_servers_and_nothing_else() -> None:
    channel = channel_of(b"")
    channel._answers = "answers"
    find = ua.ObjectIds.FindServersRequest_Encoding_DefaultBinary
    assert asyncio.run(channel._judged(find, None, "body")) == ("answers", "body")
    for kind in (channel_module.CREATE, channel_module.ACTIVATE, 99_999):
        assert status_of(lambda kind=kind: asyncio.run(channel._judged(kind, None, None))) == (
            S.BadSecurityPolicyRejected
        )
    assert {
        getattr(ua.ObjectIds, f"{name}Request_Encoding_DefaultBinary")
        for name in ("Write", "Call", "AddNodes")
    } <= services_module.CHANGES
    assert not services_module.CHANGES & services_module.READING.keys()


@pytest.mark.parametrize("sound", [True, False])
def test_a_session_is_activated_with_the_key_of_its_client(
    monkeypatch: pytest.MonkeyPatch, sound: bool
) -> None:
    """It signs the server's certificate and the nonce of this session."""
    signed: list[Any] = []

    async def admit(*_: Any) -> bool:
        return True

    def verify(*what: Any) -> None:
        signed.append(what)
        if not sound:
            raise ValueError("another key")

    monkeypatch.setattr(channel_module, "judge_identity", lambda _: None)
    wanted = SimpleNamespace(
        UserIdentityToken=ua.UserNameIdentityToken(), ClientSignature=SimpleNamespace(Signature=b"signature")
    )
    monkeypatch.setattr(channel_module, "struct_from_binary", lambda *_: wanted)
    channel = channel_of(b"abc")
    channel.address = "192.0.2.7"
    policy = SimpleNamespace(
        host_certificate=b"server", AsymmetricEncryptionURI="", peer_certificate=b"abc",
        asymmetric_cryptography=SimpleNamespace(verify=verify),
    )  # fmt: skip
    channel._secure = SimpleNamespace(security_policy=policy)
    channel._wall.people = SimpleNamespace(admit=admit)
    channel._wall.internal = SimpleNamespace(decrypt_user_token=lambda *_: ("anna", "right"))
    activates = channel._may_activate(SimpleNamespace(nonce=b"nonce"), SimpleNamespace(copy=lambda: None))
    if sound:
        asyncio.run(activates)
    else:
        assert status_of(lambda: asyncio.run(activates)) == S.BadApplicationSignatureInvalid
    assert signed == [(b"servernonce", b"signature")]
