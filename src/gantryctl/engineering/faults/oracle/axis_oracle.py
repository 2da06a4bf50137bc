"""One axis under the oracle: what is true of the plant, what is on the wire, and what is told about both."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from gantryctl.engineering.faults.oracle import limits
from gantryctl.engineering.faults.oracle.asked import SETTLES_MS, Asked
from gantryctl.engineering.faults.oracle.held import HeldUp
from gantryctl.engineering.faults.oracle.limits import REFERENCE, Bounds, StopClass
from gantryctl.engineering.faults.oracle.silence import Silence
from gantryctl.engineering.faults.oracle.stretch import stretch_around
from gantryctl.engineering.faults.oracle.words import Instant, Stop, judge_words
from gantryctl.image import DriveRequest, OperatorCommand, OutputImage
from gantryctl.program import GantryProgram
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import Alarm

_ENABLE: Final = DriveRequest.ENABLE
_QUICK_STOP: Final = DriveRequest.QUICK_STOP
_STOPS: Final = Reaction.QUICK_STOP
# ms in which a drive that switched itself off is told as an alarm: the heartbeat is missed after 150 ms.
_TOLD_MS: Final = 200
# An alarm's cause lies at most that far back, ms: a frozen encoder at standstill is found by the dither in 500 ms.
_CAUSE_MS: Final = 3000
_AT_REST_MS: Final = 50
# Scans by which a reading on a bus may be old: sampled, sent, and taken.
_READING_SCANS: Final = 3.0


class Violation(NamedTuple):
    """One broken invariant."""

    invariant: str
    time_s: float
    text: str

    def __str__(self) -> str:
        return f"{self.invariant} at {self.time_s:.3f} s: {self.text}"


class AxisOracle:
    """Judges one axis, every millisecond of its plant and every command on its wire.

    Until a program commands the drive, nothing is judged: a drive alone on a bench has no controller that could keep
    a promise.

    **INV-1, bounded stop.** From the onset of a known fault (else from the alarm) of a stop class to rest, the motor
    side goes no further than the limit of the class (`limits.Bounds`), and rests in the time of the class; so it does
    after the last command of a controller that commands no more (`silence`).
    **INV-2, no motion without a reason.** While the wire commands no speed and no stop is under way, the motor side
    stays within 0.15 deg; the shipped program commands a speed only while an operator's move, key with a living lease
    or increment asks for it, and enables only after a rising edge of power or of a brake test, or for HOLD.
    **INV-3, envelope.** The motor side stays within over-travel (or where it began; a modulo axis has no ends) and
    outside of every no-go sector, unless it stands in one and leaves; a stop of a fault ends at most 4.5 deg further.
    It stays within 1.1 of the highest speed setting (+1.2 deg/s in a fault of the feedback, and what the load of
    another axis adds until its brake must have closed); the speed command changes no faster than the steepest ramp in
    force, and the correction that the position loop may add; a step from rest ends within the way of a dither.
    **INV-4, clean wire.** Speed and torque on the wire are finite and within clamp and torque limit; the speed is
    exactly 0 unless the request is ENABLE with the brake commanded open.
    **INV-5, latch.** From a stop-class alarm until it is reset: no speed, no ENABLE and no torque that comes on, but
    for HOLD; and after the reset no torque before a new rising edge of power (shipped program).
    **INV-6, the load is held.** Torque on, or the brake closed, or closing for at most 0.2 s. The brake opens only
    while torque has been on for 10 ms. Torque is taken off only behind a closed brake, unless
    TORQUE OFF was told, or that the brake does not close; a drive that goes off by itself is told as such within 0.2 s.
    **INV-7, truth.** The angle told is within 0.05 deg of the true motor side, or called not valid within 0.1 s; where
    the reading stands and the axis may be at rest, when the controller has asked it (`Liveness.answer_s`), and at most
    by the way of a fault at standstill. The zero of a modulo axis moves by whole turns only, and not under a motion to
    an angle; no stop on the wire without a first-out alarm; times, angles and states in its words are true (`words`).

    Args:
        found: takes each violation, the first of each invariant.
        bounds: limits of this axis.

    Attributes:
        ms: virtual time, samples since the first.
        angle, speed, torque, energised, brake_open: the last sample, motor side, rad, rad/s, N m.
        program: who commands; None on a bench. `program_over`: it failed, and the engine stops the axis.
        offset: of the angle that is told, rad at the motor.
        brake_late_s: a fault lets the brake close so much later.
        reading_late_s: a fault delays every telegram of the drive by so much: none carries its time, so behind the gap
            at the beginning nothing shows it.
        contact_lies: a fault has held the contact of the brake open; only it shows that the brake is closed, so that
            may be told later than it is so.
        inside: samples are taken inside the scan, which is longer than a millisecond; `sim` takes them.
    """

    def __init__(self, found: Callable[[Violation], None], bounds: Bounds = REFERENCE) -> None:
        self._found, self._seen = found, set[str]()
        self.bounds = bounds
        self.ms = 0
        self.angle = self.speed = self.torque = 0.0
        self.energised, self.brake_open = False, False
        self.bound = self.program_over = self.inside = self.contact_lies = False
        self.program: Any = None
        self.sim: object = None
        self._axis: Any = None
        self._energised_ms = self._off_ms = -1_000_000
        self._unheld_ms = self._driven_ms = 0
        self._off_unjudged = False
        self._anchor: float | None = None
        self._reason_ms = -1
        self._asked: Asked | None = None
        self._stray = 0.0
        self._commanded = (0.0, 0.0)
        self._silent_from: float = math.inf
        self._silence: Silence | None = None
        self._vel = 0.0
        self._wire_ms = -1
        self._step, self._step_rad = "", 0.0
        self._request = DriveRequest.DISABLE
        self._stop: Stop | None = None
        self._latched: Alarm | None = None
        self._onset: Instant | None = None
        self._onset_of_feedback = False
        self._held: HeldUp | None = None
        self._disobeys = self._no_ramp = self._creeps = self._pulls_away = False
        self._late_s = self.brake_late_s = self.reading_late_s = 0.0
        self._wrong_since: int | None = None
        self._wrong = self._kpp = 0.0
        self._told_rad, self._stands_ms, self._moved_ms, self._answer_ms = math.nan, 0, 0, 0.0
        self._rest_angle = 0.0
        self._ratio = 1.0
        self._zero_counts = math.nan
        self.offset = 0.0
        # Replaced by `bind`; in motor units.
        self._deg = 1.0
        self._sag = self._high = self._speed_max = self._rest = self._told = self._settled = math.inf
        self._low = -math.inf
        self._in_sector = False
        self._vel_max = self._torque_max = self._slope = math.inf
        self._quick_dec = 0.0

    # --- who commands -------------------------------------------------------------------------------------------

    def bind(self, program: Any) -> None:
        """From now on this program commands the axis: its settings say what was promised."""
        self.program, self._axis, self.bound = program, program.axis, True
        settings = self._axis.settings
        self._deg = k = settings.law.ratio * math.pi / 180.0
        speed, ramps = settings.speed, settings.ramps
        self._ratio = ratio = settings.law.ratio
        self._kpp = settings.law.kpp_per_s
        self._sag = self.bounds.sag_deg * k
        self._speed_max = limits.OVERSPEED * speed.setting_max_rad_s * ratio
        self._rest, self._told = self.bounds.rest_deg_s * k, self.bounds.told_deg * k
        self._settled = self.bounds.regulation_deg_s * k
        # Ramps of machines that need seconds to leave the speeds that look like regulation.
        slowest = min(ramps.acc_rad_s2, ramps.dec_rad_s2) * ratio
        self._creeps = slowest < self._settled
        # A reading is asked from where the set-point has come to rest.
        self._answer_ms = 1e3 * (self._axis.liveness.answer_s + self._settled / slowest)
        # The clamp is a float that the law reaches exactly.
        self._vel_max = speed.command_clamp_rad_s * ratio * (1.0 + 1e-12)
        self._torque_max = settings.power.torque_max_nm * (1.0 + 1e-12)
        # Correction of the position loop: Kpp times the speed that the deviation monitor lets pass.
        correction = settings.law.kpp_per_s * settings.monitors.velocity_deviation_rad_s
        steepest = max(ramps.dec_rad_s2, ramps.jog_release_dec_rad_s2, ramps.acc_rad_s2)
        self._slope = (steepest + correction) * ratio * 1e-3
        self._quick_dec = ramps.quick_dec_rad_s2 * ratio
        self._zero_counts = math.nan
        self._asked = Asked(settings, self._settled, self._told)

    def begin(self, angle: float, brake_open: bool, energised: bool) -> None:
        """Take the state in which the axis is met."""
        self.angle, self.brake_open, self.energised = angle, brake_open, energised

    def deg(self, motor_rad: float) -> float:
        """An angle or a speed of the motor at the gantry, deg or deg/s."""
        return motor_rad / self._deg

    def scans_ms(self, scans: float) -> float:
        """Time of so many scans."""
        return scans * float(self._axis.settings.period_s) * 1e3

    def say(self, invariant: str, text: str) -> None:
        """Report the first violation of an invariant."""
        if invariant not in self._seen:
            self._seen.add(invariant)
            self._found(Violation(invariant, self.ms * 1e-3, text))

    def fault_injected(
        self, *, feedback: bool, at_once: bool, no_ramp: bool = False, late_s: float = 0.0
    ) -> None:
        """A test spoils something now; a cause that lasts keeps its first onset.

        Args:
            feedback: the reading is in doubt, or what the drive does with it.
            no_ramp: a brake or too little torque takes its ramp from a quick stop, which has the class torque off.
            at_once: it acts now; else only when something else happens, a quick stop for one.
            late_s: the axis goes on for so long before it shows.
        """
        self._late_s = max(self._late_s, late_s)
        onset = self._onset
        self._disobeys = self._disobeys or (feedback and not at_once)
        self._no_ramp = self._no_ramp or no_ramp
        # Either may take the load away, and the position loop answers.
        self._pulls_away = self._pulls_away or feedback or no_ramp
        old = onset is None or self.ms - onset.ms > _CAUSE_MS
        if at_once and (old or (feedback and not self._onset_of_feedback)):
            self._onset, self._onset_of_feedback = self._now(), feedback

    def controller_held(self, held_s: float) -> None:
        """The controller stands still from now on for so long."""
        self._held = HeldUp(self._now(), held_s)

    def held_way_deg(self, since: Instant) -> float:
        """Permitted way of a spoilt feedback under a controller that stands still; 0 without."""
        return self._held.way_deg(self, since) if self._held is not None and self._feedback_fault() else 0.0

    def _now(self) -> Instant:
        return Instant(self.ms, self.angle, self.speed, self.energised, self.brake_open)

    def _feedback_fault(self) -> bool:
        """A fault of the feedback is known that may still act."""
        onset = self._onset
        recent = onset is not None and self.ms - onset.ms < _CAUSE_MS
        return self._disobeys or (recent and self._onset_of_feedback)

    # --- the wire -----------------------------------------------------------------------------------------------

    def command(self, output: OutputImage, operator: OperatorCommand | None) -> None:
        """Judge one command before the drive takes it; `operator` is None when no program made it."""
        request, vel, torque, brake_open = output[:4]
        axis = self._axis
        self._silence, self._silent_from = None, self.ms + limits.SILENT_MS
        self._commanded = self.angle, self.speed
        asked = self._asked
        if operator is not None and asked is not None and operator is not asked.levels:
            asked.take(
                operator, self.ms, self._vel, self.angle + self.offset, moves=self.ms <= self._reason_ms
            )
        if self._held is not None and operator is not None:
            self._held = self._held.commands(self._now())
        if not (-self._vel_max <= vel <= self._vel_max and -self._torque_max <= torque <= self._torque_max):
            self.say("INV-4", f"on the wire: speed {vel!r} rad/s, torque {torque!r} N m")
        if axis is not None and not self.program_over:
            self._judge_told(axis)
        if vel != 0.0:
            self._speed_on_wire(request, vel, brake_open)
        else:
            self._vel, self._wire_ms, self._step = 0.0, self.ms, ""
            self._rest_angle = self.angle
        if request is not self._request:
            self._requested(request)
        if axis is None:
            return
        first = axis.alarms.first_out
        if first is not None or self._latched is not None:
            self._latch(first, request, vel)

    def _judge_told(self, axis: Any) -> None:
        """The angle that is told in this scan, before the plant goes on."""
        told = axis.pos_act_rad
        if told != self._told_rad:
            self._told_rad, self._stands_ms = told, self.ms
        angle = told * self._ratio
        if axis.zero_counts != self._zero_counts:
            begins = math.isnan(self._zero_counts)
            self._zero_counts = axis.zero_counts
            moved = angle - self.angle - self.offset
            self.offset += moved if begins or not axis.settings.travel.endless else self._zero_moved(moved)
            self._low, self._high = self._stretch()
        elif self._in_sector:
            self._low, self._high = self._stretch()
        self._wrong = wrong = angle - self.angle - self.offset
        bound = self._told
        if self.reading_late_s:
            bound += (abs(self.speed) + self._quick_dec * self.reading_late_s) * self.reading_late_s
        if not -bound <= wrong <= bound:
            self._wrong_angle(wrong)
        elif self._wrong_since is not None:
            self._wrong_since = None

    def _speed_on_wire(self, request: DriveRequest, vel: float, brake_open: bool) -> None:
        if request is not _ENABLE or not brake_open:
            self.say("INV-4", f"speed {vel / self._deg:.4f} deg/s with request {request.name}")
        now, before = self.ms, self._vel
        passed = max(1, now - self._wire_ms)
        # A reading that is wrong by less than can be told is answered by Kpp times the error all the same.
        slope = self._slope * passed + self._settled + self._kpp * abs(self._wrong)
        if self._step or not -slope <= vel - before <= slope:
            self._stepped(before, vel, passed)
        self._vel, self._wire_ms = vel, now
        asked = self._asked
        if not -self._settled < vel < self._settled:
            self._reason_ms, self._moved_ms = now + SETTLES_MS, now
            if asked is not None:
                asked.at_target_ms = now
                if now > asked.until_ms:
                    self._stray = self._stray + abs(vel) * passed * 1e-3 if before else 0.0
                    self._check_origin(asked, now, vel)
            return
        self._rest_angle = self.angle
        if asked is not None and asked.target is not None:
            if self._creeps:
                self._reason_ms = now + SETTLES_MS
            asked.perhaps_arrived(now, self.angle + self.offset)

    def _stepped(self, before: float, vel: float, passed: int) -> None:
        """Judge a speed that changes too fast: from rest, and back at rest within the way of a dither, it is one."""
        if self._step and -self._settled < vel < self._settled:
            self._step = ""
            return
        if not self._step:
            if self._feedback_fault():
                return
            self._step = (
                f"speed command {before / self._deg:.3f} to {vel / self._deg:.3f} deg/s in {passed} ms"
            )
            self._step_rad = 0.0 if -self._settled < before < self._settled else math.inf
        # What moves no further is no motion: 4096 counts forth or back are 0.0025 deg of the reference gantry.
        self._step_rad += abs(vel) * passed * 1e-3
        if self._step_rad > self.bounds.dither_deg * self._deg:
            self.say("INV-3", self._step)
            self._step = ""

    def _check_origin(self, asked: Asked, now: int, vel: float) -> None:
        """A speed without a person behind it, over more than a dither. Other programs move by their own logic."""
        if self._stray <= self.bounds.dither_deg * self._deg:
            return
        if type(self.program) is not GantryProgram:
            asked.until_ms = math.inf
            return
        if self._feedback_fault():
            # The position loop answers what a spoilt reading or a drive that turns the other way shows; the true way of
            # that is judged by INV-1.
            return
        if self._pulls_away and self._brings_back(vel):
            return
        if not asked.held(now, vel):
            self.say("INV-2", f"{vel / self._deg:.3f} deg/s commanded, and nobody asks for it")

    def _brings_back(self, vel: float) -> bool:
        """The position loop answers the true way from where the command was last that of an axis at rest.

        So it does long after a drive began to turn the other way, or where a load has become too much for the torque,
        and nobody has to ask for it, no further than may be moved without a reason. The command of rest may be off by
        the regulation, a reading on a bus is some scans old.
        """
        way = self.angle - self._rest_angle
        late = 1e-3 * self.scans_ms(_READING_SCANS) * abs(self.speed)
        answers = abs(vel + self._kpp * way) <= self._settled + self._kpp * late
        return answers and abs(way) <= self._sag

    def _requested(self, request: DriveRequest) -> None:
        before, self._request = self._request, request
        if request is _QUICK_STOP:
            self._reason_ms = max(self._reason_ms, self.ms + round(1e3 * self.bounds.rest_s[StopClass.QUICK]))
        # A program that failed is replaced by the engine, which tells it as an exception (SYS-09).
        silent = self._axis is not None and self._axis.alarms.first_out is None and not self.program_over
        if silent and request is _QUICK_STOP and before is _ENABLE:
            self.say("INV-7", "a quick stop on the wire without a first-out alarm")

    # --- alarms and latch ---------------------------------------------------------------------------------------

    def _latch(self, first: Alarm | None, request: DriveRequest, vel: float) -> None:
        before, self._latched = self._latched, first
        if first is None:
            self._stop = None
            if self._asked is not None:
                self._asked.reset()
            return
        if first is not before:
            self._alarm(first)
            return
        if vel != 0.0:
            self.say("INV-5", f"speed {vel / self._deg:.4f} deg/s while {first.code} is latched")
        if request is _ENABLE and not self._holding():
            self.say("INV-5", f"ENABLE on the wire while {first.code} is latched")
        stop = self._stop
        if stop is not None and first.steps is not stop.steps:
            stop.steps = first.steps
            for what in judge_words(first, stop, self):
                self.say("INV-7", f"{first.code}: {what}")

    def _holding(self) -> bool:
        alarms = self._axis.alarms.active.values()
        return any(alarm.reaction is Reaction.HOLD for alarm in alarms)

    def _told_torque_off(self) -> bool:
        alarms = self._axis.alarms.active
        # Behind a brake that is told not to close only the torque that goes off shows whether it holds; HOLD follows.
        told = any(alarm.reaction >= Reaction.TORQUE_OFF for alarm in alarms.values())
        return told or Code.BRK_06 in alarms

    def _alarm(self, first: Alarm) -> None:
        """A stop-class alarm is told now: the stop begins."""
        if self._asked is not None:
            self._asked.stopped()
        onset = self._onset
        if self._feedback_fault():
            kind = StopClass.FEEDBACK
        else:
            # What is told as a quick stop when the torque is off already has no ramp.
            quick = first.reaction is _STOPS and self.energised and not self._no_ramp
            kind = StopClass.QUICK if quick else StopClass.TORQUE_OFF
        now = self._now()
        recent = onset is not None and self.ms - onset.ms < _CAUSE_MS
        self._stop = Stop(first, kind, onset if onset is not None and recent else now, now)

    # --- the plant ----------------------------------------------------------------------------------------------

    def sample(self, angle: float, speed: float, torque: float, brake_open: bool, energised: bool) -> None:
        """Judge one millisecond: true motor angle rad and speed rad/s, torque N m, brake, torque on."""
        self.ms = now = self.ms + 1
        before, self.angle, self.speed, self.torque = self.angle, angle, speed, torque
        if not self.bound:
            self.energised, self.brake_open = energised, brake_open
            return
        if now > self._silent_from:
            self._silent(energised, brake_open)
            return
        if energised is not self.energised or brake_open is not self.brake_open:
            self._switched(energised, brake_open)
        if not (-self._speed_max <= speed <= self._speed_max and self._low <= angle <= self._high):
            self._outside()
        if now > self._reason_ms:
            anchor = self._anchor
            if anchor is None or abs(angle - before) > 1e-2 + 2e-3 * abs(speed):
                self._anchor = angle  # also where a test has put the plant elsewhere
            elif not -self._sag <= angle - anchor <= self._sag and self._stop is None:
                self._moves(angle - anchor)
        elif self._anchor is not None:
            self._anchor = None
        if self._stop is not None:
            self._stopping(self._stop)
        if not energised and (brake_open or self._off_unjudged):
            self._unheld()
        elif self._unheld_ms:
            self._unheld_ms = 0

    def _silent(self, energised: bool, brake_open: bool) -> None:
        """Judge one millisecond of an axis that nobody commands any more."""
        # A controller that comes back tells what it sees then of a stop that went on without it.
        if self._stop is not None:
            if self.energised and not energised:
                self._stop.torque_off(self.ms, self.angle, self.speed)
            if self.brake_open and not brake_open:
                self._stop.brake_closed(self.ms)
        self.energised, self.brake_open = energised, brake_open
        if self._silence is None:
            angle, speed = self._commanded
            last = Instant(self.ms - limits.SILENT_MS, angle, speed, energised, brake_open)
            self._silence, self._anchor, self._off_unjudged = Silence(last), None, False
        self._silence.sample(self)
        if brake_open and not energised:
            self._unheld()
        else:
            self._unheld_ms = 0

    def _moves(self, way: float) -> None:
        # Nobody can see it before the reading that stands has been asked; so far a fault at standstill may go.
        unseen = self._feedback_fault() and self._unasked()
        if unseen and abs(way) <= self.bounds.way_deg(StopClass.FEEDBACK, 0.0) * self._deg:
            return
        state = "torque on" if self.energised else "torque off"
        state += ", brake open" if self.brake_open else ", brake closed"
        self.say("INV-2", f"moved {way / self._deg:.3f} deg without a reason ({state})")

    def _outside(self) -> None:
        limit = self._speed_max
        onset = self._onset
        if self._feedback_fault():
            limit += self.bounds.fault_overspeed_deg_s * self._deg
            if self._held is not None:
                limit += self.bounds.driven_acc_deg_s2 * self._held.held_s * self._deg
        limit += self.bounds.unheld_acc_deg_s2 * self._deg * 1e-3 * min(self._driven_ms, self._unheld_max_ms)
        if not -limit <= self.speed <= limit:
            self.say("INV-3", f"true speed {self.speed / self._deg:.3f} deg/s")
        low, high = self._low, self._high
        beyond = self.angle - high if self.angle > high else low - self.angle
        torque_off = self._stop is not None and self._stop.kind is not StopClass.QUICK
        if beyond > (self.bounds.beyond_deg * self._deg if onset is not None or torque_off else 0.0):
            self.say(
                "INV-3",
                f"true angle {(self.angle + self.offset) / self._deg:.3f} deg, {beyond / self._deg:.3f} deg beyond",
            )

    def _zero_moved(self, moved: float) -> float:
        """Move of the zero of an axis that turns without end, rad at the motor, as far as it may be.

        It moves on by whole turns, and not under a motion to an angle; a new reference, by any angle, is for a program
        of somebody's own and for an axis at rest.
        """
        virtual, turn = self._axis.virtual, 360.0 * self._deg
        whole = turn * round(moved / turn)
        # What is told in motion is some scans old.
        late = abs(self.speed) * 3.0 * float(self._axis.settings.period_s)
        referenced = abs(moved - whole) > self._told + late
        moving = virtual.vel_ref_rad_s != 0.0
        if referenced and (moving or type(self.program) is GantryProgram):
            self.say("INV-7", f"the zero has moved by {self.deg(moved):.2f} deg, which is no whole turn")
        elif moving and virtual.plan.vel_end == 0.0:
            self.say("INV-7", f"the zero has moved by {self.deg(moved):.2f} deg under a motion to an angle")
        return moved if referenced else whole

    def _stretch(self) -> tuple[float, float]:
        """Motor angles between over-travel and no-go sectors, by the zero of the machine.

        An axis that stands outside of travel may stand there, and one that stands in a sector may leave it.
        """
        ratio = self._ratio
        low, high, self._in_sector = stretch_around(
            self._axis.settings.travel, (self.angle + self.offset) / ratio
        )
        return (
            min(low * ratio - self.offset, self.angle - self._sag),
            max(high * ratio - self.offset, self.angle + self._sag),
        )

    def _switched(self, energised: bool, brake_open: bool) -> None:
        now = self.ms
        was_energised, self.energised = self.energised, energised
        was_open, self.brake_open = self.brake_open, brake_open
        if energised and not was_energised:
            self._energised_ms, self._driven_ms = now, 0
            by_person = self._asked is not None and self._asked.power(now)
            asked = by_person or type(self.program) is not GantryProgram
            if self._latched is not None and not self._holding():
                self.say("INV-5", f"torque came on while {self._latched.code} is latched")
            elif not asked and not self._holding():
                self.say("INV-2", "enabled, and nobody asked for it")
        if was_energised and not energised:
            self._off_ms = now
            if self._asked is not None:
                self._asked.brake_test = False
            if self._stop is not None:
                self._stop.torque_off(now, self.angle, self.speed)
            self._off_unjudged = was_open and brake_open
            if self._off_unjudged and self._request is DriveRequest.DISABLE and not self._told_torque_off():
                self.say("INV-6", "torque taken off with the brake open, and no alarm says torque off")
        if brake_open and not was_open:
            self._moved_ms = now
        if brake_open and not was_open and (not energised or now - self._energised_ms < 10):
            self.say("INV-6", "the brake opens without torque")
        if was_open and not brake_open and self._stop is not None:
            self._stop.brake_closed(now)

    def _unheld(self) -> None:
        """Torque off: the brake must come, and an order other than brake first needs an alarm."""
        now = self.ms
        if self._off_unjudged:
            if self._told_torque_off():
                self._off_unjudged = False
            elif now - self._off_ms > _TOLD_MS and not self._stands_still:
                self._off_unjudged = False
                self.say("INV-6", "torque went off with the brake open, and no alarm says so")
        self._unheld_ms = self._unheld_ms + 1 if self.brake_open else 0
        # The speed that the load has given stays until the brake has taken it.
        self._driven_ms = max(self._driven_ms, self._unheld_ms)
        if self._unheld_ms > self._unheld_max_ms:
            self.say("INV-6", f"neither torque nor brake for {self._unheld_ms} ms")

    @property
    def _stands_still(self) -> bool:
        """The controller stands still, and can tell nothing before it goes on."""
        return self._held is not None and self._held.went_on is None

    @property
    def _unheld_max_ms(self) -> float:
        return 1e3 * (limits.BRAKE_CLOSES_S + self.brake_late_s)

    def _stopping(self, stop: Stop) -> None:
        """INV-1 while a stop is under way, and the record against which its words are judged."""
        now, speed = self.ms, self.speed
        stop.speeds.append(abs(speed) / self._deg)
        slow = -self._rest <= speed <= self._rest
        stop.slow_ms = stop.slow_ms + 1 if slow else 0
        way = abs(self.angle - stop.onset.angle) / self._deg
        if way > stop.allowed_deg and not stop.ended:
            self._too_far(stop, way)
        # What moves after a rest that was held moves without a reason (INV-2).
        if not slow and not stop.ended and now - stop.told.ms > 1e3 * self.bounds.rest_s[stop.kind]:
            late = (now - stop.told.ms) * 1e-3
            self.say("INV-1", f"{stop.alarm.code}: still {speed / self._deg:.3f} deg/s after {late:.2f} s")
        if stop.slow_ms >= _AT_REST_MS and (not self.brake_open or self.energised):
            stop.ended = True
            self._reason_ms = max(self._reason_ms, now if self._anchor is None else -1)
        if stop.ended and self._anchor is not None:
            if not -self._sag <= self.angle - self._anchor <= self._sag:
                self._moves(self.angle - self._anchor)
        elif not stop.ended:
            self._anchor = self.angle

    def _too_far(self, stop: Stop, way: float) -> None:
        """The way is beyond what was known of the stop: by the plant that is there, and a brake that is late."""
        from_deg_s = stop.onset.speed / self._deg
        allowed = self._allowed_deg(stop.kind, from_deg_s, way)
        if (
            way > allowed
            and stop.kind is StopClass.QUICK
            and stop.off is not None
            and self._told_torque_off()
        ):
            # Another cause took the torque off within the ramp: the way until then, and a stop by the brake from there.
            angle, speed = stop.off
            before = abs(angle - stop.onset.angle) / self._deg
            after = self._allowed_deg(StopClass.TORQUE_OFF, speed / self._deg, way - before)
            allowed = max(allowed, before + after)
        if way > allowed and stop.kind is StopClass.FEEDBACK:
            allowed = max(allowed, self.held_way_deg(stop.onset))
        stop.allowed_deg = allowed
        if way > allowed:
            self.say(
                "INV-1",
                f"{stop.alarm.code}, {stop.kind.value} from {from_deg_s:.2f} deg/s: "
                f"{way:.3f} deg, at most {allowed:.3f}",
            )

    def _allowed_deg(self, kind: StopClass, from_deg_s: float, way: float) -> float:
        """Permitted way of a class: by the machine file, and where that is passed by the plant that is there."""
        bounds, late_deg = self.bounds, abs(from_deg_s) * self._late_s
        known = bounds.way_deg(kind, from_deg_s) + late_deg
        if way > known and bounds.plant_way_deg is not None:
            known = max(known, bounds.plant_way_deg(kind, from_deg_s) + late_deg)
        return known

    # --- what is told ---------------------------------------------------------------------------------------------

    def _wrong_angle(self, wrong: float) -> None:
        if not self._feedback_fault():
            self.fault_injected(feedback=True, at_once=True)
        if not self._axis.feedback.position_valid:
            self._wrong_since = None
        elif self._wrong_since is None:
            self._wrong_since = self.ms
        elif self._told_wrong_for_long(wrong, self._wrong_since):
            told = self._axis.pos_act_rad * 180.0 / math.pi
            self.say(
                "INV-7", f"{told:.3f} deg are told, wrong by {wrong / self._deg:.3f} deg, and called valid"
            )

    def _told_wrong_for_long(self, wrong: float, since_ms: int) -> bool:
        """Longer than an alarm takes; or than the reading is asked for, where it looks like that of an axis at rest."""
        little = abs(wrong) <= self.bounds.way_deg(StopClass.FEEDBACK, 0.0) * self._deg
        if little and self._unasked():
            return False
        return (self.ms - since_ms) * 1e-3 > limits.TOLD_WRONG_S

    def _unasked(self) -> bool:
        """The reading stands, and the controller has had no time to ask it, or may not."""
        if self.ms <= self._stands_ms:
            return False
        # Behind a brake, and under torque that may not be commanded, nobody can ask: the next power-up does.
        asked = self.brake_open and self._request is _ENABLE and not self._holding()
        return not asked or self.ms - max(self._stands_ms, self._moved_ms) <= self._answer_ms
