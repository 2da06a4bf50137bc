"""A Dask cluster of real processes on loopback, and a campaign run beside them; each may be killed."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np

from gantryctl.engineering.campaign.job import INDEX
from support.campaign_results import rows_of

ROOT = Path(__file__).parents[2]
WORKERS = 2
_LOCAL = ("--host", "127.0.0.1", "--no-dashboard")


class DaskCluster:
    """Scheduler and workers.

    Args:
        folder: for what they print.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self._port = probe.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"
        self.scheduler: subprocess.Popen[bytes] | None = None
        self.workers: list[subprocess.Popen[bytes]] = []

    def start(self, workers: int = WORKERS) -> None:
        """Start what is not there."""
        if self.scheduler is None:
            self.scheduler = self._python(
                "distributed.cli.dask_scheduler", "--port", str(self._port), *_LOCAL
            )
        # Without its scheduler a worker ends.
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while len(self.workers) < workers:
            self.workers.append(self.worker())

    def worker(self, **environment: str) -> subprocess.Popen[bytes]:
        """One more worker, with this in its environment."""
        options = ("--no-nanny", "--nthreads", "1", "--local-directory", str(self._folder), *_LOCAL)
        return self._python("distributed.cli.dask_worker", self.address, *options, **environment)

    def kill_worker(self, which: int) -> None:
        """SIGKILL for one worker."""
        kill(self.workers.pop(which))

    def kill_scheduler(self) -> None:
        """SIGKILL for the scheduler; the workers end by themselves."""
        assert self.scheduler is not None
        kill(self.scheduler)
        self.scheduler = None
        for worker in self.workers:
            kill(worker)
        self.workers.clear()

    def close(self) -> None:
        """Kill everything."""
        if self.scheduler is not None:
            self.kill_scheduler()

    def _python(self, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        log = self._folder / f"{arguments[0].rpartition('.')[2]}.log"
        with log.open("ab") as out:
            return python(*arguments, out=out, environment=environment)


def python(
    *arguments: str, out: BinaryIO | None = None, environment: dict[str, str] | None = None
) -> subprocess.Popen[bytes]:
    """`python -m` with these sources."""
    sources = os.pathsep.join(str(ROOT / part) for part in ("src", "tests"))
    return subprocess.Popen(
        [sys.executable, "-m", *arguments],
        stdout=out,
        stderr=out,
        env=os.environ | {"PYTHONPATH": sources} | (environment or {}),
    )


def kill(process: subprocess.Popen[bytes]) -> None:
    """SIGKILL, and wait for the end."""
    process.send_signal(signal.SIGKILL)
    process.wait()


@contextmanager
def dask_cluster(folder: Path, workers: int = WORKERS) -> Iterator[DaskCluster]:
    """A running cluster."""
    cluster = DaskCluster(folder)
    try:
        cluster.start(workers)
        yield cluster
    finally:
        cluster.close()


def run_among_kills(
    campaign: Path, folder: Path, kills: Sequence[str], within_s: float, rng: random.Random
) -> None:
    """`campaign run` on a cluster, while "worker", "scheduler" and "client" are killed at random moments.

    Each kill waits for rows that came after the one before, and for a moment in the middle of a chunk. Files are merged
    all the time, and read: rows that are there never become fewer, nor more than there are.
    """
    result = folder / "killed.result"
    end = time.monotonic() + within_s
    most = 0

    def client() -> subprocess.Popen[bytes]:
        with (folder / "client.log").open("ab") as out:
            arguments = ("campaign", "run", str(campaign), "--out", str(result))
            return python("support.merging_client", *arguments, "--cluster", cluster.address, out=out)

    def rows() -> int:
        nonlocal most
        found = rows_of(result, [INDEX])[INDEX] if list(result.glob("rows-*.parquet")) else np.empty(0)
        assert len(np.unique(found)) == len(found) >= most
        most = len(found)
        return most

    with dask_cluster(folder) as cluster:
        running = client()
        try:
            for what in kills:
                before = rows()
                while rows() == before:
                    assert running.poll() is None, (folder / "client.log").read_text()[-2000:]
                    assert time.monotonic() < end, f"no rows after {kills}: {what} is next"
                    time.sleep(0.02)
                time.sleep(rng.uniform(0.0, 0.6))
                match what:
                    case "worker":
                        cluster.kill_worker(rng.randrange(len(cluster.workers)))
                    case "scheduler":
                        cluster.kill_scheduler()
                    case "client":
                        kill(running)
                        running = client()
                cluster.start()
            assert running.wait(max(1.0, end - time.monotonic())) == 0, (folder / "client.log").read_text()
        finally:
            if running.poll() is None:
                kill(running)
