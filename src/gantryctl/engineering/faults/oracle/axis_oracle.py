"""One axis under the oracle: what is true of the plant, what is on the wire, and what is told about both."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from gantryctl.engineering.faults.oracle import limits
from gantryctl.engineering.faults.oracle.asked import SETTLES_MS, Asked
from gantryctl.engineering.faults.oracle.known import KnownFaults
from gantryctl.engineering.faults.oracle.limits import REFERENCE, SILENT_MS, Bounds, StopClass
from gantryctl.engineering.faults.oracle.load import Load
from gantryctl.engineering.faults.oracle.silence import Silence
from gantryctl.engineering.faults.oracle.speed import SpeedOnWire
from gantryctl.engineering.faults.oracle.stretch import stretch_around
from gantryctl.engineering.faults.oracle.told import READING_SCANS, ToldAngle
from gantryctl.engineering.faults.oracle.words import Instant, Stop, judge_words
from gantryctl.image import DriveRequest, OperatorCommand, OutputImage
from gantryctl.program import GantryProgram
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import Alarm

_ENABLE: Final = DriveRequest.ENABLE
_QUICK_STOP: Final = DriveRequest.QUICK_STOP
_STOPS: Final = Reaction.QUICK_STOP
_AT_REST_MS: Final = 50


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
    or increment asks for it, and on its way alone; ENABLE comes only after a rising edge of power or of a brake test,
    or for HOLD.
    **INV-3, envelope.** The motor side stays within over-travel (or where it began; a modulo axis has no ends) and
    outside of every no-go sector, unless it stands in one and leaves; a stop of a fault ends at most 4.5 deg further.
    It stays within 1.1 of the highest speed setting (+1.2 deg/s in a fault of the feedback, and what load and twisted
    gear of another axis add until its brake must have closed); the speed command changes no faster than the steepest
    ramp in force, and the correction that the position loop may add; a step from rest ends within the way of a dither.
    **INV-4, clean wire.** Speed and torque on the wire are finite and within clamp and torque limit; the speed is
    exactly 0 unless the request is ENABLE with the brake commanded open.
    **INV-5, latch.** From a stop-class alarm until it is reset: no speed, no ENABLE and no torque that comes on, but
    for HOLD and an ENABLE of before the alarm; and after the reset no torque before a new rising edge of power (shipped
    program).
    **INV-6, the load is held.** Torque on, or the brake closed, or closing for at most 0.2 s. The brake opens only
    while torque has been on for 10 ms. Torque is taken off only behind a closed brake, unless
    TORQUE OFF was told, or that the brake does not close; a drive that goes off by itself is told as such within 0.2 s.
    **INV-7, truth.** The angle told is within 0.05 deg of the true motor side, or called not valid within 0.1 s; where
    the reading stands and the axis may be at rest, when the controller has asked it (`Liveness.answer_s`), and at most
    by the way of a fault at standstill. The zero of a modulo axis moves by whole turns only, and not under a motion to
    an angle; no stop on the wire without a first-out alarm; times, angles and states in its words are true (`words`),
    and so is a motion or a lease for which a key is refused.

    Args:
        found: takes each violation, the first of each invariant.
        bounds: limits of this axis.

    Attributes:
        ms: virtual time, samples since the first.
        angle, speed, torque, energised, brake_open: the last sample, motor side, rad, rad/s, N m.
        known: faults that a test has injected.
        program: who commands; None on a bench. `program_over`: it failed, and the engine stops the axis.
        inside: samples are taken inside the scan, which is longer than a millisecond; `sim` takes them.
    """

    # Read several times in every millisecond of every test: slots take an eighth off the oracle.
    __slots__ = (
        "_anchor",
        "_asked",
        "_axis",
        "_caught",
        "_commanded",
        "_creeps",
        "_deg",
        "_enabled_until_ms",
        "_found",
        "_high",
        "_in_sector",
        "_latched",
        "_load",
        "_low",
        "_ratio",
        "_reason_ms",
        "_refusals",
        "_request",
        "_reset_ms",
        "_rest",
        "_sag",
        "_seen",
        "_shipped",
        "_silence",
        "_silent_from",
        "_speed_max",
        "_stop",
        "_told",
        "_torque_max",
        "_twisted_nm",
        "_vel_max",
        "_wire",
        "angle",
        "bound",
        "bounds",
        "brake_open",
        "energised",
        "inside",
        "known",
        "ms",
        "program",
        "program_over",
        "sim",
        "speed",
        "torque",
    )

    def __init__(self, found: Callable[[Violation], None], bounds: Bounds = REFERENCE) -> None:
        self._found, self._seen = found, set[str]()
        self.bounds = bounds
        self.ms = 0
        self.angle = self.speed = self.torque = 0.0
        self.energised, self.brake_open = False, False
        self.bound = self.program_over = self.inside = False
        self.known = KnownFaults()
        self.program: Any = None
        self.sim: object = None
        self._axis: Any = None
        self._shipped = True
        self._told = ToldAngle(self.known, bounds)
        self._wire = SpeedOnWire(self.known, bounds)
        self._load = Load(self.known)
        self._anchor: float | None = None
        self._reason_ms = -1
        self._refusals = 0
        self._reset_ms = -1
        self._enabled_until_ms: float = -math.inf
        self._asked: Asked | None = None
        self._commanded = (0.0, 0.0)
        self._silent_from: float = math.inf
        self._silence: Silence | None = None
        self._request = DriveRequest.DISABLE
        self._stop: Stop | None = None
        self._latched: Alarm | None = None
        self._creeps = False
        # Replaced by `bind`; in motor units.
        self._ratio = self._deg = 1.0
        self._sag = self._high = self._speed_max = self._rest = math.inf
        self._low = -math.inf
        self._in_sector = False
        # Torque with which the drive held the gear twisted until it went off.
        self._twisted_nm = 0.0
        # Speed with which a brake has begun to catch the rotor.
        self._caught = 0.0
        self._vel_max = self._torque_max = math.inf

    # --- who commands -------------------------------------------------------------------------------------------

    def bind(self, program: Any) -> None:
        """From now on this program commands the axis: its settings say what was promised."""
        self.program, self._axis, self.bound = program, program.axis, True
        self._shipped = type(program) is GantryProgram
        settings = self._axis.settings
        self._ratio = ratio = settings.law.ratio
        self._deg = k = ratio * math.pi / 180.0
        speed, ramps = settings.speed, settings.ramps
        self._sag, self._rest = self.bounds.sag_deg * k, self.bounds.rest_deg_s * k
        self._speed_max = limits.OVERSPEED * speed.setting_max_rad_s * ratio
        # The clamp is a float that the law reaches exactly.
        self._vel_max = speed.command_clamp_rad_s * ratio * (1.0 + 1e-12)
        self._torque_max = settings.power.torque_max_nm * (1.0 + 1e-12)
        self._wire.bind(settings, program, shipped=self._shipped)
        # Ramps of machines that need seconds to leave the speeds that look like regulation.
        slowest, settled = min(ramps.acc_rad_s2, ramps.dec_rad_s2) * ratio, self._wire.settled
        self._creeps = slowest < settled
        self._told.bind(self._axis, shipped=self._shipped, settles_s=settled / slowest)
        self._asked = Asked(settings, settled, self.bounds.told_deg * k, self._sag)

    def begin(self, angle: float, brake_open: bool, energised: bool) -> None:
        """Take the state in which the axis is met."""
        self.angle, self.brake_open, self.energised = angle, brake_open, energised

    def deg(self, motor_rad: float) -> float:
        """An angle or a speed of the motor at the gantry, deg or deg/s."""
        return motor_rad / self._deg

    def scans_ms(self, scans: float) -> float:
        """Time of so many scans."""
        return scans * float(self._axis.settings.period_s) * 1e3

    def now(self) -> Instant:
        """What is true now."""
        return Instant(self.ms, self.angle, self.speed, self.energised, self.brake_open)

    @property
    def offset(self) -> float:
        """Of the angle that is told, rad at the motor."""
        return self._told.offset

    @property
    def contact_lies(self) -> bool:
        """The contact of the brake may be late to tell that it is closed."""
        return self.known.contact_lies

    def reading_lies_ms(self, since_ms: int) -> float:
        """When the encoder began to lie behind a moment; infinite where it did not."""
        return min((ms for ms in self.known.encoder_lies_ms if ms > since_ms), default=math.inf)

    def held_way_deg(self, since: Instant) -> float:
        """Permitted way of a spoilt feedback under a controller that stands still; 0 without."""
        return self.known.held_way_deg(self, since)

    def can_ask(self) -> bool:
        """The controller may command a speed, and so ask a reading that stands."""
        return self.brake_open and self._request is _ENABLE and not self._holding()

    def say(self, invariant: str, text: str) -> None:
        """Report the first violation of an invariant."""
        if invariant not in self._seen:
            self._seen.add(invariant)
            self._found(Violation(invariant, self.ms * 1e-3, text))

    # --- the wire -----------------------------------------------------------------------------------------------

    def command(self, output: OutputImage, operator: OperatorCommand | None) -> None:
        """Judge one command before the drive takes it; `operator` is None when no program made it."""
        request, vel, torque, brake_open = output[:4]
        axis = self._axis
        self._silence, self._silent_from = None, self.ms + SILENT_MS
        self._commanded = self.angle, self.speed
        asked = self._asked
        if operator is not None and asked is not None:
            refusals, self._refusals = self._refusals, axis.refusal_count
            if operator is not asked.levels:
                untrue = asked.take(
                    operator, self.ms, self._wire.vel, self.angle + self.offset, moves=self.ms <= self._reason_ms,
                    refused=axis.refusal if self._refusals != refusals else None, in_force=axis.virtual.ramps,
                )  # fmt: skip
                if untrue and self._shipped:
                    self.say("INV-7", untrue)
        held = self.known.held
        if held is not None and operator is not None:
            self.known.held = held.commands(self.now())
        if not (-self._vel_max <= vel <= self._vel_max and -self._torque_max <= torque <= self._torque_max):
            self.say("INV-4", f"on the wire: speed {vel!r} rad/s, torque {torque!r} N m")
        if axis is not None and not self.program_over and (self._told.judge(self) or self._in_sector):
            self._low, self._high = self._stretch()
        if vel != 0.0:
            self._speed_on_wire(request, vel, brake_open)
        else:
            self._wire.zero(self, self._told.wrong)
        if request is not self._request:
            self._requested(request)
        if axis is None:
            return
        first = axis.alarms.first_out
        if first is not None or self._latched is not None:
            self._latch(first, request, vel)

    def _speed_on_wire(self, request: DriveRequest, vel: float, brake_open: bool) -> None:
        if request is not _ENABLE or not brake_open:
            self.say("INV-4", f"speed {vel / self._deg:.4f} deg/s with request {request.name}")
        now, asked, told = self.ms, self._asked, self._told
        if self._wire.command(self, vel, told.wrong, asked):
            self._reason_ms, told.moved_ms = now + SETTLES_MS, now
        elif asked is not None and asked.target is not None:
            if self._creeps:
                self._reason_ms = now + SETTLES_MS
            asked.perhaps_arrived(now, self.angle + self.offset)

    def _requested(self, request: DriveRequest) -> None:
        before, self._request = self._request, request
        if before is _ENABLE:
            self._enabled_until_ms = self.ms
        elif request is _ENABLE and self._latched is None and self._unasked():
            self.say("INV-2", "ENABLE on the wire, and nobody asked for it")
        if request is _QUICK_STOP:
            self._reason_ms = max(self._reason_ms, self.ms + round(1e3 * self.bounds.rest_s[StopClass.QUICK]))
        # A program that failed is replaced by the engine, which tells it as an exception (SYS-09).
        silent = self._axis is not None and self._axis.alarms.first_out is None and not self.program_over
        if silent and request is _QUICK_STOP and before is _ENABLE:
            self.say("INV-7", "a quick stop on the wire without a first-out alarm")

    def _unasked(self) -> bool:
        """Nobody has asked for torque, and none is needed to hold the load."""
        asked = self._asked
        return asked is not None and self._shipped and not (asked.power(self.ms) or self._holding())

    # --- alarms and latch ---------------------------------------------------------------------------------------

    def _latch(self, first: Alarm | None, request: DriveRequest, vel: float) -> None:
        before, self._latched = self._latched, first
        if first is None:
            self._stop, self._reset_ms = None, self.ms
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

    def told_torque_off(self) -> bool:
        """An alarm says that the torque is off."""
        alarms = self._axis.alarms.active
        # Behind a brake that is told not to close only the torque that goes off shows whether it holds; HOLD follows.
        told = any(alarm.reaction >= Reaction.TORQUE_OFF for alarm in alarms.values())
        return told or Code.BRK_06 in alarms

    def _alarm(self, first: Alarm) -> None:
        """A stop-class alarm is told now: the stop begins."""
        if self._asked is not None:
            self._asked.stopped()
        known, now = self.known, self.now()
        if known.of_feedback(now.ms):
            kind = StopClass.FEEDBACK
        else:
            # What is told as a quick stop when the torque is off already is a torque off.
            quick = StopClass.NO_RAMP if known.no_ramp else StopClass.QUICK
            kind = quick if first.reaction is _STOPS and self.energised else StopClass.TORQUE_OFF
        onset = known.recent_onset(now.ms)
        # What had its stop before a reset is no cause of another (seed 51621).
        begun = now if onset is None or onset.ms <= self._reset_ms else onset
        self._stop = Stop(first, kind, begun, now)

    # --- the plant ----------------------------------------------------------------------------------------------

    def sample(self, angle: float, speed: float, torque: float, brake_open: bool, energised: bool) -> None:
        """Judge one millisecond: true motor angle rad and speed rad/s, torque N m, brake, torque on."""
        self.ms = now = self.ms + 1
        if self.energised and not energised:
            self._twisted_nm = abs(self.torque)
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
        if not energised and (brake_open or self._load.off_unjudged):
            self._load.unheld(self)

    def left(self) -> None:
        """The drive has no torque from here on, before the next command: it left Operation enabled by itself."""
        if self.bound and self.energised:
            self._switched(False, self.brake_open)

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
            last = Instant(self.ms - SILENT_MS, angle, speed, energised, brake_open)
            self._silence, self._anchor, self._load.off_unjudged = Silence(last), None, False
        self._silence.sample(self)
        if brake_open and not energised:
            self._load.unheld(self)
        else:
            self._load.unheld_ms = 0

    def _moves(self, way: float) -> None:
        # Nobody can see it before the reading that stands has been asked; so far a fault at standstill may go.
        unseen = self.known.of_feedback(self.ms) and self._told.unasked(self)
        if unseen and abs(way) <= self.bounds.way_deg(StopClass.FEEDBACK, 0.0) * self._deg:
            return
        # Nor can a controller that stands still end it (a sign that turns at rest, seed 80431 of the pairs).
        held = self.known.held
        if held is not None and abs(way) <= self.held_way_deg(held.begun) * self._deg:
            return
        state = "torque on" if self.energised else "torque off"
        state += ", brake open" if self.brake_open else ", brake closed"
        self.say("INV-2", f"moved {way / self._deg:.3f} deg without a reason ({state})")

    def _outside(self) -> None:
        limit, known, load = self._speed_max, self.known, self._load
        if known.of_feedback(self.ms):
            limit += self.bounds.fault_overspeed_deg_s * self._deg
            if known.held is not None:
                limit += self.bounds.driven_acc_deg_s2 * known.held.held_s * self._deg
        acc_deg_s2 = self.bounds.unheld_acc_deg_s2
        acc_deg_s2 += known.largest_load(self.angle, self.angle) * limits.BRAKE_ACC_DEG_S2
        limit += acc_deg_s2 * self._deg * 1e-3 * min(load.driven_ms, load.unheld_max_ms)
        if not self.energised:
            thrown = limit + self._twisted_nm * self.bounds.untwists_deg_s_per_nm * self._deg
            # A brake that closes takes this speed away, and gives none (0.77 deg/s: seed 10403 of axes on the bus).
            free = self.brake_open or known.brake_share < 1.0
            limit = thrown if free else max(limit, min(thrown, self._caught))
        if not -limit <= self.speed <= limit:
            self.say("INV-3", f"true speed {self.speed / self._deg:.3f} deg/s")
        low, high = self._low, self._high
        beyond = self.angle - high if self.angle > high else low - self.angle
        torque_off = self._stop is not None and self._stop.kind is not StopClass.QUICK
        if beyond > (self.bounds.beyond_deg * self._deg if known.onset is not None or torque_off else 0.0):
            self.say(
                "INV-3",
                f"true angle {(self.angle + self.offset) / self._deg:.3f} deg, {beyond / self._deg:.3f} deg beyond",
            )

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
            self._torque_on(now)
        if was_energised and not energised:
            if self._asked is not None:
                self._asked.brake_test = False
            if self._stop is not None:
                self._stop.torque_off(now, self.angle, self.speed)
            self._load.torque_off(self, open_before=was_open, commanded=self._request is DriveRequest.DISABLE)
        if brake_open and not was_open:
            self._told.moved_ms = now
            self._load.brake_opens(self)
        if was_open and not brake_open:
            self._load.unheld_ms, self._caught = 0, abs(self.speed)
            if self._stop is not None:
                self._stop.brake_closed(now)

    def _torque_on(self, now: int) -> None:
        self._load.torque_on(now)
        by_person = self._asked is not None and self._asked.power(now)
        # An ENABLE that was on the wire before the alarm acts at the SYNC after it; one behind it is found there.
        stop, late_ms = self._stop, self.scans_ms(READING_SCANS)
        if stop is not None and max(now - stop.told.ms, now - self._enabled_until_ms) <= late_ms:
            return
        if self._latched is not None and not self._holding():
            self.say("INV-5", f"torque came on while {self._latched.code} is latched")
        elif self._shipped and not by_person and not self._holding():
            self.say("INV-2", "enabled, and nobody asked for it")

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
            late_s, left = (now - stop.told.ms) * 1e-3, self._load_left(stop.onset)
            if late_s * left > self._rests_s(stop):
                self.say(
                    "INV-1", f"{stop.alarm.code}: still {speed / self._deg:.3f} deg/s after {late_s:.2f} s"
                )
        if stop.slow_ms >= _AT_REST_MS and (not self.brake_open or self.energised):
            stop.ended = True
            self._reason_ms = max(self._reason_ms, now if self._anchor is None else -1)
        if stop.ended:
            stop.ended_ms += 1
        lasts_ms = self.bounds.lasts_ms
        # Torn off within half a swing, and with the load at the end of its swing after as long again at most.
        stop.lasted = stop.lasted or stop.slow_ms >= lasts_ms or stop.ended_ms > 2.0 * lasts_ms
        caught = not (self.energised or self.brake_open)
        if stop.ended and caught and not stop.lasted and way <= stop.allowed_deg:
            # Torn off by a load that swings on: still the way of the stop.
            self._anchor = self.angle if self._anchor is not None else None
        elif stop.ended and self._anchor is not None:
            if not -self._sag <= self.angle - self._anchor <= self._sag:
                self._moves(self.angle - self._anchor)
        elif not stop.ended:
            self._anchor = self.angle

    def _rests_s(self, stop: Stop) -> float:
        """Time in which a stop comes to rest.

        A drive that may have lost its ramp may have kept it: where it has not, the way tells (a tilting table from 3.2
        deg/s, 1.06 s by its ramp and 0.72 by its brake: C4, then E15). A weak brake takes the longer by as much as it
        is weaker. One without torque stops nothing, and people must be told: the program does so after 3 s (BRK-11).
        """
        ramps = self._ramps(stop) or stop.kind is StopClass.NO_RAMP
        kinds = (stop.kind, StopClass.QUICK) if ramps else (stop.kind,)
        longest, share = max(self.bounds.rest_s[kind] for kind in kinds), self.known.brake_share
        if stop.kind is StopClass.QUICK or share >= 1.0:
            return longest
        weak = longest / share if share > 0.0 else math.inf
        return max(longest, min(weak, limits.TOLD_UNHELD_S))

    def _too_far(self, stop: Stop, way: float) -> None:
        """The way is beyond what was known of the stop: by the plant that is there, and a brake that is late."""
        from_deg_s, left = stop.onset.speed / self._deg, self._load_left(stop.onset)
        allowed = self._allowed_deg(stop.kind, from_deg_s, way, left)
        if way > allowed and stop.kind is StopClass.QUICK and stop.off is not None and self.told_torque_off():
            # Another cause took the torque off within the ramp: the way until then, and a stop by the brake from there,
            # whose gear was twisted by all that slowed the load (655 N m of a crane: axis-pairs 16).
            angle, speed = stop.off
            before = abs(angle - stop.onset.angle) / self._deg
            after = self._allowed_deg(StopClass.TORQUE_OFF, speed / self._deg, way - before, left)
            allowed = max(allowed, before + max(after, self._untwists_deg(speed / self._deg)))
        if way > allowed and stop.kind is StopClass.FEEDBACK:
            allowed = max(allowed, self.held_way_deg(stop.onset))
        if way > allowed and self._ramps(stop):
            allowed = max(allowed, self._allowed_deg(StopClass.QUICK, from_deg_s, way, left))
            runs_out_deg, share = self.bounds.runs_out_deg, self.known.torque_share
            if way > allowed and runs_out_deg is not None and share < 1.0:
                # Nobody reaches the drive, and its own ramp has as much torque as is left (random seed 141046).
                allowed = max(allowed, runs_out_deg(from_deg_s, share))
        # A contactor has taken the torque before it is told (axes 11288 on the bus).
        if way > allowed and not (stop.off is None and stop.told.energised):
            allowed = max(allowed, self._untwists_deg(from_deg_s))
        stop.allowed_deg = allowed
        if way > allowed:
            self.say(
                "INV-1",
                f"{stop.alarm.code}, {stop.kind.value} from {from_deg_s:.2f} deg/s: "
                f"{way:.3f} deg, at most {allowed:.3f}",
            )

    def _ramps(self, stop: Stop) -> bool:
        """The drive stops on its ramp, whatever is wrong.

        Readings that are late on the bus are no fault of its own loop, and are told as a quick stop (CAN-03), which on
        a slow axis is longer than a stop by its brake (a yaw drive, 0.582 deg from 0.5 deg/s: axes 8034 on the bus).
        """
        late = self.known.reading_late_s > 0.0 and stop.alarm.reaction is _STOPS
        return self.known.own_ramp or late

    def _untwists_deg(self, from_deg_s: float) -> float:
        """Way of a rotor that its gear throws back as the torque goes off, until the brake has it.

        A yaw drive whose motor held 89 N m against wind and friction at rest: 0.021 deg in the 150 ms of its brake,
        where the drive alone could have moved it by 0.019 (seed 4066 of other axes).
        """
        thrown_deg_s = self._twisted_nm * self.bounds.untwists_deg_s_per_nm
        return (abs(from_deg_s) + thrown_deg_s) * 1e-3 * min(self._load.driven_ms, self._load.unheld_max_ms)

    def _load_left(self, since: Instant) -> float:
        """What a load that has been moved leaves of the torque of the brake, in parts of it, on the way since then."""
        known = self.known
        return 1.0 if known.load_share is None else 1.0 - known.largest_load(since.angle, self.angle)

    def _allowed_deg(self, kind: StopClass, from_deg_s: float, way: float, left: float) -> float:
        """Permitted way of a class: by the machine file, and where that is passed by the plant that is there.

        Args:
            left: of the torque of the brake, by a load that has been moved.
        """
        known, bounds, late_s, share = self.known, self.bounds, self.known.late_s, 1.0
        if kind is StopClass.QUICK and left < limits.RAMP_LEFT:
            # The drive leaves its ramp, which is told, and the brake takes over.
            return limits.RAMP_LEAVES_S * abs(from_deg_s) + self._allowed_deg(
                StopClass.TORQUE_OFF, from_deg_s, way, left
            )
        if kind is not StopClass.QUICK:
            # The brake stops the axis: one that is late adds its delay times the speed, a weak one divides.
            late_s, share = late_s + known.brake_late_s, max(0.0, known.brake_share + left - 1.0)
        late_deg = abs(from_deg_s) * late_s
        allowed = bounds.way_deg(kind, from_deg_s) + late_deg
        if way * share > allowed and bounds.plant_way_deg is not None:
            allowed = max(allowed, bounds.plant_way_deg(kind, from_deg_s) + late_deg)
        return allowed / share if share > 0.0 else math.inf
