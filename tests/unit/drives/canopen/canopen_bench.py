"""A CANopen drive in this process, and hands on its virtual other end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.image import DriveFeedback, DriveRequest, DriveState, OutputImage
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.wiring.canopen import canopen_settings
from gantryctl.wiring.virtual import virtual_node

ENABLE = DriveRequest.ENABLE
SYNC_S = 0.004


@cache
def machine(*changes: tuple[str, object]) -> Machine:
    """The reference gantry behind a CAN drive."""
    return with_values(
        default_machine(), {"drive.kind": "canopen", "control.scan_period_ms": 1e3 * SYNC_S} | dict(changes)
    )


class Bench:
    """One drive, not opened yet."""

    def __init__(
        self, *quirks: str, angle_deg: float = 0.0, changes: Sequence[tuple[str, object]] = ()
    ) -> None:
        self.machine = machine(*changes)
        self.link, self.virtual = virtual_node(self.machine, angle_deg, quirks=quirks)
        self.drive = CanopenDrive(self.link, canopen_settings(self.machine), self.virtual)
        self.ratio = self.machine.axis.ratio
        self._ask = Requests(self.virtual).answer

    def ask(self, cmd: str, **fields: object) -> dict[str, object]:
        answer = self._ask({"cmd": cmd, **fields})
        assert answer["ok"], answer
        return answer

    def inject(self, fault: str, value: object = True, **fields: object) -> None:
        self.ask("inject", fault=fault, value=value, **fields)

    def event(self, event: str, **fields: object) -> None:
        self.ask("event", event=event, **fields)

    def open(self) -> Bench:
        self.drive.open()
        return self

    def scan(
        self, request: DriveRequest = ENABLE, speed_deg_s: float = 0.0, brake_open: bool = True
    ) -> DriveFeedback:
        vel = math.radians(speed_deg_s) * self.ratio
        self.drive.write(OutputImage(request, vel, 0.0, brake_open))
        return self.drive.read()

    def run(self, seconds: float, request: DriveRequest = ENABLE, speed_deg_s: float = 0.0) -> DriveFeedback:
        feedback = self.drive.read()
        for _ in range(math.ceil(seconds / SYNC_S)):
            feedback = self.scan(request, speed_deg_s)
        return feedback

    def enable(self) -> Bench:
        feedback = self.run(0.4)
        assert feedback.state is DriveState.OPERATION_ENABLED, feedback
        return self

    def ramp_to(self, speed_deg_s: float, acc_deg_s2: float = 2.0) -> DriveFeedback:
        n = math.ceil(abs(speed_deg_s) / acc_deg_s2 / SYNC_S)
        for k in range(n):
            self.scan(ENABLE, speed_deg_s * (k + 1) / n)
        return self.run(0.5, ENABLE, speed_deg_s)

    @property
    def load_deg(self) -> float:
        return math.degrees(self.virtual.truth()[0])
