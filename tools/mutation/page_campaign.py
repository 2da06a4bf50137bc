"""Planted bugs of the operator page: tried by vitest in a copy of `hmi/`, one after the other.

Such a bug names its tests, files below `hmi/tests`: nothing records what a test of the page runs.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from mutation.campaign import digest_of, keep_result, left_to_try
from mutation.mutant import Change
from mutation.trial import Fate, Trial

FOLDER: Final = "hmi"
_MODULES: Final = "node_modules"
_VITEST: Final = (f"{_MODULES}/vitest/vitest.mjs", "run", "--bail", "1", "--no-color")


def is_page(change: Change) -> bool:
    """Whether a change is one of the page."""
    return change.file.startswith(f"{FOLDER}/")


def run_page(root: Path, changes: Sequence[Change], results: Path, *, budget_s: float) -> None:
    """Try every change that has no row for its present text.

    Raises:
        SystemExit: the tools of the page are not installed, or a bug names no tests of the page.
    """
    left = left_to_try(root, changes, results)
    print(f"{len(changes)} changes of the page, {len(left)} to try", flush=True)
    if not left:
        return
    if not (root / FOLDER / _MODULES).is_dir():
        raise SystemExit("the tools of the page are not installed: make page-check")
    with tempfile.TemporaryDirectory(prefix="page") as folder:
        copy = Path(folder)
        shutil.copytree(root / FOLDER, copy / FOLDER, ignore=shutil.ignore_patterns(_MODULES))
        (copy / FOLDER / _MODULES).symlink_to(root.resolve() / FOLDER / _MODULES)
        for change in left:
            keep_result(results, _judge(copy, change, budget_s))


def _judge(copy: Path, change: Change, budget_s: float) -> Trial:
    tests = [test.removeprefix(f"{FOLDER}/") for test in change.tests]
    if not tests or not all((copy / FOLDER / test).is_file() for test in tests):
        raise SystemExit(f"{change.name}: name its tests, files below {FOLDER}/tests")
    begun, digest, shown = time.monotonic(), digest_of(copy, change), change.shown(copy)
    path = copy / change.file
    source = path.read_bytes()
    path.write_bytes(change.applied(source))
    try:
        fate, by = _run(copy / FOLDER, tests, 60.0 + 10.0 * budget_s)
    finally:
        path.write_bytes(source)
    took_s = round(time.monotonic() - begun, 2)
    return Trial(change.name, fate, by, len(tests), took_s, change.severe, shown, digest)


def _run(folder: Path, tests: Sequence[str], limit_s: float) -> tuple[Fate, str]:
    with subprocess.Popen(  # noqa: S603 - the tests of this repository
        ["node", *_VITEST, *tests],  # noqa: S607
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            told, _ = process.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return Fate.TIMEOUT, ""
    return fate_of(process.returncode, told)


def fate_of(code: int, told: str) -> tuple[Fate, str]:
    """What vitest says of a change, and the test that has found it; a file that does not compile is no program."""
    if code == 0:
        return Fate.SURVIVED, ""
    failed = [line.strip() for line in told.split("\n") if line.lstrip().startswith("FAIL ")]
    if "Failed Tests" not in told or not failed:
        return Fate.STALE, ""
    return Fate.KILLED, failed[0].removeprefix("FAIL ").strip()
