"""Plant behind the drive's state machine: motor, encoder, brake and gantry, compiled, one tick at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Final

from gantryctl import _core
from gantryctl.drives.base import state_for
from gantryctl.drives.faults import Faults
from gantryctl.drives.plant_values import FARTHEST_RAD, lost, with_value
from gantryctl.drives.virtual.axis.cabinet import Cabinet
from gantryctl.drives.virtual.axis.hardware import Hardware

_UNLIMITED_S: Final = 1e9
# Part of the overload budget below which the peak torque is available again.
_RELEASE: Final = 0.9


class StageMode(IntEnum):
    """Request of the power stage to the speed loop for one tick."""

    OFF = 0
    SPEED = 1
    RAMP = 2
    """The speed set-point goes to zero on the ramp of `ramp_rad_s2`, at the speed loop's own cycle, and stays there."""


class DrivePlant:
    """Compiled plant with the limits of the moment.

    Args:
        hardware: name plates and parameters.
        faults: injected faults.
    """

    def __init__(self, hardware: Hardware, faults: Faults) -> None:
        self._hardware, self._faults, self.motor_sign = hardware, faults, hardware.motor_sign
        self.cabinet = Cabinet(hardware.watchdog_s, enable_relay=hardware.enable_relay)
        self.plant_params = hardware.plant.copy()
        self._drive = hardware.drive.copy()
        # The I2t account of the compiled drive is switched off: the overload belongs to the motor, not to the torque
        # limit that a bus sets, so it is kept here.
        self._drive.overload_time_s = _UNLIMITED_S
        self._drive.vel_max_rad_s = hardware.speed_max_rad_s
        self._drive.torque_max_nm = hardware.torque_max_nm
        self._spoilt = False
        self._shares = (1.0, 1.0, 0.0)
        self._stale = False
        self.sim = self._make()
        self.sim.static_start(hardware.start_angle_rad, False)
        self.sim.count_offset = hardware.count_offset
        self._count_rad = 6.283185307179586 / hardware.fine_counts_per_turn
        self._farthest_counts = FARTHEST_RAD / self._count_rad
        self._budget = (
            (hardware.torque_max_nm / hardware.torque_rated_nm) ** 2 - 1.0
        ) * hardware.overload_time_s
        self._account = 0.0
        self.exhausted = False
        """Overload budget used up: rated torque at most."""
        self._allowed_nm = hardware.torque_max_nm
        self.watch: Callable[[], None] | None = None
        """Called after each tick: an observer of the true plant."""
        self._read()
        self.power_on()

    def _make(self) -> _core.GantrySim:
        h = self._hardware
        plant, drive = self.plant_params, self._drive
        if self._shares != (1.0, 1.0, 0.0):
            limit, grip, slow_s = self._shares
            plant, drive = plant.copy(), drive.copy()
            drive.torque_max_nm *= limit
            drive.brake_close_s += slow_s
            plant.brake_torque_nm *= grip
        sim = _core.GantrySim(plant, drive, h.tick_s, h.scheme, h.rk4_steps)
        if h.load_encoder is not None:
            sim.fit_load_encoder(*h.load_encoder[:4])
        return sim

    def ring_counts(self) -> int:
        """Count of the encoder on the ring, within one turn; 0 without one."""
        encoder = self._hardware.load_encoder
        if encoder is None:
            return 0
        angle = -self.sim.ring_reading() if encoder.inverted else self.sim.ring_reading()
        return (round(angle / (2.0 * math.pi) * encoder.counts) + encoder.offset) % encoder.counts

    def _apply_levels(self) -> None:
        """Hand the faults that change the compiled gantry to it."""
        faults = self._faults
        self._spoilt = bool(faults.spoilt)
        shares = (faults.torque_limit_share, faults.brake_torque_share, faults.brake_close_slow_s)
        if shares != self._shares:
            self._shares = shares
            self._remake()
        if faults.encoder_gain != self.sim.encoder_gain:
            self.sim.encoder_gain = faults.encoder_gain

    def power_on(self) -> None:
        """Read the encoder as after mains on: only the absolute value within its range is known."""
        span = float(self._hardware.fine_counts_per_turn * self._hardware.turns)
        self.wrap_counts = self.motor_sign * self.counts // span * span

    def restore(self, state: Mapping[str, float]) -> None:
        """Go on from an earlier state of the plant.

        Raises:
            ValueError: a state that lacks a value or has a non-finite one.
        """
        self.sim.state = dict(state)
        self._read()
        self.power_on()

    @property
    def overload(self) -> float:
        """Used part of the I2t budget, 0..1."""
        return self._account / self._budget if self._budget > 0.0 else 0.0

    def limit_torque(self, torque_nm: float) -> None:
        """Apply 6072; the overload may leave less."""
        self._allowed_nm = min(torque_nm, self._hardware.torque_max_nm)
        self._apply_torque()

    def set_ramp(self, dec_rad_s2: float) -> None:
        """Set the deceleration of RAMP."""
        if dec_rad_s2 != self._drive.quick_dec_rad_s2:
            self._drive.quick_dec_rad_s2 = dec_rad_s2
            self._stale = True

    def change_plant(self, name: str, value: float) -> None:
        """Change a plant parameter (side channel).

        Raises:
            UsageError: no such parameter, or a value that no plant can have.
        """
        self.plant_params = with_value(self.plant_params, name, value)
        self._stale = True

    def lose_turns(self, turns: int) -> None:
        """Shift the multiturn part of the encoder by whole turns."""
        self.sim.count_offset += float(turns * self._hardware.fine_counts_per_turn)

    def scan(self, mode: StageMode, vel_rad_s: float, torque_ff_nm: float, brake_open: bool) -> None:
        """Advance drive loops and plant by one tick."""
        faults = self._faults
        if faults.spoilt or self._spoilt:
            self._apply_levels()
            if faults.brake is not None:
                brake_open = faults.brake == "open"
            if faults.no_torque:
                mode = StageMode.OFF
        # Limits and ramp are fixed when a plant is made, so a new one takes over the state. Not while the brake moves:
        # its dead time is not part of that state.
        if self._stale and self.sim.state["brake_closed"] == float(not brake_open):
            self._remake()
        self.sim.scan(mode, vel_rad_s, torque_ff_nm, brake_open)
        self._read()
        self._count_overload()
        if self.watch is not None:
            self.watch()

    def _remake(self) -> None:
        state = self.sim.state
        self.sim = self._make()
        self.sim.state = state_for(state, self.plant_params.brake_presliding_rad)
        self._stale = False

    def _read(self) -> None:
        self.counts, self.vel_rad_s, self.torque_nm, self.brake_open, self.limited, *_ = self.sim.feedback(
            self._count_rad
        )
        if not -self._farthest_counts < self.counts < self._farthest_counts:
            raise lost(self.counts * self._count_rad)

    def _count_overload(self) -> None:
        # I2t: the account grows with (T/T_rated)^2 - 1; the budget is what the highest torque uses in the overload
        # time.
        load = self.torque_nm / self._hardware.torque_rated_nm
        account = self._account + (load * load - 1.0) * self._hardware.tick_s
        self._account = account = min(max(account, 0.0), self._budget)
        exhausted = account >= self._budget or (self.exhausted and account > _RELEASE * self._budget)
        if exhausted is not self.exhausted and self._budget > 0.0:
            self.exhausted = exhausted
            self._apply_torque()

    def _apply_torque(self) -> None:
        limit = min(self._allowed_nm, self._hardware.torque_rated_nm) if self.exhausted else self._allowed_nm
        if limit != self._drive.torque_max_nm:
            self._drive.torque_max_nm = limit
            self._stale = True
