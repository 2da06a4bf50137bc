"""Where and how a fault acts: every kind by its place, with the arguments that it takes.

A kind acts once, or stands until its time is over: then it returns what ends it. The table exists in this package only,
which no controller imports: on a real bus there is nothing that could be switched on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any, Final, NamedTuple

from gantryctl.drives.faults import FRAME_KINDS, FrameFault, default_of, frame_fault, set_fault
from gantryctl.drives.virtual.communication.nmt import NmtState
from gantryctl.engineering.faults.target import Target
from gantryctl.image import Mode
from gantryctl.units import rad

Undo = Callable[[], None]
Value = bool | int | float | str


class Place(StrEnum):
    """Places where a fault acts."""

    ENCODER = "encoder"
    DRIVE = "drive"
    BRAKE = "brake"
    PLANT = "plant"
    INPUT = "input"
    FRAME = "frame"
    PROCESS = "process"
    CLOCK = "clock"
    OPERATOR = "operator"


class Argument(NamedTuple):
    """Argument of a kind: its type, its range or its choices."""

    type: type
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    default: Value | None = None

    def fault_of(self, value: object) -> str | None:
        """What is wrong with a value, or None."""
        number = self.type is float and isinstance(value, int) and not isinstance(value, bool)
        if not number and type(value) is not self.type:
            return f"must be of type {self.type.__name__}, got {value!r}"
        if self.choices and value not in self.choices:
            return f"must be one of {', '.join(self.choices)}, got {value!r}"
        # NaN is in no range.
        if isinstance(value, int | float) and not self.low <= value <= self.high:
            return f"must be from {self.low:g} to {self.high:g}, got {value!r}"
        return None


class Kind(NamedTuple):
    """One way in which something fails."""

    place: Place
    name: str
    arguments: Mapping[str, Argument]
    needs_bus: bool
    act: Callable[..., Undo | None]

    @property
    def words(self) -> str:
        """What it does, in one line."""
        return (self.act.__doc__ or "").splitlines()[0]


KINDS: Final[dict[tuple[Place, str], Kind]] = {}


def kind(
    place: Place, name: str, /, *, needs_bus: bool = False, **arguments: Argument
) -> Callable[[Callable[..., Undo | None]], Callable[..., Undo | None]]:
    """Enter a function (target, arguments) into the table."""

    def entered(act: Callable[..., Undo | None]) -> Callable[..., Undo | None]:
        KINDS[place, name] = Kind(place, name, arguments, needs_bus, act)
        return act

    return entered


def standing(target: Target, name: str, value: Any) -> Undo:
    """Set a standing fault of the drive; what ends it."""
    set_fault(target.faults, name, value)
    return lambda: set_fault(target.faults, name, default_of(name))


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
_CAN_ID: Final = Argument(int, 0, 0x7FF)
# A data frame of eight bytes with the space behind it, without stuff bits (ISO 11898-1).
_FRAME_BITS: Final = 111

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


@kind(Place.DRIVE, "torque_reading", offset_nm=Argument(float, -1e6, 1e6))
def _torque_reading(target: Target, offset_nm: float) -> Undo:
    """Reported torque is off by this."""
    return standing(target, "torque_offset", float(offset_nm))


@kind(Place.DRIVE, "sign")
def _sign(target: Target) -> Undo:
    """Drive turns the other way; feedback is true."""
    return standing(target, "command_sign", -1)


@kind(Place.DRIVE, "ignore_target")
def _ignore_target(target: Target) -> Undo:
    """Drive keeps its speed and says so (bit 12 = 0)."""
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


@kind(Place.PLANT, "ramp", name=Argument(str), value=_NUMBER, over_s=Argument(float, 1e-3, 3600.0))
def _ramp(target: Target, name: str, value: float, over_s: float) -> Undo:
    """Parameter of the plant goes to a value in a time."""
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


# --- frames ----------------------------------------------------------------------------------------------------------

_SPOILT: Final = {
    "kind": Argument(str, choices=FRAME_KINDS),
    "amount": Argument(int, 0, 1000, default=1),
}


def _spoilt(table: dict[int, FrameFault], key: int, kind: str, amount: int) -> Undo:
    table[key] = frame_fault(kind, amount)

    def end() -> None:
        table.pop(key, None)

    return end


@kind(Place.FRAME, "tpdo", needs_bus=True, number=Argument(int, 1, 4), **_SPOILT)
def _tpdo(target: Target, number: int, kind: str, amount: int) -> Undo:
    """TPDO of the drive is dropped, delayed, doubled, swapped or cut."""
    return _spoilt(target.faults.tpdo, number, kind, amount)


@kind(Place.FRAME, "identifier", needs_bus=True, can_id=_CAN_ID, **_SPOILT)
def _identifier(target: Target, can_id: int, kind: str, amount: int) -> Undo:
    """Frames of an identifier, from or to the drive, are dropped, delayed, doubled, swapped or cut."""
    return _spoilt(target.faults.frames, can_id, kind, amount)


@kind(Place.FRAME, "readings_late", needs_bus=True, late_s=Argument(float, 0.001, 1.0))
def _readings_late(target: Target, late_s: float) -> Undo:
    """Drive hands every reading of state, position and torque over so much later, in every SYNC."""
    scans = math.ceil(late_s / (target.machine.control.scan_period_ms * 1e-3) - 1e-9)
    return _spoilt(target.faults.tpdo, 1, "delay", scans)


@kind(Place.FRAME, "rpdo_lost", needs_bus=True)
def _rpdo_lost(target: Target) -> Undo:
    """Commands of the controller do not reach the drive."""
    return _spoilt(target.faults.frames, 0x200 + target.node.node_id, "drop", 1)


@kind(Place.FRAME, "sync_lost", needs_bus=True)
def _sync_lost(target: Target) -> Undo:
    """SYNC does not reach the drive."""
    return _spoilt(target.faults.frames, 0x80, "drop", 1)


@kind(Place.FRAME, "drive_silent", needs_bus=True)
def _drive_silent(target: Target) -> Undo:
    """Drive is off the bus: sends nothing, hears nothing."""
    return standing(target, "silence", True)


@kind(Place.FRAME, "heartbeat_off", needs_bus=True)
def _heartbeat_off(target: Target) -> Undo:
    """Drive sends no heartbeat."""
    return standing(target, "heartbeat_off", True)


@kind(Place.FRAME, "foreign", needs_bus=True, can_id=_CAN_ID, data=Argument(str))
def _foreign(target: Target, can_id: int, data: str) -> None:
    """Third party sends a frame (data in hexadecimal), which drive and controller hear."""
    target.node.foreign(can_id, bytes.fromhex(data))


@kind(
    Place.FRAME,
    "foreign_nmt",
    needs_bus=True,
    command=Argument(str, choices=("start", "stop", "pre_operational", "reset_node", "reset_communication")),
)
def _foreign_nmt(target: Target, command: str) -> None:
    """Third party sends an NMT command to the drive."""
    codes = {"start": 1, "stop": 2, "pre_operational": 0x80, "reset_node": 0x81, "reset_communication": 0x82}
    target.node.foreign(0, bytes((codes[command], target.node.node_id)))


@kind(Place.FRAME, "flood", needs_bus=True, can_id=_CAN_ID, share=Argument(float, 0.01, 10.0))
def _flood(target: Target, can_id: int, share: float) -> Undo:
    """Third party floods the bus: frames of eight bytes that take this share of the bit rate."""
    key = f"flood {can_id}"
    machine = target.machine
    frames_per_scan = share * machine.can.bitrate * machine.control.scan_period_ms * 1e-3 / _FRAME_BITS
    due = 0.0

    def step() -> None:
        nonlocal due
        due += frames_per_scan
        while due >= 1.0:
            due -= 1.0
            target.node.foreign(can_id, bytes(8))

    target.repeated[key] = step

    def end() -> None:
        target.repeated.pop(key, None)

    return end


@kind(
    Place.FRAME,
    "nmt",
    needs_bus=True,
    state=Argument(str, choices=("STOPPED", "OPERATIONAL", "PRE_OPERATIONAL")),
)
def _nmt(target: Target, state: str) -> None:
    """Drive changes its NMT state by itself."""
    target.node.enter(NmtState[state])


# --- process and clock -----------------------------------------------------------------------------------------------


@kind(Place.PROCESS, "killed", needs_bus=True)
def _killed(target: Target) -> None:
    """Controller makes no scan any more."""
    target.silent = True


@kind(Place.CLOCK, "stall", late_s=Argument(float, 1e-3, 60.0))
def _stall(target: Target, late_s: float) -> None:
    """Next scan is this late; the axis goes on meanwhile."""
    target.clock.stall_s = float(late_s)


# --- operator --------------------------------------------------------------------------------------------------------


@kind(Place.OPERATOR, "move", target_deg=Argument(float), speed_deg_s=Argument(float))
def _move(target: Target, target_deg: float, speed_deg_s: float) -> None:
    """Operator asks for a move, sensible or not."""
    operator = target.operator
    operator.command = operator.command._replace(
        move=True, target_rad=rad(target_deg), speed_rad_s=rad(speed_deg_s), mode=Mode.CONTINUOUS
    )


@kind(Place.OPERATOR, "quick_stop")
def _quick_stop(target: Target) -> None:
    """Operator asks for a quick stop."""
    target.operator.command = target.operator.command._replace(quick_stop=True)


@kind(Place.OPERATOR, "power_off")
def _power_off(target: Target) -> None:
    """Operator switches power off."""
    target.operator.command = target.operator.command._replace(power=False)


@kind(Place.OPERATOR, "override", value=Argument(float))
def _override(target: Target, value: float) -> None:
    """Operator sets the override, sensible or not."""
    target.operator.command = target.operator.command._replace(override=value)
