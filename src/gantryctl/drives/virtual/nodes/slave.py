"""CANopen side of a virtual node that is no drive: its dictionary, its time, its protocol stack, and their faults."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from gantryctl.drives.faults import FrameFault
from gantryctl.drives.od.model import DeviceInfo, ObjectSpec, described
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.identifiers import Send
from gantryctl.drives.virtual.communication.objects import VENDOR_ID, communication_objects, pdo_objects
from gantryctl.drives.virtual.communication.stack import ProtocolStack
from gantryctl.drives.virtual.personality import Personality

_TICK_US: Final = 1000
# The default mapping of CiA 402, which such a node has not.
_DRIVE_OBJECTS: Final = (0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x6077, 0x60B2, 0x60FF)


class Slave:
    """Node on a bus: frames in, frames out, time as an argument.

    Args:
        profile: device profile and type, 1000h.
        name, product: 1008h and 1018:02.
        objects: of its device profile.
        node_id: 1..127.
        send: takes identifier and data of every frame.
        failed: called when the heartbeat of the controller or a telegram of it is missing, or NMT stops the node.
        stepped: time goes on by SYNC only, one SYNC period (1006) each.

    Attributes:
        od: the object dictionary.
        silent: off the bus: nothing is sent, nothing is heard; its own time goes on.
        heartbeat_deaf: 1016 is taken and has no effect.
        mapping_ignored: writes to 1A00 and 1600 are acknowledged and not kept.
        tpdo: what happens to its telegrams, by the number of the TPDO.
    """

    def __init__(
        self,
        profile: int,
        name: str,
        product: int,
        objects: tuple[ObjectSpec, ...],
        node_id: int,
        send: Send,
        failed: Callable[[], None],
        *,
        stepped: bool,
    ) -> None:
        self.node_id, self.stepped = node_id, stepped
        self.time_us = self._owed_us = 0
        self.silent = self.heartbeat_deaf = self.mapping_ignored = False
        self._out, self._failed = send, failed
        self._synced = False
        kind = Personality(device_type=profile, absent=_DRIVE_OBJECTS, block_transfer=False)
        plate: dict[tuple[int, int], int | str] = {(0x1008, 0): name, (0x1018, 2): product}
        common = (_named(spec, plate) for spec in communication_objects(kind, node_id))
        info = DeviceInfo(vendor_name="gantryctl", vendor_number=VENDOR_ID, product_name=name)
        device = described((*common, *pdo_objects(kind), *objects), info)
        self.od = od = Dictionary(device, device, node_id)
        self.tpdo: dict[int, FrameFault] = {}
        self.stack = ProtocolStack(od, node_id, kind, self, self.tpdo)

    # --- time ----------------------------------------------------------------------------------------------------

    def boot(self) -> None:
        """Power on: send the boot-up message, enter PRE-OPERATIONAL."""
        self.stack.begin_reset()
        self.od.reset({}, communication_only=False)
        self.stack.take_over()
        self._failed()
        self.stack.boot_up()

    def reset(self, communication_only: bool) -> None:
        """Reset node or communication: the same, for such a node keeps nothing."""
        self.boot()

    def advance(self, us: int) -> None:
        """Advance the node's own time in whole milliseconds; the remainder is kept."""
        self._owed_us += us
        while self._owed_us >= _TICK_US:
            self._owed_us -= _TICK_US
            self.time_us += _TICK_US
            self.stack.tick(self.time_us, hears_heartbeat=not self.heartbeat_deaf)

    # --- frames --------------------------------------------------------------------------------------------------

    def on_frame(self, can_id: int, data: bytes) -> None:
        """Take one data frame with an 11-bit identifier."""
        if self.stepped and can_id == self.stack.process_data.sync_id:
            if self._synced:
                self.advance(self.od.number(0x1006))
            self._synced = True
        if not self.silent:
            self.stack.receive(can_id, data)

    def answer_sdo(self, request: bytes) -> None:
        """Answer an SDO request."""
        kept = None
        if self.mapping_ignored and len(request) == 8 and request[0] >> 5 == 1 and request[2] in (0x16, 0x1A):
            kept = (request[1] | request[2] << 8, request[3])
        before = None if kept is None else self.od.number(*kept)
        answers = self.stack.sdo.answer(request)
        if kept is not None and before is not None:
            self.od.set(*kept, before)
        self.stack.respond(answers)

    def send(self, can_id: int, data: bytes) -> None:
        """Send one frame unless the node is off the bus."""
        if not self.silent:
            self._out(can_id, data)

    def send_heartbeat(self) -> None:
        """Send the heartbeat of this moment."""
        self.stack.send_heartbeat()

    def communication_lost(self, _code: int) -> None:
        """Let the outputs show their error values."""
        self._failed()


def _named(spec: ObjectSpec, plate: dict[tuple[int, int], int | str]) -> ObjectSpec:
    entries = {
        sub: replace(entry, default=plate.get((spec.index, sub), entry.default))
        for sub, entry in spec.entries.items()
    }
    return replace(spec, entries=entries)
