"""Hash and seal of events, and the lines that are kept elsewhere.

Hash n is the SHA-256 over hash n-1 and event n: it binds every event to all before it, and anybody can check it. Seal n
is the HMAC over the journal's name, hash n and event n: only who has the key can make it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from gantryctl.service.recorder.journal.key import Key


class Anchor(NamedTuple):
    """Number and hash of one event, to be kept out of reach of those who can write the journal.

    Attributes:
        journal: name of the journal that the event is in.
    """

    seq: int
    hash: str
    utc: str
    journal: str

    @property
    def line(self) -> str:
        """As it is written: number, hash, date, journal."""
        return f"{self.seq} {self.hash} {self.utc or '-'} {self.journal}"


def anchors_in(text: str) -> list[Anchor]:
    """Read lines; ValueError for one that is no anchor."""
    parts = [line.split() for line in text.splitlines() if line.strip()]
    return [Anchor(int(seq), digest, utc, journal) for seq, digest, utc, journal in parts]


def of_journal(anchors: Iterable[Anchor], journal: str) -> dict[int, list[Anchor]]:
    """Choose those of one journal, by the number of their event."""
    found: dict[int, list[Anchor]] = {}
    for each in anchors:
        if each.journal == journal:
            found.setdefault(each.seq, []).append(each)
    return found


def content_of(seq: int, values: Sequence[Any]) -> bytes:
    """Write an event in the one form that is hashed; TypeError or ValueError for what is no event."""
    return json.dumps([seq, *values], separators=(",", ":"), ensure_ascii=True, allow_nan=False).encode()


def first_hash(journal: str) -> str:
    """Hash before the first event of a journal."""
    return hashlib.sha256(f"gantryctl journal {journal}".encode()).hexdigest()


def chained(previous: str, content: bytes) -> str:
    """Hash of an event, hexadecimal."""
    return hashlib.sha256(previous.encode() + content).hexdigest()


def sealed(key: Key, journal: str, digest: str, content: bytes) -> str:
    """Seal of an event, hexadecimal."""
    return key.seal("event", f"{journal} {digest} ".encode() + content)
