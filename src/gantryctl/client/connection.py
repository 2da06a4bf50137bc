"""One connection to the service: the newest status frame, commands with their replies, signs of life.

A thread reads. It keeps the newest frame and tells the service that this process lives; it never renews a key, because
it would go on while the program that holds the key hangs.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from gantryctl.client.errors import Refused
from gantryctl.client.tags import Tags
from gantryctl.client.wires import Wire
from gantryctl.errors import DeviceError

# Commands that the service takes whatever has happened since: they name no epoch (docs/reference/service.md).
_WITHOUT_EPOCH: Final = frozenset({"alive", "stop", "quick_stop", "release"})
# The service answers within 1 s by itself; what lasts waits another 1 s for its disk.
_REPLY_S: Final = 5.0
# A reply comes by the scan, the tags with the next frame, those on change a little later.
_SHOWN_S: Final = 0.5
_CLOSE_S: Final = 2.0
_LATE: Final = 64


class Welcome(NamedTuple):
    """What the service said of this connection.

    Attributes:
        client: id of the connection. may: actions of the role.
        lease_ms: time of a held key from the issue of the newest frame that was acknowledged.
        stale_ms: older frames are not the present state.
    """

    client: str
    user: str
    role: str
    place: str
    may: list[str]
    version: str
    lease_ms: float
    stale_ms: float


class Reply(NamedTuple):
    """Reply to a command; `journal` is the number of its event, 0 for none."""

    seq: int
    ok: bool
    code: str
    text: str
    values: Mapping[str, Any]
    epoch: int | None
    journal: int


class Frame(NamedTuple):
    """A status frame: its mark, how many came before it, and the tags."""

    mark: str
    number: int
    tags: Tags


class Connection:
    """An open connection; `close` ends it, and with it a held key and control.

    Attributes:
        welcome: who this is.
        kept_late: the newest replies with a code that were carried out (JRN-03: done, but not kept).

    Raises:
        DeviceError: the service does not answer, or its controller is silent.
    """

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self._news = threading.Condition()
        self._sending = threading.Lock()
        self._values: dict[str, Any] = {}
        self._mark, self._number, self._seq = "", 0, 0
        self._fresh, self._age_ms, self._seen_s = False, 0.0, 0.0
        self._awaited: dict[int, Reply | None] = {}
        self._refused: deque[Reply] = deque(maxlen=_LATE)
        self.kept_late: deque[Reply] = deque(maxlen=_LATE)
        self._ended: DeviceError | None = None
        self._reader = threading.Thread(target=self._read, name="gantryctl client", daemon=True)
        try:
            said = json.loads(wire.receive())
            self.welcome = Welcome(**{name: said[name] for name in Welcome._fields})
            self._reader.start()
            self.next_frame(0)
        except BaseException as fault:
            wire.close()
            if isinstance(fault, KeyError | ValueError | TypeError):
                raise DeviceError(f"this is no service of gantryctl: {fault!r}") from fault
            raise

    def close(self) -> None:
        """End the connection."""
        self._wire.close()
        self._reader.join(_CLOSE_S)

    # --- frames ------------------------------------------------------------------------------------

    @property
    def stale(self) -> bool:
        """Whether the newest frame is too old to be the present state."""
        with self._news:
            return self._is_stale()

    @property
    def frame(self) -> Frame:
        """The newest frame.

        Raises:
            DeviceError: it is too old, the controller is silent, or the connection has ended.
        """
        with self._news:
            self._check_fresh()
            return Frame(self._mark, self._number, Tags.of(self._values))

    def next_frame(self, after: int, timeout_s: float = 3.0) -> Frame:
        """Wait for a frame with a number above `after`.

        Raises:
            DeviceError: none came in time, it is too old, or the connection has ended.
        """
        until_s = time.monotonic() + timeout_s
        with self._news:
            # Before its first scan a controller is silent, and the tags are not there yet.
            while self._ended is None and (self._number <= after or self._is_stale()):
                if not self._news.wait(until_s - time.monotonic()):
                    break
            self._check_fresh()
            return Frame(self._mark, self._number, Tags.of(self._values))

    def _is_stale(self) -> bool:
        age_ms = self._age_ms + 1e3 * (time.monotonic() - self._seen_s)
        return not (self._fresh and age_ms <= self.welcome.stale_ms)

    def _check_fresh(self) -> None:
        if self._ended is not None:
            raise DeviceError(str(self._ended))
        if self._is_stale():
            raise DeviceError(
                "the service shows no present state: its controller is silent, or the network slow"
            )

    # --- commands ----------------------------------------------------------------------------------

    def say(self, kind: str, mark: str = "", **values: Any) -> int:
        """Send a message without waiting for its reply; return its number.

        Args:
            mark: of the frame that it names; the newest one when not given.
        """
        return self._send(kind, mark, values, awaited=False)

    def ask(self, kind: str, *, shown: bool = True, **values: Any) -> Reply:
        """Send a command and wait for its reply.

        Args:
            shown: wait until the tags show it too, half a second at most.

        Raises:
            Refused: by the service, with its code.
            DeviceError: no reply came, or the connection has ended.
        """
        seq = self._send(kind, "", values, awaited=True)
        until_s = time.monotonic() + _REPLY_S
        with self._news:
            while (reply := self._awaited[seq]) is None:
                if self._ended is not None or not self._news.wait(until_s - time.monotonic()):
                    del self._awaited[seq]
                    raise DeviceError(f"no reply to {kind}: {self._ended or 'the service is silent'}")
            del self._awaited[seq]
            if not reply.ok:
                raise Refused(reply.code, reply.text, reply.values)
            if reply.code:
                self.kept_late.append(reply)
            until_s = time.monotonic() + _SHOWN_S
            while shown and not self._shows(reply) and self._ended is None:
                if not self._news.wait(until_s - time.monotonic()):
                    break
        return reply

    def refusal_from(self, seq: int) -> Reply | None:
        """The first refusal of a message with this number or a higher one that nobody waited for."""
        with self._news:
            return next((reply for reply in self._refused if reply.seq >= seq), None)

    def _shows(self, reply: Reply) -> bool:
        values = self._values
        known = reply.epoch is None or values.get("epoch") == reply.epoch
        return known and values.get("journal_sequence", 0) >= reply.journal

    def _send(self, kind: str, mark: str, values: Mapping[str, Any], *, awaited: bool) -> int:
        # Numbers rise in the order of sending, whichever thread sends.
        with self._sending:
            with self._news:
                self._seq += 1
                seq = self._seq
                message = {"type": kind, "seq": seq, "frame": mark or self._mark, **values}
                if kind not in _WITHOUT_EPOCH:
                    message["epoch"] = self._values["epoch"]
                if awaited:
                    self._awaited[seq] = None
            self._wire.send(json.dumps(message))
        return seq

    # --- the thread that reads ---------------------------------------------------------------------

    def _read(self) -> None:
        try:
            while True:
                message = json.loads(self._wire.receive())
                with self._news:
                    held = self._take(message)
                    self._news.notify_all()
                if held:
                    self._send("alive", "", {}, awaited=False)
        except (DeviceError, ValueError, KeyError, TypeError) as fault:
            with self._news:
                self._ended = (
                    fault if isinstance(fault, DeviceError) else DeviceError(f"not understood: {fault!r}")
                )
                self._news.notify_all()

    def _take(self, message: dict[str, Any]) -> bool:
        """Take one message; whether it was a frame and this connection has control."""
        if message["type"] == "status":
            self._mark, self._fresh = message["frame"], message["fresh"]
            age_ms = message["age_ms"]
            self._age_ms = float("inf") if age_ms is None else age_ms
            self._values.update(message["tags"])
            self._seen_s = time.monotonic()
            self._number += 1
            return bool(self._values.get("authority_client") == self.welcome.client)
        if message["type"] == "reply":
            reply = Reply(**{name: message[name] for name in Reply._fields})
            # The next command names it, before a frame shows it. A lower one has waited for the disk, or is of a
            # controller that was started anew, which the next frame tells.
            if reply.epoch is not None and reply.epoch > self._values.get("epoch", reply.epoch):
                self._values["epoch"] = reply.epoch
            if reply.seq in self._awaited:
                self._awaited[reply.seq] = reply
            elif not reply.ok:
                self._refused.append(reply)
        return False
