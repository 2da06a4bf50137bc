"""Figures of the service under load: they go into docs/evidence; limits here are wide."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from gantryctl.service.journal import read_journal, verify
from service_process import Page, Service, add_users

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux"),
    pytest.mark.slow,
    pytest.mark.timeout(900),
]
Evidence = Callable[[str, dict[str, object]], None]
ROLES = ("viewer", "operator", "physicist", "service", "admin")
SLICE_S = 10.0


def processor_s(process: int) -> float:
    """Processor time of a process so far."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def five_pages(service: Service) -> Iterator[list[Page]]:
    """Five browsers that look at everything, in threads of this process."""
    pages = [service.page(role) for role in ROLES]
    ended = threading.Event()

    def look(page: Page) -> None:
        while not ended.is_set():
            page.look()

    threads = [threading.Thread(target=look, args=(page,)) for page in pages]
    for thread in threads:
        thread.start()
    try:
        yield pages
    finally:
        ended.set()
        for thread in threads:
            thread.join()
        for page in pages:
            page.__exit__(None, None, None)


def test_five_browsers_cost_the_gateway_little(tmp_path: Path, evidence: Evidence) -> None:
    add_users(tmp_path)
    with Service(tmp_path) as service, five_pages(service):
        names = ("gateway", "controller", "recorder")
        before = {name: processor_s(service.child(name)) for name in names}
        begin = time.monotonic()
        time.sleep(2 * SLICE_S)
        passed_s = time.monotonic() - begin
        share = {name: (processor_s(service.child(name)) - before[name]) / passed_s for name in names}
    evidence(
        "service_processor", {"browsers": 5, **{f"{n}_percent": round(100 * s, 2) for n, s in share.items()}}
    )
    assert share["gateway"] < 0.05


def cyclictest(seconds: float) -> dict[str, float]:
    """p50, p99 and the worst latency of a C program on the same machine in us."""
    done = subprocess.run(
        ["cyclictest", "-q", "-m", "-p", "80", "-i", "1000", "-D", f"{seconds:.0f}", "-h", "20000"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    counts = {}
    for line in done.stdout.splitlines():
        words = line.split()
        if len(words) >= 2 and words[0].isdigit():
            counts[int(words[0])] = int(words[1])
    return {part: quantile(counts, q) for part, q in (("p50_us", 0.5), ("p99_us", 0.99), ("max_us", 1.0))}


def quantile(counts: dict[int, int], part: float) -> float:
    """Of a histogram."""
    left = part * sum(counts.values())
    for value, count in sorted(counts.items()):
        left -= count
        if left <= 0:
            return float(value)
    return float(max(counts))


@pytest.mark.skipif(shutil.which("cyclictest") is None, reason="cyclictest (rt-tests) is not installed")
def test_the_scan_wakes_like_a_c_program_beside_five_browsers_and_opc_ua(
    tmp_path: Path, evidence: Evidence
) -> None:
    """Alternating slices: a fresh service with its five browsers, then cyclictest beside the same browsers."""
    add_users(tmp_path)
    scans: list[dict[str, Any]] = []
    others: list[dict[str, float]] = []
    for _ in range(5):
        with socket.create_server(("127.0.0.1", 0)) as free:
            opcua = f"127.0.0.1:{free.getsockname()[1]}"
        with Service(tmp_path, "--opcua", opcua) as service, five_pages(service) as pages:
            time.sleep(SLICE_S)
            tags = pages[0].tags
            scans.append({"p50_us": tags["scan_lateness_p50_us"], "p99_us": tags["scan_lateness_p99_us"]})
            granted = tags["real_time"]
            others.append(cyclictest(SLICE_S))
    found = {
        "slices": 5,
        "real_time_granted": granted,
        "scan_p99_us": [row["p99_us"] for row in scans],
        "cyclictest_p99_us": [row["p99_us"] for row in others],
        "ratio_p50": round(
            statistics.median(s["p50_us"] / o["p50_us"] for s, o in zip(scans, others, strict=True)), 2
        ),
        "ratio_p99": round(
            statistics.median(s["p99_us"] / o["p99_us"] for s, o in zip(scans, others, strict=True)), 2
        ),
        "note": "the scan's quantiles are upper edges of bins of 26 %",
    }
    evidence("service_lateness", found)
    assert granted


def test_a_killed_controller_comes_back_with_power_off_and_says_how_it_ended(
    tmp_path: Path, evidence: Evidence
) -> None:
    add_users(tmp_path)
    back_s = []
    with Service(tmp_path) as service:
        for _ in range(5):
            with service.page("operator") as page:
                page.power_up()
                page.do("move", target_deg=20.0)
                page.until(lambda tags: tags["vel_act_deg_s"] > 0.5)
                epoch = page.tags["epoch"]
                os.kill(service.child("controller"), signal.SIGKILL)
                begin = time.monotonic()
                page.until(lambda tags, epoch=epoch: tags["epoch"] != epoch)  # type: ignore[misc]
                back_s.append(time.monotonic() - begin)
                assert page.tags["axis_state"] == "disabled"
                assert page.refused("move", target_deg=1.0) == "SEC-07"
                page.until(lambda tags: tags["journal_committed"] == tags["journal_sequence"])
    rows = [row.values["text"] for row in read_journal(service.directory)]
    assert sum("SYS-05" in text for text in rows) == 5
    assert verify(service.directory).wrong == ""
    evidence("service_controller_kills", {"kills": 5, "back_after_s": [round(s, 2) for s in back_s]})
    assert max(back_s) < 5.0
