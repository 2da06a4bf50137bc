"""The five areas of the page: what they show is what the service says, and what they offer works."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, expect

from gantryctl.gateway.access import COOKIE
from gantryctl.service.clients.link import console_link
from support.browser import SIZE, address, enter, person_key, ready_to_jog, take_control
from support.service_process import PASSWORD, Service
from support.service_process import Page as Watcher

AREAS = ["display", "operation", "settings", "alarms", "diagnosis", "scope"]


def number(text: str) -> float:
    return float(text.replace("−", "-"))


@pytest.fixture(scope="module")
def one_page(browser: Browser, page_service: Service) -> Iterator[Page]:
    context = browser.new_context(viewport=SIZE, locale="en-GB")
    yield enter(context, page_service, "service", "display")
    context.close()


@pytest.fixture
def page(one_page: Page, watcher: Watcher) -> Iterator[Page]:
    """The same browser window for each test, as it was at first: nobody has control, English, light."""
    one_page.locator("#tab-display").click()
    yield one_page
    one_page.evaluate("() => localStorage.clear()")
    one_page.goto("about:blank")
    one_page.go_back()
    one_page.locator("[data-stale=false]").wait_for()


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_a_person_logs_in_with_a_password_and_out_again(
    context: BrowserContext, page_service: Service, host: str
) -> None:
    page = context.new_page()
    page.goto(address(page_service, frozen=host == "localhost"))
    page.get_by_label("User").fill("viewer")
    expect(page.get_by_label("Password")).to_have_attribute("type", "password")
    page.get_by_label("Password").fill("not the password")
    page.get_by_role("button", name="Log in").click()
    expect(page.get_by_role("alert")).to_have_text("User or password is wrong.")
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Log in").click()
    expect(page.get_by_test_id("user")).to_contain_text("viewer")
    # Secure, though this is http: the browser counts this machine as safe.
    (cookie,) = context.cookies()
    assert (cookie["name"], cookie["domain"], cookie["path"]) == (COOKIE, host, "/")
    assert (cookie["secure"], cookie["httpOnly"], cookie["sameSite"]) == (True, True, "Strict")
    person_key(page, "Log out")
    expect(page.get_by_label("Password")).to_be_visible()
    assert context.cookies() == []


def test_the_page_that_the_console_opens_is_no_remote_screen(
    context: BrowserContext, page_service: Service
) -> None:
    page = enter(context, page_service, "viewer")
    expect(page.get_by_test_id("remote")).to_be_visible()
    page.goto(console_link(page_service.directory))
    assert page.url == address(page_service)
    page.locator("[data-stale=false]").wait_for()
    expect(page.get_by_test_id("remote")).to_have_count(0)
    page.reload()
    page.locator("[data-stale=false]").wait_for()
    expect(page.get_by_test_id("remote")).to_have_count(0)


def test_nothing_leaves_the_machine_and_no_policy_is_broken(
    context: BrowserContext, page_service: Service
) -> None:
    """Every request of a round through all areas, in both languages and themes."""
    hosts: set[str] = set()
    said: list[str] = []

    def heard(message: ConsoleMessage) -> None:
        if message.type in ("error", "warning"):
            said.append(message.text)

    context.on("request", lambda request: hosts.add(request.url.split("/")[2]))
    context.on("console", heard)
    page = enter(context, page_service, "service", "display")
    for language in ("中文", "English"):
        for area in AREAS:
            page.locator(f"#tab-{area}").click()
            expect(page.locator(f"[data-area={area}]")).to_be_visible()
        page.get_by_role("button", name=language).click()
        person_key(page, "深色" if language == "中文" else "Dark")
    assert hosts == {page_service.address}
    assert said == []


def test_display_shows_what_the_controller_says(page: Page, watcher: Watcher) -> None:
    tags = watcher.look()
    angle = page.locator("main [data-tag=pos_act_deg]")
    expect(angle).to_have_text(re.compile(r"^−?\d+\.\d\d$"))
    assert number(angle.inner_text()) == pytest.approx(tags["pos_act_deg"], abs=0.006)  # two decimals
    expect(page.get_by_role("img", name="The axis at")).to_be_visible()
    expect(page.get_by_role("img", name=re.compile("Cable: .* left in minus"))).to_be_visible()
    expect(page.locator(".overview [data-tag=mode]")).to_have_text(tags["mode"])


def test_strip_chart_pauses_and_exports_what_it_shows(page: Page, tmp_path: Path) -> None:
    page.locator(".u-legend .u-value").first.filter(has_text=":").wait_for()
    page.get_by_role("button", name="Pause").click()
    expect(page.get_by_text("PAUSED")).to_be_visible()
    shown = page.locator(".u-legend").inner_text()
    with page.expect_download() as wanted:
        page.get_by_role("button", name="Export CSV").click()
    file = tmp_path / "chart.csv"
    wanted.value.save_as(file)
    with file.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    assert {"time_s", "pos_act_deg", "pos_ref_deg", "torque_act_nm"} <= set(rows[0])
    times = [float(row["time_s"]) for row in rows]
    assert times == sorted(times)
    assert page.locator(".u-legend").inner_text() == shown
    # The time of day of this place in the legend, UTC in the file: of the same moment, to the hundredth that is shown.
    last = datetime.fromisoformat(rows[-1]["utc"])
    told = re.search(r"(\d\d):(\d\d):(\d\d\.\d\d)", shown)
    assert told is not None
    assert (60 * int(told[2]) + float(told[3]) - 60 * last.minute - last.second) % 3600 == pytest.approx(
        last.microsecond / 1e6, abs=0.011
    )
    assert abs((datetime.now(UTC) - last).total_seconds()) < 60.0


def test_operation_power_increment_move_and_halt(page: Page, watcher: Watcher) -> None:
    page.keyboard.press("2")
    ready_to_jog(page)
    page.get_by_role("button", name="incremental").click()
    start = watcher.look()["pos_ref_deg"]
    page.get_by_role("button", name="+1.00°").click()
    watcher.until(lambda tags: tags["at_rest"] and tags["pos_ref_deg"] > start + 0.5)
    assert watcher.tags["pos_ref_deg"] == pytest.approx(start + 1.0, abs=1e-4)  # six decimals are sent
    page.get_by_label("Target").fill("179,5")
    page.get_by_role("button", name="Move to 179.50°").click()
    watcher.until(lambda tags: tags["axis_state"] == "discrete_motion" and tags["vel_ref_deg_s"] > 0.1)
    expect(page.locator(".travel .target")).to_be_visible()
    page.get_by_role("button", name="Halt").click()
    watcher.until(lambda tags: tags["at_rest"])
    assert watcher.tags["pos_ref_deg"] < start + 10.0


def test_a_move_that_cannot_be_is_not_offered(page: Page) -> None:
    page.keyboard.press("2")
    ready_to_jog(page)
    button = page.locator(".move form > button").first
    for typed, why in (
        ("181", "It would be refused: see below."),
        ("1e3", "Type an angle."),
        ("", "Type an angle."),
    ):
        page.get_by_label("Target").fill(typed)
        expect(button).to_be_disabled()
        expect(button).to_have_attribute("title", why)


def test_settings_are_shown_changed_and_held_to_their_limits(page: Page, watcher: Watcher) -> None:
    page.keyboard.press("3")
    take_control(page)
    speed = page.locator("form.setting").filter(has=page.locator("#speed_setting_deg_s"))
    speed.get_by_role("textbox").fill("0.15")
    speed.get_by_role("button", name="Set").click()
    expect(page.locator("output[data-tag=speed_setting_deg_s]")).to_contain_text("0.150 r/min (0.900 °/s)")
    assert watcher.until(lambda tags: tags["speed_setting_deg_s"] == 0.9)
    speed.get_by_role("textbox").fill("0.05")
    expect(speed.get_by_role("button", name="Set")).to_be_disabled()
    expect(speed.get_by_text("Outside the allowed range.")).to_be_visible()
    speed.get_by_role("textbox").fill("0.1")
    speed.get_by_role("textbox").press("Enter")
    watcher.until(lambda tags: tags["speed_setting_deg_s"] == 0.6)


def test_alarms_first_out_acknowledge_and_reset(page: Page, watcher: Watcher) -> None:
    take_control(page)
    page.get_by_role("button", name="Quick stop").click()
    expect(page.get_by_test_id("alarm")).to_contain_text("INT-06")
    expect(page.locator(".overview .alarm [data-tag=axis_state]")).to_have_text("Error stop")
    page.keyboard.press("4")
    active = page.get_by_role("table", name="Active alarms")
    expect(active).to_contain_text("came first")
    expect(page.get_by_label("The chosen alarm")).to_contain_text("What to do")
    page.get_by_role("button", name="Acknowledge").click()
    expect(active).to_contain_text("service")
    watcher.until(lambda tags: tags["at_rest"] and tags["power_phase"] == "off")
    page.get_by_role("button", name="Reset").click()
    expect(active.locator("tbody")).to_have_text("none")
    expect(page.get_by_role("table", name="History")).to_contain_text("INT-06")


def test_diagnosis_drive_interlocks_timing_recordings_and_tags(page: Page, watcher: Watcher) -> None:
    page.keyboard.press("5")
    state = watcher.look()["drive_state"]
    expect(page.locator(".diagram .now")).to_have_attribute("data-state", state)
    expect(page.locator(".lamp").filter(has_text="Emergency-stop chain closed")).to_contain_text("yes")
    expect(page.get_by_label("Scan")).to_contain_text("Late, 99 %")
    expect(page.locator("[data-tag=feedback_age_ms]")).to_have_text(re.compile(r"^\d+\.\d ms$"))
    page.get_by_role("button", name="List recordings").click()
    expect(page.locator(".files li").first).to_be_visible()
    page.get_by_text("All tags").click()
    expect(page.get_by_role("row", name=re.compile("^journal_committed "))).to_be_visible()


def test_chinese_dark_and_back_after_a_reload(page: Page) -> None:
    page.get_by_role("button", name="中文").click()
    expect(page.locator("#tab-operation")).to_have_text("操作")
    expect(page.locator("html")).to_have_attribute("lang", "zh-CN")
    person_key(page, "深色")
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")
    page.reload()
    expect(page.locator("#tab-alarms")).to_have_text("报警")
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")


def test_keyboard_alone_reaches_every_area_and_every_control_has_a_name(page: Page) -> None:
    page.locator("#tab-display").focus()
    for area in [*AREAS[1:], AREAS[0]]:
        page.keyboard.press("ArrowRight")
        expect(page.locator(f"#tab-{area}")).to_be_focused()
        expect(page.locator(f"[data-area={area}]")).to_be_visible()
        nameless = page.evaluate(
            """() => [...document.querySelectorAll('button, select, input, [role=img], [role=meter]')]
                .filter((e) => !(e.getAttribute('aria-label') || e.innerText?.trim() || e.labels?.length))
                .map((e) => e.outerHTML)"""
        )
        assert nameless == []


def test_every_area_fits_on_1024_by_768(page: Page) -> None:
    for area in AREAS:
        page.locator(f"#tab-{area}").click()
        wide, available = page.evaluate("() => [document.documentElement.scrollWidth, innerWidth]")
        assert wide <= available == SIZE["width"], area
        for name in ("Stop", "Quick stop"):
            box = page.get_by_role("button", name=name, exact=True).bounding_box()
            assert box is not None
            assert box["x"] + box["width"] <= SIZE["width"]
            assert box["y"] + box["height"] <= SIZE["height"]


def test_the_page_says_what_rest_says(page_service: Service, page: Page) -> None:
    """One table: the machine's name and the labels of the modes come from the same tags."""
    cookie = page_service.log_in("viewer")
    code, body, _ = page_service.request("GET", "/api/v1/tags", cookie=cookie)
    assert code == 200
    rows = {row["name"]: row for row in json.loads(body)}
    shown = page.evaluate("() => [...document.querySelectorAll('[data-tag]')].map((e) => e.dataset.tag)")
    assert set(shown) <= set(rows)
