"""Slices of a soak: one machine day each, from the state that the day before has left; resumable, same seed same trace.

The folder of a soak holds `log.jsonl` (a line per day), `state` (the state directory of the machine as the last
finished day left it) and `keys`. A day that is broken off is computed anew from its beginning.
"""

from __future__ import annotations

import gc
import hashlib
import json
import os
import random
import resource
import shutil
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

from gantryctl.machine import default_machine, with_values
from gantryctl.operation.store import StateStore
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.service.recorder.journal.places import KEYS_VARIABLE
from support.virtual_soak.calendar import dated
from support.virtual_soak.climate import DAY_S, Temperatures, at_rest, in_use, machine_at
from support.virtual_soak.day import OPENS_S, USED_S, Day, date_at
from support.virtual_soak.desk import Counts, Desk, Stuck

RESTARTS_A_DAY: Final = 0.5
"""Controller restarts in the middle of a day: an update, a mains failure, somebody who pulls a plug."""
OFF_S: Final = 120.0
# PyTuple_MAXSAVESIZE and PyTuple_MAXFREELIST of CPython 3.11.
_FREE_LENGTHS: Final = 20
_FREE_TUPLES: Final = 2_000
_PAGE_MB: Final = resource.getpagesize() / 2**20


class Soak:
    """A soak in its folder.

    Args:
        seed: of everything that is drawn. scan_ms: scan period. used_s: use in a day, for a test that is short.
        restarts_a_day: how often the controller is restarted in the middle of a day, on average; at most 1.
    """

    def __init__(
        self,
        folder: Path,
        seed: int,
        scan_ms: float,
        used_s: float = USED_S,
        restarts_a_day: float = RESTARTS_A_DAY,
    ) -> None:
        self.folder, self.seed, self._used_s, self._restarts_a_day = folder, seed, used_s, restarts_a_day
        self._nominal = with_values(default_machine(), {"control.scan_period_ms": scan_ms})
        self.log = folder / "log.jsonl"
        self.head = {"kind": "soak", "seed": seed, "scan_ms": scan_ms, "used_h": used_s / 3600.0}
        self._kept, self._work = folder / "kept", folder / "work"
        folder.mkdir(parents=True, exist_ok=True)
        self.days, self._temperatures = 0, at_rest(0.0)
        self._offset_counts: float | None = None
        self._chain = hashlib.sha256(json.dumps(self.head).encode()).hexdigest()
        self._resume()

    def _resume(self) -> None:
        lines = read_lines(self.log)
        if not lines:
            shutil.rmtree(self._kept, ignore_errors=True)
            self.log.write_text(json.dumps(self.head) + "\n")
            return
        if lines[0] != self.head:
            raise SystemExit(f"{self.log} is a soak of {lines[0]}, not of {self.head}: another folder")
        # Without a last line that was torn.
        self.log.write_text("".join(json.dumps(line) + "\n" for line in lines))
        if len(lines) > 1:
            last, self._offset_counts = lines[-1], float(lines[1]["offset_counts"])
            self.days, self._chain = int(last["day"]) + 1, str(last["trace"])
            self._temperatures = Temperatures(last["gears_k"], last["motor_k"])

    def run(self, days: int) -> Iterator[dict[str, Any]]:
        """Days until there are so many in the log; each line as it is logged."""
        while self.days < days:
            line = self._one_day()
            with self.log.open("a") as log:
                print(json.dumps(line), file=log, flush=True)
            # Only now: a soak that is broken off before has the state that its log ends with.
            shutil.rmtree(self._kept / str(self.days), ignore_errors=True)
            self.days += 1
            yield line

    # --- one day ----------------------------------------------------------------------------------------------------

    def _one_day(self) -> dict[str, Any]:
        begun_s = time.process_time()
        number = self.days
        rng = random.Random(f"{self.seed} day {number}")
        counts, trace = Counts(), hashlib.sha256(self._chain.encode())
        shutil.rmtree(self._work, ignore_errors=True)
        kept = self._kept / str(number)
        if number:
            shutil.copytree(kept, self._work)
        else:
            self._work.mkdir()
        opens_s = number * DAY_S + OPENS_S
        # Switched off since the evening before.
        off_s = DAY_S - self._used_s if number else OPENS_S
        temperatures = self._temperatures.after(off_s, at_rest(opens_s))
        begin_s, end_s = opens_s, opens_s + self._used_s
        restarts = sorted(rng.uniform(0.1, 0.9) for _ in range(rng.random() < self._restarts_a_day))
        stuck = ""
        with patch.dict(os.environ, {KEYS_VARIABLE: str((self._work / "keys").resolve())}):
            for part, until in enumerate((*(begin_s + share * self._used_s for share in restarts), end_s)):
                try:
                    ran_s = self._one_start(rng, part, begin_s, until, temperatures, counts, trace)
                except Stuck as found:
                    stuck = str(found)
                    break
                temperatures = temperatures.after(ran_s, in_use(begin_s)).after(OFF_S, at_rest(begin_s))
                begin_s += ran_s + OFF_S
        self._temperatures, self._chain = temperatures, trace.hexdigest()
        shutil.rmtree(self._kept / str(number + 1), ignore_errors=True)
        self._kept.mkdir(exist_ok=True)
        shutil.move(self._work, self._kept / str(number + 1))
        found = asdict(counts)
        return {
            "kind": "day", "day": number, "date": f"{date_at(number * DAY_S):%Y-%m-%d}",
            # A controller that is not switched off may be in use for longer than a day.
            "machine_h": max((number + 1) * DAY_S, opens_s + self._used_s) / 3600.0,
            **{name: round(value, 6) if isinstance(value, float) else value for name, value in found.items()},
            "stuck": stuck,
            "gears_k": temperatures.gears_k, "motor_k": temperatures.motor_k,
            "journal_mb": round(self._journal_mb(number + 1), 3),
            "cpu_s": round(time.process_time() - begun_s, 1), "trace": self._chain,
        }  # fmt: skip

    def _one_start(
        self,
        rng: random.Random,
        part: int,
        begin_s: float,
        until_s: float,
        temperatures: Temperatures,
        counts: Counts,
        trace: hashlib._Hash,
    ) -> float:
        """From one start of the controller to its end; how long it was on."""
        machine = machine_at(self._nominal, self.seed, begin_s, temperatures)
        now = [begin_s]
        with ExitStack() as open_things:
            open_things.enter_context(memory_in_service())
            open_things.enter_context(dated(lambda: date_at(now[0])))
            # The anchor of the journal goes to the terminal of a service.
            open_things.enter_context(redirect_stderr(StringIO()))
            memory = SharedMemory.create()
            open_things.callback(memory.close)
            memory.words[Word.BOOT] = int(begin_s) + 1
            store = open_things.enter_context(StateStore(machine, self._work))
            _same_plant(store)

            def second(time_s: float) -> None:
                now[0] = begin_s + time_s
                if time_s % 3600.0 < 0.5:
                    counts.memory.append((round(now[0] / 3600.0, 3), round(own_mb(), 3)))

            desk = Desk(machine, store, memory, counts, trace, second)
            if part == 0:
                counts.offset_counts = desk.offset_counts()
            if self._offset_counts is None:
                self._offset_counts = counts.offset_counts
            day = Day(desk, rng, lambda: date_at(now[0]), until_s - begin_s)
            try:
                day.work(morning=part == 0)
            except Stuck:
                desk.look()
                raise
            finally:
                drift = desk.offset_counts() - self._offset_counts
                if abs(drift) > abs(counts.drift_counts):
                    counts.drift_counts = drift
                desk.close()
            return desk.engine.time_s

    def _journal_mb(self, number: int) -> float:
        files = (self._kept / str(number)).rglob("journal*")
        return sum(file.stat().st_size for file in files if file.is_file()) / 2**20


