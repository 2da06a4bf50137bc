"""Branches of the areas of a safety rule: how many there are, and which of them no test takes."""

from __future__ import annotations

import difflib
import json
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import coverage

from mutation.areas import ROOT, SOURCES, area_files, area_of

EVIDENCE: Final = "docs/evidence/branch_coverage.json"
COUNTED: Final = ("program", "operation", "drives/canopen", "service/command")
_NOT_RUN: Final = [
    "if (not )?TYPE_CHECKING:",
    r"^\s*\.\.\.$",
    r"case _:\s*assert_never\(.*",
    "if __name__ == .__main__.:",
]
"""What only a type checker reads (imports for it, bodies of protocols, cases that it has shown to be none), or only a
command runs."""
Way: TypeAlias = tuple[int, int]
"""From line to line; below zero the beginning or the end of the function that begins there."""


def branches(
    folder: Path, areas: Sequence[str] = COUNTED, root: Path = ROOT
) -> tuple[dict[str, dict[str, Any]], dict[str, list[list[int]]]]:
    """Counts by area, and by source the branches that were not taken, as pairs of lines; -1 is the way out.

    All parts in the folder count together, on the sources as they are now. Where a source has changed since a part was
    recorded, a branch counts as taken if neither of its two lines has changed.

    Args:
        folder: of `python -m mutation record`; nothing there is changed.

    Raises:
        SystemExit: nothing is recorded there.
    """
    # A part has its file of tests when it is whole: one that is being recorded does not count yet.
    parts = sorted(path.stem.removeprefix("tests.") for path in folder.glob("tests.*.json"))
    if not parts:
        raise SystemExit(f"{folder} holds no recorded coverage: python -m mutation record first")
    with tempfile.TemporaryDirectory() as scratch:
        joined = str(Path(scratch) / "coverage")
        whole = coverage.CoverageData(basename=joined)
        whole.add_arcs({})
        # Also a source that no part has seen.
        whole.touch_files([str(root / file) for area in areas for file in area_files(area, root)])
        for part in parts:
            taken = _taken(folder, part, Path(scratch), root)
            whole.add_arcs({str(root / file): ways for file, ways in taken.items() if area_of(file) in areas})
        whole.close()
        measured = coverage.Coverage(data_file=joined, branch=True, config_file=False, messages=False)
        for text in _NOT_RUN:
            measured.exclude(text)  # options of the report are taken at the construction only
        measured.load()
        report = Path(scratch) / "report.json"
        measured.json_report(outfile=str(report))
        files = json.loads(report.read_text(encoding="utf-8"))["files"]
    rows = {area: {"name": area, "branches": 0, "covered": 0} for area in areas}
    missing = {}
    for path, found in sorted(files.items()):
        file = f"{SOURCES}/" + path.partition(f"{SOURCES}/")[2]
        row, counts = rows[area_of(file)], found["summary"]
        row["branches"] += counts["num_branches"]
        row["covered"] += counts["covered_branches"]
        if found["missing_branches"]:
            missing[file] = found["missing_branches"]
    return rows, missing


def _taken(folder: Path, part: str, scratch: Path, root: Path) -> dict[str, list[Way]]:
    """By source: the ways that the tests of one part have taken, in the lines of now."""
    # A copy: coverage may write into what it reads.
    copy = shutil.copy(folder / f"coverage.{part}", scratch / "part")
    texts = json.loads((folder / f"tests.{part}.json").read_text(encoding="utf-8"))["texts"]
    data = coverage.CoverageData(basename=str(copy))
    data.read()
    found: dict[str, list[Way]] = {}
    for path in data.measured_files():
        file = f"{SOURCES}/" + path.partition(f"{SOURCES}/")[2]
        if (root / file).exists():
            now = _lines_now(texts.get(file, ""), (root / file).read_text(encoding="utf-8"))
            ways = data.arcs(path) or ()
            found[file] = [(now[a], now[b]) for a, b in ways if a in now and b in now]
    data.close()
    return found


def _lines_now(then: str, now: str) -> dict[int, int]:
    """The present number of every line that is as it was; below zero that of the function that begins there."""
    matcher = difflib.SequenceMatcher(None, then.split("\n"), now.split("\n"), autojunk=False)
    found: dict[int, int] = {}
    for before, after, size in matcher.get_matching_blocks():
        found |= {before + step: after + step for step in range(1, size + 1)}
    return found | {-line: -number for line, number in found.items()}


def write(rows: dict[str, dict[str, Any]], root: Path = ROOT) -> None:
    """Replace the rows of these areas, and keep others (those of the core are measured by gcov)."""
    path = root / EVIDENCE
    kept = json.loads(path.read_text(encoding="utf-8"))["areas"] if path.exists() else []
    merged = {row["name"]: row for row in kept} | rows
    text = json.dumps({"areas": [merged[name] for name in sorted(merged)]}, indent=2) + "\n"
    path.write_text(text, encoding="utf-8")
