"""Lateness of the service's scan beside `cyclictest` under the same load, in slices that take turns.

    sudo .venv/bin/python benchmarks/service_lateness.py [--slices N] [--json]

The load: the service with an axis that moves to and fro, five pages in Chromium that show it, and an OPC UA client that
subscribes. It needs the right to SCHED_FIFO, and `cyclictest` (Debian package rt-tests). The exit code is 1 when a
limit is missed: 1.5 for the ratio of p99, 5 % of a processor for the gateway.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

# The service and its page, as the tests start them.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from gantryctl.service.clients.link import ServiceLink
from gantryctl.service.controller.publisher import RECENT_S
from gantryctl.service.protocol.roles import Role
from support.browser import CHROMIUM, FLAGS, SIZE, enter
from support.opcua_looker import looking, trusted_client
from support.service_process import Service, add_users

RATIO_MAX = 1.5
GATEWAY_MAX_PERCENT = 5.0
PROCESSES = ("controller", "gateway", "recorder", "gateway.opcua")
# Of the scan, and of cyclictest.
PRIORITY = 80


def processor_s(process: int) -> float:
    """Processor time of a process so far."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def quantile(counts: dict[int, int], part: float) -> float:
    """Of a histogram in whole us: the upper edge of its bin."""
    left = part * sum(counts.values())
    for value, count in sorted(counts.items()):
        left -= count
        if left <= 0:
            return float(value + 1)
    return float(max(counts) + 1)


def cyclictest(seconds: float) -> dict[str, float]:
    """Wake-up latency of a C program with the period and the priority of the scan, us."""
    command = [
        "cyclictest",
        "-q",
        "-m",
        "-p",
        str(PRIORITY),
        "-i",
        "1000",
        "-D",
        f"{seconds:.0f}",
        "-h",
        "50000",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    counts = {}
    for line in done.stdout.splitlines():
        words = line.split()
        if len(words) >= 2 and words[0].isdigit():
            counts[int(words[0])] = int(words[1])
    return {"p50_us": quantile(counts, 0.5), "p99_us": quantile(counts, 0.99)}


class Mover(threading.Thread):
    """Keeps the axis moving to and fro over the local socket.

    Attributes:
        tags: the newest picture.
    """

    def __init__(self, directory: Path) -> None:
        super().__init__(daemon=True)
        self._directory, self.ended = directory, threading.Event()
        self.tags: dict[str, Any] = {}

    def run(self) -> None:
        with ServiceLink(self._directory) as link:
            link.ask("take", over=True)
            link.ask("set", tag="speed_setting_deg_s", value=0.6)
            link.ask("power", on=True)
            while not self.ended.is_set():
                link.alive()
                self.tags = link.look()
                if self.tags["power"] and self.tags["at_rest"]:
                    link.ask("move", target_deg=4.0 if self.tags["pos_act_deg"] < 2.0 else 0.0)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


@contextmanager
def loaded(root: Path) -> Iterator[tuple[Service, Mover]]:
    """The service with everything that looks at it."""
    add_users(root)
    port = free_port()
    client = asyncio.run(trusted_client(root, root / "hust_gantry" / "opcua"))
    with ExitStack() as stack:
        service = stack.enter_context(Service(root, "--opcua", f"127.0.0.1:{port}"))
        mover = Mover(service.directory)
        mover.start()
        stack.callback(mover.join)
        stack.callback(mover.ended.set)
        browser = stack.enter_context(sync_playwright()).chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        stack.callback(browser.close)
        pages = []
        for role in Role:
            context = browser.new_context(viewport=SIZE)  # type: ignore[arg-type]
            pages.append(enter(context, service, str(role), "display"))
        changes = stack.enter_context(looking(f"opc.tcp://127.0.0.1:{port}/gantryctl", client))
        yield service, mover
        if not mover.is_alive() or not changes():
            raise SystemExit("the load broke off: the axis does not move, or OPC UA shows nothing")
        for page in pages:
            page.locator("[data-stale=false]").wait_for()
            page.close()


def measure(slices: int) -> dict[str, Any]:
    """All figures."""
    scans, others = [], []
    busy: dict[str, list[float]] = {name: [] for name in PROCESSES}
    with tempfile.TemporaryDirectory() as folder, loaded(Path(folder)) as (service, mover):
        for _ in range(slices):
            begin_s = time.monotonic()
            before_s = {name: processor_s(service.child(name)) for name in PROCESSES}
            time.sleep(RECENT_S + 1.0)  # the controller's figures are of the last `RECENT_S`, every second
            tags, passed_s = dict(mover.tags), time.monotonic() - begin_s
            for name, used_s in before_s.items():
                busy[name].append(100.0 * (processor_s(service.child(name)) - used_s) / passed_s)
            scans.append({part: tags[f"scan_lateness_{part}"] for part in ("p50_us", "p99_us")})
            others.append(cyclictest(RECENT_S))
        granted = mover.tags["real_time"]
    both = list(zip(scans, others, strict=True))
    return {
        "slices": slices,
        "real_time_granted": granted,
        "load_average": [round(load, 2) for load in os.getloadavg()],
        "processors": os.cpu_count(),
        "scan": scans,
        "cyclictest": others,
        "ratio_p50": round(statistics.median(s["p50_us"] / o["p50_us"] for s, o in both), 2),
        "ratio_p99": round(statistics.median(s["p99_us"] / o["p99_us"] for s, o in both), 2),
        "processor_percent": {name: round(statistics.median(each), 2) for name, each in busy.items()},
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--slices", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    for needed in ("cyclictest", CHROMIUM):
        if shutil.which(needed) is None:
            raise SystemExit(f"{needed} is missing: Debian packages rt-tests, chromium")
    found = measure(asked.slices)
    if asked.json:
        print(json.dumps(found, indent=2))
    else:
        print(f"{'':14}{'scan p50':>12}{'p99':>10}{'cyclictest p50':>18}{'p99':>10}")
        for scan, other in zip(found["scan"], found["cyclictest"], strict=True):
            cells = (
                f"{scan['p50_us']:12.1f}{scan['p99_us']:10.1f}{other['p50_us']:18.1f}{other['p99_us']:10.1f}"
            )
            print(f"{'slice, us':14}{cells}")
        print(f"ratio p50 {found['ratio_p50']}, p99 {found['ratio_p99']} (limit {RATIO_MAX})")
        parts = ", ".join(f"{name} {part}" for name, part in found["processor_percent"].items())
        print(f"% of a processor: {parts} (limit for the gateway {GATEWAY_MAX_PERCENT:g})")
        print(f"load average {found['load_average']} on {found['processors']} processors")
        if not found["real_time_granted"]:
            print("real time was not granted: these figures say nothing")
    met = found["ratio_p99"] <= RATIO_MAX and found["processor_percent"]["gateway"] < GATEWAY_MAX_PERCENT
    return int(not (met and found["real_time_granted"]))


if __name__ == "__main__":
    sys.exit(main())
