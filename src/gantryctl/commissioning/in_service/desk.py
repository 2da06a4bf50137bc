"""The desk of commissioning: commands of people in, tags out, in a thread of its own beside the step under way.

It takes the place of the controller at the shared memory: the same rings, the same rules, the same tags. A Stop comes
here from every page, whatever the step does meanwhile, and ends it in its next scan.
"""

from __future__ import annotations

import math
import secrets
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Final

from gantryctl.commissioning.in_service.board import Board
from gantryctl.commissioning.in_service.tags import fast_tags, slow_tags
from gantryctl.commissioning.run import Reach, Step
from gantryctl.commissioning.watch import Halt, StepWatch
from gantryctl.image import Mode
from gantryctl.machine import Machine
from gantryctl.operation.client import Stop
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.reason import Reasons
from gantryctl.program.alarms.words import Words
from gantryctl.service.command import rules
from gantryctl.service.command.arming import Arming, check_armed
from gantryctl.service.command.authority import Authority
from gantryctl.service.command.frame_clock import FrameClock
from gantryctl.service.command.inbox import Gone, Inbox, PendingCommand
from gantryctl.service.command.rules import Situation
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import JournalHealth, SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import publish_fast, publish_json
from gantryctl.service.protocol.limits import SILENCE_S, WATCHED_S, key_limits
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import ARMABLE, Action
from gantryctl.service.protocol.second_request import SecondRequest
from gantryctl.service.protocol.tags import CommissioningPhase

# Between two looks into the rings; the tags go out with every second one.
LOOK_S: Final = 0.005
# A load that torque alone holds is let go so long after the service was asked to end, so that the run keeps what it
# knows: after 25 s the process would be killed (service/supervisor/process.py).
_HELD_S: Final = 10.0


