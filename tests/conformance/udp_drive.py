"""The conformance suite over a CAN bus of UDP multicast: the drive is another process, stepped by SYNC.

Runs inside `tests/support/private_network.sh`; `tests/system/test_can_processes.py` starts it.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from conformance.drive_port import DriveBench, DriveConformance
from conformance.test_canopen_drive import SYNC_S, CanBench
from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.errors import DeviceError
from gantryctl.machine import default_machine, with_values
from gantryctl.machine.effective import to_toml
from gantryctl.wiring.canopen import canopen_drive

MACHINE = with_values(
    default_machine(),
    {
        "drive.kind": "canopen",
        "control.scan_period_ms": 1e3 * SYNC_S,
        "brake.owner": "object_60FE",
        "can.interface": "udp_multicast",
        "can.stepped": True,
        "can.commissioning_required": False,
    },
)


@pytest.fixture(scope="module")
def channel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ControlClient]:
    """A virtual drive as its own process, and its side channel."""
    folder = tmp_path_factory.mktemp("drive")
    config, socket = folder / "machine.toml", folder / "drive.sock"
    config.write_text(to_toml(MACHINE), encoding="utf-8")
    arguments = ["drive", "sim", "--can", "udp_multicast", "--stepped", "--config", str(config)]
    with subprocess.Popen([sys.executable, "-m", "gantryctl", *arguments, "--control", str(socket)]) as drive:
        with connected(socket) as client:
            yield client
        drive.terminate()


def connected(socket: Path) -> ControlClient:
    for _ in range(200):
        try:
            return ControlClient(socket)
        except DeviceError:
            time.sleep(0.1)
    raise AssertionError("the virtual drive did not start")


class UdpBench(CanBench):
    """The same drive for every test, switched off and on again before it."""

    def __init__(self, channel: ControlClient) -> None:
        self._channel = channel
        channel.ask("clear")
        channel.ask("advance", s=3.0)  # whatever turned has come to rest
        channel.ask("event", event="reset")
        self.drive = canopen_drive(MACHINE)
        self.ratio = MACHINE.axis.ratio
        self.quick_dec_deg_s2 = MACHINE.virtual_axis.quick_dec_deg_s2
        self.brake_time_s = 0.25

    def ask(self, request: dict[str, object]) -> dict[str, object]:
        fields = dict(request)
        return {"ok": True, **self._channel.ask(str(fields.pop("cmd")), **fields)}


class TestOverUdp(DriveConformance):
    """Everything that holds in process holds between two processes."""

    @pytest.fixture
    def bench(self, channel: ControlClient) -> Iterator[DriveBench]:
        bench = UdpBench(channel)
        yield bench
        bench.drive.close()
