"""Power stage and brake: torque and its phases, whatever the statusword shows.

| phase    | torque                     | brake (owned by the drive)  | leads to                           |
|----------|----------------------------|-----------------------------|------------------------------------|
| OFF      | none                       | closed                      | STARTING, RUNNING                  |
| STARTING | zero speed, preload 60B2   | closed, then opening        | RUNNING (READY is reported)        |
| RUNNING  | follows the mode           | open                        | STOPPING, OFF                      |
| STOPPING | ramp to zero               | open                        | HOLDING or CLOSING at rest         |
| HOLDING  | zero speed                 | open                        | RUNNING, OFF                       |
| CLOSING  | zero speed                 | closing                     | OFF (STOPPED is reported)          |

A brake worked by 60FE opens only while there is torque: in OFF it is closed whatever 60FE says. With such a brake, and
with one behind a relay of the controller, STARTING and CLOSING are left out.
"""

from __future__ import annotations

from enum import Enum
from typing import Final, assert_never

from gantryctl.drives.virtual.axis.cia402 import Ramp
from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.axis.plant import DrivePlant, StageMode
from gantryctl.drives.virtual.axis.speed_reference import SpeedReference, StageCommand
from gantryctl.drives.virtual.communication.dictionary import Dictionary

# The shaft is at rest after this time below the velocity threshold 606F.
_REST_US: Final = 10_000
_IDLE: Final = StageCommand(StageMode.OFF, 0.0)
_STAND: Final = StageCommand(StageMode.SPEED, 0.0)


class Phase(Enum):
    """Phases of the table above."""

    OFF = 0
    STARTING = 1
    RUNNING = 2
    STOPPING = 3
    HOLDING = 4
    CLOSING = 5


class Event(Enum):
    """End of a phase, reported by a tick."""

    READY = 0
    """Energised, brake open."""
    STOPPED = 1
    """At rest, brake closed: the torque can go."""


class PowerStage:
    """Phases of one axis.

    Args:
        hardware: who owns the brake.
        od: brake times, 60FE.
        plant: the plant.
        reference: speed reference while RUNNING.
    """

    def __init__(
        self, hardware: Hardware, od: Dictionary, plant: DrivePlant, reference: SpeedReference
    ) -> None:
        self._od, self._plant, self._reference = od, plant, reference
        self._tick_us = round(hardware.tick_s * 1e6)
        self._owns_brake = hardware.brake_owner == "drive"
        self._by_relay = hardware.brake_owner == "controller_output"
        self.phase = Phase.OFF
        self.brake_held_open = False
        """The brake does not close in the OFF that follows: a lie."""
        self._ramp = Ramp.NONE
        self._stay = False
        self._timer_us = 0

    @property
    def energised(self) -> bool:
        """Torque is on."""
        return self.phase is not Phase.OFF

    def start(self) -> bool:
        """Energise; True if the axis runs at once."""
        self._timer_us = 0
        if self._owns_brake:
            self.phase = Phase.STARTING
            return False
        self.run()
        return True

    def run(self) -> None:
        """Follow the speed reference."""
        self.phase = Phase.RUNNING
        self._reference.start()

    def stop(self, ramp: Ramp, stay: bool) -> None:
        """Bring the shaft to rest; a closing brake goes on closing."""
        self._stay = stay
        if self.phase is not Phase.CLOSING:
            self.phase = Phase.STOPPING
            self._ramp = ramp
            self._timer_us = 0

    def off(self) -> None:
        """Torque off now, brake closed."""
        self.phase = Phase.OFF
        self._reference.start()

    def advance(self) -> Event | None:
        """Advance timers and phases by one tick."""
        match self.phase:
            case Phase.OFF | Phase.RUNNING | Phase.HOLDING:
                return None
            case Phase.STARTING:
                # 2100:03 is the preload time before the brake opens, 2100:01 its opening time, ms.
                self._timer_us += self._tick_us
                if self._timer_us <= 1000 * (self._od.number(0x2100, 3) + self._od.number(0x2100, 1)):
                    return None
                self.run()
                return Event.READY
            case Phase.STOPPING:
                self._timer_us = self._timer_us + self._tick_us if self._reference.at_rest else 0
                return self._rested() if self._timer_us >= _REST_US else None
            case Phase.CLOSING:
                self._timer_us += self._tick_us
                return Event.STOPPED if self._timer_us > 1000 * self._od.number(0x2100, 2) else None
            case _:
                assert_never(self.phase)

    def _rested(self) -> Event | None:
        if self._stay:
            self.phase = Phase.HOLDING
            return None
        if not self._owns_brake:
            return Event.STOPPED
        self.phase = Phase.CLOSING
        self._timer_us = 0
        return None

    def apply(self, controlword: int, coasting: bool) -> None:
        """Drive the plant for one tick.

        Args:
            controlword: for the halt bit.
            coasting: keep the last speed instead of following, as a drive that ignores a quick stop.
        """
        drive = self._drive(controlword, coasting)
        self._plant.scan(drive.mode, drive.vel_rad_s, self._reference.torque_ff_nm, self._brake_open())

    def _drive(self, controlword: int, coasting: bool) -> StageCommand:
        match self.phase:
            case Phase.OFF:
                return _IDLE
            case Phase.STARTING:
                return _STAND
            case Phase.RUNNING:
                if coasting:
                    return StageCommand(StageMode.SPEED, self._reference.vel_rad_s)
                return self._reference.run(controlword)
            case Phase.STOPPING | Phase.HOLDING | Phase.CLOSING:
                self._reference.vel_rad_s = 0.0
                dec_rad_s2 = self._reference.deceleration(self._ramp)
                # A ramp of 0, the default of some drives, is no ramp: as hard as the torque limit allows.
                if self._ramp is Ramp.LIMIT or not dec_rad_s2:
                    return _STAND
                self._plant.set_ramp(dec_rad_s2)
                return StageCommand(StageMode.RAMP, 0.0)
            case _:
                assert_never(self.phase)

    def _brake_open(self) -> bool:
        if self._by_relay:
            return self._plant.cabinet.brake_released
        if self.phase is Phase.OFF:
            return self.brake_held_open
        if not self._owns_brake:
            # 60FE:01 bit 0 sets the brake, 60FE:02 is the mask of the outputs in use (CiA 402).
            released = not self._od.number(0x60FE, 1) & 1
            return bool(self._od.number(0x60FE, 2) & 1) and released
        if self.phase is Phase.STARTING:
            return self._timer_us > 1000 * self._od.number(0x2100, 3)
        return self.phase is not Phase.CLOSING or self.brake_held_open
