"""NMT slave states (CiA 301) as one pure function.

| command           | state afterwards | allowed from                     |
|-------------------|------------------|----------------------------------|
| 01 start          | OPERATIONAL      | any but initialising             |
| 02 stop           | STOPPED          | any but initialising             |
| 80 pre-operational| PRE_OPERATIONAL  | any but initialising             |
| 81 reset node     | INITIALISING     | always; boot-up, PRE_OPERATIONAL |
| 82 reset comm.    | INITIALISING     | always; boot-up, PRE_OPERATIONAL |

| service | PRE_OPERATIONAL | OPERATIONAL | STOPPED |
|---------|-----------------|-------------|---------|
| PDO     |                 | yes         |         |
| SDO     | yes             | yes         |         |
| SYNC    | yes             | yes         |         |
| EMCY    | yes             | yes         |         |
| NMT, heartbeat | yes      | yes         | yes     |
"""

from __future__ import annotations

from enum import IntEnum
from typing import assert_never


# Written against CiA 301 and sharing no code with the master, so that either can be tested against the other.
class NmtState(IntEnum):
    """NMT states with their value in the heartbeat; INITIALISING is the boot-up message."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """Command specifiers of the NMT message."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


def next_nmt(state: NmtState, command: NmtCommand) -> NmtState:
    """State after a command; INITIALISING: reset, boot up and go on to PRE_OPERATIONAL."""
    if state is NmtState.INITIALISING:
        return state
    match command:
        case NmtCommand.START:
            return NmtState.OPERATIONAL
        case NmtCommand.STOP:
            return NmtState.STOPPED
        case NmtCommand.ENTER_PRE_OPERATIONAL:
            return NmtState.PRE_OPERATIONAL
        case NmtCommand.RESET_NODE | NmtCommand.RESET_COMMUNICATION:
            return NmtState.INITIALISING
        case _:
            assert_never(command)


def command_for(data: bytes, node_id: int) -> NmtCommand | None:
    """Command of an NMT message for this node, or for all nodes (node id 0); else None."""
    if len(data) != 2 or data[1] not in (0, node_id):
        return None
    try:
        return NmtCommand(data[0])
    except ValueError:
        return None
