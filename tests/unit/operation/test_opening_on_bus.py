"""A machine on a bus that cannot be opened leaves its bus."""

from __future__ import annotations

from pathlib import Path

import pytest

from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.errors import DeviceError
from gantryctl.image import DriveFeedback
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.operation.opening import open_axis

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
