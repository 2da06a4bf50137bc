"""Rights of the roles in one table; deny is the default."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, NamedTuple


class Role(StrEnum):
    """Roles of users."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    PHYSICIST = "physicist"
    SERVICE = "service"
    ADMIN = "admin"


class Action(StrEnum):
    """Everything that a client can ask of the service."""

    VIEW = "view"
    STOP = "stop"
    QUICK_STOP = "quick_stop"
    AUTHORITY = "authority"
    TAKE_OVER = "take_over"
    POWER = "power"
    MODE = "mode"
    JOG = "jog"
    MOVE = "move"
    HALT = "halt"
    RESET = "reset"
    ACKNOWLEDGE = "acknowledge"
    SPEED = "set_speed"
    INCREMENT = "set_increment"
    OVERRIDE = "set_override"
    ACCELERATION = "set_acceleration"
    NOTE = "note"
    BRAKE_TEST = "brake_test"
    RESET_LOCKED = "reset_locked"
    COMMISSION = "commission"
    TRACES = "traces"
    JOURNAL = "journal"
    USERS = "users"


_ALL: Final = frozenset(Role)
_MOVES: Final = frozenset({Role.OPERATOR, Role.PHYSICIST, Role.SERVICE})
_TUNES: Final = frozenset({Role.PHYSICIST, Role.SERVICE})
_READS: Final = frozenset({Role.PHYSICIST, Role.SERVICE, Role.ADMIN})


class Right(NamedTuple):
    """Roles that may do an action, and what it is; `control` restricts it to the holder of control."""

    roles: frozenset[Role]
    words: str
    control: bool = False


# The admin looks after users and cannot move; Stop is for everybody. Power off needs no control, see `rules`.
RIGHTS: Final[dict[Action, Right]] = {
    Action.VIEW: Right(_ALL, "see everything that the page shows"),
    Action.STOP: Right(_ALL, "Stop: jog-release ramp"),
    Action.QUICK_STOP: Right(_ALL, "quick stop: ErrorStop afterwards"),
    Action.AUTHORITY: Right(_MOVES, "take control when it is free, give it back"),
    Action.TAKE_OVER: Right(_MOVES, "take control over from somebody, at standstill"),
    Action.POWER: Right(_MOVES, "power on and off", control=True),
    Action.MODE: Right(_MOVES, "choose the motion mode, at standstill", control=True),
    Action.JOG: Right(_MOVES, "forward and reverse keys, increments", control=True),
    Action.MOVE: Right(_MOVES, "move to an angle", control=True),
    Action.HALT: Right(_MOVES, "stop on the normal ramp", control=True),
    Action.RESET: Right(_MOVES, "reset alarms that are not locked", control=True),
    Action.ACKNOWLEDGE: Right(_MOVES, "acknowledge an alarm as seen"),
    Action.SPEED: Right(_MOVES, "speed setting", control=True),
    Action.INCREMENT: Right(_MOVES, "increment setting", control=True),
    Action.OVERRIDE: Right(_MOVES, "speed override", control=True),
    Action.ACCELERATION: Right(_TUNES, "acceleration setting, up to that of the machine file", control=True),
    Action.NOTE: Right(_MOVES, "write into the shift log"),
    Action.BRAKE_TEST: Right(_TUNES, "brake test", control=True),
    Action.RESET_LOCKED: Right(frozenset({Role.SERVICE}), "reset alarms that are locked", control=True),
    Action.COMMISSION: Right(frozenset({Role.SERVICE}), "commission the drive, step by step", control=True),
    Action.TRACES: Right(_MOVES, "list and download recordings"),
    Action.JOURNAL: Right(_READS, "export the journal"),
    Action.USERS: Right(frozenset({Role.ADMIN}), "users (on the command line)"),
}


ARMABLE: Final = {
    "brake_test": Action.BRAKE_TEST,
    "reset_locked": Action.RESET_LOCKED,
    "commission": Action.COMMISSION,
}
"""What `arm` takes, with the action that it is."""


def may(role: Role, action: Action) -> bool:
    """Whether a role may do an action."""
    right = RIGHTS.get(action)
    return right is not None and role in right.roles


def rights_of(role: Role) -> list[str]:
    """List the actions of a role."""
    return [str(action) for action in RIGHTS if may(role, action)]
