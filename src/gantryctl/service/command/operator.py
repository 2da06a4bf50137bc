"""The operator of the scan engine that is people: commands from the rings, judged in the scan, one at a time.

A command that the program must judge is put on the levels of one scan; after that scan `settle` looks whether the
program refused it, and answers. Stops come first and are never refused.
"""

from __future__ import annotations

from typing import Final

from gantryctl.image import Mode, OperatorCommand
from gantryctl.program import Code, PowerPhase
from gantryctl.service.command.inbox import PendingCommand
from gantryctl.service.command.operator_state import OperatorState
from gantryctl.service.protocol.limits import HELD_S
from gantryctl.service.protocol.messages import ARMABLE, Identity, MessageRefused
from gantryctl.service.protocol.roles import Action, may

_PER_SCAN: Final = 8
"""Commands judged in one scan at most: refusing takes time too."""


class ServiceOperator(OperatorState):
    """Commands of people as operator levels of the scan; arguments and attributes of `OperatorState`."""

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
            holder = self.authority.holder
            self.events.put("command", f"hold-to-run: {self.hold.ended}, the axis stops", holder)
            if self.hold.too_long:
                self.program.axis.stop_by(Code.CTL_21, measured=HELD_S, limit=HELD_S)
        if self.authority.silent(now_s) and self.authority.holder is not None:
            self._free(self.authority.holder.client, "was silent for 2 s")
        if self.testing and not self._test_ended and self.authority.epoch != self._test_epoch:
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
        elif kind == "set":
            self._set(override=axis.virtual.override)
        self._answer(acting, MessageRefused(str(reason.code), reason.text))

    # --- everything else --------------------------------------------------------------------------

    def _carry_out(self, waiting: PendingCommand, now_s: float) -> None:
        """Judge one command, then do it at once or put it on the levels of this scan."""
        try:
            self._check_fresh(waiting)
            self.authority.alive(waiting.who, now_s)
            self.rules.check(self, waiting.who, waiting.message)
            done = self._do(waiting, now_s)
        except MessageRefused as refused:
            self._answer(waiting, refused)
            return
        if done:
            self._answer(waiting, None)
        else:
            self._acting = waiting

    def _check_fresh(self, waiting: PendingCommand) -> None:
        message = waiting.message
        self._inbox.check_sequence(waiting)
        self.rules.check_age(message, self.frame())
        if message.epoch is not None and message.epoch != self.authority.epoch:
            raise MessageRefused(
                "SEC-03", "sent before the last stop, reset or change of control: look, then ask again"
            )

    def frame(self) -> int:
        """Status frame number now."""
        return self.rules.frame(self.now())

    def _do(self, waiting: PendingCommand, now_s: float) -> bool:
        """True: done. False: the program decides in this scan."""
        who, message = waiting.who, waiting.message
        values = message.values
        match message.kind:
            case "alive":
                pass
            case "take":
                self._take(who, values["over"], now_s)
            case "give":
                self._give(who.client)
            case "renew":
                self._lease(self.hold.renew(values["lease"], who.client, now_s))
            case "jog":
                forward = values["direction"] == "forward"
                self._lease(self.hold.begin(values["lease"], who.client, forward, now_s))
                return False
            case "set":
                values["before"] = round(self.rules.present(self, values["tag"]), 6)  # for the journal
                self.rules.apply(self, values["tag"], float(values["value"]))
                return bool(values["tag"] != "override_percent")  # which may let a motion go on
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

    def _edge(self, waiting: PendingCommand) -> bool:
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
                self._test_epoch, self._test_ended = self.authority.epoch, False
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
        """Whether `who` may execute this now; raises MessageRefused."""
        self.arming.check(action, who, self.authority.epoch, self.now())

    def _take(self, who: Identity, over: bool, now_s: float) -> None:
        """Control, also over a moving axis when the local console wants it: that stops it first."""
        held = self.authority.holder
        if who.local and held is not None and held.client != who.client and not self.at_rest:
            self.stop()
        refused = self.authority.take(who, over, self.at_rest, now_s)
        if refused is not None:
            raise MessageRefused(*refused)
        self._set(remote=who.place == "remote")

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
            raise MessageRefused("SEC-09", reason)
