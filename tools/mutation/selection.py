"""Which tests a change calls for: those that run its lines, the quickest first."""

from __future__ import annotations

import difflib
import functools
import json
import operator
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from mutation.areas import SOURCES
from mutation.mutant import Change

DEAR_S = 0.3
"""A shared fixture that takes longer is set up once: its tests run one after the other."""


class Selection:
    """What `python -m mutation record` has kept, seen from the sources as they are now.

    Args:
        folder: where it was kept, one part per call.
        root: of the repository; its sources may have changed since.
    """

    def __init__(self, folder: Path, root: Path) -> None:
        self._root = root
        self._parts = [_Part(path, root) for path in sorted(folder.glob("tests.*.json"))]
        if not self._parts:
            raise SystemExit(f"{folder} holds no recorded coverage: python -m mutation record first")
        self._seconds: dict[str, float] = {}
        self._fixtures: dict[str, list[str]] = {}
        self._fixture_s: dict[str, float] = {}
        self._users: dict[str, list[str]] = {}
        for part in self._parts:
            self._fixture_s |= part.fixtures
            for test, facts in part.tests.items():
                if facts["passed"]:
                    self._seconds[test] = facts["seconds"]
                    self._fixtures[test] = facts["fixtures"]
                    for fixture in facts["fixtures"]:
                        self._users.setdefault(fixture, []).append(test)

    @property
    def tests(self) -> Mapping[str, float]:
        """Seconds of every test that passed, by node id."""
        return self._seconds

    def covering(self, change: Change) -> list[str]:
        """Tests that run what changes, the quickest first; those of one dear fixture together."""
        return self._in_order(self._expanded(self._contexts(change)))

    def _contexts(self, change: Change) -> set[str]:
        if change.function and (found := self._of_function(change)):
            return found
        # What is defined when a module is imported acts where its name stands.
        words = re.compile(rf"\b({'|'.join(map(re.escape, change.names))})\b") if change.names else None
        found = set()
        for file in sorted((self._root / SOURCES).rglob("*.py")) if words else ():
            text = _text(file)
            places = [
                number for number, line in enumerate(text.split("\n"), 1) if words and words.search(line)
            ]
            if places:
                found |= self._of_lines(str(file.relative_to(self._root)), places)
        return (found or self._of_lines(change.file, range(1, 10_000))) | self._of_importers(change.file)

    def _of_function(self, change: Change) -> set[str]:
        found = self._of_lines(change.file, range(change.line, change.end_line + 1))
        return found or self._of_lines(change.file, [_statement_line(self._root, change)])

    def acts_at_import(self, change: Change) -> bool:
        """Whether no test runs what changes: it runs when a module is imported, and its tests need a fresh process."""
        return not change.function or not self._of_function(change)

    def _of_importers(self, file: str) -> set[str]:
        """Tests of files that import this module by its name: what it has made by then they see."""
        *above, name = Path(file).with_suffix("").parts[1:]
        parent = re.escape(".".join(above))
        words = re.compile(rf"\b{parent}\.{name}\b|\bfrom {parent} import [^()\n]*\b{name}\b")
        files = {test.partition("::")[0] for test in self._seconds}
        chosen = {file for file in files if words.search(_text(self._root / file))}
        return {test for test in self._seconds if test.partition("::")[0] in chosen}

    def _of_lines(self, file: str, lines: Iterable[int]) -> set[str]:
        wanted = list(lines)
        return {context for part in self._parts for context in part.contexts(file, wanted)} - {""}

    def _expanded(self, contexts: Iterable[str]) -> set[str]:
        found = set()
        for context in contexts:
            if context in self._users:
                found.update(self._users[context])
            elif context in self._seconds:
                found.add(context)
        return found

    def _in_order(self, tests: Iterable[str]) -> list[str]:
        groups: dict[tuple[str, ...], list[str]] = {}
        for test in tests:
            dear = tuple(name for name in self._fixtures[test] if self._fixture_s.get(name, 0.0) > DEAR_S)
            groups.setdefault(dear or (test,), []).append(test)
        for group in groups.values():
            group.sort(key=lambda test: (self._seconds[test], test))

        def cost(item: tuple[tuple[str, ...], list[str]]) -> tuple[float, str]:
            names, group = item
            return sum(self._fixture_s.get(name, 0.0) for name in names) + self._seconds[group[0]], group[0]

        return [test for _, group in sorted(groups.items(), key=cost) for test in group]

    def within(self, tests: Iterable[str], budget_s: float) -> Iterator[str]:
        """As many of them as fit into a time, fixtures included."""
        left_s, ready = budget_s, set()
        for test in tests:
            fresh = [name for name in self._fixtures.get(test, []) if name not in ready]
            left_s -= self._seconds.get(test, 0.0) + sum(self._fixture_s.get(name, 0.0) for name in fresh)
            ready.update(fresh)
            if left_s < 0.0:
                return
            yield test


class _Part:
    """One recorded part: its tests, and contexts by line of the sources as they are now."""

    def __init__(self, path: Path, root: Path) -> None:
        kept = json.loads(path.read_text(encoding="utf-8"))
        self.tests, self.fixtures = kept["tests"], kept["fixtures"]
        self._contexts, self._lines, self._texts = kept["contexts"], kept["lines"], kept["texts"]
        self._root = root
        self._by_file: dict[str, dict[int, int]] = {}

    def contexts(self, file: str, lines: Iterable[int]) -> Iterator[str]:
        if file not in self._by_file:
            self._by_file[file] = self._now(file)
        kept = self._by_file[file]
        bits = 0
        for line in lines:
            bits |= kept.get(line, 0)
        return (name for number, name in enumerate(self._contexts) if bits >> number & 1)

    def _now(self, file: str) -> dict[int, int]:
        found = {int(line): int(bits, 16) for line, bits in self._lines.get(file, {}).items()}
        then, now = self._texts.get(file, ""), _text(self._root / file)
        if then == now or not found:
            return found
        # A line that is new takes the tests of the lines around it.
        moved: dict[int, int] = {}
        matcher = difflib.SequenceMatcher(None, then.split("\n"), now.split("\n"), autojunk=False)
        for tag, a, b, c, d in matcher.get_opcodes():
            if tag == "equal":
                moved |= {c + step: found[a + step] for step in range(1, b - a + 1) if a + step in found}
            elif d > c:
                around = functools.reduce(operator.or_, (found.get(line, 0) for line in range(a, b + 2)), 0)
                moved |= dict.fromkeys(range(c + 1, d + 1), around)
        return moved


@functools.cache
def _text(path: Path) -> str:
    return path.read_text(encoding="utf-8") if path.exists() else ""


def _statement_line(root: Path, change: Change) -> int:
    """The last line before the change that begins with a statement of its own: where coverage counts it."""
    lines = _text(root / change.file).split("\n")
    for number in range(change.line, 0, -1):
        indent = len(lines[number - 1]) - len(lines[number - 1].lstrip())
        if lines[number - 1].strip() and indent < len(lines[change.line - 1]) - len(
            lines[change.line - 1].lstrip()
        ):
            return number
    return change.line
