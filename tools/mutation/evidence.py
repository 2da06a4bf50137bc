"""What the trials amount to: docs/evidence/mutation.json, and the list of survivors that are argued."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

from mutation.mutant import Change
from mutation.trial import FOUND, Fate, Trial

ARGUED: Final = "tests/planted/argued.toml"
EVIDENCE: Final = "docs/evidence/mutation.json"


def read_argued(root: Path) -> dict[str, str]:
    """The reason why a mutant changes nothing that anybody could see, by its name."""
    path = root / ARGUED
    rows = tomllib.loads(path.read_text(encoding="utf-8")).get("mutant", []) if path.exists() else []
    return {row["name"]: row["reason"] for row in rows}


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


def write(root: Path, found: Mapping[str, Any], name: str = EVIDENCE) -> None:
    """Replace the rows of these areas, and keep the others."""
    path = root / name
    kept = json.loads(path.read_text(encoding="utf-8"))["areas"] if path.exists() else []
    rows = {row["name"]: row for row in kept} | dict(found)
    text = json.dumps({"areas": [rows[key] for key in sorted(rows)]}, indent=2) + "\n"
    path.write_text(text, encoding="utf-8")
