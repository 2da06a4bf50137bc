"""Gateway, shared memory and controller in one thread and virtual time: what a page does, from end to end."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from starlette.websockets import WebSocket

from gantryctl.gateway.access import COOKIE, Access
from gantryctl.gateway.live import Live
from gantryctl.gateway.settings import Settings
from gantryctl.machine import Machine
from gantryctl.operation.store import StateStore
from gantryctl.runtime import VirtualClock
from gantryctl.service.clients.console_link import LinkTaker
from gantryctl.service.clients.hub import Hub
from gantryctl.service.controller.process import Controller
from gantryctl.service.controller.publisher import Publisher
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.protocol.roles import Role
from support.marks import newest_mark

ORIGIN = "http://127.0.0.1:1"
SLICE_S = 0.02
"""Axis time between two turns of the event loop."""


class PageInProcess:
    """One logged-in page. Axis time passes while it waits, and only then."""

    def __init__(self, controller: Controller, memory: SharedMemory) -> None:
        self.controller, self.memory = controller, memory
        engine = controller.engine
        engine.clock = VirtualClock()
        controller.operator.now = lambda: engine.time_s
        controller.operator.frames.start_s = 0.0
        self._publisher = Publisher(
            controller.machine, engine, controller.operator, controller.alarms, controller.brake,
            controller._recorder, memory, real_time=False, version="test",
        )  # fmt: skip
        self._to_service: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.status: dict[str, Any] = {}
        self._replies: dict[int, dict[str, Any]] = {}
        self._client = ""
        self._seq = 0

    async def receive(self) -> dict[str, Any]:
        return await self._to_service.get()

    async def send(self, message: dict[str, Any]) -> None:
        """What the gateway sends to the page."""
        if message["type"] != "websocket.send":
            return
        frame = json.loads(message["text"])
        if frame["type"] == "status":
            self.status.update(frame["tags"])
        elif frame["type"] == "welcome":
            self._client = frame["client"]
        elif "seq" in frame:
            self._replies[frame["seq"]] = frame

    async def until_welcome(self) -> None:
        """Wait for the name of this connection, to which its frames are sealed."""
        while not self._client:
            await asyncio.sleep(0.001)

    async def until(self, holds: Callable[[], bool], timeout_s: float = 60.0) -> None:
        """Let axis time pass until something holds."""
        engine = self.controller.engine
        end_s = engine.time_s + timeout_s
        while not holds():
            assert engine.time_s < end_s, f"nothing happened within {timeout_s} s of axis time"
            if round(engine.time_s / SLICE_S) % 20 == 0:
                self._put("alive")
            engine.run_until(lambda _: self.controller._after_scan(self._publisher), SLICE_S)
            for ring in self.memory.events:  # a recorder that keeps everything at once
                ring.clear()
            await asyncio.sleep(0.003)  # the hub's tasks look every 2 ms while a reply is expected

    async def ask(self, kind: str, **values: object) -> dict[str, Any]:
        """The reply to one command."""
        seq = self._put(kind, **values)
        await self.until(lambda: seq in self._replies)
        return self._replies[seq]

    def _put(self, kind: str, **values: object) -> int:
        self._seq += 1
        operator = self.controller.operator
        # The newest frame, whatever the hub has sent: axis time runs faster than the clock of the hub.
        mark = newest_mark(operator, self._client)
        raw = {"type": kind, "seq": self._seq, "frame": mark, **values}
        if kind != "alive":
            raw["epoch"] = operator.authority.epoch
        self._to_service.put_nowait({"type": "websocket.receive", "text": json.dumps(raw)})
        return self._seq


def with_page(machine: Machine, folder: Path, script: Callable[[PageInProcess], Awaitable[None]]) -> None:
    """Run the script of a person at the page of a service that stands with power off."""
    memory = SharedMemory.create()
    memory.words[Word.RECORDER_NS] = 2**62  # a recorder that is always alive

    async def whole() -> None:
        hub = Hub(memory, Source.WEB)
        access = Access(
            Settings("127.0.0.1", 1, -1, None, None, (ORIGIN,), folder, folder), hub, LinkTaker(memory.words)
        )
        access.users.add("anna", Role.SERVICE, "correct horse battery")
        session = access.sessions.open(access.users.all()["anna"], "here")
        page = PageInProcess(Controller(machine, store, memory), memory)
        headers = [(b"cookie", f"{COOKIE}={session.token}".encode()), (b"origin", ORIGIN.encode())]
        scope = {
            "type": "websocket",
            "path": "/live",
            "headers": headers,
            "client": ("127.0.0.1", 1),
            "scheme": "ws",
        }
        await page._to_service.put({"type": "websocket.connect"})
        served = asyncio.create_task(Live(access, hub).serve(WebSocket(scope, page.receive, page.send)))
        looking = asyncio.create_task(hub.run())
        try:
            await page.until_welcome()
            await script(page)
        finally:
            for task in (served, looking):
                task.cancel()
                with suppress(asyncio.CancelledError):
                    await task

    try:
        with StateStore(machine) as store:
            asyncio.run(whole())
    finally:
        memory.close()
