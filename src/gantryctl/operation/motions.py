"""What a session says of a motion: how it is going, how it ended, how urgently somebody wants it to stop."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from gantryctl.errors import CommandRefused
from gantryctl.program import AxisState, Refusal


class Stop(IntEnum):
    """How urgently somebody wants the axis to stop."""

    NO = 0
    RAMP = 1
    QUICK = 2


class Snapshot(NamedTuple):
    """What a display shows. Angles at the gantry, measured by the motor encoder."""

    time_s: float
    angle_deg: float
    speed_deg_s: float
    following_error_deg: float
    state: str
    time_left_s: float | None
    """Of a motion that has an end."""


def state_words(state: AxisState) -> str:
    """An axis state as people read it."""
    return state.name.lower().replace("_", " ")


def require(refused: Refusal | None) -> None:
    """Raise CommandRefused with the reason, unless there is none."""
    if refused is not None:
        raise CommandRefused(refused.text)


class Motion(NamedTuple):
    """A motion that has ended: its time in the recording, and whether it did what was asked.

    Attributes:
        done: it ran to its end: not stopped, and in position where it has a target.
        settled_s: from the end of the set-point's motion until in position; None without a target.
        asked_deg_s: the speed that was asked for, times override; None where the time decides (jog).
    """

    from_s: float
    to_s: float
    done: bool
    settled_s: float | None
    asked_deg_s: float | None
