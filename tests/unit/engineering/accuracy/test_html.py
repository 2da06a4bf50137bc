"""The page: self-contained, deterministic, complete."""

import base64
import dataclasses
import hashlib
import html
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import pytest

from gantryctl.engineering.accuracy.paper import PAPER_TABLE
from gantryctl.engineering.accuracy.report.page import render_html, write_report
from gantryctl.engineering.accuracy.report.report import AccuracyReport
from gantryctl.engineering.accuracy.table import table_from_rows
from gantryctl.engineering.accuracy.table_csv import read_error_table
from gantryctl.engineering.report.origin import Origin
from gantryctl.machine import Requirement
from support.figure_faults import watched
from support.reports import HEAD


class Rendered(NamedTuple):
    """The page, and what is wrong with each of its pictures."""

    page: str
    faults: dict[str, list[str]]


@pytest.fixture(scope="module")
def rendered(report: AccuracyReport) -> Rendered:
    with pytest.MonkeyPatch.context() as patch, watched(patch) as found:
        return Rendered(render_html(report, HEAD), found)


@pytest.fixture(scope="module")
def page(rendered: Rendered) -> str:
    return rendered.page


class _Page(HTMLParser):
    """Collects ids, references and whether every tag is closed."""

    VOID = ("meta", "link", "br", "hr", "img", "input")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.references: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(str(value))
            if name in ("src", "href", "xlink:href"):
                self.references.append(str(value))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_nothing_is_fetched_and_every_id_is_unique(page: str) -> None:
    parsed = _Page()
    parsed.feed(page)
    assert parsed.open == []
    assert len(parsed.ids) == len(set(parsed.ids))
    assert all(reference.startswith("#") for reference in parsed.references)
    assert {reference[1:] for reference in parsed.references} <= set(parsed.ids)
    assert not parsed.tags & {"link", "img", "iframe", "object"}
    # The one script that the policy names; the others are data, which nothing runs.
    kinds = re.findall(r"<script([^>]*)>", page)
    assert sorted(set(kinds)) == ["", ' type="application/json" class="recording"']
    assert kinds.count("") == 1
    script = page.rpartition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in page
    assert set(re.findall(r"url\(([^)]*)\)", page)) <= {f"#{identity}" for identity in parsed.ids}
    assert "@import" not in page
    # namespaces are names, not requests
    addresses = set(re.findall(r"https?://[^\"'\s<]+", page))
    assert addresses <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


def test_the_page_has_the_budget_of_the_uncertainty(report: AccuracyReport, page: str) -> None:
    found = report.budget
    assert found is not None
    text = html.unescape(re.sub(r"<[^>]+>", "|", page))
    for row in found.contributions:
        line = next(line for line in text.splitlines() if f"|{row.name.replace('+-', '±')}|" in line)
        assert f"|{row.contribution_deg:.5f}|" in line
        assert row.acting in line
    assert f"|{found.combined_deg:.5f}|" in text
    assert f"A ± {found.expanded_deg:.4f}°" in text
    assert f"{found.draws} draws" in text
    without = dataclasses.replace(report, budget=None, speed=(), ensemble=None)
    assert "Uncertainty of A" not in render_html(without, HEAD)


def test_the_same_report_gives_the_same_page(report: AccuracyReport, page: str) -> None:
    with mpl.rc_context({"font.size": 20.0, "axes.grid": False}):
        assert render_html(report, HEAD) == page
    # Script 58 kB, nine recordings of 700 to 2000 samples a curve, five pictures.
    assert len(page) < 750_000


def test_its_pictures_are_whole(rendered: Rendered) -> None:
    assert len(rendered.faults) == 5
    assert not {name: faults for name, faults in rendered.faults.items() if faults}


def test_what_the_page_says(page: str, report: AccuracyReport) -> None:
    text = re.sub(r"<(svg|script|style).*?</\1>", "", page, flags=re.DOTALL)
    for part in (
        "PASS: 0.1° required",
        "a comparison, not a criterion",
        "are fitted to the paper",
        "S pools both directions",
        "Not computable: 1 run in each direction",
        "Chord radius 2.5 m, noise 10 µm",
        "Figure 5 of the paper: 6°/s ccw, −90.0° to 90.0°",
        "stick-slip",
        "rigid (no compliance)",
        "seeds 0 to 7",
        "tracker AT-1",
        "DKD 7",
        "contract 4711",
        "A. Operator",
        "gantryctl accuracy run",
    ):
        assert part in text
    assert "None" not in text
    assert not re.search(r"\bnan\b", text)
    assert page.count("<svg") == 5


def test_a_table_from_a_file_makes_a_small_page() -> None:
    report = AccuracyReport("m", "-", "0.1", 0, "tracker.csv", PAPER_TABLE, Origin.MEASURED)
    page = render_html(report, HEAD)
    assert "NO VERDICT" in page
    assert page.count("<svg") == 2
    assert "Speed test" not in page
    assert "Gears with other phases" not in page
    assert "without instrument noise" not in page


def test_other_bases_columns_and_no_verdict() -> None:
    table = table_from_rows([(45.0, "ccw", (0.0, 0.001)), (30.0, "ccw", (0.0, 0.2))], (0.0, 7.5))
    report = AccuracyReport("<b>m</b>", "-", "0.1", 0, "drive", table, Origin.MEASURED, measures_load=False)
    page = render_html(report, HEAD)
    assert "NO VERDICT" in page
    assert "<b>m</b>" not in page
    assert "&lt;b&gt;m&lt;/b&gt;" in page
    strict = dataclasses.replace(
        report, measures_load=True, required=Requirement(0.05, "dish", "tender 4711")
    )
    failed = render_html(strict, HEAD)
    assert "FAIL: 0.05° required" in failed
    assert "required by dish (tender 4711)" in failed


def test_the_page_of_another_machine_speaks_of_no_paper(report: AccuracyReport, page: str) -> None:
    other = render_html(dataclasses.replace(report, of_reference=False, phases_fitted=False), HEAD)
    for word in ("paper", "Sun, Gong", "eq. (6)"):
        assert word not in other
    assert "paper" in page


def test_five_runs_show_the_iso_figures(five_runs: AccuracyReport) -> None:
    page = render_html(dataclasses.replace(five_runs, speed=(), ensemble=None), HEAD)
    assert "A (ISO), accuracy, both ways" in page
    assert "mean of 5 runs" in page


def test_files(report: AccuracyReport, tmp_path: Path) -> None:
    page = write_report(
        dataclasses.replace(report, speed=(), ensemble=None), HEAD, tmp_path / "new" / "folder"
    )
    assert page.name == "report.html"
    assert read_error_table(page.with_name("table.csv")) == report.measured
    assert page.with_name("report.json").read_text().startswith("{")
