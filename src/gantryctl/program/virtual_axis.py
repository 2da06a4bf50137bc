"""The virtual axis: the set-point, planned when something changes, sampled every scan."""

from __future__ import annotations

import math
from typing import Final

from gantryctl._core import Segments
from gantryctl.errors import CommandRefused
from gantryctl.motion import (
    MotionLimits,
    SetPoint,
    cruise,
    hold,
    plan_move,
    plan_stop,
    plan_velocity,
    rest,
    stop_point,
)
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.settings import AxisSettings, RampSettings
from gantryctl.units import deg

# Rounding of a plan that ends exactly at the limit: less than one fine count at the gantry, 1.3e-9 rad.
_LIMIT_TOLERANCE_RAD: Final = 1e-9
# An override below this stops the motion: with it a degree takes 28 minutes at the lowest setting, 0.6 deg/s.
OVERRIDE_MIN: Final = 0.001


class VirtualAxis:
    """The set-point axis that the real one follows.

    While `following`, the set-point of scan k is `plan.sample((k - start_scan) x period)`, never a sum of
    steps; else it is the measured angle. Every plan ends at rest inside the travel, and its extremes are
    checked before it is taken: a motion with a speed only is a plan to the end of the travel. Only a modulo
    axis has a plan without an end, to a target that is infinite.

    Attributes:
        pos_ref_rad, vel_ref_rad_s, acc_ref_rad_s2: the set-point of this scan.
        at_rest: the plan has ended (True while not following).
        paused: stopped by override 0; the motion goes on when it is raised.
        changed: a new plan was taken in this scan.
        ramps: of the motions that begin from now on, and have none of their own.
        plans: every plan with its start scan, if `keep_plans`.
    """

    __slots__ = (
        "_duration", "_period_s", "_ramps", "_sample", "_speed", "_speed_max", "_target", "_travel",
        "acc_ref_rad_s2", "at_rest", "changed", "following", "keep_plans", "override", "paused", "plan",
        "plans", "pos_ref_rad", "ramps", "start_scan", "stopping", "vel_ref_rad_s",
    )  # fmt: skip

    def __init__(self, settings: AxisSettings, *, keep_plans: bool = False) -> None:
        self._period_s = settings.period_s
        self._travel = settings.travel
        # Those of the motion under way, whose speed may be changed.
        self.ramps = self._ramps = settings.ramps
        self._speed = self._speed_max = settings.speed.setting_max_rad_s
        self._target = 0.0
        self.override = 1.0
        self.keep_plans = keep_plans
        self.plans: list[tuple[int, Segments]] = []
        self.plan = hold(0.0)
        self._sample = self.plan.sample
        self._duration = 0.0
        self.start_scan = 0
        self.pos_ref_rad = self.vel_ref_rad_s = self.acc_ref_rad_s2 = 0.0
        self.at_rest = True
        self.following = self.paused = self.stopping = self.changed = False

    def sample(self, scan: int) -> None:
        """Set the set-point of `scan`; only while following."""
        t = (scan - self.start_scan) * self._period_s
        self.pos_ref_rad, self.vel_ref_rad_s, self.acc_ref_rad_s2 = self._sample(t)
        self.at_rest = t >= self._duration

    def follow_from(self, pos_rad: float, scan: int) -> None:
        """Begin at `pos_rad`, at rest: the axis follows from now on."""
        self.following = True
        self._take(hold(pos_rad), scan)

    def release(self, pos_rad: float) -> None:
        """Set the set-point to the measured angle; the axis does not follow."""
        self.following = False
        self.pos_ref_rad = pos_rad
        self.vel_ref_rad_s = self.acc_ref_rad_s2 = 0.0
        self.at_rest = True
        self.paused = self.stopping = False

    def move_to(
        self, target_rad: float, speed_rad_s: float, ramps: RampSettings, scan: int, *, take: bool = True
    ) -> Refusal | None:
        """Plan a motion to `target_rad` with `speed_rad_s` times override; None when there is a plan.

        Args:
            ramps: of this motion.
            take: False only judges, and nothing changes.
        """
        start, rests = self._set_point(), self.override < OVERRIDE_MIN
        try:
            # Override 0 is a plan to rest, on the ramp of the machine: who turns it down does not wait for that of a
            # gentle motion. The target is kept, and planned anew when the override is raised.
            if rests:
                plan = plan_stop(start, self.ramps.normal(speed_rad_s))
            else:
                plan = _plan_to(target_rad, start, ramps.normal(speed_rad_s * self.override))
        except CommandRefused as error:
            return refusal(Code.CTL_17, reason=str(error))
        if not self._within_travel(plan):
            low, high = plan.extremes()
            reached = high if high > self._travel.stretch(self.pos_ref_rad).high_rad else low
            read_deg = deg(self._travel.read_rad(reached))
            return refusal(Code.CTL_17, reason=Words.OUTSIDE_ON_THE_WAY(angle=read_deg))
        if take:
            self._target, self._speed, self._ramps, self.paused = target_rad, speed_rad_s, ramps, rests
            self._take(plan, scan)
        return None

    def change_speed(self, speed_rad_s: float, scan: int) -> Refusal | None:
        """Change the speed of the motion under way, same target."""
        return self.move_to(self._target, speed_rad_s, self._ramps, scan)

    def set_override(self, override: float, scan: int) -> Refusal | None:
        """Change the override 0..1 of the motion under way and all later ones."""
        before, self.override = self.override, override
        if self.stopping or (self.at_rest and not self.paused):
            return None
        refused = self.move_to(self._target, self._speed, self._ramps, scan)
        if refused is not None:
            self.override = before
        return refused

    def stop(self, limits: MotionLimits, scan: int) -> None:
        """Come to rest with `limits`; a stop under way that ends no later is kept: no stop is made weaker."""
        self.paused = False
        # Nothing to stop: with override 0 the motion under way is given up.
        if self.at_rest:
            return
        # The stop that ends nearer is the harder one, whatever its ramp.
        here = self.pos_ref_rad
        ends = stop_point(self._set_point(), limits)
        if self.stopping and abs(self.plan.pos_end - here) <= abs(ends - here):
            return
        plan = self._stop_plan(limits)
        if plan is not self.plan:
            self._take(plan, scan)
        self.stopping = True

    def _stop_plan(self, limits: MotionLimits) -> Segments:
        """Plan to rest with `limits`, which goes no further than the motion would have gone.

        A motion that still gains speed turns its acceleration round by its own jerk. Where that is larger, a stop with
        a smaller one comes to rest beyond its target, 0.42 deg on a fast table: it has the ramp of the motion then.
        """
        start = self._set_point()
        for ramp in (limits, self._ramps.normal(self._speed_max)):
            plan = plan_stop(start, ramp)
            if not self._leads_on(plan):
                return plan
        return self.plan

    def _leads_on(self, plan: Segments) -> bool:
        """Whether a plan goes further than the present one; nothing goes further than one without an end."""
        if self.plan.vel_end != 0.0:
            return False
        (low, high), (low_now, high_now) = plan.extremes(), self.plan.extremes()
        return low < low_now - _LIMIT_TOLERANCE_RAD or high > high_now + _LIMIT_TOLERANCE_RAD

    def stopping_angle_rad(self, limits: MotionLimits) -> float:
        """Angle that the set-point would still travel in a stop with `limits`."""
        # Nothing to stop, also where no angle is known yet.
        return 0.0 if self.at_rest else abs(self._stop_plan(limits).pos_end - self.pos_ref_rad)

    def rest_point_rad(self) -> float:
        """Angle at which the set-point would come to rest on the normal ramp."""
        if self.at_rest:
            return self.pos_ref_rad
        return stop_point(self._set_point(), self.ramps.normal(self._speed_max))

    @property
    def cruising(self) -> bool:
        """On a plan without an end, at its speed."""
        vel = self.plan.vel_end
        return vel != 0.0 and self.vel_ref_rad_s == vel and self.acc_ref_rad_s2 == 0.0

    def turn_back(self, turns: int, scan: int) -> None:
        """Count the same set-point from a zero that lies so many turns further on; at rest, or while `cruising`."""
        pos = self.pos_ref_rad - turns * math.tau
        if self.cruising:
            self._take(cruise(pos, self.plan.vel_end), scan)
            return
        # The time at which the motion ended stays what it was.
        self.plan = rest(pos, self.plan.duration)
        self._sample, self.pos_ref_rad = self.plan.sample, pos
        if self.keep_plans:
            self.plans.append((self.start_scan, self.plan))

    def _within_travel(self, plan: Segments) -> bool:
        """Whether the plan stays inside the travel, or, started outside, never goes further out."""
        low, high = plan.extremes()
        # Started outside, as after a fault, the way back must be open.
        here = self.pos_ref_rad
        stretch = self._travel.stretch(here)
        return (
            low >= min(stretch.low_rad, here) - _LIMIT_TOLERANCE_RAD
            and high <= max(stretch.high_rad, here) + _LIMIT_TOLERANCE_RAD
        )

    def _set_point(self) -> SetPoint:
        return SetPoint(self.pos_ref_rad, self.vel_ref_rad_s, self.acc_ref_rad_s2)

    def _take(self, plan: Segments, scan: int) -> None:
        self.plan = plan
        self._sample = plan.sample
        self._duration = plan.duration if plan.vel_end == 0.0 else math.inf
        self.start_scan = scan
        self.stopping = False
        self.changed = True
        if self.keep_plans:
            self.plans.append((scan, plan))
        self.sample(scan)


def _plan_to(target_rad: float, start: SetPoint, limits: MotionLimits) -> Segments:
    """Plan to an angle, or with a speed towards an infinite one."""
    if math.isinf(target_rad):
        return plan_velocity(start, math.copysign(limits.vel_rad_s, target_rad), limits)
    return plan_move(start, target_rad, limits)
