"""Operator commands from people: page, console and scripts, judged in the scan one at a time.

A command that the program must judge is put on the levels of one scan; after that scan `settle` sees whether the
program refused it, and answers. Stops come first and are never refused.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from gantryctl.image import Direction, Mode, OperatorCommand
from gantryctl.machine import Machine
from gantryctl.program import Code, GantryProgram
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.power.phases import RISING
from gantryctl.service.command import rules
from gantryctl.service.command.arming import Arming
from gantryctl.service.command.authority import Authority
from gantryctl.service.command.frame_clock import FrameClock
from gantryctl.service.command.inbox import Gone, Inbox, PendingCommand
from gantryctl.service.command.lease import HoldToRun
from gantryctl.service.command.permit import Permit
from gantryctl.service.command.rules import Situation
from gantryctl.service.command.unheld import UnheldPower
from gantryctl.service.protocol.limits import HELD_S, SILENCE_S, key_limits
from gantryctl.service.protocol.messages import SILENT, Identity, MessageRefused
from gantryctl.service.protocol.roles import ARMABLE
from gantryctl.units import deg, rad

# Refusing takes time too: a flood of commands must not make a scan late.
_PER_SCAN: Final = 8


class ServiceOperator:
    """The operator of the scan engine: control, leases, arming, and the levels that the program sees.

    Args:
        inbox: commands in, replies and events out.
        permit: what stands against power beside the program's alarms.
        acknowledge: marks an alarm row as seen; raises MessageRefused for an unknown one.
        levels: the first ones, see `first_levels`.
        epoch: the first one.
        now: the monotonic time, s.
        second_person: what one person arms, another one executes.

    Attributes:
        levels: what the program sees.
        ranges: lowest and highest value of every tag that can be set.
        frames: times of issue of the status frames.
        unheld: how long power has been on without control.
        shutdown: raised to bring the axis to rest and switch off.
        hands_over: it is raised because commissioning takes the axis next.
    """

    def __init__(
        self,
        machine: Machine,
        program: GantryProgram,
        inbox: Inbox,
        permit: Permit,
        acknowledge: Callable[[int, Identity], None],
        levels: OperatorCommand,
        *,
        epoch: int,
        now: Callable[[], float] = time.monotonic,
        second_person: bool = False,
    ) -> None:
        self.program, self._inbox, self.permit = program, inbox, permit
        self.events, self.refusals, self._acknowledge = inbox.events, inbox.refusals, acknowledge
        # Nine digits: 6 deg/s comes back from radians as 6.
        in_force = round(deg(program.axis.settings.speed.setting_max_rad_s), 9)
        self.ranges = rules.setting_ranges(machine, in_force)
        self.arming, self.authority = Arming(second_person=second_person), Authority(epoch)
        self.unheld = UnheldPower(program.axis, self.authority, machine.monitors.unheld_power_time_s)
        lease_s = machine.monitors.lease_ms * 1e-3
        self.hold, self._keys = HoldToRun(lease_s, machine.control.scan_period_ms * 1e-3), key_limits(lease_s)
        self.frames = FrameClock(now())
        self.levels, self.shutdown, self.hands_over = levels, False, False
        self._on_bus = machine.on_bus
        self.now = now
        self._acting: PendingCommand | None = None
        self._refusals = 0
        self._gap = False
        self._stop_scans = 0
        self._test_epoch = 0
        self._test_ended = True

    # --- one scan ---------------------------------------------------------------------------------

    def poll(self, time_s: float) -> OperatorCommand:
        """Take commands, then return the levels of this scan."""
        now_s, inbox = self.now(), self._inbox
        inbox.time_s = time_s
        self.frames.tick(now_s)
        holder = self.authority.holder
        inbox.receive(self.authority.epoch, "" if holder is None else holder.client)
        # Ended connections and stops come before commands: none of them may wait behind a queue.
        while inbox.gone:
            self._end_connection(inbox.gone.popleft())
        self.refusals.look()
        self._watch(now_s)
        for together in inbox.first.values():
            self._stop_now(together)
        # One scan without edges between two commands: the program must see every level fall before it rises again.
        if self._gap:
            self._gap = False
        else:
            for _ in range(_PER_SCAN):
                if inbox.others and self._acting is None:
                    self._carry_out(inbox.others.take(), now_s)
        if self._acting is None or self._acting.message.kind != "increment":
            self._follow_keys(now_s)
        self._refusals = self.program.axis.refusal_count
        return self.levels

    def settle(self) -> None:
        """After the scan: answer the command that was on its levels, and take edges back."""
        acting = self._acting
        if acting is None:
            return
        self._acting, self._gap = None, True
        kind, axis = acting.message.kind, self.program.axis
        self._set(move=False, halt=False, reset=False, brake_test=False)
        reason = axis.refusal if axis.refusal_count > self._refusals else None
        if reason is None:
            # A reset that was carried out ends the epoch: what was sent under the alarm was meant for another state.
            if kind == "reset":
                self.authority.new_epoch()
            self._answer(acting, None)
            return
        match kind:
            case "jog":
                self.hold.end()
            case "mode":
                self._set(mode=self.program.mode)
            case "power":
                self._set(power=False)
            case "set":
                self._set(override=axis.virtual.override)
        self._answer(acting, MessageRefused(reason.code, **reason.values))

    def _watch(self, now_s: float) -> None:
        """React to what comes without a command: lost leases, a silent holder, alarms, shutdown."""
        if self._stop_scans:
            self._keep_stopping()
        if self.hold.alive and self.hold.check(now_s):
            holder = self.authority.holder
            self.events.put("command", f"hold-to-run: {self.hold.ended}, the axis stops", holder)
            if self.hold.too_long:
                self.program.axis.stop_by(Code.CTL_21, measured=HELD_S, limit=HELD_S)
        if self.authority.silent(now_s) and self.authority.holder is not None:
            self._free(self.authority.holder.client, f"was silent for {SILENCE_S:g} s")
        if self.unheld.due(now_s, power=self.levels.power):
            limit_s = self.unheld.limit_s
            self.events.put("authority", f"power off: nobody had control for {limit_s:g} s", after_s=limit_s)
            self._set(power=False)
        # Decision 0014: a brake test ends with its epoch. Its starter lost control, or a reset or stop came.
        if self._testing and not self._test_ended and self.authority.epoch != self._test_epoch:
            self.stop()
        # After an alarm a held key must be pressed again, and power needs a new command.
        first_out = self.program.axis.alarms.first_out is not None
        if first_out:
            self.hold.end()
        if self.shutdown:
            self._shut_down()
        elif first_out and self.levels.power:
            self._set(power=False)

    def _follow_keys(self, now_s: float) -> None:
        levels, hold = self.levels, self.hold
        if levels.lease != hold.count:
            self._set(lease=hold.count, lease_age_s=now_s - hold.issued_s)
        if (levels.forward, levels.reverse) != (hold.forward, hold.reverse):
            self._set(forward=hold.forward, reverse=hold.reverse)

    # --- one command ------------------------------------------------------------------------------

    def _carry_out(self, pending: PendingCommand, now_s: float) -> None:
        """Judge one command, then do it at once or put it on the levels of this scan."""
        _, who, message = pending
        now = self.situation(now_s, who, self.frames.issued_s(message.frame, who.client))
        try:
            self._inbox.check_sequence(pending)
            if not rules.counts(message, now):
                return
            rules.check_fresh(message, now)
            # A stale command is no sign of life: after a freeze of the network they arrive in a burst.
            self.authority.alive(who, now_s)
            rules.check_allowed(message, who, now)
            if self.shutdown and message.kind not in SILENT:
                raise MessageRefused(Code.SYS_07)
            done = self._do(pending, now, now_s)
        except MessageRefused as refused:
            self._answer(pending, refused)
            return
        if done:
            self._answer(pending, None)
        else:
            self._acting = pending

    def situation(self, now_s: float, who: Identity, issued_s: float) -> Situation:
        """Describe the moment of a command to the rules.

        Args:
            who: sends it.
            issued_s: when the status frame was issued that it names; nan for an unknown one.
        """
        axis, authority, permit = self.program.axis, self.authority, self.permit
        round_trip_s = now_s - issued_s
        if authority.holds(who):
            authority.round_trip.take(round_trip_s, now_s)
            round_trip_s = authority.round_trip.shortest_s(now_s)
        return Situation(
            epoch=authority.epoch,
            time_s=now_s,
            issued_s=issued_s,
            round_trip_s=round_trip_s,
            keys=self._keys,
            holder=authority.holder,
            mode=self.program.mode,
            paused=axis.paused,
            armed=self.arming.now(authority.epoch, now_s),
            second_person=self.arming.second_person,
            shutdown=self.shutdown,
            journal_keeps=permit.keeps_events,
            blocked_by=permit.blocked_by,
            untestable=axis.settings.power.untestable,
            reset_locked=permit.reset_locked,
        )

    def _do(self, pending: PendingCommand, now: Situation, now_s: float) -> bool:
        """Carry a command out; False when the program decides in this scan."""
        who, message = pending.who, pending.message
        values = message.values
        match message.kind:
            case "alive" | "note":
                pass  # the event of a note is all that it does
            case "take":
                self._take(who, values["over"], now_s)
            case "give":
                self._give(who.client)
            case "renew":
                _check_lease(self.hold.renew(values["lease"], who.client, now.issued_s, now_s))
            case "jog":
                forward = values["direction"] == "forward"
                begun = self.hold.begin(values["lease"], who.client, forward, now.issued_s, now_s)
                _check_lease(begun)
                return False
            case "set":
                self._change(values)
                return bool(values["tag"] != "override_percent")  # which may let a motion go on
            case "arm":
                step = values.get("step", "")
                self.arming.arm(ARMABLE[values["action"]], who, now.epoch, now_s, step)
            case "acknowledge":
                self._acknowledge(values["id"], who)
            case "power":
                return self._power(values["on"])
            case "commission_begin" | "commission_step" | "commission_end":
                self._hand_over(message.kind, now)
            case "mode":
                mode = Mode[values["mode"].upper()]
                self._set(mode=mode)
                return mode is self.program.mode
            case _:
                self._give_edge(pending, now)
                return False
        return True

    def _give_edge(self, pending: PendingCommand, now: Situation) -> None:
        """Raise the level of a command that the program takes as an edge."""
        values = pending.message.values
        match pending.message.kind:
            case "increment":
                forward = values["direction"] == "forward"
                self._set(forward=forward, reverse=not forward)
            case "move":
                asked = values.get("direction")
                direction = None if asked is None else Direction[asked.upper()]
                self._set(
                    move=True, relative=False, target_rad=rad(values["target_deg"]), direction=direction
                )
            case "move_by":
                self._set(move=True, relative=True, target_rad=rad(values["distance_deg"]), direction=None)
            case "halt":
                self._set(halt=True)
            case "brake_test":
                self.arming.use()
                self._test_epoch, self._test_ended = now.epoch, False
                self._set(brake_test=True)
            case _:  # reset
                self._reset(pending.who, service=rules.resets_locked(pending.who, now))

    def _change(self, values: dict[str, Any]) -> None:
        """Change one setting; its old value goes into the journal beside the new one."""
        tag, value = values["tag"], float(values["value"])
        values["before"] = round(self.setting(tag), 6)
        rules.check_setting(value, self.ranges[tag])
        match tag:
            case "speed_setting_deg_s":
                self._set(speed_rad_s=rad(value))
            case "increment_deg":
                self._set(increment_rad=rad(value))
            case "override_percent":
                self._set(override=value / 100.0)
            case _:  # acc_setting_deg_s2
                refused = self.program.axis.set_acceleration(rad(value))
                if refused is not None:
                    raise MessageRefused(refused.code, **refused.values)

    def setting(self, tag: str) -> float:
        """One setting as it is, in the unit of its tag."""
        return {
            "speed_setting_deg_s": deg(self.levels.speed_rad_s),
            "increment_deg": deg(self.levels.increment_rad),
            "override_percent": self.levels.override * 100.0,
            "acc_setting_deg_s2": deg(self.program.axis.virtual.ramps.acc_rad_s2),
        }[tag]

    def _power(self, on: bool) -> bool:
        if on and self.levels.power and not self.program.axis.is_off:
            return True
        if not on:
            self.hold.end()
            if self._testing:
                self.stop()
        self._set(power=on)
        return not on

    def _hand_over(self, kind: str, now: Situation) -> None:
        """End with power off, so that commissioning has the axis next."""
        if kind != "commission_begin":
            raise MessageRefused(Code.CTL_14, reason=Words.NOT_BEING_COMMISSIONED)
        if not self._on_bus:
            raise MessageRefused(Code.CTL_14, reason=Words.NO_DRIVE_TO_COMMISSION)
        if not now.journal_keeps:
            raise MessageRefused(Code.JRN_02, reason=Words.NO_JOURNAL)
        if not self.program.axis.is_off:
            raise MessageRefused(Code.CTL_14, reason=Words.POWER_OFF_TO_COMMISSION)
        self.shutdown = self.hands_over = True

    def _reset(self, who: Identity, *, service: bool) -> None:
        if service:
            self.arming.use()
        self.permit.reset(who, service=service)
        self.program.service = service
        self._set(reset=True)

    def _answer(self, pending: PendingCommand, refused: MessageRefused | None) -> None:
        self._inbox.answer(pending, refused, self.authority.epoch)

    # --- control ----------------------------------------------------------------------------------

    def _take(self, who: Identity, over: bool, now_s: float) -> None:
        """Give control to `who`."""
        held = self.authority.holder
        # Decision 0011: the local console comes first. It stops what moves, then takes control from anybody.
        if who.local and held is not None and held.client != who.client and not self.program.axis.at_rest:
            self.stop()
        refused = self.authority.take(who, over, self.program.axis.at_rest, now_s)
        if refused is not None:
            raise MessageRefused(refused.code, **refused.values)
        if self.hold.client != who.client:
            self.hold.end()
        self._set(remote=who.remote)

    def _end_connection(self, gone: Gone) -> None:
        client = gone.end(self.arming, self.authority.holder)
        if client is not None:
            self._free(client, "has gone")

    def _free(self, client: str, why: str) -> None:
        holder = self.authority.holder
        if self._give(client):
            self.events.put("authority", f"control is free: the holder {why}", holder)

    def _give(self, client: str) -> bool:
        if not self.authority.give(client):
            return False
        self.hold.end()
        # Decision 0011: a motion that stands still at override 0 would be set going by the next holder.
        if self.program.axis.paused:
            self._begin_stop()
        return True

    # --- stops ------------------------------------------------------------------------------------

    def stop(self, *, quick: bool = False) -> None:
        """Stop on the jog-release ramp, or by a quick stop; commands sent before are void."""
        self.hold.end()
        self.authority.new_epoch()
        self._begin_stop(quick=quick)

    def _stop_now(self, together: Sequence[PendingCommand]) -> None:
        """Treat all stops of one kind in this scan as one; every release counts."""
        kind = together[0].message.kind
        if kind == "release":
            for each in together:
                self.hold.release(each.message.values["lease"], each.who.client)
        else:
            self.stop(quick=kind == "quick_stop")
        self._inbox.answer_all(together, self.authority.epoch)

    @property
    def _testing(self) -> bool:
        return self.program.axis.brake_test.under_way

    def _begin_stop(self, *, quick: bool = False) -> None:
        axis = self.program.axis
        self._test_ended = True
        if quick:
            self._set(quick_stop=True)
            self._stop_scans = 1
        # A brake test ends by a stop, a power-up by taking power back, a motion by a stop; an axis that an alarm is
        # stopping already needs none.
        if self._testing and not quick:
            self._set(stop=True)
            self._stop_scans = 1
        elif axis.power.phase in RISING:
            self._set(power=False)
        elif not quick and axis.power.status and axis.alarms.first_out is None:
            self._set(stop=True)
            self._stop_scans = 1

    def _keep_stopping(self) -> None:
        """Keep the level of a stop until the axis is at rest; a quick stop is an edge."""
        self._stop_scans += 1
        if self._stop_scans > 2:
            self._set(quick_stop=False)
            if self.program.axis.virtual.at_rest or not self.levels.stop:
                self._set(stop=False)
                self._stop_scans = 0

    def _shut_down(self) -> None:
        """Come to rest, then switch power off."""
        self.hold.end()
        if self._testing and not self._test_ended:
            self.stop()
        if self.levels.power and not self.levels.stop and not self._stop_scans:
            if self.program.axis.at_rest:
                self._set(power=False)
            else:
                self.stop()

    def _set(self, **levels: Any) -> None:
        self.levels = self.levels._replace(**levels)


def _check_lease(reason: Words | Said | None) -> None:
    if reason is not None:
        raise MessageRefused(Code.SEC_09, reason=reason)
