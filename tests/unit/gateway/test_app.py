"""The application: every request has its status, and every refusal is JSON of the one form."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from gantryctl.gateway.app import build_app
from gantryctl.gateway.routes import API, ROUTES
from gantryctl.gateway.settings import Settings
from gantryctl.service.memory.memory import SharedMemory


@pytest.fixture
def app(tmp_path: Path) -> Iterator[Any]:
    memory = SharedMemory.create()
    yield build_app(Settings("127.0.0.1", 1, -1, None, None, (), tmp_path, tmp_path), memory)
    memory.close()


def ask(app: Any, method: str, path: str) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body."""
    scope = {
        "type": "http", "method": method, "path": path, "raw_path": path.encode(), "query_string": b"",
        "headers": [(b"host", b"127.0.0.1:1")], "client": ("192.0.2.7", 1), "http_version": "1.1", "scheme": "http",
        "root_path": "", "state": {},
    }  # fmt: skip
    said: list[Any] = []

    async def receive() -> Any:
        return {"type": "http.request", "body": b""}

    async def send(message: Any) -> None:
        said.append(message)

    asyncio.run(app(scope, receive, send))
    headers = {name.decode(): value.decode() for name, value in said[0]["headers"]}
    return said[0]["status"], headers, b"".join(each.get("body", b"") for each in said[1:])


@pytest.mark.parametrize(
    ("method", "path", "status", "allowed"),
    [
        ("GET", "/api/v1/nothing", 404, None),
        ("POST", "/api/v1/nothing", 404, None),
        ("BREW", "/api/nothing", 404, None),
        ("GET", "/api/v1/traces/", 404, None),
        ("PUT", "/api/v1/status", 405, "GET, HEAD"),
        ("OPTIONS", "/api/v1/status", 405, "GET, HEAD"),
        ("BREW", "/api/v1/status", 405, "GET, HEAD"),
        ("GET", "/api/v1/login", 405, "POST"),
        ("DELETE", "/api/v1/traces/x", 405, "GET, HEAD"),
        ("POST", "/", 405, "GET, HEAD"),
        ("PUT", "/assets/x.js", 405, "GET, HEAD"),
    ],
)
def test_what_is_not_there_is_404_and_another_method_405(
    app: Any, method: str, path: str, status: int, allowed: str | None
) -> None:
    found, headers, body = ask(app, method, path)
    assert found == status
    assert headers["content-type"] == "application/json"
    assert headers.get("allow") == allowed
    said = json.loads(body)["error"]
    # SEC-08, "control is held", was said once where nothing was found.
    assert said["code"] == ("SEC-12" if status == 404 else "SEC-05")
    assert said["text"] == (
        "not found" if status == 404 else f"{method} is not possible here, only {allowed}"
    )


def test_every_route_answers_another_method_with_405(app: Any) -> None:
    for route in ROUTES:
        path = API + route.path.replace("{id}", "0" * 32)
        assert ask(app, "PATCH", path)[0] == 405
