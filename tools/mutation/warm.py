"""A process that has imported and collected every test, and runs some of them in a fork with a change in force."""

from __future__ import annotations

import contextlib
import gc
import os
import resource
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest
from _pytest.config import _prepareconfig
from _pytest.main import Session

from mutation.mutant import Change
from mutation.private_tree import PrivateTree
from mutation.trial import Fate

MEMORY_BYTES = 12 << 30


class NotPatched(LookupError):
    """The change is not inside a function that the import has made: the tests need a fresh process."""


class WarmTests:
    """Collected tests of a private tree.

    Args:
        tree: of which `enter` was called.
        paths: files or folders of tests.
    """

    def __init__(self, tree: PrivateTree, paths: Sequence[str]) -> None:
        self._tree = tree
        arguments = ["--capture=no", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *paths]
        null = os.open(os.devnull, os.O_RDWR)
        kept = os.dup(1)
        os.dup2(null, 1)
        try:
            self._config = _prepareconfig(arguments, [])
            self._failed: list[str] = []
            self._config.pluginmanager.register(_Failures(self._failed), "failures")
            self._config._do_configure()
            session = Session.from_config(self._config)
            self._config.hook.pytest_sessionstart(session=session)
            self._config.hook.pytest_collection(session=session)
        finally:
            os.dup2(kept, 1)
        self.items: dict[str, pytest.Item] = {item.nodeid: item for item in session.items}
        # The collection of tests may have frozen what it made (tests/conftest.py): get_objects would not tell of it.
        gc.unfreeze()
        gc.collect()
        self._functions: dict[tuple[str, str], list[FunctionType]] = {}
        for found in gc.get_objects():
            if type(found) is FunctionType and found.__code__.co_filename.startswith(str(tree.root)):
                key = found.__code__.co_filename, found.__code__.co_qualname
                self._functions.setdefault(key, []).append(found)
        gc.freeze()
        self._sound: dict[str, bool] = {}
        self._runs = 0

    def judge(self, change: Change, text: bytes, tests: Sequence[str], cpu_s: float) -> tuple[Fate, str]:
        """Run tests in this order with the change in force, as far as the first that fails.

        Raises:
            NotPatched: the change is at module or class level.
        """
        return self.judge_patched(self._patch(change, text), tests, cpu_s)

    def judge_patched(
        self, patch: Callable[[], None], tests: Sequence[str], cpu_s: float
    ) -> tuple[Fate, str]:
        """The same with a change that `patch` puts in force in the fork."""
        left = [test for test in tests if test in self.items]
        while True:
            fate, by = self._run(left, patch, cpu_s)
            if fate is not Fate.KILLED or by not in self.items or self._is_sound(by):
                return fate, by
            left = [test for test in left if test != by]

    def _is_sound(self, test: str) -> bool:
        """A test that fails without any change here says nothing."""
        if test not in self._sound:
            self._sound[test] = self._run([test], lambda: None, 600.0)[0] is Fate.SURVIVED
        return self._sound[test]

    def _patch(self, change: Change, text: bytes) -> Callable[[], None]:
        path = str(self._tree.root / change.file)
        if not change.function or (path, change.function) not in self._functions:
            raise NotPatched(change.name)
        whole, new = compile(text, path, "exec"), list[tuple[FunctionType, CodeType]]()
        # What a function has made while the module was imported, a closure in a table, has its own code.
        inner = f"{change.function}.<locals>."
        for (file, name), functions in self._functions.items():
            if file == path and (name == change.function or name.startswith(inner)):
                codes = {code.co_firstlineno: code for code in _codes(whole, name)}
                for function in functions:
                    code = codes.get(function.__code__.co_firstlineno)
                    if code is None or len(code.co_freevars) != len(function.__code__.co_freevars):
                        raise NotPatched(change.name)
                    new.append((function, code))

        def patch() -> None:
            for function, code in new:
                function.__code__ = code

        return patch

    def _run(self, tests: Sequence[str], patch: Callable[[], None], cpu_s: float) -> tuple[Fate, str]:
        self._runs += 1
        folder = self._tree.root.parent / f"{self._tree.root.name}.{os.getpid()}.tmp"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reader)
            status = 1
            try:
                self._child(tests, patch, cpu_s, writer, folder)
                status = 0
            finally:
                os._exit(status)
        os.close(writer)
        told = _read_until(reader, time.monotonic() + 10.0 * cpu_s)
        if not told.endswith("."):  # it hangs, or died
            _kill_group(child)
        _, status = os.waitpid(child, 0)
        _kill_group(child)  # what its tests have left behind
        shutil.rmtree(folder, ignore_errors=True)
        begun = [line.removeprefix("begins ") for line in told.split("\n") if line.startswith("begins ")]
        by = begun[-1] if begun else ""
        if told.endswith("survived."):
            return Fate.SURVIVED, ""
        if told.endswith("failed."):
            return Fate.KILLED, by
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) in {signal.SIGXCPU, signal.SIGKILL}:
            return Fate.TIMEOUT, by
        return Fate.KILLED, by

    def _child(
        self, tests: Sequence[str], patch: Callable[[], None], cpu_s: float, writer: int, folder: Path
    ) -> None:
        os.setsid()
        null = os.open(os.devnull, os.O_RDWR)
        for standard in (0, 1, 2):
            os.dup2(null, standard)
        limit = int(cpu_s) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        factory: Any = getattr(self._config, "_tmp_path_factory")  # noqa: B009
        factory._given_basetemp, factory._basetemp = folder / "pytest", None
        os.environ["TMPDIR"] = str(folder)
        patch()
        items = [self.items[test] for test in tests]
        for item, following in zip(items, [*items[1:], None], strict=True):
            os.write(writer, f"begins {item.nodeid}\n".encode())
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self._failed:
                os.write(writer, b"failed.")
                return
        os.write(writer, b"survived.")


