"""One plant is identified, others are run with its calibration: how accurate control stays when the machine changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

import numpy as np

from gantryctl.engineering.accuracy.verdict import AccuracyVerdict, judge_chords, worst_verdict
from gantryctl.engineering.batch import expected
from gantryctl.engineering.comparison.drift_file import Drift, DriftRow
from gantryctl.engineering.comparison.key_figures import (
    SHORT_DEG,
    KeyFigures,
    figures_of,
    key_columns,
    measure_key_figures,
)
from gantryctl.engineering.comparison.variants import (
    Variant,
    backlash_followed,
    check_same_plant,
    ending_gently,
    may_follow_backlash,
    may_follow_moment,
    moment_followed,
    without_load_encoder,
)
from gantryctl.engineering.identification import calibrate_each
from gantryctl.engineering.scheduler.job import Rows
from gantryctl.engineering.scheduler.schedule import all_rows
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, Requirement, required_angle
from gantryctl.machine.places import fitted_stretch_deg
from gantryctl.units import SIGNED, Dial
from gantryctl.wiring.compensation import check_calibration

UNCHANGED: Final = "as identified"
WITHOUT_ENCODER: Final = "without the load encoder"
NOTHING_FOLLOWED: Final = "nothing followed"
FOLLOWED: Final = "moment followed"
BOTH_FOLLOWED: Final = "moment and backlash followed"
GENTLE: Final = "gentle end"
NOT_GENTLE: Final = "without a gentle end"
_HIGH: Final = 0.95
_OWN: Final = "own"


class Spread(NamedTuple):
    """A figure over the rows that change something.

    Attributes:
        unchanged: on the plant as it was identified. high: 95 % of the rows, between rows on a straight line.
        worst_in: name of the row with the largest.
    """

    unchanged: float
    median: float
    high: float
    worst: float
    worst_in: str


@dataclass(frozen=True)
class DriftReport:
    """Ways of control on a plant as it was identified, and on the same plant changed.

    Attributes:
        first, second: names of the machines. drift: the file.
        calibration: where the calibration of the second comes from.
        required: accuracy of the angle that judges both. short_deg: ends of the move.
        rows: name and meaning; the first is the plant as identified.
        figures: by name of the control, one `KeyFigures` per row.
    """

    first: str
    second: str
    drift: Drift
    calibration: str
    required: Requirement
    short_deg: tuple[float, float]
    rows: tuple[tuple[str, str], ...]
    figures: dict[str, tuple[KeyFigures, ...]]
    dial: Dial = SIGNED

    def spread(self, control: str, figure: Callable[[KeyFigures], float]) -> Spread:
        """One figure of a control over the rows."""
        unchanged, *changed = (figure(row) for row in self.figures[control])
        worst = int(np.argmax(changed))
        return Spread(
            unchanged,
            float(np.median(changed)),
            float(np.quantile(changed, _HIGH)),
            changed[worst],
            self.rows[1 + worst][0],
        )

    @property
    def verdict(self) -> AccuracyVerdict:
        """The second machine in its worst row as its instrument sees it, beside the requirement."""
        # By each figure that is judged: a row of small A may have the largest chord error, or stand beside its angle.
        return worst_verdict(
            judge_chords(row.judged_by, self.required, of=f"{self.second}, {name}")
            for row, (name, _) in zip(self.figures[self.second], self.rows, strict=True)
        )


def a_true(row: KeyFigures) -> float:
    """The larger A of procedures A and B, deg."""
    return max(row.a_true_a, row.a_true_b)


@dataclass(frozen=True)
class DriftJob:
    """Key figures of every control on every plant, control by control."""

    controls: tuple[Variant, ...]
    rows_of_drift: tuple[DriftRow, ...]
    seed: int

    # The packs of the widest instruction set, twice: plants under one control share them.
    pack: ClassVar[int] = 16

    def rows(self, first: int, count: int) -> Rows:
        """Columns of `key_columns`."""
        plants = (None, *self.rows_of_drift)
        machines = []
        for number in range(first, first + count):
            control, row = divmod(number, len(plants))
            machine, change = self.controls[control].machine, plants[row]
            machines.append(machine if change is None else change.on(machine))
        return key_columns({_OWN: measure_key_figures(machines, [self.seed] * count, warm_up=True)})


def drift_report(
    paper: Machine,
    improved: Machine,
    drift: Drift,
    *,
    identify: bool = False,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> DriftReport:
    """Run every control on the plant as identified and on every row of the drift.

    Args:
        identify: the second machine is identified first; else its calibration file holds.
        seed: of the tracker's noise.
        threads: default all processors; no effect on the result.
        progress: called with the number of runs that are done, of `runs_of`.

    Raises:
        UsageError: the two are different machines.
        ConfigError: a compensation needs a calibration that is missing or of another machine.
    """
    check_same_plant(paper, improved)
    calibrated = improved.control.compensation.needs_calibration
    source = "no identified values"
    if calibrated and identify:
        improved = improved.calibrated(expected(calibrate_each([improved], [seed]))[0])
        source = f"identified anew on the plant as it is, noise of seed {seed}"
    elif calibrated:
        origin = check_calibration(improved, improved.plant.encoder.serial).origin
        source = f"the calibration of {origin.machine}, version {origin.version}, of {origin.date}"
    controls = controls_of(paper, improved)
    job = DriftJob(controls, drift.rows, seed)
    plants = 1 + len(drift.rows)
    found = figures_of(all_rows(job, len(controls) * plants, threads, progress))[_OWN]
    return DriftReport(
        first=paper.name,
        second=controls[-1].name,
        drift=drift,
        calibration=source,
        required=required_angle(improved),
        short_deg=fitted_stretch_deg(improved, *SHORT_DEG),
        rows=((UNCHANGED, "nothing changes"), *((row.name, row.meaning) for row in drift.rows)),
        figures={control.name: found[k * plants : (k + 1) * plants] for k, control in enumerate(controls)},
        dial=improved.axis.dial,
    )


def controls_of(paper: Machine, improved: Machine) -> tuple[Variant, ...]:
    """The ways of control that are compared; the second machine as it is comes last."""
    if paper.name == improved.name:
        raise UsageError(
            f"{paper.name} twice: a drift compares two ways of control, so name two machine files"
        )
    bare: tuple[Variant, ...] = ()
    if improved.control.compensation.load_encoder.active:
        bare = _ways(without_load_encoder(improved), WITHOUT_ENCODER)
    others = (way for way in _ways(improved, improved.name) if way.machine != improved)
    return Variant(paper.name, paper), *bare, *others, Variant(improved.name, improved)


def _ways(machine: Machine, name: str) -> tuple[Variant, ...]:
    """What a machine may follow within a person's limits; by its motor alone also with the other end of moves."""
    if not may_follow_moment(machine):
        return (Variant(name, machine),)
    nothing = Variant(f"{name}, {NOTHING_FOLLOWED}", moment_followed(machine, followed=False))
    moment = Variant(f"{name}, {FOLLOWED}", moment_followed(machine))
    if not may_follow_backlash(machine):
        return nothing, moment
    both = Variant(f"{name}, {BOTH_FOLLOWED}", backlash_followed(moment.machine))
    if machine.control.compensation.load_encoder.active:
        return nothing, moment, both
    gentle = machine.virtual_axis.gentle_end
    other = ending_gently(both.machine, gently=not gentle)
    return nothing, moment, both, Variant(f"{both.name}, {NOT_GENTLE if gentle else GENTLE}", other)


def runs_of(paper: Machine, improved: Machine, drift: Drift) -> int:
    """How many plants are run."""
    return len(controls_of(paper, improved)) * (1 + len(drift.rows))
