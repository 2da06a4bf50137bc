"""Kinds that act on the axis: encoder, drive, brake, plant, hard-wired inputs."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.engineering.faults.kinds.kind import Argument, Place, Table, Undo, enters, standing
from gantryctl.engineering.faults.physics import friction_nm
from gantryctl.engineering.faults.target import Target
from gantryctl.machine.rules.parts import motion_torque_nm
from gantryctl.units import rad

KINDS: Final[Table] = {}
kind = enters(KINDS)

INPUTS: Final = (
    "estop_ok",
    "estop_ok_2",
    "mains_ready",
    "enabling_switch",
    "limit_minus_ok",
    "limit_plus_ok",
    "collision_ok",
    "door_ok",
    "motion_permit",
)
_NUMBER: Final = Argument(float, -1e12, 1e12)
_SHARE: Final = Argument(float, 0.0, 1.0)
_RATED: Final = Argument(float, -100.0, 100.0)
# Where an eccentric moment has next to no torque, no moment of any size is told.
_SINE_LEAST: Final = 0.1

# --- encoder ---------------------------------------------------------------------------------------------------------


@kind(Place.ENCODER, "gain", value=Argument(float, -10.0, 10.0))
def _gain(target: Target, value: float) -> Undo:
    """Encoder shows this part of the motion, also to the drive's own loops: 0 frozen, -1 sign wrong."""
    return standing(target, "encoder_gain", float(value))


@kind(Place.ENCODER, "jump", angle_deg=Argument(float, -360.0, 360.0))
def _jump(target: Target, angle_deg: float) -> None:
    """Encoder jumps by an angle of the gantry, also for the drive's own loops."""
    target.jump_encoder(angle_deg)


@kind(Place.ENCODER, "freeze_reading")
def _freeze_reading(target: Target) -> Undo:
    """Reading keeps its value; the drive's own loop sees the true shaft."""
    return standing(target, "freeze_position", True)


@kind(Place.ENCODER, "flags", bits=Argument(int, 0, 255))
def _flags(target: Target, bits: int) -> Undo:
    """Reading carries flags: 1 checksum error, 2 alarm, 4 warning."""
    return standing(target, "encoder_flags", bits)


@kind(Place.ENCODER, "speed_reading", speed_deg_s=Argument(float, -1e300, 1e300))
def _speed_reading(target: Target, speed_deg_s: float) -> Undo:
    """Speed that the drive reports, deg/s at the gantry; its own loop sees the true one."""
    return standing(target, "velocity_reading", rad(speed_deg_s) * target.machine.axis.ratio)


@kind(Place.ENCODER, "turns", turns=Argument(int, -100_000, 100_000))
def _turns(target: Target, turns: int) -> None:
    """Multiturn part is off by whole motor turns."""
    target.lose_turns(turns)


# --- drive -----------------------------------------------------------------------------------------------------------


@kind(Place.DRIVE, "no_torque")
def _no_torque(target: Target) -> Undo:
    """Drive is enabled, and its power stage gives nothing."""
    return standing(target, "no_torque", True)


@kind(Place.DRIVE, "torque_limit", share=_SHARE)
def _torque_limit(target: Target, share: float) -> Undo:
    """Power stage has this part of its torque limit."""
    return standing(target, "torque_limit_share", float(share))


@kind(Place.DRIVE, "torque_reading", limit_share=_RATED)
def _torque_reading(target: Target, limit_share: float) -> Undo:
    """Reported torque is off by this part of the torque limit."""
    return standing(target, "torque_offset", limit_share * target.machine.motor.torque_max_nm)


@kind(Place.DRIVE, "sign")
def _sign(target: Target) -> Undo:
    """Drive turns the other way; feedback is true."""
    return standing(target, "command_sign", -1)


@kind(Place.DRIVE, "ignore_target")
def _ignore_target(target: Target) -> Undo:
    """Drive keeps its speed and reports it (bit 12 = 0)."""
    return standing(target, "ignore_target", True)


