"""Stop of a drive that takes no process data any more: controlword and brake by SDO, or NMT start where it takes none.

| NMT state of the drive | process data | SDO | what stops it                           |
|------------------------|--------------|-----|-----------------------------------------|
| PRE-OPERATIONAL        | no           | yes | controlword and brake by SDO            |
| STOPPED                | no           | no  | NMT start, then the controlword by RPDO |
| not known              | ?            | ?   | SDO; NMT start when nothing answers     |
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from gantryctl.drives.canopen.bus.node import NmtCommand, NmtState, RemoteNode
from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.cia402 import DISABLE_VOLTAGE, ENERGISED, QUICK_STOP, decode_statusword
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.image import DriveState

# A drive answers an SDO request within some milliseconds; the next try comes after this.
_RETRY_S: Final = 0.02
# By then the drive's own watch has ended what was not heard.
_LONGEST_S: Final = 3.0
_CONTROLWORD: Final = (0x6040, 0, 2)
_BRAKE: Final = (0x60FE, 1, 4)
_STOPS: Final = (DISABLE_VOLTAGE, QUICK_STOP)


class StopBySdo:
    """Take torque and brake from a drive that another master has put out of operation, without waiting for anything.

    Only words that stop are sent this way: nothing enables a drive by SDO.

    Args:
        node: takes NMT commands.
        requests: SDO to it.
        settings: who works the brake, scan period.
        take_speed: takes a 606C and the scan in which it was asked for, on the ramp of a quick stop; None for a drive
            without one.
    """

    # The drive's own watch of the controller stops it too, later: 4.26 deg from 6 deg/s, measured.

    def __init__(
        self,
        node: RemoteNode,
        requests: SdoRequests,
        settings: CanopenSettings,
        take_speed: Callable[[int, int], None] | None = None,
    ) -> None:
        self._node, self._requests, self._take_speed = node, requests, take_speed
        self._longest = round(_LONGEST_S / settings.period_s)
        self._retry = max(1, round(_RETRY_S / settings.period_s))
        self._brake_by_60fe = settings.brake_by_60fe
        self._asked = self._since = 0
        self._done: dict[tuple[int, int, int], int] = {}
        self._started = self._refuses_speed = self._reads_speed = False
        self._speed_scan: int | None = None
        self.state = DriveState.UNKNOWN
        """State without torque that the drive has shown by SDO; UNKNOWN until it has."""

    def forget(self) -> None:
        """The drive takes process data: the next stop begins anew."""
        if self._since:
            self._asked = self._since = 0
            self._done.clear()
            self._started = self._refuses_speed = self._reads_speed = False
            self._speed_scan = None
            self.state = DriveState.UNKNOWN

    def scan(self, word: int, brake_word: int, periods: int) -> None:
        """Send what is due.

        Args:
            word: controlword in force.
            brake_word: 60FE in force.
            periods: since the scan before.
        """
        if word not in _STOPS or self._since > self._longest:
            return
        self._since += periods
        silent = not self._done and self._since > self._retry
        # A drive that has booted has lost its mapping: it is not started.
        if (silent or self._node.state == NmtState.STOPPED) and not (self._started or self._node.boots):
            # Once: a master that keeps stopping the drive is not fought, the drive's own watch ends it.
            self._started = True
            self._node.nmt(NmtCommand.START)
        waits = self._requests.waiting and self._since - self._asked < self._retry
        # A word that stops waits for no speed.
        if waits and not self._reads_speed:
            return
        wanted = {_CONTROLWORD: word} | ({_BRAKE: brake_word} if self._brake_by_60fe else {})
        for place, value in wanted.items():
            if self._done.get(place) != value:
                self._asked, self._reads_speed = self._since, False
                index, sub, size = place
                data = value.to_bytes(size, "little")
                self._requests.write(index, sub, data, partial(self._written, place, value))
                return
        if waits:
            return
        asks_speed = word == QUICK_STOP and self._take_speed is not None and not self._refuses_speed
        if asks_speed:
            # What comes may answer the first request that has no answer yet: its age counts.
            self._speed_scan = self._node.scan if self._speed_scan is None else self._speed_scan
            self._asked, self._reads_speed = self._since, True
            self._requests.read(0x606C, 0, self._speed)
        elif self.state is DriveState.UNKNOWN and self._since - self._asked >= self._retry:
            self._asked = self._since
            self._requests.read(0x6041, 0, self._seen)

    def _written(self, place: tuple[int, int, int], value: int, answer: bytes | None) -> None:
        # A refusal too is an answer: the same request again would get the same one.
        self._done[place] = value
        self._asked = self._since - self._retry

    def _seen(self, answer: bytes | None) -> None:
        if answer is not None:
            state = decode_statusword(int.from_bytes(answer, "little"))
            self.state = DriveState.UNKNOWN if state in ENERGISED else state

    def _speed(self, answer: bytes | None) -> None:
        scan, self._speed_scan = self._speed_scan, None
        self._reads_speed, self._refuses_speed = False, answer is None
        if answer is not None and scan is not None and self._take_speed is not None:
            self._take_speed(int.from_bytes(answer, "little", signed=True), scan)
