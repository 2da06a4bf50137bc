"""Identified numbers beside the truth of the simulator, as a table of text."""

from __future__ import annotations

from collections.abc import Iterable

from gantryctl.engineering.identification.truth import Comparison
from gantryctl.engineering.report.text import TextTable
from gantryctl.machine import Calibration


def truth_table(title: str, head: str, rows: Iterable[Comparison], digits: int) -> TextTable:
    """One row per number; `head` names the column of what was found."""
    cells = tuple(
        (
            row.name,
            f"{row.identified:.{digits}g}",
            f"{row.truth:.{digits}g}",
            row.unit,
            f"{row.error_percent:+.1f} %" if row.truth else "",
        )
        for row in rows
    )
    return TextTable(title, ("", head, "truth", "", "off by"), cells)


_UNITS = {
    "moment_sine_nm": ("eccentric moment, sine", "N m"),
    "moment_cosine_nm": ("eccentric moment, cosine", "N m"),
    "inertia_kg_m2": ("inertia of load and motor", "kg m2"),
    "motor_inertia_kg_m2": ("inertia at the motor", "kg m2"),
    "stiffness_nm_per_rad": ("stiffness, base included", "N m/rad"),
    "windup_per_acc_s2": ("wind-up per acceleration", "s2"),
    "swing_hz": ("first mode, motor held", "Hz"),
    "friction_nm": ("Coulomb friction, unloaded", "N m"),
    "friction_load_ratio": ("friction per load", ""),
    "friction_nm_s_per_rad": ("friction per speed", "N m s/rad"),
    "dead_time_s": ("dead time", "s"),
}


def numbers_table(calibration: Calibration) -> TextTable:
    """The identified numbers alone, where nobody knows the truth."""
    found = calibration.identified
    rows = tuple((name, f"{getattr(found, key):.6g}", unit) for key, (name, unit) in _UNITS.items())
    return TextTable("Identified", ("", "found", ""), rows)
