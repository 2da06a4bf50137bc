"""Cost of one SYNC, RPDO and TPDO cycle at 100, 250 and 500 Hz, beside a bare python-can loop in the same run.

    tests/support/private_network.sh .venv/bin/python benchmarks/can_cycle.py [--seconds N]

The drive is `gantryctl drive sim` in a process of its own, in real time over UDP multicast; it is never enabled.
"""

from __future__ import annotations

import argparse
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import can

from gantryctl.drives.canopen.bus.link import open_bus
from gantryctl.drives.virtual.side_channel.control import ControlClient
from gantryctl.errors import DeviceError
from gantryctl.image import SAFE_OUTPUT
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.machine.effective import to_toml
from gantryctl.runtime import RealClock, keeps_time
from gantryctl.wiring.canopen import canopen_drive

PERIODS_MS = (10.0, 4.0, 2.0)
LATE_PART = 0.25
"""A scan that begins later than this part of its period counts as late."""


class Figures(NamedTuple):
    """One loop."""

    cpu_us: float
    """Processor time of a cycle."""
    late: float
    """Part of the scans that began late."""
    unanswered: float
    """Part of the SYNCs without both answers in time."""


def machine(period_ms: float) -> Machine:
    return with_values(
        default_machine(),
        {
            "drive.kind": "canopen",
            "control.scan_period_ms": period_ms,
            "can.interface": "udp_multicast",
            "can.answer_ms": 0.5 * period_ms,
        },
    )


def paced(period_s: float, seconds: float, cycle: Callable[[], bool]) -> Figures:
    """Run a cycle at its rate; it says whether both answers came."""
    clock, count = RealClock(period_s), round(seconds / period_s)
    late = unanswered = 0
    clock.start()
    before = time.process_time()
    for scan in range(count):
        late += clock.wait_for(scan) > LATE_PART * period_s
        unanswered += not cycle()
    return Figures(1e6 * (time.process_time() - before) / count, late / count, unanswered / count)


def master(period_ms: float, seconds: float) -> Figures:
    """The whole `Drive` port: read and write."""
    drive = canopen_drive(machine(period_ms))

    def cycle() -> bool:
        feedback = drive.read()
        drive.write(SAFE_OUTPUT)
        return feedback.age_scans == 0

    found = paced(period_ms * 1e-3, seconds, cycle)
    drive.close()
    return found


def bare(period_ms: float, seconds: float) -> Figures:
    """The same telegrams with python-can alone; the drive is set up by the master first."""
    drive = canopen_drive(machine(period_ms))
    bus = open_bus("udp_multicast")
    sync = can.Message(arbitration_id=0x80, is_extended_id=False)
    rpdo = can.Message(arbitration_id=0x202, data=struct.pack("<Hih", 0, 0, 0), is_extended_id=False)

    def cycle() -> bool:
        while bus.recv(0.0) is not None:
            pass
        bus.send(sync)
        end, answers = time.monotonic() + 0.5e-3 * period_ms, 0
        while answers < 2 and (left := end - time.monotonic()) > 0.0:
            message = bus.recv(left)
            answers += message is not None and message.arbitration_id in (0x182, 0x282)
        bus.send(rpdo)
        return answers == 2

    found = paced(period_ms * 1e-3, seconds, cycle)
    bus.shutdown()
    drive.close()
    return found


def start_drive(folder: Path) -> subprocess.Popen[bytes]:
    """The virtual drive, listening."""
    config, socket = folder / "machine.toml", folder / "drive.sock"
    config.write_text(to_toml(machine(PERIODS_MS[0])), encoding="utf-8")
    arguments = ["drive", "sim", "--can", "udp_multicast", "--config", str(config), "--control", str(socket)]
    drive = subprocess.Popen([sys.executable, "-m", "gantryctl", *arguments], stdout=subprocess.DEVNULL)
    for _ in range(100):
        try:
            ControlClient(socket)
        except DeviceError:
            time.sleep(0.1)
        else:
            return drive
    raise SystemExit("the virtual drive did not start")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as name:
        drive = start_drive(Path(name))
        try:
            print(f"{'':24}{'processor time':>16}{'late':>10}{'unanswered':>14}")
            for period_ms in PERIODS_MS:
                with keeps_time():
                    loops = {"master": master(period_ms, seconds), "python-can": bare(period_ms, seconds)}
                for what, found in loops.items():
                    print(
                        f"{1000.0 / period_ms:4.0f} Hz  {what:15}{found.cpu_us:13.0f} us"
                        f"{100.0 * found.late:9.2f}%{100.0 * found.unanswered:13.2f}%"
                    )
        finally:
            drive.terminate()
            drive.wait()


if __name__ == "__main__":
    main()
