"""The brake test: torque against the closed brake, both ways, and its verdict."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Final, NamedTuple

from gantryctl.program.alarms.words import Said, Words
from gantryctl.units import deg

# How long the brake must hold the test torque, each way.
HELD_S: Final = 2.0
# From no torque to the test torque.
_RISE_S: Final = 0.5
# After the ramp the motor must give the torque within this.
_GIVE_S: Final = 1.0
# The torque is back at the preload within this, or is taken off as it is.
_RELIEVE_S: Final = 1.5
# Of the regulator that corrects the motor torque by what the motor reports.
_TIME_CONSTANT_S: Final = 0.1
# Part of the test torque that the motor must give. With this, and the friction of the motor (6 N m on the reference
# machine, it helps the brake), a brake passes that bears a little less than the level: of brakes from 0.5 to 400 N m
# tested with 70 N m the weakest that passed bore 65 (docs/evidence/brake_test.json).
_SHARE: Final = 0.95


class BrakeTestPhase(IntEnum):
    """Phase of a brake test; ENABLING and DISABLING end with the drive, the others by the torque.

    | phase        | leaves when                                              | to                   |
    |--------------|----------------------------------------------------------|----------------------|
    | IDLE         | begun: power off, brake closed                           | ENABLING             |
    | ENABLING     | drive in Operation enabled, brake still closed           | PLUS_RISING          |
    | PLUS_RISING  | the motor gives the test torque                          | PLUS_HELD            |
    | PLUS_HELD    | held for 2 s                                             | MINUS_RISING         |
    | MINUS_RISING | the motor gives the test torque the other way            | MINUS_HELD           |
    | MINUS_HELD   | held for 2 s: passed                                     | RELIEVING            |
    | these four   | moved too far, torque not given or not held: failed      | RELIEVING            |
    | these four   | stopped: aborted                                         | RELIEVING            |
    | RELIEVING    | the motor gives the preload, so the brake bears nothing  | DISABLING            |
    | ENABLING     | stopped, or the drive opens its brake: aborted           | DISABLING            |
    | DISABLING    | torque taken off in three steps, drive disabled          | IDLE                 |
    | any          | alarm of a stop class: aborted                           | IDLE, by its reaction|
    """

    IDLE = 0
    ENABLING = 1
    PLUS_RISING = 2
    PLUS_HELD = 3
    MINUS_RISING = 4
    MINUS_HELD = 5
    RELIEVING = 6
    DISABLING = 7


class BrakeTestOutcome(IntEnum):
    """How a brake test ended.

    NONE: no test yet, or under way. ABORTED: ended before it could show anything (stopped, an alarm, control lost).
    """

    NONE = 0
    PASSED = 1
    FAILED = 2
    ABORTED = 3


class BrakeTestResult(NamedTuple):
    """One test that has ended. Torques are those on the brake: motor torque minus preload, N m at the motor.

    Attributes:
        plus_nm, minus_nm: means while held; NaN for a direction that was not held.
        moved_rad: largest motion during the test, at the gantry, rad.
        words: the result in a sentence.
    """

    outcome: BrakeTestOutcome
    plus_nm: float
    minus_nm: float
    moved_rad: float
    words: Words | Said | None

    @property
    def text(self) -> str:
        """The sentence in English, "" for a test under way."""
        return str(self.words or "")


_P: Final = BrakeTestPhase
_RISING: Final = (_P.PLUS_RISING, _P.MINUS_RISING)
_HELD: Final = (_P.PLUS_HELD, _P.MINUS_HELD)
_NOMINAL_S: Final = {
    _P.PLUS_RISING: _RISE_S,
    _P.PLUS_HELD: HELD_S,
    _P.MINUS_RISING: 2.0 * _RISE_S,
    _P.MINUS_HELD: HELD_S,
    _P.RELIEVING: _RISE_S,
}


class BrakeTest:
    """Torque against a closed brake, both ways, while the drive stands at speed 0; the brake never opens on the way.

    The drive's speed loop works against the torque as soon as the shaft gives way by a little (play, a brake that
    slips): its integrator takes back what was asked for. So the torque that the motor reports is regulated to
    the level, within twice the level, and a brake that slips shows as torque that is not reached. At the end the
    torque is back at the preload, which holds the load, so that nothing is wound up when it is taken off.

    Args:
        level_nm: what the brake must bear both ways, N m at the motor.
        moved_max_rad: how far the gantry may move under it, rad.
        torque_max_nm: no command passes it.
        period_s: time of one scan.

    Attributes:
        phase: IDLE unless a test is under way.
        outcome: NONE until it is known.
        on_brake_nm: torque on the brake that is asked for now.
        moved_rad, plus_nm, minus_nm: see `BrakeTestResult`.
        last, count: the last test that has ended, and how many have.
    """

    __slots__ = (
        "_correction", "_mean", "_period_s", "_preload_nm", "_scans", "_start_rad", "_torque_max_nm", "count", "last",
        "level_nm", "minus_nm", "moved_max_rad", "moved_rad", "on_brake_nm", "outcome", "phase", "plus_nm", "words",
    )  # fmt: skip

    def __init__(self, level_nm: float, moved_max_rad: float, torque_max_nm: float, period_s: float) -> None:
        self.level_nm, self.moved_max_rad = level_nm, moved_max_rad
        self._torque_max_nm, self._period_s = torque_max_nm, period_s
        self.last: BrakeTestResult | None = None
        self.count, self._mean = 0, 0.0
        self.prepare(0.0)
        self.phase = BrakeTestPhase.IDLE

    def prepare(self, preload_nm: float) -> None:
        """Forget the test before; the drive is being enabled.

        Args:
            preload_nm: motor torque that holds the load, so that the brake bears nothing.
        """
        self._preload_nm = preload_nm
        self._start_rad: float | None = None
        self._correction = 0.0
        self.on_brake_nm = self.moved_rad = 0.0
        self.plus_nm = self.minus_nm = math.nan
        self.outcome = BrakeTestOutcome.NONE
        self.words: Words | Said | None = None
        self._enter(BrakeTestPhase.ENABLING)

    def begin(self) -> None:
        """Give torque: the drive is enabled at speed 0 and the brake is closed."""
        self._enter(BrakeTestPhase.PLUS_RISING)

    @property
    def under_way(self) -> bool:
        """From `prepare` until the drive is disabled again."""
        return self.phase is not BrakeTestPhase.IDLE

    @property
    def running(self) -> bool:
        """The motor gives torque against the brake."""
        return self.phase in _NOMINAL_S

    @property
    def left_s(self) -> float:
        """Nominal time until the torque is back, s."""
        if not self.running:
            return 0.0
        now_s = max(0.0, _NOMINAL_S[self.phase] - self._scans * self._period_s)
        return now_s + sum(time_s for phase, time_s in _NOMINAL_S.items() if phase > self.phase)

    @property
    def result(self) -> BrakeTestResult:
        """Result so far."""
        return BrakeTestResult(self.outcome, self.plus_nm, self.minus_nm, self.moved_rad, self.words)

    def end(self, outcome: BrakeTestOutcome, words: Words | Said) -> None:
        """Decide how the test ends, unless that is known already; the torque goes back to the preload."""
        if self.outcome is BrakeTestOutcome.NONE:
            self.outcome, self.words = outcome, words
        if self.phase is BrakeTestPhase.ENABLING:
            self._enter(BrakeTestPhase.DISABLING)
        elif self.running and self.phase is not BrakeTestPhase.RELIEVING:
            self._enter(BrakeTestPhase.RELIEVING)

    def slipped_afterwards(self) -> None:
        """Fail a test that has passed: the brake does not bear the load when the torque goes off."""
        if self.outcome is BrakeTestOutcome.PASSED:
            self.outcome = BrakeTestOutcome.FAILED
            self.words = Words.TEST_SLIPPED_AFTER

    def finish(self) -> BrakeTestResult:
        """Keep the result: the drive is disabled, or an alarm decides about torque and drive."""
        self.phase = BrakeTestPhase.IDLE
        self.on_brake_nm = 0.0
        self.count += 1
        self.last = self.result
        return self.last

    def scan(self, torque_nm: float, pos_rad: float, periods: int = 1) -> float:
        """Return the motor torque to ask for in this scan, N m.

        Args:
            torque_nm: what the motor gives.
            pos_rad: angle of the gantry.
            periods: scan periods since the scan before.
        """
        if self._start_rad is None:
            self._start_rad = pos_rad
        given = torque_nm - self._preload_nm
        moved = abs(pos_rad - self._start_rad)
        self._scans += periods
        self.moved_rad = max(self.moved_rad, moved)
        if self.phase in _RISING or self.phase in _HELD:
            self._watch(given, moved)
        if self.phase in _RISING:
            self._rising(given)
        elif self.phase in _HELD:
            self._holding(given, periods)
        else:
            self._relieving(given)
        return self._regulated(given)

    def _enter(self, phase: BrakeTestPhase) -> None:
        self.phase = phase
        self._scans = 0

    def _watch(self, given_nm: float, moved_rad: float) -> None:
        """End the test at once on an invalid reading or a brake that slips."""
        if not math.isfinite(given_nm):
            self.end(BrakeTestOutcome.ABORTED, Words.TORQUE_NOT_FINITE)
        elif not moved_rad <= self.moved_max_rad:
            self._fail(Words.TEST_SLIPPED(given=given_nm))
            # No ramp: every further scan under torque moves the load further.
            self.on_brake_nm = 0.0

    def _rising(self, given_nm: float) -> None:
        """Ramp the torque up, or over to the other direction; then wait for the motor."""
        sign = 1.0 if self.phase is BrakeTestPhase.PLUS_RISING else -1.0
        self._ramp_to(sign * self.level_nm)
        over_s = self._scans * self._period_s - _NOMINAL_S[self.phase]
        if self.on_brake_nm == sign * self.level_nm and sign * given_nm >= _SHARE * self.level_nm:
            self._enter(BrakeTestPhase.PLUS_HELD if sign > 0.0 else BrakeTestPhase.MINUS_HELD)
        elif over_s > _GIVE_S:
            self._fail(Words.TEST_NOT_REACHED(given=given_nm, wanted=sign * self.level_nm))

    def _holding(self, given_nm: float, periods: float) -> None:
        """Average over the time that the torque must be held."""
        self._mean += (given_nm - self._mean) * periods / self._scans
        plus = self.phase is BrakeTestPhase.PLUS_HELD
        if plus:
            self.plus_nm = self._mean
        else:
            self.minus_nm = self._mean
        if self._scans * self._period_s < HELD_S - 1e-9:
            return
        wanted_nm = self.level_nm if plus else -self.level_nm
        if math.copysign(1.0, wanted_nm) * self._mean < _SHARE * self.level_nm:
            self._fail(Words.TEST_NOT_HELD(given=self._mean, wanted=wanted_nm))
        elif plus:
            self._enter(BrakeTestPhase.MINUS_RISING)
        else:
            held = Words.TEST_HELD(plus=self.plus_nm, minus=self.minus_nm, time_s=HELD_S)
            self.end(BrakeTestOutcome.PASSED, self._with_way(held))

    def _relieving(self, given_nm: float) -> None:
        """Ramp the torque back to the preload; the motor must follow."""
        # Nothing that is wound up may reach the load when the torque is taken off.
        self._ramp_to(0.0)
        back = self.on_brake_nm == 0.0 and abs(given_nm) <= (1.0 - _SHARE) * self.level_nm
        if back or self._scans * self._period_s >= _RELIEVE_S:
            self.phase = BrakeTestPhase.DISABLING

    def _ramp_to(self, target_nm: float) -> None:
        step = self.level_nm * self._period_s / _RISE_S
        self.on_brake_nm = min(max(target_nm, self.on_brake_nm - step), self.on_brake_nm + step)

    def _regulated(self, given_nm: float) -> float:
        """Correct the torque by what the motor gives.

        At the reference gains 0.5 deg of play in a brake, at the motor, takes 68 N m back from a torque that is only
        asked for (decision 14).
        """
        missing = self.on_brake_nm - given_nm
        if math.isfinite(missing):
            wanted = self._correction + missing * min(1.0, self._period_s / _TIME_CONSTANT_S)
            # Within twice the level, so that a brake that slips shows as torque that is not reached.
            most = 2.0 * self.level_nm
            self._correction = min(max(wanted, -most - self.on_brake_nm), most - self.on_brake_nm)
        torque = self._preload_nm + self.on_brake_nm + self._correction
        return min(max(torque, -self._torque_max_nm), self._torque_max_nm)

    def _fail(self, what: Said) -> None:
        self.end(BrakeTestOutcome.FAILED, self._with_way(what))

    def _with_way(self, what: Said) -> Said:
        return Words.TEST_RESULT(what=what, way=deg(self.moved_rad), limit=deg(self.moved_max_rad))
