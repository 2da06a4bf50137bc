"""Ideal drive: actual = set-point, for trying programs without a plant."""

from __future__ import annotations

import math
from typing import Final

from gantryctl.drives.base import BaseDrive, next_state
from gantryctl.image import (
    DigitalInputs,
    DriveFeedback,
    DriveIdentity,
    DriveRequest,
    DriveState,
    OutputImage,
)

_ENABLED: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)


class IdealDrive(BaseDrive):
    """Drive without any deviation: its angle is the integral of the speed command.

    Its torque is the preload, the brake follows its command at once, the load has no inertia. A quick stop ramps
    down; with the torque off the axis stands still at once.

    Args:
        period_s: scan period.
        counts_per_turn: fine counts per motor turn.
        ratio: motor turns per gantry turn.
        pos_rad: gantry angle at the start.
        zero_counts: encoder count at 0 deg.
        turns: multiturn range of the encoder.
        quick_dec_rad_s2: quick-stop deceleration at the gantry.

    Attributes:
        inputs: hard-wired inputs; a test may change them.
        error_code: above 0: the drive is in fault.
    """

    def __init__(
        self,
        period_s: float,
        counts_per_turn: int,
        ratio: float,
        *,
        pos_rad: float = 0.0,
        zero_counts: float = 0.0,
        turns: int = 4096,
        quick_dec_rad_s2: float = math.radians(5.5),
    ) -> None:
        self._identity = DriveIdentity("ideal drive", "IDEAL-0001", counts_per_turn, turns)
        self._period_s = period_s
        self._counts_per_rad = counts_per_turn / (2.0 * math.pi)
        self._ratio = ratio
        self._quick_step = quick_dec_rad_s2 * ratio * period_s
        self._zero_counts = zero_counts
        self.pos_motor_rad = pos_rad * ratio
        self.vel_rad_s = self.torque_nm = 0.0
        self.brake_open = False
        self.state = DriveState.SWITCH_ON_DISABLED
        self.inputs = DigitalInputs()
        self.error_code = 0

    @property
    def pos_rad(self) -> float:
        """Angle of the gantry, rad."""
        return self.pos_motor_rad / self._ratio

    def identity(self) -> DriveIdentity:
        """Counts and range of its encoder."""
        return self._identity

    def read(self) -> DriveFeedback:
        """State at the beginning of this scan."""
        counts = round(self.pos_motor_rad * self._counts_per_rad + self._zero_counts)
        moving = self.state, counts, self.vel_rad_s, self.torque_nm, self.brake_open
        return DriveFeedback(*moving, False, 0.0, error_code=self.error_code, inputs=self.inputs)

    def write(self, output: OutputImage) -> None:
        """Follow the request and advance the angle by one scan of the speed."""
        self._walk(output.request)
        enabled = self.state in _ENABLED
        self.brake_open = enabled and output.brake_open
        self.torque_nm = output.torque_ff_nm if enabled else 0.0
        if self.state is DriveState.OPERATION_ENABLED and self.brake_open:
            self.vel_rad_s = output.vel_cmd_rad_s
        elif self.state is DriveState.QUICK_STOP_ACTIVE and self.brake_open:
            left = max(0.0, abs(self.vel_rad_s) - self._quick_step)
            self.vel_rad_s = math.copysign(left, self.vel_rad_s)
        else:
            self.vel_rad_s = 0.0
        self.pos_motor_rad += self.vel_rad_s * self._period_s

    def close(self) -> None:
        """Torque off, brake closed."""
        self.state = DriveState.SWITCH_ON_DISABLED
        self.vel_rad_s = self.torque_nm = 0.0
        self.brake_open = False

    def plant_state(self) -> dict[str, float]:
        """Angle as the encoder reads it."""
        counts = self.read().pos_act_counts - self._zero_counts
        return {"pos_ideal": counts * math.tau / (self._identity.counts_per_turn * self._ratio)}

    def _walk(self, request: DriveRequest) -> None:
        powered = self.inputs.estop_ok and self.inputs.mains_ready
        faulty = self.error_code != 0
        self.state = next_state(self.state, request, faulty=faulty, powered=powered)
        if self.state is not DriveState.FAULT:
            self.error_code = 0
