"""Reset of a drive fault by SDO, for a drive that nobody runs."""

from __future__ import annotations

from typing import Final

from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.drives.canopen.cia402 import DISABLE_VOLTAGE, FAULT_RESET, decode_statusword
from gantryctl.image import DriveState

# Some drives show a new state 10 ms after the word; a cause that lasts shows by the fault that stays.
_LAG_S: Final = 0.5
_STEP_S: Final = 0.02


def reset_fault(node: RemoteNode) -> DriveState:
    """Reset the fault; the state of the drive afterwards, FAULT where the cause is still there.

    Raises:
        DeviceError: the drive does not answer.
    """
    # Bit 7 acts on its rising edge, and some drives freeze while it is set (cia402). Bits 0 to 3 stay 0: it never
    # enables.
    for word in (DISABLE_VOLTAGE, FAULT_RESET, DISABLE_VOLTAGE):
        node.sdo.set(0x6040, 0, word)
    waited = 0.0
    while (state := decode_statusword(node.sdo.number(0x6041))) is DriveState.FAULT and waited < _LAG_S:
        node.listen_for(_STEP_S)
        waited += _STEP_S
    return state
