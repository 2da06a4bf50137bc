"""What every test shares: reproducible hypothesis runs, and no silent skip in CI."""

import json
import os
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

settings.register_profile("reproducible", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("reproducible")

EVIDENCE = Path(__file__).resolve().parent.parent / "docs" / "evidence"
IN_CI = os.environ.get("CI", "").lower() == "true"


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


@pytest.fixture
def evidence(request: pytest.FixtureRequest) -> Callable[..., None]:
    """Write what a slow test measured to docs/evidence/<test>.json: `evidence(median_deg=0.0128, gears=200)`.

    Nothing is written unless slow tests were asked for, so that everyday runs leave the tree clean.
    """

    def write(**figures: Any) -> None:
        if "slow" not in request.config.getoption("markexpr").replace("not slow", ""):
            return
        EVIDENCE.mkdir(parents=True, exist_ok=True)
        text = json.dumps({"test": request.node.nodeid, **figures}, indent=2, sort_keys=True, allow_nan=False)
        (EVIDENCE / f"{request.node.name}.json").write_text(text + "\n", encoding="utf-8")

    return write
