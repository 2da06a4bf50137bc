"""A row of the alarm table."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.program.alarms.codes import Code, Reaction, Severity
from gantryctl.program.alarms.words import Words


class Text(NamedTuple):
    """The texts of a row in one language; `message` names what was measured against which limit."""

    title: str
    message: str
    cause: str
    to_do: str


class Definition(NamedTuple):
    """One row: number formats stand in the English message; the Chinese one has the same fields without them."""

    code: Code
    severity: Severity
    reaction: Reaction
    english: Text
    chinese: Text
    lock: bool = False
    """Only the service role may reset it."""
    blocks_motion: bool = False
    """No motion while it is active, though it does not stop the axis."""
    before_motion: Words = Words.RESET_FIRST
    """The condition for motion that a refused motion names then."""
