"""A drive on a bus without a position loop, scan by scan: for the proofs that come before the loop may be closed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import Final

from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.errors import AlarmStop, CommandRefused, DeviceError
from gantryctl.image import DriveFeedback, DriveRequest, DriveState, OutputImage
from gantryctl.machine import Machine
from gantryctl.operation.opening import keep_machine, open_machine
from gantryctl.operation.proofs import bus_reasons
from gantryctl.operation.store import StateStore
from gantryctl.runtime import RealClock, Retained, VirtualClock, keeps_time
from gantryctl.units import deg, rad

ENABLE: Final = DriveRequest.ENABLE
_ENABLE_S: Final = 2.0
_SILENT_S: Final = 1.5


class OpenLoopAxis:
    """Commands to an open drive, switched off when the gantry moves too far.

    Args:
        feedback: what the drive showed when it was opened.
        leash_deg: way from there at which the axis is switched off.

    Attributes:
        retained: the controller's memory, kept at the end; a step may change it.
    """

    def __init__(
        self,
        machine: Machine,
        drive: CanopenDrive,
        feedback: DriveFeedback,
        leash_deg: float,
        retained: Retained,
    ) -> None:
        self.retained = retained
        self.drive, self.period_s = drive, drive.settings.period_s
        self.ratio = machine.axis.ratio
        self._leash_deg = leash_deg
        self._deg_per_count = 360.0 / (drive.identity().counts_per_turn * self.ratio)
        self._clock = RealClock(self.period_s) if machine.paced_by_clock else VirtualClock()
        self._deadline = 0
        self.feedback, self.start_counts = feedback, feedback.pos_act_counts

    @property
    def angle_deg(self) -> float:
        """Way of the gantry since the start, motor side."""
        return (self.feedback.pos_act_counts - self.start_counts) * self._deg_per_count

    @property
    def speed_deg_s(self) -> float:
        """Of the gantry, as the drive says."""
        return deg(self.feedback.vel_act_rad_s / self.ratio)

    def scan(
        self, request: DriveRequest, speed_deg_s: float = 0.0, torque_nm: float = 0.0, brake: bool = True
    ) -> DriveFeedback:
        """Send one command and return the feedback of the next SYNC.

        Raises:
            AlarmStop: the leash is at its end, or something is wrong with the connection.
        """
        vel = rad(speed_deg_s) * self.ratio
        self.drive.write(OutputImage(request, vel, torque_nm, brake))
        self._wait()
        self.feedback = self.drive.read()
        if not math.isfinite(self.angle_deg) or abs(self.angle_deg) > self._leash_deg:
            self.drive.write(OutputImage())
            raise AlarmStop(
                f"the gantry moved {self.angle_deg:+.3f} deg, {self._leash_deg:g} deg were allowed · torque off, "
                "brake closed"
            )
        if self.feedback.link:
            raise AlarmStop(f"the connection to the drive is disturbed: {self.feedback.link!r}")
        return self.feedback

    def _wait(self) -> None:
        self._deadline = self._clock.wait_for(self._deadline + 1).deadline

    def run(
        self,
        seconds: float,
        request: DriveRequest = ENABLE,
        speed_deg_s: float = 0.0,
        torque_nm: float = 0.0,
        brake: bool = True,
    ) -> list[DriveFeedback]:
        """Repeat a command for a time."""
        return [
            self.scan(request, speed_deg_s, torque_nm, brake)
            for _ in range(math.ceil(seconds / self.period_s - 1e-9))
        ]

    def enable(self, *, brake: bool = True) -> None:
        """Enable the drive, standing.

        Raises:
            DeviceError: it does not reach Operation enabled.
        """
        for _ in range(round(_ENABLE_S / self.period_s)):
            if self.scan(ENABLE, brake=brake).state is DriveState.OPERATION_ENABLED:
                self.run(0.3, brake=brake)
                return
        raise DeviceError(
            f"the drive is in {self.feedback.state.name.lower().replace('_', ' ')} after {_ENABLE_S:g} s, operation "
            "enabled was wanted"
        )

    def ramp_to(self, speed_deg_s: float, acc_deg_s2: float) -> None:
        """Change speed at a constant acceleration."""
        start = self.speed_deg_s
        n = max(1, math.ceil(abs(speed_deg_s - start) / acc_deg_s2 / self.period_s))
        for k in range(n):
            self.scan(ENABLE, start + (speed_deg_s - start) * (k + 1) / n)

    def disable(self) -> None:
        """Close the brake, where the controller commands it, then take the torque off."""
        self.run(2 * self.period_s, brake=False)
        self.run(0.6, DriveRequest.DISABLE, brake=False)

    def fall_silent(self, *, process_data: bool, heartbeat: bool) -> float:
        """Stop sending until the drive has reacted; how long that took, s, or NaN.

        With process data silent nothing is read either: the reaction shows by its emergency message.
        """
        drive, node = self.drive, self.drive.node
        before, begun = node.emergencies.count, drive.link.now_s()
        drive.silent_process_data, drive.silent_heartbeat = process_data, heartbeat
        reacted = math.nan
        for k in range(round(_SILENT_S / self.period_s)):
            drive.write(OutputImage(ENABLE, 0.0, 0.0, True))
            if not process_data:
                self._wait()
            self.feedback = drive.read()
            seen = node.emergencies.count > before or (
                not process_data and self.feedback.state is not DriveState.OPERATION_ENABLED
            )
            if seen and math.isnan(reacted):
                elapsed = drive.link.now_s() - begun
                reacted = (k + 1) * self.period_s if drive.link.stepped else elapsed
        drive.silent_process_data = drive.silent_heartbeat = False
        return reacted

    def wake(self) -> DriveFeedback:
        """Send again, asking for nothing; the last feedback."""
        self.drive.resume()
        self._clock.start()
        return self.run(0.1, DriveRequest.DISABLE)[-1]


@contextmanager
def open_loop_axis(machine: Machine, store: StateStore, leash_deg: float) -> Iterator[OpenLoopAxis]:
    """Open the drive, and leave it off, braked and with its rest position retained.

    Raises:
        CommandRefused: its parameters forbid enabling.
    """
    opened = open_machine(machine, store)
    drive = opened.drive
    assert isinstance(drive, CanopenDrive)
    axis = OpenLoopAxis(machine, drive, opened.feedback, leash_deg, opened.retained)
    try:
        for reason in bus_reasons(machine, store, drive, commissioning=True):
            raise CommandRefused(reason.text)
        with keeps_time() if machine.paced_by_clock else nullcontext():
            yield axis
    finally:
        drive.close()
        counts = int(drive.read().pos_act_counts) % opened.scale.range_counts
        keep_machine(machine, store, drive, replace(axis.retained, rest_position_counts=counts))
