"""What a process loads: a controller on a bus no simulator, a simulation no bus, a recorder no machine."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

import gantryctl.wiring

MODULES_MAX = 228
"""Of the controller of a machine on a bus; 213 before the rooms were told apart, 172 before the ledger and the
nodes beside the drive came, 203 before the power sequence got its parts,
208 before requirement, turns of a modulo axis and no-go sectors, 216 before the further blocks of PLCopen and
of IEC 61131-3, 224 before frames were sealed and unclean ends told,
226 before power that nobody holds was switched off, 227 before `gantryctl.lazy`."""

ON_BUS = """
from gantryctl.service.controller import process
from gantryctl.drives.base import BaseDrive
from gantryctl.errors import DeviceError
from gantryctl.image import DriveIdentity
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.wiring.engine import build_engine, build_program, drive_of

file = load_machine(configs_folder() / "hust_can.toml")
bus = {"can.interface": "virtual", "can.channel": "nobody", "can.sdo_timeout_ms": 10.0}
machine = with_values(file, bus)
try:
    drive_of(machine)
except DeviceError as silence:
    assert "does not answer" in str(silence)
class Silent(BaseDrive):
    def identity(self):
        return DriveIdentity("silent", "", 1, 1)
drive = Silent()
build_engine(machine, drive, build_program(machine, drive, zero_counts=0.0))
"""

SIMULATED = """
from gantryctl.machine import default_machine
from gantryctl.wiring.engine import build_engine

build_engine(default_machine()).run_for(0.1)
"""


def loaded(script: str) -> list[str]:
    """Our modules, python-can and pydantic, that a new process has loaded at the end of a script."""
    looked_for = ("gantryctl", "can", "pydantic")
    end = (
        f"\nimport json, sys\nprint(json.dumps([m for m in sys.modules if m.split('.')[0] in {looked_for}]))"
    )
    done = subprocess.run([sys.executable, "-c", script + end], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: list[str] = json.loads(done.stdout.splitlines()[-1])
    return sorted(found)


def of(rooms: tuple[str, ...], modules: list[str]) -> list[str]:
    return [m for m in modules if any(m == room or m.startswith(room + ".") for room in rooms)]


@pytest.mark.can
def test_a_controller_on_a_bus_loads_no_simulator() -> None:
    modules = loaded(ON_BUS)
    strange = (
        "drives.virtual",
        "drives.simulated",
        "drives.ideal",
        "engineering",
        "commissioning",
        "cli",
        "gateway",
    )
    assert of(tuple(f"gantryctl.{room}" for room in strange), modules) == []
    ours = of(("gantryctl",), modules)
    print(f"modules of gantryctl in the controller of a machine on a bus: {len(ours)}")
    assert len(ours) <= MODULES_MAX, ours


def test_a_simulation_loads_no_bus() -> None:
    modules = loaded(SIMULATED)
    assert (
        of(("can", "gantryctl.drives.canopen", "gantryctl.drives.virtual", "gantryctl.service"), modules)
        == []
    )


def test_the_recorder_loads_neither_machine_nor_program() -> None:
    """It writes what others tell; the tables of the machine file would make its start three times as long."""
    modules = loaded("import gantryctl.service.recorder.process")
    assert (
        of(
            ("pydantic", "gantryctl.machine", "gantryctl.program.axis.axis", "gantryctl.program.gantry"),
            modules,
        )
        == []
    )


def test_the_gateway_loads_neither_machine_nor_program() -> None:
    modules = loaded("import gantryctl.gateway.app, gantryctl.gateway.server")
    assert of(("gantryctl.machine", "gantryctl.program.axis.axis", "gantryctl.program.gantry"), modules) == []


def test_the_wiring_has_no_classes() -> None:
    """It chooses parts and is not one itself: a class there would be a part that nobody finds."""
    for file in Path(gantryctl.wiring.__path__[0]).glob("*.py"):
        classes = [
            n.name
            for n in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
            if isinstance(n, ast.ClassDef)
        ]
        assert classes == [], file
