"""The desk of a commissioning in virtual time, and the people in front of it."""

from __future__ import annotations

import json
from typing import Any

from gantryctl.commissioning import Commissioning, Step
from gantryctl.commissioning.in_service.board import Board
from gantryctl.commissioning.in_service.desk import Desk
from gantryctl.machine import configs_folder, load_machine
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import Snapshot
from gantryctl.service.protocol.frames import mark_of
from gantryctl.service.protocol.messages import WITHOUT_EPOCH, Identity, to_record
from gantryctl.service.protocol.roles import Role

MACHINE = load_machine(configs_folder() / "hust_can.toml")
ANNA = Identity("a", "anna", Role.SERVICE, "console")
REMOTE = Identity("r", "remy", Role.SERVICE, "10.0.0.7")
OTHER = Identity("o", "otto", Role.SERVICE, "console")
VIEWER = Identity("v", "vera", Role.VIEWER, "10.0.0.8")
LOOK_S = 0.005


class Room:
    """A desk in virtual time, and people in front of it."""

    def __init__(self, work: Commissioning, **options: bool) -> None:
        self.memory = SharedMemory.create()
        self.memory.words[Word.RECORDER_NS] = 2**62  # always alive
        self.now_s, self._seq, self.lively = 100.0, 0, True
        self.work, self.board = work, Board(self.memory)
        self.desk = Desk(
            MACHINE, self.memory, self.board, lambda: work.watch, now=lambda: self.now_s, **options
        )
        self.board.show(work)
        self.desk.set_up()
        self.go(0.02)

    def go(self, seconds: float) -> None:
        """The desk looks as often as it does, and whoever has control gives signs of life as a page does."""
        for k in range(round(seconds / LOOK_S)):
            holder = self.desk.authority.holder
            if self.lively and holder is not None and k % 80 == 0:
                self.send(holder, "alive")
            self.desk.look()
            self.now_s += LOOK_S

    def mark(self, who: Identity) -> str:
        """Of the status frame that a connection would get now."""
        frames = self.desk.frames
        return mark_of(frames.issued_ms, frames.key, who.client)

    def send(self, who: Identity, kind: str, **values: Any) -> int:
        self._seq += 1
        raw = {"type": kind, "seq": self._seq, "frame": self.mark(who), **values}
        if kind not in WITHOUT_EPOCH:
            raw["epoch"] = self.desk.authority.epoch
        assert self.memory.commands[Source.WEB].put(to_record(who, raw))
        return self._seq

    def ask(self, who: Identity, kind: str, **values: Any) -> str:
        """Send and look; "" when it was done, else the code."""
        seq = self.send(who, kind, **values)
        self.go(LOOK_S)
        while (record := self.memory.replies[Source.WEB].take()) is not None:
            client, reply = json.loads(record)
            if (client, reply["seq"]) == (who.client, seq):
                return str(reply["code"])
        raise AssertionError(f"no reply to {kind}")

    def leave(self, who: Identity) -> None:
        """The connection has ended, as the gateway says."""
        assert self.memory.commands[Source.WEB].put(to_record(who, {"type": "gone"}))

    def begun(self, key: str = "identity", who: Identity = ANNA) -> Step:
        """A step that has begun, as its thread gets it."""
        assert self.ask(who, "take", over=False) == ""
        if key != "identity":
            assert self.ask(who, "arm", action="commission", step=key) == ""
        assert self.ask(who, "commission_step", step=key) == ""
        step = self.desk.next_order()
        assert step is not None
        assert step.key == key
        assert not self.desk.halt.asked()
        return step

    @property
    def tags(self) -> dict[str, Any]:
        self.go(2 * LOOK_S)
        snapshot = Snapshot(self.memory)
        return {**snapshot.fast()[0], **snapshot.slow()}
