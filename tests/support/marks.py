"""Marks of status frames for tests that talk to the operator past the hub."""

from __future__ import annotations

from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.protocol.frames import mark_of

UNKNOWN = "0-0000000000000000"
"""Well-formed, and of no frame."""


def newest_mark(operator: ServiceOperator, client: str) -> str:
    """The mark of the frame that a connection would get now."""
    frames = operator.frames
    return mark_of(frames.issued_ms, frames.key, client)
