"""Messages to the service, and how they travel from a gateway to the controller."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias, get_args

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_validator,
)
from pydantic_core import PydanticCustomError

from gantryctl.errors import GantryctlError
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, to_wire
from gantryctl.program.alarms.words import Said, Words
from gantryctl.service.protocol.frames import MARK_PATTERN
from gantryctl.service.protocol.limits import MESSAGE_MAX
from gantryctl.service.protocol.roles import ARMABLE, Action, Role


class MessageRefused(GantryctlError):
    """A message that is refused: a code with the values of its message.

    Attributes:
        seq: number of the message, where it has one.
    """

    exit_code = 2

    def __init__(self, code: Code, /, **values: object) -> None:
        self.refusal, self.seq = Refusal(code, values), 0
        super().__init__(self.refusal.text)


class Identity(NamedTuple):
    """The sender of a message.

    Attributes:
        client: one connection.
        place: `local` is the local socket of this machine, `console` a page that has proved to be on it, anything else
            is a remote screen.
        person: whose account it is, across accounts; "" for one of the system that no account stands for.
    """

    # Filled by the process that owns the connection, never from the message.
    client: str
    user: str
    role: Role
    place: str
    person: str = ""

    @property
    def local(self) -> bool:
        """Whether it is the local socket of this machine."""
        return self.place == "local"

    @property
    def remote(self) -> bool:
        """Whether nothing proves that it is on this machine."""
        return self.place not in ("local", "console")


class Message(NamedTuple):
    """A well-formed message.

    Attributes:
        frame: mark of the newest status frame that its sender has; empty for a stop or release, where it is not read.
    """

    kind: str
    seq: int
    frame: str
    epoch: int | None
    values: dict[str, Any]


# Tags that `set` takes, with the action that it is.
SETTABLE: Final = {
    "speed_setting_deg_s": Action.SPEED,
    "increment_deg": Action.INCREMENT,
    "override_percent": Action.OVERRIDE,
    "acc_setting_deg_s2": Action.ACCELERATION,
}

# Type of a line of the shift log, and kind of its event, whose text is the line.
NOTE: Final = "note"
# Characters of a line of the shift log: with four bytes each it fits the text of an event.
NOTE_MAX: Final = 120
_LINE: Final = rf"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]{{1,{NOTE_MAX}}}$"

# A safe integer: JavaScript holds no larger one exactly.
Whole: TypeAlias = Annotated[int, Field(ge=0, le=2**53)]
# Wider than any machine: what is beyond its travel is refused with its travel.
Number: TypeAlias = Annotated[float, Field(ge=-1e9, le=1e9, allow_inf_nan=False)]
Mark: TypeAlias = Annotated[
    str, Field(pattern=MARK_PATTERN, description="`frame` of the newest `status`, as it came")
]
Lease: TypeAlias = Annotated[
    str, Field(pattern="^[0-9a-f]{16}$", description="16 hex digits, random, new at every press")
]
Direction: TypeAlias = Literal["forward", "reverse"]


class Untimed(BaseModel):
    """Keys of every message. Stopping and letting go are never too late: frame and epoch are not read."""

    # Strict: a string is no number and True is no 1, whatever a language of clients makes of it (SEC-05).
    model_config = ConfigDict(strict=True, extra="forbid", defer_build=True)
    seq: Whole
    frame: Any = None
    epoch: Any = None


class Framed(Untimed):
    """Keys of a message that counts by the age of the status frame that it names."""

    frame: Mark


class Timed(Framed):
    """Keys of a message that is refused in another epoch than its own."""

    epoch: Whole


class Alive(Framed):
    """Sign of life of the holder of control, at least twice a second, best at once when a status frame came: its round
    trip is measured by them. A silent holder loses control. No reply; with an old frame it counts as not sent.
    """

    type: Literal["alive"]


class Take(Timed):
    """Take control authority; `over` takes it from another holder, at standstill only."""

    type: Literal["take"]
    over: bool


class Give(Timed):
    """Give control back; a jog stops, a move goes on, a motion that stands still at override 0 ends. A holder that
    falls silent or leaves gives control back, too.
    """

    type: Literal["give"]


class Power(Timed):
    """Switch power; on needs control, off does not."""

    type: Literal["power"]
    on: bool


class ChooseMode(Timed):
    """Choose the motion mode, at standstill."""

    type: Literal["mode"]
    mode: Literal["none", "continuous", "incremental"]


class Jog(Timed):
    """Begin hold-to-run, in continuous mode."""

    type: Literal["jog"]
    lease: Lease
    direction: Direction


class Renew(Timed):
    """Renew the lease while the key is held: it ends `lease_ms` after the issue of the frame named. No reply but a
    refusal: then the lease is dead. With an old frame it counts as not sent.
    """

    type: Literal["renew"]
    lease: Lease


class Release(Untimed):
    """Let the key go: the axis stops on the jog-release ramp. Always accepted."""

    type: Literal["release"]
    lease: Lease


class Increment(Timed):
    """Move by one increment, in incremental mode."""

    type: Literal["increment"]
    direction: Direction


class Move(Timed):
    """Move to an angle with the speed setting. A linear axis has one way, and `direction` is refused; a modulo axis
    takes the shortest one unless it is given.
    """

    type: Literal["move"]
    target_deg: Number
    direction: Literal["shortest", "positive", "negative", "current"] = "shortest"


class MoveBy(Timed):
    """Move by an angle from the set-point with the speed setting; a modulo axis also beyond a turn."""

    type: Literal["move_by"]
    distance_deg: Number


class Halt(Timed):
    """End the motion on the normal ramp."""

    type: Literal["halt"]


class Stop(Untimed):
    """Stop on the jog-release ramp. Accepted from everyone, always."""

    type: Literal["stop"]


class QuickStop(Untimed):
    """Stop by a quick stop, which leads to ErrorStop. Accepted from everyone, always."""

    type: Literal["quick_stop"]


class Reset(Timed):
    """Reset alarms whose cause is gone; never switches on. Locked ones (`reset_locked` is true) need the service role,
    and `arm` first.
    """

    type: Literal["reset"]


class Acknowledge(Timed):
    """Mark an alarm as seen. Needs no control."""

    type: Literal["acknowledge"]
    id: Annotated[Whole, Field(description="number of the alarm row")]


class Set(Timed):
    """Change a setting: a tag with direction `both`, but `mode`. An override raised from 0 while a motion stands still
    is refused as that motion would be.
    """

    type: Literal["set"]
    tag: Literal["speed_setting_deg_s", "increment_deg", "override_percent", "acc_setting_deg_s2"]
    value: Number


class WriteNote(Framed):
    """Write a line into the shift log. The journal keeps it with name and time; where it cannot, the line is refused.
    Needs no control.
    """

    type: Literal["note"]
    line: Annotated[str, Field(pattern=_LINE, description="one line without control characters")]


class Arm(Timed):
    """Take the first of two steps, see below. Needs no control."""

    type: Literal["arm"]
    action: Literal["brake_test", "reset_locked", "commission"]
    step: Annotated[
        str,
        Field(
            pattern="^[a-z]{0,20}$",
            validate_default=True,
            description="with `commission`, and with it alone: `key` of the step that may run then",
        ),
    ] = ""

    @field_validator("step")
    @classmethod
    def _of_commissioning(cls, step: str, others: ValidationInfo) -> str:
        wanted = others.data.get("action") == "commission"
        if bool(step) != wanted:
            raise PydanticCustomError(
                "missing" if wanted else "extra_forbidden", "commission alone has a step"
            )
        return step


class StartBrakeTest(Timed):
    """Execute the armed brake test; power must be off; refused where `brake_test_available` is false."""

    type: Literal["brake_test"]


class BeginCommissioning(Timed):
    """Have the controller hand the axis over for commissioning: with power off, and a drive on a bus. It ends, and
    control with it: take it again when the tag `commissioning` is there.
    """

    type: Literal["commission_begin"]


class RunStep(Timed):
    """Run one step of commissioning. One that can move is armed first (`commission`), at the console of the machine. It
    ends when its holder of control is silent for 1 s.
    """

    type: Literal["commission_step"]
    step: Annotated[str, Field(pattern="^[a-z]{1,20}$", description="`key` of a step of `/commissioning`")]


class EndCommissioning(Timed):
    """Write record and report; then the controller has the axis again."""

    type: Literal["commission_end"]


# Every message to the service; its JSON schema is `MESSAGES.json_schema()`.
AnyMessage: TypeAlias = Annotated[
    Alive | Take | Give | Power | ChooseMode | Jog | Renew | Release | Increment | Move | MoveBy | Halt
    | Stop | QuickStop | Reset | Acknowledge | Set | WriteNote | Arm | StartBrakeTest
    | BeginCommissioning | RunStep | EndCommissioning,
    Field(discriminator="type"),
]  # fmt: skip
MESSAGES: Final[TypeAdapter[Any]] = TypeAdapter(AnyMessage)
COMMON: Final = frozenset({"type", *Timed.model_fields})


_MODELS: Final[dict[str, type[Untimed]]] = {
    get_args(model.model_fields["type"].annotation)[0]: model for model in get_args(get_args(AnyMessage)[0])
}
# Keys that a message of a type has beside those of all messages.
FIELDS: Final = {
    kind: tuple(name for name in model.model_fields if name not in COMMON) for kind, model in _MODELS.items()
}
WITHOUT_EPOCH: Final = frozenset(kind for kind, model in _MODELS.items() if not issubclass(model, Timed))
WITHOUT_FRAME: Final = frozenset(kind for kind, model in _MODELS.items() if not issubclass(model, Framed))
# Not counted with the commands by the rate limit: each has a limit of its own.
FREE: Final = frozenset({"alive", "renew", "release", "stop", "quick_stop"})
# No reply when all is well, and no event in the journal.
SILENT: Final = frozenset({"alive", "renew"})

# What goes on without a held key, or changes what outlasts the moment: the reply waits until the event is on the disk
# (decision 0020). What stops the axis, what a held key does and what only prepares is answered at once.
KEPT_FIRST: Final = frozenset(
    {
        "power", "increment", "move", "move_by", "reset", "acknowledge", "set", "note", "brake_test",
        "commission_begin", "commission_step", "commission_end",
    }
)  # fmt: skip

_ACTIONS: Final = {
    "take": Action.AUTHORITY, "give": Action.AUTHORITY, "alive": Action.VIEW, "power": Action.POWER,
    "mode": Action.MODE, "jog": Action.JOG, "renew": Action.JOG, "release": Action.VIEW,
    "increment": Action.JOG, "move": Action.MOVE, "move_by": Action.MOVE, "halt": Action.HALT, "stop": Action.STOP,
    "quick_stop": Action.QUICK_STOP, "reset": Action.RESET, "acknowledge": Action.ACKNOWLEDGE,
    "note": Action.NOTE,
    "brake_test": Action.BRAKE_TEST, "commission_begin": Action.COMMISSION, "commission_step": Action.COMMISSION,
    "commission_end": Action.COMMISSION,
}  # fmt: skip


def action_of(message: Message) -> Action:
    """Find the action of a message in the table of rights."""
    if message.kind == "set":
        return SETTABLE[message.values["tag"]]
    if message.kind == "arm":
        return ARMABLE[message.values["action"]]
    if message.kind == "take" and message.values["over"]:
        return Action.TAKE_OVER
    return _ACTIONS[message.kind]


def is_kept_first(message: Message) -> bool:
    """Whether the reply to a command that was carried out waits for the commit of its event: power off never does."""
    return message.kind in KEPT_FIRST and message.values.get("on") is not False


def parse(text: str | bytes) -> Message:
    """Parse one message.

    Raises:
        MessageRefused: SEC-05, with the key that is wrong.
    """
    if len(text) > MESSAGE_MAX:
        raise MessageRefused(Code.SEC_05, reason=Words.MESSAGE_TOO_LONG(length=len(text), limit=MESSAGE_MAX))
    try:
        found = json.loads(text, parse_constant=_no_constant, object_pairs_hook=_no_twins)
    except (ValueError, RecursionError):
        raise MessageRefused(Code.SEC_05, reason=Words.NOT_JSON) from None
    try:
        return checked(found)
    except MessageRefused as refused:
        seq = found.get("seq") if isinstance(found, dict) else 0
        refused.seq = seq if type(seq) is int and 0 <= seq <= 2**53 else 0
        raise


def checked(found: object) -> Message:
    """Check a message of JSON values."""
    # The gateway checks to refuse early, the controller checks again and trusts nothing but the sender. One check takes
    # 1.6 to 3.7 us, written by hand it took 1.7 to 4.7 us in the same run (two processors, loaded).
    if not isinstance(found, dict):
        raise MessageRefused(Code.SEC_05, reason=Words.NOT_JSON)
    try:
        MESSAGES.validate_python(found)
    except ValidationError as fault:
        kind = found.get("type")
        if not isinstance(kind, str) or kind not in FIELDS:
            raise MessageRefused(Code.SEC_05, reason=Words.TYPE_UNKNOWN) from None
        raise MessageRefused(Code.SEC_05, reason=_cause(kind, fault)) from None
    kind = found["type"]
    # The values as they came: 40 stays a whole number in the journal, where a float would read 40.0.
    values = {name: found[name] for name in FIELDS[kind] if name in found}
    return Message(
        kind,
        found["seq"],
        "" if kind in WITHOUT_FRAME else found["frame"],
        None if kind in WITHOUT_EPOCH else found["epoch"],
        values,
    )


_CAUSES: Final = {
    "missing": Words.KEY_MISSING,
    "extra_forbidden": Words.KEY_UNKNOWN,
    "float_type": Words.KEY_NO_NUMBER,
    "finite_number": Words.KEY_NO_NUMBER,
    "int_type": Words.KEY_NO_WHOLE_NUMBER,
    "bool_type": Words.KEY_NO_BOOLEAN,
}


def _cause(kind: str, fault: ValidationError) -> Said:
    """Say what is wrong with one key: missing and unknown keys come first."""
    errors = fault.errors(include_url=False)
    error = min(errors, key=lambda each: each["type"] not in ("missing", "extra_forbidden"))
    key, context = ascii(str(error["loc"][-1])[:40]), error.get("ctx", {})
    for bound in ("ge", "le"):
        if bound in context:
            value = ascii(error["input"])[:40]
            return Words.KEY_BEYOND(kind=kind, key=key, value=value, limit=context[bound])
    if error["type"] == "string_pattern_mismatch":
        return Words.KEY_PATTERN(kind=kind, key=key, pattern=context["pattern"])
    if error["type"] == "literal_error":
        choices = context["expected"].replace(" or ", ", ")
        return Words.KEY_NO_CHOICE(kind=kind, key=key, choices=choices)
    return _CAUSES.get(error["type"], Words.KEY_NO_TEXT)(kind=kind, key=key)


def reply_to(
    seq: int, refused: MessageRefused | None = None, *, epoch: int | None = None, journal: int = 0
) -> dict[str, Any]:
    """Make the reply to a command.

    Args:
        epoch: the newest one, if it is known. journal: number of the event, 0 for none.
    """
    return {
        "type": "reply",
        "seq": seq,
        "ok": refused is None,
        "code": "" if refused is None else str(refused.refusal.code),
        "text": "" if refused is None else str(refused),
        "values": {} if refused is None else to_wire(refused.refusal.values),
        "epoch": epoch,
        "journal": journal,
    }


def compact(value: object) -> str:
    """JSON without spaces, in any script."""
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False)


def to_record(identity: Identity, message: Mapping[str, Any]) -> bytes:
    """Make a record for the command ring."""
    # In any script: a line of the shift log has four bytes a character at most, where an escape has twelve.
    return json.dumps(
        [*identity, message], separators=(",", ":"), allow_nan=False, ensure_ascii=False
    ).encode()


def from_record(record: bytes) -> tuple[Identity, dict[str, Any]]:
    """Read sender and message of a record; ValueError for anything else."""
    try:
        client, user, role, place, person, message = json.loads(record)
    except (TypeError, RecursionError) as fault:
        raise ValueError("no record of a message") from fault
    if not isinstance(message, dict):
        raise ValueError("no message in the record")
    return Identity(str(client), str(user), Role(role), str(place), str(person)), message


def _no_constant(word: str) -> float:
    raise ValueError(word)


def _no_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a key twice")
    return found
