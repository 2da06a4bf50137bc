"""A run of the service once more, in virtual time: the same controller on the same machine gets the journaled commands
in the scans that carried them out, and nothing else. Keys are not journaled while they are held: moves only.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gantryctl.image import OperatorCommand
from gantryctl.machine import Machine
from gantryctl.operation.store import StateStore
from gantryctl.runtime import VirtualClock
from gantryctl.service.controller.process import Controller
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.protocol.messages import FIELDS, WITHOUT_EPOCH, Identity, to_record
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.journal.reading import Entry
from support.marks import newest_mark

ALIVE_S = 0.5
"""A holder of control gives a sign of life so often; signs of life are not journaled."""


def carried_out(entries: Sequence[Entry]) -> list[tuple[float, Identity, str, dict[str, Any]]]:
    """Time of the scan, sender, kind and values of every command in the journal that was not refused."""
    found = []
    for entry in entries:
        row, values = entry.values, json.loads(entry.values["detail"])
        if "time_s" in values and row["text"].endswith(": done"):
            who = Identity(row["client"], row["user"], Role(row["role"]), row["place"])
            kind = row["text"].split()[0].rstrip(":")
            asked = {name: value for name, value in values.items() if name in FIELDS[kind]}
            found.append((float(values["time_s"]), who, kind, asked))
    return found


class Replay:
    """One run. `rows` are those of its recording, as the recorder process would get them.

    Args:
        root: the state root as it was before the service started.
        entries: the journal of the service.
        end_s: when it was told to end, on the clock of the scan.
    """

    def __init__(self, machine: Machine, root: Path, entries: Sequence[Entry], end_s: float) -> None:
        self._commands = deque(carried_out(entries))
        self._end_s, self._seq = end_s, 0
        self._memory = SharedMemory.create()
        self._rows: list[bytes] = []
        with StateStore(machine, root) as store:
            self._controller = Controller(machine, store, self._memory)
            self._engine, self._operator = self._controller.engine, self._controller.operator
            self._engine.clock = VirtualClock()
            self._operator.now, self._operator.frames.start_s = lambda: self._engine.time_s, 0.0
            self._memory.words[Word.RECORDER_NS] = 2**62
            self._poll, self._operator.poll = self._operator.poll, self._polled
            self._controller.run(real_time=False)
        self._take_rows()
        self._memory.close()

    @property
    def rows(self) -> NDArray[np.float64]:
        """Shape (rows, columns): without the number of the recording and the mark."""
        return np.array([np.frombuffer(row)[2:] for row in self._rows])

    def _polled(self, time_s: float) -> OperatorCommand:
        """What is due in this scan goes into the ring, just before the scan looks into it."""
        while self._commands and self._commands[0][0] <= time_s:
            _, who, kind, values = self._commands.popleft()
            self._send(who, kind, values)
        holder = self._operator.authority.holder
        if holder is not None and self._engine.scan % round(ALIVE_S / self._engine.period_s) == 0:
            self._send(holder, "alive", {})
        if time_s >= self._end_s:
            self._controller.end()
        self._take_rows()
        return self._poll(time_s)

    def _send(self, who: Identity, kind: str, values: dict[str, Any]) -> None:
        self._seq += 1
        message = {"type": kind, "seq": self._seq, "frame": newest_mark(self._operator, who.client), **values}
        if kind not in WITHOUT_EPOCH:
            message["epoch"] = self._operator.authority.epoch
        ring = self._memory.commands[Source.LOCAL if who.place == "local" else Source.WEB]
        assert ring.put(to_record(who, message))

    def _take_rows(self) -> None:
        while (record := self._memory.rows.take()) is not None:
            if len(record) > 8:  # else the mark of its end
                self._rows.append(record)
