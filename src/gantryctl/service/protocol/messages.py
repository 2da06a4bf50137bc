"""Messages to the service: what each may hold, and how they travel from a gateway to the controller.

The gateway parses a message to refuse it early; the controller parses it again and trusts nothing but who sent it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, TypeAlias

from gantryctl.errors import GantryctlError
from gantryctl.image import Mode
from gantryctl.service.protocol.limits import MESSAGE_MAX
from gantryctl.service.protocol.roles import Action, Role

_SAFE_INTEGER: Final = 2**53


class MessageRefused(GantryctlError):
    """A message that is refused; `code` is stable."""

    exit_code = 2

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code
        self.seq = 0
        """Of the message, where it has one."""


class Identity(NamedTuple):
    """Who sends: put there by the process that knows, never by the message.

    Attributes:
        client: one connection.
        place: `local` is the console of this machine, `loopback` a page on it, `remote` anything else.
    """

    client: str
    user: str
    role: Role
    place: str

    @property
    def local(self) -> bool:
        """Whether it is the console of this machine."""
        return self.place == "local"


class Message(NamedTuple):
    """A message that is well formed."""

    kind: str
    seq: int
    frame: int
    epoch: int | None
    values: dict[str, Any]


Check: TypeAlias = Callable[[Any], bool]


def _whole(value: Any) -> bool:
    return type(value) is int and 0 <= value <= _SAFE_INTEGER


def _number(value: Any) -> bool:
    return type(value) in (int, float) and -1e9 < value < 1e9 and math.isfinite(value)


def _flag(value: Any) -> bool:
    return type(value) is bool


def _lease(value: Any) -> bool:
    return isinstance(value, str) and len(value) == 16 and all(c in "0123456789abcdef" for c in value)


def _one_of(*words: str) -> Check:
    return lambda value: isinstance(value, str) and value in words


_MODES: Final = tuple(mode.name.lower() for mode in Mode)
_DIRECTION: Final = _one_of("forward", "reverse")
SETTABLE: Final = {
    "speed_setting_deg_s": Action.SPEED,
    "increment_deg": Action.INCREMENT,
    "override_percent": Action.OVERRIDE,
    "acc_setting_deg_s2": Action.ACCELERATION,
}
"""Tags that `set` takes, with the action that it is."""

ARMABLE: Final = {"brake_test": Action.BRAKE_TEST, "reset_locked": Action.RESET_LOCKED}
"""What `arm` takes, with the action that it is."""

FIELDS: Final[dict[str, dict[str, Check]]] = {
    "alive": {},
    "take": {"over": _flag},
    "give": {},
    "power": {"on": _flag},
    "mode": {"mode": _one_of(*_MODES)},
    "jog": {"lease": _lease, "direction": _DIRECTION},
    "renew": {"lease": _lease},
    "release": {"lease": _lease},
    "increment": {"direction": _DIRECTION},
    "move": {"target_deg": _number},
    "halt": {},
    "stop": {},
    "quick_stop": {},
    "reset": {},
    "acknowledge": {"id": _whole},
    "set": {"tag": _one_of(*SETTABLE), "value": _number},
    "arm": {"action": _one_of(*ARMABLE)},
    "brake_test": {},
}
"""Every message with its own keys."""

WITHOUT_EPOCH: Final = frozenset({"alive", "stop", "quick_stop", "release"})
"""Stopping and letting go are never too late."""
FREE: Final = frozenset({"alive", "renew", "release", "stop", "quick_stop"})
"""Not counted with the commands by the rate limit: each has a limit of its own."""
SILENT: Final = frozenset({"alive", "renew"})
"""No reply when all is well, and no event in the journal."""

_ACTIONS: Final = {
    "take": Action.AUTHORITY, "give": Action.AUTHORITY, "alive": Action.VIEW, "power": Action.POWER,
    "mode": Action.MODE, "jog": Action.JOG, "renew": Action.JOG, "release": Action.VIEW,
    "increment": Action.JOG, "move": Action.MOVE, "halt": Action.HALT, "stop": Action.STOP,
    "quick_stop": Action.QUICK_STOP, "reset": Action.RESET, "acknowledge": Action.ACKNOWLEDGE,
    "brake_test": Action.BRAKE_TEST,
}  # fmt: skip


def action_of(message: Message) -> Action:
    """What a message asks for, in the table of roles."""
    if message.kind == "set":
        return SETTABLE[message.values["tag"]]
    if message.kind == "arm":
        return ARMABLE[message.values["action"]]
    if message.kind == "take" and message.values["over"]:
        return Action.TAKE_OVER
    return _ACTIONS[message.kind]


def parse(text: str | bytes) -> Message:
    """One message.

    Raises:
        MessageRefused: SEC-05, with the key that is wrong.
    """
    if len(text) > MESSAGE_MAX:
        raise MessageRefused("SEC-05", f"a message of {len(text)} bytes: at most {MESSAGE_MAX}")
    try:
        found = json.loads(text, parse_constant=_no_constant, object_pairs_hook=_no_twins)
    except (ValueError, RecursionError):
        raise MessageRefused("SEC-05", "not one JSON object with finite numbers") from None
    try:
        return checked(found)
    except MessageRefused as refused:
        seq = found.get("seq") if isinstance(found, dict) else 0
        refused.seq = seq if _whole(seq) and isinstance(seq, int) else 0
        raise


def checked(found: object) -> Message:
    """The same for a message that is JSON values already."""
    if not isinstance(found, dict):
        raise MessageRefused("SEC-05", "a message is one JSON object")
    kind = found.get("type")
    fields = FIELDS.get(kind) if isinstance(kind, str) else None
    if fields is None or not isinstance(kind, str):
        raise MessageRefused("SEC-05", "unknown type of message")
    known: dict[str, Check] = {"seq": _whole, "frame": _whole, **fields}
    if kind not in WITHOUT_EPOCH:
        known["epoch"] = _whole
    wrong = sorted((set(found) - {"type", "epoch"}) ^ (set(known) - {"epoch"}))
    wrong += [name for name in known if name not in found or not known[name](found[name])]
    if wrong:
        raise MessageRefused("SEC-05", f"{kind}: {wrong[0][:40]!a} is missing, unknown or of a wrong type")
    values = {name: found[name] for name in fields}
    epoch = found["epoch"] if "epoch" in known else None
    return Message(kind, found["seq"], found["frame"], epoch, values)


def to_record(identity: Identity, message: Mapping[str, Any]) -> bytes:
    """A record for the command ring."""
    return json.dumps([*identity, message], separators=(",", ":"), allow_nan=False).encode()


def from_record(record: bytes) -> tuple[Identity, dict[str, Any]]:
    """Sender and raw message of a record; ValueError when it is none."""
    client, user, role, place, message = json.loads(record)
    if not isinstance(message, dict):
        raise ValueError("no message in the record")
    return Identity(str(client), str(user), Role(role), str(place)), message


def _no_constant(word: str) -> float:
    raise ValueError(word)


def _no_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key twice")
    return found
