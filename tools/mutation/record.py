"""A pytest plugin that records which test runs which line, and how long it takes: `python -m mutation record`.

A fixture that several tests share has a context of its own: the lines it runs belong to every test that uses it.
"""

from __future__ import annotations

import functools
import importlib.util
import json
import operator
import os
import time
from collections.abc import Generator, Mapping
from pathlib import Path
from typing import Any, Protocol

import coverage
import pytest

FOLDER_VARIABLE = "GANTRYCTL_COVERAGE_FOLDER"
PART_VARIABLE = "GANTRYCTL_COVERAGE_PART"
SHARED = {"class", "module", "package", "session"}
FIXTURE = "fixture "
"""Begins the context of a shared fixture; the other contexts are the node ids of tests."""


class Tracer(Protocol):
    """What a test runs: lines of Python, or switches of the core."""

    def switch(self, context: str) -> None:
        """What is run from now on belongs to this context."""
        ...

    def kept(self) -> Mapping[str, object]:
        """What the selection reads, in a file that nothing opens for writing again.

        Returns:
            contexts: their names; lines: by file and line, the bits of its contexts as a hexadecimal number;
            texts: the sources that the line numbers belong to.
        """
        ...


class LineTracer:
    """Lines of the package, by coverage with a context for each test."""

    def __init__(self, folder: Path, part: str) -> None:
        package = importlib.util.find_spec("gantryctl")
        self._source = Path(str(package and package.origin)).parent
        self._coverage = coverage.Coverage(
            data_file=str(folder / f"coverage.{part}"),
            branch=True,
            source=[str(self._source)],
            config_file=False,
            messages=False,
        )
        self._coverage.erase()
        self._coverage.start()

    def switch(self, context: str) -> None:
        self._coverage.switch_context(context)

    def kept(self) -> Mapping[str, object]:
        self._coverage.stop()
        self._coverage.save()
        data, root = self._coverage.get_data(), self._source.parent.parent
        contexts = sorted(data.measured_contexts())
        bits = {name: 1 << number for number, name in enumerate(contexts)}
        lines, texts = {}, {}
        for path in sorted(data.measured_files()):
            file = str(Path(path).relative_to(root))
            found = data.contexts_by_lineno(path)
            lines[file] = {
                str(line): f"{functools.reduce(operator.or_, (bits[name] for name in set(names))):x}"
                for line, names in found.items()
                if names
            }
            texts[file] = Path(path).read_text(encoding="utf-8")
        return {"contexts": contexts, "lines": lines, "texts": texts}


class Recorder:
    """Contexts of a tracer by test, and what each test took.

    Attributes:
        tests: by node id: whether it passed, seconds without shared fixtures, the contexts of these.
        fixtures: seconds that a shared fixture took, by its context.
    """

    def __init__(self, folder: Path, part: str, tracer: Tracer) -> None:
        self.folder, self.part, self.tracer = folder, part, tracer
        self.tests: dict[str, dict[str, Any]] = {}
        self.fixtures: dict[str, float] = {}
        self._in_fixtures_s = 0.0
        self._context = ""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        definitions = getattr(item, "_fixtureinfo").name2fixturedefs.values()  # noqa: B009
        shared = [self._name(found[-1]) for found in definitions if found[-1].scope in SHARED]
        self.tests[item.nodeid] = {"passed": True, "seconds": 0.0, "fixtures": sorted(shared)}
        self._switch(item.nodeid)
        begun, self._in_fixtures_s = time.monotonic(), 0.0
        try:
            return (yield)
        finally:
            took_s = time.monotonic() - begun - self._in_fixtures_s
            self.tests[item.nodeid]["seconds"] = round(took_s, 4)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Generator[None, object, object]:
        if fixturedef.scope not in SHARED:
            return (yield)
        name, before, begun = self._name(fixturedef), self._context, time.monotonic()
        self._switch(name)
        inside_before, self._in_fixtures_s = self._in_fixtures_s, 0.0
        try:
            return (yield)
        finally:
            took_s = time.monotonic() - begun
            self.fixtures[name] = round(max(self.fixtures.get(name, 0.0), took_s - self._in_fixtures_s), 4)
            self._in_fixtures_s = inside_before + took_s
            self._switch(before)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.passed and report.nodeid in self.tests:
            self.tests[report.nodeid]["passed"] = False

    def pytest_sessionfinish(self) -> None:
        kept = {"tests": self.tests, "fixtures": self.fixtures, **self.tracer.kept()}
        (self.folder / f"tests.{self.part}.json").write_text(json.dumps(kept), encoding="utf-8")

    def _switch(self, context: str) -> None:
        self._context = context
        self.tracer.switch(context)

    @staticmethod
    def _name(fixturedef: Any) -> str:
        return f"{FIXTURE}{fixturedef.baseid}::{fixturedef.argname}"


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests(early_config: pytest.Config) -> None:
    """Begin before the tests' conftest imports the product."""
    folder, part = Path(os.environ[FOLDER_VARIABLE]), os.environ[PART_VARIABLE]
    recorder = Recorder(folder, part, LineTracer(folder, part))
    early_config.pluginmanager.register(recorder, "coverage recorder")
