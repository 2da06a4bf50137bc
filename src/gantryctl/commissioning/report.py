"""The report: one HTML page and its JSON, with a hash, beside what the last commissioning measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.commissioning.drawing import picture_svg
from gantryctl.commissioning.results import (
    Figure,
    Outcome,
    Progress,
    StepResult,
    load_progress,
    store_progress,
)
from gantryctl.commissioning.run import Step, complete, steps_for
from gantryctl.engineering.report.page import render_page, signed
from gantryctl.errors import StateError
from gantryctl.files import write_whole
from gantryctl.machine.tables.fields import UNITS
from gantryctl.operation.ledger import LedgerRow, Standing
from gantryctl.units import name_ending

TEMPLATE: Final = Path(__file__).parent / "templates" / "commissioning.html.j2"
_STYLES: Final = {Outcome.PASSED: "pass", Outcome.FAILED: "fail", Outcome.NOT_TESTABLE: "none"}
_NOT_DONE: Final = "not done"


def write_report(progress: Progress, ledger: Sequence[LedgerRow], folder: Path) -> Path:
    """Write `commissioning.html` and `commissioning.json`, compared with the JSON of an earlier report there.

    Raises:
        StateError: a file cannot be written.
    """
    data = folder / "commissioning.json"
    try:
        before = load_progress(data)
    except StateError:
        # A damaged report of before is no reason to have none now.
        before = None
    store_progress(data, progress)
    page = folder / "commissioning.html"
    write_whole(page, render_page(TEMPLATE, _view(progress, ledger, before)))
    return page


def _view(progress: Progress, ledger: Sequence[LedgerRow], before: Progress | None) -> dict[str, Any]:
    steps = steps_for(ledger)
    results = [progress.results.get(step.key) for step in steps]
    # Steps that were never run are shown as well: a report without them would look complete.
    counts = Counter(_NOT_DONE if result is None else result.outcome.value for result in results)
    done = complete(progress.results, steps)
    return {
        "progress": progress,
        "before": before,
        "ledger": ledger,
        "lacking": sum(row.standing is Standing.LACKING for row in ledger),
        "accepted": [row for row in ledger if row.standing is Standing.ACCEPTED],
        "badge": "COMPLETE" if done else "NOT COMPLETE",
        "badge_class": "pass" if done else "fail" if counts[Outcome.FAILED.value] else "none",
        "verdict": _verdict(progress, done, steps),
        "tiles": [
            (str(counts[name]), f"step{'s' if counts[name] != 1 else ''} {name}", f"of {len(steps)}")
            for name in (*(outcome.value for outcome in Outcome), _NOT_DONE)
        ],
        "steps": [
            _StepView(
                step,
                result,
                _STYLES[result.outcome] if result else None,
                _figures(result, before),
                _drawn(result),
            )
            for step, result in zip(steps, results, strict=True)
        ],
    }


class _StepView(NamedTuple):
    """A step for the page; `result` is None where it was not done."""

    step: Step
    result: StepResult | None
    style: str | None
    figures: list[_FigureRow]
    pictures: list[tuple[str, str]]


def _verdict(progress: Progress, done: bool, steps: Sequence[Step]) -> str:
    """What the commissioning has shown, in a sentence."""
    required = [step for step in steps if step.required]
    if not done:
        found = progress.results
        failed = [s.title for s in steps if s.key in found and found[s.key].outcome is Outcome.FAILED]
        left = [s.title for s in required if s.key not in found]
        why = [
            f"{word}: {', '.join(names)}" for word, names in (("failed", failed), ("not done", left)) if names
        ]
        return f"The machine may not move. {'; '.join(why)}.".replace(". f", ". F").replace(". n", ". N")
    last = max(progress.results.values(), key=lambda result: result.at)
    people = ", ".join(dict.fromkeys(result.by for result in progress.results.values() if result.by))
    first = min(result.at for result in progress.results.values())
    return (
        f"All {len(required)} required steps are passed or cannot be tested here; the machine may move in this "
        f"configuration with this drive. Done from {first} to {last.at} by {people or 'nobody named'}."
    )


def _drawn(result: StepResult | None) -> list[tuple[str, str]]:
    """Title and SVG of every picture of a step."""
    if result is None:
        return []
    return [
        (picture.title, picture_svg(picture, f"{result.key}-{k}"))
        for k, picture in enumerate(result.pictures)
    ]


class _FigureRow(NamedTuple):
    """A figure in the words of the page; `was` is the value of the report before, "" without one."""

    name: str
    value: str
    unit: str
    limit: str
    style: str
    was: str


def _figures(result: StepResult | None, before: Progress | None) -> list[_FigureRow]:
    if result is None:
        return []
    old = before.results.get(result.key) if before else None
    was = old.figures if old else {}
    return [_row(name, figure, was.get(name)) for name, figure in result.figures.items()]


def _row(name: str, figure: Figure, old: Figure | None) -> _FigureRow:
    ending = name_ending(name, UNITS)
    return _FigureRow(
        name=name.removesuffix(f"_{ending}").replace("_", " "),
        value=_number(figure.value),
        unit=UNITS[ending] if ending else "",
        limit=_limit(figure),
        style=("pass" if figure.within else "fail") if figure.limited else "",
        was=_number(old.value) if old else "",
    )


def _number(value: float | None) -> str:
    if value is None:
        return "not measured"
    text = f"{value:.5g}"
    # Nobody reads 1.3e-05 deg beside 0.0033.
    return signed(f"{value:.6f}" if "e-" in text else text)


def _limit(figure: Figure) -> str:
    low, high = figure.low, figure.high
    if low is not None and high is not None:
        return f"{_number(low)} to {_number(high)}"
    if high is not None:
        return f"at most {_number(high)}"
    return f"at least {_number(low)}" if low is not None else ""
