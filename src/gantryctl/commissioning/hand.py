"""A drive driven by hand, scan by scan, with no position loop: within a leash, and never without rest at the end."""

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


class Hand:
    """One drive and the leash its gantry is on.

    Args:
        drive: open.
        leash_deg: further than this from where it stood the axis is switched off.

    Attributes:
        retained: the controller's memory; kept at the end, with what a step has put into it.
    """

    def __init__(self, machine: Machine, drive: CanopenDrive, leash_deg: float, retained: Retained) -> None:
        self.retained = retained
        self.drive, self.period_s = drive, drive.settings.period_s
        self.ratio = machine.axis.ratio
        self._leash_deg = leash_deg
        self._deg_per_count = 360.0 / (drive.identity().counts_per_turn * self.ratio)
        self._clock = RealClock(self.period_s) if machine.paced_by_clock else VirtualClock()
        self._deadline = 0
        self.feedback = drive.read()
        self.start_counts = self.feedback.pos_act_counts

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
        """One command, and what shows at the next SYNC.

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
        """The same command for a time."""
        return [
            self.scan(request, speed_deg_s, torque_nm, brake)
            for _ in range(math.ceil(seconds / self.period_s - 1e-9))
        ]

    def enable(self, *, brake: bool = True) -> None:
        """Up to Operation enabled, standing.

        Raises:
            DeviceError: it does not get there.
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
        """Speed up gently."""
        start = self.speed_deg_s
        n = max(1, math.ceil(abs(speed_deg_s - start) / acc_deg_s2 / self.period_s))
        for k in range(n):
            self.scan(ENABLE, start + (speed_deg_s - start) * (k + 1) / n)

    def disable(self) -> None:
        """The brake first where that can be told, then the torque."""
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
        """Speak again, asking for nothing; what the drive shows."""
        self.drive.resume()
        self._clock.start()
        return self.run(0.1, DriveRequest.DISABLE)[-1]


@contextmanager
def by_hand(machine: Machine, store: StateStore, leash_deg: float) -> Iterator[Hand]:
    """Open the drive, and leave it off, braked and with its rest position kept.

    Raises:
        CommandRefused: its parameters forbid enabling.
    """
    opened = open_machine(machine, store)
    drive = opened.drive
    assert isinstance(drive, CanopenDrive)
    retained = opened.retained
    hand: Hand | None = None
    try:
        for reason in bus_reasons(machine, store, drive, commissioning=True):
            raise CommandRefused(reason.text)
        hand = Hand(machine, drive, leash_deg, retained)
        with keeps_time() if machine.paced_by_clock else nullcontext():
            yield hand
    finally:
        drive.close()
        identity = drive.identity()
        counts = int(drive.read().pos_act_counts) % (identity.counts_per_turn * identity.turns)
        keep_machine(
            machine,
            store,
            drive,
            replace(hand.retained if hand is not None else retained, rest_position_counts=counts),
        )
