"""The areas whose tests are measured, and which of their sources could move, drop or mislead people."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parent.parent.parent
SOURCES: Final = "src/gantryctl"

AREAS: Final[dict[str, tuple[str, ...]]] = {
    "program": ("program/**/*.py",),
    "operation": ("operation/**/*.py",),
    "drives/canopen": ("drives/canopen/**/*.py",),
    "commissioning": ("commissioning/**/*.py",),
    "service/command": ("service/command/**/*.py",),
    "service/controller": ("service/controller/*.py",),
    "service/clients": ("service/clients/*.py", "service/memory/*.py"),
    "service/protocol": ("service/protocol/*.py",),
    "service/supervisor": ("service/supervisor/*.py",),
    "recorder": ("service/recorder/**/*.py",),
    "gateway": ("gateway/*.py", "gateway/opcua/*.py"),
    "accuracy": (
        *(
            f"engineering/accuracy/{name}.py"
            for name in (
                "budget", "gear", "iso230", "isocentre", "noise", "paper", "speed_test", "statistics",
                "uncertainty", "verdict",
            )
        ),
    ),
    "wiring": ("wiring/**/*.py",),
}  # fmt: skip
"""By name: patterns below src/gantryctl."""

CORE_AREAS: Final = ("core/control", "core/plant", "core/loop", "core/lane")
"""Folders of the core in C++, from the root of the repository."""

SEVERE: Final = (
    "program/power/",
    "program/monitors/",
    "program/axis/",
    "program/blocks/motion",
    "program/blocks/by_hand",
    "program/blocks/administration",
    "program/alarms/log",
    "program/feedback",
    "program/gantry",
    "program/settings",
    "program/stretch",
    "program/virtual_axis",
    "operation/brake_policy",
    "operation/client",
    "operation/home_reference",
    "operation/proofs",
    "operation/run",
    "operation/run_memory",
    "operation/sliced_scan",
    "operation/state",
    "drives/canopen/brake",
    "drives/canopen/cia402",
    "drives/canopen/drive",
    "drives/canopen/emergency",
    "drives/canopen/process_image",
    "drives/canopen/scaling",
    "drives/canopen/stop_by_sdo",
    "drives/canopen/supervision",
    "drives/canopen/bus/link",
    "drives/canopen/bus/node",
    "drives/canopen/nodes/ring_encoder",
    "drives/canopen/nodes/inputs",
    "drives/canopen/nodes/outputs",
    "drives/canopen/setup/parameter_check",
    "service/command/",
    "service/controller/",
    "gateway/access",
    "gateway/door",
    "gateway/guard",
    "gateway/sessions",
    "wiring/program",
    "core/control/",
    "core/plant/",
)
"""Beginnings of paths below src/gantryctl, or of the core from the root."""
HARMLESS: Final = (
    "program/alarms/alarms_page.py", "program/alarms/words.py", "service/protocol/service_page.py",
)  # fmt: skip
"""Texts and pages: a mutant there is another word."""


def area_files(area: str, root: Path = ROOT) -> Iterator[Path]:
    """The sources of an area, relative to the root of the repository."""
    if area in CORE_AREAS:
        yield from (path.relative_to(root) for path in sorted((root / area).glob("*.hpp")))
        return
    base = root / SOURCES
    for pattern in AREAS[area]:
        for path in sorted(base.glob(pattern)):
            if path.relative_to(base).as_posix() not in HARMLESS:
                yield path.relative_to(root)


def area_of(file: str) -> str:
    """The area of a source by its path from the root, "" of one outside."""
    for area in AREAS:
        if any(Path(file).match(f"{SOURCES}/{pattern.replace('**/', '*/')}") for pattern in AREAS[area]):
            return area
    below = file.removeprefix(f"{SOURCES}/")
    return next((area for area in AREAS if below.startswith(f"{area}/")), "")


def is_severe(file: str) -> bool:
    """Whether a mistake in this source could move, drop or mislead people."""
    return file.removeprefix(f"{SOURCES}/").startswith(SEVERE)
