"""A machine on a bus that cannot be opened leaves its bus."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gantryctl.commissioning import Commissioning
from gantryctl.drives.canopen.bus.link import BusLink
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.image import DriveFeedback, DriveState
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.opening import open_axis
from gantryctl.operation.run import AxisRun
from gantryctl.operation.state import read_retained, reset_machine
from gantryctl.operation.store import StateStore
from gantryctl.wiring import virtual

pytestmark = pytest.mark.can


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def test_a_drive_that_stops_answering_while_it_is_opened_leaves_its_bus(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine = load_machine(configs_folder() / "hust_can.toml")
    closed: list[CanopenDrive] = []

    def silent(_: CanopenDrive) -> DriveFeedback:
        raise DeviceError("silent")

    def close(drive: CanopenDrive) -> None:
        closed.append(drive)

    monkeypatch.setattr(CanopenDrive, "read", silent)
    monkeypatch.setattr(CanopenDrive, "close", close)
    with pytest.raises(DeviceError, match="silent"):
        open_axis(with_values(machine, {"can.interface": "simulated"}), None)
    assert len(closed) == 1
    closed[0].link.close()


@pytest.fixture
def faulty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every virtual drive of this process is in fault when it is opened, as one that has outlived its controller."""
    sound = virtual.virtual_node

    def virtual_node(*given: Any, **more: Any) -> tuple[BusLink, DriveNode]:
        link, node = sound(*given, **more)
        node.axis.fault(0x8250, report=True, ramp=True)
        node.advance(2_000_000)  # us: at rest, brake closed
        return link, node

    monkeypatch.setattr(virtual, "virtual_node", virtual_node)


@pytest.mark.usefixtures("faulty")
def test_a_reset_on_the_command_line_resets_the_fault_of_the_drive_and_never_enables_it() -> None:
    machine = load_machine(configs_folder() / "hust_can.toml")
    assert reset_machine(machine) == "the fault of the drive is reset, the drive is in switch on disabled"


@pytest.mark.usefixtures("faulty")
def test_a_drive_in_fault_since_its_controller_was_killed_is_told_before_anything_begins(
    tmp_path: Path,
) -> None:
    """It is no alarm of this run, and no stop of it: one reset, and the same command goes on."""
    machine = load_machine(configs_folder() / "hust_can.toml")
    said = r"DRV-15 · .* in fault since before this start: error 33360 \(hexadecimal 8250\): the controller's commands"
    with StateStore(machine) as store, pytest.raises(CommandRefused, match=said):
        AxisRun(machine, store, commissioning=True)
    retained = read_retained(machine)
    assert retained is None or (retained.error_stop, retained.alarms) == ("", ())
    with StateStore(machine) as store, pytest.raises(CommandRefused, match=said):
        Commissioning(machine, store, tmp_path, print, lambda _: True).start(again=False)


@pytest.mark.usefixtures("faulty")
def test_a_fault_that_stays_is_not_acknowledged(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = load_machine(configs_folder() / "hust_can.toml")
    monkeypatch.setattr("gantryctl.wiring.canopen.reset_drive_fault", lambda _: DriveState.FAULT)
    with pytest.raises(DeviceError, match="the drive stays in fault"):
        reset_machine(machine)
    assert read_retained(machine) is None
