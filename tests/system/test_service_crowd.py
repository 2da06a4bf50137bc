"""A thousand rude clients of this machine: Stop works from an open page as before, and a new page gets in.

INV-9: no client can hold a place that others need.
"""

from __future__ import annotations

import os
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

from support.fuzz.judge import Judge, Record
from support.hostile import KINDS
from support.new_page import Browser, files_of
from support.service_process import Service, add_users

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux"),
    pytest.mark.slow,
]
Evidence = Callable[[str, dict[str, object]], None]
HOSTILE = Path(__file__).parents[1] / "support" / "hostile.py"
CLIENTS = 1000
CHILDREN = ("controller", "recorder", "gateway")
CALM_S, CROWD_S, EVERY_S = 8.0, 45.0, 0.5
STOP_MAX_S, NEW_PAGE_MAX_S = 0.1, 2.0
BUSY_PAGE_MAX_S = 10.0
"""On a computer that has more to do than it can: Stop has a limit there too, that of the judge."""
NOBODY = 65534
"""Another user than the operator's, where this test may choose one."""


@contextmanager
def crowd(service: Service, uid: int | None) -> Iterator[None]:
    """All of them at the service, as a user of the system, with the session of somebody who may only look."""
    host, _, port = service.address.partition(":")
    browser = Browser(service.address)
    file = next(iter(files_of(browser.ask("GET", "/")[0])), "/")
    browser.close()
    options = ["--session", service.log_in("viewer"), "--file", file]
    options += [] if uid is None else ["--uid", str(uid)]
    command = [sys.executable, str(HOSTILE), port, str(CLIENTS), f"{host}:{port}", *options]
    clients = subprocess.Popen(command, stdout=subprocess.PIPE)
    try:
        assert clients.stdout is not None
        assert clients.stdout.readline() == b"holding\n"
        yield
        assert clients.poll() is None
    finally:
        clients.kill()
        clients.communicate()


def ran_and_waited_s(process: int) -> tuple[float, float]:
    """Time that a process has had a processor, and time that it has waited for one (`proc(5)`, schedstat)."""
    ran_ns, waited_ns, _ = Path(f"/proc/{process}/schedstat").read_text(encoding="ascii").split()
    return int(ran_ns) * 1e-9, int(waited_ns) * 1e-9


def figures(record: Record) -> dict[str, Any]:
    """What a judge has seen."""
    return {
        "stops": len(record.stops_s),
        "stop_median_s": round(statistics.median(record.stops_s), 3),
        "stop_longest_s": round(max(record.stops_s), 3),
        "new_pages": len(record.new_pages_s),
        "new_page_median_s": round(statistics.median(record.new_pages_s), 2),
        "new_page_longest_s": round(max(record.new_pages_s), 2),
        "asked_again": record.asked_again,
        "scans_hz_least": round(min(record.scans_hz)),
        "faults": record.faults,
    }


@pytest.mark.parametrize("uid", [NOBODY, None], ids=["of_another_user", "of_the_same_user"])
def test_a_thousand_rude_clients_delay_neither_stop_nor_a_new_page(
    tmp_path: Path, evidence: Evidence, uid: int | None
) -> None:
    """Clients of the operator's own user use up that user's logins: there, the page is opened with a session."""
    if uid is not None and os.geteuid() != 0:
        pytest.skip("only root starts clients of another user")
    add_users(tmp_path)
    before = os.getloadavg()
    with Service(tmp_path) as service:
        session = service.log_in("service") if uid is None else ""
        with Judge(service, threading.Event(), CHILDREN, session) as judge:
            judge.watch(time.monotonic() + CALM_S, EVERY_S)
            calm, judge.record = judge.record, Record()
            with crowd(service, uid):
                ran_s, waited_s = ran_and_waited_s(service.child("gateway"))
                judge.watch(time.monotonic() + CROWD_S, EVERY_S)
                ran_then_s, waited_then_s = ran_and_waited_s(service.child("gateway"))
    gateway = {
        "gateway_ran_s": round(ran_then_s - ran_s, 1),
        "gateway_waited_for_a_processor_s": round(waited_then_s - waited_s, 1),
    }
    found = {"calm": figures(calm), "crowd": figures(judge.record) | gateway}
    about = {"clients": CLIENTS, "kinds": list(KINDS), "load_average_before": before}
    name = "service_crowd_same_user" if uid is None else "service_crowd"
    evidence(name, {**about, **found, "load_average": os.getloadavg()})
    assert found["calm"]["faults"] == found["crowd"]["faults"] == []
    assert [line for line in service.errors().splitlines() if not line.startswith("journal anchor:")] == []
    busy = before[0] > 1.5 * (os.cpu_count() or 1)
    assert busy or found["crowd"]["stop_longest_s"] < STOP_MAX_S, found
    assert found["crowd"]["new_page_longest_s"] < (BUSY_PAGE_MAX_S if busy else NEW_PAGE_MAX_S), found
