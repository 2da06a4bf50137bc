"""CiA 402 as two pure functions that never wait: statusword to state, state and request to controlword.

| state seen             | DISABLE | ENABLE | QUICK_STOP | FAULT_RESET             |
|------------------------|---------|--------|------------|-------------------------|
| Switch on disabled     | 00      | 06     | 00         | 00                      |
| Ready to switch on     | 00      | 07     | 00         | 00                      |
| Switched on            | 00      | 0F     | 00         | 00                      |
| Operation enabled      | 00      | 0F     | 02         | 00                      |
| Quick stop active      | 00      | 02     | 02         | 00                      |
| Fault                  | 00      | 00     | 00         | 80 and 00 in turn       |
| anything else          | 00      | 00     | 00         | 00                      |
"""

from __future__ import annotations

from typing import Final

from gantryctl.image import DriveRequest, DriveState

# Controlwords (CiA 402): bit 0 switch on, 1 enable voltage, 2 quick stop (0 = active), 3 enable operation, 7 fault
# reset.
DISABLE_VOLTAGE: Final = 0x00
QUICK_STOP: Final = 0x02
SHUTDOWN: Final = 0x06
SWITCH_ON: Final = 0x07
DISABLE_OPERATION: Final = 0x07
ENABLE_OPERATION: Final = 0x0F
FAULT_RESET: Final = 0x80

# Bits of the statusword beside the state.
WARNING: Final = 1 << 7
# The drive obeys the bus.
REMOTE: Final = 1 << 9
INTERNAL_LIMIT: Final = 1 << 11
# Mode specific; in CSV 1 = the drive follows 60FF, and 0 while Operation enabled is a fault.
FOLLOWS_COMMAND: Final = 1 << 12

# Statusword patterns of CiA 402 (IEC 61800-7-201). Of the 128 patterns of the low seven bits 24 are states: the others
# decode to UNKNOWN, which leads to a safe word.
_BY_4F: Final = {
    0x00: DriveState.NOT_READY_TO_SWITCH_ON,
    0x40: DriveState.SWITCH_ON_DISABLED,
    0x0F: DriveState.FAULT_REACTION_ACTIVE,
    0x08: DriveState.FAULT,
}
_BY_6F: Final = {
    0x21: DriveState.READY_TO_SWITCH_ON,
    0x23: DriveState.SWITCHED_ON,
    0x27: DriveState.OPERATION_ENABLED,
    0x07: DriveState.QUICK_STOP_ACTIVE,
}
_STATES: Final = tuple(
    _BY_4F.get(low & 0x4F, _BY_6F.get(low & 0x6F, DriveState.UNKNOWN)) for low in range(128)
)
_TO_ENABLED: Final = {
    DriveState.SWITCH_ON_DISABLED: SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: SWITCH_ON,
    DriveState.SWITCHED_ON: ENABLE_OPERATION,
    DriveState.OPERATION_ENABLED: ENABLE_OPERATION,
    # Only DISABLE ends a quick stop: 0F would enable again with the option codes 5 to 8 of 605A.
    DriveState.QUICK_STOP_ACTIVE: QUICK_STOP,
}
TURNING: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
ENERGISED: Final = (*TURNING, DriveState.FAULT_REACTION_ACTIVE)


def decode_statusword(word: int) -> DriveState:
    """State that 6041 shows; UNKNOWN for a pattern outside the table."""
    return _STATES[word & 0x7F]


def next_controlword(state: DriveState, request: DriveRequest, previous: int) -> int:
    """Word for 6040.

    Args:
        state: as decoded from the last statusword.
        request: of the program.
        previous: the word sent last, for the edge of the reset bit.
    """
    # Bit 7 acts on its rising edge. It goes back to 0 in between, for drives that freeze while it is set, and a reset
    # never enables: both were seen on drives, or in libraries (decision 0012).
    if request is DriveRequest.ENABLE:
        return _TO_ENABLED.get(state, DISABLE_VOLTAGE)
    # In Switched on it is what "disable voltage" is; of a drive that is enabled by the next SYNC it is its quick stop.
    if request is DriveRequest.QUICK_STOP and (state in TURNING or state is DriveState.SWITCHED_ON):
        return QUICK_STOP
    if request is DriveRequest.FAULT_RESET and state is DriveState.FAULT and not previous & FAULT_RESET:
        return FAULT_RESET
    return DISABLE_VOLTAGE