@kind(Place.DRIVE, "never_move")
def _never_move(target: Target) -> Undo:
    """Drive stands still and claims to follow."""
    return standing(target, "never_move", True)


@kind(Place.DRIVE, "stuck_state")
def _stuck_state(target: Target) -> Undo:
    """CiA 402 state machine obeys no command."""
    return standing(target, "stuck_state", True)


@kind(Place.DRIVE, "quick_stop_off")
def _quick_stop_off(target: Target) -> Undo:
    """Quick stop is acknowledged, and the shaft goes on turning."""
    return standing(target, "quick_stop_off", True)


@kind(Place.DRIVE, "warning")
def _warning(target: Target) -> Undo:
    """Drive warns (bit 7)."""
    return standing(target, "warning", True)


@kind(Place.DRIVE, "trip", code=Argument(int, 1, 0xFFFF))
def _trip(target: Target, code: int) -> None:
    """Drive raises a fault of its own: torque off."""
    target.trip(code)


@kind(Place.DRIVE, "leaves_enabled")
def _leaves_enabled(target: Target) -> None:
    """Drive leaves Operation enabled by itself, without a fault."""
    target.leave_enabled()


@kind(Place.DRIVE, "mode_display", needs_bus=True, mode=Argument(int, -128, 127))
def _mode_display(target: Target, mode: int) -> Undo:
    """Drive shows another mode in 6061."""
    return standing(target, "mode_display", mode)


@kind(Place.DRIVE, "status", needs_bus=True, set=Argument(int, 0, 0xFFFF), clear=Argument(int, 0, 0xFFFF))
def _status(target: Target, set: int, clear: int) -> Undo:
    """Bits of 6041 are always 1, always 0."""
    ends = standing(target, "status_set", set), standing(target, "status_clear", clear)

    def end() -> None:
        for each in ends:
            each()

    return end


@kind(Place.DRIVE, "restart", needs_bus=True, off_s=Argument(float, 0.0, 3600.0, default=0.0))
def _restart(target: Target, off_s: float) -> None:
    """Drive restarts by itself."""
    target.node.reset(communication_only=False, off_us=round(off_s * 1e6))


@kind(
    Place.DRIVE,
    "object",
    needs_bus=True,
    index=Argument(int, 0, 0xFFFF),
    sub=Argument(int, 0, 255, default=0),
    value=Argument(int, -(1 << 31), (1 << 32) - 1),
)
def _object(target: Target, index: int, sub: int, value: int) -> None:
    """Object of the drive changes by itself."""
    target.node.od.force(index, sub, value)


@kind(
    Place.DRIVE,
    "emcy",
    needs_bus=True,
    code=Argument(int, 0, 0xFFFF),
    count=Argument(int, 1, 100_000, default=1),
)
def _emcy(target: Target, code: int, count: int) -> None:
    """Drive sends emergency messages without a fault of its own."""
    for _ in range(count):
        target.node.emergency.raw(code, 0x81)


# --- brake -----------------------------------------------------------------------------------------------------------


@kind(Place.BRAKE, "stuck", position=Argument(str, choices=("closed", "open")))
def _stuck(target: Target, position: str) -> Undo:
    """Brake is stuck, or closes or opens by itself."""
    return standing(target, "brake", position)


@kind(Place.BRAKE, "contact", open=Argument(bool))
def _contact(target: Target, open: bool) -> Undo:
    """Contact of the brake shows this, whatever the brake does."""
    return standing(target, "brake_feedback", open)


@kind(Place.BRAKE, "torque", share=_SHARE)
def _brake_torque(target: Target, share: float) -> Undo:
    """Closed brake has this part of its torque."""
    return standing(target, "brake_torque_share", float(share))


@kind(Place.BRAKE, "slow", late_s=Argument(float, 0.0, 10.0))
def _slow(target: Target, late_s: float) -> Undo:
    """Brake closes this much later."""
    return standing(target, "brake_close_slow_s", float(late_s))


# --- plant -----------------------------------------------------------------------------------------------------------


