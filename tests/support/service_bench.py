"""The service's operator in front of the real program on the virtual gantry, in virtual time: no process, no clock."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from gantryctl.image import Mode
from gantryctl.machine import Machine, default_machine
from gantryctl.program import AxisState, GantryProgram
from gantryctl.service.command.inbox import Inbox
from gantryctl.service.command.operator import ServiceOperator
from gantryctl.service.command.permit import Permit
from gantryctl.service.command.rules import first_levels
from gantryctl.service.controller.alarm_view import AlarmView
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import JournalHealth, SharedMemory, Source, Word
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import Identity, to_record
from gantryctl.service.protocol.roles import Role
from gantryctl.wiring.engine import build_engine, build_program
from gantryctl.wiring.simulator import sim_drive
from support.marks import newest_mark

MACHINE = default_machine()
EPOCH = 1000
LEASE = "00000000000000aa"
SPEED_DEG_S = 3.0
# Jog-release ramp of the machine file: v / a plus the time that the jerk adds, and a scan or two.
RAMP_S = SPEED_DEG_S / MACHINE.virtual_axis.jog_release_dec_deg_s2 + (
    MACHINE.virtual_axis.jog_release_dec_deg_s2 / MACHINE.virtual_axis.jog_release_jerk_deg_s3
)


def ring(slots: int, slot: int = 1024) -> Ring:
    return Ring(memoryview(bytearray(192 + slots * slot)), slot)


class Bench:
    """One axis with the operator of the service; `scans` goes on in time.

    Attributes:
        epoch: what a page sees now.
        lively: whoever has control gives a sign of life twice a second.
        stops: how often the axis has come to rest.
    """

    def __init__(
        self,
        *,
        second_person: bool = False,
        machine: Machine = MACHINE,
        memory: SharedMemory | None = None,
    ) -> None:
        self.commands: Sequence[Ring] = (ring(512), ring(64))
        self.replies: Sequence[Ring] = (ring(512), ring(64))
        self.event_ring = ring(4096)
        if memory is not None:
            self.commands, self.replies = memory.commands, memory.replies
            self.event_ring = memory.events[Source.CONTROLLER]
        self.events = EventLog(self.event_ring)
        drive = sim_drive(machine)
        program = build_program(machine, drive)
        assert isinstance(program, GantryProgram)
        self.program, self.axis = program, program.axis
        self.words = memoryview(bytearray(512)).cast("Q")
        self.words[Word.RECORDER_NS] = 2**62  # always alive
        self.operator = ServiceOperator(
            machine,
            program,
            Inbox(self.commands, self.replies, self.events),
            Permit(self.axis, JournalHealth(self.words), self.events),
            AlarmView(
                self.axis.alarms, self.axis.feedback, self.events, self.axis.settings.travel
            ).acknowledge,
            first_levels(machine, machine.speed.setting_max_deg_s),
            epoch=EPOCH,
            now=lambda: self.time_s,
            second_person=second_person,
        )
        self.engine = build_engine(machine, drive=drive, program=program, operator=self.operator)
        self.seq = 0
        self.lively = True
        self.stops = 0
        self._before = AxisState.DISABLED

    @property
    def time_s(self) -> float:
        return self.engine.time_s if hasattr(self, "engine") else 0.0

    @property
    def epoch(self) -> int:
        return self.operator.authority.epoch

    def frame(self, who: Identity) -> str:
        """Mark of the status frame that a connection would get now."""
        return newest_mark(self.operator, who.client)

    def who(self, role: Role = Role.OPERATOR, client: str = "", place: str = "console") -> Identity:
        return Identity(client or f"{role}-{place}", str(role), role, place)

    def scans(self, count: int) -> None:
        """So many scans, 1 ms each unless the machine has others."""
        self.engine.run_until(self._after, count * self.engine.period_s)

    def _after(self, _: object) -> bool:
        self.operator.settle()
        state, before = self.axis.state, self._before
        self._before = state
        self.stops += state is AxisState.STANDSTILL and before not in (
            AxisState.STANDSTILL,
            AxisState.DISABLED,
        )
        holder = self.operator.authority.holder
        if self.lively and holder is not None and self.engine.scan % round(0.5 / self.engine.period_s) == 0:
            self.send(holder, "alive")
        return False

    def until(self, state: AxisState, limit_s: float = 60.0) -> None:
        def reached(_: object) -> bool:
            self._after(_)
            return self.axis.state is state

        assert self.engine.run_until(reached, limit_s), self.axis.state

    def send(self, who: Identity, kind: str, **values: Any) -> int:
        """Put a message into the ring as the gateway does."""
        self.seq += 1
        raw = {"type": kind, "seq": self.seq, "frame": self.frame(who), "epoch": self.epoch, **values}
        if kind in ("alive", "stop", "quick_stop", "release"):
            raw.pop("epoch")
        assert self.commands[1 if who.place == "local" else 0].put(to_record(who, raw))
        return int(raw["seq"])

    def ask(self, who: Identity, kind: str, **values: Any) -> dict[str, Any]:
        """Send and let a few scans pass; the reply."""
        seq = self.send(who, kind, **values)
        self.scans(3)
        for each in self.replies:
            while (record := each.take()) is not None:
                client, reply = json.loads(record)
                if (client, reply["seq"]) == (who.client, seq):
                    return dict(reply)
        raise AssertionError(f"no reply to {kind}")

    def do(self, who: Identity, kind: str, **values: Any) -> None:
        reply = self.ask(who, kind, **values)
        assert reply["ok"], reply

    def refused(self, who: Identity, kind: str, **values: Any) -> str:
        reply = self.ask(who, kind, **values)
        assert not reply["ok"], reply
        return str(reply["code"])

    def powered(self, who: Identity, mode: Mode = Mode.CONTINUOUS) -> None:
        """Control taken, power on, mode chosen."""
        self.do(who, "take", over=False)
        self.do(who, "power", on=True)
        self.until(AxisState.STANDSTILL)
        self.do(who, "mode", mode=mode.name.lower())

    def hold(self, seconds: float) -> None:
        """Renew every 30 ms."""
        for _ in range(round(seconds / 0.030)):
            self.send(self.who(), "renew", lease=LEASE)
            self.scans(30)

    def rest_after_s(self) -> float:
        """Time until the axis stands."""
        begin = self.engine.time_s
        self.until(AxisState.STANDSTILL, 10.0)
        return self.engine.time_s - begin
