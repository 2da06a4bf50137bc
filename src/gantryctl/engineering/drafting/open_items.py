"""What the full plant says of a draft: what gears of its grade give, and decisions that the catalogue cannot take."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from gantryctl import _core
from gantryctl.engineering.accuracy.noise import Distribution
from gantryctl.engineering.accuracy.procedure.on_batch import random_gear, run_procedure
from gantryctl.engineering.accuracy.procedure.plan import chord_test
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, errors_from_points, target_points
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import FloatArray
from gantryctl.engineering.drafting.basis import Basis
from gantryctl.engineering.drafting.draft import Draft
from gantryctl.engineering.drafting.gear_errors import graded_values
from gantryctl.engineering.stops import StopClass, worst_stop
from gantryctl.machine import Machine, with_values
from gantryctl.wiring.simulator import plant_params

GEARS: Final = 32
"""Gears that a draft is tried with: `gantryctl accuracy run --ensemble 32` draws the same."""
# The finest grade that a sheet can ask for.
_FINEST: Final = 1


class GradeFigure(NamedTuple):
    """What gears of a grade give.

    Attributes:
        grade: of the teeth, ISO 1328-1. a_kept_deg: A of the true angles that 95 % of the gears keep.
    """

    grade: float
    a_kept_deg: float


class GearsOfGrade(NamedTuple):
    """What gears of a draft's grade give on the full plant, beside what is required.

    Attributes:
        gears: how many were drawn. required_deg: accuracy of the angle.
        drafted: of the grade of the draft.
        enough: of the coarsest grade that keeps what is required, not coarser than the draft's; None where none does.
        without_teeth_deg: what teeth without an error leave of A: reducer, wind-up, lost motion; None where the draft
            keeps what is required.
    """

    gears: int
    required_deg: float
    drafted: GradeFigure
    enough: GradeFigure | None
    without_teeth_deg: float | None

    @property
    def kept(self) -> bool:
        """The draft keeps what is required."""
        return self.enough == self.drafted

    @property
    def text(self) -> str:
        """One sentence, with what would help."""
        found = (
            f"95 % of {self.gears} gears of grade {self.drafted.grade:g} keep A = {self.drafted.a_kept_deg:.2g} deg; "
            f"{self.required_deg:g} deg is required"
        )
        if self.kept:
            return found
        if self.enough is not None:
            return f"{found}: grade {self.enough.grade:g} would do, with {self.enough.a_kept_deg:.2g} deg"
        return (
            f"{found}: no grade of the teeth does it, perfect ones leave {self.without_teeth_deg:.2g} deg of reducer "
            "and wind-up; map the gear (gantryctl identify), or measure at the load"
        )


def gears_of_grade(made: Draft, gears: int = GEARS) -> GearsOfGrade:
    """Try a draft with other gears of its grade, and with finer ones until what is required is kept.

    Args:
        gears: to draw.
    """
    machine, basis = made.machine(), Basis(made.fit)
    procedure, required_deg = chord_test(machine), machine.required.angle_deg
    drawn = _drawn(machine, gears)
    angles_rad = run_procedure(drawn, procedure).load_rad
    drafted = GradeFigure(basis.sheet.teeth.grade, _kept_deg(procedure, angles_rad))
    if drafted.a_kept_deg <= required_deg:
        return GearsOfGrade(gears, required_deg, drafted, drafted, None)
    # At rest the error of the gears stands in the angle as it is: other teeth are foreseen without another run.
    rest_rad = angles_rad - _gear_errors_rad(drawn, procedure)
    perfect = _drawn(with_values(machine, _without_teeth(machine)), gears)
    without_teeth_deg = _kept_deg(procedure, rest_rad + _gear_errors_rad(perfect, procedure))
    enough = None
    if without_teeth_deg <= required_deg:
        enough = _coarsest(machine, basis, procedure, rest_rad)
    return GearsOfGrade(gears, required_deg, drafted, enough, without_teeth_deg)


def _coarsest(
    machine: Machine, basis: Basis, procedure: Procedure, rest_rad: FloatArray
) -> GradeFigure | None:
    """The coarsest grade, finer than the draft's, that keeps what is required."""
    for finer in range(math.ceil(basis.sheet.teeth.grade) - 1, _FINEST - 1, -1):
        values: dict[str, object] = {
            path: list(each.value) if isinstance(each.value, tuple) else each.value
            for path, each in graded_values(basis, float(finer)).items()
        }
        drawn = _drawn(with_values(machine, values), len(rest_rad))
        foreseen_deg = _kept_deg(procedure, rest_rad + _gear_errors_rad(drawn, procedure))
        if foreseen_deg > machine.required.angle_deg:
            continue
        # Foreseen is not shown.
        shown_deg = _kept_deg(procedure, run_procedure(drawn, procedure).load_rad)
        if shown_deg <= machine.required.angle_deg:
            return GradeFigure(float(finer), shown_deg)
    return None


def _drawn(machine: Machine, gears: int) -> list[Machine]:
    """The machine with other gears, as `accuracy run --ensemble` draws them."""
    return [random_gear(machine, seed) for seed in range(1, 1 + gears)]


def _gear_errors_rad(machines: Sequence[Machine], procedure: Procedure) -> FloatArray:
    """Error of each gear at the stops, shape (machines, stops)."""
    plants = [plant_params(machine) for machine in machines]
    return np.array(
        [
            [
                _core.ring_error(p, at)[0] + _core.motor_error(p, p.ratio * at)[0]
                for at in procedure.targets_rad
            ]
            for p in plants
        ]
    )


def _kept_deg(procedure: Procedure, angles_rad: FloatArray) -> float:
    """A that 95 % of the rows of true angles keep; the radius of the circle cancels."""
    a_deg = accuracy_a(errors_from_points(procedure, target_points(angles_rad, 1.0), 1.0))
    return Distribution.of(a_deg).high_deg


def _without_teeth(machine: Machine) -> dict[str, object]:
    waves = len(machine.plant.gear_error.ring_um)
    at = "plant.gear_error"
    return {f"{at}.ring_um": [0.0] * waves, f"{at}.pinion_1x_um": 0.0, f"{at}.mesh_um": 0.0}


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
