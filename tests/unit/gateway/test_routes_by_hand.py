"""The table of routes, by hand: who may ask what, and how it is described."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from starlette.requests import Request

from gantryctl.gateway.access import Access
from gantryctl.gateway.rest import Rest
from gantryctl.gateway.routes import API, ROUTES, openapi
from gantryctl.service.protocol.roles import Action, Role
from support.gateway_by_hand import ANNA, JSON, scope

OPEN = {"login", "console", "health", "openapi"}
"""For everybody: without them nobody could log in, nor find out that the controller is silent."""
EVIDENCE = {
    "traces": Action.TRACES, "trace": Action.TRACES, "columns": Action.TRACES, "journal": Action.JOURNAL,
}  # fmt: skip
QUERIES = {"samples": ("from", "limit"), "columns": ("from", "to"), "journal": ("from", "limit")}


def test_each_route_asks_for_its_right() -> None:
    rights = {route.name: route.action for route in ROUTES}
    assert rights == {
        name: None if name in OPEN else EVIDENCE.get(name, Action.VIEW)
        for name in (
            "login", "logout", "session", "console", "tags", "status", "samples", "alarms", "commissioning", "traces",
            "trace", "columns", "journal", "notes", "people", "health", "openapi",
        )
    }  # fmt: skip
    assert {route.name for route in ROUTES if route.method == "POST"} == {"login", "logout"}


@pytest.mark.parametrize(("role", "refused"), [(None, 401), (Role.VIEWER, 403)])
def test_strangers_are_told_to_log_in_and_viewers_get_no_evidence(
    access: Access, monkeypatch: pytest.MonkeyPatch, role: Role | None, refused: int
) -> None:
    """Whatever a handler would answer."""
    if role is not None:
        session = access.sessions.open(ANNA._replace(role=role), "here")
        monkeypatch.setattr(access, "session", lambda _: session)
    samples: Any = SimpleNamespace()
    statuses = {}
    for route, row in zip(Rest(access, access.hub, samples).routes(), ROUTES, strict=True):
        if row.action is not None and (role is None or row.name in EVIDENCE):
            headers = [JSON] if row.method == "POST" else []
            asked: Any = route.endpoint(Request(scope(row.method, headers=headers)))
            statuses[row.name] = asyncio.run(asked).status_code
    assert statuses == dict.fromkeys(
        EVIDENCE if role else [row.name for row in ROUTES if row.action], refused
    )


def test_each_route_is_described_with_its_session_its_parameters_and_its_body() -> None:
    found = {
        each["operationId"]: each for methods in openapi()["paths"].values() for each in methods.values()
    }
    for route in ROUTES:
        each = found[route.name]
        assert each["security"] == ([] if route.name in OPEN else [{"session": []}])
        named = [(one["name"], one["in"], one.get("required", False)) for one in each.get("parameters", [])]
        assert named == [
            *((name, "query", False) for name in QUERIES.get(route.name, ())),
            *((name, "path", True) for name in ("token", "id") if f"{{{name}}}" in route.path),
        ]
        for status, said in each["responses"].items():
            refers = said.get("content", {}).get("application/json", {}).get("schema", {}).get("$ref", "")
            assert refers.endswith("/Error") is (int(status) >= 400), (route.name, status)
    body = found["login"]["requestBody"]["content"]["application/json"]["schema"]
    assert body["required"] == ["user", "password"]
    assert found["logout"]["requestBody"]["content"]["application/json"]["schema"]["required"] == []
    assert f"{API}/traces/{{id}}/columns" in openapi()["paths"]
