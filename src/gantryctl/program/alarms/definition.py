"""What a row of the alarm table is."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.program.alarms.codes import Code, Reaction, Severity


class Definition(NamedTuple):
    """One row: `message` names what was measured against which limit."""

    code: Code
    title: str
    severity: Severity
    reaction: Reaction
    message: str
    cause: str
    to_do: str
    lock: bool = False
    """Only the service role may reset it."""
    blocks_motion: bool = False
    """No motion while it is active, though it does not stop the axis."""
    before_motion: str = "reset first"
    """What a refused motion is told then."""
