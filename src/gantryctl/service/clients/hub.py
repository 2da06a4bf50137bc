"""Between connections and the controller, for the gateway and the local socket alike: frames out, commands in.

A connection gets the newest status frame when it is ready for one, so a slow reader loses frames and nothing queues up.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import secrets
import time
from collections import deque
from importlib.metadata import version
from typing import Any, Final

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import to_wire
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import Snapshot
from gantryctl.service.protocol.limits import (
    ANSWER_S,
    COMMANDS_PER_S,
    FLOOD_PER_S,
    FRAME_S,
    FRAMES_MAX,
    FRAMES_MAX_JOG,
    RENEW_S,
    SIGNS_PER_S,
    STALE_S,
    RateLimiter,
)
from gantryctl.service.protocol.messages import (
    FREE,
    SILENT,
    Identity,
    MessageRefused,
    action_of,
    parse,
    to_record,
)
from gantryctl.service.protocol.roles import MAY, Role, may

_QUICK_S: Final = 0.002
_OUT_MAX: Final = 200


class Flooded(Exception):
    """A connection that sends far too much, or does not take its replies."""


class Client:
    """One connection.

    Attributes:
        who: its identity.
        wake: set when there is something to send.
        used_s: when its user last asked for something, on the monotonic clock.
    """

    def __init__(self, hub: Hub, who: Identity) -> None:
        self.who, self.wake = who, asyncio.Event()
        self.used_s = time.monotonic()
        self._hub = hub
        self._replies: deque[str] = deque()
        self._asked: dict[int, float] = {}
        self._sent_frame = self._sent_slow = -1
        self._all = RateLimiter(FLOOD_PER_S)
        self._commands, self._signs = RateLimiter(COMMANDS_PER_S), RateLimiter(SIGNS_PER_S)

    def take(self, text: str | bytes) -> None:
        """One message of this connection: refused here, or handed to the controller.

        Raises:
            Flooded: the connection is to be closed.
        """
        if self._all.wait_s() > 0.0:
            raise Flooded
        seq = 0
        try:
            message = parse(text)
            seq = message.seq
            limit = self._signs if message.kind in SILENT else self._commands
            if limit.wait_s(message.kind if message.kind in FREE else "command") > 0.0:
                if message.kind in SILENT:
                    return
                raise MessageRefused(Code.SEC_06, reason=Words.TOO_MANY_COMMANDS(limit=COMMANDS_PER_S))
            if not may(self.who.role, action_of(message)):
                reason = Words.ROLE_MAY_NOT(role=self.who.role, action=action_of(message))
                raise MessageRefused(Code.SEC_01, reason=reason)
            raw: dict[str, Any] = {"type": message.kind, "seq": seq, "frame": message.frame, **message.values}
            if message.epoch is not None:
                raw["epoch"] = message.epoch
            if not self._hub.send(self.who, raw):
                raise MessageRefused(Code.SYS_11, reason=Words.NO_COMMANDS_NOW)
        except MessageRefused as refused:
            self.answer(refusal_of(seq or refused.seq, refused))
            return
        if message.kind not in SILENT:
            self.used_s = time.monotonic()
            self._asked[seq] = self.used_s + ANSWER_S
            self._hub.expect()

    def answer(self, reply: dict[str, Any]) -> None:
        """Queue a reply."""
        self._asked.pop(reply["seq"], None)
        if len(self._replies) < _OUT_MAX:
            self._replies.append(json.dumps(reply, separators=(",", ":"), ensure_ascii=False))
        self.wake.set()

    def overdue(self, now_s: float) -> None:
        """Answer for a controller that does not."""
        for seq in [seq for seq, due_s in self._asked.items() if now_s > due_s]:
            self.answer(refusal_of(seq, MessageRefused(Code.SYS_11, reason=Words.NO_ANSWER)))

    @property
    def waiting(self) -> bool:
        """A reply is expected."""
        return bool(self._asked)

    def outgoing(self) -> list[str]:
        """Everything to send now: replies in their order, then the newest status frame if it is new."""
        self.wake.clear()
        texts = list(self._replies)
        self._replies.clear()
        if self._hub.tick != self._sent_frame:
            self._sent_frame = self._hub.tick
            whole = self._hub.slow_version != self._sent_slow
            self._sent_slow = self._hub.slow_version
            texts.append(self._hub.status_text(whole=whole))
        return texts


class Hub:
    """All connections of one source.

    Attributes:
        tick: number of the newest picture. slow_version: of the tags that are sent on change.
        events: journal events of this source.
    """

    def __init__(self, memory: SharedMemory, source: Source) -> None:
        self._memory, self._source = memory, source
        self._commands, self._replies = memory.commands[source], memory.replies[source]
        self.events = EventLog(memory.events[source])
        self._picture = Snapshot(memory)
        self._clients: dict[str, Client] = {}
        self.tick = self.slow_version = 0
        self._fast: dict[str, Any] = {}
        self._slow: dict[str, Any] = {}
        self._age_ms = math.inf
        self._texts: dict[bool, str] = {}
        self._expected = asyncio.Event()
        while self._replies.take() is not None:
            pass  # of connections that are gone
        self.send(
            Identity("", "", Role.VIEWER, "local" if source is Source.LOCAL else "web"), {"type": "restart"}
        )

    # --- connections ------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._clients)

    def connect(self, user: str, role: Role, place: str) -> Client:
        """A new connection."""
        who = Identity(secrets.token_hex(4), user, role, place)
        client = self._clients[who.client] = Client(self, who)
        return client

    def leave(self, client: Client) -> None:
        """A connection has ended: its lease and its control end with it."""
        if self._clients.pop(client.who.client, None) is not None:
            self.send(client.who, {"type": "gone"})

    def clients(self) -> list[Client]:
        """All connections."""
        return list(self._clients.values())

    def welcome(self, who: Identity) -> str:
        """The first message to a connection."""
        found = {
            "type": "welcome",
            "client": who.client,
            "user": who.user,
            "role": str(who.role),
            "place": who.place,
            "may": [str(action) for action, roles in MAY.items() if who.role in roles],
            "version": version("gantryctl"),
            "frame_ms": round(FRAME_S * 1e3),
            "lease_ms": self._memory.words[Word.LEASE_MS],
            "renew_ms": round(RENEW_S * 1e3),
            "frames_max_jog": FRAMES_MAX_JOG,
            "frames_max": FRAMES_MAX,
            "stale_ms": round(STALE_S * 1e3),
        }
        return json.dumps(found, separators=(",", ":"))

    def send(self, who: Identity, message: dict[str, Any]) -> bool:
        """Hand a message to the controller; False when it takes none."""
        return self._commands.put(to_record(who, message))

    def expect(self) -> None:
        """A reply is on its way: look often."""
        self._expected.set()

    # --- pictures ---------------------------------------------------------------------------------

    def look(self) -> None:
        """Take a new picture and wake every connection."""
        fast, age_ms = self._picture.fast()
        self._slow = self._picture.slow()
        self._fast, self._age_ms = fast, age_ms
        self.slow_version = self._picture.version
        self.tick += 1
        self._texts.clear()
        now_s = time.monotonic()
        for client in self._clients.values():
            client.overdue(now_s)
            client.wake.set()

    @property
    def fresh(self) -> bool:
        """The controller is alive."""
        return self._age_ms <= STALE_S * 1e3

    def status(self, *, whole: bool = True) -> dict[str, Any]:
        """A `status` message."""
        return {
            "type": "status",
            "frame": self._fast.get("frame") or 0,
            "fresh": self.fresh,
            "age_ms": round(self._age_ms, 1) if math.isfinite(self._age_ms) else None,
            "tags": {**self._fast, **self._slow} if whole else self._fast,
        }

    def status_text(self, *, whole: bool) -> str:
        """The same as text, made once for all connections."""
        if whole not in self._texts:
            status = self.status(whole=whole)
            self._texts[whole] = json.dumps(status, separators=(",", ":"), ensure_ascii=False)
        return self._texts[whole]

    # --- tasks ------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Pictures and replies until cancelled."""
        await asyncio.gather(self._look_on(), self._answer_on())

    async def _look_on(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            self.look()
            due_s = max(due_s + FRAME_S, loop.time())
            await asyncio.sleep(due_s - loop.time())

    async def _answer_on(self) -> None:
        """Replies: every 2 ms while one is expected, else with every picture."""
        while True:
            while (record := self._replies.take()) is not None:
                with contextlib.suppress(ValueError):
                    name, reply = json.loads(record)
                    client = self._clients.get(name)
                    if client is not None:
                        client.answer(reply)
            if any(client.waiting for client in self._clients.values()):
                await asyncio.sleep(_QUICK_S)
                continue
            self._expected.clear()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._expected.wait(), FRAME_S)


def refusal_of(seq: int, refused: MessageRefused) -> dict[str, Any]:
    """A reply that refuses."""
    return {
        "type": "reply",
        "seq": seq,
        "ok": False,
        "code": str(refused.refusal.code),
        "text": str(refused),
        "values": to_wire(refused.refusal.values),
        "epoch": None,
        "journal": 0,
    }
