"""The report of a commissioning, by hand: what it holds against what, and what it says has failed or is left."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import STEPS, Outcome, StepResult, report
from gantryctl.commissioning.results import Figure, Progress
from gantryctl.commissioning.run import Step
from gantryctl.engineering.report.head import Judged
from gantryctl.engineering.report.pictures import Picture
from gantryctl.operation.ledger import Standing

pytestmark = pytest.mark.can

P, F, N = Outcome.PASSED, Outcome.FAILED, Outcome.NOT_TESTABLE


def titled(key: str, *, required: bool = True) -> Step:
    """A step that is never run."""
    return Step(key, key, "", "", lambda c: StepResult(key, P, ""), required=required)


A, B, D, MAY = titled("a"), titled("b"), titled("d"), titled("c", required=False)


@pytest.mark.parametrize(
    ("results", "shown"),
    [
        ({}, Judged.OPEN), ({"identity": P}, Judged.OPEN), ({"identity": F}, Judged.FAIL),
        ({each.key: F if each.key == "brake" else P for each in STEPS}, Judged.FAIL),
        ({each.key: N if each.key == "brake" else P for each in STEPS}, Judged.PASS),
    ],
)  # fmt: skip
def test_the_report_shows_a_failed_step_as_failed(
    monkeypatch: pytest.MonkeyPatch, results: dict[str, Outcome], shown: Judged
) -> None:
    verdicts: list[Any] = []
    monkeypatch.setattr(report, "render_page", lambda page, head, verdict, *_: verdicts.append(verdict))
    found = {key: StepResult(key, outcome, "") for key, outcome in results.items()}
    report._page(Progress("m", "h", results=found), (), None, None)  # type: ignore[arg-type]
    assert verdicts[0].judged is shown


@pytest.mark.parametrize(
    ("figure", "limit", "shown"),
    [
        (Figure(3.0), "", None), (Figure(3.0, low=5.0), "at least 5", Judged.FAIL),
        (Figure(3.0, high=5.0), "at most 5", Judged.PASS), (Figure(3.0, 1.0, 2.5), "1 to 2.5", Judged.FAIL),
        (Figure(3.0, 1.0, 5.0), "1 to 5", Judged.PASS), (Figure(None, high=5.0), "at most 5", Judged.FAIL),
    ],
)  # fmt: skip
def test_a_report_holds_a_figure_against_its_limit_and_against_the_one_before(
    figure: Figure, limit: str, shown: Judged | None
) -> None:
    row = report._row("ramp_deg_s2", figure, Figure(2.0))
    value = "not measured" if figure.value is None else "3"
    assert (row.name, row.value, row.unit) == ("ramp", value, "deg/s2")
    assert (row.limit, row.judged, row.was) == (limit, shown, "2")
    assert report._row("ramp_deg_s2", figure, None).was == ""


def test_a_step_stands_beside_the_same_step_of_the_report_before() -> None:
    """Of another step with a figure of that name nothing is said."""

    def shown(**values: float) -> Progress:
        results = {key: StepResult(key, P, "", {"way_deg": Figure(value)}) for key, value in values.items()}
        return Progress("m", "h", results=results)

    now, before = shown(a=1.0, b=2.0), shown(d=4.0, b=3.0)
    was = {key: report._figures(result, before)[0].was for key, result in now.results.items()}
    assert was == {"a": "", "b": "3"}


def test_a_report_has_small_numbers_without_an_exponent() -> None:
    """Nobody reads 1.3e-05 deg beside 0.0033."""
    shown = [report._number(value) for value in (1.3e-5, -1.3e-5, 0.0033)]
    assert shown == ["0.000013", "\N{MINUS SIGN}0.000013", "0.0033"]


def test_a_report_has_each_limit_with_its_unit_and_what_was_not_measured_without() -> None:
    figures = {
        "ramp_deg_s2": Figure(5.3, low=5.1),
        "torque_nm": Figure(None, high=70.0),
        "way_deg": Figure(1.0),
    }
    progress = Progress("m", "h", results={"a": StepResult("a", P, "", figures)})
    assert [tuple(row)[:3] for row in report._required((A, B), progress)] == [
        ("a: ramp", "at least 5.1 deg/s2", "5.3 deg/s2"), ("a: torque", "at most 70 N m", "not measured")
    ]  # fmt: skip


def test_each_picture_of_a_step_has_a_name_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "recorded", lambda picture, name: (picture.title, name))
    result = StepResult("a", P, "", pictures=(Picture("there", ()), Picture("back", ())))
    assert report._drawn(result) == [("there", "a-0"), ("back", "a-1")]
    assert report._drawn(None) == []


def test_a_report_names_what_a_person_has_accepted_and_counts_what_lacks() -> None:
    rows: Any = [SimpleNamespace(what=each.name, standing=each) for each in (*Standing, Standing.LACKING)]
    results = {key: StepResult(key, outcome, "") for key, outcome in (("brake", F), ("sign", P), ("loop", P))}
    view = report._view(Progress("m", "h", results=results), rows, None)
    assert [row.what for row in view["accepted"]] == ["ACCEPTED"]
    assert view["lacking"] == 2
    # Of all steps but the two that are for a lack, which this drive has not.
    count = len(STEPS)
    words = [text for _, text, _ in view["tiles"]]
    assert [int(number) for number, _, _ in view["tiles"]] == [2, 1, 0, count - 3]
    assert words == ["steps passed", "step failed", "steps not testable here", "steps not done"]


@pytest.mark.parametrize(
    ("outcomes", "told"),
    [
        ({"a": F, "b": N}, "Failed: a; not done: d."), ({"a": P, "b": N}, "Not done: d."),
        ({"a": P, "b": N, "d": F}, "Failed: d."), ({}, "Not done: a, b, d."),
    ],
)  # fmt: skip
def test_a_report_names_what_has_failed_and_what_is_left(outcomes: dict[str, Outcome], told: str) -> None:
    results = {key: StepResult(key, outcome, "") for key, outcome in outcomes.items()}
    text = report._verdict(Progress("m", "h", results=results), False, (A, B, MAY, D))
    assert text == f"The machine may not move. {told}"


@pytest.mark.parametrize("earlier", [False, True])
def test_a_report_stands_beside_what_the_one_before_it_has_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, earlier: bool
) -> None:
    seen: list[Progress | None] = []
    monkeypatch.setattr(report, "_page", lambda progress, ledger, before, head: seen.append(before) or "page")
    first, second = Progress("m", "first"), Progress("m", "second")
    for progress in (first, second) if earlier else (second,):
        report.write_report(progress, (), tmp_path, None)  # type: ignore[arg-type]
    assert seen[-1] == (first if earlier else None)


def test_a_complete_report_says_from_when_to_when_and_by_whom() -> None:
    results = {
        "a": StepResult("a", P, "", at="2026-11-02", by="anna"),
        "b": StepResult("b", P, "", at="2026-11-05", by="otto"),
        "c": StepResult("c", P, "", at="2026-11-03", by="anna"),
    }
    said = report._verdict(Progress("m", "h", results=results), True, (A, B, MAY))
    assert "All 2 required steps" in said
    assert said.endswith("Done from 2026-11-02 to 2026-11-05 by anna, otto.")
    # A step of before that names nobody.
    results["b"] = StepResult("b", P, "", at="2026-11-05")
    assert report._verdict(Progress("m", "h", results=results), True, (A, B, MAY)).endswith(" by anna.")
    alone = {"a": StepResult("a", P, "", at="2026-11-02")}
    assert report._verdict(Progress("m", "h", results=alone), True, (A,)).endswith(" by nobody named.")
