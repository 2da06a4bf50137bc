"""A soak of the real service: hours with two pages, an OPC UA client and a wall clock that is stepped by an hour.

    .venv/bin/python benchmarks/soak.py --hours 24 --log soak.jsonl      # Ctrl-C: what was run is judged
    .venv/bin/python benchmarks/soak.py --judge soak.jsonl               # also of one that is running
    .venv/bin/python benchmarks/soak.py --judge soak.jsonl --keep docs/evidence/soak.log

`gantryctl serve` runs in real time on the virtual gantry, with a state directory of its own. In Chromium one person
plays a day of treatment by seed, another one looks on; an OPC UA client subscribes. Every ten minutes the wall clock of
the service, not of the computer, is stepped by an hour, forward or back, while the axis moves or stands. Each minute is
a line of the log. The exit code is 1 when a criterion fails.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import platform
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from itertools import cycle
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from playwright.sync_api import sync_playwright

# The service, its pages and clients, as the tests start them.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from support.browser import CHROMIUM, FLAGS
from support.opcua_looker import looking, trusted_client
from support.service_process import Service, add_users
from support.soak.day import Day
from support.soak.stepped_clock import SteppedClock
from support.soak.verdict import judge, kept, line_of, passed, read_log, words
from support.soak.watch import Files, Observer, Processes

MINUTE_S = 60.0
AHEAD_S = 7200
"""The service's clock is ahead from the start: the client's certificate, made before, is valid after every step."""
STEPS_S = (3600, -3600, -3600, 3600)


class Asked(NamedTuple):
    """What is to be run."""

    hours: float
    log: Path
    seed: int
    step_min: float
    note: str


class Log:
    """Lines of JSON, on the disk at once."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("w", encoding="utf-8")
        self._begin_s = time.monotonic()

    @property
    def time_s(self) -> float:
        return time.monotonic() - self._begin_s

    def put(self, kind: str, **values: Any) -> None:
        print(line_of({"kind": kind, "t_s": round(self.time_s, 1), **values}), file=self._file, flush=True)


class Ended:
    """Set by Ctrl-C: the day goes on to the end of the gesture."""

    def __init__(self) -> None:
        self.now = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._end)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self.now = True


def conditions(asked: Asked) -> dict[str, Any]:
    """Where and what."""
    described = subprocess.run(
        ["git", "describe", "--always", "--dirty", "--abbrev=12"],
        capture_output=True, text=True, check=False, cwd=Path(__file__).parent,
    )  # fmt: skip
    return {
        "commit": described.stdout.strip(),
        "begun": datetime.now(UTC).isoformat(timespec="seconds"),
        "hours": asked.hours,
        "seed": asked.seed,
        "step_min": asked.step_min,
        "python": platform.python_version(),
        "kernel": platform.release(),
        "processors": os.cpu_count(),
        "note": asked.note,
    }


@contextmanager
def service_of(root: Path, clock: SteppedClock) -> Iterator[tuple[Service, Any]]:
    """The service, and the number of changes that its OPC UA client has got as a function."""
    add_users(root)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    client = asyncio.run(trusted_client(root, root / "hust_gantry" / "opcua"))
    options = ("--opcua", f"127.0.0.1:{port}")
    with (
        Service(root, *options, environment=clock.environment, own_group=True) as service,
        looking(f"opc.tcp://127.0.0.1:{port}/gantryctl", client) as changes,
    ):
        yield service, changes


def minute(log: Log, day: Day, files: Files, processes: Processes, tags: dict[str, Any], opcua: int) -> None:
    """One line, and one for each event in the journal that nobody asked for."""
    known = len(files.unasked)
    left = files.sample()
    for text in files.unasked[known:]:
        log.put("trouble", of="journal", what=text)
    log.put(
        "minute",
        **processes.sample(),
        **left,
        page_kb=day.page_kb(),
        opcua=opcua,
        gestures=day.gestures,
        rows_lost=tags["trace_rows_lost"],
        events_lost=tags["events_lost"],
        alarms=tags["alarm_count"],
        late_us=[round(tags[f"scan_lateness_{part}_us"]) for part in ("p50", "p99", "max")],
        skipped=tags["scan_skipped"],
        real_time=tags["real_time"],
        load=round(os.getloadavg()[0], 2),
    )


def play(asked: Asked, log: Log, ended: Ended) -> None:
    """Run the day until its end, and write what there is."""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder, ExitStack() as stack:
        root = Path(folder) / "state"
        root.mkdir()
        clock = SteppedClock(Path(folder), AHEAD_S)
        service, changes = stack.enter_context(service_of(root, clock))
        files, processes = Files(service.directory), Processes(service)
        observer = Observer(service.directory)
        observer.start()
        stack.callback(observer.join)
        stack.callback(observer.ended.set)
        observer.until(lambda tags: True)
        browser = stack.enter_context(sync_playwright()).chromium.launch(
            executable_path=CHROMIUM, args=FLAGS, handle_sigint=False, handle_sigterm=False
        )
        stack.callback(browser.close)
        day = Day(
            browser, service, observer, asked.seed, lambda of, what: log.put("trouble", of=of, what=what)
        )
        steps_s = cycle(STEPS_S)
        due_s, minute_s = asked.step_min * 60.0, 0.0

        def step() -> None:
            """The next step of the clock."""
            step_s = next(steps_s)
            clock.offset_s += step_s
            axis = {name: observer.tags[name] for name in ("axis_state", "vel_ref_deg_s", "power")}
            log.put("step", step_s=step_s, **axis)

        while log.time_s < asked.hours * 3600.0 and not ended.now:
            for _ in day.session():
                if log.time_s >= due_s and day.step is None:
                    day.step, due_s = step, due_s + asked.step_min * 60.0
                if log.time_s >= minute_s:
                    minute_s += MINUTE_S
                    day.look_on()
                    minute(log, day, files, processes, observer.tags, changes())
                if observer.failure:
                    log.put("trouble", of="stuck", what=f"the local socket: {observer.failure}")
                    ended.now = True
                if ended.now:
                    break
        minute(log, day, files, processes, observer.tags, changes())
        stack.close()
        files.sample()
        log.put(
            "end",
            **files.proof(),
            unasked=files.unasked,
            held_up=files.held_up,
            errors=service.errors()[-2000:],
        )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--log", type=Path, default=Path("soak.jsonl"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step-min", type=float, default=10.0, help="minutes between two steps of the clock")
    parser.add_argument("--note", default="", help="of the computer, for the log")
    parser.add_argument("--judge", type=Path, help="judge this log, and run nothing")
    parser.add_argument("--keep", type=Path, help="write the verdict and the log into this file")
    read = parser.parse_args()
    if read.judge is None:
        asked = Asked(read.hours, read.log, read.seed, read.step_min, read.note)
        log, ended = Log(asked.log), Ended()
        log.put("conditions", **conditions(asked))
        play(asked, log, ended)
    whole = read_log(read.judge or read.log)
    findings = judge(whole)
    print(words(findings))
    if read.keep is not None:
        read.keep.write_text(kept(whole), encoding="utf-8")
    return int(not passed(findings))


if __name__ == "__main__":
    sys.exit(main())
