"""Virtual node with digital inputs and outputs by CiA 401, wired to the axis of a virtual drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from gantryctl.drives.od.model import Access, Entry, ObjectKind, ObjectSpec
from gantryctl.drives.od.types import DataType
from gantryctl.drives.virtual.axis.cabinet import Cabinet
from gantryctl.drives.virtual.communication.identifiers import Send
from gantryctl.drives.virtual.nodes.slave import Slave

# Device profile 401 with digital inputs and outputs: bits 16 and 17 of 1000h (CiA 401).
_PROFILE: Final = 0x0003_0191
_PRODUCT: Final = 0x0047_0401
BYTES: Final = 4
_RW, _RO = Access.RW, Access.RO


def _bytes_of(index: int, name: str, access: Access, default: int = 0, *, maps: bool = False) -> ObjectSpec:
    """Array with one entry for each group of eight inputs or outputs."""
    u8 = DataType.UNSIGNED8
    entries = {0: Entry(index, 0, "Number of groups", u8, Access.CONST, BYTES)}
    entries |= {
        n: Entry(
            index, n, f"{name} {8 * n - 7} to {8 * n}", u8, access, default, mappable=maps, volatile=maps
        )
        for n in range(1, BYTES + 1)
    }
    return ObjectSpec(index, name, ObjectKind.ARRAY, entries)


class IoNode:
    """Node with four bytes of inputs and four of outputs.

    The outputs follow 6200h in OPERATIONAL. When the heartbeat of the controller (1016) is missing, or NMT stops the
    node, each shows what 6206h and 6207h say: kept, or the error value; so it stays until it is OPERATIONAL again.

    Args:
        node_id: 1..127.
        send: takes its frames.
        cabinet: what its outputs work.
        wires: present levels of what is wired to its inputs, by name.
        inputs, outputs: bit of each name, 0 for the first.
        stepped: time goes on by SYNC only.

    Attributes:
        slave: its CANopen side.
        inputs_stuck: 6000h keeps its value.
        outputs_dead: 6200h is taken and has no effect.
        error_values_ignored: 6206h and 6207h are taken and have no effect.
    """

    def __init__(
        self,
        node_id: int,
        send: Send,
        cabinet: Cabinet,
        wires: Callable[[], Mapping[str, bool]],
        inputs: Mapping[str, int],
        outputs: Mapping[str, int],
        *,
        stepped: bool = False,
    ) -> None:
        self._cabinet, self._wires = cabinet, wires
        self._inputs, self._outputs = dict(inputs), dict(outputs)
        self.inputs_stuck = self.outputs_dead = self.error_values_ignored = False
        self._shown = self._word = 0
        objects = (
            _bytes_of(0x6000, "Read inputs", _RO, maps=True),
            _bytes_of(0x6002, "Polarity of inputs", _RW),
            _bytes_of(0x6200, "Write outputs", Access.RWW, maps=True),
            _bytes_of(0x6202, "Polarity of outputs", _RW),
            _bytes_of(0x6206, "Error mode of outputs", _RW, 0xFF),
            _bytes_of(0x6207, "Error value of outputs", _RW),
        )
        name = "gantryctl virtual I/O node"
        self.slave = Slave(_PROFILE, name, _PRODUCT, objects, node_id, send, self._failed, stepped=stepped)
        for n in range(1, BYTES + 1):
            self.slave.od.readers[0x6000, n] = partial(self._group, n)
            self.slave.od.actions[0x6200, n] = lambda _value: self._commanded()

    def boot(self) -> None:
        """Power on."""
        self._word = 0
        self.slave.boot()

    def _group(self, n: int) -> int:
        """Inputs of one group, 6000h:n."""
        return self._sampled() >> 8 * (n - 1) & 0xFF

    def _sampled(self) -> int:
        """6000h, all bytes; the first input is bit 0."""
        if not self.inputs_stuck:
            wires = self._wires()
            word = sum(1 << bit for name, bit in self._inputs.items() if wires[name])
            self._shown = word ^ self._bytes(0x6002)
        return self._shown

    def _bytes(self, index: int) -> int:
        return sum(self.slave.od.number(index, n) << 8 * (n - 1) for n in range(1, BYTES + 1))

    def _commanded(self) -> None:
        self._word = self._bytes(0x6200)
        self._show(self._word)

    def _failed(self) -> None:
        if self.error_values_ignored:
            return
        mode, value = self._bytes(0x6206), self._bytes(0x6207)
        self._word = (self._word & ~mode) | (value & mode)
        self._show(self._word)

    def _show(self, word: int) -> None:
        if not self.outputs_dead:
            word ^= self._bytes(0x6202)
            self._cabinet.take({name: bool(word >> bit & 1) for name, bit in self._outputs.items()})
