"""Signals of the drive: statusword, position, speed, torque and inputs, as readers of the object dictionary."""

from __future__ import annotations

from collections import deque
from typing import Final

from gantryctl.drives.faults import Faults
from gantryctl.drives.virtual.axis import cia402
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.drives.virtual.axis.drive_axis import DriveAxis
from gantryctl.drives.virtual.axis.hardware import Hardware, Scaling, clamp_int, wrap_i32
from gantryctl.drives.virtual.axis.power_stage import Phase
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.objects import MODE_CSV, MODE_PV
from gantryctl.drives.virtual.personality import Personality

# 400 V mains, rectified.
_DC_LINK_MV: Final = 560_000
_TOGGLE_US: Final = 7000

# Bits of 60FD: 0 to 3 by CiA 402, from 16 on manufacturer-specific, here those of this drive.
LIMIT_MINUS: Final = 1 << 0
LIMIT_PLUS: Final = 1 << 1
INTERLOCK: Final = 1 << 3
ESTOP_OK: Final = 1 << 16
ENABLING_SWITCH: Final = 1 << 17
MAINS_READY: Final = 1 << 18
BRAKE_IS_OPEN: Final = 1 << 19
COLLISION_OK: Final = 1 << 20
DOOR_OK: Final = 1 << 21
ESTOP_OK_2: Final = 1 << 22
WATCHDOG_CLOSED: Final = 1 << 23
MOTION_PERMIT: Final = 1 << 24
_BITS: Final = (
    ("limit_minus", LIMIT_MINUS), ("limit_plus", LIMIT_PLUS), ("estop_ok", ESTOP_OK), ("mains_ready", MAINS_READY),
    ("enabling_switch", ENABLING_SWITCH), ("brake_open", BRAKE_IS_OPEN), ("collision_ok", COLLISION_OK),
    ("door_ok", DOOR_OK), ("estop_ok_2", ESTOP_OK_2), ("watchdog_closed", WATCHDOG_CLOSED),
    ("motion_permit", MOTION_PERMIT),
)  # fmt: skip


# On a real drive model 6041 and 6061 follow a write by 10 ms.
class Lagging:
    """Value that shows later than it changes."""

    def __init__(self, lag_us: int) -> None:
        self._lag_us = lag_us
        self._seen: int | None = None
        self._coming: deque[tuple[int, int]] = deque()

    def note(self, value: int, now_us: int) -> None:
        """Take the true value of this moment."""
        if self._seen is None:
            self._seen = value
        last = self._coming[-1][1] if self._coming else self._seen
        if value != last:
            self._coming.append((now_us + self._lag_us, value))

    def at(self, now_us: int) -> int:
        """Value that shows now."""
        while self._coming and self._coming[0][0] <= now_us:
            self._seen = self._coming.popleft()[1]
        return self._seen or 0


