"""Connections of clients to the controller, from page and local socket alike: status frames out, commands in.

A connection gets the newest status frame when it is ready for one, so a slow reader loses frames and nothing queues up.
Each frame carries a mark of this connection, which commands hand back; whoever holds a key gets frames more often.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import secrets
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from typing import Any, Final, NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.clients.commit_wait import CommitWait
from gantryctl.service.clients.logins import LoginLog
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.held_up import HeldUp
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.refusals import RefusalLog
from gantryctl.service.memory.snapshot import Snapshot
from gantryctl.service.protocol import limits, messages
from gantryctl.service.protocol.frames import mark_of
from gantryctl.service.protocol.messages import SILENT, Identity, MessageRefused, compact
from gantryctl.service.protocol.roles import Role, may, rights_of

# The controller answers within a scan or two of 1 ms: replies are fetched as quickly while one is expected.
_QUICK_S: Final = 0.002
_OUT_MAX: Final = 200
# Without a press or renewal for this long a connection holds no key, and gets frames like all others.
_KEY_S: Final = 0.25
# Epochs rise one by one within a run of the controller, and a run begins at a random number of 40 bits: a snapshot that
# is less than this behind a reply was made before it. The snapshot is 10 ms old at most: some ten epochs at 1 ms.
_EPOCHS_BEHIND: Final = 256


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
        self.used_s = hub.now()
        self.displaced = False
        self._hub = hub
        self._replies: deque[str] = deque()
        self._asked: dict[int, _Asked] = {}
        self._due = True
        self._sent_slow = -1
        self._epoch = 0
        self._key_s = -math.inf
        self._all = limits.RateLimiter(limits.FLOOD_PER_S, now=hub.now)
        self._commands = limits.RateLimiter(limits.COMMANDS_PER_S, now=hub.now)
        self._signs = limits.RateLimiter(limits.SIGNS_PER_S, now=hub.now)

    def take(self, text: str | bytes) -> None:
        """Refuse one message of this connection, or hand it to the controller.

        Raises:
            Flooded: the connection is to be closed.
        """
        # The time that a long message takes is that of its length: none of a page has a KiB.
        if any(self._all.wait_s() > 0.0 for _ in range(1 + len(text) // limits.FLOOD_BYTES)):
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
        self._follow_key(message.kind)
        if message.kind not in SILENT:
            self.used_s = self._hub.now()
            self._asked[seq] = _Asked(self.used_s + limits.ANSWER_S, messages.is_kept_first(message))
            self._hub.expect()

    def _follow_key(self, kind: str) -> None:
        if kind in ("jog", "renew"):
            self._key_s = self._hub.now()
        elif kind == "release":
            self._key_s = -math.inf
        if kind == "jog":
            self._hub.hurry()

    def holds_key(self, now_s: float) -> bool:
        """Whether its user holds a key, as far as its messages tell."""
        return now_s - self._key_s < _KEY_S

    def show(self) -> None:
        """Send the newest status frame as soon as it is ready for it."""
        self._due = True
        self.wake.set()

    def waits_for_disk(self, reply: dict[str, Any]) -> bool:
        """Whether a reply of the controller is to wait for its event; from now on the controller owes nothing."""
        asked = self._asked.pop(reply["seq"], None)
        return asked is not None and asked.kept_first and reply["ok"]

    def answer(self, reply: dict[str, Any]) -> None:
        """Queue a reply."""
        self._asked.pop(reply["seq"], None)
        self._epoch = reply["epoch"] or self._epoch
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
        """Take everything to send now: replies in their order, then the newest status frame if it is new.

        A frame that was made before a reply is not sent behind it: the client would name its epoch, and be refused.
        """
        self.wake.clear()
        # A slow reader loses status frames, never a reply and never the newest frame.
        texts = list(self._replies)
        self._replies.clear()
        if self._due and not self._hub.is_before(self._epoch):
            self._due = False
            whole = self._hub.slow_version != self._sent_slow
            self._sent_slow = self._hub.slow_version
            texts.append(self._hub.status_text(self.who.client, whole=whole))
        return texts


class Hub:
    """All connections of one source.

    Args:
        now: the monotonic time, s.

    Attributes:
        slow_version: of the tags that are sent on change.
        events: journal events of this source. refusals: those of refused commands. logins: of who comes and goes.
    """

    def __init__(
        self, memory: SharedMemory, source: Source, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.now = now
        self._memory, self._source = memory, source
        self._commands, self._replies = memory.commands[source], memory.replies[source]
        self.events = EventLog(memory.events[source])
        self.refusals, self.logins = RefusalLog(self.events, now), LoginLog(self.events, now)
        self._snapshot = Snapshot(memory)
        self._commits = CommitWait(memory.events[Source.CONTROLLER], now)
        self._clients: dict[str, Client] = {}
        self.slow_version = 0
        self._all_due_s = now()
        self._fast: dict[str, Any] = {}
        self._slow: dict[str, Any] = {}
        self._age_ms = math.inf
        self._texts: dict[bool, str] = {}
        self._expected, self._hurried = asyncio.Event(), asyncio.Event()
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
        if oldest is None or self.now() - oldest.used_s < unused_s:
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
        lease_ms = self._memory.words[Word.LEASE_MS]
        keys = limits.key_limits(lease_ms * 1e-3)
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
            "key_frame_ms": round(limits.KEY_FRAME_S * 1e3),
            "lease_ms": lease_ms,
            "renew_ms": round(limits.RENEW_S * 1e3),
            "view_max_ms": round(limits.VIEW_MAX_S * 1e3),
            "key_view_max_ms": round(keys.view_max_s * 1e3),
            "round_trip_max_ms": round(keys.round_trip_max_s * 1e3),
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

    def hurry(self) -> None:
        """Take a snapshot at once: a key is pressed, its first renewals need frames."""
        self._hurried.set()

    def look(self) -> float:
        """Take a new snapshot for all connections that are due for one; the time until the next are due, s."""
        self._fast, self._age_ms = self._snapshot.fast()
        self._slow = self._snapshot.slow()
        self.slow_version = self._snapshot.version
        self._texts.clear()
        now_s = self.now()
        everyone = not now_s < self._all_due_s
        if everyone:
            self._all_due_s = max(self._all_due_s + limits.FRAME_S, now_s)
        key_held = False
        for client in self._clients.values():
            # Frames every 20 ms cost 2.5 times as much: one connection at most gets them, the one that has control.
            held = client.who.client == self._slow.get("authority_client") and client.holds_key(now_s)
            key_held |= held
            if everyone:
                client.overdue(now_s)
            if everyone or held:
                client.show()
        left_s = max(0.0, self._all_due_s - now_s)
        return min(left_s, limits.KEY_FRAME_S) if key_held else left_s

    @property
    def fresh(self) -> bool:
        """Whether the controller is alive."""
        return self._age_ms <= limits.STALE_S * 1e3

    def is_before(self, epoch: int) -> bool:
        """Whether the newest snapshot of a live controller was made before an epoch that it has told since."""
        return self.fresh and 0 < epoch - (self._fast.get("epoch") or 0) < _EPOCHS_BEHIND

    def status(self, *, whole: bool = True) -> dict[str, Any]:
        """A `status` message without the mark of a connection."""
        return {
            "type": "status",
            "fresh": self.fresh,
            "age_ms": round(self._age_ms, 1) if math.isfinite(self._age_ms) else None,
            "tags": {**self._fast, **self._slow} if whole else self._fast,
        }

    def commissioning(self) -> dict[str, Any] | None:
        """Steps and ledger of commissioning; None before the first one since the service was started."""
        found = self._memory.commissioning.read()
        return None if found is None else json.loads(found)

    def status_text(self, client: str, *, whole: bool) -> str:
        """The `status` message to one connection as text; all but its mark is made once for all of them."""
        if whole not in self._texts:
            self._texts[whole] = compact(self.status(whole=whole)).removeprefix('{"type":"status",')
        mark = mark_of(self._fast.get("issued_ms") or 0, self._snapshot.key, client)
        return f'{{"type":"status","frame":"{mark}",{self._texts[whole]}'

    # --- tasks ------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Take snapshots and pass replies on, until cancelled."""
        await asyncio.gather(self._look_on(), self._answer_on())

    async def _look_on(self) -> None:
        process = "supervisor" if self._source is Source.LOCAL else "gateway"
        held_up = HeldUp(process, partial(self.events.put, "service"))
        while True:
            held_up.look()
            left_s = self.look()
            self.refusals.look()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._hurried.wait(), left_s)
            self._hurried.clear()

    async def _answer_on(self) -> None:
        while True:
            self.pass_replies()
            if len(self._commits) or any(client.waiting for client in self._clients.values()):
                await asyncio.sleep(_QUICK_S)
                continue
            self._expected.clear()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._expected.wait(), limits.FRAME_S)

    def pass_replies(self) -> None:
        """Pass on the replies of the controller, those of what lasts when their event is on the disk."""
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
