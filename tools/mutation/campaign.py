"""Many changes, one after the other: workers, and a result file that goes on where it ended."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from mutation.mutant import Change
from mutation.operators import is_program
from mutation.private_tree import PrivateTree
from mutation.selection import Selection
from mutation.trial import Fate, Trial
from mutation.warm import NotPatched, WarmTests, fresh_run

_REMEMBERED = 12


class Worker:
    """One private tree, its collected tests, and which tests have found changes so far."""

    def __init__(self, root: Path, folder: Path, selection: Selection, changes: Sequence[Change]) -> None:
        self.tree = PrivateTree(root, folder)
        self._selection = selection
        self._chosen = {change.name: self._choose(change) for change in changes}
        files = {test.partition("::")[0] for tests in self._chosen.values() for test in tests}
        self.tree.enter()
        self._warm = WarmTests(self.tree, sorted(name for name in files if Path(name).exists()))
        self._killers: dict[str, list[str]] = {}

    def _choose(self, change: Change) -> list[str]:
        """Tests by name where they are given: also those that are newer than what was recorded."""
        return list(change.tests) or self._selection.covering(change)

    def judge(self, change: Change, budget_s: float) -> Trial:
        """Try one change with as many of its tests as fit into a time."""
        begun = time.monotonic()
        digest = digest_of(self.tree.root, change)
        chosen = self._named(self._chosen[change.name])
        first = [
            test
            for key in (f"{change.file}:{change.function}", change.file)
            for test in self._killers.get(key, [])
        ]
        covering = set(chosen)
        first = [test for test in dict.fromkeys(first) if test in covering]
        order = list(dict.fromkeys([*first, *chosen]))
        tests = list(self._selection.within(order, budget_s)) if not change.tests else order
        with self.tree.changed(change) as text:
            if not is_program(change.file, text):
                fate, by = Fate.STALE, ""
            elif not tests:
                fate, by = Fate.UNCOVERED, ""
            else:
                fate, by = self._run(change, text, tests, 20.0 + 2.0 * budget_s)
        if fate is Fate.KILLED:
            for key in (f"{change.file}:{change.function}", change.file):
                known = self._killers.setdefault(key, [])
                self._killers[key] = [by, *(test for test in known if test != by)][:_REMEMBERED]
        took_s = round(time.monotonic() - begun, 2)
        shown = change.shown(self.tree.root)
        return Trial(change.name, fate, by, len(tests), took_s, change.severe, shown, digest)

    def _named(self, chosen: Iterable[str]) -> list[str]:
        """Paths and functions as the node ids that they stand for."""
        found: list[str] = []
        for test in chosen:
            if test in self._warm.items:
                found.append(test)
            else:
                found.extend(item for item in self._warm.items if _is_below(item, test))
        return list(dict.fromkeys(found))

    def _run(self, change: Change, text: bytes, tests: list[str], cpu_s: float) -> tuple[Fate, str]:
        if self._selection.acts_at_import(change):
            return fresh_run(self.tree, tests, cpu_s)
        try:
            return self._warm.judge(change, text, tests, cpu_s)
        except NotPatched:
            return fresh_run(self.tree, tests, cpu_s)


def _is_below(test: str, place: str) -> bool:
    return test == place or test.startswith((f"{place}::", f"{place}[", f"{place.rstrip('/')}/"))


def digest_of(root: Path, change: Change) -> str:
    """Of the source and the change: a kept result holds for these."""
    text = (root / change.file).read_bytes()
    return hashlib.sha256(text + b"\0" + change.applied(text)).hexdigest()[:16]


def read_results(path: Path) -> dict[str, Trial]:
    """The last row of each change."""
    found: dict[str, Trial] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            row = json.loads(line)
            found[row["name"]] = Trial(**{**row, "fate": Fate(row["fate"])})
    return found


def left_to_try(root: Path, changes: Sequence[Change], results: Path) -> list[Change]:
    """Changes that have no row for their present text."""
    kept = read_results(results)
    return [
        change
        for change in changes
        if change.name not in kept or kept[change.name].digest != digest_of(root, change)
    ]


def keep_result(results: Path, trial: Trial) -> None:
    """Tell of a trial and append its row."""
    print(f"{trial.fate:9} {trial.seconds:6.1f} s  {trial.shown}  {trial.by}", flush=True)
    with results.open("a", encoding="utf-8") as file:
        file.write(json.dumps(trial.row()) + "\n")


def in_processes(work: Callable[[int], None], count: int) -> None:
    """Run work(0) to work(count - 1), each in a forked process.

    Raises:
        SystemExit: one of them failed; it has said why.
    """
    children = []
    for number in range(count):
        child = os.fork()
        if child == 0:
            status = 1
            try:
                work(number)
                status = 0
            except BaseException:
                traceback.print_exc()
                raise
            finally:
                os._exit(status)
        children.append(child)
    failed = [child for child in children if os.waitpid(child, 0)[1]]
    if failed:
        raise SystemExit(f"{len(failed)} workers failed; the same command goes on")


def run_all(
    root: Path, changes: Sequence[Change], coverage: Path, results: Path, *, workers: int, budget_s: float
) -> None:
    """Try every change that has no row for its present text, in as many processes as wanted."""
    left = left_to_try(root, changes, results)
    print(f"{len(changes)} changes, {len(left)} to try, {workers} workers", flush=True)
    if not left:
        return
    selection = Selection(coverage, root)
    with tempfile.TemporaryDirectory(prefix="mutants") as folder:

        def work(number: int) -> None:
            mine = left[number::workers]
            worker = Worker(root, Path(folder) / str(number), selection, mine)
            for change in mine:
                keep_result(results, worker.judge(change, budget_s))

        in_processes(work, min(workers, len(left)))
