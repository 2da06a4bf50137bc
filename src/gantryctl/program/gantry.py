"""Programs: the base of custom ones, and the shipped one with power, both modes by hand, moves, stops, alarms."""

from __future__ import annotations

from gantryctl.image import InputImage, Mode, OperatorCommand, OutputImage
from gantryctl.motion import SetPoint, stop_point
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.command_checks import check_setting
from gantryctl.program.axis.motion_command import MotionCommand
from gantryctl.program.blocks import (
    BrakeTest,
    Halt,
    Inch,
    Jog,
    MoveAbsolute,
    MoveRelative,
    Power,
    Reset,
    SetOverride,
    Stop,
)
from gantryctl.units import deg


class AxisProgram:
    """Base of a program for one axis: override `logic` and call blocks in it.

    `logic` runs between the axis' own halves of the scan: alarms, interlocks and power before it; set-point,
    position loop and output guard after it.

    Args:
        axis: the axis that the blocks act on.
    """

    def __init__(self, axis: Axis) -> None:
        self.axis = axis
        self.trace_columns: tuple[str, ...] = axis.trace_columns

    def logic(self, image: InputImage) -> None:
        """Call the blocks of one scan."""

    def scan(self, image: InputImage) -> OutputImage:
        """One scan."""
        axis = self.axis
        axis.begin(image)
        self.logic(image)
        return axis.end()

    def trace_row(self) -> tuple[float, ...]:
        """Values of the last scan, in the order of `trace_columns`."""
        return self.axis.trace_row()


