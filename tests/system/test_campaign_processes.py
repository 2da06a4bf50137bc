"""A campaign as a process: interrupted, killed with its own workers, and among workers with other code."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from gantryctl import _core
from support.campaign_results import sorted_bytes
from support.dask_processes import ROOT, dask_cluster, kill, python

from .test_campaign_kills import campaign_file, undisturbed

_NO_EDITABLE = """
import sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in type(finder).__module__]
"""


def wait_for(what: Callable[[], object], within_s: float = 60.0) -> None:
    end = time.monotonic() + within_s
    while not what():
        assert time.monotonic() < end
        time.sleep(0.02)


def run(campaign: Path, *options: str) -> subprocess.Popen[bytes]:
    with (campaign.parent / "client.log").open("ab") as out:
        return python("gantryctl", "campaign", "run", str(campaign), *options, out=out)


@pytest.mark.slow
def test_an_interrupt_and_a_kill_lose_nothing_and_leave_no_process(tmp_path: Path) -> None:
    campaign, result = campaign_file(tmp_path, 128), tmp_path / "r"
    options = ("--out", str(result), "--workers", "2")
    first = run(campaign, *options)
    wait_for(lambda: list(result.glob("rows-*.parquet")))
    first.send_signal(signal.SIGINT)
    assert first.wait(60) == 1
    log = (tmp_path / "client.log").read_text()
    assert "the chunks under way are finished first" in log
    assert "of 128 rows are there; the same command goes on" in log
    before = len(list(result.glob("rows-*.parquet")))
    second = run(campaign, *options)
    wait_for(lambda: len(list(result.glob("rows-*.parquet"))) > before)
    workers = psutil.Process(second.pid).children(recursive=True)
    kill(second)
    wait_for(lambda: not any(worker.is_running() for worker in workers), 10.0)
    assert run(campaign, "--out", str(result), "--threads", "2").wait(120) == 0
    assert sorted_bytes(result) == undisturbed(campaign, tmp_path)


@pytest.mark.slow
def test_a_worker_with_other_code_is_refused_by_name(tmp_path: Path) -> None:
    """Same version, one file changed: alone in the cluster it ends the run, beside a right one it gets no work."""
    changed = tmp_path / "changed"
    shutil.copytree(ROOT / "src", changed / "src", ignore=shutil.ignore_patterns("page", "__pycache__"))
    units = changed / "src" / "gantryctl" / "units.py"
    units.write_text(units.read_text("utf-8") + "# changed\n", encoding="utf-8")
    # The core lies elsewhere in an editable installation, whose finder would go before any path.
    shutil.copy(_core.__file__, changed / "src" / "gantryctl")
    (changed / "src" / "sitecustomize.py").write_text(_NO_EDITABLE, encoding="utf-8")
    sources = os.pathsep.join(str(changed / part) for part in ("src", "tests"))
    campaign = campaign_file(tmp_path, 16)
    with dask_cluster(tmp_path, workers=0) as cluster:
        other = cluster.worker(PYTHONPATH=sources)
        try:
            options = ("--out", str(tmp_path / "r"), "--cluster", cluster.address)
            wait_for(lambda: "Registered to" in (tmp_path / "dask_worker.log").read_text())
            assert run(campaign, *options).wait(60) == 3
            log = (tmp_path / "client.log").read_text()
            assert "is refused: sources " in log
            assert "all of its 1 workers are refused" in log
            cluster.start(1)
            wait_for(lambda: (tmp_path / "dask_worker.log").read_text().count("Registered to") == 2)
            assert run(campaign, *options).wait(60) == 0
        finally:
            kill(other)
    assert sorted_bytes(tmp_path / "r") == undisturbed(campaign, tmp_path)
