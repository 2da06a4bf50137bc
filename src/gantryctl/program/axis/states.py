"""The axis states of PLCopen Part 1, and their table."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, assert_never


class AxisState(IntEnum):
    """Axis states of PLCopen Part 1; a trace holds the number. No block leads to SYNCHRONIZED_MOTION (gearing)."""

    DISABLED = 0
    STANDSTILL = 1
    HOMING = 2
    DISCRETE_MOTION = 3
    CONTINUOUS_MOTION = 4
    SYNCHRONIZED_MOTION = 5
    STOPPING = 6
    ERROR_STOP = 7


class AxisEvents(NamedTuple):
    """Inputs of the state table in one scan.

    Attributes:
        error: a stop-class alarm is latched.
        powered: power is on: the axis follows commands.
        stop_held: Execute of Stop is TRUE, or the axis is still coming to rest.
        motion: state of the motion under way, or None.
    """

    error: bool
    powered: bool
    stop_held: bool
    motion: AxisState | None


def next_state(state: AxisState, events: AxisEvents) -> AxisState:
    """Return the state of the next scan: at most one transition, by the first row that applies.

    | from             | when                                  | to                              |
    |------------------|---------------------------------------|---------------------------------|
    | any              | error                                 | ErrorStop                       |
    | ErrorStop        | error gone (Reset), powered           | Standstill                      |
    | ErrorStop        | error gone (Reset), not powered       | Disabled                        |
    | Disabled         | powered                               | Standstill                      |
    | any other        | not powered                           | Disabled                        |
    | any motion state | stop held                             | Stopping                        |
    | Standstill       | stop held                             | Stopping                        |
    | Stopping         | stop not held any more, at rest       | Standstill                      |
    | Standstill       | a motion begins                       | the state of that motion        |
    | any motion state | another motion takes over             | the state of that motion        |
    | any motion state | no motion under way                   | Standstill                      |

    Disabled goes to Standstill only: a motion accepted in the scan of power-up shows one scan later.
    """
    if events.error:
        return AxisState.ERROR_STOP
    match state:
        # Every alarm of a stop class ends with torque off, or with HOLD: in practice Reset leads to Disabled.
        case AxisState.ERROR_STOP | AxisState.DISABLED:
            return AxisState.STANDSTILL if events.powered else AxisState.DISABLED
        case AxisState.STOPPING:
            if not events.powered:
                return AxisState.DISABLED
            return AxisState.STOPPING if events.stop_held else AxisState.STANDSTILL
        case (
            AxisState.STANDSTILL
            | AxisState.HOMING
            | AxisState.DISCRETE_MOTION
            | AxisState.CONTINUOUS_MOTION
            | AxisState.SYNCHRONIZED_MOTION
        ):
            if not events.powered:
                return AxisState.DISABLED
            if events.stop_held:
                return AxisState.STOPPING
            return AxisState.STANDSTILL if events.motion is None else events.motion
        case _:
            assert_never(state)
