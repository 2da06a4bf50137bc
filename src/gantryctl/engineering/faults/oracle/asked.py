"""What people ask of the axis: moves, keys with their leases, increments, power; and until when a speed is theirs."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.image import Mode, OperatorCommand
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.settings import AxisSettings, RampSettings

SETTLES_MS: Final = 300
"""After a command that is nearly zero the servo still settles for so long."""
# ms that the servo may take to follow a stop's last set-point, on top of its ramp.
_COMES_TO_REST_MS: Final = 1500
_LEASE_MS: Final = 250
# ms in which a step of the drive that was commanded before power was switched off still takes effect.
_UNDER_WAY_MS: Final = 100
# A frame that is older is void.
_FRAME_S: Final = 0.2
# Reasons of a refusal that speak of a motion under way.
_MOVES: Final = (Words.JOG_FROM_REST, Words.REVERSAL_FROM_REST, Words.INCREMENT_FROM_REST)
_ANYWHERE: Final = (-math.inf, math.inf)


class Asked:
    """What was asked of one program since it commands; angles and speeds at the motor, rad and rad/s.

    Args:
        settings: ramps that end a motion.
        settled: a slower command is regulation. told: so far from its target a move has arrived.
        sag: so far beyond the way of what was asked is regulation.

    Attributes:
        levels: the last of the operator.
        until_ms: until then a speed has its reason in them.
        target: of the move under way, by the zero of the machine; None without.
        way: angles between which what was asked for last leads, from where it began and by the zero of the machine.
        at_target_ms: since when it may have arrived.
        brake_test: asked for, and not ended.
    """

    def __init__(self, settings: AxisSettings, settled: float, told: float, sag: float) -> None:
        self._ramps, self._ratio = settings.ramps, settings.law.ratio
        self._endless = settings.travel.endless
        # A move that has not come into its window has not ended for so long, though the axis stands; one that comes
        # into it later ends there (a rotary table, 2.2 s behind its ramp).
        self._window = settings.monitors.in_position_window_rad * self._ratio
        self._arrives_ms = 1e3 * settings.monitors.in_position_tolerance_time_s
        self._settled, self._told, self._sag = settled, told, sag
        self.levels = OperatorCommand()
        self.until_ms = self._power_until = -1.0
        self._reset_ms = self._power_ms = -1
        self.target: float | None = None
        self.way = _ANYWHERE
        self.at_target_ms = self._beside_ms = 0
        self.brake_test = False
        self._lease_ms = -1_000_000
        self._key_counts, self._halted, self._by_jog = True, False, False

    def take(
        self,
        op: OperatorCommand,
        now: int,
        vel: float,
        angle: float,
        *,
        moves: bool,
        refused: Refusal | None,
        in_force: RampSettings,
    ) -> str:
        """Take new levels; what is told of a key that is refused and is not so, or "".

        Args:
            vel: on the wire. angle: true, by the zero of the machine.
            moves: a speed was commanded until now, or the servo still settles.
            refused: what people are told in this scan to be refused; None for nothing. A move that has just begun is
                as slow as regulation, and a key is refused then (seed 50442). Neither a key nor a move that is refused
                gives a motion a reason: the one before goes on, on its own way.
            in_force: ramps of a move that begins now.
        """
        last, self.levels = self.levels, op
        ramps = self._ramps
        renewed = op.lease != last.lease
        if renewed:
            self._lease_ms = now
        if op.power and not last.power:
            self._power_until, self._power_ms = math.inf, now
        if op.reset and not last.reset:
            self._reset_ms = now
        self.brake_test = self.brake_test or (op.brake_test and not last.brake_test)
        stopping = (op.stop and not last.stop) or (op.halt and not last.halt) or (last.power and not op.power)
        self._halted = self._halted or stopping
        if last.power and not op.power:
            self._power_until = now + _UNDER_WAY_MS
        pressed = (op.forward and not last.forward) or (op.reverse and not last.reverse)
        # An increment and a move go on without a lease until they have arrived.
        untrue = ""
        if op.move and not last.move and op.power:
            if refused is None or not _of_a_move(op, last):
                self._move(op, now, vel, angle, in_force)
        elif pressed:
            if refused is None:
                self._press(op, now, vel, angle, rests=not self._turns_round(op, angle, moves))
            else:
                untrue, way = self._untrue(refused, op, now, moves), self.way
                self._press(op, now, vel, angle, rests=False)
                # The ramp of the key before it has a way of its own.
                self.way = way
        elif renewed and self._key_counts and self._by_jog and (op.forward or op.reverse):
            # As long as this lease lives, and then the ramp: from the speed that the axis may have reached until then.
            fastest = abs(vel) / self._ratio + 1e-3 * _LEASE_MS * ramps.acc_rad_s2
            ramp_s = (
                fastest / ramps.jog_release_dec_rad_s2
                + ramps.jog_release_dec_rad_s2 / ramps.jog_release_jerk_rad_s3
            )
            self.until_ms = now + _LEASE_MS + SETTLES_MS + 1e3 * ramp_s
        if stopping:
            # Halt has the ramp of a move, stop and power off that of a key.
            self._ends_by(now, vel, halt=op.halt)
            # As behind a move: a key that is still held then ends nothing.
            self._key_counts = False
        released = (last.forward or last.reverse) and not (op.forward or op.reverse)
        # What the key began counts, not a mode that was chosen while it was held.
        if released and self._by_jog and self._key_counts:
            self._ends_by(now, vel)
        return untrue

    def _move(self, op: OperatorCommand, now: int, vel: float, angle: float, ramps: RampSettings) -> None:
        """A move takes over: from where it comes to rest first, if it turns round, to its target."""
        self.until_ms, self.target, self.at_target_ms = math.inf, op.target_rad * self._ratio, now
        self._halted = self._by_jog = False
        # It takes over from a key, which then ends nothing when it is let go.
        self._key_counts = False
        if self._endless or op.relative:
            # The whole turn, or the set-point from which it counts, is not known here.
            self.way = _ANYWHERE
            return
        # On its way up to a speed the axis goes beyond it by what the jerk takes from its acceleration.
        dec = min(ramps.dec_rad_s2, ramps.end_dec_rad_s2)
        jerk_s = max(ramps.acc_rad_s2, ramps.dec_rad_s2) / min(ramps.jerk_rad_s3, ramps.end_jerk_rad_s3)
        speed = abs(vel) / self._ratio + ramps.acc_rad_s2 * jerk_s
        ramp = speed * (0.5 * speed / dec + 1.5 * jerk_s) * self._ratio
        rest = angle + math.copysign(ramp, vel) if abs(vel) > self._settled else angle
        self.way = min(angle, rest, self.target) - self._sag, max(angle, rest, self.target) + self._sag

    def leads_away(self, angle: float, vel: float) -> bool:
        """A speed leads on from outside of the way of what was asked for."""
        low, high = self.way
        return angle > high if vel > 0.0 else angle < low

    def _untrue(self, refused: Refusal, op: OperatorCommand, now: int, moves: bool) -> str:
        """The reason of a refused key against what is so: a motion under way, a lease that has run out."""
        reason = refused.values.get("reason")
        if refused.code is Code.CTL_14 and reason in _MOVES and now > self.until_ms and not moves:
            return f"a key is refused at rest, {reason}"
        if refused.code is Code.CTL_15 and self._lease_ms == now and op.lease_age_s < _FRAME_S:
            return "a key is refused for its lease, which was renewed in this scan"
        return ""

    def _press(self, op: OperatorCommand, now: int, vel: float, angle: float, *, rests: bool) -> None:
        """Take a key: refused while the axis moves, and the move or increment goes on, also when it is let go.

        On the ramp of the last held key one of the same direction is taken.
        """
        ramp = self._by_jog and (vel > 0.0) is op.forward
        self._key_counts = (rests and -self._settled < vel < self._settled) or ramp
        if self._key_counts:
            self.target, self._by_jog = None, op.mode is Mode.CONTINUOUS
            # A held key moves as long as its lease lives, and then on its ramp; an increment goes on without one.
            self.until_ms = now + _COMES_TO_REST_MS if op.mode is Mode.CONTINUOUS else math.inf
            if op.forward is not op.reverse:
                far = math.inf if op.mode is Mode.CONTINUOUS else op.increment_rad * self._ratio
                back, on = self._sag, far + self._sag
                self.way = (angle - back, angle + on) if op.forward else (angle - on, angle + back)

    def _turns_round(self, op: OperatorCommand, angle: float, moves: bool) -> bool:
        """A move is under way that passes zero speed, or is held there by override 0: a key is refused."""
        if self.target is None or self._halted:
            return False
        return op.override == 0.0 or (moves and not self._there(angle, self.target))

    def _there(self, angle: float, target: float) -> bool:
        return -self._told < angle - target < self._told

    def perhaps_arrived(self, now: int, angle: float) -> None:
        """A move that has stood at its target for a while is over: no speed has its reason in it any more."""
        target = self.target
        if target is None or not self._there(angle, target) or self.levels.override == 0.0:
            self.at_target_ms = now
            return
        if not -self._window <= angle - target <= self._window:
            self._beside_ms = now
        arrived_ms = now - max(self.at_target_ms, self._beside_ms)
        if arrived_ms > _COMES_TO_REST_MS or now - self.at_target_ms > _COMES_TO_REST_MS + self._arrives_ms:
            self.target, self.until_ms = None, now

    def held(self, now: int, vel: float) -> bool:
        """A key is held with a living lease: its ramp from this speed on is asked for."""
        op = self.levels
        living = op.forward is not op.reverse and op.power and now - self._lease_ms <= _LEASE_MS
        if living:
            self._ends_by(now, vel)
        return living

    def _ends_by(self, now: int, vel: float, *, halt: bool = False) -> None:
        """Nothing is asked once a stop from now on has ended: on the ramp of a key, or of a move for Halt.

        An acceleration that is under way must go first: the crane of the template, 0.36 deg/s2 that change by as much
        a second, comes to rest 5 s after a Halt at 0.5 deg/s.
        """
        acc, (dec, jerk) = self._ramps.acc_rad_s2, self._stop_ramp(halt=halt)
        fastest = abs(vel) / self._ratio + 0.5 * acc**2 / jerk
        ramp_s = fastest / dec + (acc + dec) / jerk
        self.until_ms = now + 1e3 * ramp_s + _COMES_TO_REST_MS

    def _stop_ramp(self, *, halt: bool) -> tuple[float, float]:
        """Deceleration and jerk of a stop: that of a key, or for Halt of a move where that is slower."""
        ramps = self._ramps
        dec, jerk = ramps.jog_release_dec_rad_s2, ramps.jog_release_jerk_rad_s3
        return (min(dec, ramps.dec_rad_s2), min(jerk, ramps.jerk_rad_s3)) if halt else (dec, jerk)

    def power(self, now: int) -> bool:
        """Torque may come on: for power, or for a brake test."""
        return now <= self._power_until or self.brake_test

    def stopped(self) -> None:
        """A stop-class alarm has ended everything that was asked."""
        self.brake_test = False
        self.until_ms = self._power_until = -1.0

    def reset(self) -> None:
        """After a reset power has to be asked for anew.

        A reset takes a scan: what is asked for in that scan is asked for behind it (seed 41897).
        """
        if not 0 <= self._reset_ms < self._power_ms:
            self._power_until = -1.0


def _of_a_move(op: OperatorCommand, last: OperatorCommand) -> bool:
    """Nothing else was asked in this scan that could be refused."""
    return op == last._replace(
        move=op.move,
        target_rad=op.target_rad,
        speed_rad_s=op.speed_rad_s,
        direction=op.direction,
        relative=op.relative,
        lease=op.lease,
        lease_age_s=op.lease_age_s,
    )
