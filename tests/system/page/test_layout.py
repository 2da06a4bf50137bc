"""The page in every window: nothing lies over anything else, targets are as large as a finger, Stop is always there.

What it shows is the longest that there is: it is the words and numbers that overlap.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Playwright, expect

from gantryctl.program import ALARMS
from gantryctl.service.protocol.tags import TAGS
from support.browser import CHROMIUM, FLAGS
from support.page_geometry import faults_of_layout, grey_without_reason, heavy_findings
from support.page_shown import IN_CONTROL, Shown

AREAS = ("display", "operation", "settings", "alarms", "diagnosis", "scope")
SIZES = ((360, 640), (640, 360), (768, 1024), (1024, 768), (1280, 800), (1920, 1080))

_LONGEST_TITLES = sorted(ALARMS.values(), key=lambda each: len(each.english.title))[-4:]
CROWDED: dict[str, Any] = {
    "pos_act_deg": -179.985, "pos_ref_deg": -179.981, "vel_act_deg_s": -5.9987, "vel_ref_deg_s": -6.0,
    "target_deg": -179.99, "axis_state": "synchronized_motion", "mode": "incremental", "at_rest": False,
    "time_left_s": 299.9, "unheld_power_left_s": 299.0, "stopping_angle_deg": 12.345, "quick_stop_angle_deg": 10.01,
    "pos_err_deg": -0.0299, "torque_act_nm": -384.9, "torque_expected_nm": -379.9, "overload": 0.999,
    "eccentric_moment_nm": None, "override_percent": 100.0, "speed_setting_deg_s": 6.0,
    "power": True, "power_phase": "torque_hold", "brake_open": None, "brake_test_overdue": True,
    "brake_test_due_at": "2026-11-20T10:11:12.000+00:00", "brake_tested_at": "2026-11-10T10:11:12.000+00:00",
    "brake_test_result": "aborted", "brake_test_phase": "minus_rising", "brake_test_left_s": 12.0,
    "authority_user": "a.physicist.of.the.night", "authority_client": "another", "authority_local": True,
    "travel_left_minus_deg": 359.99, "travel_left_plus_deg": 359.99, "alarm_count": 12, "round_trip_ms": 149.0,
    "blocked_by": "the brake failed its test", "blocked_by_messages": None,
    "alarms": [
        {
            "id": number, "code": str(each.code), "severity": each.severity.value, "title": each.english.title,
            "measured": each.english.message, "values": {}, "done": "Quick stop", "steps": [],
            "to_do": each.english.to_do, "cause": each.english.cause, "text": "",
            "at": "2026-11-20T10:11:12.000+00:00", "time_s": 1.5, "pos_act_deg": -179.985, "active": True,
            "first_out": number == 4, "follows": "" if number == 4 else "LIM-06", "lock": True,
            "acknowledged_by": "a.physicist.of.the.night",
        }
        for number, each in reversed(list(enumerate(_LONGEST_TITLES, 1)))
    ],
}  # fmt: skip
READY: dict[str, Any] = {
    "power": True,
    "power_phase": "on",
    "mode": "continuous",
    "enabling_switch": True,
} | IN_CONTROL
"""All that the keys need."""


# Eight curves of the longest names, with a mark; the same laid over it.
_LONGEST_NAMES = sorted((tag for tag in TAGS if tag.kind == "float"), key=lambda tag: len(tag.name))[-8:]
CAPTURE = {
    "format": "gantryctl scope", "version": 1, "title": "service-000012-20261122T151537123.parquet",
    "machine": "hust_gantry", "utc_s": 1795385708.0, "marks": [{"x": 0.5, "label": "CTL-03"}],
    "channels": [
        {"name": tag.name, "unit": tag.unit, "steps": False, "labels": [], "begin": None, "periods_s": [0.004, 0.12],
         "x": [-1.0, 0.0, 1.0], "y": [-179.985, 20.0, 40.0]}
        for tag in _LONGEST_NAMES
    ],
}  # fmt: skip
RECORDED = {
    "name": CAPTURE["title"], "machine": "hust_gantry", "utc_s": 1795385708.0, "end_s": 86399.9,
    "columns": [{"name": tag.name, "unit": tag.unit, "x": [0.0, 1.0], "y": [0.0, None]} for tag in _LONGEST_NAMES],
}  # fmt: skip
SCOPE_ANSWERS = {
    "api/v1/tags": [
        {"name": tag.name, "unit": tag.unit, "type": tag.kind, "labels": list(tag.labels)} for tag in TAGS
    ],
    "api/v1/traces": [{"id": "a", "name": CAPTURE["title"], "size": 1, "modified": ""}],
    "api/v1/traces/a/columns": RECORDED,
}


@pytest.fixture(scope="module")
def shown(playwright: Playwright) -> Iterator[Shown]:
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
    yield Shown(browser)
    browser.close()


def fill_scope(shown: Shown) -> None:
    """Whatever the scope can show at once: curves, others over them, a log, cursors, the recordings."""
    page = shown.page
    for label, name, text in (
        (0, "one.json", json.dumps(CAPTURE)),
        (1, "another_of_a_long_name.json", json.dumps(CAPTURE)),
        (2, "bus.log", "(1795385708.250000) can0 181#37060000\n"),
    ):
        file = {"name": name, "mimeType": "text/plain", "buffer": text.encode()}
        page.locator(".scope input[type=file]").nth(label).set_input_files(file)  # type: ignore[arg-type]
    page.locator("[data-testid=log]").wait_for()
    recordings = page.locator(".scope section").last
    recordings.locator("[data-recordings] button").first.click()
    recordings.locator("[data-recordings] select").select_option("a")


def faults(shown: Shown) -> list[str]:
    """At both ends of what scrolls."""
    found = faults_of_layout(shown.page)
    shown.scroll(1e6)
    found += faults_of_layout(shown.page)
    shown.scroll(0.0)
    return found


def assert_stop_reached(shown: Shown) -> None:
    assert "stop" in shown.tap("[data-stop=stop]")
    assert "quick_stop" in shown.tap("[data-stop=quick_stop]")


def test_nothing_overlaps_and_stop_is_reached_in_every_window(shown: Shown) -> None:
    shown.answers = SCOPE_ANSWERS
    shown.show(CROWDED)
    for area in AREAS:
        shown.go(area)
        if area == "scope":
            fill_scope(shown)
        for size in SIZES if area == "display" else (SIZES[0], SIZES[3]):
            shown.resize(*size)
            assert faults(shown) == [], (area, size)
            assert grey_without_reason(shown.page) == [], (area, size)
            if area == "display":
                assert_stop_reached(shown)


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "zh"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_area_in_every_window_language_and_theme(shown: Shown, language: str, theme: str) -> None:
    """With axe-core, of which nothing serious or critical is accepted."""
    for tags in (CROWDED, READY):
        shown.answers = SCOPE_ANSWERS
        shown.show(tags, language, theme)
        for area in AREAS:
            shown.go(area)
            # Empty with one set of tags, full with the other.
            if area == "scope" and tags is CROWDED:
                fill_scope(shown)
            for size in SIZES:
                shown.resize(*size)
                assert faults(shown) == [], (area, size)
                assert grey_without_reason(shown.page) == [], (area, size)
                assert heavy_findings(shown.page) == [], (area, size)
                assert_stop_reached(shown)


PLANTED = {
    "overlap": "document.querySelector('.overview .value').style.marginRight = '-6rem';"
    " document.querySelector('.overview .value dt').textContent = 'Angle of the axis, as measured'",
    "clipped": "document.querySelector('.alarmcell').style.cssText = 'overflow: hidden; height: 1rem'",
    "spills": "document.querySelector('[data-area] .panel').style.height = '3rem'",
    "outside": "document.querySelector('.who').style.marginRight = '-40px'",
    "small": "document.querySelector('.who button').style.cssText = 'min-height: 30px; height: 30px'",
    "grey": "document.getElementById('mode-why').remove()",
    "not in sight": "document.body.insertAdjacentHTML('beforeend', '<p class=planted>over Stop</p>');"
    " document.querySelector('.planted').style.cssText = 'position: fixed; inset: 0; background: white'",
}


@pytest.mark.parametrize("fault", PLANTED)
def test_a_planted_fault_is_found(shown: Shown, fault: str) -> None:
    shown.show(CROWDED)
    shown.go("operation")
    shown.resize(1024, 768)
    shown.page.evaluate(f"() => {{ {PLANTED[fault]} }}")
    if fault == "grey":
        assert grey_without_reason(shown.page) == ["none", "continuous", "incremental"]
    else:
        assert any(each.startswith(fault) for each in faults_of_layout(shown.page))


def test_no_motion_is_offered_where_stop_cannot_be_pressed(shown: Shown) -> None:
    shown.show(READY)
    shown.go("operation")
    shown.resize(360, 640)
    key = shown.page.locator("[data-hold=forward]")
    expect(key).to_be_enabled()
    shown.page.evaluate(
        "() => { const cover = document.createElement('div'); cover.id = 'cover';"
        " cover.style.cssText = 'position: fixed; inset: auto 0 0; height: 60px'; document.body.append(cover) }"
    )
    expect(key).to_be_disabled()
    expect(key).to_have_attribute("title", "Stop is not in sight: zoom out, or close what covers it.")
    for name in ("Move to 0.00°", "1 · Arm test", "incremental"):
        expect(shown.page.get_by_role("button", name=name, exact=True)).to_be_disabled()
    shown.page.evaluate("() => document.getElementById('cover').remove()")
    expect(key).to_be_enabled()


@pytest.mark.parametrize("size", [(339, 640), (640, 259), (200, 150)])
def test_a_window_without_room_has_stop_alone_and_says_why(shown: Shown, size: tuple[int, int]) -> None:
    shown.show(READY)
    shown.resize(*size)
    expect(shown.page.get_by_role("alert").filter(has_text="too small to move the axis")).to_be_visible()
    assert shown.page.locator("button").evaluate_all("(all) => all.map((e) => e.dataset.stop)") == [
        "stop",
        "quick_stop",
    ]
    assert faults_of_layout(shown.page) == []
    assert_stop_reached(shown)
    shown.resize(1024, 768)
    expect(shown.page.locator("#area")).to_be_visible()
