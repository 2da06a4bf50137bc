"""A bus whose frames are written by hand; its time goes on only while nothing is there."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

from gantryctl.drives.canopen.bus.link import Frame
from gantryctl.drives.canopen.bus.node import RemoteNode
from gantryctl.image import LinkFlag

NODE, MASTER = 2, 127


class Wire:
    """Stands for `BusLink`.

    Attributes:
        coming: frames that the next calls of `receive` give.
        sent: frames of the master, as (identifier, data in hexadecimal).
        answers: by a request on the bus, the frames that follow it.
    """

    stepped, down, trouble = True, False, LinkFlag.NONE
    unseen = queue_full = 0

    def __init__(self) -> None:
        self.coming: list[Frame] = []
        self.sent: list[tuple[int, str]] = []
        self.answers: dict[str, list[str]] = {}
        self.time_s = 0.0
        self.traffic = SimpleNamespace(bits=0, filtered=0)

    def comes(self, can_id: int, *data: str) -> None:
        self.coming += [Frame(can_id, bytes.fromhex(each)) for each in data]

    def send(self, can_id: int, data: bytes) -> bool:
        self.sent.append((can_id, data.hex(" ").upper()))
        self.comes(0x580 + NODE, *self.answers.get(data.hex(" ").upper(), []))
        return True

    def receive(self, timeout_s: float) -> Frame | None:
        if self.coming:
            return self.coming.pop(0)
        self.time_s += timeout_s
        return None

    def now_s(self) -> float:
        return self.time_s

    def pause(self, seconds: float) -> None:
        self.time_s += seconds


def remote_node(wire: Wire) -> RemoteNode:
    return RemoteNode(wire, NODE, MASTER, 0.05)  # type: ignore[arg-type]


class Asked:
    """Stands for `SdoRequests`: what was asked, answered by the test."""

    def __init__(self) -> None:
        self.reads: list[tuple[int, int]] = []
        self.writes: list[tuple[int, int, str]] = []
        self.waiting, self.abort_code = False, 0
        self.then: Callable[[bytes | None], None] = lambda data: None

    def read(self, index: int, sub: int, then: Callable[[bytes | None], None]) -> None:
        self.reads.append((index, sub))
        self.then = then

    def write(self, index: int, sub: int, data: bytes, then: Callable[[bytes | None], None]) -> None:
        self.writes.append((index, sub, data.hex()))
        self.then = then
