"""What stands behind the operator of the service: levels, control, leases, and every way to stop. Stops come first."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from gantryctl.image import OperatorCommand
from gantryctl.program import GantryProgram
from gantryctl.program.power.phases import RISING
from gantryctl.service.command.arming import Arming
from gantryctl.service.command.authority import Authority
from gantryctl.service.command.inbox import Gone, Inbox, PendingCommand
from gantryctl.service.command.lease import HoldToRun
from gantryctl.service.command.rules import Rules
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import Source
from gantryctl.service.memory.ring import Ring
from gantryctl.service.protocol.messages import Identity, MessageRefused


class OperatorState:
    """Levels of the operator, who has control, and what ends a motion or a brake test.

    Args:
        commands, replies: rings, one of each for every source.
        events: where what happened is written down.
        rules: limits and roles.
        epoch: the first one.
        now: the monotonic time, s.
        second_person: what is armed must be executed by another user.

    Attributes:
        levels: what the program sees.
        shutdown: raised to bring the axis to rest and switch off.
    """

    def __init__(
        self,
        commands: Sequence[Ring],
        replies: Sequence[Ring],
        events: EventLog,
        rules: Rules,
        epoch: int,
        now: Callable[[], float] = time.monotonic,
        *,
        second_person: bool = False,
    ) -> None:
        self.arming = Arming(second_person=second_person)
        self.rules, self.events = rules, events
        self.authority, self.hold = Authority(epoch), HoldToRun(rules.lease_s)
        self.levels = OperatorCommand(
            speed_rad_s=rules.speed_rad_s, increment_rad=rules.increment_rad, override=1.0
        )
        self.shutdown = False
        self.on_reset: Callable[[Identity, bool], str] = lambda _who, _service: ""
        self.program: GantryProgram
        self.now = now
        self._inbox = Inbox(commands, replies, events)
        self._acting: PendingCommand | None = None
        self._refusals = 0
        self._gap = False
        self._stop_scans = 0
        self._test_epoch = 0
        self._test_ended = True

    def attach(self, program: GantryProgram) -> None:
        """The program that the levels go to."""
        self.program = program

    @property
    def at_rest(self) -> bool:
        """No motion under way or waiting."""
        axis = self.program.axis
        return axis.motion.current is None and axis.motion.waiting is None and axis.virtual.at_rest

    @property
    def testing(self) -> bool:
        """A brake test is under way."""
        return self.program.axis.brake_test.under_way

    def _answer(self, waiting: PendingCommand, refused: MessageRefused | None) -> None:
        self._inbox.answer(waiting, refused, self.authority.epoch)

    def _gone(self, gone: Gone) -> None:
        """The lease and the control of a connection end with it."""
        client, holder = gone.client, self.authority.holder
        if gone.everyone:
            self.arming.gone_all(local=gone.source == Source.LOCAL)
            if holder is None or holder.local != (gone.source == Source.LOCAL):
                return
            client = holder.client
        self.arming.gone(client)
        if self.hold.client == client:
            self.hold.end()
        self._free(client, "has gone")

    def _free(self, client: str, why: str) -> None:
        holder = self.authority.holder
        if self._give(client):
            self.events.put("authority", f"control is free: the holder {why}", holder)

    def _give(self, client: str) -> bool:
        """Control is free: keys are let go, and what stands still at override 0 does not wait for the next holder."""
        if not self.authority.give(client):
            return False
        self.hold.end()
        if self.program.axis.paused:
            self._begin_stop()
        return True

    def _stop_now(self, together: Sequence[PendingCommand]) -> None:
        """All stops of one kind in this scan are one stop; every release counts."""
        kind = together[0].message.kind
        if kind == "release":
            for each in together:
                self.hold.release(each.message.values["lease"], each.who.client)
        else:
            self.stop(quick=kind == "quick_stop")
        self._inbox.answer_all(together, self.authority.epoch)

    def stop(self, *, quick: bool = False) -> None:
        """Stop on the jog-release ramp, or by a quick stop; everything sent before is of the past."""
        self.hold.end()
        self.authority.new_epoch()
        self._begin_stop(quick=quick)

    def _begin_stop(self, *, quick: bool = False) -> None:
        axis = self.program.axis
        self._test_ended = True
        if quick:
            self._set(quick_stop=True)
            self._stop_scans = 1
        if self.testing and not quick:
            self._set(stop=True)
            self._stop_scans = 1
        elif axis.power.phase in RISING:
            self._set(power=False)
        elif not quick and axis.power.status and axis.alarms.first_out is None:
            self._set(stop=True)
            self._stop_scans = 1

    def _hold_stop(self) -> None:
        """Stop is held until the axis is at rest; quick stop is an edge."""
        self._stop_scans += 1
        if self._stop_scans > 2:
            self._set(quick_stop=False)
            if self.program.axis.virtual.at_rest or not self.levels.stop:
                self._set(stop=False)
                self._stop_scans = 0

    def _shut_down(self) -> None:
        """Come to rest, then power off."""
        self.hold.end()
        self._inbox.others.clear()
        if self.testing and not self._test_ended:
            self.stop()
        if self.levels.power and not self.levels.stop and not self._stop_scans:
            if self.at_rest:
                self._set(power=False)
            else:
                self.stop()

    def _set(self, **levels: Any) -> None:
        self.levels = self.levels._replace(**levels)