class Signals:
    """Process values of one axis, with the injected faults.

    Args:
        hardware: limit switches.
        axis: state, motor, set-point.
        od: takes the readers.
        scaling: units.
        kind: quirks.
        faults: injected faults.
    """

    def __init__(
        self,
        hardware: Hardware,
        axis: DriveAxis,
        od: Dictionary,
        scaling: Scaling,
        kind: Personality,
        faults: Faults,
    ) -> None:
        self._hardware, self._axis, self._scaling = hardware, axis, scaling
        self._kind, self._faults, self._sign = kind, faults, axis.plant.motor_sign
        self._middle = scaling.counts_per_turn * hardware.turns // 2 if kind.position_around_zero else 0
        self._frozen: int | None = None
        self._now_us = 0
        self._lagging = (Lagging(1000 * kind.lag_ms), Lagging(1000 * kind.lag_ms)) if kind.lag_ms else None
        plant = axis.plant
        od.readers.update(
            {
                (0x6041, 0): self.statusword,
                (0x6061, 0): self.mode_display,
                (0x603F, 0): lambda: axis.error_code,
                (0x6064, 0): self.position,
                (0x606B, 0): lambda: scaling.velocity(self._sign * axis.reference.vel_rad_s),
                (0x606C, 0): self.velocity,
                (0x6077, 0): lambda: scaling.torque(self._sign * (plant.torque_nm + faults.torque_offset)),
                (0x6078, 0): lambda: clamp_int(
                    1000.0 * self._sign * plant.torque_nm / hardware.torque_rated_nm, -32768, 32767
                ),
                (0x6079, 0): lambda: _DC_LINK_MV if faults.mains_ready else 0,
                (0x60FD, 0): self.inputs,
                (0x60E4, 1): self.ring_position,
                (0x2101, 1): lambda: clamp_int(1000.0 * plant.overload, 0, 1000),
                (0x2110, 2): lambda: self._absolute() % scaling.counts_per_turn,
                (0x2110, 3): lambda: self._absolute() // scaling.counts_per_turn,
                (0x2110, 5): lambda: faults.encoder_flags,
                (0x2120, 0): lambda: self._now_us // 1000 & 0xFFFF_FFFF,
            }
        )

    def tick(self, now_us: int) -> None:
        """Sample the lagging values."""
        self._now_us = now_us
        if self._lagging is not None:
            self._lagging[0].note(self._status(), now_us)
            self._lagging[1].note(self._axis.reference.mode, now_us)

    def statusword(self) -> int:
        """Statusword 6041 as the bus sees it."""
        faults = self._faults
        if faults.status_value is not None:
            return faults.status_value & 0xFFFF
        if self._kind.statusword_zero and not self._axis.commanded:
            word = 0
        else:
            word = self._status() if self._lagging is None else self._lagging[0].at(self._now_us)
        toggled = self._kind.status_toggles if self._now_us // _TOGGLE_US % 2 else 0
        return ((word ^ toggled | faults.status_set) & ~faults.status_clear) & 0xFFFF

    def mode_display(self) -> int:
        """Modes of operation display 6061."""
        if self._faults.mode_display is not None:
            return clamp_int(self._faults.mode_display, -128, 127)
        return self._axis.reference.mode if self._lagging is None else self._lagging[1].at(self._now_us)

    def position(self) -> int:
        """Position actual value 6064."""
        if self._position_frozen:
            if self._frozen is None:
                self._frozen = self._position()
            return self._frozen
        self._frozen = None
        return self._position()

    @property
    def _position_frozen(self) -> bool:
        return self._faults.freeze_position or (self._kind.position_frozen and self._axis.stage.energised)

    def velocity(self) -> int:
        """Velocity actual value 606C."""
        faults = self._faults
        if faults.velocity_reading is not None:
            return self._scaling.velocity(self._sign * faults.velocity_reading)
        vel_rad_s = self._sign * self._axis.plant.vel_rad_s
        return 0 if self._position_frozen else self._scaling.velocity(vel_rad_s)

    def wires(self) -> dict[str, bool]:
        """Level of every wire that leads to an input, wherever it ends: True is 24 V."""
        faults, plant = self._faults, self._axis.plant
        lower, upper = self._hardware.limit_switches_rad
        pos_load = plant.sim.truth()[0]
        minus_ok = pos_load > lower if faults.limit_minus_ok is None else faults.limit_minus_ok
        plus_ok = pos_load < upper if faults.limit_plus_ok is None else faults.limit_plus_ok
        brake_open = plant.brake_open if faults.brake_feedback is None else faults.brake_feedback
        # Whether the machine has the last five is in its file, not in the drive.
        return {
            "limit_minus": not minus_ok,
            "limit_plus": not plus_ok,
            "estop_ok": faults.estop_ok,
            "enabling_switch": faults.enabling_switch,
            "mains_ready": faults.mains_ready,
            "brake_open": brake_open,
            "collision_ok": faults.collision_ok is not False,
            "door_ok": faults.door_ok is not False,
            "estop_ok_2": faults.estop_ok_2 is not False,
            "motion_permit": faults.motion_permit is not False,
            "watchdog_closed": plant.cabinet.watchdog_contact,
        }

    def inputs(self) -> int:
        """Digital inputs 60FD."""
        wires = self.wires()
        word = INTERLOCK if wires["estop_ok"] else 0
        for name, bit in _BITS:
            if wires[name]:
                word |= bit
        return word

    def ring_position(self) -> int:
        """Additional position actual value 60E4:01; 0 without an encoder on the ring."""
        return wrap_i32(self._axis.plant.ring_counts())

    def _position(self) -> int:
        plant = self._axis.plant
        return wrap_i32(
            self._scaling.increments(self._sign * plant.counts - plant.wrap_counts)
            - self._middle
            + self._faults.position_offset
        )

    def _absolute(self) -> int:
        """Absolute position of the encoder, within one multiturn range."""
        span = self._hardware.turns * self._scaling.counts_per_turn
        return self._scaling.increments(self._sign * self._axis.plant.counts) % span

    def _status(self) -> int:
        """6041 without faults and quirks."""
        axis, faults = self._axis, self._faults
        state, reference = (State.FAULT if axis.shows_fault else axis.state), axis.reference
        bits = cia402.REMOTE | (cia402.FOLLOWS_COMMAND if self._kind.follows_bit_stuck else 0)
        if faults.mains_ready:
            bits |= cia402.VOLTAGE_ENABLED
        if axis.overload_warning or faults.warning:
            bits |= cia402.WARNING
        if axis.stage.energised:
            if axis.plant.limited or reference.clamped or axis.plant.exhausted:
                bits |= cia402.INTERNAL_LIMIT
            bits |= self._mode_bits(state)
        return cia402.statusword(state, bits)

    def _mode_bits(self, state: State) -> int:
        """Bits 10 (target reached) and 12 (mode specific) of an energised drive."""
        axis = self._axis
        reference, phase = axis.reference, axis.stage.phase
        if state is State.QUICK_STOP:
            return cia402.TARGET_REACHED if phase is Phase.HOLDING else 0
        if state is not State.ENABLED or phase is not Phase.RUNNING:
            return 0
        reached = reference.at_rest if reference.halted else reference.target_reached
        bits = cia402.TARGET_REACHED if reached else 0
        if reference.mode == MODE_CSV:
            return bits | (cia402.FOLLOWS_COMMAND if reference.follows else 0)
        return bits | (cia402.FOLLOWS_COMMAND if reference.mode == MODE_PV and reference.at_rest else 0)
