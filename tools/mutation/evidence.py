"""What the trials amount to: docs/evidence/mutation.json, and the list of survivors that are argued."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from mutation.areas import SOURCES
from mutation.cpp_operators import cpp_mutants
from mutation.mutant import Change
from mutation.operators import mutants
from mutation.trial import FOUND, Fate, Trial

ARGUED: Final = "tests/planted/argued.toml"
EVIDENCE: Final = "docs/evidence/mutation.json"


def read_argued(root: Path) -> dict[str, str]:
    """The reason why a mutant changes nothing that anybody could see, by its name.

    A row whose lines are no longer those of its mutant argues for nothing: numbers move with the text.
    """
    rows = argued_rows(root)
    now: dict[str, tuple[str, str]] = {}
    for file in {row["name"].partition(":")[0] for row in rows}:
        now |= _lines(root, file)
    return {
        row["name"]: row["reason"] for row in rows if now.get(row["name"]) == (row.get("old"), row.get("new"))
    }


def argued_rows(root: Path) -> list[dict[str, str]]:
    """The rows of the list as they stand there."""
    path = root / ARGUED
    return tomllib.loads(path.read_text(encoding="utf-8")).get("mutant", []) if path.exists() else []


def argue(root: Path, name: str, reason: str) -> None:
    """Put a mutant on the list, with its lines as they are now.

    Raises:
        KeyError: there is no such mutant.
    """
    old, new = _lines(root, name.partition(":")[0])[name]
    path = root / ARGUED
    path.parent.mkdir(parents=True, exist_ok=True)
    row = "".join(
        f"{key} = {json.dumps(value, ensure_ascii=False)}\n"
        for key, value in {"name": name, "old": old, "new": new, "reason": reason}.items()
    )
    with path.open("a", encoding="utf-8") as file:
        file.write(f"\n[[mutant]]\n{row}")


def _lines(root: Path, file: str) -> dict[str, tuple[str, str]]:
    """The lines of each mutant of a source, before and after, by its name."""
    path = Path(file if file.startswith("core/") else f"{SOURCES}/{file}")
    if not (root / path).exists():
        return {}
    source = (root / path).read_bytes()
    found = (cpp_mutants if path.suffix == ".hpp" else mutants)(path.as_posix(), source)
    return {change.name: change.lines(source) for change in found}


def summary(
    area: str, changes: Iterable[Change], trials: Mapping[str, Trial], argued: Mapping[str, str]
) -> dict[str, Any]:
    """Counts of one area; an argued mutant counts neither as killed nor as survived."""
    tried = [
        (change, trials[change.name])
        for change in changes
        if change.name in trials and trials[change.name].fate is not Fate.STALE
    ]
    killed = [change for change, trial in tried if trial.fate in FOUND]
    excused = [change for change, trial in tried if trial.fate not in FOUND and change.name in argued]
    severe = [change for change, _ in tried if change.severe and change not in excused]
    return {
        "name": area,
        "mutants": len(tried),
        "killed": len(killed),
        "argued": len(excused),
        "survived": len(tried) - len(killed) - len(excused),
        "severe": len(severe),
        "severe_killed": sum(change.severe for change in killed),
        "timeouts": sum(trial.fate == "timeout" for _, trial in tried),
        "drawn": len(list(changes)),
    }


def planted_summary(area: str, tried: Iterable[tuple[Change, Trial | None]]) -> dict[str, Any]:
    """Counts of one file of planted bugs; a trial is None where the bug was not tried on the sources as they are."""
    rows = list(tried)
    done = [(change, trial) for change, trial in rows if trial is not None and trial.fate is not Fate.STALE]
    lost = [(change, trial) for change, trial in done if trial.fate not in FOUND]
    return {
        "name": area,
        "bugs": len(rows),
        "severe": sum(change.severe for change, _ in rows),
        "tried": len(done),
        "severe_tried": sum(change.severe for change, _ in done),
        "killed": len(done) - len(lost),
        "survived": sum(trial.fate is Fate.SURVIVED for _, trial in lost),
        "uncovered": sum(trial.fate is Fate.UNCOVERED for _, trial in lost),
        "open": sorted(change.name.rpartition("/")[2] for change, _ in lost),
    }


def write(root: Path, found: Mapping[str, Any], planted: Mapping[str, Any], name: str = EVIDENCE) -> None:
    """Replace the rows of these areas and files of planted bugs, and keep the others."""
    path = root / name
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    tables = {}
    for table, fresh in (("areas", found), ("planted", planted)):
        rows = {row["name"]: row for row in kept.get(table, [])} | dict(fresh)
        tables[table] = [rows[key] for key in sorted(rows)]
    path.write_text(json.dumps(tables, indent=2) + "\n", encoding="utf-8")
