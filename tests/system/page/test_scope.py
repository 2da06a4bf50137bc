"""The scope as a person uses it: what fires, what is kept around it, files, and whose samples they are."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from support.browser import enter, ready_to_jog, take_control
from support.service_process import Page as Watcher
from support.service_process import Service

LEVEL_DEG_S = 0.3


def show(page: Page, area: str) -> None:
    page.locator(f"#tab-{area}").click()
    page.locator(f"[data-area={area}]").wait_for()


def saved(page: Page, folder: Path) -> dict[str, Any]:
    """What the person gets who presses Save."""
    with page.expect_download() as wanted:
        page.get_by_role("button", name="Save").click()
    assert re.fullmatch(r"gantryctl_scope_\d{4}-\d\d-\d\dT\d{6}\.json", wanted.value.suggested_filename)
    file = folder / "capture.json"
    wanted.value.save_as(file)
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def single_shot(page: Page) -> None:
    """Fires once when the set-point's speed rises over the level; half a second, a quarter of it before."""
    show(page, "scope")
    page.get_by_role("button", name="single").click()
    page.get_by_label("Length").select_option("0.5 s")
    page.get_by_label("Trigger", exact=True).select_option("vel_ref_deg_s")
    page.get_by_label("Level").fill(str(LEVEL_DEG_S))
    page.get_by_label("Level").press("Enter")
    page.get_by_label("Before the trigger").fill("25")
    page.get_by_label("Add a channel").select_option("vel_ref_deg_s")
    page.get_by_label("Add a channel").select_option("brake_open")
    page.get_by_role("button", name="Start").click()
    expect(page.get_by_test_id("scope-state")).to_contain_text("Waits for the trigger.")


def test_a_single_shot_begins_at_the_first_scan_beyond_the_level(
    context: BrowserContext, page_service: Service, watcher: Watcher, tmp_path: Path
) -> None:
    """It waits while its person drives in another area, and every scan around the trigger is in its file."""
    page = enter(context, page_service, "service")
    ready_to_jog(page)
    page.get_by_role("button", name="incremental").click()
    single_shot(page)
    expect(page.get_by_test_id("scope-state")).to_contain_text(re.compile(r"a sample in every scan, \d+ ms"))
    show(page, "operation")
    page.get_by_role("button", name="+1.00°").click()
    watcher.until(lambda tags: tags["vel_ref_deg_s"] > LEVEL_DEG_S)
    watcher.until(lambda tags: tags["at_rest"])
    show(page, "scope")
    expect(page.get_by_test_id("scope-state")).to_contain_text("vel_ref_deg_s ·")
    expect(page.get_by_role("button", name="Start")).to_be_visible()
    found = saved(page, tmp_path)
    channels = {each["name"]: each for each in found["channels"]}
    speed = channels["vel_ref_deg_s"]
    period_s = watcher.tags["scan_period_ms"] / 1e3
    at = speed["x"].index(0)
    # One sample late, and the one before would be beyond the level as well.
    assert speed["y"][at - 1] < LEVEL_DEG_S <= speed["y"][at]
    assert speed["periods_s"] == pytest.approx([period_s, period_s], abs=1e-6)
    steps = [b - a for a, b in zip(speed["x"], speed["x"][1:], strict=False)]
    assert steps == pytest.approx([period_s] * len(steps), abs=2e-6)  # six decimals are told
    # The parts before and after; both ends are within one scan.
    assert speed["x"][0] == pytest.approx(-0.125, abs=1.01 * period_s)
    assert speed["x"][-1] == pytest.approx(0.375, abs=1.01 * period_s)
    # What no recording has comes with the status frames, and the page says so.
    assert channels["brake_open"]["periods_s"][0] > 5 * period_s  # the controller tells such tags every 10 ms
    row = page.locator("[data-channel=brake_open] [data-sampled]")
    expect(row).to_have_text(re.compile(r"^\d\d( … \d\d+)? ms$"))
    expect(page.locator("[data-channel=vel_ref_deg_s] [data-sampled]")).to_have_text(f"{1e3 * period_s:g} ms")
    # Angle and time agree with each other: no sample of one stands beside a time of another.
    angle = channels["pos_act_deg"]
    assert angle["x"] == speed["x"]
    assert found["utc_s"] is not None


