"""The phases of the power sequence, and the commands of each to the drive."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

from gantryctl.image import DriveRequest


class PowerPhase(Enum):
    """Phase of the power sequence.

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
    """Commands of a phase to the drive, and what the phase demands.

    Attributes:
        request: None keeps the one before.
        rising: on the way up, or in a brake test.
        falling: on the way down, or stopping.
        torque_on: the drive must be enabled (or in its quick stop); anything else is a fault.
    """

    request: DriveRequest | None
    brake_open: bool
    rising: bool = False
    falling: bool = False
    torque_on: bool = False


_ENABLE, _DISABLE, _STOP = DriveRequest.ENABLE, DriveRequest.DISABLE, DriveRequest.QUICK_STOP

# Every row holds the load: a closed or closing brake, or an enabled drive.
OUTPUTS: Final = {
    PowerPhase.OFF: PhaseOutput(_DISABLE, brake_open=False),
    PowerPhase.ENABLING: PhaseOutput(_ENABLE, brake_open=False, rising=True),
    PowerPhase.PROVING: PhaseOutput(_ENABLE, brake_open=False, rising=True, torque_on=True),
    PowerPhase.SETTLING: PhaseOutput(_ENABLE, brake_open=False, rising=True, torque_on=True),
    PowerPhase.RELEASING: PhaseOutput(_ENABLE, brake_open=True, rising=True, torque_on=True),
    PowerPhase.SAG_WATCH: PhaseOutput(_ENABLE, brake_open=True, rising=True, torque_on=True),
    PowerPhase.ON: PhaseOutput(_ENABLE, brake_open=True, torque_on=True),
    PowerPhase.CLOSING: PhaseOutput(None, brake_open=False, falling=True, torque_on=True),
    PowerPhase.UNLOADING: PhaseOutput(None, brake_open=False, falling=True, torque_on=True),
    PowerPhase.DISABLING: PhaseOutput(_DISABLE, brake_open=False, falling=True),
    PowerPhase.PARKED: PhaseOutput(_DISABLE, brake_open=False),
    PowerPhase.QUICK_STOPPING: PhaseOutput(_STOP, brake_open=True, falling=True, torque_on=True),
    PowerPhase.TORQUE_OFF: PhaseOutput(_DISABLE, brake_open=False, falling=True),
    PowerPhase.TORQUE_HOLD: PhaseOutput(None, brake_open=False),
    PowerPhase.TESTING: PhaseOutput(_ENABLE, brake_open=False, rising=True, torque_on=True),
}
RISING: Final = frozenset(phase for phase, row in OUTPUTS.items() if row.rising)
FALLING: Final = frozenset(phase for phase, row in OUTPUTS.items() if row.falling)
TORQUE_ON: Final = frozenset(phase for phase, row in OUTPUTS.items() if row.torque_on)
