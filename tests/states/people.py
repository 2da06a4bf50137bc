"""What people may say, and through what: the operator of the service, or a panel."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any, Final

from gantryctl.image import Mode, OperatorCommand
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from gantryctl.units import deg
from states.brief_settings import SPEED_RAD_S, WAY_RAD
from states.stub_drive import Once, Standing


def person(role: Role, place: str = "console") -> Identity:
    return Identity(str(role), str(role), role, place)


OPERATOR, SERVICE, VIEWER = person(Role.OPERATOR), person(Role.SERVICE), person(Role.VIEWER)
PANEL: Final = person(Role.SERVICE, "local")


class Now:
    """The operator's clock; it goes on only while somebody is silent."""

    __slots__ = ("time_s",)

    def __init__(self) -> None:
        self.time_s = 0.0

    def __call__(self) -> float:
        return self.time_s


class Wire:
    """A ring of the shared memory that keeps nothing but what was put in last."""

    __slots__ = ("records",)
    record_max = 1 << 20

    def __init__(self) -> None:
        self.records: deque[bytes] = deque(maxlen=8)

    def __len__(self) -> int:
        return len(self.records)

    def put(self, record: bytes) -> bool:
        self.records.append(record)
        return True

    def peek(self, count: int) -> list[bytes]:
        return list(self.records)[:count]

    def advance(self, count: int) -> None:
        for _ in range(count):
            self.records.popleft()


class Journal:
    """A journal that keeps everything, and shows nothing."""

    keeps, locked, room = True, False, True

    def put(self, *_: object, **__: object) -> int:
        return 1


@dataclass(frozen=True)
class Event:
    """What happens in one scan: a message of somebody, or something at the drive, or nothing.

    Attributes:
        old: the message names an epoch that is over.
        silence: the holder of control, and whoever holds a key or has armed something, falls silent.
    """

    who: Identity | None = None
    kind: str = ""
    values: tuple[tuple[str, Any], ...] = ()
    old: bool = False
    silence: bool = False
    drive: Standing | Once | None = None

    @property
    def stops(self) -> bool:
        return self.kind in ("stop", "quick_stop", "release")

    def __str__(self) -> str:
        if self.who is not None:
            said = " ".join([self.kind, *(str(value) for _, value in self.values)])
            return f"{self.who.user}: {said}{' (of an old epoch)' if self.old else ''}"
        return "silence" if self.silence else str(self.drive.value if self.drive else "nothing")


def say(who: Identity, kind: str, *, old: bool = False, **values: Any) -> Event:
    return Event(who, kind, tuple(values.items()), old)


NOTHING: Final = Event()
# Pressed and let go before anything else happens. A stop is let go in the scan after, whatever happens in it.
_PULSES: Final = ("move", "reset", "brake_test")


class Panel:
    """A panel: levels of the program. A pulse is pressed in one scan and let go in the next (`parts`).

    Stands in for the operator of the service where the drive is explored: what people may do is explored beside it.
    """

    __slots__ = ("levels",)

    def __init__(self) -> None:
        self.levels = OperatorCommand(
            mode=Mode.CONTINUOUS, speed_rad_s=SPEED_RAD_S, increment_rad=WAY_RAD, override=1.0
        )

    def do(self, event: Event, pos_rad: float) -> None:
        """Take the event of one scan; a move goes from one end of the way to the other."""
        # A pulse of the scan before falls, and the program sees it fall before it can rise again.
        levels = self.levels._replace(move=False, stop=False, quick_stop=False, reset=False, brake_test=False)
        values = dict(event.values)
        match event.kind:
            case "power":
                levels = levels._replace(power=values["on"])
            case "move":
                levels = levels._replace(move=True, target_rad=0.0 if pos_rad > 0.75 * WAY_RAD else WAY_RAD)
            case "jog":
                levels = levels._replace(forward=True)
            case "release":
                levels = levels._replace(forward=False)
            case "stop" | "quick_stop" | "reset" | "brake_test" as pulse:
                levels = levels._replace(**{pulse: True})
        if event.kind in ("jog", "renew"):
            levels = levels._replace(lease=levels.lease + 1)
        self.levels = levels

    def parts(self, event: Event) -> tuple[Event, ...]:
        """The scans that an event takes."""
        return (event, NOTHING) if event.kind in _PULSES else (event,)

    def can(self, event: Event) -> bool:
        """A level that is TRUE cannot rise, and one that is FALSE cannot fall."""
        levels = self.levels
        match event.kind:
            case "power":
                return levels.power is not dict(event.values)["on"]
            case "jog":
                return not levels.forward
            case "release" | "renew":
                return levels.forward
            case "stop":
                return not levels.stop
            case "quick_stop":
                return not levels.quick_stop
        return True


def commands() -> tuple[Event, ...]:
    """What people say."""
    target = deg(WAY_RAD)
    return (
        say(OPERATOR, "take", over=False),
        say(OPERATOR, "give"),
        say(OPERATOR, "power", on=True),
        say(OPERATOR, "power", on=False),
        say(OPERATOR, "mode", mode="continuous"),
        say(OPERATOR, "jog", direction="forward"),
        say(OPERATOR, "renew"),
        say(OPERATOR, "release"),
        say(OPERATOR, "move", target_deg=target),
        say(OPERATOR, "move", target_deg=-target),
        say(OPERATOR, "halt"),
        say(OPERATOR, "set", tag="override_percent", value=0.0),
        say(OPERATOR, "set", tag="override_percent", value=100.0),
        say(OPERATOR, "reset"),
        say(SERVICE, "take", over=True),
        say(SERVICE, "arm", action="reset_locked"),
        say(SERVICE, "reset"),
        say(SERVICE, "arm", action="brake_test"),
        say(SERVICE, "brake_test"),
        say(VIEWER, "stop"),
        say(VIEWER, "quick_stop"),
        Event(silence=True),
    )


def buttons() -> tuple[Event, ...]:
    """What the panel can do."""
    return (
        say(PANEL, "power", on=True),
        say(PANEL, "power", on=False),
        say(PANEL, "move"),
        say(PANEL, "stop"),
        say(PANEL, "quick_stop"),
        say(PANEL, "reset"),
        say(PANEL, "brake_test"),
    )


def without_right() -> tuple[Event, ...]:
    """What must change nothing, from anybody, in any state."""
    target = deg(WAY_RAD)
    return (
        say(VIEWER, "power", on=True),
        say(VIEWER, "move", target_deg=target),
        say(VIEWER, "reset"),
        say(VIEWER, "take", over=True),
        say(OPERATOR, "power", on=True, old=True),
        say(OPERATOR, "move", target_deg=target, old=True),
        say(OPERATOR, "arm", action="reset_locked"),
    )
