"""The REST routes, all of them to read; nothing moves over REST.

Hold-to-run needs a connection whose end is noticed, and a POST has none (decision 0011).
"""

from __future__ import annotations

import asyncio
import json
import math
import os
from collections.abc import Awaitable, Callable, Iterable
from pathlib import Path
from typing import Any, Final

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import Receive, Scope, Send

from gantryctl.errors import GantryctlError
from gantryctl.gateway.access import Access, person
from gantryctl.gateway.guard import error
from gantryctl.gateway.routes import API, NUMBER_MAX, ROUTES, openapi
from gantryctl.gateway.settings import BODY_MAX
from gantryctl.gateway.traces import Content, Recorded, Traces
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.hub import Hub
from gantryctl.service.clients.samples import ANSWERS_PER_S, ROWS_MAX, Samples
from gantryctl.service.protocol.limits import RateLimiter
from gantryctl.service.protocol.messages import NOTE, Identity
from gantryctl.service.protocol.roles import Action
from gantryctl.service.protocol.tags import TAGS
from gantryctl.service.recorder.journal.reading import read_journal

# Lines of one answer; a client asks again from the last number.
JOURNAL_MAX: Final = 10_000
# Lines of the shift log in one answer. Where there are fewer the whole journal is read for them, so not more often than
# this for all together.
NOTES_MAX: Final = 50
NOTES_PER_S: Final = 4.0
_JOURNAL_QUERY: Final = (("from", 0), ("limit", 1000))
# ms from the first row.
_COLUMNS_QUERY: Final = (("from", 0), ("to", NUMBER_MAX))
_SAMPLES_QUERY: Final = (("from", NUMBER_MAX), ("limit", ROWS_MAX))
Handler = Callable[[Request], Awaitable[Response]]


