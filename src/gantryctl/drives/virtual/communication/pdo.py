"""Process data: RPDOs in, TPDOs out, at SYNC or by events (CiA 301)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.objects import MAPPED, PDOS
from gantryctl.drives.virtual.communication.pdo_parameters import EXTENDED_BIT, ID_MASK, PdoParameters

# Transmission types (CiA 301): 0 acyclic at SYNC, 1 to 240 every n-th SYNC, 254 and 255 event-driven.
_LAST_SYNC_TYPE: Final = 240
# Objects whose change is an event for the transmission types 0, 254 and 255 (CiA 301 leaves the events to the device
# profile); position, speed and torque change all the time and are no events.
_EVENTS: Final = frozenset({0x1001, 0x603F, 0x6041, 0x6061, 0x60FD})

# Error codes of CiA 301: PDO not processed due to length error; RPDO time-out.
LENGTH_ERROR: Final = 0x8210
DEADLINE: Final = 0x8250


class Rpdo:
    """Receive PDO.

    Args:
        od: takes the values.
        number: 0 for the first.
        emcy: takes an error code and whether the error comes or goes.
        lost: called when the deadline (event timer) passes.
    """

    def __init__(
        self, od: Dictionary, number: int, emcy: Callable[[int, bool], None], lost: Callable[[], None]
    ) -> None:
        self.parameters = PdoParameters(od, number, transmit=False)
        self._od, self._emcy, self._lost = od, emcy, lost
        self.received_us = 0
        """When the last whole frame came, in the drive's own time."""
        self._overdue = self._short = False
        self.reload()

    def reload(self) -> None:
        """Take over changed parameters."""
        p = self.parameters
        self.mapped = p.mapped()
        self.size = sum(mapped.size for mapped in self.mapped)
        self.can_id = p.can_id if p.valid else None
        self.synchronous = p.type <= _LAST_SYNC_TYPE
        self._event_us = p.event_us
        self.stop()

    def stop(self) -> None:
        """Discard the waiting data and the deadline: OPERATIONAL was left, or the PDO changed."""
        # An error that was reported stays in 1001 until a frame comes again (CiA 301).
        self._waiting: bytes | None = None
        self._deadline_us: int | None = None

    def receive(self, data: bytes, now_us: int) -> None:
        """Take one frame: refuse a short one whole (EMCY 8210), read a long one as far as it is mapped."""
        if len(data) < self.size:
            if not self._short:
                self._short = True
                self._emcy(LENGTH_ERROR, True)
            return
        if self._short:
            self._short = False
            self._emcy(LENGTH_ERROR, False)
        self.received_us = now_us
        if self._overdue:
            self._overdue = False
            self._emcy(DEADLINE, False)
        if self._event_us:
            self._deadline_us = now_us + self._event_us
        if self.synchronous:
            self._waiting = data
        else:
            self._apply(data)

    def sync(self) -> None:
        """Apply at SYNC what was received since the last one."""
        if self._waiting is not None:
            data, self._waiting = self._waiting, None
            self._apply(data)

    def tick(self, now_us: int) -> None:
        """Supervise the deadline, which runs from the first reception on."""
        if self._deadline_us is not None and now_us >= self._deadline_us:
            self._deadline_us = None
            self._overdue = True
            self._emcy(DEADLINE, True)
            self._lost()

    def _apply(self, data: bytes) -> None:
        at = 0
        for mapped in self.mapped:
            part = data[at : at + mapped.size]
            at += mapped.size
            try:
                self._od.receive(mapped.entry, part)
            # A process data object has no answer: a value that the drive refuses is left out.
            except SdoAbort:
                continue


class Tpdo:
    """Transmit PDO.

    Args:
        od: gives the values.
        number: 0 for the first.
        send: takes (number, identifier, data).
    """

    def __init__(self, od: Dictionary, number: int, send: Callable[[int, int, bytes], None]) -> None:
        self.parameters = PdoParameters(od, number, transmit=True)
        self._od, self._number, self._send = od, number, send
        self.reload()

    def reload(self) -> None:
        """Take over changed parameters."""
        p = self.parameters
        self.mapped = p.mapped()
        self.can_id = p.can_id if p.valid else None
        self.type = p.type
        # CiA 301: the inhibit time counts in units of 100 us.
        self._inhibit_us = 100 * self._od.number(p.communication, 3)
        self._event_us = p.event_us
        self._events = tuple(m.entry for m in self.mapped if m.entry.index in _EVENTS)
        self.start(0)

    def start(self, now_us: int) -> None:
        """Make event-driven transmission due once: OPERATIONAL was entered, or the PDO changed."""
        self._syncs = 0
        self._last: bytes | None = None
        self._changed = False
        self._next_us = now_us + self._event_us
        self._free_us = now_us

    def pack(self) -> bytes:
        """Present values of the mapped objects."""
        return b"".join([self._od.packed(mapped.entry) for mapped in self.mapped])

    def sync(self) -> None:
        """Count SYNC for the cyclic types 1 to 240; send type 0 when an event has happened."""
        if self.can_id is None or self.type > _LAST_SYNC_TYPE:
            return
        if self.type == 0:
            if self._changed or self._last is None:
                self._changed = False
                self._last = self._event_values()
                self._out()
            return
        self._syncs += 1
        if self._syncs >= self.type:
            self._syncs = 0
            self._out()

    def tick(self, now_us: int) -> None:
        """Send on an event or by the event timer, within the inhibit time."""
        if self.can_id is None or 0 < self.type <= _LAST_SYNC_TYPE:
            return
        values = self._event_values()
        if values != self._last and self._last is not None:
            self._changed = True
        if self.type == 0:
            return
        due = self._event_us and now_us >= self._next_us
        if (self._changed or self._last is None or due) and now_us >= self._free_us:
            self._changed = False
            self._last = values
            self._next_us = now_us + self._event_us
            self._free_us = now_us + self._inhibit_us
            self._out()
        elif self._changed:
            self._last = values

    def _event_values(self) -> bytes:
        return b"".join([self._od.packed(entry) for entry in self._events])

    def _out(self) -> None:
        if self.can_id is not None:
            self._send(self._number, self.can_id, self.pack())