def _same_plant(store: StateStore) -> None:
    """The plant of the evening before has aged, it is no other one: its state goes on, its clock begins anew.

    Without this a state directory with another [plant] means another machine, which is zeroed anew.
    """
    found = store.load_plant()
    if found is not None:
        # Temperatures are functions of the time since the start (plant equations S13).
        store.store_plant({**found[0], "scans_done": 0.0})


@contextmanager
def memory_in_service() -> Iterator[None]:
    """Let only the controller's own memory grow, and all of it.

    As in the service no garbage is collected: a cycle is memory that does not come back. CPython keeps freed tuples for
    later use, up to 2,000 of each length below 20. Each `tuple(generator)` adds one, so a length that comes up seven
    times an hour grows for 280 h and then no more: here all are kept from the start, 4.5 MB.
    """
    gc.collect()
    gc.disable()
    for length in range(1, _FREE_LENGTHS):
        kept = [tuple([None] * length) for _ in range(_FREE_TUPLES)]
        del kept
    try:
        yield
    finally:
        gc.enable()


def own_mb() -> float:
    """Resident memory of this process that is of no file.

    The shared memory of the service is a file: its rings have a fixed size, and their pages come to be resident one by
    one, 2.4 MB of events a day.
    """
    pages = Path("/proc/self/statm").read_text().split()
    return (int(pages[1]) - int(pages[2])) * _PAGE_MB


def read_lines(log: Path) -> list[dict[str, Any]]:
    """Lines of a log; the last one may be torn, and is left out then."""
    found: list[dict[str, Any]] = []
    if log.exists():
        for text in log.read_text().splitlines():
            try:
                found.append(json.loads(text))
            except ValueError:
                break
    return found
