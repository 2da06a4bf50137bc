"""PLCopen reading blocks: copies of what the axis has anyway."""

from __future__ import annotations

from abc import ABC, abstractmethod

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.axis.axis import Axis
from gantryctl.program.axis.permission import why_no_torque
from gantryctl.program.axis.states import AxisState
from gantryctl.program.blocks.base import Block


def _flag(state: AxisState, doc: str) -> property:
    return property(lambda block: block.valid and block.state is state, doc=doc)


class ReadStatus(Block):
    """The axis state as one flag per state (MC_ReadStatus)."""

    __slots__ = ("state", "valid")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.valid = False
        self.state = AxisState.DISABLED

    def __call__(self, *, enable: bool = True) -> None:
        self.valid = enable
        if enable:
            self.state = self.axis.state

    error_stop = _flag(AxisState.ERROR_STOP, "Stopped by an alarm.")
    disabled = _flag(AxisState.DISABLED, "Power is off.")
    stopping = _flag(AxisState.STOPPING, "Held by Stop.")
    homing = _flag(AxisState.HOMING, "Home is being executed.")
    standstill = _flag(AxisState.STANDSTILL, "Power is on, no motion.")
    discrete_motion = _flag(AxisState.DISCRETE_MOTION, "A motion with an end.")
    continuous_motion = _flag(AxisState.CONTINUOUS_MOTION, "A motion with a speed only.")
    synchronized_motion = _flag(AxisState.SYNCHRONIZED_MOTION, "Never in this version.")


class ReadAxisError(Block):
    """The alarm that stopped the axis: first out."""

    __slots__ = ("axis_error_id", "axis_error_text", "valid")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.valid = False
        self.axis_error_id: Code | None = None
        self.axis_error_text = ""

    def __call__(self, *, enable: bool = True) -> None:
        self.valid = enable
        first = self.axis.alarms.first_out
        if enable:
            self.axis_error_id = None if first is None else first.code
            self.axis_error_text = "" if first is None else first.text


class ReadAxisInfo(Block):
    """What the axis is ready for, from its inputs and its drive.

    There is no Simulation output: a program cannot tell a simulator from a drive.

    Attributes:
        limit_switch_pos, limit_switch_neg: the switch is actuated.
        communication_ready: the drive is heard. ready_for_power_on: nothing stands against Power.
        is_homed: the angle is known. axis_warning: a warning is active.
    """

    __slots__ = (
        "axis_warning", "communication_ready", "is_homed", "limit_switch_neg", "limit_switch_pos", "power_on",
        "ready_for_power_on", "valid",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.valid = self.limit_switch_pos = self.limit_switch_neg = self.communication_ready = False
        self.ready_for_power_on = self.power_on = self.is_homed = self.axis_warning = False

    def __call__(self, *, enable: bool = True) -> None:
        self.valid = enable
        if not enable:
            return
        axis = self.axis
        feedback = axis.feedback
        self.limit_switch_pos = not feedback.inputs.limit_plus_ok
        self.limit_switch_neg = not feedback.inputs.limit_minus_ok
        self.communication_ready = feedback.state is not DriveState.UNKNOWN and not feedback.state_old
        self.ready_for_power_on = why_no_torque(feedback, axis.alarms) is None
        self.power_on = axis.power.status
        self.is_homed = feedback.position_valid
        self.axis_warning = any(alarm.reaction is Reaction.W for alarm in axis.alarms.active.values())


class ReadMotionState(Block):
    """Motion state of the set-point."""

    __slots__ = (
        "accelerating", "constant_velocity", "decelerating", "direction_negative", "direction_positive",
        "valid",
    )  # fmt: skip

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.valid = self.constant_velocity = self.accelerating = self.decelerating = False
        self.direction_positive = self.direction_negative = False

    def __call__(self, *, enable: bool = True) -> None:
        self.valid = enable
        virtual = self.axis.virtual
        vel, acc = virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2
        moving = enable and not virtual.at_rest
        self.constant_velocity = moving and acc == 0.0
        self.accelerating = moving and (acc * vel > 0.0 or (vel == 0.0 and acc != 0.0))
        self.decelerating = moving and acc * vel < 0.0
        self.direction_positive = moving and vel > 0.0
        self.direction_negative = moving and vel < 0.0


class _ReadValue(Block, ABC):
    __slots__ = ("valid", "value")

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.valid = False
        self.value = 0.0

    def __call__(self, *, enable: bool = True) -> None:
        self.valid = enable
        if enable:
            self.value = self._read()

    @abstractmethod
    def _read(self) -> float: ...


class ReadActualPosition(_ReadValue):
    """`value`: measured angle, rad, of a modulo axis within its turn; `valid` FALSE after a fault of the encoder."""

    __slots__ = ()

    def _read(self) -> float:
        self.valid = self.axis.feedback.position_valid
        return self.axis.settings.travel.shown_rad(self.axis.pos_act_rad)


class ReadActualVelocity(_ReadValue):
    """`value`: the drive's speed at the gantry, rad/s."""

    __slots__ = ()

    def _read(self) -> float:
        return self.axis.feedback.vel_rad_s


class ReadActualTorque(_ReadValue):
    """`value`: the motor's torque, N m."""

    __slots__ = ()

    def _read(self) -> float:
        return self.axis.feedback.torque_nm
