"""The controller of the service in virtual time, and people who command it by messages; what goes wrong is told.

Everything from the ring of commands to the plant is that of the service: its operator with control, leases and frame
marks, the program, alarms, brake watch, retained memory on the disk, and the journal with its retention. Not there:
pages, gateway and the publisher of their tags, whose memory `make soak` watches in real time; rows of recordings are
made and thrown away.
"""

from __future__ import annotations

import hashlib
import json
import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from gantryctl.drives.simulated import SimDrive
from gantryctl.machine import Machine
from gantryctl.operation.store import StateStore
from gantryctl.program import AxisState
from gantryctl.program.alarms.codes import Severity
from gantryctl.runtime import Engine, VirtualClock
from gantryctl.service.controller.process import Controller
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.protocol.messages import Identity, to_record
from gantryctl.service.protocol.roles import Role
from gantryctl.service.recorder.process import EventWriter
from gantryctl.service.recorder.retention import RetentionPolicy
from gantryctl.units import deg
from support.marks import newest_mark

RENEW_S: Final = 0.03
_ALIVE_S: Final = 0.4
_REPLY_S: Final = 0.3
_REST_S: Final = 150.0
# One cause may come again all day.
_TOLD_MOST: Final = 10
POLICY: Final = RetentionPolicy(journal_mb=4, journal_days=30)
"""Small, so that both limits of the journal act within a few dozen days."""
SERVICE_DESK: Final = Identity("c-service", "serena", Role.SERVICE, "console")


class Stuck(Exception):
    """The controller does not do what it is asked for, and what it says about it."""


@dataclass
class Counts:
    """What one slice has done and found.

    Attributes:
        scans: computed one by one.
        on_s: machine time with the controller on.
        troubles: the first stops, warnings, refusals and unfinished motions that nobody caused, each with its place.
        told: how many there were.
        worst_following_deg, worst_angle_deg: largest set-point minus measured angle of any scan with power on; largest
            difference of load and target after a move.
        offset_counts: told minus true angle of the motor when the slice began, counts of the absolute encoder.
        drift_counts: the same at the end of a start, minus that of the delivered machine; the largest.
        memory: memory of this process after each hour with the controller on: machine time in h, MB.
    """

    scans: int = 0
    on_s: float = 0.0
    moves: int = 0
    jogs: int = 0
    increments: int = 0
    operator_stops: int = 0
    power_ups: int = 0
    starts: int = 0
    brake_tests: int = 0
    events: int = 0
    stops: dict[str, int] = field(default_factory=dict)
    warnings: dict[str, int] = field(default_factory=dict)
    troubles: list[str] = field(default_factory=list)
    told: int = 0
    worst_following_deg: float = 0.0
    worst_angle_deg: float = 0.0
    offset_counts: float = 0.0
    drift_counts: float = 0.0
    memory: list[tuple[float, float]] = field(default_factory=list)