class Desk:
    """Who may do what in a commissioning under way, and the picture of it.

    Args:
        board: steps and ledger.
        watching: the watch over the step under way, None before it has begun.
        second_person: what one person arms, another one executes.
        now: the monotonic time, s.

    Attributes:
        phase, step: what goes on; the key of the step under way, "" for none.
        halt: ends the step under way.
    """

    def __init__(
        self,
        machine: Machine,
        memory: SharedMemory,
        board: Board,
        watching: Callable[[], StepWatch | None],
        *,
        second_person: bool = False,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._machine, self._memory, self.board, self._watching = machine, memory, board, watching
        # Commands in the rings were sent to the controller, which is gone.
        for ring in memory.commands:
            ring.clear()
        self.events = EventLog(memory.events[Source.CONTROLLER])
        self._inbox = Inbox(memory.commands, memory.replies, self.events)
        self._journal = JournalHealth(memory.words)
        # Epochs start from a random number, so that none of the controller is met again (decision 0011).
        self.authority, self.arming = Authority(secrets.randbits(40)), Arming(second_person=second_person)
        self._now, self._begun_s = now, now()
        self.frames = FrameClock(self._begun_s)
        self._keys = key_limits(machine.monitors.lease_ms * 1e-3)
        self.phase, self.step = CommissioningPhase.SETTING_UP, ""
        self._beginner: Identity | None = None
        self.halt = Halt()
        self._reach = Reach.NOTHING
        self._orders: SimpleQueue[Step | None] = SimpleQueue()
        self._told: deque[tuple[str, str, bool, dict[str, str]]] = deque()
        self._shown: object = None
        self._looks = 0
        self._ending_s, self._held = math.inf, False
        self._second = SecondRequest()
        self._ended = threading.Event()

    # --- the step's side, another thread ----------------------------------------------------------

    @property
    def by(self) -> str:
        """User whose step it is, or was; "" before the first one."""
        return "" if self._beginner is None else self._beginner.user

    def next_order(self) -> Step | None:
        """Wait for the next step that a person wants; None to end."""
        return self._orders.get()

    def step_ended(self) -> None:
        """The step under way has ended, one way or the other."""
        self.step = ""
        if self.phase is CommissioningPhase.RUNNING:
            self.phase = CommissioningPhase.WAITING

    def set_up(self) -> None:
        """The drive is set up: steps may begin."""
        if self.phase is CommissioningPhase.SETTING_UP:
            self.phase = CommissioningPhase.WAITING

    def tell(self, kind: str, text: str, **values: str) -> None:
        """Hand an event to this desk, which alone writes its ring."""
        self._told.append((kind, text, False, values))

    def tell_of_step(self, kind: str, text: str, **values: str) -> None:
        """The same of the step under way: it is that of whoever began it, whoever has control when it ends."""
        self._told.append((kind, text, True, values))

    def end(self, why: str) -> None:
        """Stop the step under way, and end."""
        self.halt.ask(Stop.RAMP, why)
        self.phase = CommissioningPhase.ENDING
        self._orders.put(None)

    def close(self) -> None:
        """Leave `run`."""
        self._ended.set()

    # --- this thread ------------------------------------------------------------------------------

    def run(self) -> None:
        """Look until the end. A fault here stops the step: nobody would hear a Stop any more."""
        try:
            while not self._ended.is_set():
                self.look()
                time.sleep(LOOK_S)
            # What was told between the last look and the end.
            self.look()
        except Exception as fault:
            self.end(f"the desk of commissioning has failed: {fault!r}")
            raise

    def look(self) -> None:
        """Take what has come, then tell what is."""
        now_s, inbox = self._now(), self._inbox
        self.halt.listened()
        inbox.time_s = now_s - self._begun_s
        self.frames.tick(now_s)
        while self._told:
            kind, text, of_step, values = self._told.popleft()
            who = self._beginner if of_step else self.authority.holder
            self.events.put(kind, text, who, **values)
        holder = self.authority.holder
        inbox.receive(self.authority.epoch, "" if holder is None else holder.client)
        while inbox.gone:
            self._end_connection(inbox.gone.popleft())
        inbox.refusals.look()
        for together in inbox.first.values():
            self._stop_now(together)
        self._watch_over(now_s)
        self._look_at_load(now_s)
        while inbox.others:
            self._carry_out(inbox.others.take(), now_s)
        self._looks += 1
        if self._looks % 2 == 0:
            self._publish(now_s)

    def _watch_over(self, now_s: float) -> None:
        """A step ends when nobody watches it any more: its page is gone, hangs, or has lost its network."""
        if self.authority.holder is None:
            return
        user = self.authority.holder.user
        if self.authority.silent(now_s, WATCHED_S):
            self._halt(f"the page of {user}, who watches it, was silent for {WATCHED_S:g} s")
        if self.authority.silent(now_s):
            self._free(self.authority.holder.client, f"was silent for {SILENCE_S:g} s")

    def _look_at_load(self, now_s: float) -> None:
        """Tell of a load that torque alone holds, and let it go in time where the service ends."""
        held, self._held = self._held, self.halt.holds_load
        if self._held and not held:
            text = f"step {self.step}: torque alone holds the load; two requests to stop let it go"
            self.events.put("alarm", text, self.authority.holder)
            self._second.forget()
        if self.phase is CommissioningPhase.ENDING:
            self._ending_s = min(self._ending_s, now_s)
            if self._held and now_s - self._ending_s >= _HELD_S:
                self.halt.ask(Stop.QUICK, "the service ends")

    def _halt(self, why: str, urgency: Stop = Stop.RAMP) -> None:
        if self.step and urgency > self.halt.urgency:
            self.halt.ask(urgency, why)
            self.events.put("command", f"step {self.step} is stopped: {why}", self.authority.holder)

    def _stop_now(self, together: Sequence[PendingCommand]) -> None:
        """Treat all stops of one kind as one; commands sent before are void."""
        kind = together[0].message.kind
        if kind != "release":
            self.authority.new_epoch()
            urgency = Stop.QUICK if kind == "quick_stop" else Stop.RAMP
            why = f"stopped by {together[0].who.user}"
            if self._held:
                self._ask_with_load(together, urgency, why)
            else:
                self._halt(why, urgency)
        self._inbox.answer_all(together, self.authority.epoch)

    def _ask_with_load(self, together: Sequence[PendingCommand], urgency: Stop, why: str) -> None:
        """Count the presses of people while torque alone holds the load: a page that falls silent lets no load go."""
        for user in {each.who.user for each in together}:
            if self._second.asked(user):
                self.halt.ask(urgency, why)

    # --- commands ---------------------------------------------------------------------------------

    def _carry_out(self, pending: PendingCommand, now_s: float) -> None:
        """Judge one command and do it."""
        _, who, message = pending
        now = self._situation(who, self.frames.issued_s(message.frame, who.client), now_s)
        refused: MessageRefused | None = None
        try:
            self._inbox.check_sequence(pending)
            if not rules.counts(message, now):
                return
            rules.check_fresh(message, now)
            self.authority.alive(who, now_s)
            rules.check_allowed(message, who, now)
            self._do(pending, now)
        except MessageRefused as fault:
            refused = fault
        self._inbox.answer(pending, refused, self.authority.epoch)

    def _situation(self, who: Identity, issued_s: float, now_s: float) -> Situation:
        authority, round_trip_s = self.authority, now_s - issued_s
        if authority.holds(who):
            authority.round_trip.take(round_trip_s, now_s)
        return Situation(
            epoch=authority.epoch,
            time_s=now_s,
            issued_s=issued_s,
            round_trip_s=round_trip_s,
            keys=self._keys,
            holder=authority.holder,
            mode=Mode.NONE,
            paused=False,
            armed=self.arming.now(authority.epoch, now_s),
            second_person=self.arming.second_person,
            shutdown=self.phase is CommissioningPhase.ENDING,
            journal_keeps=self._journal.keeps and self.events.room,
            blocked_by=Reasons(),
            untestable=None,
            reset_locked=False,
        )

    def _do(self, pending: PendingCommand, now: Situation) -> None:
        who, values = pending.who, pending.message.values
        match pending.message.kind:
            case "alive" | "note":
                pass
            case "take":
                self._take(who, values["over"], now.time_s)
            case "give":
                self._free(who.client, "gave it back")
            case "arm" if values["action"] == "commission":
                step = self.board.step(values["step"])
                self.arming.arm(ARMABLE["commission"], who, now.epoch, now.time_s, step.key)
            case "commission_step":
                self._begin(self.board.step(values["step"]), who, now)
            case "commission_end":
                self._refuse_unless(self.phase is CommissioningPhase.WAITING, Words.STEP_UNDER_WAY)
                self.phase = CommissioningPhase.ENDING
                self._orders.put(None)
            case _:
                raise MessageRefused(Code.CTL_14, reason=Words.BEING_COMMISSIONED)

    def _begin(self, step: Step, who: Identity, now: Situation) -> None:
        """Begin a step: one that moves at the console of the machine only, and armed."""
        self._refuse_unless(self.phase is CommissioningPhase.WAITING, Words.STEP_UNDER_WAY)
        if not now.journal_keeps:
            raise MessageRefused(Code.JRN_02, reason=Words.NO_JOURNAL)
        self.board.check_turn(step)
        if step.reach is not Reach.NOTHING:
            self._refuse_unless(not who.remote, Words.STEP_AT_CONSOLE)
            check_armed(now.armed, Action.COMMISSION, who, step.key, second_person=now.second_person)
            self.arming.use()
        self.halt = Halt(listens=True)
        self._beginner = who
        self.phase, self.step, self._reach = CommissioningPhase.RUNNING, step.key, step.reach
        self._orders.put(step)

    def _refuse_unless(self, holds: bool, why: Words) -> None:
        if not holds:
            raise MessageRefused(Code.CTL_14, reason=why)

    # --- control ----------------------------------------------------------------------------------

    def _take(self, who: Identity, over: bool, now_s: float) -> None:
        held = self.authority.holder
        # Decision 0011: the local console comes first.
        if who.local and held is not None and held.client != who.client:
            self._halt(f"{who.user} took control")
        at_rest = self._reach is Reach.NOTHING or not self.step
        refused = self.authority.take(who, over, at_rest, now_s)
        if refused is not None:
            raise MessageRefused(refused.code, **refused.values)

    def _end_connection(self, gone: Gone) -> None:
        client = gone.end(self.arming, self.authority.holder)
        if client is not None:
            self._free(client, "has gone")

    def _free(self, client: str, why: str) -> None:
        """Free control; the step of who had it ends."""
        holder = self.authority.holder
        if holder is not None and self.authority.give(client):
            self._halt(f"{holder.user}, who watches it, {why}")
            self.events.put("authority", f"control is free: the holder {why}", holder)

    # --- tags -------------------------------------------------------------------------------------

    def _publish(self, now_s: float) -> None:
        step = self.step
        watch = self._watching() if step else None
        seen, left_s = (None, math.nan) if watch is None else (watch.seen, watch.meter.left_s)
        moves = bool(step) and self._reach is not Reach.NOTHING
        fast = fast_tags(self._machine, seen, moves=moves, holds_load=self._held)
        events = self._memory.events[Source.CONTROLLER]
        own = {
            "issued_ms": self.frames.issued_ms,
            "epoch": self.authority.epoch,
            "scan": self._looks,
            "time_s": now_s - self._begun_s,
            "armed_left_s": self.arming.left_s(self.authority.epoch, now_s),
            "round_trip_ms": self.authority.round_trip.shortest_s(now_s) * 1e3,
            "journal_sequence": events.written,
            "journal_committed": events.done,
            "journal_state": self._memory.words[Word.JOURNAL_STATE],
            "commissioning_left_s": left_s,
        }
        publish_fast(self._memory.fast, {**fast, **own}, self.frames.key)
        armed = self.arming.now(self.authority.epoch, now_s)
        shown = (self.authority.holder, armed, self.phase, step, self.board.results)
        if shown != self._shown:
            self._shown = shown
            slow = slow_tags(
                self._machine, self.authority.holder, armed, second_person=self.arming.second_person
            )
            slow |= {
                "commissioning": self.phase.name.lower(),
                "commissioning_step": step,
                "commissioning_results": self.board.results,
            }
            publish_json(self._memory.slow, slow)
