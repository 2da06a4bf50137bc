"""The comparison of two machines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

from gantryctl.engineering.accuracy.verdict import AccuracyVerdict, judge_chords
from gantryctl.engineering.comparison.ensemble import PlantEnsemble, ensemble
from gantryctl.engineering.comparison.key_figures import (
    LONG_DEG,
    SHORT_DEG,
    KeyFigures,
    figures_of,
    key_columns,
    measure_key_figures,
)
from gantryctl.engineering.comparison.profiles import ProfileRow, profiles_at_equal_base_motion
from gantryctl.engineering.comparison.variants import Variant, check_same_plant, variants
from gantryctl.engineering.identification import Comparison, comparisons
from gantryctl.engineering.scheduler.job import Rows
from gantryctl.engineering.scheduler.schedule import all_rows
from gantryctl.machine import Machine, Requirement, required_angle
from gantryctl.machine.places import fitted_stretch_deg
from gantryctl.units import SIGNED, Dial
from gantryctl.wiring.compensation import check_calibration


@dataclass(frozen=True)
class CompareReport:
    """The comparison of two machines.

    Attributes:
        first, second: their names.
        required: accuracy of the angle that judges both.
        short_deg, long_deg: ends of the two moves.
        rows: name and figures of every variant.
        identified: what the compensations know, beside the truth of the plant; empty if they know nothing.
        profiles: what each profile takes for the short move at the base motion of the first machine.
        ensemble: None unless asked for.
        dial: how people read the ends of the moves.
    """

    first: str
    second: str
    required: Requirement
    short_deg: tuple[float, float]
    long_deg: tuple[float, float]
    rows: tuple[tuple[str, KeyFigures], ...]
    identified: tuple[Comparison, ...]
    profiles: tuple[ProfileRow, ...]
    ensemble: PlantEnsemble | None
    dial: Dial = SIGNED

    @property
    def verdict(self) -> AccuracyVerdict:
        """The second machine as its instrument sees it, beside the requirement."""
        return judge_chords(self.rows[-1][1].judged_by, self.required, of=self.second)


_OWN: Final = "own"


@dataclass(frozen=True)
class VariantsJob:
    """Key figures of the variants of one machine; row k is variant k."""

    variants: tuple[Variant, ...]
    seed: int

    pack: ClassVar[int] = 8

    def rows(self, first: int, count: int) -> Rows:
        """Columns of `key_columns`."""
        chosen = [each.machine for each in self.variants[first : first + count]]
        return key_columns({_OWN: measure_key_figures(chosen, [self.seed] * len(chosen))})


def compare_report(
    paper: Machine,
    improved: Machine,
    *,
    plants: int = 0,
    seed: int = 0,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> CompareReport:
    """Run the comparison.

    Args:
        plants: size of the ensemble; 0 for none.
        seed: of the tracker's noise and of the random plants.
        threads: default all processors; no effect on the result.
        progress: called with the number of rows that are done: of the variants, then of the ensemble.

    Raises:
        UsageError: the two are different machines.
        ConfigError: a compensation needs a calibration that is missing or of another machine.
    """
    check_same_plant(paper, improved)
    calibrated = improved.control.compensation.needs_calibration
    calibration = check_calibration(improved, improved.plant.encoder.serial) if calibrated else None
    shown = variants(paper, improved)
    found = figures_of(all_rows(VariantsJob(tuple(shown), seed), len(shown), threads, progress))[_OWN]
    rows = tuple((variant.name, figures) for variant, figures in zip(shown, found, strict=True))
    return CompareReport(
        first=paper.name,
        second=improved.name,
        required=required_angle(improved),
        short_deg=fitted_stretch_deg(improved, *SHORT_DEG),
        long_deg=fitted_stretch_deg(improved, *LONG_DEG),
        rows=rows,
        identified=tuple(comparisons(improved, calibration)) if calibration else (),
        profiles=tuple(profiles_at_equal_base_motion(paper, improved, rows[0][1].base_um)),
        ensemble=(
            ensemble(
                paper,
                improved,
                plants,
                seed=seed,
                threads=threads,
                progress=None if progress is None else lambda done: progress(len(shown) + done),
            )
            if plants
            else None
        ),
        dial=improved.axis.dial,
    )
