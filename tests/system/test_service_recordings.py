"""Recordings of a real service: thin at rest, whole around what happens, and no half-made file left by any end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from gantryctl.service.recorder.row_filter import AFTER_S, BEFORE_S
from gantryctl.trace.naming import number_of, oldest_first
from gantryctl.trace.reader import read_trace
from support.service_process import PATIENCE_S, Page, Service, add_users

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")


def files(service: Service) -> dict[int, str]:
    """Endings of the recordings by their numbers."""
    return {number_of(file): "".join(file.suffixes) for file in (service.directory / "traces").iterdir()}


def wait(holds: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < end_s
        time.sleep(0.05)


def on(service: Service) -> Page:
    page = service.page("operator")
    page.power_up()
    page.until(lambda tags: bool(tags["recording"]))
    return page


def kill_all(service: Service) -> None:
    """At once, the first process last: it starts nothing again."""
    found = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(service.process.pid)], capture_output=True, text=True, check=True
    )
    pids = [service.process.pid, *map(int, found.stdout.split())]
    os.kill(service.process.pid, signal.SIGSTOP)
    for pid in reversed(pids):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    service.process.wait(PATIENCE_S)


@pytest.mark.slow
def test_every_end_leaves_closed_files_and_rest_is_thin(tmp_path: Path) -> None:
    add_users(tmp_path)
    with Service(tmp_path) as service:
        with on(service) as page:
            # Another recorder goes on with the file.
            os.kill(service.child("recorder"), signal.SIGKILL)
            begin_s = page.tags["time_s"]
            page.until(lambda tags: tags["time_s"] > begin_s + AFTER_S + BEFORE_S + 3.0)
            page.do("set", tag="speed_setting_deg_s", value=2.0)
            at_s = page.tags["time_s"]
            page.until(lambda tags: tags["time_s"] > at_s + 1.0)
            # A controller that is gone ends its recording with the next one's start.
            os.kill(service.child("controller"), signal.SIGKILL)
        wait(lambda: files(service) == {1: ".parquet"})
        with on(service):
            kill_all(service)
    assert files(service)[2] == ".arrows"
    with Service(tmp_path) as service:
        wait(lambda: files(service) == {1: ".parquet", 2: ".parquet"})
        on(service)
        service.process.send_signal(signal.SIGTERM)
    assert files(service) == {1: ".parquet", 2: ".parquet", 3: ".parquet"}
    first, second, third = (
        read_trace(file) for file in oldest_first((service.directory / "traces").iterdir())
    )
    assert [trace.gaps() for trace in (first, second, third)] == [[], [], []]
    assert first.rest_rows > 5
    # The seconds around the command have every scan.
    around = first.slice(at_s - BEFORE_S + 0.2, at_s + 0.5)  # the picture was up to 0.2 s old
    assert around.rest_rows == 0
    assert len(around) > 2000
    assert len(second) > 0
    assert len(third) > 0
