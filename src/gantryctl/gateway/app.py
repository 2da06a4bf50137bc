"""The application: guard, REST, WebSocket, page."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import time
from collections.abc import AsyncIterator, Sequence

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Match, Route, WebSocketRoute
from starlette.types import Receive, Scope, Send

from gantryctl.gateway.access import Access
from gantryctl.gateway.guard import Guard, error
from gantryctl.gateway.live import Live
from gantryctl.gateway.rest import Rest
from gantryctl.gateway.routes import API
from gantryctl.gateway.settings import Settings
from gantryctl.gateway.static import Page
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.clients.samples import Samples
from gantryctl.service.memory.memory import SharedMemory, Source, Word


def build_app(settings: Settings, memory: SharedMemory, page: Page | None = None) -> Guard:
    """The ASGI application; its hub runs for as long as the application does."""
    hub = Hub(memory, Source.WEB)
    access = Access(settings, hub, LinkTaker(memory.words))
    live, rest, shown = Live(access, hub), Rest(access, hub, Samples(memory)), page or Page()

    @contextlib.asynccontextmanager
    async def running(_: Starlette) -> AsyncIterator[None]:
        hub.look()
        tasks = [asyncio.create_task(work) for work in (hub.run(), _beat(memory))]
        for task in tasks:
            task.add_done_callback(_end_with)
        yield
        # A lease must not outlive the gateway that renews it.
        for client in hub.clients():
            hub.leave(client)
        hub.logins.close()
        hub.refusals.close()
        for task in tasks:
            task.cancel()

    # Not `shown.answer` itself: Starlette would take a thread for every file.
    async def file(request: Request) -> Response:
        return shown.answer(request)

    routes = rest.routes()
    app = Starlette(
        routes=[
            *routes,
            WebSocketRoute(f"{API}/socket", live.serve),
            Route("/api/{rest:path}", NoRoute(routes)),
            Route("/{path:path}", file, methods=["GET"]),
        ],
        exception_handlers={405: _page_is_read},
        lifespan=running,
    )
    return Guard(app, settings, access.session)


class NoRoute:
    """The answer to everything below `/api` that is no route: 405 where another method is one, else 404.

    Args:
        routes: that there are.
    """

    def __init__(self, routes: Sequence[Route]) -> None:
        self._routes = routes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer any method."""
        found = [each.methods or set() for each in self._routes if each.matches(scope)[0] is Match.PARTIAL]
        allowed = ", ".join(sorted(set().union(*found)))
        answer = wrong_method(scope["method"], allowed) if allowed else error(404, refusal(Code.SEC_12))
        await answer(scope, receive, send)


async def _page_is_read(request: Request, _: Exception) -> Response:
    return wrong_method(request.method, "GET, HEAD")


def wrong_method(method: str, allowed: str) -> Response:
    """405, and the methods that are possible."""
    reason = Words.METHOD_WRONG(method=method, allowed=allowed)
    return error(405, refusal(Code.SEC_05, reason=reason), allow=allowed)


def _end_with(task: asyncio.Task[None]) -> None:
    """End the process with a failed task."""
    # A gateway that shows old states is worse than no gateway: the supervisor starts it again.
    if not task.cancelled():
        logging.getLogger("uvicorn.error").error("the gateway ends: %r", task.exception())
        os.kill(os.getpid(), signal.SIGTERM)


async def _beat(memory: SharedMemory) -> None:
    """Give a sign of life twice a second."""
    while True:
        memory.words[Word.GATEWAY_NS] = time.monotonic_ns()
        await asyncio.sleep(0.5)
