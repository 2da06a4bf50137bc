"""A row of the fault catalogue."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from gantryctl.program.alarms.codes import Code


class State(StrEnum):
    """Whether a fault is detected, answered and tested."""

    YES = "yes"
    PARTLY = "partly"
    NO = "no"


class Row(NamedTuple):
    """One fault of the catalogue.

    Attributes:
        number: letter of the group and number, "A2"; "N" are rows found after the catalogue was written.
        fault: what breaks.
        detected_by: what notices it, with threshold and time.
        reaction: what is done about it.
        codes: alarms or refusals that a person reads, the usual one first; () where nobody needs to read one.
        tests: tests that inject it, as path below `tests` and name.
        state: how much of it is done.
        why: the reason where the state is not "yes", or where the reaction differs from the catalogue's.
    """

    number: str
    fault: str
    detected_by: str
    reaction: str
    codes: tuple[Code, ...] = ()
    tests: tuple[str, ...] = ()
    state: State = State.YES
    why: str = ""


def at(path: str, *names: str) -> tuple[str, ...]:
    """Ids of tests in one file below `tests`."""
    return tuple(f"{path}::{name}" for name in names)
