"""The PLCopen axis states and their one table."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple, assert_never


class AxisState(IntEnum):
    """PLCopen Part 1 axis states; the number is what the trace shows."""

    DISABLED = 0
    STANDSTILL = 1
    HOMING = 2
    DISCRETE_MOTION = 3
    CONTINUOUS_MOTION = 4
    SYNCHRONIZED_MOTION = 5
    """Kept for gearing: no block of this version leads here."""
    STOPPING = 6
    ERROR_STOP = 7


class AxisEvents(NamedTuple):
    """What one scan knows when it decides on the next state."""

    error: bool
    """A stop-class alarm is latched."""
    powered: bool
    """Power is on: the axis follows commands."""
    stop_held: bool
    """Stop: its Execute is TRUE, or the axis is still coming to rest."""
    motion: AxisState | None
    """The state that the motion under way belongs to; None when there is none."""


def next_state(state: AxisState, events: AxisEvents) -> AxisState:
    """At most one transition a scan; the first row that applies wins.

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
