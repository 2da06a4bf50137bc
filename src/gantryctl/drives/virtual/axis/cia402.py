"""CiA 402 state machine of the drive (IEC 61800-7-201) and its option codes, as pure functions.

| state                  | 6041 pattern | 06 shutdown | 07 switch on | 0F enable   | 02 quick stop | 00 voltage off |
|------------------------|--------------|-------------|--------------|-------------|---------------|----------------|
| Not ready to switch on | x0xx 0000    | (leaves by itself, transition 1)                                         |
| Switch on disabled     | x1xx 0000    | 2 Ready     |              |             |               |                |
| Ready to switch on     | x01x 0001    |             | 3 Switched   | 3 Switched  | 7 Disabled    | 7 Disabled     |
| Switched on            | x01x 0011    | 6 Ready     |              | 4 Enabled   | 10 Disabled   | 10 Disabled    |
| Operation enabled      | x01x 0111    | 8 Ready     | 5 Switched   |             | 11 Quick stop | 9 Disabled     |
| Quick stop active      | x00x 0111    |             |              | 16 Enabled  |               | 12 Disabled    |
| Fault reaction active  | x0xx 1111    | (leaves by itself, transition 14)                                        |
| Fault                  | x0xx 1000    | only a rising edge of bit 7: 15 Disabled                                 |

13: any state to Fault reaction active. 16 only with quick stop option codes 5 to 8. 3 needs power and no STO; 0F in
Ready to switch on goes on to 4 by itself. How a state is left (ramp, torque off at once, brake first) is the axis'
business, not this module's.
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import Final, NamedTuple, assert_never


class State(IntEnum):
    """Drive states; the value is the pattern of bits 0..3, 5 and 6 of the statusword."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY = 0x21
    SWITCHED_ON = 0x23
    ENABLED = 0x27
    QUICK_STOP = 0x07
    FAULT_REACTION = 0x0F
    FAULT = 0x08


class Command(Enum):
    """Commands in bits 0..3 of the controlword; disable operation has the pattern of SWITCH_ON."""

    DISABLE_VOLTAGE = 0
    QUICK_STOP = 1
    SHUTDOWN = 2
    SWITCH_ON = 3
    ENABLE = 4


FAULT_RESET_BIT: Final = 0x80
HALT_BIT: Final = 0x100

# Bits of the statusword beside the state.
VOLTAGE_ENABLED: Final = 1 << 4
WARNING: Final = 1 << 7
REMOTE: Final = 1 << 9
TARGET_REACHED: Final = 1 << 10
INTERNAL_LIMIT: Final = 1 << 11
# Mode specific. CSV: the drive follows 60FF; PV: the speed is zero.
FOLLOWS_COMMAND: Final = 1 << 12


def command_of(controlword: int) -> Command:
    """Command of a controlword: every word is one of five."""
    if not controlword & 2:
        return Command.DISABLE_VOLTAGE
    if not controlword & 4:
        return Command.QUICK_STOP
    if not controlword & 1:
        return Command.SHUTDOWN
    return Command.ENABLE if controlword & 8 else Command.SWITCH_ON


def is_fault_reset(previous: int, controlword: int) -> bool:
    """Rising edge of bit 7."""
    return bool(controlword & FAULT_RESET_BIT) and not previous & FAULT_RESET_BIT


def next_state(state: State, command: Command, power_ok: bool, quick_stop_stays: bool) -> State:
    """State after a command, at most one transition further.

    Args:
        state: the present state.
        command: the command in force.
        power_ok: mains are on and no safe torque off is requested.
        quick_stop_stays: the quick stop option code is 5 to 8.
    """
    match state:
        case State.NOT_READY | State.FAULT_REACTION | State.FAULT:
            return state
        case State.SWITCH_ON_DISABLED:
            return State.READY if command is Command.SHUTDOWN else state
        case State.READY | State.SWITCHED_ON | State.ENABLED:
            return _powered(state, command, power_ok)
        case State.QUICK_STOP:
            if command is Command.DISABLE_VOLTAGE:
                return State.SWITCH_ON_DISABLED
            return State.ENABLED if command is Command.ENABLE and quick_stop_stays else state
        case _:
            assert_never(state)


def _powered(state: State, command: Command, power_ok: bool) -> State:
    enabled = state is State.ENABLED
    match command:
        case Command.DISABLE_VOLTAGE:
            return State.SWITCH_ON_DISABLED
        case Command.QUICK_STOP:
            return State.QUICK_STOP if enabled else State.SWITCH_ON_DISABLED
        case Command.SHUTDOWN:
            return State.READY
        case Command.SWITCH_ON:
            return State.SWITCHED_ON if power_ok else State.READY
        case Command.ENABLE:
            if state is State.READY:
                return State.SWITCHED_ON if power_ok else State.READY
            return State.ENABLED
        case _:
            assert_never(command)


def statusword(state: State, bits: int) -> int:
    """6041: pattern of the state and the other bits."""
    return state.value | bits


class Ramp(Enum):
    """Ramp that brings the shaft to rest."""

    NONE = 0
    """Torque off at once, the brake closes."""
    SLOW = 1
    """Slow-down ramp, 6084."""
    QUICK = 2
    """Quick-stop ramp, 6085."""
    LIMIT = 3
    """As hard as the torque limit allows (current limit, voltage limit)."""


class StopPlan(NamedTuple):
    """Ramp, and whether the drive stays energised afterwards."""

    ramp: Ramp
    stay: bool = False


class AbortConnection(IntEnum):
    """6007: reaction of the axis to lost communication."""

    NOTHING = 0
    FAULT = 1
    DISABLE_VOLTAGE = 2
    QUICK_STOP = 3


# By option code; 3 and 4 are current limit and voltage limit.
_RAMPS: Final = (Ramp.NONE, Ramp.SLOW, Ramp.QUICK, Ramp.LIMIT, Ramp.LIMIT)


def quick_stop_plan(code: int) -> StopPlan:
    """Reaction of 605A: 0 to 4 end in Switch on disabled, 5 to 8 are 1 to 4 and stay in Quick stop active."""
    return StopPlan(_RAMPS[code - 4 if code > 4 else code], stay=code > 4)


def leave_ramp(code: int) -> Ramp:
    """Ramp of 605B shutdown and 605C disable operation: 0 torque off, 1 slow-down ramp."""
    return Ramp.SLOW if code == 1 else Ramp.NONE


def stop_ramp(code: int) -> Ramp:
    """Ramp of 605E fault reaction and 605D halt, where the drive stays enabled."""
    return _RAMPS[code]
