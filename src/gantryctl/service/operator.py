"""The operator of the scan engine that is people: commands from the rings, judged in the scan, one at a time.

A command that the program must judge is put on the levels of one scan; after that scan `settle` looks whether the
program refused it, and answers. Stops come first and are never refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from gantryctl.image import Mode, OperatorCommand
from gantryctl.program import GantryProgram, PowerPhase
from gantryctl.program.power_phases import RISING
from gantryctl.service.arming import Arming
from gantryctl.service.authority import Authority
from gantryctl.service.events import EventLog
from gantryctl.service.inbox import Gone, Inbox
from gantryctl.service.lease import HoldToRun
from gantryctl.service.memory import Source
from gantryctl.service.messages import ARMABLE, Identity, Refused
from gantryctl.service.ring import Ring
from gantryctl.service.roles import Action, may
from gantryctl.service.rules import Rules
from gantryctl.service.waiting import Waiting

_PER_SCAN: Final = 8
"""Commands judged in one scan at most: refusing takes time too."""


class ServiceOperator:
    """Commands of people as operator levels of the scan.

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
        self._acting: Waiting | None = None
        self._refusals = 0
        self._gap = False
        self._stop_scans = 0
        self._test_epoch = 0

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
        return self.program.axis.power.testing

    # --- once a scan ------------------------------------------------------------------------------

    def poll(self, time_s: float) -> OperatorCommand:
        """The levels of this scan."""
        now_s, inbox = self.now(), self._inbox
        inbox.time_s = time_s
        holder = self.authority.holder
        inbox.receive(self.authority.epoch, "" if holder is None else holder.client)
        while inbox.gone:
            self._gone(inbox.gone.popleft())
        self._watch(now_s)
        for together in inbox.first.values():
            self._stop_now(together)
        if self._gap:
            self._gap = False
        else:
            for _ in range(_PER_SCAN):
                if inbox.others and self._acting is None:
                    self._carry_out(inbox.others.take(), now_s)
        if self._acting is None or self._acting.message.kind != "increment":
            self._keys()
        self._refusals = self.program.axis.refusal_count
        return self.levels

    def _watch(self, now_s: float) -> None:
        """What happens without a command: leases that run out, a holder that is silent, alarms, shutdown."""
        if self._stop_scans:
            self._hold_stop()
        if self.hold.alive and self.hold.check(now_s):
            self.events.put(
                "command", "hold-to-run: the lease ran out, the axis stops", self.authority.holder
            )
        if self.authority.silent(now_s) and self.authority.holder is not None:
            self._free(self.authority.holder.client, "was silent for 2 s")
        if self.testing and self.authority.epoch != self._test_epoch and not self.levels.stop:
            self.stop()  # whoever began the brake test has lost control, or somebody reset
        first_out = self.program.axis.alarms.first_out is not None
        if first_out:
            self.hold.end()
        if self.shutdown:
            self._shut_down()
        elif first_out and self.levels.power:
            self._set(power=False)  # Power needs a new edge after an alarm

    def _keys(self) -> None:
        """The hold-to-run keys as they are now."""
        levels, hold = self.levels, self.hold
        if (levels.forward, levels.reverse, levels.lease) != (hold.forward, hold.reverse, hold.count):
            self._set(forward=hold.forward, reverse=hold.reverse, lease=hold.count)

    def settle(self) -> None:
        """After the scan: answer the command that was on its levels, and take edges back."""
        acting = self._acting
        if acting is None:
            return
        self._acting, self._gap = None, True
        kind, axis = acting.message.kind, self.program.axis
        self._set(move=False, halt=False, reset=False, brake_test=False)
        if kind == "increment":
            self._set(forward=False, reverse=False)
        reason = axis.refusal if axis.refusal_count > self._refusals else None
        if reason is None:
            if kind == "reset":
                self.authority.new_epoch()
            self._answer(acting, None)
            return
        if kind == "jog":
            self.hold.end()
        elif kind == "mode":
            self._set(mode=self.program.mode)
        elif kind == "power":
            self._set(power=False)
        self._answer(acting, Refused(str(reason.code), reason.text))

    def _answer(self, waiting: Waiting, refused: Refused | None) -> None:
        self._inbox.answer(waiting, refused, self.authority.epoch)

    def _gone(self, gone: Gone) -> None:
        """The lease and the control of a connection end with it."""
        client, holder = gone.client, self.authority.holder
        if gone.everyone:
            if holder is None or holder.local != (gone.source == Source.LOCAL):
                return
            client = holder.client
        self.arming.gone(client)
        if self.hold.client == client:
            self.hold.end()
        self._free(client, "has gone")

    def _free(self, client: str, why: str) -> None:
        holder = self.authority.holder
        if self.authority.give(client):
            self.hold.end()
            self.events.put("authority", f"control is free: the holder {why}", holder)

    # --- stopping: always ---------------------------------------------------------------------------

    def _stop_now(self, together: Sequence[Waiting]) -> None:
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
        axis = self.program.axis
        if quick:
            self._set(quick_stop=True)
            self._stop_scans = 1
        if self.testing:
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
        if self.testing and not self.levels.stop:
            self.stop()
        if self.levels.power and not self.levels.stop and not self._stop_scans:
            if self.at_rest:
                self._set(power=False)
            else:
                self.stop()

    # --- everything else --------------------------------------------------------------------------

    def _carry_out(self, waiting: Waiting, now_s: float) -> None:
        """Judge one command, then do it at once or put it on the levels of this scan."""
        try:
            self._check_fresh(waiting)
            self.authority.alive(waiting.who, now_s)
            self.rules.check(self, waiting.who, waiting.message)
            done = self._do(waiting, now_s)
        except Refused as refused:
            self._answer(waiting, refused)
            return
        if done:
            self._answer(waiting, None)
        else:
            self._acting = waiting

    def _check_fresh(self, waiting: Waiting) -> None:
        message = waiting.message
        self._inbox.check_sequence(waiting)
        self.rules.check_age(message, self.frame())
        if message.epoch is not None and message.epoch != self.authority.epoch:
            raise Refused(
                "SEC-03", "sent before the last stop, reset or change of control: look, then ask again"
            )

    def frame(self) -> int:
        """Status frame number now."""
        return self.rules.frame(self.now())

    def _do(self, waiting: Waiting, now_s: float) -> bool:
        """True: done. False: the program decides in this scan."""
        who, message = waiting.who, waiting.message
        values = message.values
        match message.kind:
            case "alive":
                pass
            case "take":
                self._take(who, values["over"], now_s)
            case "give":
                if self.hold.client == who.client:
                    self.hold.end()
                self.authority.give(who.client)
            case "renew":
                self._lease(self.hold.renew(values["lease"], who.client, now_s))
            case "jog":
                forward = values["direction"] == "forward"
                self._lease(self.hold.begin(values["lease"], who.client, forward, now_s))
                return False
            case "set":
                self.rules.apply(self, values["tag"], float(values["value"]))
            case "arm":
                action = ARMABLE[values["action"]]
                self.arming.arm(action, who, self.authority.epoch, now_s)
            case "acknowledge":
                self.rules.acknowledge(values["id"], who)
            case "power":
                return self._power(values["on"])
            case _:
                return self._edge(waiting)
        return True

    def _edge(self, waiting: Waiting) -> bool:
        """Commands that the program takes as an edge; True when there is nothing to do."""
        who, values = waiting.who, waiting.message.values
        match waiting.message.kind:
            case "mode":
                mode = Mode[values["mode"].upper()]
                if mode is self.program.mode:
                    return True
                self._set(mode=mode)
            case "increment":
                key = values["direction"]
                self._set(forward=key == "forward", reverse=key == "reverse")
            case "move":
                self._set(move=True, target_rad=self.rules.rad(values["target_deg"]))
            case "halt":
                self._set(halt=True)
            case "brake_test":
                self.arming.use()
                self._test_epoch = self.authority.epoch
                self._set(brake_test=True)
            case "reset":
                self._reset(who)
        return False

    def _reset(self, who: Identity) -> None:
        """Locked alarms too when that was armed; then the arming is used up."""
        service = self.rules.locked() and may(who.role, Action.RESET_LOCKED)
        if service:
            self.arming.use()
        self.on_reset(who, service)
        self.program.service = service
        self._set(reset=True)

    def check_armed(self, action: Action, who: Identity) -> None:
        """Whether `who` may execute this now; raises Refused."""
        self.arming.check(action, who, self.authority.epoch, self.now())

    def _take(self, who: Identity, over: bool, now_s: float) -> None:
        """Control, also over a moving axis when the local console wants it: that stops it first."""
        held = self.authority.holder
        if who.local and held is not None and held.client != who.client and not self.at_rest:
            self.stop()
        refused = self.authority.take(who, over, self.at_rest, now_s)
        if refused is not None:
            raise Refused(*refused)

    def _power(self, on: bool) -> bool:
        if on and self.levels.power and self.program.axis.power.phase is not PowerPhase.OFF:
            return True
        if not on:
            self.hold.end()
            if self.testing:
                self.stop()
        self._set(power=on)
        return not on

    @staticmethod
    def _lease(reason: str | None) -> None:
        if reason is not None:
            raise Refused("SEC-09", reason)

    def _set(self, **levels: Any) -> None:
        self.levels = self.levels._replace(**levels)
