"""Branch coverage of the core by its own tests: reads what a build with `--coverage` has left, for one folder of it.

A branch of a template is covered when one of its instances took it. Branches that only an exception takes are left out:
nothing in the numeric core throws.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple


class Line(NamedTuple):
    """One line of a file.

    Attributes:
        ran: whether it was executed. taken: by branch, whether it was taken.
    """

    ran: bool
    taken: tuple[bool, ...]


def reports(build: Path) -> Iterator[dict[str, Any]]:
    """Yield what gcov says of every object that has run."""
    for data in sorted(build.rglob("*.gcda")):
        command = ["gcov", "--json-format", "--branch-probabilities", "--stdout", str(data)]
        said = subprocess.run(command, capture_output=True, text=True, check=True, cwd=build).stdout  # noqa: S603 - a tool of the compiler
        yield from (json.loads(line) for line in said.splitlines())


def lines_of(found: Iterable[dict[str, Any]], folder: Path) -> dict[str, dict[int, Line]]:
    """Merge reports: lines with their branches by file of `folder`, whose name is relative to it."""
    merged: dict[str, dict[int, Line]] = defaultdict(dict)
    for report in found:
        base = Path(report["current_working_directory"])
        for file in report["files"]:
            path = (base / file["file"]).resolve()
            if not path.is_relative_to(folder):
                continue
            lines = merged[str(path.relative_to(folder))]
            for row in file["lines"]:
                taken = tuple(each["count"] > 0 for each in _chosen(row["branches"]))
                before = lines.get(row["line_number"], Line(False, ()))
                lines[row["line_number"]] = Line(before.ran or row["count"] > 0, _either(before.taken, taken))
    return merged


def _chosen(branches: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Leave out both ways of a call that could throw: back as usual, and by an exception."""
    thrown = {at for at, each in enumerate(branches) if each["throw"]}
    beside = {at - 1 if at and branches[at - 1]["fallthrough"] else at + 1 for at in thrown}
    return [each for at, each in enumerate(branches) if at not in thrown | beside]


def _either(one: tuple[bool, ...], other: tuple[bool, ...]) -> tuple[bool, ...]:
    longer, shorter = sorted((one, other), key=len, reverse=True)
    return tuple(took or (place < len(shorter) and shorter[place]) for place, took in enumerate(longer))


def main() -> int:
    """Print lines and branches by file and what is missing; 1 when that is anything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=Path, help="folder of a build with --coverage whose tests have run")
    parser.add_argument("folder", type=Path, help="folder of sources, such as core/control")
    parser.add_argument("--json", action="store_true", help="figures as one line of JSON")
    asked = parser.parse_args()
    found = lines_of(reports(asked.build), asked.folder.resolve())
    if not found:
        sys.exit(
            f"{asked.build}: nothing of {asked.folder} has run there; build with --coverage and run the tests"
        )
    branches = covered = missing = 0
    for name, lines in sorted(found.items()):
        all_of = [took for line in lines.values() for took in line.taken]
        open_lines = sorted(at for at, line in lines.items() if not line.ran or not all(line.taken))
        branches, covered, missing = branches + len(all_of), covered + sum(all_of), missing + len(open_lines)
        if not asked.json:
            where = f"; not whole: {', '.join(map(str, open_lines))}" if open_lines else ""
            print(
                f"{asked.folder / name}: {len(lines)} lines, {sum(all_of)} of {len(all_of)} branches{where}"
            )
    if asked.json:
        print(json.dumps({"folder": str(asked.folder), "branches": branches, "covered": covered}))
    else:
        print(f"{covered} of {branches} branches of {asked.folder}")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
