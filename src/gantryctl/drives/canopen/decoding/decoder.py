"""Decoder of a bus, frame after frame: it learns the mapping of the telegrams from the transfers that set it up."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from contextlib import suppress
from enum import StrEnum
from typing import Final, NamedTuple

from gantryctl.drives.canopen.bus.node import NMT, SYNC, NmtCommand, NmtState
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.decoding.objects import ObjectValue, object_value
from gantryctl.drives.canopen.emergency import emergency_text
from gantryctl.drives.canopen.settings import CanopenSettings
from gantryctl.drives.od.standard import standard_of
from gantryctl.trace.frames.ring import BusFrame

# Pre-defined connection set of CiA 301, each plus the node id.
_EMCY: Final = 0x080
_TIME: Final = 0x100
_TPDOS: Final = (0x180, 0x280, 0x380, 0x480)
_RPDOS: Final = (0x200, 0x300, 0x400, 0x500)
_RESPONSE: Final = 0x580
_REQUEST: Final = 0x600
_HEARTBEAT: Final = 0x700
_NODE: Final = 0x7F
_FUNCTION: Final = 0x780
# Communication objects of the telegrams; their mapping lies 200h above.
_RPDO_OBJECTS: Final = 0x1400
_TPDO_OBJECTS: Final = 0x1800
_PDOS: Final = 0x200
_INVALID: Final = 0x8000_0000
_IDENTIFIER: Final = 0x7FF
_MOST_ENTRIES: Final = 8
# Command specifiers of SDO, the upper three bits of the first byte (CiA 301).
_SEGMENT_DOWN, _DOWNLOAD, _UPLOAD, _SEGMENT_UP, _ABORT = range(5)
_ABORTED: Final = 0x80


class Kind(StrEnum):
    """What a frame is."""

    NMT = "nmt"
    SYNC = "sync"
    EMCY = "emcy"
    TPDO = "tpdo"
    RPDO = "rpdo"
    SDO = "sdo"
    HEARTBEAT = "heartbeat"
    OTHER = "other"


class DecodedFrame(NamedTuple):
    """Frame in words.

    Attributes:
        node: that sends or is meant; None for a frame to all, or of nobody.
        text: of what is no object.
        objects: in a telegram or a transfer.
    """

    frame: BusFrame
    kind: Kind
    node: int | None
    text: str
    objects: tuple[ObjectValue, ...] = ()

    def __str__(self) -> str:
        objects = "; ".join(map(str, self.objects))
        return ": ".join(part for part in (self.text, objects) if part)


class _Telegram(NamedTuple):
    """Telegram in force, with index, sub-index and bits of its objects."""

    kind: Kind
    number: int
    node: int
    entries: tuple[tuple[int, int, int], ...]


class FrameDecoder:
    """Decodes the frames of one bus in the order in which they came.

    Args:
        settings: of the machine file: units that the bus has not told, names of inputs.
        described: objects of the nodes by an EDS or DCF, in force until the bus tells others.
    """

    def __init__(
        self,
        settings: CanopenSettings | None = None,
        described: Mapping[tuple[int, int], int] | None = None,
    ) -> None:
        self._settings = settings
        self._objects: dict[int, dict[tuple[int, int], int]] = defaultdict(lambda: dict(described or {}))
        self._telegrams: dict[int, _Telegram] = {}

    def decode(self, frame: BusFrame) -> DecodedFrame:
        """Decode one frame, and learn from it."""
        can_id, data = frame.can_id, frame.data
        if can_id == NMT:
            return self._nmt(frame)
        if can_id == SYNC:
            return DecodedFrame(frame, Kind.SYNC, None, "")
        function, node = can_id & _FUNCTION, can_id & _NODE
        if function in (_REQUEST, _RESPONSE) and node:
            return self._sdo(frame, node, request=function == _REQUEST)
        telegram = self._telegrams.get(can_id) or self._default(function, node)
        if telegram is not None:
            return self._pdo(frame, telegram)
        if function == _HEARTBEAT and node:
            with suppress(ValueError, IndexError):
                state = NmtState(data[0] & 0x7F).name.lower().replace("_", "-")
                return DecodedFrame(frame, Kind.HEARTBEAT, node, state)
            return DecodedFrame(frame, Kind.HEARTBEAT, node, "no known state")
        if function == _EMCY and node:
            told = emergency_text(int.from_bytes(data[:2], "little")) if len(data) >= 2 else "too short"
            return DecodedFrame(frame, Kind.EMCY, node, told)
        return DecodedFrame(frame, Kind.OTHER, None, "TIME" if can_id == _TIME else "")

    def _nmt(self, frame: BusFrame) -> DecodedFrame:
        if len(frame.data) != 2:
            return DecodedFrame(frame, Kind.NMT, None, "of a wrong length")
        command, node = frame.data
        with suppress(ValueError):
            name = NmtCommand(command).name.lower().replace("_", " ")
            return DecodedFrame(
                frame, Kind.NMT, node or None, f"{name}, {f'node {node}' if node else 'all nodes'}"
            )
        return DecodedFrame(frame, Kind.NMT, node or None, f"unknown command {command:02X}h")

    # --- process data ----------------------------------------------------------------------------------------------

    def _default(self, function: int, node: int) -> _Telegram | None:
        """Telegram of the pre-defined connection set: a log that begins later does not tell its objects."""
        for kind, identifiers in ((Kind.TPDO, _TPDOS), (Kind.RPDO, _RPDOS)):
            if node and function in identifiers:
                number = identifiers.index(function) + 1
                return _Telegram(kind, number, node, self._entries(node, kind, number - 1))
        return None

    def _entries(self, node: int, kind: Kind, number: int) -> tuple[tuple[int, int, int], ...]:
        known = self._objects[node]
        mapping = (_TPDO_OBJECTS if kind is Kind.TPDO else _RPDO_OBJECTS) + _PDOS + number
        count = min(known.get((mapping, 0), 0), _MOST_ENTRIES)
        entries = (known.get((mapping, sub), 0) for sub in range(1, count + 1))
        return tuple((entry >> 16, entry >> 8 & 0xFF, entry & 0xFF) for entry in entries)

    def _pdo(self, frame: BusFrame, telegram: _Telegram) -> DecodedFrame:
        kind, number, node, entries = telegram
        known, objects, at, data = self._objects[node], [], 0, frame.data
        for index, sub, bits in entries:
            part = data[at // 8 : (at + bits) // 8]
            at += bits
            if bits % 8 or len(part) * 8 != bits:
                break
            # Entries below 0020h are data types: room that is left empty.
            if index >= 0x1000:
                objects.append(object_value(index, sub, part, known, self._settings))
        size = sum(bits for _, _, bits in entries) // 8
        text = f"{kind.upper()} {number}"
        if not entries:
            text += ", its objects are not known"
        elif len(data) != size:
            text += f", {len(data)} bytes of {size}"
        return DecodedFrame(frame, kind, node, text, tuple(objects))

    # --- transfers -------------------------------------------------------------------------------------------------

    def _sdo(self, frame: BusFrame, node: int, *, request: bool) -> DecodedFrame:
        data = frame.data
        if len(data) != 8:
            return DecodedFrame(frame, Kind.SDO, node, "of a wrong length")
        specifier, index, sub = data[0] >> 5, data[1] | data[2] << 8, data[3]
        place = f"{index:04X}:{sub:02X}"
        standard = standard_of(index, sub)
        name = place if standard is None else f"{place} {standard.name}"
        if data[0] == _ABORTED:
            refused = SdoError(index, sub, int.from_bytes(data[4:], "little"))
            return DecodedFrame(frame, Kind.SDO, node, f"refused: {refused}")
        if specifier == _UPLOAD and request:
            return DecodedFrame(frame, Kind.SDO, node, f"read: {name}")
        if specifier == _SEGMENT_UP and not request:
            return DecodedFrame(frame, Kind.SDO, node, f"written: {name}")
        # Bit 1: the value is in this frame; bit 0: with its size, in bytes that are not used (bits 2 and 3).
        if specifier in (_DOWNLOAD, _UPLOAD) and request is (specifier == _DOWNLOAD):
            verb = "write" if request else "answer"
            if not data[0] & 2:
                return DecodedFrame(frame, Kind.SDO, node, f"{verb}: {name}, in segments")
            part = data[4 : 8 - (data[0] >> 2 & 3)] if data[0] & 1 else data[4:]
            self._learn(node, index, sub, part)
            found = object_value(index, sub, part, self._objects[node], self._settings)
            return DecodedFrame(frame, Kind.SDO, node, verb, (found,))
        what = "a segment" if specifier in (_SEGMENT_DOWN, _DOWNLOAD, _SEGMENT_UP) else "a block"
        return DecodedFrame(frame, Kind.SDO, node, f"{what} of a transfer")

    def _learn(self, node: int, index: int, sub: int, data: bytes) -> None:
        """Keep what a node is told, or tells: telegrams and units follow from it."""
        self._objects[node][index, sub] = int.from_bytes(data, "little")
        for kind, first in ((Kind.RPDO, _RPDO_OBJECTS), (Kind.TPDO, _TPDO_OBJECTS)):
            if first <= index < first + 2 * _PDOS:
                self._remap(node, kind, (index - first) % _PDOS)

    def _remap(self, node: int, kind: Kind, number: int) -> None:
        first = _TPDO_OBJECTS if kind is Kind.TPDO else _RPDO_OBJECTS
        cob_id = self._objects[node].get((first + number, 1), _INVALID)
        for can_id, telegram in list(self._telegrams.items()):
            if telegram[:3] == (kind, number + 1, node):
                del self._telegrams[can_id]
        if not cob_id & _INVALID:
            entries = self._entries(node, kind, number)
            self._telegrams[cob_id & _IDENTIFIER] = _Telegram(kind, number + 1, node, entries)
