"""The conformance suite over python-can's `virtual` interface: the drive lives in a thread, stepped by SYNC."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import can
import pytest

from conformance.drive_port import DriveBench, DriveConformance
from conformance.test_canopen_drive import SYNC_S, CanBench
from gantryctl.drives.virtual.loop import DriveLoop, FrameSender
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.machine import default_machine, with_values
from gantryctl.wiring.canopen import canopen_drive
from gantryctl.wiring.virtual import drive_hardware

CHANNELS = itertools.count()


@contextmanager
def running(loop: DriveLoop) -> Iterator[DriveLoop]:
    """Boot the drive and run it in its own thread during a with block."""
    stop = threading.Event()
    thread = threading.Thread(target=loop.run, args=(stop,), name="virtual drive", daemon=True)
    with loop.lock:
        loop.node.boot()
    thread.start()
    try:
        yield loop
    finally:
        stop.set()
        thread.join()


class VirtualBusBench(CanBench):
    """A bus with the drive on one end and the master on the other."""

    def __init__(self, stack: ExitStack) -> None:
        channel = f"conformance-{next(CHANNELS)}"
        machine = with_values(
            default_machine(),
            {
                "drive.kind": "canopen",
                "control.scan_period_ms": 1e3 * SYNC_S,
                "brake.owner": "object_60FE",
                "can.interface": "virtual",
                "can.channel": channel,
                "can.stepped": True,
                "can.commissioning_required": False,
            },
        )
        bus = stack.enter_context(can.Bus(interface="virtual", channel=channel))
        link = FrameSender(bus)
        node = DriveNode(drive_hardware(machine), machine.can.node, link.send, stepped=True)
        self._loop = stack.enter_context(running(DriveLoop(node, link)))
        self._answer = Requests(node).answer
        self.drive = canopen_drive(machine)
        self.ratio = machine.axis.ratio
        self.quick_dec_deg_s2 = machine.virtual_axis.quick_dec_deg_s2
        self.brake_time_s = 0.25

    def ask(self, request: dict[str, object]) -> dict[str, object]:
        with self._loop.lock:
            return self._answer(request)


class TestOverAVirtualBus(DriveConformance):
    """Everything that holds in process holds over a bus of python-can."""

    @pytest.fixture
    def bench(self) -> Iterator[DriveBench]:
        with ExitStack() as stack:
            bench = VirtualBusBench(stack)
            yield bench
            bench.drive.close()
