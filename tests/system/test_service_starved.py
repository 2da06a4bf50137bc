"""A gateway that gets no more memory or file handles: it refuses, the axis goes on, and it recovers by itself.

INV-9: a gateway without memory or handles does not reach the controller.
"""

from __future__ import annotations

import json
import os
import resource
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from gantryctl.service.clients.link import ServiceLink
from gantryctl.service.recorder.journal.writer import Journal
from gantryctl.trace.reader import read_trace
from support.service_process import Service, add_users

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the service needs Linux")
EVENTS = 10_000


def long_journal(directory: Path) -> None:
    """To ask for all of it needs tens of MB at once."""
    made = Journal(directory)
    event = {"utc": "2026-01-01T00:00:00.000+00:00", "monotonic_ns": 0, "kind": "command", "text": "x" * 400}
    made.append(1, 0, 1, [json.dumps(event).encode()] * EVENTS)
    made.close()


@contextmanager
def limited(process: int, kind: int, most: int) -> Iterator[None]:
    """A limit for a process that runs."""
    before = resource.prlimit(process, kind)
    resource.prlimit(process, kind, (most, before[1]))
    try:
        yield
    finally:
        resource.prlimit(process, kind, before)


def status(service: Service, path: str, cookie: str) -> int:
    """Of one request; 0 when the connection broke."""
    with suppress(OSError):
        return service.request("GET", path, cookie=cookie)[0]
    return 0


def use_up_handles(service: Service, stack: ExitStack) -> None:
    host, port = service.address.split(":")
    for _ in range(30):
        stack.enter_context(socket.create_connection((host, int(port))))


@pytest.mark.slow
def test_a_gateway_without_memory_and_without_handles_disturbs_no_motion(tmp_path: Path) -> None:
    add_users(tmp_path)
    long_journal(tmp_path / "hust_gantry")
    with Service(tmp_path) as service, ServiceLink(service.directory) as link, ExitStack() as connections:
        cookie, gateway = service.log_in("physicist"), service.child("gateway")
        link.ask("take", over=True)
        link.ask("set", tag="speed_setting_deg_s", value=0.6)
        link.ask("power", on=True)
        until(link, lambda tags: bool(tags["power"]))
        link.ask("move", target_deg=3.0)
        until(link, lambda tags: tags["vel_act_deg_s"] > 0.3)
        with limited(gateway, resource.RLIMIT_AS, 2**20):  # what it has it keeps, it gets nothing more
            assert status(service, f"/api/v1/journal?limit={EVENTS}", cookie) in (0, 500, 503)
        handles = len(os.listdir(f"/proc/{service.child('gateway')}/fd"))
        with limited(service.child("gateway"), resource.RLIMIT_NOFILE, handles):
            use_up_handles(service, connections)
            link.alive()
            assert link.look()["vel_act_deg_s"] > 0.3  # the axis has gone on
        connections.close()
        until(link, lambda tags: bool(tags["in_position"]))
        assert link.tags["pos_act_deg"] == pytest.approx(3.0, abs=0.005)  # the in-position window
        assert status(service, "/api/v1/journal?limit=5", cookie) in (200, 401)  # 401: it had to start anew
        link.ask("power", on=False)
        until(link, lambda tags: not tags["recording"])
    assert "Too many open files" in service.errors()
    (trace,) = (read_trace(file) for file in (service.directory / "traces").iterdir())
    assert trace.gaps() == []


def until(link: ServiceLink, holds: Callable[[dict[str, Any]], bool]) -> None:
    """Look, alive, until something holds."""
    while not holds(link.look()):
        link.alive()
