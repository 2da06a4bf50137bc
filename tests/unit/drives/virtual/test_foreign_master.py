"""The virtual drive driven by the canopen library: SDO, NMT, PDO maps, heartbeat, EMCY of somebody else."""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator

import can
import canopen
import pytest

from gantryctl.drives.od.writing import write_eds
from gantryctl.drives.virtual.communication.objects import device_tables
from gantryctl.drives.virtual.loop import DirectBus
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.personality import personality
from gantryctl.machine import default_machine
from gantryctl.wiring.virtual import drive_hardware


class Foreign:
    """canopen's network and node on one end, the virtual drive on the other."""

    def __init__(self) -> None:
        hardware = drive_hardware(default_machine())
        self.bus = DirectBus()
        self.drive = DriveNode(hardware, 2, self.bus.deliver, stepped=True)
        self.bus.attach(self.drive)
        self.network = canopen.Network(self.bus)
        self.network.notifier = can.Notifier(self.bus, self.network.listeners, 0.05)
        eds = io.StringIO(write_eds(device_tables(hardware, personality(()))[1]))
        eds.name = "drive.eds"
        self.node = self.network.add_node(2, eds)
        self.node.sdo.RESPONSE_TIMEOUT = 5.0  # a slow computer is no slow drive

    def sync(self, count: int = 1) -> None:
        for _ in range(count):
            self.network.send_message(0x80, b"")


@pytest.fixture
def foreign(caplog: pytest.LogCaptureFixture) -> Iterator[Foreign]:
    caplog.set_level(logging.ERROR)
    made = Foreign()
    made.drive.boot()
    yield made
    made.network.notifier.stop(5.0)
    made.bus.shutdown()


def test_identity_and_a_text_by_its_sdo_client(foreign: Foreign) -> None:
    sdo = foreign.node.sdo
    assert sdo[0x1018][2].raw == 0x0047_0402
    assert sdo[0x1008].raw == "gantryctl virtual drive"  # segmented: longer than 4 bytes


def test_an_abort_reaches_it_as_its_own_exception(foreign: Foreign) -> None:
    with pytest.raises(canopen.SdoAbortedError) as aborted:
        foreign.node.sdo.upload(0x5FFF, 0)
    assert aborted.value.code == 0x0602_0000


def test_its_pdo_maps_are_taken_and_move_the_axis(foreign: Foreign) -> None:
    """Mapping, NMT, SYNC, RPDO and TPDO all by canopen; a tenth of a degree a second for one second."""
    node = foreign.node
    node.sdo[0x1006].raw = 4000
    node.sdo[0x6060].raw = 9
    node.rpdo.read()
    node.tpdo.read()
    node.rpdo[1].clear()
    for name in ("Controlword", "Target velocity"):
        node.rpdo[1].add_variable(name)
    node.tpdo[1].clear()
    for name in ("Statusword", "Position actual value"):
        node.tpdo[1].add_variable(name)
    for pdo in (node.rpdo[1], node.tpdo[1]):
        pdo.trans_type, pdo.enabled = 1, True
    node.rpdo.save()
    node.tpdo.save()
    node.nmt.state = "OPERATIONAL"
    speed = round(0.1 / 360.0 * 1144.0 * node.sdo[0x608F][1].raw)
    begun = node.sdo[0x6064].raw
    for word in (0x06, 0x07, 0x0F):
        node.rpdo[1]["Controlword"].raw = word
        node.rpdo[1]["Target velocity"].raw = 0
        for _ in range(60):
            node.rpdo[1].transmit()
            foreign.sync()
    node.rpdo[1]["Target velocity"].raw = speed
    for _ in range(250):
        node.rpdo[1].transmit()
        foreign.sync()
    assert node.tpdo[1].wait_for_reception(timeout=5.0) is not None
    assert node.sdo[0x6041].raw & 0x6F == 0x27
    moved = (node.sdo[0x6064].raw - begun) / node.sdo[0x608F][1].raw * 360.0 / 1144.0
    assert moved == pytest.approx(0.1, rel=0.05)  # the speed loop needs some hundredths of a second


def test_its_heartbeat_and_emergency_consumers_hear_the_drive(foreign: Foreign) -> None:
    node = foreign.node
    node.sdo[0x1006].raw = 4000
    node.sdo[0x1017].raw = 20
    foreign.sync(20)
    assert node.nmt.wait_for_heartbeat(timeout=5.0) == "PRE-OPERATIONAL"
    with foreign.bus.lock:
        foreign.drive.axis.fault(0x7305)
    emcy = node.emcy.wait(0x7305, timeout=5.0)
    assert emcy is not None
    assert emcy.register & 1
