"""An axis that writes down what blocks ask it for, and answers what a test has put there."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

from gantryctl.program import Code
from gantryctl.program.alarms.log import AlarmLog, refusal
from gantryctl.program.axis.motion_command import Aim, Goal, MotionCommand
from gantryctl.program.axis.states import AxisState
from gantryctl.program.power.brake_test import BrakeTestPhase
from unit.program.rig import settings

REFUSED = refusal(Code.PWR_03)


class Asked:
    """An axis and its commands in one: every order gives a new command, or the refusal that a test has put there."""

    def __init__(self) -> None:
        self.orders: list[tuple[Any, ...]] = []
        self.refusals: list[object] = []
        self.refused: Any = None
        self.motion = self
        self.current: MotionCommand | None = None
        self.settings = settings()
        self.speed_is_reached = False
        self.alarms = AlarmLog()
        self.recovery = SimpleNamespace(resetting=False, failure=None)
        self.power = SimpleNamespace(status=False)
        self.virtual = SimpleNamespace(override=1.0, pos_ref_rad=0.0)
        self.brake_test = SimpleNamespace(
            count=4, phase=BrakeTestPhase.IDLE, plus_nm=math.nan, minus_nm=math.nan, moved_rad=0.0,
            outcome=None, words="words",
        )  # fmt: skip

    def report_refusal(self, reason: object) -> None:
        self.refusals.append(reason)

    def _begun(self, *order: Any, state: AxisState = AxisState.DISCRETE_MOTION) -> MotionCommand:
        self.orders.append(order)
        command = MotionCommand(state, Aim(Goal.SPEED, 1.0) if order[0] == "velocity" else None)
        return command if self.refused is None else command.fail(self.refused)

    def move_absolute(self, *order: Any) -> MotionCommand:
        return self._begun("absolute", *order)

    def move_relative(self, *order: Any) -> MotionCommand:
        return self._begun("relative", *order)

    def move_additive(self, *order: Any) -> MotionCommand:
        return self._begun("additive", *order)

    def move_velocity(self, *order: Any, held: bool = False) -> MotionCommand:
        return self._begun("velocity", *order, *(["held"] if held else []))

    def halt(self) -> MotionCommand:
        return self._begun("halt")

    def stop(self) -> MotionCommand:
        return self._begun("stop")

    def home(self, position_rad: float) -> MotionCommand:
        return self._begun("home", position_rad)

    def release(self, command: MotionCommand) -> None:
        self.orders.append(("release", command))

    def release_stop(self, command: MotionCommand) -> None:
        self.orders.append(("release stop", command))

    def change_speed(self, command: MotionCommand, speed_rad_s: float) -> object:
        self.orders.append(("change", speed_rad_s))
        return self.refused

    def check_speed(self, speed_rad_s: float) -> object:
        return None if speed_rad_s > 0.0 else REFUSED

    def in_velocity(self, command: MotionCommand) -> bool:
        return self.speed_is_reached

    def _asked(self, *order: Any) -> Any:
        self.orders.append(order)
        return self.refused

    def power_on(self) -> object:
        return self._asked("on")

    def power_off(self) -> object:
        return self._asked("off")

    def reset(self, *, service: bool) -> object:
        return self._asked("reset", service)

    def set_override(self, override: float) -> object:
        return self._asked("override", override)

    def set_position(self, position_rad: float) -> object:
        return self._asked("position", position_rad)

    def begin_brake_test(self) -> object:
        return self._asked("test")
