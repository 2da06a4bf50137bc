"""Branches of the areas of a safety rule: how many there are, and which of them no test takes."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any, Final

import coverage

from mutation.areas import ROOT, SOURCES, area_of

EVIDENCE: Final = "docs/evidence/branch_coverage.json"
COUNTED: Final = ("program", "operation", "drives/canopen", "service/command")
_NOT_RUN: Final = [
    "if TYPE_CHECKING:",
    r"^\s*\.\.\.$",
    r"case _:\s*assert_never\(.*",
    "if __name__ == .__main__.:",
]
"""What only a type checker reads (imports for it, bodies of protocols, cases that it has shown to be none), or only a
command runs."""


def branches(folder: Path) -> tuple[dict[str, dict[str, Any]], dict[str, list[list[int]]]]:
    """Counts by area, and by source the branches that were not taken, as pairs of lines; -1 is the way out.

    Args:
        folder: of `python -m mutation record`; nothing there is changed.
    """
    with tempfile.TemporaryDirectory() as scratch:
        measured = coverage.Coverage(
            data_file=str(Path(scratch) / "coverage"), branch=True, config_file=False, messages=False
        )
        measured.set_option("report:exclude_also", _NOT_RUN)
        measured.combine([str(path) for path in sorted(folder.glob("coverage.*"))], keep=True)
        report = Path(scratch) / "report.json"
        wanted = [f"*/{SOURCES}/{area}/*" for area in COUNTED]
        measured.json_report(outfile=str(report), include=wanted)
        files = json.loads(report.read_text(encoding="utf-8"))["files"]
    rows = {area: {"name": area, "branches": 0, "covered": 0} for area in COUNTED}
    missing = {}
    for path, found in sorted(files.items()):
        file = f"{SOURCES}/" + path.partition(f"{SOURCES}/")[2]
        row, counts = rows[area_of(file)], found["summary"]
        row["branches"] += counts["num_branches"]
        row["covered"] += counts["covered_branches"]
        if found["missing_branches"]:
            missing[file] = found["missing_branches"]
    return rows, missing


def write(rows: dict[str, dict[str, Any]], root: Path = ROOT) -> None:
    """Replace the rows of these areas, and keep others (those of the core are measured by gcov)."""
    path = root / EVIDENCE
    kept = json.loads(path.read_text(encoding="utf-8"))["areas"] if path.exists() else []
    merged = {row["name"]: row for row in kept} | rows
    text = json.dumps({"areas": [merged[name] for name in sorted(merged)]}, indent=2) + "\n"
    path.write_text(text, encoding="utf-8")
