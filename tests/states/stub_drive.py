"""A drive of few values behind the real program: CiA 402 state, brake contact, shaft, encoder, inputs, link.

It knows no physics. What a real drive may do is an event: a condition that stands until it is cleared, or something
that happens once. The shaft follows the set-point of the program exactly while the drive obeys, so that positions stay
on a grid of half a scan's way, and the number of states is finite.
"""

from __future__ import annotations

import math
from enum import StrEnum

from gantryctl.drives.base import next_state
from gantryctl.image import (
    DigitalInputs,
    DriveFeedback,
    DriveState,
    EncoderFlag,
    LinkFlag,
    OutputImage,
)
from gantryctl.program import Axis
from gantryctl.units import rad
from states.brief_settings import WAY_RAD

ENABLED = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
# Above the sag of 0.02 deg that a brake may allow, below a jump of the encoder.
_SLIP_RAD = rad(0.1)
_JUMP_RAD = rad(40.0)
_TOO_FAST = 4.0
GRID_RAD = 0.5 * WAY_RAD
_ERROR = 0x8611


class Standing(StrEnum):
    """Conditions that stand until they are cleared."""

    ESTOP = "emergency stop open"
    MAINS = "mains not ready"
    LIMIT_PLUS = "limit switch plus open"
    LIMIT_MINUS = "limit switch minus open"
    COLLISION = "collision interlock open"
    DOOR = "room door open"
    SWITCH = "enabling switch released"
    FAULT = "drive fault"
    STUCK = "drive obeys no request"
    CONTACT_OPEN = "brake contact says open"
    CONTACT_CLOSED = "brake contact says closed"
    OWNS_BRAKE = "drive works the brake itself"
    NO_TORQUE = "motor gives no torque"
    STANDS = "shaft does not begin to turn"
    COASTS = "shaft does not come to rest"
    ENCODER_ALARM = "encoder alarm bit"
    ENCODER_JUMP = "encoder shifted"
    SILENT = "heartbeat lost"
    FOREIGN = "another master"


class Once(StrEnum):
    """What happens once."""

    LEAVES = "drive leaves its enable"
    SLIPS = "load slips, and back"
    RACES = "speed reading far too high"


class StubDrive:
    """State of the drive and its shaft; `advance` is one scan.

    Attributes:
        standing: conditions that stand now.
        shown_rad_s: speed reading: that of the command before, while the drive obeys it.
        slipped: the next reading shows the load beside where it stood.
        race: the next reading shows a speed that is far too high.
        faults: how many have happened since the axis was last without any.
    """

    __slots__ = (
        "brake_open",
        "faults",
        "pos_rad",
        "race",
        "shown_rad_s",
        "slipped",
        "standing",
        "state",
        "vel_rad_s",
    )

    def __init__(self) -> None:
        self.state = DriveState.SWITCH_ON_DISABLED
        self.brake_open = False
        self.pos_rad = self.vel_rad_s = self.shown_rad_s = 0.0
        self.standing: frozenset[Standing] = frozenset()
        self.slipped = self.race = False
        self.faults = 0

    def happen(self, fault: Standing | Once) -> None:
        """A condition begins or ends, or something happens once."""
        if fault not in self.standing:
            self.faults += 1
        match fault:
            case Standing():
                self.standing ^= {fault}
            case Once.LEAVES:
                self.state = DriveState.SWITCH_ON_DISABLED
            case Once.SLIPS:
                self.slipped = True
            case Once.RACES:
                self.race = True

    def read(self, axis: Axis) -> DriveFeedback:
        law, on = axis.settings.law, self.standing
        torque = axis.power.torque_ff_nm if self.state in ENABLED and Standing.NO_TORQUE not in on else 0.0
        link = LinkFlag.HEARTBEAT_LOST if Standing.SILENT in on else LinkFlag.NONE
        link |= LinkFlag.OTHER_MASTER if Standing.FOREIGN in on else LinkFlag.NONE
        angle, self.slipped = self.pos_rad + self._offset_rad, False
        speed = self.shown_rad_s
        if self.race:
            speed, self.race = _TOO_FAST * axis.settings.speed.overspeed_trip_rad_s, False
        return DriveFeedback(
            self.state,
            angle / (2.0 * math.pi) * law.ratio * law.counts_per_turn,
            speed * law.ratio,
            torque,
            self.contact,
            False,
            0.0,
            EncoderFlag.ALARM if Standing.ENCODER_ALARM in on else EncoderFlag.NONE,
            _ERROR if self.state is DriveState.FAULT else 0,
            False,
            1 if Standing.SILENT in on else 0,
            DigitalInputs(
                Standing.ESTOP not in on,
                Standing.SWITCH not in on,
                Standing.LIMIT_MINUS not in on,
                Standing.LIMIT_PLUS not in on,
                Standing.MAINS not in on,
                collision_ok=Standing.COLLISION not in on,
                door_ok=Standing.DOOR not in on,
            ),
            0.0,
            link,
        )

    @property
    def _offset_rad(self) -> float:
        """What the encoder shows beside the shaft that follows."""
        return (_SLIP_RAD if self.slipped else 0.0) + (
            _JUMP_RAD if Standing.ENCODER_JUMP in self.standing else 0.0
        )

    @property
    def contact(self) -> bool:
        """What the brake contact says."""
        if Standing.CONTACT_OPEN in self.standing:
            return True
        return self.brake_open and Standing.CONTACT_CLOSED not in self.standing

    def advance(self, output: OutputImage, axis: Axis) -> None:
        """Follow the request, the brake command and the set-point by one scan."""
        on = self.standing
        if Standing.STUCK not in on:
            powered = Standing.ESTOP not in on and Standing.MAINS not in on
            faulty = Standing.FAULT in on or self.state is DriveState.FAULT
            self.state = next_state(self.state, output.request, faulty=faulty, powered=powered)
        enabled = self.state in ENABLED
        self.brake_open = enabled and (output.brake_open or Standing.OWNS_BRAKE in on)
        self._move(axis)
        obeys = self.state is DriveState.OPERATION_ENABLED and self.brake_open
        self.shown_rad_s = output.vel_cmd_rad_s / axis.settings.law.ratio if obeys else self.vel_rad_s
        if not self.standing and not axis.alarms.active:
            self.faults = 0

    def _move(self, axis: Axis) -> None:
        virtual, period_s = axis.virtual, axis.settings.period_s
        if self.state is DriveState.OPERATION_ENABLED and self.brake_open and virtual.following:
            if Standing.STANDS in self.standing and self.vel_rad_s == 0.0:
                return
            t = (axis.scan + 1 - virtual.start_scan) * period_s
            pos_rad, self.vel_rad_s, _ = virtual.plan.sample(t)
            jump_rad = _JUMP_RAD if Standing.ENCODER_JUMP in self.standing else 0.0
            # On its grid also when the program begins from a reading that was spoilt.
            self.pos_rad = on_grid(pos_rad - jump_rad)
        elif Standing.COASTS not in self.standing:
            # To rest within this scan, on a ramp that takes half of its way. A shaft at rest beside the grid would jump
            # onto it when it is followed again.
            self.pos_rad = on_grid(self.pos_rad + 0.5 * self.vel_rad_s * period_s)
            self.vel_rad_s = 0.0


def on_grid(angle_rad: float) -> float:
    """The nearest angle of the grid."""
    return round(angle_rad / GRID_RAD) * GRID_RAD