class Rest:
    """All routes of the table, each behind its check."""

    def __init__(self, access: Access, hub: Hub, samples: Samples) -> None:
        self._access, self._hub, self._scans = access, hub, samples
        self._scopes = RateLimiter(ANSWERS_PER_S, now=hub.now)
        self._notes_asked = RateLimiter(NOTES_PER_S, now=hub.now)
        self._directory = access.settings.directory
        # The loop has the processor every 5 ms beside one thread, every 20 ms beside four of them.
        self._one_reader = asyncio.Semaphore(1)
        self._files = Traces(self._directory / "traces")
        self._recorded = Recorded()
        self._described = openapi()

    def routes(self) -> list[Route]:
        """For the application."""
        return [
            Route(
                API + row.path, self._behind(row.action, getattr(self, f"_{row.name}")), methods=[row.method]
            )
            for row in ROUTES
        ]

    def _behind(self, action: Action | None, handler: Handler) -> Handler:
        async def checked(request: Request) -> Response:
            return self._access.refuse(request, action) or await handler(request)

        return checked

    async def _login(self, request: Request) -> Response:
        try:
            found: Any = json.loads(await request.body())
            name, password = found["user"], found["password"]
            right = set(found) == {"user", "password"} and isinstance(name, str) and isinstance(password, str)
        except ClientDisconnect:
            return error(413, refusal(Code.SEC_05, reason=Words.BODY_TOO_LONG(limit=BODY_MAX)))
        except (ValueError, KeyError, TypeError, RecursionError):
            right = False
        if not right:
            return error(400, refusal(Code.SEC_05, reason=Words.NAME_AND_PASSWORD))
        return await self._access.log_in(request, name, password)

    async def _logout(self, request: Request) -> Response:
        return self._access.log_out(request)

    async def _session(self, request: Request) -> Response:
        session = self._access.session(request)
        assert session is not None
        return JSONResponse(person(session))

    async def _console(self, request: Request) -> Response:
        return self._access.open_console(request, request.path_params["token"])

    async def _tags(self, _: Request) -> Response:
        rows = [{**tag._asdict(), "type": tag.kind, "labels": list(tag.labels)} for tag in TAGS]
        return JSONResponse([{key: row[key] for key in row if key != "kind"} for row in rows])

    async def _status(self, _: Request) -> Response:
        return JSONResponse(self._hub.status())

    async def _alarms(self, _: Request) -> Response:
        tags = self._hub.status()["tags"]
        return JSONResponse({"active": tags.get("alarms", []), "history": tags.get("alarm_history", [])})

    async def _commissioning(self, _: Request) -> Response:
        found = self._hub.commissioning()
        if found is None:
            return error(404, refusal(Code.CTL_14, reason=Words.NOT_BEING_COMMISSIONED))
        return JSONResponse(found)

    async def _traces(self, _: Request) -> Response:
        return JSONResponse(await asyncio.to_thread(self._files.rows))

    async def _trace(self, request: Request) -> Response:
        found = await asyncio.to_thread(self._files.open, request.path_params["id"])
        if found is None:
            return error(404, refusal(Code.SEC_12))
        name, size, content = found
        # Reading is journaled too (docs/explanation/security.md).
        self._log(request, f"recording {name} was read")
        headers = {"content-length": str(size), "content-disposition": f'attachment; filename="{name}"'}
        return _FileResponse(content, headers)

    async def _columns(self, request: Request) -> Response:
        asked = _numbers(request, _COLUMNS_QUERY)
        if isinstance(asked, Response):
            return asked
        found = await asyncio.to_thread(self._files.handle, request.path_params["id"])
        if found is None:
            return error(404, refusal(Code.SEC_12))
        name, _, handle = found
        try:
            if self._recorded.busy:
                return error(429, refusal(Code.SEC_06, reason=Words.TOO_MANY_REQUESTS), retry_after="1")
            answer = await self._recorded.columns(handle, name, *asked)
        finally:
            os.close(handle)
        if answer is None:
            return error(422, refusal(Code.SEC_05, reason=Words.NO_RECORDING(name=name)))
        self._log(request, f"recording {name} was read")
        return Response(answer, media_type="application/json")

    async def _samples(self, request: Request) -> Response:
        asked = _numbers(request, _SAMPLES_QUERY)
        if isinstance(asked, Response):
            return asked
        wait_s = self._scopes.wait_s()
        if wait_s > 0.0:
            busy = refusal(Code.SEC_06, reason=Words.TOO_MANY_SCOPES(limit=ANSWERS_PER_S))
            return error(429, busy, retry_after=str(math.ceil(wait_s)))
        # Beside the loop: status frames and commands, a Stop above all, do not wait for a long answer.
        return JSONResponse(await asyncio.to_thread(self._scans.read, *asked))

    async def _journal(self, request: Request) -> Response:
        asked = _numbers(request, _JOURNAL_QUERY)
        if isinstance(asked, Response):
            return asked
        after, limit = asked
        try:
            async with self._one_reader:
                lines = await asyncio.to_thread(
                    _journal_lines, self._directory, after, min(limit, JOURNAL_MAX)
                )
        except GantryctlError as fault:
            return error(503, refusal(Code.JRN_02, reason=str(fault)))
        self._log(request, f"journal was read from {after}")
        return Response(lines, media_type="application/jsonl")

    async def _notes(self, _: Request) -> Response:
        if self._notes_asked.wait_s() > 0.0:
            return error(429, refusal(Code.SEC_06, reason=Words.TOO_MANY_REQUESTS), retry_after="1")
        try:
            rows = await asyncio.to_thread(
                read_journal, self._directory, limit=NOTES_MAX, newest=True, kind=NOTE
            )
        except GantryctlError as fault:
            return error(503, refusal(Code.JRN_02, reason=str(fault)))
        told = [{"seq": row.seq, **{key: row.values[key] for key in ("utc", "user", "text")}} for row in rows]
        return JSONResponse(told[::-1])

    async def _people(self, _: Request) -> Response:
        who = sorted(
            (client.who for client in self._hub.clients()), key=lambda each: (each.user, each.client)
        )
        keys = ("client", "user", "person", "role", "place")
        return JSONResponse([{key: str(getattr(each, key)) for key in keys} for each in who])

    async def _health(self, _: Request) -> Response:
        return JSONResponse({"controller": "ok" if self._hub.fresh else "silent"})

    async def _openapi(self, _: Request) -> Response:
        return JSONResponse(self._described)

    def _log(self, request: Request, text: str) -> None:
        session = self._access.session(request)
        if session is not None:
            who = Identity("", session.user, session.role, self._access.place(request))
            self._hub.events.put("read", text, who)


class _FileResponse(StreamingResponse):
    """A recording, closed when it was sent, or its client has left, before the first chunk too."""

    def __init__(self, content: Content, headers: dict[str, str]) -> None:
        super().__init__(content, 200, headers, media_type="application/vnd.apache.parquet")
        self._content = content

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send it."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._content.close()


def _journal_lines(directory: Path, after: int, limit: int) -> str:
    """Events as JSON lines, written beside the loop as well: 10 000 of them take a tenth of a second."""
    rows = read_journal(directory, after, limit)
    return "".join(json.dumps({"seq": row.seq, **row.values, "hash": row.hash}) + "\n" for row in rows)


def _numbers(request: Request, query: Iterable[tuple[str, int]]) -> list[int] | Response:
    """The whole numbers of a query, by names and defaults; or why it is not understood."""
    asked = []
    for name, default in query:
        text = request.query_params.get(name, str(default))
        if not (text.isascii() and text.isdigit() and len(text) <= len(str(NUMBER_MAX))):
            return error(400, refusal(Code.SEC_05, reason=Words.WHOLE_NUMBER(name=name)))
        asked.append(int(text))
    return asked
