"""The shipped program: power, continuous mode, incremental mode, moves, stops, alarms."""

from __future__ import annotations

from gantryctl.image import InputImage, Mode, OperatorCommand
from gantryctl.program.alarms import Refusal, refusal
from gantryctl.program.axis import Axis
from gantryctl.program.blocks import Halt, Inch, Jog, MoveAbsolute, Power, Reset, SetOverride, Stop
from gantryctl.program.codes import Code
from gantryctl.program.program import AxisProgram
from gantryctl.units import deg


class GantryProgram(AxisProgram):
    """Does what the operator's levels ask for; it finds the edges itself.

    - *Continuous*: moves while exactly one direction key is TRUE and the hold-to-run lease lives.
    - *Incremental*: one rising edge of a key is one increment from the set-point position.
    - `move` works in any mode, at standstill or taking over from another move; halt, stop, quick stop always.

    After a start the mode is NONE and nothing moves. A command that is refused changes nothing and shows in
    `refusal`, with `refusal_count` one higher.

    Args:
        axis: the axis.
        service: resets come from the service role and may clear locked alarms.

    Attributes:
        mode: the mode in force, which follows the operator's at standstill only.
        power, move, jog, inch, halt, stop, reset, override: its blocks, to look at.
    """

    def __init__(self, axis: Axis, *, service: bool = False) -> None:
        super().__init__(axis)
        self.service = service
        self.mode = Mode.NONE
        self.power = Power(axis)
        self.reset = Reset(axis)
        self.override = SetOverride(axis)
        self.stop = Stop(axis)
        self.halt = Halt(axis)
        self.move = MoveAbsolute(axis)
        self.jog = Jog(axis)
        self.inch = Inch(axis)
        speed = axis.settings.speed
        self._speed_min, self._speed_max = speed.setting_min_rad_s, speed.setting_max_rad_s
        self._without_switch = speed.without_enabling_switch_rad_s
        self._lease_scans = axis.settings.scans(axis.settings.monitors.lease_s)
        self._lease_scans = axis.settings.scans(axis.settings.monitors.lease_s)
        self._last = OperatorCommand()
        self._lease = 0
        self._lease_age = self._lease_scans + 1
        self._move_gate = self._keys_dead = False
        self._speed = 0.0

    @property
    def refusal(self) -> Refusal | None:
        """The last refused command: code and text."""
        return self.axis.refusal

    @property
    def refusal_count(self) -> int:
        """How many commands were refused."""
        return self.axis.refusal_count

    def logic(self, image: InputImage) -> None:
        """One scan of the program's own part."""
        op, last = image.operator, self._last
        if op.lease != self._lease:
            self._lease, self._lease_age = op.lease, 0
        else:
            self._lease_age += 1
        self.power(enable=op.power)
        self.reset(execute=op.reset, service=self.service)
        self.override(override=op.override)
        self.stop(execute=op.stop)
        self.halt(execute=op.halt)
        if op is not last:
            self._last = op
            self._edges(op, last)
        self.move(execute=self._move_gate, position_rad=op.target_rad, velocity_rad_s=op.speed_rad_s)
        if self.mode is Mode.CONTINUOUS:
            self._continuous(op)
        elif self.mode is Mode.INCREMENTAL:
            keys = not self._keys_dead
            self.inch(
                forward=op.forward and keys,
                backward=op.reverse and keys,
                distance_rad=op.increment_rad,
                velocity_rad_s=op.speed_rad_s,
            )

    def _edges(self, op: OperatorCommand, last: OperatorCommand) -> None:
        """What acts on a change: quick stop, mode, and whether move and keys may start anything."""
        if op.quick_stop and not last.quick_stop:
            self.axis.quick_stop()
        if op.mode is not last.mode and op.mode is not self.mode:
            self._choose_mode(op)
        if op.move and not last.move:
            self._move_gate = self._allowed(self._check_setting(op) or self._check_not_jogging())
        elif not op.move:
            self._move_gate = False
        pressed = (op.forward and not last.forward) or (op.reverse and not last.reverse)
        if pressed and not self._keys_dead:
            self._keys_dead = not self._allowed(self._check_keys(op))
        elif not (op.forward or op.reverse):
            self._keys_dead = False
        if op.speed_rad_s != self._speed:
            self._choose_speed(op)

    def _continuous(self, op: OperatorCommand) -> None:
        """Hold-to-run: keys, lease and enabling switch must go on being right."""
        if self.jog.busy and not self._keys_dead:
            if self._lease_age > self._lease_scans:
                ms = self.axis.settings.period_s * 1e3
                age, limit = self._lease_age * ms, self._lease_scans * ms
                self.axis.stop_by(Code.CTL_15, measured=age, limit=limit)
                self._keys_dead = True
            elif not self.axis.feedback.inputs.enabling_switch and self._speed > self._without_switch:
                speed, limit = deg(self._speed), deg(self._without_switch)
                self.axis.stop_by(Code.INT_05, measured=speed, limit=limit)
                self._keys_dead = True
        keys = not self._keys_dead
        self.jog(forward=op.forward and keys, backward=op.reverse and keys, velocity_rad_s=self._speed)

    def _choose_mode(self, op: OperatorCommand) -> None:
        """At standstill only; keys that are held now start nothing in the new mode."""
        if self.axis.motion.current is None and self.axis.virtual.at_rest:
            self.mode = op.mode
            self._keys_dead = op.forward or op.reverse
        else:
            self.axis.report_refusal(refusal(Code.CTL_14, measured="the mode changes at standstill only"))

    def _choose_speed(self, op: OperatorCommand) -> None:
        """Another speed setting, for a jog under way too; refused outside the range, which keeps the old one."""
        if self._check_setting(op) is None:
            self._speed = op.speed_rad_s
        elif self.jog.busy:
            self._allowed(self._check_setting(op))

    def _allowed(self, reason: Refusal | None) -> bool:
        if reason is not None:
            self.axis.report_refusal(reason)
        return reason is None

    def _check_keys(self, op: OperatorCommand) -> Refusal | None:
        """Whether a key pressed now may start a motion by hand."""
        if self.mode is Mode.NONE:
            return refusal(Code.CTL_16)
        wrong = self._check_setting(op)
        if wrong is not None:
            return wrong
        if op.speed_rad_s > self._without_switch and not self.axis.feedback.inputs.enabling_switch:
            return refusal(Code.INT_05, measured=deg(op.speed_rad_s), limit=deg(self._without_switch))
        if self.mode is Mode.CONTINUOUS and self._lease_age > self._lease_scans:
            ms = self.axis.settings.period_s * 1e3
            return refusal(Code.CTL_15, measured=self._lease_age * ms, limit=self._lease_scans * ms)
        return None

    def _check_setting(self, op: OperatorCommand) -> Refusal | None:
        if self._speed_min <= op.speed_rad_s <= self._speed_max:
            return None
        allowed = f"within {deg(self._speed_min):.2f} and {deg(self._speed_max):.2f} deg/s"
        measured = f"{deg(op.speed_rad_s):.6g} deg/s"
        return refusal(Code.CTL_01, name="speed", allowed=allowed, measured=measured)

    def _check_not_jogging(self) -> Refusal | None:
        if self.jog.busy:
            return refusal(Code.CTL_14, measured="the axis is moving by hand: release the key first")
        return None