class _Failures:
    def __init__(self, failed: list[str]) -> None:
        self._failed = failed

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._failed.append(report.nodeid)


def _codes(code: CodeType, qualified: str) -> Iterable[CodeType]:
    if code.co_qualname == qualified:
        yield code
        return
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant, qualified)


def _read_until(reader: int, deadline_s: float) -> str:
    told = b""
    with os.fdopen(reader, "rb", buffering=0) as stream:
        while not told.endswith(b"."):
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0 or not select.select([stream], [], [], left_s)[0]:
                break
            part = stream.read(65536)
            if not part:
                break
            told += part
    return told.decode(errors="replace")


def _kill_group(leader: int) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(leader, signal.SIGKILL)


def fresh_run(tree: PrivateTree, tests: Sequence[str], cpu_s: float) -> tuple[Fate, str]:
    """The same in a process of its own, for a change that acts when a module is imported."""
    arguments = ["-x", "-q", "-rfE", "--no-header", "--tb=no", "-p", "no:cacheprovider", "-p", "no:xdist"]
    with subprocess.Popen(  # noqa: S603 - the tests of this repository
        [sys.executable, "-m", "pytest", *arguments, *tests],
        cwd=tree.root,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        resource.prlimit(process.pid, resource.RLIMIT_CPU, (int(cpu_s) + 1, int(cpu_s) + 1))
        try:
            told, _ = process.communicate(timeout=10.0 * cpu_s)
        except subprocess.TimeoutExpired:
            _kill_group(process.pid)
            return Fate.TIMEOUT, ""
        finally:
            _kill_group(process.pid)
    if process.returncode in {-signal.SIGXCPU, -signal.SIGKILL}:
        return Fate.TIMEOUT, ""
    # A test that is not there kills nothing.
    if process.returncode == 0 or "ERROR: not found: " in told:
        return Fate.SURVIVED, ""
    failed = [line.split(" ")[1] for line in told.split("\n") if line.startswith(("FAILED ", "ERROR "))]
    return Fate.KILLED, failed[0] if failed else told[-200:]
