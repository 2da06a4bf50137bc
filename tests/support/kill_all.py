"""A service of which every process is killed at once, and what its next start finds."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from gantryctl.service.memory.memory import Source
from gantryctl.service.recorder.journal.reading import read_journal
from support.service_process import Page, Service

PHASES = ("at rest", "power on", "jog", "move")
LEASE = "{:016x}"


class Killed(NamedTuple):
    """How a run ended.

    Attributes:
        phase: what the axis did.
        acknowledged: numbers of the events whose command was acknowledged as kept.
        seen: time of the scan, angle and speed of every status frame of the page.
    """

    phase: str
    acknowledged: tuple[int, ...]
    seen: tuple[tuple[float, float, float], ...]


def processes(service: Service) -> list[int]:
    """The first process and all its children."""
    found = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(service.process.pid)], capture_output=True, text=True, check=True
    )
    return [service.process.pid, *map(int, found.stdout.split())]


class Recorded:
    """A page that remembers what was acknowledged, and when it saw what."""

    def __init__(self, page: Page) -> None:
        self.page, self.acknowledged = page, list[int]()
        self.lease = ""
        self.seen: list[tuple[float, float, float]] = []

    def do(self, kind: str, **values: Any) -> None:
        for _ in range(5):  # a busy computer lets pictures grow old
            reply = self.page.ask(kind, **values)
            if reply["code"] not in ("SEC-02", "SEC-03"):
                break
            self.page.look()
        assert reply["ok"], reply
        if kind in ("set", "power", "move") and reply["code"] == "":
            self.acknowledged.append(reply["journal"])

    def look(self, seconds: float) -> None:
        """Look for a time, and stay alive."""
        end_s = time.monotonic() + seconds
        while True:
            tags = self.page.look()
            self.seen.append((tags["time_s"], tags["pos_act_deg"], tags["vel_act_deg_s"]))
            self.page.say("renew", lease=self.lease) if self.lease else self.page.say("alive")
            if time.monotonic() > end_s:
                return


def work(page: Recorded, phase: str, chance: random.Random) -> None:
    """Bring the axis into a phase, and go on for some time."""
    page.do("take", over=False)
    for _ in range(chance.randrange(1, 6)):
        page.do("set", tag="increment_deg", value=round(chance.uniform(0.1, 9.0), 3))
    if phase != "at rest":
        page.do("set", tag="speed_setting_deg_s", value=round(chance.uniform(0.7, 6.0), 2))
        page.do("power", on=True)
        page.page.until(lambda tags: bool(tags["power"]))
    if phase == "jog":
        page.do("mode", mode="continuous")
        page.lease = LEASE.format(chance.getrandbits(64))
        page.do("jog", lease=page.lease, direction="forward")
    elif phase == "move":
        page.do("move", target_deg=90.0)
    page.look(chance.uniform(0.0, 1.5))


def run_and_kill(service: Service, phase: str, chance: random.Random) -> Killed:
    """Work at the page, then SIGKILL to all processes, in any order."""
    opened = service.page("operator")
    page = Recorded(opened)
    work(page, phase, chance)
    os.kill(service.process.pid, signal.SIGSTOP)  # it would start others again meanwhile
    victims = processes(service)
    chance.shuffle(victims)
    for victim in victims:
        os.kill(victim, signal.SIGKILL)
    with suppress(Exception):  # the other end is dead
        opened.__exit__()
    service.process.wait(30)
    service.end()
    until_s = time.monotonic() + 30.0
    while any(Path(f"/proc/{victim}").exists() for victim in victims) and time.monotonic() < until_s:
        time.sleep(0.01)
    return Killed(phase, tuple(page.acknowledged), tuple(page.seen))


def lost(directory: Path, boot: int, killed: Killed) -> int:
    """Acknowledged events of a start that are not in its journal."""
    rows = read_journal(directory, limit=1_000_000)
    kept = {
        row.values["number"]
        for row in rows
        if row.values["boot"] == boot and row.values["source"] == Source.CONTROLLER
    }
    return len(set(killed.acknowledged) - kept)


def boots(directory: Path) -> list[int]:
    """Starts of the service in the journal, the oldest first."""
    found = dict.fromkeys(row.values["boot"] for row in read_journal(directory, limit=1_000_000))
    return [boot for boot in found if boot]
