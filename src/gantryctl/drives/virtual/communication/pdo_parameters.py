"""Parameters of a PDO in the object dictionary, and the rules by which they may be written (CiA 301)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from gantryctl.drives.od.model import Entry
from gantryctl.drives.od.types import bit_length
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.objects import MAPPED, PDO_INVALID

EXTENDED_BIT: Final = 0x2000_0000
ID_MASK: Final = 0x7FF
_MAX_BITS: Final = 64
# Restricted identifiers (CiA 301): NMT, the default of SYNC, SDO, NMT error control. No PDO may take them.
_RESTRICTED: Final = (
    range(0x000, 0x081),
    range(0x101, 0x181),
    range(0x581, 0x600),
    range(0x601, 0x680),
    range(0x6E0, 0x800),
)


@dataclass(frozen=True, slots=True)
class Mapped:
    """Mapped entry and its bytes."""

    entry: Entry
    size: int


class PdoParameters:
    """Communication and mapping parameter of one PDO.

    A mapping is changed as CiA 301 says and not otherwise: PDO invalid (bit 31 of sub-index 1), count 0, entries,
    count n, PDO valid.

    Args:
        od: the dictionary; takes the rules as checks.
        number: 0 for the first PDO.
        transmit: TPDO or RPDO.
    """

    def __init__(self, od: Dictionary, number: int, transmit: bool) -> None:
        self._od, self._transmit = od, transmit
        self.communication = (0x1800 if transmit else 0x1400) + number
        self._mapping = (0x1A00 if transmit else 0x1600) + number
        od.checks[self.communication, 1] = self._check_cob_id
        od.checks[self.communication, 2] = self._check_type
        if transmit:
            od.checks[self.communication, 3] = self._check_inhibit
        od.checks[self._mapping, 0] = self._check_count
        for sub in range(1, MAPPED + 1):
            od.checks[self._mapping, sub] = self._check_entry

    @property
    def valid(self) -> bool:
        """The PDO exists: bit 31 of its COB-ID is 0."""
        return not self._od.number(self.communication, 1) & PDO_INVALID

    @property
    def can_id(self) -> int:
        """Identifier of its frames."""
        return self._od.number(self.communication, 1) & ID_MASK

    @property
    def type(self) -> int:
        """Transmission type."""
        return self._od.number(self.communication, 2)

    @property
    def event_us(self) -> int:
        """Event timer: period of a TPDO, deadline of an RPDO."""
        return 1000 * self._od.number(self.communication, 5)

    def mapped(self) -> tuple[Mapped, ...]:
        """Mapped entries; none where stored values do not fit, as after a change of personality."""
        try:
            return self._resolved(self._od.number(self._mapping, 0))
        except SdoAbort:
            return ()

    def _resolved(self, count: int) -> tuple[Mapped, ...]:
        found = tuple(self._object(self._od.number(self._mapping, sub)) for sub in range(1, count + 1))
        if 8 * sum(mapped.size for mapped in found) > _MAX_BITS:
            raise SdoAbort(Abort.PDO_LENGTH)
        return found

    def _object(self, value: int) -> Mapped:
        index, sub, bits = value >> 16, value >> 8 & 0xFF, value & 0xFF
        entry = self._od.entry(index, sub)
        if not (entry.tpdo if self._transmit else entry.rpdo):
            raise SdoAbort(Abort.NOT_MAPPABLE)
        if bits != bit_length(entry.data_type):
            raise SdoAbort(Abort.SIZE)
        return Mapped(entry, bits // 8)

    def _check_cob_id(self, value: int) -> None:
        if value & EXTENDED_BIT:
            raise SdoAbort(Abort.VALUE)
        if value & PDO_INVALID:
            return
        can_id = value & ID_MASK
        if self.valid and can_id != self.can_id:
            raise SdoAbort(Abort.VALUE)
        if any(can_id in ids for ids in _RESTRICTED):
            raise SdoAbort(Abort.VALUE)

    def _check_type(self, value: int) -> None:
        # 241 to 251 are reserved, 252 and 253 need remote frames.
        if 241 <= value <= 253:
            raise SdoAbort(Abort.VALUE)

    def _check_inhibit(self, value: int) -> None:
        if self.valid:
            raise SdoAbort(Abort.STATE)

    def _check_count(self, count: int) -> None:
        if self.valid:
            raise SdoAbort(Abort.STATE)
        if count > MAPPED:
            raise SdoAbort(Abort.PDO_LENGTH)
        self._resolved(count)

    def _check_entry(self, value: int) -> None:
        if self.valid or self._od.number(self._mapping, 0):
            raise SdoAbort(Abort.STATE)
        if value:
            self._object(value)
