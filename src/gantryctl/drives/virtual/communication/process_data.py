"""All PDOs of the node and SYNC."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.objects import MAPPED, PDOS
from gantryctl.drives.virtual.communication.pdo import Rpdo, Tpdo

_PRODUCE: Final = 0x4000_0000
_EXTENDED: Final = 0x2000_0000
_ID: Final = 0x7FF
_COMMUNICATION_SUBS: Final = (1, 2, 3, 5)


class ProcessData:
    """RPDOs, TPDOs and the SYNC that moves them.

    Args:
        od: parameters and values.
        send: takes (number of the TPDO, identifier, data).
        emcy: reports (code, whether it comes or goes).
        lost: called when an RPDO misses its deadline.
        now: the drive's own time, us.
    """

    def __init__(
        self,
        od: Dictionary,
        send: Callable[[int, int, bytes], None],
        emcy: Callable[[int, bool], None],
        lost: Callable[[], None],
        now: Callable[[], int],
    ) -> None:
        self._od = od
        self._now = now
        self.rpdos = tuple(Rpdo(od, number, emcy, lost) for number in range(PDOS))
        self.tpdos = tuple(Tpdo(od, number, send) for number in range(PDOS))
        self._by_id: dict[int, Rpdo] = {}
        self._timed: tuple[Rpdo, ...] = ()
        self._events: tuple[Tpdo, ...] = ()
        self.operational = False
        self._last_sync_us = 0
        od.checks[0x1005, 0] = _check_sync_id
        self._hook()
        self.reload()

    def _hook(self) -> None:
        """A change of one PDO's parameters takes effect on that PDO."""
        for number in range(PDOS):
            for index, pdo in (
                (0x1400 + number, self.rpdos[number]),
                (0x1600 + number, self.rpdos[number]),
                (0x1800 + number, self.tpdos[number]),
                (0x1A00 + number, self.tpdos[number]),
            ):
                subs = _COMMUNICATION_SUBS if index & 0x200 == 0 else range(MAPPED + 1)
                for sub in subs:
                    self._od.actions[index, sub] = self._reloader(pdo)

    def _reloader(self, pdo: Rpdo | Tpdo) -> Callable[[int], None]:
        def changed(_value: int) -> None:
            pdo.reload()
            self._route()

        return changed

    def reload(self) -> None:
        """Take over all parameters, after a reset."""
        for rpdo in self.rpdos:
            rpdo.reload()
        for tpdo in self.tpdos:
            tpdo.reload()
        self._route()

    def _route(self) -> None:
        self._by_id = {rpdo.can_id: rpdo for rpdo in self.rpdos if rpdo.can_id is not None}
        self._timed = tuple(rpdo for rpdo in self._by_id.values() if rpdo.parameters.event_us)
        self._events = tuple(t for t in self.tpdos if t.can_id is not None and not 0 < t.type <= 240)

    @property
    def sync_id(self) -> int:
        """Identifier of SYNC."""
        return self._od.number(0x1005) & _ID

    def set_operational(self, operational: bool) -> None:
        """PDOs live in OPERATIONAL only."""
        if operational and not self.operational:
            for tpdo in self.tpdos:
                tpdo.start(self._now())
        if not operational:
            for rpdo in self.rpdos:
                rpdo.stop()
        self.operational = operational

    def receive(self, can_id: int, data: bytes) -> bool:
        """A frame that may be an RPDO; True when it is one."""
        rpdo = self._by_id.get(can_id)
        if rpdo is None:
            return False
        if self.operational:
            window = self._od.number(0x1007)
            late = rpdo.synchronous and window and self._now() - self._last_sync_us > window
            if not late:
                rpdo.receive(data, self._now())
        return True

    def sync(self) -> None:
        """SYNC: TPDOs sample and go out, then what the RPDOs brought acts."""
        self._last_sync_us = self._now()
        if self.operational:
            for tpdo in self.tpdos:
                tpdo.sync()
            for rpdo in self.rpdos:
                rpdo.sync()

    def tick(self) -> None:
        """Deadlines and events; also called after every frame, for what it has changed."""
        if self.operational:
            now = self._now()
            for rpdo in self._timed:
                rpdo.tick(now)
            for tpdo in self._events:
                tpdo.tick(now)


def _check_sync_id(value: int) -> None:
    if value & (_PRODUCE | _EXTENDED) or not value & _ID:
        raise SdoAbort(Abort.VALUE)