class Desk:
    """A controller in service from its start to its end.

    Args:
        seconds: called with the time of the controller after each second of it, for the calendar.
        counts: takes what is done and found.
        trace: takes encoder counts and speed command of every scan.
    """

    def __init__(
        self,
        machine: Machine,
        store: StateStore,
        memory: SharedMemory,
        counts: Counts,
        trace: hashlib._Hash,
        seconds: Callable[[float], None],
    ) -> None:
        self.memory, self.counts, self._trace, self._seconds = memory, counts, trace, seconds
        self.controller = made = Controller(machine, store, memory)
        self.engine, self.operator, self.axis = made.engine, made.operator, made.axis
        engine = self.engine
        engine.clock = VirtualClock()
        self.operator.now = lambda: engine.time_s
        self.operator.frames.start_s = 0.0
        # A job of low priority is held up by others: that is no fault of the controller.
        made._held_up._now = self.operator.now
        memory.words[Word.RECORDER_NS] = 2**62  # a recorder that is always alive
        self.writer = EventWriter(memory, store.directory, lambda: 2**40, POLICY)
        assert isinstance(engine.drive, SimDrive)
        self.drive: SimDrive = engine.drive
        self._counts_per_turn = machine.encoder.counts_per_turn
        self._fine_per_count = machine.encoder.fine_counts_per_turn / machine.encoder.counts_per_turn
        self._rows = array("d")
        self._per_second = round(1.0 / engine.period_s)
        self._alive_scans = round(_ALIVE_S / engine.period_s)
        self._seen: object = None
        self._worst_rad = 0.0
        self._seq = 0
        counts.starts += 1
        made._write_start()

    # --- time ------------------------------------------------------------------------------------------------------

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.engine.run_until(self._after, seconds)

    def until(self, holds: Callable[[], bool], timeout_s: float) -> bool:
        """Let time pass until something holds; False when it is over before."""

        def reached(engine: Engine) -> bool:
            self._after(engine)
            return holds()

        return holds() or self.engine.run_until(reached, timeout_s)

    def _after(self, engine: Engine) -> bool:
        """After a scan, as `Controller._after_scan` but for the publisher; False."""
        controller, axis, rows = self.controller, self.axis, self._rows
        self.operator.settle()
        controller._watch()
        controller.alarms.scan()
        rows.append(axis.feedback.counts)
        rows.append(engine.output.vel_cmd_rad_s)
        error = abs(axis.pos_err_rad)
        if error > self._worst_rad and not axis.is_off:
            self._worst_rad = error
        scan = engine.scan
        if scan % self._alive_scans == 0:
            holder = self.operator.authority.holder
            if holder is not None:
                self._put("alive", holder)
        if scan % self._per_second == 0:
            self._trace.update(rows.tobytes())
            del rows[:]
            self.memory.rows.clear()
            self._seconds(engine.time_s)
        return False

    # --- messages --------------------------------------------------------------------------------------------------

    def _put(self, kind: str, who: Identity, **values: Any) -> int:
        self._seq += 1
        raw = {"type": kind, "seq": self._seq, "frame": newest_mark(self.operator, who.client), **values}
        if kind not in ("alive", "stop", "release", "quick_stop"):
            raw["epoch"] = self.operator.authority.epoch
        if not self.memory.commands[Source.WEB].put(to_record(who, raw)):
            raise Stuck(f"the ring of commands is full at {kind}")
        return self._seq

    def send(self, kind: str, who: Identity, **values: Any) -> None:
        """Send a message that has no reply."""
        self._put(kind, who, **values)

    def ask(self, kind: str, who: Identity, **values: Any) -> None:
        """Send a command and wait for its reply; a refusal is told as trouble."""
        code, text = self.answer(kind, who, **values)
        if code:
            self.trouble(f"{kind} {values} of {who.user} refused: {text}")

    def answer(self, kind: str, who: Identity, **values: Any) -> tuple[str, str]:
        """Send a command; code and text of its reply, empty when it was done."""
        seq, found = self._put(kind, who, **values), list[dict[str, Any]]()

        def replied() -> bool:
            while (record := self.memory.replies[Source.WEB].take()) is not None:
                reply = json.loads(record)[1]
                if reply["seq"] == seq:
                    found.append(reply)
            return bool(found)

        if not self.until(replied, _REPLY_S):
            raise Stuck(f"no reply to {kind}")
        return str(found[0]["code"]), str(found[0]["text"])

    # --- what goes wrong -------------------------------------------------------------------------------------------

    def trouble(self, what: str) -> None:
        """Tell what nobody caused."""
        self.counts.told += 1
        if len(self.counts.troubles) >= _TOLD_MOST:
            return
        here = f"{self.engine.time_s:.2f} s after the start, at {deg(self.axis.pos_act_rad):.3f} deg"
        self.counts.troubles.append(f"{here}: {what}")

    def look(self) -> None:
        """Count the alarms since the last look, and bring their events into the journal."""
        history = self.axis.alarms.history
        fresh = []
        for alarm in reversed(history):
            if alarm is self._seen:
                break
            fresh.append(alarm)
        self._seen = history[-1] if history else None
        for alarm in reversed(fresh):
            severity, code = alarm.definition.severity, str(alarm.code)
            if severity is Severity.STOP:
                self.counts.stops[code] = self.counts.stops.get(code, 0) + 1
            elif severity is Severity.WARNING:
                self.counts.warnings[code] = self.counts.warnings.get(code, 0) + 1
            else:
                continue
            self.trouble(alarm.text)
        while self.writer.drain():
            pass

    # --- the machine -----------------------------------------------------------------------------------------------

    @property
    def resting(self) -> bool:
        """No motion goes on or waits."""
        return self.axis.at_rest and not self.axis.motion.waiting

    def until_rest(self) -> None:
        """Let a motion end.

        Raises:
            Stuck: it does not.
        """
        if not self.until(lambda: self.resting or self.axis.alarms.first_out is not None, _REST_S):
            raise Stuck(f"the axis does not come to rest: {self.axis.state.name}")

    def power_on(self, who: Identity) -> None:
        """Power on, and wait for the brake to open."""
        self.ask("power", who, on=True)
        self.counts.power_ups += 1
        axis = self.axis
        if not self.until(lambda: axis.state is AxisState.STANDSTILL or bool(axis.alarms.first_out), 10.0):
            raise Stuck(f"power does not come on: {self.axis.power.phase.name}")

    def power_off(self, who: Identity) -> None:
        """Power off, and wait for the brake to close."""
        self.ask("power", who, on=False)
        if not self.until(lambda: self.axis.is_off, 10.0):
            raise Stuck(f"power does not go off: {self.axis.power.phase.name}")

    def recover(self, who: Identity) -> None:
        """After a stop that nobody caused: reset, and power on again.

        Raises:
            Stuck: it cannot be reset by an operator.
        """
        self.look()
        if self.axis.alarms.first_out is None:
            return
        self.until(lambda: self.axis.is_off, _REST_S)
        self.ask("power", who, on=False)
        code, text = self.answer("reset", who)
        if code:
            raise Stuck(f"a stop cannot be reset: {text}")
        self.wait(1.0)
        self.power_on(who)

    def offset_counts(self) -> float:
        """Told minus true angle of the motor, counts of the absolute encoder."""
        told = self.drive.read().pos_act_counts / self._fine_per_count
        zero = self.axis.zero_counts / self._fine_per_count
        true = self.drive.truth()[2] / math.tau * self._counts_per_turn
        return told - zero - true

    def change_load(self, moment_nm: float) -> None:
        """Another nozzle or snout: its moment acts from now on. Power is off, the brake holds."""
        self.drive.change_plant("eccentric_moment_nm", moment_nm)

    def close(self) -> Path:
        """Switch the controller off: torque off, brake closed, state on the disk."""
        controller, counts = self.controller, self.counts
        self.look()
        counts.scans += self.engine.scan
        counts.on_s += self.engine.time_s
        counts.worst_following_deg = max(counts.worst_following_deg, deg(self._worst_rad))
        self._trace.update(self._rows.tobytes())
        controller._close(None)
        for ring in (*self.memory.commands, *self.memory.replies):
            ring.clear()
        self.memory.rows.clear()
        # Retention works every ten minutes and daily by the monotonic clock: here at every end.
        self.writer._prune_s = -math.inf
        while self.writer.drain():
            pass
        written = self.memory.events[Source.CONTROLLER].written
        counts.events += written
        self.writer.close()
        return controller._store.directory
