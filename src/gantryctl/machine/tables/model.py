"""Machine file as one immutable object."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Self

from pydantic import PrivateAttr, ValidationInfo, model_validator

from gantryctl.machine.calibration import Calibration
from gantryctl.machine.rules.book import violations
from gantryctl.machine.tables.axis import AxisTable, FileIdentity, SpeedTable, VirtualAxisTable
from gantryctl.machine.tables.can import CanTable
from gantryctl.machine.tables.control import AccuracyTable, ControlTable, MonitorsTable
from gantryctl.machine.tables.drive import DriveTable
from gantryctl.machine.tables.fields import Table, table
from gantryctl.machine.tables.motor import BrakeTable, EncoderTable, MotorTable, ReducerTable
from gantryctl.machine.tables.plant import PlantTable
from gantryctl.machine.tables.required import RequiredTable

# Key of the validation context: the caller checks the rules itself, because it makes lines of them.
RULES_LATER: Final = "rules_later"


@dataclass(frozen=True)
class SourceFile:
    """Where a machine was read from; None for one that was made otherwise. All are equal: a place is no value."""

    path: Path | None = field(default=None, compare=False)


class Machine(Table):
    """Complete machine; equal files give equal objects.

    Made by `load_machine`, `parse_machine` and `with_values`, which answer with a line per problem. A machine
    built in any other way obeys the same rules, except by `model_copy(update=...)`, which checks nothing.
    """

    machine: FileIdentity = table("Name of the machine.")
    required: RequiredTable = table("What the axis must do.", RequiredTable)
    axis: AxisTable = table("Travel, limits, ratio.")
    speed: SpeedTable = table("Speed chain.", SpeedTable)
    virtual_axis: VirtualAxisTable = table("Dynamics of the set-point.", VirtualAxisTable)
    control: ControlTable = table("Scan and position loop.", ControlTable)
    motor: MotorTable = table("Name plate of the motor.")
    reducer: ReducerTable = table("Limits of the reducer.", ReducerTable)
    encoder: EncoderTable = table("Motor encoder.")
    brake: BrakeTable = table("Holding brake.", BrakeTable)
    drive: DriveTable = table("Drive and its loops.", DriveTable)
    can: CanTable = table("CANopen bus and drive.", CanTable)
    monitors: MonitorsTable = table("Supervision.", MonitorsTable)
    accuracy: AccuracyTable = table("Chord test and speed test.", AccuracyTable)
    plant: PlantTable = table("Simulated physics.", PlantTable)

    _calibration: Calibration | None = PrivateAttr(default=None)
    _source: SourceFile = PrivateAttr(default=SourceFile())

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self.machine.name

    @property
    def calibration(self) -> Calibration | None:
        """Identified values, from the file that [control.compensation] names; None without such a file."""
        return self._calibration

    @property
    def source(self) -> Path | None:
        """The file that the machine was read from, also when it was varied since; None without one."""
        return self._source.path

    @property
    def counts_per_turn(self) -> int:
        """Counts per motor turn that the controller reads: on a bus, increments of the drive."""
        return self.can.increments_per_turn if self.on_bus else self.encoder.fine_counts_per_turn

    @property
    def speed_counts_per_turn(self) -> float:
        """Counts per motor turn that the speed loop makes its speed of; infinite where it reads the true angle."""
        encoder = self.encoder
        counts = {"interpolated": encoder.fine_counts_per_turn, "counts": encoder.counts_per_turn}
        return counts.get(self.drive.speed_loop.feedback, math.inf)

    @property
    def on_bus(self) -> bool:
        """The drive is a node on a CAN bus, real or virtual."""
        return self.drive.kind == "canopen"

    @property
    def plant_is_local(self) -> bool:
        """The gantry is simulated in this process, and its state is kept in the state directory."""
        return not self.on_bus or self.can.simulated

    @property
    def paced_by_clock(self) -> bool:
        """The scans must keep real time: the drive does not wait for them."""
        return not self.plant_is_local and not self.can.stepped

    def _repr_html_(self) -> str:
        from gantryctl.notebook import facts_html

        axis, speed, virtual = self.axis, self.speed, self.virtual_axis
        turn = f", {axis.kind}" if axis.modulo else ""
        facts = {
            "file": self.source,
            "travel": f"{axis.pos_min_deg:g} .. {axis.pos_max_deg:g} deg{turn}",
            "speed": f"{speed.setting_min_deg_s:g} .. {speed.setting_max_deg_s:g} deg/s",
            "acceleration": f"{virtual.acc_deg_s2:g} deg/s2",
            "ratio": f"{axis.ratio:g}",
            "motor": f"{self.motor.torque_rated_nm:g} N m, at most {self.motor.torque_max_nm:g} N m",
            "scan": f"{self.control.scan_period_ms:g} ms",
            "drive": self.drive.kind,
            "compensation": "calibrated" if self.calibration else "not calibrated",
        }
        return facts_html(f"Machine: {self.name}", facts)

    def calibrated(self, calibration: Calibration | None) -> Machine:
        """Replace the identified values."""
        copy = self.model_copy()
        copy._calibration = calibration
        return copy

    def read_from(self, source: Path | None) -> Machine:
        """Note the file that it was read from."""
        copy = self.model_copy()
        copy._source = SourceFile(source)
        return copy

    @model_validator(mode="after")
    def _consistent(self, info: ValidationInfo) -> Self:
        if not (info.context or {}).get(RULES_LATER):
            broken = violations(self)
            if broken:
                raise ValueError("; ".join(f"{', '.join(rule.paths)}: {rule.sentence}" for rule, _ in broken))
        return self
