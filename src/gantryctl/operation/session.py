"""What a command line or a script asks of an axis: moves, increments, keys held for a time, a brake test."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any, Final

from gantryctl.errors import CommandRefused, UsageError
from gantryctl.image import Mode
from gantryctl.operation.brake_policy import after_test, judge_due
from gantryctl.operation.motions import Motion, Stop, require
from gantryctl.operation.run import REST_S, AxisRun
from gantryctl.program import BrakeTestResult
from gantryctl.program.axis.command_checks import check_direction, check_overdue, check_setting, check_target
from gantryctl.units import deg, rad

_TEST_S: Final = 30.0  # the brake test has time limits of its own; this is only a net below them


class AxisSession(AxisRun):
    """The axis of one machine, for one command line or script; arguments, attributes and errors of `AxisRun`."""

    def move(self, target_deg: float, speed_deg_s: float | None = None, override: float = 1.0) -> Motion:
        """Move to an angle and wait until the axis stands there; powers up where that was not done.

        Raises:
            CommandRefused: target or speed are not possible; nothing moved, and power was not switched on for it.
            AlarmStop: an alarm ended it; the axis is at rest.
        """
        wanted = self.machine.speed.setting_max_deg_s if speed_deg_s is None else speed_deg_s
        self._check_speed(wanted)
        require(check_target(rad(self.angle_deg), rad(target_deg), self.axis.settings.travel))
        if not 0.0 < override <= 1.0:
            raise UsageError(f"override {override:g}: above 0 and at most 1")
        return self._motion(move=True, target_rad=rad(target_deg), speed_rad_s=rad(wanted), override=override)

    def increment(self, step_deg: float, forward: bool, speed_deg_s: float) -> Motion:
        """One increment in the incremental mode."""
        self._check_speed(speed_deg_s)
        self.power_up()
        self._command(mode=Mode.INCREMENTAL)
        self.engine.step()
        key = {"forward" if forward else "reverse": True}
        return self._motion(increment_rad=rad(step_deg), speed_rad_s=rad(speed_deg_s), **key)

    def jog(self, forward: bool, speed_deg_s: float, seconds: float) -> Motion:
        """Hold the key for a time in the continuous mode, then let go and wait for rest; powers up first.

        Raises:
            CommandRefused: the speed is outside the setting range, or no way is left; nothing moved.
            AlarmStop: an alarm ended it; the axis is at rest.
        """
        self._check_speed(speed_deg_s)
        direction = 1.0 if forward else -1.0
        require(check_direction(rad(self.angle_deg), direction, self.axis.settings.travel))
        self.power_up()
        if self.stop is not Stop.NO:
            return self._not_begun()
        self._command(mode=Mode.CONTINUOUS, speed_rad_s=rad(speed_deg_s))
        self.engine.step()
        start = self.engine.time_s
        refusals = self.axis.refusal_count
        self._command(forward=forward, reverse=not forward)
        self._renew()
        self.engine.step()
        self._follow(lambda: self._refused(refusals) or self._at_rest(), seconds, held=True)
        self._raise_refusal(refusals)
        self._command(forward=False, reverse=False)
        return self._finished(start, lease=True)._replace(settled_s=None, asked_deg_s=None)

    def test_brake(self) -> BrakeTestResult:
        """Torque both ways against the closed brake, with power off; the result is retained.

        Raises:
            CommandRefused: it cannot be tested here, or not now. AlarmStop: an alarm ended it.
        """
        refusals = self.axis.refusal_count
        self._command(brake_test=True)
        self.engine.step()
        self._command(brake_test=False)
        self._raise_refusal(refusals)
        self._follow(lambda: not self.axis.brake_test.under_way, _TEST_S)
        result = self.axis.brake_test.last
        assert result is not None
        power_ups = self._retained.power_ups + self._power_ups
        self._retained = after_test(self._retained, result, power_ups, datetime.now(UTC))
        self.brake_due = judge_due(self.machine, self.axis, self._retained, power_ups)
        self._raise_alarm()
        return result

    def _check_speed(self, speed_deg_s: float) -> None:
        speed = self.axis.settings.speed
        require(check_setting(rad(speed_deg_s), speed))
        reason = check_overdue(rad(speed_deg_s), speed) if self.brake_due.overdue else None
        if reason is not None:
            raise CommandRefused(f"{reason.code} · {reason.text}; `gantryctl brake-test` tests it")

    def _not_begun(self) -> Motion:
        """A stop was asked for before the motion began."""
        return Motion(self.engine.time_s, self.engine.time_s, False, None, None)

    def _motion(self, **levels: Any) -> Motion:
        self.power_up()
        if self.stop is not Stop.NO:
            return self._not_begun()
        start = self.engine.time_s
        refusals = self.axis.refusal_count
        self._command(**levels)
        self.engine.step()
        self._command(move=False, forward=False, reverse=False)
        self._raise_refusal(refusals)
        return self._finished(start)

    def _finished(self, start: float, *, lease: bool = False) -> Motion:
        """Wait until the motion has ended one way or the other."""
        self._moves += 1
        self._follow(self._at_rest, self.axis.virtual.plan.duration + REST_S, lease=lease)
        plan_end = self.axis.virtual.start_scan * self.engine.period_s + self.axis.virtual.plan.duration
        end = self.engine.time_s
        self._raise_alarm()
        done = self.stop is Stop.NO and self._at_rest() and not self.axis.monitors.not_in_position
        command = self.operator.command
        return Motion(start, end, done, max(0.0, end - plan_end), deg(command.speed_rad_s) * command.override)

    def _at_rest(self) -> bool:
        motion = self.axis.motion
        quiet = motion.current is None and motion.waiting is None and self.axis.virtual.at_rest
        return quiet or self.axis.alarms.first_out is not None

    def _refused(self, before: int) -> bool:
        return self.axis.refusal_count > before or self.axis.alarms.first_out is not None

    def _raise_refusal(self, before: int) -> None:
        if self.axis.refusal_count > before:
            assert self.axis.refusal is not None
            raise CommandRefused(self.axis.refusal.text)
