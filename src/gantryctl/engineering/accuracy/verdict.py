"""The criterion of an accuracy test, held against figures with their uncertainty."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from gantryctl.machine import Requirement

A_MEASURED: Final = "A as measured"
LARGEST_CHORD: Final = "largest chord error"
LARGEST_ANGLE: Final = "largest angle error at a stop"
# Ends the name of a figure that a short procedure was scaled to.
OF_THE_WHOLE: Final = " of the whole test, at most"


class Conformity(Enum):
    """What a figure with its uncertainty says of a limit (ISO 14253-1: both sides must prove their case)."""

    PASS = "pass"  # noqa: S105 - a verdict
    FAIL = "fail"
    # The limit lies within the uncertainty: neither is proven.
    UNDECIDED = "within uncertainty"
    # Nothing was measured at the load, or nothing tells what is required.
    NOT_JUDGED = "no verdict"

    @property
    def passed(self) -> bool | None:
        """None = neither."""
        return {Conformity.PASS: True, Conformity.FAIL: False}.get(self)


_WORST_FIRST: Final = (Conformity.FAIL, Conformity.UNDECIDED, Conformity.PASS)


@dataclass(frozen=True)
class AccuracyVerdict:
    """Conformity with the requirement.

    Attributes:
        figures_deg: what was compared with the limit, by name.
        required: the limit, with who asks for it; None where nothing tells.
        text: one sentence.
        uncertainties_deg: expanded uncertainty (k = 2) of these figures, where it is known.
    """

    conformity: Conformity
    figures_deg: Mapping[str, float]
    required: Requirement | None
    text: str
    uncertainties_deg: Mapping[str, float] = field(default_factory=dict)

    @property
    def passed(self) -> bool | None:
        """None = no verdict."""
        return self.conformity.passed


@dataclass(frozen=True)
class ChordFigures:
    """What a chord test is judged by, deg.

    Attributes:
        a_deg: A through the instrument: the median over draws of its noise, or of the one table there is.
        a_expanded_deg: 95 % of the draws lie below `a_deg` and this, or the expanded uncertainty (k = 2) of A; None
            where nothing is known of the instrument.
        largest_chord_deg, largest_chord_expanded_deg: largest chord error, and its expanded uncertainty where known.
        largest_angle_deg: largest error of an angle at a stop; None where the instrument has a zero of its own.
    """

    a_deg: float
    largest_chord_deg: float
    a_expanded_deg: float | None = None
    largest_chord_expanded_deg: float | None = None
    largest_angle_deg: float | None = None


def judge_chords(
    found: ChordFigures, required: Requirement, *, whole_ratio: float = 1.0, of: str = ""
) -> AccuracyVerdict:
    """Hold a chord test against what is required: PASS when 95 % of what its instrument could have shown keeps it.

    Args:
        whole_ratio: what the whole procedure may show more than a short one.
        of: whose test it is, where a sentence speaks of several.
    """
    # What a short procedure leaves out could be worse than what it visits.
    end = "" if whole_ratio == 1.0 else OF_THE_WHOLE
    a_name, chord_name, angle_name = (
        f"{of}: {name}" if of else name for name in (A_MEASURED + end, LARGEST_CHORD + end, LARGEST_ANGLE)
    )
    # A is a spread, the requirement is on the angle itself: the largest errors are compared as well.
    figures = {a_name: whole_ratio * found.a_deg, chord_name: whole_ratio * found.largest_chord_deg}
    # A turn lost with the power off shifts all stops alike and changes no chord; only this figure shows it.
    if found.largest_angle_deg is not None:
        figures[angle_name] = found.largest_angle_deg
    expanded = {
        name: whole_ratio * value
        for name, value in (
            (a_name, found.a_expanded_deg),
            (chord_name, found.largest_chord_expanded_deg),
        )
        if value is not None
    }
    return judge(figures, required, expanded)


def judge(
    figures_deg: Mapping[str, float], required: Requirement, uncertainties_deg: Mapping[str, float]
) -> AccuracyVerdict:
    """Hold figures against a limit; the worst of them decides.

    Args:
        uncertainties_deg: expanded, by the name of the figure; a figure without one counts as certain.
    """
    limit_deg = required.limit
    each = {
        name: conformity_of(value, uncertainties_deg.get(name, 0.0), limit_deg)
        for name, value in figures_deg.items()
    }
    worst = next(c for c in (Conformity.FAIL, Conformity.UNDECIDED, Conformity.PASS) if c in each.values())
    told = ", ".join(
        f"{name} {figures_deg[name]:.4f} {plus_minus(uncertainties_deg.get(name))}deg"
        for name, conformity in each.items()
        if conformity is worst
    )
    end = {
        Conformity.PASS: f"within {limit_deg:g} deg",
        Conformity.FAIL: f"outside {limit_deg:g} deg",
        Conformity.UNDECIDED: f"{limit_deg:g} deg lies within the uncertainty, so this is neither passed nor failed",
    }[worst]
    text = f"{told}: {end}; required by {required.origin}"
    return AccuracyVerdict(worst, figures_deg, required, text, uncertainties_deg)


def worst_verdict(verdicts: Iterable[AccuracyVerdict]) -> AccuracyVerdict:
    """The worst of several: one that fails, else one that is not decided; of alike ones, by its largest figure."""

    def badness(verdict: AccuracyVerdict) -> tuple[int, float]:
        expanded = verdict.uncertainties_deg
        largest = max(value + expanded.get(name, 0.0) for name, value in verdict.figures_deg.items())
        return -_WORST_FIRST.index(verdict.conformity), largest

    return max(verdicts, key=badness)


def conformity_of(value: float, expanded: float, limit: float) -> Conformity:
    """What one figure says of the limit; `expanded`: its uncertainty (k = 2)."""
    if value + expanded <= limit:
        return Conformity.PASS
    return Conformity.UNDECIDED if value - expanded <= limit else Conformity.FAIL


def plus_minus(expanded: float | None) -> str:
    """An expanded uncertainty behind its figure; "" where none is known."""
    return "" if expanded is None else f"+- {expanded:.4f} "
