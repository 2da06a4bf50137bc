"""Virtual encoder on the ring as a node of its own, by CiA 406."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from gantryctl.drives.od.model import Access
from gantryctl.drives.od.types import DataType
from gantryctl.drives.virtual.communication.identifiers import Send
from gantryctl.drives.virtual.communication.objects import var
from gantryctl.drives.virtual.nodes.slave import Slave

# Device profile 406, type 1: absolute rotary encoder, single turn.
_PROFILE: Final = 0x0001_0196
_PRODUCT: Final = 0x0047_0406
_POSITION_ERROR: Final = 0x0001


class EncoderNode:
    """Absolute encoder on the ring, one turn of it.

    Args:
        node_id: 1..127.
        send: takes its frames.
        reading: count that the encoder shows, within one turn.
        counts: steps of a turn.
        stepped: time goes on by SYNC only.

    Attributes:
        slave: its CANopen side.
        frozen: 6004h keeps its value.
        jump: added to 6004h, steps.
        alarm: 6503h shows a position error.
    """

    def __init__(
        self,
        node_id: int,
        send: Send,
        reading: Callable[[], int],
        counts: int,
        *,
        stepped: bool = False,
    ) -> None:
        self._reading, self._counts = reading, counts
        self.frozen = self.alarm = False
        self.jump = 0
        self._shown = 0
        u16, u32 = DataType.UNSIGNED16, DataType.UNSIGNED32
        objects = (
            var(0x6004, "Position value", u32, Access.RO, maps=True, volatile=True),
            var(0x6501, "Measuring units per revolution", u32, Access.RO, counts),
            var(0x6502, "Revolutions told apart", u16, Access.RO, 1),
            var(0x6503, "Alarms", u16, Access.RO, maps=True, volatile=True),
        )
        name = "gantryctl virtual ring encoder"
        self.slave = Slave(_PROFILE, name, _PRODUCT, objects, node_id, send, lambda: None, stepped=stepped)
        readers = self.slave.od.readers
        readers[0x6004, 0] = self._position
        readers[0x6503, 0] = lambda: _POSITION_ERROR if self.alarm else 0

    def boot(self) -> None:
        """Power on."""
        self.slave.boot()

    def _position(self) -> int:
        """6004h."""
        if not self.frozen:
            self._shown = self._reading()
        return (self._shown + self.jump) % self._counts
