"""Connections of clients to the controller, from page and local socket alike: status frames out, commands in.

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
from typing import Any, Final, NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.commit_wait import CommitWait
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.refusals import RefusalLog
from gantryctl.service.memory.snapshot import Snapshot
from gantryctl.service.protocol import limits, messages
from gantryctl.service.protocol.messages import SILENT, Identity, MessageRefused, compact
from gantryctl.service.protocol.roles import Role, may, rights_of

# The controller answers within a scan or two of 1 ms: replies are fetched as quickly while one is expected.
_QUICK_S: Final = 0.002
_OUT_MAX: Final = 200


class _Asked(NamedTuple):
    """A command without a reply: when the controller counts as silent, and whether the reply waits for the disk."""

    due_s: float
    kept_first: bool


class Flooded(Exception):
    """Raised for a connection that sends far too much: it is to be closed."""


class Client:
    """One connection.

    Attributes:
        who: its identity.
        wake: set when there is something to send.
        used_s: when its user last asked for something, on the monotonic clock.
        displaced: it has made room for a newer connection of its user, and is to be closed.
    """

    def __init__(self, hub: Hub, who: Identity) -> None:
        self.who, self.wake = who, asyncio.Event()
        self.used_s = time.monotonic()
        self.displaced = False
        self._hub = hub
        self._replies: deque[str] = deque()
        self._asked: dict[int, _Asked] = {}
        self._sent_frame = self._sent_slow = -1
        self._all = limits.RateLimiter(limits.FLOOD_PER_S)
        self._commands = limits.RateLimiter(limits.COMMANDS_PER_S)
        self._signs = limits.RateLimiter(limits.SIGNS_PER_S)

    def take(self, text: str | bytes) -> None:
        """Refuse one message of this connection, or hand it to the controller.

        Raises:
            Flooded: the connection is to be closed.
        """
        if self._all.wait_s() > 0.0:
            raise Flooded
        seq, message = 0, None
        try:
            message = messages.parse(text)
            seq = message.seq
            # Stop, quick stop and release have buckets of their own: a flood of commands must not hold them up.
            limit = self._signs if message.kind in SILENT else self._commands
            if limit.wait_s(message.kind if message.kind in messages.FREE else "command") > 0.0:
                if message.kind in SILENT:
                    return
                raise MessageRefused(Code.SEC_06, reason=Words.TOO_MANY_COMMANDS(limit=limits.COMMANDS_PER_S))
            if not may(self.who.role, messages.action_of(message)):
                reason = Words.ROLE_MAY_NOT(role=self.who.role, action=messages.action_of(message))
                raise MessageRefused(Code.SEC_01, reason=reason)
            raw: dict[str, Any] = {"type": message.kind, "seq": seq, "frame": message.frame, **message.values}
            if message.epoch is not None:
                raw["epoch"] = message.epoch
            if not self._hub.send(self.who, raw):
                raise MessageRefused(Code.SYS_11, reason=Words.NO_COMMANDS_NOW)
        except MessageRefused as refused:
            self._hub.refusals.put(self.who, message, refused)
            self.answer(messages.reply_to(seq or refused.seq, refused))
            return
        if message.kind not in SILENT:
            self.used_s = time.monotonic()
            self._asked[seq] = _Asked(self.used_s + limits.ANSWER_S, messages.is_kept_first(message))
            self._hub.expect()

    def waits_for_disk(self, reply: dict[str, Any]) -> bool:
        """Whether a reply of the controller is to wait for its event; from now on the controller owes nothing."""
        asked = self._asked.pop(reply["seq"], None)
        return asked is not None and asked.kept_first and reply["ok"]

    def answer(self, reply: dict[str, Any]) -> None:
        """Queue a reply."""
        self._asked.pop(reply["seq"], None)
        if len(self._replies) < _OUT_MAX:
            self._replies.append(compact(reply))
        self.wake.set()

    def overdue(self, now_s: float) -> None:
        """Answer in place of a silent controller."""
        for seq in [seq for seq, asked in self._asked.items() if now_s > asked.due_s]:
            self.answer(messages.reply_to(seq, MessageRefused(Code.SYS_11, reason=Words.NO_ANSWER)))

    @property
    def waiting(self) -> bool:
        """Replies are outstanding."""
        return bool(self._asked)

    def outgoing(self) -> list[str]:
        """Take everything to send now: replies in their order, then the newest status frame if it is new."""
        self.wake.clear()
        # A slow reader loses status frames, never a reply and never the newest frame.
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
        tick: number of the newest snapshot. slow_version: of the tags that are sent on change.
        events: journal events of this source. refusals: those of refused commands.
    """

    def __init__(self, memory: SharedMemory, source: Source) -> None:
        self._memory, self._source = memory, source
        self._commands, self._replies = memory.commands[source], memory.replies[source]
        self.events = EventLog(memory.events[source])
        self.refusals = RefusalLog(self.events)
        self._snapshot = Snapshot(memory)
        self._commits = CommitWait(memory.events[Source.CONTROLLER])
        self._clients: dict[str, Client] = {}
        self.tick = self.slow_version = 0
        self._fast: dict[str, Any] = {}
        self._slow: dict[str, Any] = {}
        self._age_ms = math.inf
        self._texts: dict[bool, str] = {}
        self._expected = asyncio.Event()
        # Connections of an earlier process of this source are gone, and their replies with them.
        self._replies.clear()
        place = "local" if source is Source.LOCAL else "web"
        self.send(Identity("", "", Role.VIEWER, place), {"type": "restart"})

    # --- connections ------------------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self._clients)

    def connect(self, user: str, role: Role, place: str, person: str = "") -> Client:
        """Add a connection; `person` is whose account the user is, see `Identity`."""
        who = Identity(secrets.token_hex(4), user, role, place, person)
        client = self._clients[who.client] = Client(self, who)
        return client

    def make_room(self, user: str, most: int, unused_s: float) -> bool:
        """Let the connection of a user that was unused for longest make room; False when none may.

        Args:
            most: connections of one user. unused_s: so long must it have been unused: a page that is closed connects
                again, and must not close the next one at once.
        """
        own = [
            client for client in self._clients.values() if client.who.user == user and not client.displaced
        ]
        if len(own) < most:
            return True
        # Who has control keeps it: a key may be held.
        free = [client for client in own if client.who.client != self._slow.get("authority_client")]
        oldest = min(free, key=lambda client: client.used_s, default=None)
        if oldest is None or time.monotonic() - oldest.used_s < unused_s:
            return False
        oldest.displaced = True
        oldest.wake.set()
        return True

    def leave(self, client: Client) -> None:
        """Remove a connection; the controller ends its lease and its control."""
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
            "person": who.person,
            "role": str(who.role),
            "place": who.place,
            "may": rights_of(who.role),
            "version": version("gantryctl"),
            "frame_ms": round(limits.FRAME_S * 1e3),
            "lease_ms": self._memory.words[Word.LEASE_MS],
            "renew_ms": round(limits.RENEW_S * 1e3),
            "frames_max_jog": limits.FRAMES_MAX_JOG,
            "frames_max": limits.FRAMES_MAX,
            "stale_ms": round(limits.STALE_S * 1e3),
        }
        return compact(found)

    def send(self, who: Identity, message: dict[str, Any]) -> bool:
        """Hand a message to the controller; False when it takes none."""
        return self._commands.put(messages.to_record(who, message))

    def expect(self) -> None:
        """Fetch replies quickly: one is expected."""
        self._expected.set()

    # --- snapshots --------------------------------------------------------------------------------

    def look(self) -> None:
        """Take a new snapshot and wake every connection."""
        self._fast, self._age_ms = self._snapshot.fast()
        self._slow = self._snapshot.slow()
        self.slow_version = self._snapshot.version
        self.tick += 1
        self._texts.clear()
        now_s = time.monotonic()
        for client in self._clients.values():
            client.overdue(now_s)
            client.wake.set()

    @property
    def fresh(self) -> bool:
        """Whether the controller is alive."""
        return self._age_ms <= limits.STALE_S * 1e3

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
        """The `status` message as text, made once for all connections."""
        if whole not in self._texts:
            self._texts[whole] = compact(self.status(whole=whole))
        return self._texts[whole]

    # --- tasks ------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Take snapshots and pass replies on, until cancelled."""
        await asyncio.gather(self._look_on(), self._answer_on())

    async def _look_on(self) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        while True:
            self.look()
            self.refusals.look()
            due_s = max(due_s + limits.FRAME_S, loop.time())
            await asyncio.sleep(due_s - loop.time())

    async def _answer_on(self) -> None:
        while True:
            while (record := self._replies.take()) is not None:
                with contextlib.suppress(ValueError):
                    name, reply = json.loads(record)
                    client = self._clients.get(name)
                    if client is not None and client.waits_for_disk(reply):
                        self._commits.add(name, reply)
                    elif client is not None:
                        client.answer(reply)
            for name, reply in self._commits.take():
                client = self._clients.get(name)
                if client is not None:
                    client.answer(reply)
            if len(self._commits) or any(client.waiting for client in self._clients.values()):
                await asyncio.sleep(_QUICK_S)
                continue
            self._expected.clear()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._expected.wait(), limits.FRAME_S)