@kind(Place.PLANT, "set", name=Argument(str), value=_NUMBER)
def _set(target: Target, name: str, value: float) -> Undo:
    """Parameter of the plant steps to a value."""
    before = target.plant_value(name)
    target.change_plant(name, value)
    return lambda: target.change_plant(name, before)


@kind(
    Place.PLANT,
    "motor_friction",
    beyond_load_share=_RATED,
    over_s=Argument(float, 1e-3, 3600.0, default=1e-3),
)
def _motor_friction(target: Target, beyond_load_share: float, over_s: float) -> Undo:
    """Friction of the motor grows until its torque is what any motion asks for and this part of the rated torque, in
    the mean of the gusts.
    """
    machine, feedback = target.machine, target.engine.image.drive
    sign = math.copysign(1.0, feedback.vel_act_rad_s)
    now_nm = sign * feedback.torque_act_nm
    if machine.plant.switches.wind:
        # A gust is gone before the drag is told.
        wind_nm = machine.plant.wind.moment_nm / machine.axis.ratio
        now_nm = friction_nm(machine, feedback.vel_act_rad_s) - sign * wind_nm
    beyond_nm = motion_torque_nm(machine) + beyond_load_share * machine.motor.torque_rated_nm - now_nm
    # A load that asks for more already (B7) leaves nothing to grow; friction below nothing would drive the shaft on.
    beyond_nm = max(0.0, beyond_nm)
    return _to_value(target, "motor_coulomb_nm", target.plant_value("motor_coulomb_nm") + beyond_nm, over_s)


@kind(Place.PLANT, "load_shift", rated_share=_RATED, over_s=Argument(float, 1e-3, 3600.0))
def _load_shift(target: Target, rated_share: float, over_s: float) -> Undo:
    """Eccentric moment grows, in a time, until with the wind this part of the rated torque must hold it."""
    machine = target.machine
    held_nm = (rated_share * machine.motor.torque_rated_nm + friction_nm(machine)) * machine.axis.ratio
    # It acts by the sine of the angle; the mean of the wind acts everywhere, and the load shifts the way it blows.
    at_rad = target.device.truth()[2] / machine.axis.ratio
    sine = math.sin(at_rad - rad(machine.plant.load.eccentric_angle_deg))
    sine = math.copysign(max(abs(sine), _SINE_LEAST), sine)
    wind_nm = machine.plant.wind.moment_nm if machine.plant.switches.wind else 0.0
    moment_nm = (math.copysign(held_nm, wind_nm or sine) - wind_nm) / sine
    return _to_value(target, "eccentric_moment_nm", moment_nm, over_s)


@kind(Place.PLANT, "ramp", name=Argument(str), value=_NUMBER, over_s=Argument(float, 1e-3, 3600.0))
def _ramp(target: Target, name: str, value: float, over_s: float) -> Undo:
    """Parameter of the plant goes to a value in a time."""
    return _to_value(target, name, value, over_s)


def _to_value(target: Target, name: str, value: float, over_s: float) -> Undo:
    before, engine = target.plant_value(name), target.engine
    begin_s, key = engine.time_s, f"ramp {name}"

    def step() -> None:
        part = min(1.0, (engine.time_s - begin_s) / over_s)
        target.change_plant(name, before + part * (value - before))
        if part >= 1.0:
            target.repeated.pop(key, None)

    def end() -> None:
        target.repeated.pop(key, None)
        target.change_plant(name, before)

    target.repeated[key] = step
    return end


# --- inputs ----------------------------------------------------------------------------------------------------------


@kind(
    Place.INPUT,
    "off",
    name=Argument(str, choices=INPUTS),
)
def _off(target: Target, name: str) -> Undo:
    """Hard-wired input is off."""
    return standing(target, name, False)


@kind(Place.INPUT, "motor_temperature", temp_c=Argument(float, -273.0, 1e6))
def _motor_temperature(target: Target, temp_c: float) -> Undo:
    """Temperature sensor of the motor shows this, C."""
    return standing(target, "motor_temp_c", float(temp_c))
