"""The phases of the power sequence and what each of them says to the drive."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

from gantryctl.image import DriveRequest


class PowerPhase(Enum):
    """Where the power sequence is.

    | phase         | leaves when                                             | to                           |
    |---------------|---------------------------------------------------------|------------------------------|
    | OFF           | switched on                                             | ENABLING                     |
    | ENABLING      | drive in Operation enabled                              | PROVING, or SAG_WATCH when   |
    |               |                                                         | no proof is possible; TESTING|
    |               |                                                         | when a brake test is asked   |
    |               |                                                         | for                          |
    | PROVING       | actual torque proven against the closed brake           | SETTLING                     |
    | SETTLING      | torque is at the preload                                | RELEASING                    |
    | RELEASING     | brake feedback open                                     | SAG_WATCH                    |
    | SAG_WATCH     | stood still for the watch time                          | ON                           |
    | ON            | switched off at standstill, or brake wanted for holding | CLOSING                      |
    | CLOSING       | brake closed                                            | UNLOADING                    |
    | UNLOADING     | torque taken off in three steps, brake holds            | DISABLING                    |
    | DISABLING     | drive not enabled any more                              | OFF, or PARKED               |
    | PARKED        | a motion is wanted / switched off                       | ENABLING / OFF               |
    | QUICK_STOPPING| at rest                                                 | CLOSING                      |
    | TORQUE_OFF    | at rest                                                 | OFF                          |
    | TORQUE_HOLD   | reset by service                                        | CLOSING                      |
    | TESTING       | brake test over, torque back at the preload             | UNLOADING                    |
    | any but OFF   | alarm QUICK_STOP                                        | QUICK_STOPPING (or down)     |
    | any but OFF   | alarm TORQUE_OFF                                        | TORQUE_OFF                   |
    | any           | alarm HOLD, drive able                                  | TORQUE_HOLD                  |
    """

    OFF = 0
    ENABLING = 1
    PROVING = 2
    SETTLING = 3
    RELEASING = 4
    SAG_WATCH = 5
    ON = 6
    CLOSING = 7
    UNLOADING = 8
    DISABLING = 9
    PARKED = 10
    QUICK_STOPPING = 11
    TORQUE_OFF = 12
    TORQUE_HOLD = 13
    TESTING = 14


class Proof(Enum):
    """What is known about torque before the brake opened."""

    NOT_DONE = "not done"
    PROVEN = "torque proven against the closed brake"
    NOT_POSSIBLE = "no proof possible, the drive's own brake sequence was accepted"


class PhaseOutput(NamedTuple):
    """What a phase says; request None keeps the one before."""

    request: DriveRequest | None
    brake_open: bool


_ENABLE, _DISABLE = DriveRequest.ENABLE, DriveRequest.DISABLE

OUTPUTS: Final = {
    PowerPhase.OFF: PhaseOutput(_DISABLE, False),
    PowerPhase.ENABLING: PhaseOutput(_ENABLE, False),
    PowerPhase.PROVING: PhaseOutput(_ENABLE, False),
    PowerPhase.SETTLING: PhaseOutput(_ENABLE, False),
    PowerPhase.RELEASING: PhaseOutput(_ENABLE, True),
    PowerPhase.SAG_WATCH: PhaseOutput(_ENABLE, True),
    PowerPhase.ON: PhaseOutput(_ENABLE, True),
    PowerPhase.CLOSING: PhaseOutput(None, False),
    PowerPhase.UNLOADING: PhaseOutput(None, False),
    PowerPhase.DISABLING: PhaseOutput(_DISABLE, False),
    PowerPhase.PARKED: PhaseOutput(_DISABLE, False),
    PowerPhase.QUICK_STOPPING: PhaseOutput(DriveRequest.QUICK_STOP, True),
    PowerPhase.TORQUE_OFF: PhaseOutput(_DISABLE, False),
    PowerPhase.TORQUE_HOLD: PhaseOutput(None, False),
    PowerPhase.TESTING: PhaseOutput(_ENABLE, False),
}
"""Drive request and brake command of every phase: the one place where they are decided."""

RISING: Final = frozenset(
    {
        PowerPhase.ENABLING,
        PowerPhase.PROVING,
        PowerPhase.SETTLING,
        PowerPhase.RELEASING,
        PowerPhase.SAG_WATCH,
        PowerPhase.TESTING,
    }
)
"""On the way up, or in a brake test: the drive is enabled and holds nothing alone."""

FALLING: Final = frozenset(
    {
        PowerPhase.CLOSING,
        PowerPhase.UNLOADING,
        PowerPhase.DISABLING,
        PowerPhase.QUICK_STOPPING,
        PowerPhase.TORQUE_OFF,
    }
)
"""On the way down, or stopping."""

TORQUE_ON: Final = frozenset(
    {
        PowerPhase.PROVING,
        PowerPhase.SETTLING,
        PowerPhase.RELEASING,
        PowerPhase.SAG_WATCH,
        PowerPhase.ON,
        PowerPhase.CLOSING,
        PowerPhase.UNLOADING,
        PowerPhase.QUICK_STOPPING,
        PowerPhase.TESTING,
    }
)
"""The drive must be enabled (or in its quick stop); anything else is a fault."""