def test_cursors_a_file_laid_over_and_a_log_of_the_bus(
    context: BrowserContext, page_service: Service, watcher: Watcher, tmp_path: Path
) -> None:
    page = enter(context, page_service, "viewer", "scope")
    made = {
        "format": "gantryctl scope", "version": 1, "title": "pos_act_deg", "machine": "m", "utc_s": 1795385708.0,
        "channels": [
            {"name": "pos_act_deg", "unit": "deg", "steps": False, "labels": [], "begin": None,
             "periods_s": [0.5, 0.5], "x": [-1.0, 0.0, 1.0], "y": [10.0, 20.0, 40.0]},
            {"name": "power", "unit": "", "steps": True, "labels": [], "begin": None,
             "periods_s": [1, 1], "x": [-1.0, 0.0, 1.0], "y": [0, 1, 1]},
        ],
        "marks": [{"x": 0.5, "label": "CTL-03"}],
    }  # fmt: skip
    file = tmp_path / "one.json"
    file.write_text(json.dumps(made), encoding="utf-8")
    page.get_by_label("Open", exact=True).set_input_files(file)
    expect(page.get_by_test_id("scope-state")).to_contain_text("pos_act_deg ·")
    expect(page.locator("[data-channel=pos_act_deg] [data-sampled]")).to_have_text("500 ms")
    page.get_by_label("Cursor A").fill("-0.5")
    page.get_by_label("Cursor A").press("Enter")
    page.get_by_label("Cursor B").fill("0.5")
    page.get_by_label("Cursor B").press("Enter")
    readings = page.locator(".readings")
    # Between its samples a curve is a line, a flag keeps its value.
    expect(readings).to_contain_text("A: −0.5 s; pos_act_deg 15 °, power 0")
    expect(readings).to_contain_text("B: 0.5 s; pos_act_deg 30 °, power 1")
    expect(readings).to_contain_text("B − A: 1 s; pos_act_deg 15 °, power 1")
    other = tmp_path / "two.json"
    made["channels"][0]["y"] = [0.0, 0.0, 0.0]  # type: ignore[index]
    other.write_text(json.dumps(made), encoding="utf-8")
    page.get_by_label("Lay another one over it").set_input_files(other)
    expect(page.get_by_text("Fine dots: two.json.")).to_be_visible()
    expect(readings).to_contain_text("pos_act_deg (2) 0 °")
    log = tmp_path / "bus.log"
    log.write_text(
        "(1795385708.250000) can0 181#37060000\n(1795385708.300000) can0 201#0F00\n", encoding="utf-8"
    )
    page.get_by_label("Lay a log of the bus over it").set_input_files(log)
    expect(page.get_by_test_id("log")).to_have_text("bus.log: 2 telegrams.")
    for wrong, why in (("bus.log", "is no file of this scope"), ("one.json", "has no line of a candump log")):
        name = "Open" if wrong == "bus.log" else "Lay a log of the bus over it"
        page.get_by_label(name, exact=True).set_input_files(tmp_path / wrong)
        expect(page.locator(".reason[role=alert]")).to_contain_text(why)


def test_an_alarm_fires_and_its_code_stands_in_the_picture(
    context: BrowserContext, page_service: Service, watcher: Watcher, tmp_path: Path
) -> None:
    page = enter(context, page_service, "service", "scope")
    take_control(page)
    page.get_by_role("button", name="normal").click()
    page.get_by_label("Length").select_option("0.5 s")
    page.get_by_label("Trigger", exact=True).select_option("any new alarm")
    page.get_by_role("button", name="Start").click()
    page.get_by_role("button", name="Quick stop").click()
    expect(page.get_by_test_id("scope-state")).to_contain_text("any new alarm ·")
    assert "INT-06" in [mark["label"] for mark in saved(page, tmp_path)["marks"]]
    watcher.until(lambda tags: tags["at_rest"] and tags["power_phase"] == "off")
    show(page, "alarms")
    page.get_by_role("button", name="Reset").click()
    watcher.until(lambda tags: tags["alarm_count"] == 0)
