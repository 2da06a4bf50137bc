"""The criterion of an accuracy test, held against figures with their uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from gantryctl.machine import Requirement


class Conformity(Enum):
    """What a figure with its uncertainty says of a limit (ISO 14253-1: both sides must prove their case)."""

    PASS = "pass"  # noqa: S105 - a verdict
    FAIL = "fail"
    # The limit lies within the uncertainty: neither is proven.
    UNDECIDED = "within uncertainty"
    # Nothing was measured at the load, or nothing tells what is required.
    NOT_JUDGED = "no verdict"


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
        return {Conformity.PASS: True, Conformity.FAIL: False}.get(self.conformity)


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


def conformity_of(value: float, expanded: float, limit: float) -> Conformity:
    """What one figure says of the limit; `expanded`: its uncertainty (k = 2)."""
    if value + expanded <= limit:
        return Conformity.PASS
    return Conformity.UNDECIDED if value - expanded <= limit else Conformity.FAIL


def plus_minus(expanded: float | None) -> str:
    """An expanded uncertainty behind its figure; "" where none is known."""
    return "" if expanded is None else f"+- {expanded:.4f} "
