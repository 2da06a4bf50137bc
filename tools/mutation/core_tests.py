"""The core's own tests (core/tests): which of them pass which switch, and what they say of a change."""

from __future__ import annotations

import itertools
import json
import os
import re
import resource
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from mutation.trial import Fate

_TOGETHER_S: Final = 0.2
"""Tests below this run in one process."""


class CoreTests:
    """The tests of one program, recorded when it is new.

    Args:
        program: built with switches.
        kept: file for what was recorded, read again as long as the program is the same.
    """

    def __init__(self, program: Path, kept: Path) -> None:
        self._program = program
        made = program.stat().st_mtime_ns
        known = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
        if known.get("made") != made:
            known = {"made": made, "tests": self._record()}
            kept.write_text(json.dumps(known), encoding="utf-8")
        self._seconds: dict[str, float] = {}
        self._of: dict[int, list[str]] = {}
        for name, (took_s, seen) in sorted(known["tests"].items(), key=lambda item: item[1][0]):
            self._seconds[name] = took_s
            for number in seen:
                self._of.setdefault(number, []).append(name)

    def covering(self, number: int) -> list[str]:
        """Tests that pass the switch of a change, the quickest first."""
        return self._of.get(number, [])

    def judge(self, number: int, budget_s: float, first: Sequence[str] = ()) -> tuple[Fate, str]:
        """What these tests say of a change, and the one that found it; `first` are tried before the others.

        Args:
            budget_s: recorded time of the tests that are run at most.
        """
        took_s = itertools.accumulate(self._seconds[name] for name in self.covering(number))
        tests = [
            name for name, so_far_s in zip(self.covering(number), took_s, strict=True) if so_far_s <= budget_s
        ]
        if not tests:
            return Fate.UNCOVERED, ""
        # Each of these alone: in one process tests run in the order of their source, also behind a slow one.
        early = [name for name in tests if name in first]
        rest = [name for name in tests if name not in first]
        quick = [name for name in rest if self._seconds[name] <= _TOGETHER_S]
        slow = [[name] for name in rest if self._seconds[name] > _TOGETHER_S]
        for group in filter(None, [*([name] for name in early), quick, *slow]):
            fate, by = self._run(group, number)
            if fate is not Fate.SURVIVED:
                return fate, by
        return Fate.SURVIVED, ""

    def _run(self, tests: Sequence[str], number: int) -> tuple[Fate, str]:
        limit_s = int(5.0 + 10.0 * sum(self._seconds[name] for name in tests))
        try:
            told = subprocess.run(  # noqa: S603
                [self._program, "--gtest_fail_fast", f"--gtest_filter={':'.join(tests)}"],
                env=os.environ | {"GANTRY_MUTANT": str(number)},
                capture_output=True, text=True, check=False, errors="replace",
                timeout=20.0 * limit_s, preexec_fn=_limited_to(limit_s),
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            return Fate.TIMEOUT, ""
        if told.returncode == 0:
            return Fate.SURVIVED, ""
        failed = re.findall(r"^\[  FAILED  \] ([\w./]+)", told.stdout, re.MULTILINE)
        begun = re.findall(r"^\[ RUN      \] (\S+)", told.stdout, re.MULTILINE)
        test = failed[0] if failed else begun[-1] if begun else ""  # without a word it has crashed
        by = f"{self._program.name} {test}"
        return (Fate.TIMEOUT if told.returncode in {-signal.SIGXCPU, -signal.SIGKILL} else Fate.KILLED), by

    def _record(self) -> dict[str, tuple[float, list[int]]]:
        listed = subprocess.run(  # noqa: S603
            [self._program, "--gtest_list_tests"], capture_output=True, text=True, check=True
        ).stdout.splitlines()  # fmt: skip
        names, suite = [], ""
        for line in listed:
            if line.startswith("  "):
                names.append(suite + line.split("#")[0].strip())
            elif line.endswith(".") or ".  #" in line:
                suite = line.split("#")[0].strip()
        found = {}
        with tempfile.TemporaryDirectory() as folder:
            seen = Path(folder) / "seen"
            for name in names:
                begun = time.monotonic()
                told = subprocess.run(  # noqa: S603
                    [self._program, f"--gtest_filter={name}"],
                    env=os.environ | {"GANTRY_SEEN": str(seen), "GANTRY_MUTANT": "0"},
                    capture_output=True, check=False,
                )  # fmt: skip
                if told.returncode == 0:  # a test that fails without a change says nothing
                    numbers = [number for number, passed in enumerate(seen.read_bytes()) if passed]
                    found[name] = round(time.monotonic() - begun, 3), numbers
        return found


def _limited_to(seconds: int) -> Callable[[], None]:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    return limit
