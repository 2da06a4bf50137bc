"""The whole machine file as one immutable object."""

from __future__ import annotations

from gantryctl.machine.axis import Axis, Identity, Speed, VirtualAxis
from gantryctl.machine.control import Accuracy, Control, Monitors
from gantryctl.machine.drive import Drive
from gantryctl.machine.fields import Table, table
from gantryctl.machine.motor import Brake, Encoder, Motor, Reducer
from gantryctl.machine.plant import Plant


class Machine(Table):
    """A complete machine. Made by `load_machine` or `parse_machine`; equal files give equal objects."""

    machine: Identity = table("Name of the machine.")
    axis: Axis = table("Travel, limits, ratio.")
    speed: Speed = table("Speed chain.", Speed)
    virtual_axis: VirtualAxis = table("Dynamics of the set-point.", VirtualAxis)
    control: Control = table("Scan and position loop.", Control)
    motor: Motor = table("Name plate of the motor.")
    reducer: Reducer = table("Limits of the reducer.", Reducer)
    encoder: Encoder = table("Motor encoder.")
    brake: Brake = table("Holding brake.", Brake)
    drive: Drive = table("Drive and its loops.", Drive)
    monitors: Monitors = table("Supervision.", Monitors)
    accuracy: Accuracy = table("Chord test.", Accuracy)
    plant: Plant = table("Simulated physics.", Plant)

    @property
    def name(self) -> str:
        """Name of the machine."""
        return self.machine.name
