"""Changes of the core (C++), one after the other: its own tests first, then those in Python that pass the switch."""

from __future__ import annotations

import ctypes
import os
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import pytest

from mutation.areas import CORE_AREAS, area_files
from mutation.campaign import digest_of, in_processes, keep_result, left_to_try
from mutation.core_build import CoreBuild
from mutation.core_tests import CoreTests
from mutation.cpp_operators import cpp_mutants
from mutation.mutant import Change
from mutation.planted import FOLDER, StaleBug, change_of, read_bugs
from mutation.record import Recorder
from mutation.selection import Selection
from mutation.trial import FOUND, Fate, Trial
from mutation.warm import WarmTests


def is_core(change: Change) -> bool:
    """Whether a change is one of the core."""
    return change.file.startswith("core/")


def all_core_changes(root: Path) -> list[Change]:
    """Every mutant of the core and every bug planted there: one build serves them all."""
    planted = []
    for bug in read_bugs(root / FOLDER / "core.toml"):
        with suppress(StaleBug):  # `planted` and a test of the fast suite tell of it
            planted.append(change_of(bug, "core", root))
    found = [
        change
        for area in CORE_AREAS
        for file in area_files(area, root)
        for change in cpp_mutants(str(file), (root / file).read_bytes())
    ]
    return [*planted, *found]


class SwitchTracer:
    """Which switches each test passes; the same answers as the tracer of lines in record.py.

    Args:
        build: whose extension the tests import.
        root: of the repository, whose sources the lines belong to.
    """

    def __init__(self, build: CoreBuild, root: Path) -> None:
        library = ctypes.CDLL(str(build.module))
        self._seen = (ctypes.c_ubyte * build.count).in_dll(library, "gantry_seen")
        self._build, self._root = build, root
        self._of: dict[str, bytes] = {}
        self._context = ""

    def switch(self, context: str) -> None:
        """What is passed from now on belongs to this context."""
        now = bytes(self._seen)
        before = self._of.get(self._context)
        self._of[self._context] = bytes(map(max, now, before)) if before else now
        ctypes.memset(self._seen, 0, len(now))
        self._context = context

    def kept(self) -> dict[str, object]:
        """Contexts and lines as record.py describes them."""
        self.switch("")
        contexts = sorted(self._of)
        bits: dict[str, dict[str, int]] = {}
        for place, context in enumerate(contexts):
            for number, passed in enumerate(self._of[context]):
                if passed and number:
                    file, line = self._build.place(number)
                    found = bits.setdefault(file, {})
                    found[str(line)] = found.get(str(line), 0) | 1 << place
        return {
            "contexts": contexts,
            "lines": {
                file: {line: f"{some:x}" for line, some in found.items()} for file, found in bits.items()
            },
            "texts": {file: (self._root / file).read_text(encoding="utf-8") for file in bits},
        }


def record_core(root: Path, build: Path, folder: Path, part: str, tests: Sequence[str]) -> int:
    """Run these tests once on the switched core and keep which of them passes which change."""
    core = CoreBuild(root, build, all_core_changes(root))
    folder.mkdir(parents=True, exist_ok=True)
    folder = folder.resolve()
    child = os.fork()
    if child == 0:
        status = 1
        try:
            core.tree.enter()
            recorder = Recorder(folder, part, SwitchTracer(core, root))
            options = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--timeout", "900", *tests]
            status = int(pytest.main(options, plugins=[recorder]))
        finally:
            os._exit(status)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def run_core(
    root: Path,
    build: Path,
    changes: Sequence[Change],
    coverage: Path,
    results: Path,
    *,
    workers: int,
    budget_s: float,
) -> None:
    """Try every change that has no row for its present text."""
    left = left_to_try(root, changes, results)
    print(f"{len(changes)} changes of the core, {len(left)} to try", flush=True)
    if not left:
        return
    core = CoreBuild(root, build, all_core_changes(root))
    own = [CoreTests(program, build / f"{program.name}.json") for program in core.programs]
    selection = Selection(coverage, root) if any(coverage.glob("tests.*.json")) else None
    if selection is None:
        print(f"{coverage} holds no recorded tests in Python: only the core's own are used", flush=True)
    in_processes(
        lambda number: _Worker(root, core, own, selection).work(left[number::workers], results, budget_s),
        min(workers, len(left)),
    )