class GantryProgram(AxisProgram):
    """Turns the operator's levels into edges and calls the blocks.

    - *Continuous*: moves while exactly one direction key is TRUE and the hold-to-run lease lives.
    - *Incremental*: one rising edge of a key is one increment from the set-point position.
    - `move` works in any mode, at standstill or taking over from another move; halt, stop, quick stop always.
    - Without the *enabling switch* nothing by hand, and nothing from a remote screen, is faster than the cap: judged at
      the start and in every scan.

    After a start the mode is NONE and nothing moves. A command that is refused changes nothing and shows in
    `axis.refusal`, with `axis.refusal_count` one higher.

    Args:
        axis: the axis.
        service: resets come from the service role and may clear locked alarms.

    Attributes:
        mode: the mode in force, which follows the operator's at standstill only.
        power, move, move_by, jog, inch, halt, stop, reset, override, brake_test: the blocks, for reading.
    """

    def __init__(self, axis: Axis, *, service: bool = False) -> None:
        super().__init__(axis)
        self.service = service
        # After a start nothing moves until a mode is chosen.
        self.mode = Mode.NONE
        self.power = Power(axis)
        self.reset = Reset(axis)
        self.override = SetOverride(axis)
        self.stop = Stop(axis)
        self.halt = Halt(axis)
        self.move = MoveAbsolute(axis)
        self.move_by = MoveRelative(axis)
        self.jog = Jog(axis)
        self.inch = Inch(axis)
        self.brake_test = BrakeTest(axis)
        speed = axis.settings.speed
        self._without_switch = speed.without_enabling_switch_rad_s
        self._lease_scans = axis.settings.scans(axis.settings.monitors.lease_s)
        self._last = OperatorCommand()
        # Expired at the start: the first key needs a renewal.
        self._lease_age = float(self._lease_scans)
        self._move_gate = self._by_way = self._keys_dead = self._remote = False
        self._speed = 0.0

    def logic(self, image: InputImage) -> None:
        """One scan: edges first, then the blocks."""
        op, last = image.operator, self._last
        self._lease_age += self.axis.feedback.periods
        changed = op is not last and op != last
        # A block without new inputs and with nothing new to show is left out: nearly all of them in nearly all scans.
        if changed or self.power.attention:
            self.power(enable=op.power)
        if changed:
            self._last = op
            self._changed(op, last)
        if changed or self.reset.busy:
            self.reset(execute=op.reset, service=self.service)
        if changed or self.stop.attention:
            self.stop(execute=op.stop)
        if changed or self.halt.attention:
            self.halt(execute=op.halt)
        if changed or self.move_by.attention:
            self.move_by(
                execute=self._move_gate and self._by_way,
                distance_rad=op.target_rad,
                velocity_rad_s=op.speed_rad_s,
            )
        if changed or self.move.attention:
            self.move(
                execute=self._move_gate and not self._by_way,
                position_rad=op.target_rad,
                velocity_rad_s=op.speed_rad_s,
                direction=op.direction,
            )
        # Hold-to-run is judged in every scan.
        if changed or self.jog.busy or self.jog.attention:
            self._by_key(op)
        if changed or self.inch.attention:
            self._by_increment(op)
        if changed or self.brake_test.attention:
            self.brake_test(execute=op.brake_test)
        # In every scan: the switch may be released on the way.
        if (self._remote or self.inch.busy) and not self.axis.feedback.inputs.enabling_switch:
            self._keep_the_cap()

    def key_lost_angle_rad(self) -> float:
        """Longest way to rest if a held key were not renewed any more: the lease at the speed set, then the ramp."""
        settings, virtual = self.axis.settings, self.axis.virtual
        speed = max(self._speed * virtual.override, abs(virtual.vel_ref_rad_s))
        # On its way up to the speed the axis goes beyond it by what the jerk of the ramp takes from its acceleration.
        acc = 0.0 if virtual.cruising else virtual.ramps.acc_rad_s2
        ramp = settings.ramps.jog_release(settings.speed.setting_max_rad_s)
        return speed * settings.monitors.lease_s + stop_point(SetPoint(0.0, speed, acc), ramp)

    # --- edges ------------------------------------------------------------------------------------

    def _changed(self, op: OperatorCommand, last: OperatorCommand) -> None:
        """Take lease, override, quick stop, mode and speed; judge whether move and keys may begin anything."""
        if op.lease != last.lease:
            self._lease_age = op.lease_age_s / self.axis.settings.period_s
        self.override(override=op.override)
        # A motion begun from a remote screen stays remote until it has ended.
        self._remote = op.remote or (self._remote and self._under_way() is not None)
        if op.quick_stop and not last.quick_stop:
            self.axis.quick_stop()
        if op.mode is not last.mode and op.mode is not self.mode:
            self._choose_mode(op)
        # The gate keeps a move that was refused from its block while the level stays TRUE.
        if op.move and not last.move:
            self._move_gate, self._by_way = self._allowed(self._check_move(op)), op.relative
        elif not op.move:
            self._move_gate = False
        # A key that was refused, or stopped by an alarm, must be released before it begins anything again.
        pressed = (op.forward and not last.forward) or (op.reverse and not last.reverse)
        if pressed and not self._keys_dead:
            self._keys_dead = not self._allowed(self._check_keys(op))
        elif not (op.forward or op.reverse):
            self._keys_dead = False
        if op.speed_rad_s != last.speed_rad_s:
            self._choose_speed(op)

    def _choose_mode(self, op: OperatorCommand) -> None:
        """Change the mode, at standstill only; keys that are held now start nothing in the new mode."""
        if self.axis.at_rest:
            self.mode = op.mode
            self._keys_dead = op.forward or op.reverse
        else:
            self._allowed(refusal(Code.CTL_14, reason=Words.MODE_AT_REST))

    def _choose_speed(self, op: OperatorCommand) -> None:
        """Change the speed setting, also of a jog under way; outside the range it is refused and the old one stays."""
        refused = self._check_setting(op)
        if refused is None:
            self._speed = op.speed_rad_s
        elif self.jog.busy:
            self._allowed(refused)

    # --- by hand ----------------------------------------------------------------------------------

    def _by_key(self, op: OperatorCommand) -> None:
        """Continuous mode, hold-to-run: keys, lease and enabling switch are judged in every scan."""
        if self.jog.busy and (op.forward or op.reverse) and not self._keys_dead:
            refused = self._check_lease() or self._check_switch(self._speed)
            if refused is not None:
                self.axis.stop_by(refused.code, **refused.values)
                self._keys_dead = True
        keys = self.mode is Mode.CONTINUOUS and not self._keys_dead
        self.jog(forward=op.forward and keys, backward=op.reverse and keys, velocity_rad_s=self._speed)

    def _by_increment(self, op: OperatorCommand) -> None:
        """Incremental mode: one edge, one increment."""
        keys = self.mode is Mode.INCREMENTAL and not self._keys_dead
        self.inch(
            forward=op.forward and keys,
            backward=op.reverse and keys,
            distance_rad=op.increment_rad,
            velocity_rad_s=op.speed_rad_s,
        )

    def _keep_the_cap(self) -> None:
        """End increments, and moves from a remote screen, that are too fast without the enabling switch."""
        command = self._under_way()
        refused = None if command is None else self._check_switch(command.speed_rad_s)
        if refused is None:
            return
        if command is self.inch.command or (self._remote and command is not self.jog.command):
            self.axis.stop_by(refused.code, **refused.values)

    def _under_way(self) -> MotionCommand | None:
        motion = self.axis.motion
        return motion.current or motion.waiting

    # --- checks: None, or the reason of a refusal -------------------------------------------------

    def _allowed(self, refused: Refusal | None) -> bool:
        if refused is not None:
            self.axis.report_refusal(refused)
        return refused is None

    def _check_move(self, op: OperatorCommand) -> Refusal | None:
        refused = self._check_setting(op)
        if refused is None and op.remote:
            refused = self._check_switch(op.speed_rad_s)
        if refused is None and self.jog.busy:
            return refusal(Code.CTL_14, reason=Words.MOVING_BY_HAND)
        return refused

    def _check_keys(self, op: OperatorCommand) -> Refusal | None:
        """Judge a motion by hand that a key would begin now."""
        # A change that was refused in motion leaves the operator's level and the mode in force apart: a key that is
        # held must not begin an increment, which goes on when it is let go.
        if op.mode is not self.mode:
            return refusal(Code.CTL_14, reason=Words.MODE_AT_REST)
        if self.mode is Mode.NONE:
            return refusal(Code.CTL_16, reason=Words.MODE_NONE)
        refused = self._check_setting(op) or self._check_switch(op.speed_rad_s)
        return self._check_lease() if refused is None and self.mode is Mode.CONTINUOUS else refused

    def _check_setting(self, op: OperatorCommand) -> Refusal | None:
        return check_setting(op.speed_rad_s, self.axis.settings.speed)

    def _check_switch(self, speed_rad_s: float) -> Refusal | None:
        # The speed setting counts, not the override: that can be raised at any moment.
        if speed_rad_s <= self._without_switch or self.axis.feedback.inputs.enabling_switch:
            return None
        return refusal(Code.INT_05, measured=deg(speed_rad_s), limit=deg(self._without_switch))

    def _check_lease(self) -> Refusal | None:
        # The operator judges the lease by the clock, the program in scans: each stops the key alone (decision 11).
        if self._lease_age < self._lease_scans:
            return None
        period_ms = self.axis.settings.period_s * 1e3
        return refusal(Code.CTL_15, measured=self._lease_age * period_ms, limit=self._lease_scans * period_ms)
