"""A drive on a bus belongs to one process."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from gantryctl.drives.canopen.bus.lock import DriveLock
from gantryctl.errors import DeviceError, StateError
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.runtime import StateLock
from gantryctl.wiring.canopen import can_link

pytestmark = pytest.mark.can

linux = pytest.mark.skipif(sys.platform != "linux", reason="abstract names of sockets are Linux's")
MACHINE = load_machine(configs_folder() / "hust_can.toml")
WHERE = f"test bus {os.getpid()}, node 1"
HOLD = (
    "import sys; from gantryctl.drives.canopen.bus.lock import DriveLock\n"
    "lock = DriveLock(sys.argv[1]); print('held', flush=True); sys.stdin.read()"
)


@linux
def test_the_second_one_is_told_who_has_it() -> None:
    first = DriveLock(WHERE)
    with pytest.raises(DeviceError, match=f"{WHERE} is in use by process {os.getpid()}: "):
        DriveLock(WHERE)
    DriveLock(WHERE + "2").release()
    first.release()
    first.release()
    DriveLock(WHERE).release()


@linux
def test_a_killed_process_holds_nothing() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, WHERE], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(DeviceError, match=f"in use by process {other.pid}"):
            DriveLock(WHERE)
        other.kill()
        other.wait()
        DriveLock(WHERE).release()


@linux
def test_a_link_holds_its_drive_until_it_is_closed() -> None:
    """python-can's bus within one process: two links to it could be opened otherwise."""
    machine = with_values(MACHINE, {"can.interface": "virtual", "can.channel": f"lock-{os.getpid()}"})
    link = can_link(machine)
    with pytest.raises(DeviceError, match="in use by process"):
        can_link(machine)
    link.close()
    link.close()
    can_link(machine).close()


@linux
def test_a_bus_that_cannot_be_opened_leaves_the_drive_free() -> None:
    machine = with_values(MACHINE, {"can.interface": "socketcan", "can.channel": "nowhere0"})
    for _ in range(2):
        with pytest.raises(DeviceError, match="cannot be opened"):
            can_link(machine)


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="links are opened here")
def test_a_lock_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("kept", encoding="utf-8")
    (tmp_path / "state").mkdir()
    (tmp_path / "state" / "lock").symlink_to(precious)
    with pytest.raises(StateError, match="state directory"), StateLock(tmp_path / "state"):
        pass
    assert precious.read_text(encoding="utf-8") == "kept"
