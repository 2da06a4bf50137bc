"""Packages whose branches are counted while a target is fuzzed; known before anything of them is imported."""

from __future__ import annotations

from typing import Final

_MACHINE: Final = ("gantryctl.machine", "tomllib")
PACKAGES: Final[dict[str, tuple[str, ...]]] = {
    "machine": _MACHINE,
    "calibration": _MACHINE,
    "campaign": ("gantryctl.engineering.campaign", *_MACHINE),
    "sheet": ("gantryctl.engineering.sizing", *_MACHINE),
    "drift": ("gantryctl.engineering.comparison", *_MACHINE),
    "injections": ("gantryctl.engineering.faults.injection", "tomllib"),
    "error_table": ("gantryctl.engineering.accuracy.table_csv", "csv"),
    "eds": ("gantryctl.drives.od",),
    "object_table": ("gantryctl.drives.od", "csv"),
    "frames": ("gantryctl.drives.canopen", "gantryctl.drives.od"),
    "sdo": ("gantryctl.drives.canopen.bus", "gantryctl.drives.od"),
    "bus_log": ("gantryctl.trace.frames", "can.io", "csv"),
    "retained": ("gantryctl.runtime.retained", "gantryctl.runtime.retained_store"),
    "backup": ("gantryctl.service.backup", "tarfile"),
    "drive_backup": ("gantryctl.drives.canopen.setup.parameters",),
    "journal": ("gantryctl.service.recorder.journal",),
    "recording": ("gantryctl.trace",),
    "message": ("gantryctl.service.protocol",),
    "record": ("gantryctl.service.protocol",),
}
