"""Results of this computer: a file in the state directory, to which the next run is compared."""

from __future__ import annotations

import json
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl import _core
from gantryctl.engineering.bench.figures import Figure
from gantryctl.errors import StateError
from gantryctl.files import write_whole
from gantryctl.operation.store import now_text, state_root

FILE: Final = "bench.json"
KEPT: Final = 20
"""Runs of one group that are kept."""


class Results(NamedTuple):
    """All runs, by group, oldest first."""

    path: Path
    runs: dict[str, list[dict[str, Any]]]

    def last(self, group: str) -> dict[str, float]:
        """Figures of the last run of a group by key; {} before the first."""
        runs = self.runs.get(group)
        return dict(runs[-1]["figures"]) if runs else {}

    def add(self, group: str, figures: list[Figure]) -> None:
        """Keep a run, and write the file.

        Raises:
            StateError: the disk does not take it.
        """
        run = {
            "at": now_text(),
            "version": _own_version(),
            "python": platform.python_version(),
            "processor": platform.machine(),
            "instructions": _core.isa(),
            "figures": {figure.key: figure.value for figure in figures},
        }
        self.runs[group] = [*self.runs.get(group, []), run][-KEPT:]
        write_whole(self.path, json.dumps(self.runs, indent=1) + "\n", make_folder=True)


def _own_version() -> str:
    try:
        return version("gantryctl")
    except PackageNotFoundError:
        return "not installed"


def load_results() -> Results:
    """What is in the file; nothing before the first run.

    Raises:
        StateError: it is not a file of results.
    """
    path = state_root() / FILE
    try:
        runs = json.loads(path.read_text(encoding="utf-8"))
        for group in runs.values():
            for run in group:
                for value in run["figures"].values():
                    float(value)
    except FileNotFoundError:
        return Results(path, {})
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as fault:
        raise StateError(f"{path}: no file of results ({type(fault).__name__}): move it away") from None
    return Results(path, runs)
