"""The process of OPC UA, by hand: its turns, its limits, its key, and what the library is told."""

from __future__ import annotations

import asyncio
import logging
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

asyncua = pytest.importorskip("asyncua", reason="the extra [opcua] is not installed")
from asyncua import ua  # noqa: E402

from gantryctl.gateway.opcua import channel as channel_module  # noqa: E402
from gantryctl.gateway.opcua import listener as listener_module  # noqa: E402
from gantryctl.gateway.opcua import people as people_module  # noqa: E402
from gantryctl.gateway.opcua import server as server_module  # noqa: E402
from gantryctl.gateway.opcua import services as services_module  # noqa: E402
from gantryctl.gateway.opcua import space as space_module  # noqa: E402
from gantryctl.gateway.opcua.server import _SAID, POLICIES  # noqa: E402


def test_every_policy_signs_and_encrypts_and_none_has_sha_1() -> None:
    assert {policy.name for policy in POLICIES} == {
        "Basic256Sha256_SignAndEncrypt", "Aes128Sha256RsaOaep_SignAndEncrypt", "Aes256Sha256RsaPss_SignAndEncrypt",
    }  # fmt: skip
    assert (_SAID["MaxNodesPerRead"], _SAID["MaxNodesPerBrowse"], _SAID["MaxMonitoredItemsPerCall"]) == (
        1000, 100, 1000
    )  # fmt: skip


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
            "INTERVAL_MAX_MS": 60_000.0, "QUEUE_MAX": 10,
        },
        channel_module: {
            "BUFFER_MIN": 8192, "MESSAGE_MAX": 1_048_576, "LIFETIME_MIN_MS": 60_000, "LIFETIME_MAX_MS": 3_600_000,
            "NONCE_MIN": 32, "SESSIONS_MAX": 4,
        },
        people_module: {"CHECKS_PER_S": 1.0, "CHECKS_RESERVE": 10.0},
        server_module: {"SESSION_MAX_MS": 60_000.0, "_UNACKNOWLEDGED_MAX": 20},
        space_module: {"PERIOD_S": 0.2, "GONE_S": 5.0},
    }  # fmt: skip
    for module, limits in wanted.items():
        assert {name: getattr(module, name) for name in limits} == limits


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
    settings = server_module.Settings("127.0.0.1", 4841, str(tmp_path / "root"), str(tmp_path / "machine"))
    listener, _ = asyncio.run(server_module.make_server(settings, SimpleNamespace(put=lambda *_: None)))  # type: ignore[arg-type]
    assert vars(internal) == {
        "allow_remote_admin": False, "supported_tokens": (ua.UserNameIdentityToken,),
        "max_session_timeout_ms": 60_000.0, "max_monitored_item_queue_size": 10,
        "max_unacked_messages_per_subscription": 20,
    }  # fmt: skip
    # Users are those of the installation, clients those of the machine.
    users: Any = listener.wall.people._users
    assert users.path.parent == tmp_path / "root"
    assert listener.wall.trust._trusted == tmp_path / "machine" / "opcua" / "trusted"
    limits: Any = listener.wall.limits
    assert (limits.max_message_size, limits.max_chunk_count) == (1_048_576, 16)
    assert told == ["urn:gantryctl:server", "opc.tcp://127.0.0.1:4841/gantryctl", 3]


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


def test_clients_are_told_the_limits_that_they_have() -> None:
    """OPC UA Part 5, section 6.3.11."""
    told: dict[Any, Any] = {}

    def get_node(node: Any) -> Any:
        async def write_value(data: Any) -> None:
            told[node.Identifier] = (data.Value.Value, data.Value.VariantType)

        return SimpleNamespace(write_value=write_value)

    asyncio.run(server_module._say_limits(SimpleNamespace(get_node=get_node)))  # type: ignore[arg-type]
    wanted = {
        "MaxSubscriptionsPerSession": 8, "MaxMonitoredItems": 1000, "OperationLimits_MaxNodesPerRead": 1000,
        "OperationLimits_MaxNodesPerRegisterNodes": 1000, "OperationLimits_MaxNodesPerBrowse": 100,
        "OperationLimits_MaxNodesPerTranslateBrowsePathsToNodeIds": 100,
        "OperationLimits_MaxMonitoredItemsPerCall": 1000,
    }  # fmt: skip
    assert told == {
        getattr(ua.ObjectIds, f"Server_ServerCapabilities_{name}"): (most, ua.VariantType.UInt32)
        for name, most in wanted.items()
    }
