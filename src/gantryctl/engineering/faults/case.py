"""A row of the fault catalogue as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Literal, NamedTuple

from gantryctl.engineering.faults.injection import Injection
from gantryctl.machine import Machine
from gantryctl.machine.reference import is_reference_machine
from gantryctl.program.alarms.codes import Code


class Phase(Enum):
    """Phase of the axis in which a fault begins."""

    OFF = "standstill, power off"
    POWER_UP = "power-up"
    ENABLED = "standstill, enabled"
    FIRST_MOVE = "first move after power-up"
    ACCELERATION = "acceleration"
    CRUISE = "cruise"
    DECELERATION = "deceleration"
    QUICK_STOP = "quick stop under way"
    HOLD = "held by torque because the brake is not trusted"
    BRAKE_TEST = "brake test"

    @property
    def moves(self) -> bool:
        """The axis turns when the fault begins."""
        return self in (Phase.ACCELERATION, Phase.CRUISE, Phase.DECELERATION, Phase.QUICK_STOP)


class ReactionClass(Enum):
    """What limits the way from the fault to rest."""

    QUICK_STOP = "quick stop"
    DRIVE_DEADLINE = "quick stop of the drive by its own deadline"
    TORQUE_OFF = "torque off and brake"
    FEEDBACK = "torque off and brake, feedback in doubt"
    STANDSTILL = "caught at standstill"
    BRAKE_SLIP = "brake slips, held by torque"
    HALT = "stop on the jog-release ramp"
    WARNING = "warning, the motion goes on"
    REFUSED = "refused"
    NONE = "none"


class SeenBy(Enum):
    """The monitor whose time a fault takes to be seen."""

    CLASS = "any of its class"
    SATURATION = "torque at its limit while the following error grows"
    BRAKE_CONTACT = "contact of the brake"
    WINDING = "temperature of the winding"
    RAMP = "speed above the ramp of the quick stop"
    HEARTBEAT = "heartbeat of the drive"
    DRAG = "torque of a motion against that of earlier ones"


class Instead(NamedTuple):
    """An alarm that comes first on axes of another physics than the reference gantry.

    Attributes:
        why: what of the axis decides it, for people. where: whether an axis is so; never asked of the reference gantry.
    """

    code: Code
    why: str
    where: Callable[[Machine], bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultCase:
    """One run of a fault: how it is injected, what must happen, and what a person reads.

    Its evidence and its state stand in the row of the table to which its number belongs.

    Attributes:
        number: of the catalogue, "A2"; a letter behind it is a variant, "A2b".
        title: the fault in a few words.
        detected_by: monitor and its threshold.
        reaction: class whose limit holds.
        codes: alarm that may come first; () where none comes. instead: what other axes may tell first, and which.
        reads: what the operator reads, in a few words.
        phase: where the fault begins.
        buses: drives on which it can be injected.
        beside: it is of a node beside the drive, which the axis of the run has.
        position_valid: at the end; None: not judged.
        also: alarm that must come too. rests: False: nothing is left that could hold the load.
        hold: the drive may be enabled again to hold the load.
        seen_by: the monitor that sees it, where it takes longer than its class.
        from_deviation: the way counts from the first 0.1 deg/s of true speed deviation.
        judged: False: nothing is demanded of the run, it is shown.
    """

    number: str
    title: str
    detected_by: str
    reaction: ReactionClass
    injections: tuple[Injection, ...]
    codes: tuple[Code, ...] = ()
    instead: tuple[Instead, ...] = ()
    reads: str = ""
    phase: Phase = Phase.CRUISE
    buses: tuple[Literal["sim", "bus"], ...] = ("sim", "bus")
    beside: bool = False
    position_valid: bool | None = None
    also: Code | None = None
    rests: bool = True
    hold: bool = False
    seen_by: SeenBy = SeenBy.CLASS
    from_deviation: bool = False
    judged: bool = True

    def codes_on(self, machine: Machine) -> tuple[Code, ...]:
        """Alarms that may come first on this axis."""
        if is_reference_machine(machine):
            return self.codes
        return (*self.codes, *(each.code for each in self.instead if each.where(machine)))
