"""The table of REST routes, and the OpenAPI description that is made of it."""

from __future__ import annotations

import re
from importlib.metadata import version
from typing import Any, Final, NamedTuple

from gantryctl.service.protocol.answers import SCHEMAS, Schema, exactly, list_of, refer
from gantryctl.service.protocol.roles import Action


class RouteEntry(NamedTuple):
    """One route.

    Attributes:
        action: what the role must allow; None for all.
        answers: status and meaning.
        query: names of whole-number parameters.
        media: content type of the answer; empty for none.
        schema: of the answer; None for what is no JSON.
    """

    method: str
    path: str
    name: str
    action: Action | None
    summary: str
    answers: dict[int, str]
    query: tuple[str, ...] = ()
    media: str = "application/json"
    schema: Schema | None = None


API: Final = "/api/v1"
# Highest number in a query; of more than twelve digits nothing is read.
NUMBER_MAX: Final = 10**12 - 1
# One table: the routes of the application and their OpenAPI description are both made of it.
# JSON Lines: no JSON as a whole; what one line is stands beside it.
_LINES: Final = {"type": "string", "contentMediaType": "application/jsonl", "contentSchema": refer("Event")}
_LOG_IN: Final = {401: "not logged in", 403: "the role may not do it", 429: "too many requests"}
ROUTES: Final = (
    RouteEntry(
        "POST", "/login", "login", None, "Log in; the answer sets the session cookie.",
        {200: "logged in", 400: "not understood", 401: "wrong name or password", 403: "foreign page", 429: "locked",
         503: "users.json is damaged"}, schema=refer("Person"),
    ),
    RouteEntry(
        "POST", "/logout", "logout", Action.VIEW, "End the session.",
        {204: "done", 400: "not understood", 401: "not logged in"}, media="",
    ),
    RouteEntry(
        "GET", "/session", "session", Action.VIEW, "Who is logged in.", {200: "user and role", 401: "no login"},
        schema=refer("Person"),
    ),
    RouteEntry(
        "GET", "/console/{token}", "console", None, "Open the page as the console: `gantryctl console`.",
        {303: "the page, with a cookie that proves it", 403: "used before, too old, or not from this machine"},
        media="",
    ),
    RouteEntry(
        "GET", "/tags", "tags", Action.VIEW, "The tag table.", {200: "list of tags", **_LOG_IN},
        schema=list_of("TagRow"),
    ),
    RouteEntry(
        "GET", "/status", "status", Action.VIEW, "All tags as they are now.", {200: "status", **_LOG_IN},
        schema=refer("Status"),
    ),
    RouteEntry(
        "GET", "/samples", "samples", Action.VIEW, "Tags of every scan from row number `from` on, while power is on.",
        {200: "rows that are still in memory", 400: "not understood", **_LOG_IN}, ("from", "limit"),
        schema=refer("Samples"),
    ),
    RouteEntry(
        "GET", "/alarms", "alarms", Action.VIEW, "Active alarms and history.", {200: "rows", **_LOG_IN},
        schema=refer("Alarms"),
    ),
    RouteEntry(
        "GET", "/commissioning", "commissioning", Action.VIEW,
        "Steps and ledger of the commissioning under way, or of the last one since the service was started.",
        {200: "steps, what they have shown, what is open", 404: "there was none", **_LOG_IN},
        schema=refer("Commissioning"),
    ),
    RouteEntry(
        "GET", "/traces", "traces", Action.TRACES, "Recordings, newest first.", {200: "list", **_LOG_IN},
        schema=list_of("Recording"),
    ),
    RouteEntry(
        "GET", "/traces/{id}", "trace", Action.TRACES, "One recording as Parquet.",
        {200: "the file", 404: "no such recording", **_LOG_IN}, media="application/vnd.apache.parquet",
    ),
    RouteEntry(
        "GET", "/traces/{id}/columns", "columns", Action.TRACES,
        "Columns of a recording from `from` to `to` ms after its first row, thinned for a picture.",
        {200: "curves", 400: "not understood", 404: "no such recording", 422: "it cannot be read", **_LOG_IN},
        ("from", "to"), schema=refer("Columns"),
    ),
    RouteEntry(
        "GET", "/journal", "journal", Action.JOURNAL, "Events after number `from` as JSON lines.",
        {200: "events", 400: "not understood", 503: "the journal cannot be read", **_LOG_IN}, ("from", "limit"),
        media="application/jsonl", schema=_LINES,
    ),
    RouteEntry(
        "GET", "/notes", "notes", Action.VIEW, "Newest lines of the shift log, newest first.",
        {200: "lines", 503: "the journal cannot be read", **_LOG_IN}, schema=list_of("Note"),
    ),
    RouteEntry(
        "GET", "/people", "people", Action.VIEW, "Who has the page open now.", {200: "people", **_LOG_IN},
        schema=list_of("Visitor"),
    ),
    RouteEntry(
        "GET", "/health", "health", None, "Whether the controller is alive.", {200: "ok or silent"},
        schema=refer("Health"),
    ),
    RouteEntry(
        "GET", "/openapi.json", "openapi", None, "This description.", {200: "OpenAPI 3.1"},
        schema=refer("Description"),
    ),
)  # fmt: skip


# Before any route, by `guard` and the server.
_ALWAYS: Final = {403: "foreign host", 413: "too long", 429: "too many requests"}


def openapi() -> dict[str, Any]:
    """The description of all routes."""
    paths: dict[str, Any] = {}
    for route in ROUTES:
        paths.setdefault(API + route.path, {})[route.method.lower()] = _operation(route)
    return {
        "openapi": "3.1.0",
        "info": {"title": "gantryctl", "version": version("gantryctl"), "license": {"name": "MIT"}},
        "paths": paths,
        "components": {
            "securitySchemes": {
                "session": {"type": "apiKey", "in": "cookie", "name": "__Host-gantryctl_session"}
            },
            "schemas": SCHEMAS,
        },
    }


def _operation(route: RouteEntry) -> dict[str, Any]:
    failing = {"content": {"application/json": {"schema": refer("Error")}}}
    schema = {"schema": route.schema} if route.schema else {}
    given = {"content": {route.media: schema}} if route.media else {}
    found: dict[str, Any] = {
        "operationId": route.name,
        "summary": route.summary,
        "responses": {
            str(status): {"description": words, **(failing if status >= 400 else given)}
            for status, words in sorted({**_ALWAYS, **route.answers}.items())
        },
        "security": [] if route.action is None else [{"session": []}],
    }
    parameters: list[dict[str, Any]] = [
        {"name": name, "in": "query", "schema": {"type": "integer", "minimum": 0, "maximum": NUMBER_MAX}}
        for name in route.query
    ]
    parameters += [
        {"name": name, "in": "path", "required": True, "schema": {"type": "string"}}
        for name in re.findall(r"{(\w+)}", route.path)
    ]
    if parameters:
        found["parameters"] = parameters
    if route.method == "POST":
        names = ("user", "password") if route.name == "login" else ()
        body = exactly({name: {"type": "string"} for name in names})
        # Also where nothing is in it: a form of another page cannot send JSON.
        found["requestBody"] = {"required": True, "content": {"application/json": {"schema": body}}}
    return found