class _Worker:
    def __init__(
        self, root: Path, core: CoreBuild, own: Sequence[CoreTests], selection: Selection | None
    ) -> None:
        self._root, self._core, self._own, self._selection = root, core, own, selection
        self._killers: dict[str, list[str]] = {}
        self._warm: WarmTests | None = None

    def work(self, changes: Sequence[Change], results: Path, budget_s: float) -> None:
        """The core's own tests of every change, then the tests in Python of what they have not found."""
        survivors = []
        for change in changes:
            begun = time.monotonic()
            if change.name not in self._core.numbers:
                self._tell(results, change, Fate.STALE, "", 0, begun)
                continue
            number = self._core.numbers[change.name]
            killers = [each for key in (change.function, change.file) for each in self._killers.get(key, [])]
            first = [*change.tests, *killers]
            fate, by = self._by_own(number, budget_s, first)
            if fate in FOUND or not self._in_python(change, budget_s):
                self._tell(results, change, fate, by, self._own_tests(number), begun)
                for key in (change.function, change.file) if fate is Fate.KILLED else ():
                    known = self._killers.setdefault(key, [])
                    name = by.partition(" ")[2]
                    self._killers[key] = [name, *(each for each in known if each != name)][:4]
            else:
                survivors.append(change)
        if survivors:
            self._by_python(survivors, results, budget_s)

    def _by_own(self, number: int, budget_s: float, first: Sequence[str]) -> tuple[Fate, str]:
        """What the core's own tests say, one program after the other."""
        fates = []
        for tests in self._own:
            fate, by = tests.judge(number, budget_s, first)
            if fate in FOUND:
                return fate, by
            fates.append(fate)
        return (Fate.SURVIVED if Fate.SURVIVED in fates else Fate.UNCOVERED), ""

    def _own_tests(self, number: int) -> int:
        return sum(len(tests.covering(number)) for tests in self._own)

    def _in_python(self, change: Change, budget_s: float) -> list[str]:
        if self._selection is None:
            return []
        return list(self._selection.within(self._selection.covering(change), budget_s))

    def _by_python(self, changes: Sequence[Change], results: Path, budget_s: float) -> None:
        chosen = {change.name: self._in_python(change, budget_s) for change in changes}
        files = sorted({test.partition("::")[0] for tests in chosen.values() for test in tests})
        self._core.tree.enter()
        warm = WarmTests(self._core.tree, [name for name in files if Path(name).exists()])
        killers: list[str] = []
        for change in changes:
            begun = time.monotonic()
            number = self._core.numbers[change.name]
            tests = chosen[change.name]
            first = [test for test in killers if test in tests]
            order = list(dict.fromkeys([*first, *tests]))
            fate, by = warm.judge_patched(_switch_on(self._core, number), order, 20.0 + 2.0 * budget_s)
            if fate is Fate.KILLED:
                killers = [by, *(test for test in killers if test != by)][:12]
            count = self._own_tests(number) + len(tests)
            self._tell(results, change, fate, by, count, begun)

    def _tell(self, results: Path, change: Change, fate: Fate, by: str, count: int, begun: float) -> None:
        shown = change.shown(self._root)
        took_s = round(time.monotonic() - begun, 2)
        digest = digest_of(self._root, change)
        keep_result(results, Trial(change.name, fate, by, count, took_s, change.severe, shown, digest))


def _switch_on(core: CoreBuild, number: int) -> Callable[[], None]:
    def switch_on() -> None:
        library = ctypes.CDLL(str(core.module))
        ctypes.c_int.in_dll(library, "gantry_mutant").value = number
        os.environ["GANTRY_MUTANT"] = str(number)  # for processes that a test starts

    return switch_on
