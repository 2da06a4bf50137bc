"""What every test shares: reproducible hypothesis runs and fresh ones, the oracle, and no silent skip in CI."""

import atexit
import gc
import importlib.util
import json
import os

# Before numpy is loaded, and for the processes that tests start: the threads of OpenBLAS wait busily, and three
# workers on two processors then use a third more processor time for identification (30 s for 22 s were measured).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis.database import DirectoryBasedExampleDatabase

from gantryctl.engineering.faults.oracle.taps import Oracle, tapped, watching
from gantryctl.operation.store import STATE_VARIABLE
from gantryctl.service.recorder.journal.places import KEYS_VARIABLE

settings.register_profile("reproducible", derandomize=True, deadline=None, print_blob=True)
# Other examples in every run; what fails is kept in a directory, tried first in the next run, and printed with the
# line that repeats it. `make test-slow` runs it (CONTRIBUTING.md: how a found example becomes a test).
settings.register_profile(
    "fresh",
    derandomize=False,
    deadline=None,
    print_blob=True,
    database=DirectoryBasedExampleDatabase(Path(__file__).resolve().parent.parent / ".hypothesis" / "found"),
)
settings.load_profile("reproducible")

EVIDENCE = Path(__file__).resolve().parent.parent / "docs" / "evidence"
BUS_TESTS = "pytestmark = pytest.mark.can\n"
"""Stands in a test module that imports the CANopen master."""
IN_CI = os.environ.get("CI", "").lower() == "true"


def has_canopen() -> bool:
    try:
        return importlib.util.find_spec("gantryctl.drives.canopen") is not None
    except ModuleNotFoundError:
        return False


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Where drives/canopen is removed, the modules of its tests cannot even be imported."""
    if collection_path.suffix != ".py" or has_canopen():
        return None
    return BUS_TESTS in collection_path.read_text(encoding="utf-8") or None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected lives to the end: the garbage collector need not look through these 700,000 objects.

    It took 5 of the 13 s of a collection, and 0.7 s of a processor each time that it looked at all objects afterwards.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


# What is left at the end of the process, nanobind calls leaked. Not before: pytest collects several times while it
# ends, 2 s of a processor in each worker.
atexit.register(gc.unfreeze)


LONGEST = (
    "system/test_vcan.py",
    "system/page/",
    "system/test_brake_test_service.py",
    "system/test_readme.py",
    "faults/test_reactions.py",
    "comparison/test_drift.py",
)
"""What takes half a minute to two goes first: at the end one worker would run it alone."""


HANGS_AFTER_S = {"fast": 600.0, "slow": 86_400.0}
"""No test has a limit of its own: a busy computer would reach it, and the result would tell of the computer. These
are for what hangs: the longest fast test takes a minute on a quiet computer, the longest slow one hours. `--timeout`
stands above them.
"""


def pytest_collection_modifyitems(items: list[pytest.Item], config: pytest.Config) -> None:
    if config.getoption("timeout") is None:
        for item in items:
            kind = "fast" if item.get_closest_marker("slow") is None else "slow"
            item.add_marker(pytest.mark.timeout(HANGS_AFTER_S[kind]))

    def turn(item: pytest.Item) -> int:
        path = item.path.as_posix()
        return next((turn for turn, part in enumerate(LONGEST) if part in path), len(LONGEST))

    items.sort(key=turn)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object | None:
    """Of `--dist loadfile`: whole files, some of them first, not too many services at a time."""
    if config.getoption("dist") != "loadfile":
        return None
    from support.in_files import InFiles

    return InFiles(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """In CI a skipped test is a failure: something that should be installed is not."""
    report = yield
    return fail_if_skipped(report)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """The same for a module that skips itself while it is imported."""
    report = yield
    return fail_if_skipped(report)


def fail_if_skipped(report: Any) -> Any:
    if IN_CI and report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid}: {reason} (CI=true: nothing may be skipped)"
    return report


@pytest.fixture(scope="session", autouse=True)
def states(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where the machines of all tests keep what they know; fixtures that several tests share find a folder too."""
    folder = tmp_path_factory.mktemp("states")
    with pytest.MonkeyPatch.context() as session:
        session.setenv(STATE_VARIABLE, str(folder / "shared"))
        yield folder


@pytest.fixture(autouse=True)
def state_of_its_own(states: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """No test finds the machines of another, nor those of the person who runs it."""
    monkeypatch.setenv(STATE_VARIABLE, str(states / f"{hash(request.node.nodeid):x}"))


@pytest.fixture
def keys(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the keys of this test's journals are: for tests whose state directory is the folder of the test."""
    folder = tmp_path_factory.mktemp("keys")
    monkeypatch.setenv(KEYS_VARIABLE, str(folder))
    return folder


@pytest.fixture(scope="session", autouse=True)
def oracle_taps() -> Iterator[None]:
    """Where the oracle looks: once for all tests."""
    with tapped():
        yield


@pytest.fixture(autouse=True)
def oracle() -> Iterator[Oracle]:
    """Watches the true plant and the wire of every axis that a test moves (INV-1 to INV-7).

    No test is excused: one that breaks an invariant on purpose takes what it expects out (`oracle.caught`).
    """
    judge = Oracle()
    with watching(judge):
        yield judge
    broken = "\n".join(map(str, judge.violations))
    if broken:
        pytest.fail(f"the oracle saw:\n{broken}", pytrace=False)


EVIDENCE_DIGITS = 5


def rounded(figures: object) -> object:
    """Figures to five digits: what is measured is known to three, and the last of sixteen is the computer's."""
    if isinstance(figures, float):
        return float(f"{figures:.{EVIDENCE_DIGITS}g}")
    if isinstance(figures, dict):
        return {key: rounded(value) for key, value in figures.items()}
    if isinstance(figures, list | tuple):
        return [rounded(value) for value in figures]
    return figures


@pytest.fixture(scope="session")
def evidence(pytestconfig: pytest.Config) -> Callable[[str, dict[str, object]], None]:
    """Keeps what a slow test measured as docs/evidence/<name>.json; only when slow tests were asked for."""
    wanted = "slow" in pytestconfig.getoption("markexpr").replace("not slow", "")

    def write(name: str, figures: dict[str, object]) -> None:
        if wanted:
            EVIDENCE.mkdir(parents=True, exist_ok=True)
            text = json.dumps(rounded(figures), indent=2, allow_nan=False) + "\n"
            (EVIDENCE / f"{name}.json").write_text(text, encoding="utf-8")

    return write
