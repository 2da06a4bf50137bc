"""Marks of status frames: when the controller issued a frame, and proof that a connection has received it."""

from __future__ import annotations

from hashlib import blake2s
from typing import Final

# `<issue time, ms>-<seal>`; the seal has 64 bits.
MARK_PATTERN: Final = "^[0-9]{1,15}-[0-9a-f]{16}$"


def mark_of(issued_ms: int, key: int, client: str) -> str:
    """The mark of one status frame for one connection.

    Args:
        issued_ms: time of issue, ms of the controller's clock since its start.
        key: of this frame, 64 bits: `FrameClock.key`.
        client: id of the connection.
    """
    seal = blake2s(client.encode(), key=key.to_bytes(8, "little"), digest_size=8)
    return f"{issued_ms}-{seal.hexdigest()}"
