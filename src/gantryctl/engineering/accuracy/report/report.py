"""The accuracy report as data: order, measured tables, and the figures that follow from them.

`AccuracyReport` holds the inputs; every figure in it is computed from them on demand, by the same functions
everywhere. `text` prints it, `report_json` and `html` write it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.accuracy.budget import Budget
from gantryctl.engineering.accuracy.gear import gear_study, worth_of_the_fit
from gantryctl.engineering.accuracy.iso230 import IsoFigures, iso230_2
from gantryctl.engineering.accuracy.noise import Distribution
from gantryctl.engineering.accuracy.paper import PAPER_A_DEG, PAPER_TABLE
from gantryctl.engineering.accuracy.procedure.procedures import Procedure
from gantryctl.engineering.accuracy.statistics import TableStatistics, statistics
from gantryctl.engineering.accuracy.table import Direction, ErrorTable
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K, ChordUncertainty
from gantryctl.engineering.accuracy.verdict import AccuracyVerdict, ChordFigures, Conformity, judge_chords
from gantryctl.engineering.analysis.models.profiles import shortest_trapezoid_reaching, trapezoid_peak_speed
from gantryctl.engineering.report.origin import Origin
from gantryctl.machine import Requirement, default_machine
from gantryctl.notebook import facts_html
from gantryctl.units import SIGNED, Dial

FloatArray = NDArray[np.float64]

_NOTHING_REQUIRED = (
    "nothing tells which accuracy is required: name the machine (--config) or the angle (--required)"
)


@dataclass(frozen=True, eq=False)
class SpeedCurves:
    """One move of the speed test, sampled. All arrays have the same length; speeds at the gantry.

    Attributes:
        load_deg_s: None where nothing measures it.
    """

    time_s: FloatArray
    ref_deg_s: FloatArray
    motor_deg_s: FloatArray
    load_deg_s: FloatArray | None

    @property
    def motor_error_deg_s(self) -> FloatArray:
        """Motor-side speed minus reference."""
        return self.motor_deg_s - self.ref_deg_s

    @property
    def load_error_deg_s(self) -> FloatArray | None:
        """Load-side speed minus reference; None where nothing measures it."""
        return None if self.load_deg_s is None else self.load_deg_s - self.ref_deg_s


class LoadSpeedBy(StrEnum):
    """What shows the speed of the load."""

    MODEL = "of the model"
    RING = "by the encoder on the ring"
    NOTHING = "not measured"


@dataclass(frozen=True, eq=False)
class SpeedRun:
    """One move of the speed test and its figures.

    Attributes:
        speed_deg_s: speed asked, positive.
        travel_deg: from, to.
        reached_deg_s: highest reference speed that the motor side held.
        motor_error_deg_s, load_error_deg_s: largest absolute speed error over the whole move, one per side;
            the load side is None where nothing measures it.
        required: permitted error of the motor side, deg/s.
        stick_slip: the load stood still and broke away again while the reference was moving.
        origin: whether both sides are measured, or simulated. load_by: what shows the load side.
        motor_judged: False where the control moves the motor off the set-point on purpose, for the load's sake.
        curves: for the figure; None to leave it out.
        dial: how people read `travel_deg`.
    """

    speed_deg_s: float
    direction: Direction
    travel_deg: tuple[float, float]
    reached_deg_s: float
    motor_error_deg_s: float
    load_error_deg_s: float | None
    required: Requirement
    stick_slip: bool = False
    origin: Origin = Origin.SIMULATED
    load_by: LoadSpeedBy = LoadSpeedBy.MODEL
    motor_judged: bool = True
    curves: SpeedCurves | None = field(default=None, repr=False)
    dial: Dial = SIGNED

    @property
    def ends_read(self) -> tuple[str, str]:
        """From, to, deg, as people read them."""
        start, end = self.travel_deg
        return self.dial.text(start, ".1f"), self.dial.text(end, ".1f")

    @property
    def reached(self) -> bool:
        """True when the speed was reached (to 0.1 %)."""
        return self.reached_deg_s >= 0.999 * self.speed_deg_s

    @property
    def motor_within(self) -> bool | None:
        """The motor-side error is within what is required over the whole move; None where it is not judged."""
        return self.motor_error_deg_s <= self.required.limit if self.motor_judged else None

    @property
    def passed(self) -> bool:
        """Speed reached, and the motor side within what is required where it is judged."""
        return self.reached and self.motor_within is not False


@dataclass(frozen=True)
class GearEnsemble:
    """A over plants that differ only in the phases of their gear errors, drawn at random.

    Attributes:
        a_deg: A of the true angles, one per gear.
        seeds: of the phases, in the same order.
    """

    a_deg: tuple[float, ...]
    seeds: tuple[int, ...]

    @property
    def distribution(self) -> Distribution:
        """Median and 5..95 % (of few gears: little more than the extremes)."""
        return Distribution.of(self.a_deg)


class Beside(NamedTuple):
    """A table beside ours, and its name."""

    name: str
    table: ErrorTable


@cache
def _worth_of_the_paper_fit() -> str:
    return worth_of_the_fit(gear_study(PAPER_TABLE, default_machine()))


@dataclass(frozen=True, eq=False)
class AccuracyReport:
    """Inputs of an accuracy report, and every figure that follows from them. Angles in deg.

    Attributes:
        machine, config_hash, version, seed: what was run; `created` is a date for the page, or empty.
        source: where the readings come from, in words ("simulator", "tracker.csv", a drive's name).
        measures_load: False for motor-side readings: the report then gives no verdict.
        procedure: what was asked; None for a table from a file.
        measured: the table as the instrument saw it (one draw of its noise).
        origin: whether the readings are of a machine or of a model.
        true: the table without instrument noise; known to a simulator only.
        a_measured: A over many draws of the noise; its median is "A as measured".
        a_floor: A of a perfect axis through the same noise.
        radius_m, sigma_m: chord radius and noise of the instrument; None where unknown.
        dwell_s, average_s: time at every stop and the last part of it that is averaged.
        vel_max_deg_s, acc_deg_s2: of the profile, to say how fast the test moves were.
        angle_errors_deg: reading minus target at every stop; finds what chords cannot (a lost turn). None if
            unknown.
        settings: further rows for "what was asked", name -> value in words.
        switches: plant effects of the simulator, name -> in force.
        phases_fitted: the gear phases are the set fitted to the paper's table.
        speed: the runs of the speed test.
        ensemble: A over random gear phases.
        notes: further warnings, one sentence each.
        required: accuracy of the angle that is required; None where nothing tells: the report then gives no verdict.
        of_reference: the machine is the reference machine: the paper's figures stand beside its own.
        simulated: the same test on the model of a measured machine, true angles.
        uncertainty: of the measured table, from the uncertainties of its readings.
        budget: of A, by the sources of error of the instrument; None where nothing tells the instrument.
        dial: how people read the bases, which are angles of the axis.
    """

    machine: str
    config_hash: str
    version: str
    seed: int
    source: str
    measured: ErrorTable
    origin: Origin
    created: str = ""
    measures_load: bool = True
    procedure: Procedure | None = None
    true: ErrorTable | None = None
    a_measured: Distribution | None = None
    a_floor: Distribution | None = None
    radius_m: float | None = None
    sigma_m: float | None = None
    dwell_s: float | None = None
    average_s: float | None = None
    vel_max_deg_s: float | None = None
    acc_deg_s2: float | None = None
    angle_errors_deg: tuple[float, ...] | None = None
    settings: Mapping[str, str] = field(default_factory=dict)
    switches: Mapping[str, bool] = field(default_factory=dict)
    phases_fitted: bool = False
    speed: tuple[SpeedRun, ...] = ()
    ensemble: GearEnsemble | None = None
    notes: tuple[str, ...] = ()
    required: Requirement | None = None
    of_reference: bool = False
    simulated: ErrorTable | None = None
    uncertainty: ChordUncertainty | None = None
    budget: Budget | None = None
    dial: Dial = SIGNED

    @property
    def table(self) -> ErrorTable:
        """The true table where it is known, else the measured one."""
        return self.measured if self.true is None else self.true

    @property
    def beside(self) -> Beside | None:
        """What stands beside the errors: the model of a measured machine, else the paper of the reference machine."""
        if self.simulated is not None:
            return Beside("simulated", self.simulated)
        return Beside("paper", PAPER_TABLE) if self.of_reference else None

    @cached_property
    def statistics(self) -> TableStatistics:
        """Figures of `table` by the test's own formulas."""
        return statistics(self.table)

    @cached_property
    def measured_statistics(self) -> TableStatistics:
        """The same of the measured table."""
        return statistics(self.measured)

    @cached_property
    def iso(self) -> IsoFigures:
        """ISO 230-2 figures of `table`."""
        return iso230_2(self.table, dial=self.dial)

    @cached_property
    def iso_measured(self) -> IsoFigures:
        """ISO 230-2 figures of the measured table: the instrument's noise is part of its repeatability."""
        return iso230_2(self.measured, dial=self.dial)

    @property
    def a_as_measured_deg(self) -> float:
        """A through the instrument: the median over its noise, or of the one table there is."""
        return self.measured_statistics.a_deg if self.a_measured is None else self.a_measured.median_deg

    @property
    def verdict(self) -> AccuracyVerdict:
        """The criterion: the required accuracy, for everything measured at the load."""
        if not self.measures_load:
            text = "the readings are motor side: the gear is outside of what the motor encoder sees"
            return AccuracyVerdict(Conformity.NOT_JUDGED, {}, self.required, text)
        if self.required is None:
            return AccuracyVerdict(Conformity.NOT_JUDGED, {}, None, _NOTHING_REQUIRED)
        ratio = 1.0 if self.procedure is None else self.procedure.whole_ratio
        return judge_chords(self._judged_by, self.required, whole_ratio=ratio)

    @property
    def _judged_by(self) -> ChordFigures:
        known, draws, angles = self.uncertainty, self.a_measured, self.angle_errors_deg
        a_expanded = None if draws is None else draws.high_deg - draws.median_deg
        return ChordFigures(
            a_deg=self.a_as_measured_deg,
            largest_chord_deg=max(self.statistics.largest_deg, self.measured_statistics.largest_deg),
            a_expanded_deg=a_expanded if known is None else COVERAGE_K * known.a_deg,
            largest_chord_expanded_deg=None if known is None else COVERAGE_K * known.largest_chord_deg,
            largest_angle_deg=None if angles is None else max(abs(error) for error in angles),
        )

    def _repr_html_(self) -> str:
        facts = {
            "A": f"{self.statistics.a_deg:.4f} deg",
            "A as measured": f"{self.a_as_measured_deg:.4f} deg",
            "largest chord error": f"{self._judged_by.largest_chord_deg:.4f} deg",
            "verdict": f"{self.verdict.conformity.value}: {self.verdict.text}",
            "speed test": {True: "passed", False: "failed", None: None}[self.speed_passed],
            "readings": f"{self.source} ({self.origin.value})",
        }
        if self.comparison:
            facts["comparison"] = self.comparison
        return facts_html(f"Accuracy: {self.machine}", facts)

    @property
    def speed_passed(self) -> bool | None:
        """All runs of the speed test; None when there was none."""
        return all(run.passed for run in self.speed) if self.speed else None

    @property
    def comparison(self) -> str:
        """Our A beside the paper's, and the worth of the comparison, never a criterion; "" for any other machine."""
        if not self.of_reference:
            return ""
        ours = f"A = {self.statistics.a_deg:.4f} deg beside the paper's {PAPER_A_DEG:.4f} deg"
        if self.table == PAPER_TABLE:
            return f"{ours}: this is the paper's own table"
        if not self.phases_fitted:
            return f"{ours}: another gear, another table; a comparison, not a criterion"
        return (
            f"{ours}: a comparison, not a criterion. The phases of the simulated gear errors (18) are fitted "
            "to the paper's table (24 values), so closeness shows the fit, not the machine. "
            f"{_worth_of_the_paper_fit()}. What gears of this grade give is the spread over random phases"
        )

    @property
    def speed_note(self) -> str:
        """Reason for two tests: the moves of the chord test are too short for full speed."""
        if self.vel_max_deg_s is None or self.acc_deg_s2 is None:
            return ""
        vel, acc = self.vel_max_deg_s, self.acc_deg_s2
        steps = [d for d in self.table.displacements_deg if d > 0.0]
        peaks = [trapezoid_peak_speed(d, vel, acc) for d in (steps[0], steps[-1])]
        return (
            f"At {acc:.4g} deg/s2 a move of {steps[0]:g} deg peaks at {peaks[0]:.2f} deg/s and one of "
            f"{steps[-1]:g} deg at {peaks[1]:.2f} deg/s; {vel:g} deg/s needs at least "
            f"{shortest_trapezoid_reaching(vel, acc):.1f} deg. The chord test says nothing about full speed, "
            "so the speed test is a test of its own."
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Limits of the figures for the reader."""
        found = [*self.notes, *self.statistics.warnings, *self.iso.warnings]
        if self.procedure is not None and self.procedure.whole_ratio > 1.0:
            chords = len(self.table.displacements_deg) - 1
            found.append(
                f"short test: {len(self.table.rows)} series of {chords} chord{'s' if chords > 1 else ''}; judged by "
                f"{self.procedure.whole_ratio:g} times its figures, which the whole test stayed below with 19 of 20 "
                "random gears"
            )
        if not self.measures_load:
            found.insert(0, "motor side: the readings do not contain gear error, wind-up or lost motion")
        # From here on the instrument decides A more than the axis does.
        if self.a_floor is not None and self.a_floor.median_deg > 0.5 * self.a_as_measured_deg:
            found.append(
                f"noise: the instrument alone gives A = {self.a_floor.median_deg:.4f} deg, more than half of "
                f"A as measured ({self.a_as_measured_deg:.4f} deg)"
            )
        slipping = [
            f"{run.speed_deg_s:g} deg/s {run.direction.value}" for run in self.speed if run.stick_slip
        ]
        if slipping:
            found.append(f"stick-slip at {', '.join(slipping)}")
        return tuple(found)
