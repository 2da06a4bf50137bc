"""Who may do what: the one table. Deny is the default."""

from __future__ import annotations

from enum import StrEnum
from typing import Final


class Role(StrEnum):
    """Roles of users; each does what the table says and nothing more."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    PHYSICIST = "physicist"
    SERVICE = "service"
    ADMIN = "admin"


class Action(StrEnum):
    """Everything that can be asked of the service."""

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
    BRAKE_TEST = "brake_test"
    RESET_LOCKED = "reset_locked"
    TRACES = "traces"
    JOURNAL = "journal"
    USERS = "users"


_ALL: Final = frozenset(Role)
_MOVES: Final = frozenset({Role.OPERATOR, Role.PHYSICIST, Role.SERVICE})
_TUNES: Final = frozenset({Role.PHYSICIST, Role.SERVICE})

# The admin looks after users and cannot move; Stop is for everybody.
MAY: Final[dict[Action, frozenset[Role]]] = {
    Action.VIEW: _ALL,
    Action.STOP: _ALL,
    Action.QUICK_STOP: _ALL,
    Action.AUTHORITY: _MOVES,
    Action.TAKE_OVER: _MOVES,
    Action.POWER: _MOVES,
    Action.MODE: _MOVES,
    Action.JOG: _MOVES,
    Action.MOVE: _MOVES,
    Action.HALT: _MOVES,
    Action.RESET: _MOVES,
    Action.ACKNOWLEDGE: _MOVES,
    Action.SPEED: _MOVES,
    Action.INCREMENT: _MOVES,
    Action.OVERRIDE: _MOVES,
    Action.ACCELERATION: _TUNES,
    Action.BRAKE_TEST: _TUNES,
    Action.RESET_LOCKED: frozenset({Role.SERVICE}),
    Action.TRACES: _MOVES,
    Action.JOURNAL: frozenset({Role.PHYSICIST, Role.SERVICE, Role.ADMIN}),
    Action.USERS: frozenset({Role.ADMIN}),
}

WORDS: Final[dict[Action, str]] = {
    Action.VIEW: "see everything that the page shows",
    Action.STOP: "Stop: jog-release ramp",
    Action.QUICK_STOP: "quick stop: ErrorStop afterwards",
    Action.AUTHORITY: "take control when it is free, give it back",
    Action.TAKE_OVER: "take control over from somebody, at standstill",
    Action.POWER: "power on and off",
    Action.MODE: "choose the motion mode, at standstill",
    Action.JOG: "forward and reverse keys, increments",
    Action.MOVE: "move to an angle",
    Action.HALT: "stop on the normal ramp",
    Action.RESET: "reset alarms that are not locked",
    Action.ACKNOWLEDGE: "acknowledge an alarm as seen",
    Action.SPEED: "speed setting",
    Action.INCREMENT: "increment setting",
    Action.OVERRIDE: "speed override",
    Action.ACCELERATION: "acceleration setting, up to that of the machine file",
    Action.BRAKE_TEST: "brake test",
    Action.RESET_LOCKED: "reset alarms that are locked",
    Action.TRACES: "list and download recordings",
    Action.JOURNAL: "export the journal",
    Action.USERS: "users (on the command line)",
}

# Only whoever has control may do these; power off is for any of these roles without it.
NEEDS_AUTHORITY: Final = frozenset(
    {
        Action.POWER, Action.MODE, Action.JOG, Action.MOVE, Action.HALT, Action.RESET, Action.SPEED,
        Action.INCREMENT, Action.OVERRIDE, Action.ACCELERATION, Action.BRAKE_TEST, Action.RESET_LOCKED,
    }
)  # fmt: skip


def may(role: Role, action: Action) -> bool:
    """Whether the table allows it."""
    return role in MAY.get(action, frozenset())
