"""What `docs/how-to/extend.md` promises: whoever adds something and forgets a place is told by a test."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import get_args, get_type_hints

import pytest

from gantryctl.commissioning import STEPS, Step
from gantryctl.drives.faults import names
from gantryctl.machine import field_specs
from gantryctl.machine.tables.drive import DriveTable
from gantryctl.service.protocol.tags import TAGS, Tag

# Commissioning is of machines on a bus.
pytestmark = pytest.mark.can
ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src" / "gantryctl"
EXTEND = ROOT / "docs" / "how-to" / "extend.md"
CONFORMANCE = {"sim": "test_sim_drive.py", "ideal": "test_ideal_drive.py", "canopen": "test_canopen_drive.py"}
"""A kind of drive in the machine file, and where the `Drive` port is held against it."""


@cache
def sources(*left_out: str) -> str:
    """All Python of the package but the folders named."""
    files = (path for path in SOURCE.rglob("*.py") if not any(part in str(path) for part in left_out))
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted(files))


def test_every_kind_of_drive_runs_the_conformance_suite() -> None:
    assert set(get_args(get_type_hints(DriveTable)["kind"])) == set(CONFORMANCE)
    for file in CONFORMANCE.values():
        assert "DriveConformance" in (ROOT / "tests" / "conformance" / file).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", names())
def test_a_fault_of_the_virtual_drive_acts_is_documented_and_injected_by_a_test(name: str) -> None:
    assert f"`{name}`" in (ROOT / "docs" / "reference" / "drive-sim.md").read_text(encoding="utf-8")
    assert re.search(rf"faults\.{name}\b", sources("drives/faults.py"))
    tests = (path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("*.py"))
    assert any(f'"{name}"' in text for text in tests)


@pytest.mark.parametrize("tag", TAGS, ids=lambda tag: tag.name)
def test_a_tag_is_published(tag: Tag) -> None:
    assert re.search(rf"""["']{tag.name}["']""", sources("service/protocol")), "no publisher gives it a value"


@pytest.mark.parametrize("path", field_specs())
def test_a_key_of_the_machine_file_is_read_by_somebody(path: str) -> None:
    """Beyond the rules that only compare it with other keys."""
    key = path.rpartition(".")[2]
    read = re.search(rf"""[."']{key}\b""", sources("machine/tables", "machine/rules"))
    # A table may give another value that follows from it.
    assert read or re.search(rf"self\.{key}\b", sources("machine/rules"))


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.key)
def test_a_commissioning_step_is_documented(step: Step) -> None:
    page = (ROOT / "docs" / "how-to" / "commission.md").read_text(encoding="utf-8")
    assert f"| `{step.key}` |" in page


def test_the_files_that_the_page_names_exist() -> None:
    named = re.findall(
        r"`((?:src|tests|docs|tools|hmi|configs)/[\w./-]+\.\w+)`", EXTEND.read_text(encoding="utf-8")
    )
    assert len(named) > 25
    assert [name for name in named if not (ROOT / name).exists()] == []