# Bits of 1005 (CiA 301): 30 the device generates SYNC, 29 an identifier of 29 bits. This drive does neither.
_PRODUCE: Final = 0x4000_0000
_COMMUNICATION_SUBS: Final = (1, 2, 3, 5)


class ProcessData:
    """RPDOs, TPDOs and the SYNC that moves them.

    Args:
        od: parameters and values.
        send: takes (number of the TPDO, identifier, data).
        emcy: reports (code, whether it comes or goes).
        lost: called when an RPDO misses its deadline.
        now: the drive's own time, us.
        deadlines: False for a drive whose 1400:05 is without effect.
    """

    def __init__(
        self,
        od: Dictionary,
        send: Callable[[int, int, bytes], None],
        emcy: Callable[[int, bool], None],
        lost: Callable[[], None],
        now: Callable[[], int],
        *,
        deadlines: bool = True,
    ) -> None:
        self._od, self._now, self._deadlines = od, now, deadlines
        self.rpdos = tuple(Rpdo(od, number, emcy, lost) for number in range(PDOS))
        self.tpdos = tuple(Tpdo(od, number, send) for number in range(PDOS))
        self._pdos: tuple[Rpdo | Tpdo, ...] = (*self.rpdos, *self.tpdos)
        self.operational = False
        self._last_sync_us = 0
        self.sync_id = 0
        """Identifier of SYNC: every frame is compared with it."""
        od.checks[0x1005, 0] = _check_sync_id
        od.actions[0x1005, 0] = lambda _: self._take_sync_id()
        self._hook()
        self.reload()

    def _hook(self) -> None:
        """Let a change of one PDO's parameters take effect on that PDO."""
        for pdo in self._pdos:
            first = pdo.parameters.communication
            for index, subs in ((first, _COMMUNICATION_SUBS), (first + 0x200, range(MAPPED + 1))):
                for sub in subs:
                    self._od.actions[index, sub] = partial(self._changed, pdo)

    def _changed(self, pdo: Rpdo | Tpdo, _value: int) -> None:
        pdo.reload()
        self._route()

    def reload(self) -> None:
        """Take over all parameters, after a reset."""
        for pdo in self._pdos:
            pdo.reload()
        self._take_sync_id()
        self._route()

    def _take_sync_id(self) -> None:
        self.sync_id = self._od.number(0x1005) & ID_MASK

    def _route(self) -> None:
        self._by_id = {rpdo.can_id: rpdo for rpdo in self.rpdos if rpdo.can_id is not None}
        timed = (rpdo for rpdo in self._by_id.values() if rpdo.parameters.event_us)
        self._timed = tuple(timed) if self._deadlines else ()
        self._events = tuple(t for t in self.tpdos if t.can_id is not None and not 0 < t.type <= 240)

    @property
    def command_us(self) -> int:
        """When the last RPDO came: from then on the deadline of 1400:05 runs."""
        return max(rpdo.received_us for rpdo in self.rpdos)

    def set_operational(self, operational: bool) -> None:
        """Start or stop the PDOs, which exist in OPERATIONAL only."""
        if operational and not self.operational:
            for tpdo in self.tpdos:
                tpdo.start(self._now())
        if not operational:
            for rpdo in self.rpdos:
                rpdo.stop()
        self.operational = operational

    def receive(self, can_id: int, data: bytes) -> bool:
        """Take a frame; True if it is an RPDO."""
        rpdo = self._by_id.get(can_id)
        if rpdo is None:
            return False
        if self.operational:
            window = self._od.number(0x1007)
            # 1007: a synchronous RPDO that comes later than the window after SYNC is ignored (CiA 301).
            late = rpdo.synchronous and window and self._now() - self._last_sync_us > window
            if not late:
                rpdo.receive(data, self._now())
        return True

    def sync(self) -> None:
        """Sample and send the TPDOs, then apply the RPDOs received before this SYNC."""
        self._last_sync_us = self._now()
        if self.operational:
            for tpdo in self.tpdos:
                tpdo.sync()
            for rpdo in self.rpdos:
                rpdo.sync()

    def tick(self) -> None:
        """Check deadlines and events, every tick and after every frame."""
        if self.operational:
            now = self._now()
            for rpdo in self._timed:
                rpdo.tick(now)
            for tpdo in self._events:
                tpdo.tick(now)


def _check_sync_id(value: int) -> None:
    if value & (_PRODUCE | EXTENDED_BIT) or not value & ID_MASK:
        raise SdoAbort(Abort.VALUE)
