"""The process of the gateway, by hand: its parent, its limits, its signs of life."""

from __future__ import annotations

import asyncio
import json
import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.requests import Request
from starlette.responses import Response

from gantryctl.gateway import __main__ as main_module
from gantryctl.gateway import app as app_module
from gantryctl.gateway import door as door_module
from gantryctl.gateway import live as live_module
from gantryctl.gateway import rest as rest_module
from gantryctl.gateway import server
from gantryctl.gateway import sessions as sessions_module
from gantryctl.gateway import settings as settings_module
from gantryctl.gateway import traces as traces_module
from gantryctl.gateway.access import Access
from gantryctl.gateway.settings import Settings
from gantryctl.service.memory.memory import SharedMemory, Word
from support.gateway_by_hand import HERE, scope


def test_an_application_has_the_page_of_the_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it is given no other one."""

    class Installed:
        def answer(self, _: Request) -> Response:
            return Response("the page")

    monkeypatch.setattr(app_module, "Page", Installed)
    memory, sent = SharedMemory.create(), list[Any]()
    app = app_module.build_app(Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path), memory)

    async def receive() -> dict[str, Any]:
        return {"type": "http.request", "body": b""}

    async def send(message: Any) -> None:
        sent.append(message)

    asked = scope(headers=[(b"host", HERE)]) | {"root_path": "", "raw_path": b"/", "http_version": "1.1"}
    asyncio.run(app(asked, receive, send))
    assert (sent[0]["status"], sent[1]["body"]) == (200, b"the page")
    memory.close()


def test_a_sign_of_life_is_given_twice_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    slept: list[float] = []

    async def sleep(time_s: float) -> None:
        slept.append(time_s)
        if len(slept) == 2:
            raise asyncio.CancelledError

    monkeypatch.setattr(app_module.asyncio, "sleep", sleep)
    memory: Any = SimpleNamespace(words={})
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(app_module._beat(memory))
    assert (slept, list(memory.words)) == ([0.5, 0.5], [Word.GATEWAY_NS])


@pytest.mark.parametrize("refused", [False, True])
def test_the_process_ends_with_its_parent_and_comes_behind_the_scan(
    monkeypatch: pytest.MonkeyPatch, refused: bool
) -> None:
    """Where the system does not let it step back it serves all the same."""
    did: list[Any] = []

    def nice(by: int) -> None:
        did.append(f"nice {by}")
        if refused:
            raise OSError

    memory = SimpleNamespace(words={Word.SUPERVISOR: 4711})
    monkeypatch.setattr(main_module, "SharedMemory", lambda handle: did.append(handle) or memory)
    monkeypatch.setattr(main_module, "die_with_parent", did.append)
    monkeypatch.setattr(main_module.os, "nice", nice)
    monkeypatch.setattr(main_module, "build_app", lambda settings, _: f"app at {settings.port}")
    monkeypatch.setattr(main_module, "run_server", lambda app, settings: did.append(app))
    said = {
        "host": "127.0.0.1", "port": 8650, "listener": 3, "certificate": None, "key": None, "names": [],
        "root": "r", "directory": "d",
    }  # fmt: skip
    assert main_module.main([json.dumps(said), "7"]) == 0
    assert did == [7, 4711, "nice 5", "app at 8650"]


def test_frames_are_not_compressed_and_the_end_takes_two_seconds(access: Access) -> None:
    config = server.make_server(None, access.settings).config
    assert (config.ws_per_message_deflate, config.timeout_graceful_shutdown) == (False, 2)
    assert (config.limit_concurrency, config.ws_max_size) == (256, 16_384)
    assert config.h11_max_incomplete_event_size == 16_384
    # A page that is gone is found out within 10 s; a connection of HTTP waits 5 s for its next request.
    assert (config.ws_ping_interval, config.ws_ping_timeout, config.timeout_keep_alive) == (5.0, 5.0, 5)
    secured = server.make_server(None, access.settings._replace(certificate="c", key="k")).config
    assert (secured.ssl_certfile, secured.ssl_keyfile, secured.lifespan) == ("c", "k", "on")
    # Nothing of a client is believed of where it is, nor written line by line.
    assert (config.proxy_headers, config.access_log, config.server_header) == (False, False, False)


@pytest.mark.parametrize(
    ("level", "said", "kept"),
    [
        (logging.ERROR, "the program failed", True), (logging.WARNING, "a client has sent nonsense", False),
        (logging.ERROR, "Invalid UTF-8 sequence received from client.", False),
    ],
)  # fmt: skip
def test_only_errors_of_the_program_are_in_the_log_of_clients(level: int, said: str, kept: bool) -> None:
    record = logging.LogRecord("uvicorn.error.clients", level, "", 0, said, (), None)
    assert bool(logging.getLogger("uvicorn.error.clients").filter(record)) is kept


def test_limits_of_the_page_are_those_of_the_manual() -> None:
    """The table of docs/explanation/security.md, in bytes, seconds and numbers."""
    wanted: dict[Any, dict[str, float]] = {
        settings_module: {
            "BODY_MAX": 65_536, "CONNECTIONS": 64, "CONNECTIONS_REMOTE": 8, "CONNECTIONS_OF_USER": 16,
            "UNUSED_S": 60.0, "REQUESTS_PER_S": 10.0, "REQUESTS_RESERVE": 40.0, "LOGINS_PER_S": 5.0,
            "LOGINS_RESERVE": 20.0, "HEADER_S": 5.0, "STUCK_S": 5.0,
        },
        sessions_module: {
            "IDLE_S": 900.0, "WHOLE_S": 28_800.0, "FAILURES": 5, "LOCK_MAX_S": 900.0, "SESSIONS_OF_USER": 16,
            "_REMEMBERED": 10_000,
        },
        door_module: {"WAITING": 256, "ARRIVALS": 1024},
        live_module: {"_STUCK_S": 5.0},
        rest_module: {"JOURNAL_MAX": 10_000, "NOTES_MAX": 50, "NOTES_PER_S": 4.0},
        traces_module: {"TIME_MAX_S": 30.0, "_LISTED": 500},
    }  # fmt: skip
    for module, limits in wanted.items():
        assert {name: getattr(module, name) for name in limits} == limits


def test_the_server_takes_the_socket_of_the_supervisor_and_tells_parties_apart(
    monkeypatch: pytest.MonkeyPatch, access: Access
) -> None:
    did: list[Any] = []

    async def serve(sockets: list[Any]) -> None:
        did.append(sockets)

    def make(app: Any, settings: Settings, session_of: Any = None) -> Any:
        did.append((app, settings, session_of))
        return SimpleNamespace(serve=serve)

    monkeypatch.setattr(server, "make_server", make)
    monkeypatch.setattr(server, "raise_handles", lambda: did.append("handles"))
    monkeypatch.setattr(server, "socket", SimpleNamespace(socket=lambda fileno: f"socket {fileno}"))
    app: Any = SimpleNamespace(session_of="whose session it is")
    settings = access.settings._replace(listener=7)
    server.run_server(app, settings)
    assert did == ["handles", (app, settings, "whose session it is"), ["socket 7"]]
