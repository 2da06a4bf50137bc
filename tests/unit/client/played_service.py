"""The service at the other end of a client's wire, played by the test."""

from __future__ import annotations

import json
import queue
from typing import Any

from gantryctl.errors import DeviceError
from gantryctl.service.protocol.messages import parse
from gantryctl.service.protocol.tags import TAGS, Tag

PATIENCE_S = 20.0
ME = "0123abcd"
WELCOME = {
    "type": "welcome", "client": ME, "user": "anna", "person": "anna", "role": "operator", "place": "remote",
    "may": ["view", "stop", "move"], "version": "0", "lease_ms": 250, "stale_ms": 500,
}  # fmt: skip


def example(tag: Tag) -> Any:
    values: dict[str, Any] = {"float": 0.0, "int": 0, "bool": True, "text": "", "enum": (*tag.labels, "")[0]}
    return None if tag.null else values.get(tag.kind, [])


def tags(**values: Any) -> dict[str, Any]:
    """All tags of an axis with power, at rest at 0 deg, held by this connection."""
    found = {tag.name: example(tag) for tag in TAGS}
    return {**found, "epoch": 7, "mode": "continuous", "authority_client": ME, "increment_deg": 1.0, **values}


class FakeService:
    """A wire whose other end is a test: it answers every command with `ok` unless it is told otherwise.

    Attributes:
        sent: the messages in their order, checked as the service does.
        refused: code by kind of message. late: the same of what was done, but not kept.
        moves: tags that appear with the reply to a message of a kind.
        epoch: of every reply.
    """

    def __init__(self, **values: Any) -> None:
        self.sent: list[dict[str, Any]] = []
        self.refused: dict[str, str] = {}
        self.late: dict[str, str] = {}
        self.moves: dict[str, dict[str, Any]] = {}
        self.epoch = 7
        self._out: queue.Queue[str | None] = queue.Queue()
        self._frames = 0
        self._out.put(json.dumps(WELCOME))
        self.frame(**tags(**values))

    def frame(self, *, fresh: bool = True, age_ms: float | None = 1.0, **values: Any) -> str:
        self._frames += 1
        mark = f"{self._frames}-0123456789abcdef"
        message = {"type": "status", "frame": mark, "fresh": fresh, "age_ms": age_ms, "tags": values}
        self._out.put(json.dumps(message))
        return mark

    def send(self, text: str) -> None:
        message = json.loads(text)
        kind = parse(text).kind
        self.sent.append(message)
        if kind == "alive":
            return
        code = self.refused.get(kind, "")
        if kind == "renew" and not code:
            return
        if kind in self.moves:
            self.frame(**self.moves[kind])
        reply = {
            "type": "reply",
            "seq": message["seq"],
            "ok": not code,
            "code": code or self.late.get(kind, ""),
            "text": "why",
            "values": {},
        }
        self._out.put(json.dumps({**reply, "epoch": self.epoch, "journal": 0}))

    def receive(self) -> str:
        found = self._out.get(timeout=PATIENCE_S)
        if found is None:
            raise DeviceError("the other end has gone")
        return found

    def close(self) -> None:
        self._out.put(None)

    def kinds(self) -> list[str]:
        return [message["type"] for message in self.sent if message["type"] != "alive"]
