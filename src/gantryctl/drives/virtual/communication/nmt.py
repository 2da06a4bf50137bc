"""NMT slave (CiA 301): its states as one pure function, heartbeat producer (1017) and consumer (1016).

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

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Final

from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.objects import CONSUMERS


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


_TARGETS: Final = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}


def next_nmt(state: NmtState, command: NmtCommand) -> NmtState:
    """State after a command; INITIALISING: reset, boot up and go on to PRE_OPERATIONAL."""
    return state if state is NmtState.INITIALISING else _TARGETS[command]


def command_for(data: bytes, node_id: int) -> NmtCommand | None:
    """Command of an NMT message for this node, or for all nodes (node id 0); else None."""
    addressed = len(data) == 2 and data[1] in (0, node_id)
    return next((command for command in NmtCommand if addressed and command == data[0]), None)


# Error code "life guard error or heartbeat error" (CiA 301).
HEARTBEAT_LOST: Final = 0x8130


@dataclass(slots=True)
class _Watched:
    """Watched node."""

    # CiA 301: monitoring starts with the first heartbeat of the producer.

    node: int
    period_us: int
    deadline_us: int | None = None
    lost: bool = False


class HeartbeatProducer:
    """Send the NMT state every 1017 ms.

    Args:
        od: holds 1017.
        send: sends the heartbeat.
    """

    def __init__(self, od: Dictionary, send: Callable[[], None]) -> None:
        self._od, self._send = od, send
        self._next_us: int | None = None
        self._now_us = 0
        od.actions[0x1017, 0] = self._changed

    def reload(self, now_us: int) -> None:
        """Take over 1017 after a reset; the boot-up message stands for the first heartbeat."""
        self._now_us = now_us
        period = 1000 * self._od.number(0x1017)
        self._next_us = now_us + period if period else None

    def _changed(self, value: int) -> None:
        if value:  # a new producer time begins with a heartbeat
            self._next_us = self._now_us + 1000 * value
            self._send()
        else:
            self._next_us = None

    def tick(self, now_us: int) -> None:
        """Send when due."""
        self._now_us = now_us
        if self._next_us is not None and now_us >= self._next_us:
            self._next_us += 1000 * self._od.number(0x1017)
            self._send()


class HeartbeatConsumer:
    """Watch the heartbeats of the nodes in 1016.

    Args:
        od: holds 1016.
        emcy: takes an error code and whether the error comes or goes.
        lost: called when a heartbeat is missing.
    """

    def __init__(self, od: Dictionary, emcy: Callable[[int, bool], None], lost: Callable[[], None]) -> None:
        self._od, self._emcy, self._lost = od, emcy, lost
        self._watched: dict[int, _Watched] = {}
        for sub in range(1, CONSUMERS + 1):
            od.checks[0x1016, sub] = partial(self._check, sub)
            od.actions[0x1016, sub] = lambda _value: self.reload()
        self.reload()

    def reload(self) -> None:
        """Take over 1016; monitoring begins again with the next heartbeat."""
        for old in self._watched.values():
            if old.lost:
                self._emcy(HEARTBEAT_LOST, False)
        self._watched = {}
        for sub in range(1, CONSUMERS + 1):
            node, period = _split(self._od.number(0x1016, sub))
            if node and period:
                self._watched[node] = _Watched(node, 1000 * period)

    def receive(self, node: int, now_us: int) -> None:
        """Take a heartbeat of any node."""
        watched = self._watched.get(node)
        if watched is None:
            return
        watched.deadline_us = now_us + watched.period_us
        if watched.lost:
            watched.lost = False
            self._emcy(HEARTBEAT_LOST, False)

    def tick(self, now_us: int) -> None:
        """Report a missing heartbeat, once until the node is heard again."""
        for watched in self._watched.values():
            if watched.deadline_us is not None and now_us >= watched.deadline_us:
                watched.deadline_us = None
                watched.lost = True
                self._emcy(HEARTBEAT_LOST, True)
                self._lost()

    def _check(self, sub: int, value: int) -> None:
        # CiA 301: an attempt to configure several heartbeat times for one node id is refused (abort 0604 0043).
        node, period = _split(value)
        others = (self._od.number(0x1016, other) for other in range(1, CONSUMERS + 1) if other != sub)
        if node > 127:
            raise SdoAbort(Abort.VALUE)
        if node and period and any(_split(o)[0] == node and _split(o)[1] for o in others):
            raise SdoAbort(Abort.INCOMPATIBLE)


def _split(value: int) -> tuple[int, int]:
    """Node id and milliseconds of an entry of 1016: bits 16 to 23 and 0 to 15."""
    return value >> 16 & 0xFF, value & 0xFFFF
