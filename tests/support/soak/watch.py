"""What a soak looks at from outside: the processes, the picture of the axis, the files that are left."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from gantryctl import read_trace
from gantryctl.errors import GantryctlError
from gantryctl.service.clients.link import ServiceLink
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import Entry, read_journal
from gantryctl.trace.naming import number_of
from support.service_process import Service
from support.soak.verdict import clock_steps, missing_numbers, missing_scans, unasked

CHILDREN = ("controller", "recorder", "gateway", "gateway.opcua")


class Picture(NamedTuple):
    """The axis at one time (monotonic)."""

    time_s: float
    state: str
    vel_ref_deg_s: float
    pos_ref_deg: float
    at_rest: bool


class Observer(threading.Thread):
    """Looks at the service over the local socket, without control.

    Attributes:
        tags: the newest.
        pictures: of the last minutes.
        failure: why it does not look any more; "" while it does.
    """

    def __init__(self, directory: Path) -> None:
        super().__init__(daemon=True)
        self._directory, self.ended = directory, threading.Event()
        self.tags: dict[str, Any] = {}
        self.pictures: deque[Picture] = deque(maxlen=6000)
        self.failure = ""

    def run(self) -> None:
        try:
            with ServiceLink(self._directory) as link:
                while not self.ended.is_set():
                    tags = dict(link.look())
                    self.pictures.append(
                        Picture(
                            time.monotonic(),
                            tags["axis_state"],
                            tags["vel_ref_deg_s"],
                            tags["pos_ref_deg"],
                            tags["at_rest"],
                        )
                    )
                    self.tags = tags
        except (GantryctlError, OSError) as fault:
            self.failure = str(fault)

    def until(self, holds: Callable[[dict[str, Any]], bool], limit_s: float = 30.0) -> None:
        """Wait until something holds.

        Raises:
            TimeoutError: it does not within the limit.
        """
        end_s = time.monotonic() + limit_s
        while not (self.tags and holds(self.tags)):
            if time.monotonic() > end_s or self.failure:
                raise TimeoutError(self.failure or f"nothing after {limit_s:g} s: {self.tags['axis_state']}")
            time.sleep(0.02)

    def since(self, begin_s: float) -> list[Picture]:
        """The pictures since a time."""
        return [each for each in tuple(self.pictures) if each.time_s >= begin_s]


class Processes:
    """The processes of the service."""

    def __init__(self, service: Service) -> None:
        self._service = service

    def ids(self) -> dict[str, int]:
        """Process number by name."""
        return {"supervisor": self._service.process.pid} | {
            name: self._service.child(name) for name in CHILDREN
        }

    def sample(self) -> dict[str, Any]:
        """Memory, processor time and handles of each.

        `own_kb` is what is resident or swapped out and of no file: only the process itself can give it back. Not in it
        are the service's shared memory, which has one size from its start and is mapped as it is touched, and pages of
        files (`file_kb`): libraries, of which the system drops and reads again what it likes, and a recording of up
        to 64 MB while it is closed. A file that is kept mapped keeps its handle. `pss_kb` shares out what several
        processes use. `waited_s` is for how long their threads were ready to run and had no processor, those of
        the browser with what drives it, too: what was short of time when a key was lost.
        """
        ids = self.ids()
        state = {name: _numbers(Path(f"/proc/{pid}/status")) for name, pid in ids.items()}
        return {
            "processes": ids,
            "own_kb": {name: each["RssAnon"] + each["VmSwap"] for name, each in state.items()},
            "file_kb": {name: each["RssFile"] for name, each in state.items()},
            "pss_kb": {name: _numbers(Path(f"/proc/{pid}/smaps_rollup"))["Pss"] for name, pid in ids.items()},
            "shared_kb": {name: each["RssShmem"] for name, each in state.items()},
            "cpu_s": {name: _processor_s(pid) for name, pid in ids.items()},
            "waited_s": {name: _waited_s([pid]) for name, pid in ids.items()}
            | {"browser": _waited_s(_descendants(os.getpid(), self._service.process.pid))},
            "handles": {name: len(os.listdir(f"/proc/{pid}/fd")) for name, pid in ids.items()},
            "threads": {name: each["Threads"] for name, each in state.items()},
        }


def _numbers(path: Path) -> dict[str, int]:
    """Numbers of a file of /proc by name; sizes in kB."""
    words = (line.split() for line in path.read_text(encoding="ascii").splitlines())
    return {
        line[0][:-1]: int(line[1])
        for line in words
        if line[0].endswith(":") and line[1:2] and line[1].isdigit()
    }


def _processor_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _waited_s(pids: Iterable[int]) -> float:
    """Time for which the threads of processes, as far as they live, were ready to run and did not."""
    waited_ns = 0
    for pid in pids:
        for thread in Path(f"/proc/{pid}/task").glob("*/schedstat"):
            with suppress(OSError):  # it has ended
                waited_ns += int(thread.read_text(encoding="ascii").split()[1])
    return round(waited_ns * 1e-9, 3)


def _descendants(pid: int, without: int) -> Iterator[int]:
    """The processes below a process, without one and those below it."""
    for thread in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):
            for child in map(int, thread.read_text(encoding="ascii").split()):
                if child != without:
                    yield child
                    yield from _descendants(child, without)


class Files:
    """Journal and recordings of a state directory."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._read = 0
        self.unasked: list[str] = []
        self.held_up: list[str] = []

    def sample(self) -> dict[str, Any]:
        """Rows of the journal, events nobody asked for, recordings and their bytes."""
        for row in self._new():
            text = row.values["text"]
            if unasked(row.values["kind"], text):
                self.unasked.append(f"{row.seq}: {text}")
            if " was held up for " in text:
                self.held_up.append(f"{row.seq}: {text}")
        files = list((self._directory / "traces").glob("*"))
        return {
            "journal": self._read,
            "unasked": len(self.unasked),
            "held_up": len(self.held_up),
            "recordings": len(files),
            "recorded_mb": round(sum(file.stat().st_size for file in files if file.exists()) / 1e6, 1),
        }

    def _new(self) -> Iterator[Entry]:
        while rows := read_journal(self._directory, after=self._read, limit=2000):
            self._read = rows[-1].seq
            yield from rows

    def proof(self) -> dict[str, Any]:
        """What is left when the service has ended; reads everything."""
        found = verify(self._directory)
        rows: list[Entry] = []
        while more := read_journal(self._directory, after=rows[-1].seq if rows else 0):
            rows += more
        folder = self._directory / "traces"
        recorded = missing = 0
        files = sorted(folder.glob("*.parquet"))
        for file in files:
            trace = read_trace(file, ["time_s"])
            recorded += len(trace)
            period_s = float(trace.metadata["period_s"])
            missing += missing_scans(trace["time_s"], trace["spacing_s"], period_s)
        # The oldest may have been removed, by their number.
        numbers = {number_of(file) for file in files} or {0}
        return {
            "power_ups": sum(row.values["text"] == "power True: done" for row in rows),
            "recordings_missing": max(numbers) - min(numbers) + 1 - len(numbers),
            "journal_rows": found.rows,
            "journal_wrong": found.wrong,
            "journal_missing": missing_numbers(
                (row.values["boot"], row.values["source"], row.values["number"]) for row in rows
            ),
            "clock_steps_s": clock_steps(
                (datetime.fromisoformat(row.values["utc"]).timestamp(), row.values["monotonic_ns"] / 1e9)
                for row in rows
            ),
            "recordings": max(numbers),
            "recorded_rows": recorded,
            "scans_missing": missing,
            "unfinished": sum(1 for file in folder.glob("*") if file.suffix != ".parquet"),
        }
