"""Reports in a browser: alone, on paper, without a script, and with one."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from gantryctl.engineering.report.head import Judged, Required, Verdict
from gantryctl.engineering.report.page import Section, render_sections
from gantryctl.engineering.report.pictures import Panel, Picture, line
from gantryctl.engineering.report.recording import recorded
from gantryctl.engineering.report.text import TextTable
from support.command_line import cli
from support.printed import broken, opened, too_wide
from support.reports import CAMPAIGN, HEAD


def write(file: Path, amplitude: float = 1.0) -> Path:
    """A report with more than one page: figures with recordings between tables, one longer than a page."""
    time_s = np.linspace(0.0, 10.0, 5001)
    wave = amplitude * np.sin(time_s)
    speeds = Panel(
        "time, s", "speed, deg/s", (line("set-point", time_s, wave), line("motor side", time_s, 0.9 * wave)), (0.5,),
        followed=True,
    )  # fmt: skip
    error = Panel("time, s", "error, deg/s", (line("motor side", time_s, 0.1 * wave),))
    picture = Picture("A picture", (speeds, error), columns=1)
    rows = tuple((f"row {k}", "a word of it", f"{k}") for k in range(70))
    text = render_sections(
        HEAD,
        Verdict("PASS", Judged.PASS, "within the limit"),
        [Required("angle", "at most 0.1 deg", "0.01 deg", Judged.PASS)] * 12,
        title="A report",
        subtitle="of a test",
        tiles=[("0.01°", "angle", "of the load")] * 6,
        sections=[
            Section(f"Part {k}", ["A sentence"] * k, [TextTable("", ("", "", "number"), rows[: 9 * k])],
                    [recorded(picture, f"figure-{k}")])
            for k in range(1, 6)
        ],
    )  # fmt: skip
    file.write_text(text, "utf-8")
    return file


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("report") / "one.html")


def drawn(page: Page) -> str:
    """Pixels of the first chart."""
    image: str = page.locator("#figure-1 canvas").first.evaluate("(canvas) => canvas.toDataURL()")
    return image


def test_printed_on_a4(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        assert too_wide(page) == []
        assert broken(page) == []
        still, chart = page.locator("#figure-1 .still"), page.locator("#figure-1 .charts")
        expect(still).to_be_visible()
        expect(chart).to_be_hidden()
        page.emulate_media(media="screen")
        expect(still).to_be_hidden()
        expect(chart).to_be_visible()


def test_planted_faults_of_a_print_are_found(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        # Set from a script: the policy of the page lets no further style sheet run, and an attribute is one.
        page.locator("#figure-2 svg").evaluate(
            "(svg) => { svg.style.height = '300mm'; svg.style.maxHeight = 'none' }"
        )
        page.locator("h1").evaluate("(title) => { title.textContent = 'x'.repeat(200) }")
        assert any("xxx" in each for each in too_wide(page))
        page.locator("h1").evaluate("(title) => { title.textContent = 'x' }")
        assert broken(page) == ["figure-2"]


def test_without_a_script_the_picture_stands_there(browser: Browser, report: Path) -> None:
    with opened(browser, report, java_script_enabled=False) as page:
        expect(page.locator("#figure-1 .still")).to_be_visible()
        expect(page.locator(".charts")).to_have_count(0)


def test_zoom_and_cursors(browser: Browser, report: Path) -> None:
    with opened(browser, report) as page:
        whole = drawn(page)
        over = page.locator("#figure-1 .u-over").first
        over.scroll_into_view_if_needed()
        box = over.bounding_box()
        assert box is not None
        left, top = box["x"], box["y"] + 0.5 * box["height"]

        def at(part: float) -> float:
            return left + part * box["width"]

        page.mouse.click(at(0.25), top)
        page.mouse.click(at(0.75), top)
        readings = page.locator("#figure-1 .readings").first
        expect(readings).to_contain_text("B − A: ")
        told = re.findall(r"(?m)^[AB]: ([\d.]+) s; set-point ([\d.]+) °/s", readings.inner_text())
        # A pixel of the 830 is 0.012 s.
        assert [float(place) for place, _ in told] == pytest.approx([2.5, 7.5], abs=0.03)
        for place, value in told:
            # Between two samples of 0.005 s the curve is a straight line.
            assert float(value) == pytest.approx(math.sin(float(place)), abs=1e-4)
        marked = drawn(page)
        assert marked != whole
        page.mouse.move(at(0.3), top)
        page.mouse.down()
        page.mouse.move(at(0.6), top, steps=5)
        page.mouse.up()
        page.mouse.move(at(0.1), top + box["height"])
        zoomed = drawn(page)
        assert zoomed != marked
        assert "A:" in readings.inner_text()
        assert readings.inner_text().count("\n") == 2  # dragging has set no cursor
        page.mouse.dblclick(at(0.5), top)
        page.mouse.move(at(0.1), top + box["height"])
        page.wait_for_function(
            "(was) => document.querySelector('#figure-1 canvas').toDataURL() === was", arg=marked
        )


def test_another_report_is_laid_over_this_one(browser: Browser, report: Path, tmp_path: Path) -> None:
    other = write(tmp_path / "two.html", amplitude=0.5)
    with opened(browser, report) as page:
        before = drawn(page)
        page.locator("input[type=file]").set_input_files(other)
        legend = page.locator("#figure-1 .u-legend").first
        expect(legend).to_contain_text("motor side (two.html)")
        expect(page.locator(".overlay")).to_contain_text("5 of 5 figures")
        assert drawn(page) != before
        page.get_by_role("button", name="Without it").click()
        expect(legend).not_to_contain_text("two.html")
        no_report = tmp_path / "none.html"
        no_report.write_text("<p>nothing</p>", "utf-8")
        page.locator("input[type=file]").set_input_files(no_report)
        expect(page.locator(".overlay")).to_contain_text("none.html has no recording of these figures")


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("accuracy", "run", "--ensemble", "8"),
        ("speed-test",),
        ("stops",),
        ("size",),
        ("brake-test", "--fresh"),
        ("tune",),
        ("tune", "--method", "margins"),
        ("compare",),
        ("commission", "--with-sim"),
    ],
    ids=" ".join,
)
def test_every_report_prints(browser: Browser, command: tuple[str, ...], tmp_path: Path) -> None:
    assert cli(*command, "--out", tmp_path).code in (0, 1)
    (file,) = (path for path in tmp_path.glob("*.html"))
    with opened(browser, file) as page:
        recordings = page.locator("figure.recorded").count()
        assert page.locator("figure.live").count() == recordings
        assert too_wide(page) == []
        assert broken(page) == []


@pytest.mark.slow
def test_the_page_of_a_campaign_prints(browser: Browser, tmp_path: Path) -> None:
    file = tmp_path / "small.toml"
    file.write_text(CAMPAIGN, "utf-8")
    assert cli("campaign", "run", file, "--out", tmp_path / "result").code == 0
    assert cli("campaign", "plot", tmp_path / "result", "--out", tmp_path).code == 0
    with opened(browser, tmp_path / "campaign.html") as page:
        assert too_wide(page) == []
        assert broken(page) == []
