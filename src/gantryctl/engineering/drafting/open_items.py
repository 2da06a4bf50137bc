"""What a draft leaves open: decisions that the catalogue cannot take, each with figures from the full plant."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.machine import Machine, with_values


class BrakeOverload(NamedTuple):
    """A brake stop from the highest speed that puts more on the reducer than it bears for a moment.

    Attributes:
        torque_nm: largest at the reducer's output. momentary_nm: its rating.
        brake_nm: of the motor's brake. brake_within_nm: brake torque with which the rating is about kept, by the line
            through this brake and half of it; not positive where none keeps it.
    """

    speed_deg_s: float
    torque_nm: float
    momentary_nm: float
    brake_nm: float
    brake_within_nm: float

    @property
    def text(self) -> str:
        """One sentence, with what would help."""
        brake = (
            f"a brake of about {self.brake_within_nm:.3g} N m instead of {self.brake_nm:g} N m, "
            if self.brake_within_nm > 0.0
            else ""
        )
        return (
            f"a brake stop from {self.speed_deg_s:g} deg/s puts {self.torque_nm:.4g} N m on the reducer, which bears "
            f"{self.momentary_nm:.4g} N m for a moment: {brake}a reducer of {self.torque_nm:.4g} N m momentary, or an "
            "inspection after each"
        )


def brake_overload(machine: Machine) -> BrakeOverload | None:
    """Whether the brake of the motor is too strong for the reducer; None where it is not."""
    speed, rating = machine.speed.setting_max_deg_s, machine.reducer.torque_momentary_nm
    brake = machine.brake.torque_nm
    whole = worst_stop(machine, StopClass.BRAKE, speed).torque_reducer_nm
    if whole <= rating:
        return None
    # The rules ask a brake for what it holds; the plant is asked for what half of it does.
    halved = with_values(machine, {"plant.brake.torque_share": 0.5 * machine.plant.brake.torque_share})
    half = worst_stop(halved, StopClass.BRAKE, speed).torque_reducer_nm
    slope = (whole - half) / (0.5 * brake)
    within = brake - (whole - rating) / slope if slope > 0.0 else 0.0
    return BrakeOverload(speed, whole, rating, brake, within)
