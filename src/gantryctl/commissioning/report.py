"""The report: one HTML page and its JSON, with a hash, beside what the last commissioning measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from gantryctl.commissioning.results import (
    Figure,
    Outcome,
    Progress,
    StepResult,
    load_progress,
    store_progress,
)
from gantryctl.commissioning.run import Step, complete, steps_for
from gantryctl.engineering.report.head import Head, Judged, Required, Verdict, judged_as
from gantryctl.engineering.report.page import render_page, signed
from gantryctl.engineering.report.recording import ShownFigure, recorded
from gantryctl.errors import StateError
from gantryctl.files import write_whole
from gantryctl.machine.tables.fields import UNITS
from gantryctl.operation.ledger import LedgerRow, Standing
from gantryctl.units import name_ending

TEMPLATE: Final = Path(__file__).parent / "templates" / "commissioning.html.j2"
_STYLES: Final = {
    Outcome.PASSED: Judged.PASS,
    Outcome.FAILED: Judged.FAIL,
    Outcome.NOT_TESTABLE: Judged.OPEN,
}
_NOT_DONE: Final = "not done"


def write_report(progress: Progress, ledger: Sequence[LedgerRow], folder: Path, head: Head) -> Path:
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
    write_whole(page, _page(progress, ledger, before, head))
    return page


def _page(progress: Progress, ledger: Sequence[LedgerRow], before: Progress | None, head: Head) -> str:
    steps = steps_for(ledger)
    done = complete(progress.results, steps)
    failed = any(result.outcome is Outcome.FAILED for result in progress.results.values())
    verdict = Verdict(
        "COMPLETE" if done else "NOT COMPLETE",
        Judged.PASS if done else Judged.FAIL if failed else Judged.OPEN,
        _verdict(progress, done, steps),
    )
    return render_page(TEMPLATE, head, verdict, _required(steps, progress), _view(progress, ledger, before))


def _required(steps: Sequence[Step], progress: Progress) -> list[Required]:
    """The figures of all steps that are held against a limit."""
    rows = []
    for step in steps:
        for row in _figures(progress.results.get(step.key), None):
            if row.judged is not None:
                unit = f" {row.unit}" if row.unit else ""
                found = f"{row.value}{unit if row.measured else ''}"
                rows.append(Required(f"{step.title}: {row.name}", f"{row.limit}{unit}", found, row.judged))
    return rows


def _view(progress: Progress, ledger: Sequence[LedgerRow], before: Progress | None) -> dict[str, Any]:
    steps = steps_for(ledger)
    results = [progress.results.get(step.key) for step in steps]
    # Steps that were never run are shown as well: a report without them would look complete.
    counts = Counter(_NOT_DONE if result is None else result.outcome.value for result in results)
    return {
        "progress": progress,
        "before": before,
        "ledger": ledger,
        "lacking": sum(row.standing is Standing.LACKING for row in ledger),
        "accepted": [row for row in ledger if row.standing is Standing.ACCEPTED],
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
    style: Judged | None
    figures: list[_FigureRow]
    pictures: list[ShownFigure]


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


def _drawn(result: StepResult | None) -> list[ShownFigure]:
    """The pictures of a step."""
    if result is None:
        return []
    return [recorded(picture, f"{result.key}-{k}") for k, picture in enumerate(result.pictures)]


class _FigureRow(NamedTuple):
    """A figure in the words of the page; `judged` is None without a limit, `was` the value of the report before."""

    name: str
    value: str
    unit: str
    limit: str
    judged: Judged | None
    was: str
    measured: bool


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
        judged=judged_as(figure.within) if figure.limited else None,
        was=_number(old.value) if old else "",
        measured=figure.value is not None,
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
