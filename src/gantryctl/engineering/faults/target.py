"""What a fault acts on: the drive and its true plant, the scan engine, its clock and its operator."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from gantryctl.drives.faults import Faults
from gantryctl.drives.simulated import SimDrive
from gantryctl.drives.virtual.axis.plant import DrivePlant
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.nodes.encoder_node import EncoderNode
from gantryctl.drives.virtual.nodes.group import Neighbours
from gantryctl.drives.virtual.nodes.io_node import IoNode
from gantryctl.errors import UsageError
from gantryctl.image import DriveState
from gantryctl.machine import Machine
from gantryctl.ports import ScanStart
from gantryctl.runtime import Engine, FixedOperator


class StallingClock:
    """Virtual time in which the controller can be held up: the axis goes on by itself meanwhile.

    Args:
        period_s: scan period, s.
    """

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self.stall_s = 0.0
        """Time by which the next scan is late."""
        self.goes_on: Callable[[int], None] = lambda periods: None
        """Lets the axis go on for some periods."""

    def start(self) -> None:
        """Do nothing."""

    def wait_for(self, deadline: int) -> ScanStart:
        """Return at once, late where a stall is asked for."""
        if self.stall_s == 0.0:
            return ScanStart(deadline, 0.0)
        late_s, self.stall_s = self.stall_s, 0.0
        missed = math.ceil(late_s / self._period_s)
        self.goes_on(missed)
        return ScanStart(deadline + missed, late_s)

    def elapsed_s(self) -> float:
        """Return 0: no time passes inside a scan."""
        return 0.0


@dataclass(slots=True, eq=False)
class Target:
    """One running axis with every place where a fault can act.

    Attributes:
        device: the simulated drive in process, or the virtual one behind a bus.
        neighbours: virtual nodes beside it.
        repeated: actions of every scan, by name.
        silent: the controller makes no scan any more.
    """

    machine: Machine
    device: SimDrive | DriveNode
    engine: Engine
    operator: FixedOperator
    clock: StallingClock
    neighbours: Neighbours
    repeated: dict[str, Callable[[], None]] = field(default_factory=dict)
    silent: bool = False

    @property
    def faults(self) -> Faults:
        """Standing faults of the drive."""
        return self.device.faults

    @property
    def plant(self) -> SimDrive | DrivePlant:
        """By what the oracle knows the axis: a drive alone has no controller yet."""
        return self.device.plant if isinstance(self.device, DriveNode) else self.device

    @property
    def node(self) -> DriveNode:
        """The virtual drive.

        Raises:
            UsageError: the drive is the simulated one in process.
        """
        if not isinstance(self.device, DriveNode):
            raise UsageError("this fault needs a drive on a bus: --bus")
        return self.device

    def beside(self, which: str) -> IoNode | EncoderNode:
        """A virtual node beside the drive.

        Args:
            which: "io" or "encoder".

        Raises:
            UsageError: the machine has none.
        """
        node = self.neighbours.io if which == "io" else self.neighbours.encoder
        if node is None:
            key = "[can.io] node" if which == "io" else '[can.load_encoder] source = "node"'
            raise UsageError(f"this fault needs a node beside the drive: {key} of the machine file")
        return node

    def plant_value(self, name: str) -> float:
        """Present value of a plant parameter.

        Raises:
            UsageError: no such parameter.
        """
        value: Any = getattr(self.plant.plant_params, name, None)
        if name.startswith("_") or not isinstance(value, bool | int | float):
            raise UsageError(f"the plant has no parameter '{name}' that is a number")
        return float(value)

    def change_plant(self, name: str, value: float) -> None:
        """Change a plant parameter.

        Raises:
            UsageError: no such parameter.
        """
        self.plant.change_plant(name, value)

    def jump_encoder(self, angle_deg: float) -> None:
        """Shift what reading and loops of the drive see, deg at the gantry."""
        self.plant.sim.jump_encoder(math.radians(angle_deg) * self.machine.axis.ratio)

    def lose_turns(self, turns: int) -> None:
        """Shift the multiturn part of the encoder."""
        self.plant.lose_turns(turns)

    def trip(self, code: int) -> None:
        """Raise a fault inside the drive: torque off."""
        device = self.device
        if isinstance(device, DriveNode):
            device.axis.fault(code, ramp=False)
        else:
            device.trip(code)

    def leave_enabled(self) -> None:
        """Let the drive go to Switch on disabled by itself."""
        device = self.device
        if isinstance(device, DriveNode):
            device.axis.leave_by_itself()
        else:
            device.state = DriveState.SWITCH_ON_DISABLED

    def go_on(self, periods: int) -> None:
        """Let the axis go on by itself: the controller makes no scan meanwhile."""
        device = self.device
        if isinstance(device, DriveNode):
            device.advance(periods * device.sync_period_us)
            return
        # A drive in process goes on with the last command, as one without supervision of its master does.
        for _ in range(periods):
            device.write(self.engine.output)
