"""Brake test and reset of what is locked from the page: armed, then executed, within ten seconds."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Locator, Page, expect

from gantryctl.machine import configs_folder
from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import Users
from support.browser import SIZE, enter, take_control
from support.service_process import PASSWORD, Service, add_users
from support.service_process import Page as Watcher

TEST_MS = 30_000
"""A test takes 7 s, more on a computer that runs other tests beside it."""


def ready(page: Page, watcher: Watcher) -> None:
    """In control with the power off."""
    take_control(page)
    page.get_by_role("button", name="Power off").click()
    watcher.until(lambda tags: tags["power_phase"] == "off" and tags["authority_user"] != "")


def key(page: Page, name: str) -> Locator:
    return page.get_by_role("button", name=name, exact=True)


def begin(page: Page) -> None:
    key(page, "1 · Arm test").click()
    key(page, "2 · Execute test").click()
    expect(page.get_by_text("Stop ends the test. The brake stays closed.")).to_be_visible()


def panel(page: Page) -> Locator:
    return page.get_by_role("region", name="Brake test")


def test_by_keyboard_it_is_armed_executed_and_passes(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "physicist")
    ready(page, watcher)
    expect(key(page, "2 · Execute test")).to_be_disabled()
    key(page, "1 · Arm test").focus()
    page.keyboard.press("Enter")
    expect(page.get_by_text("Armed by physicist.")).to_be_visible()
    left = page.get_by_role("meter", name="Armed: time left")
    expect(left).to_have_attribute("aria-valuenow", re.compile(r"^[89]\.\d+$"))
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    phase = panel(page).get_by_role("progressbar", name="Under way")
    for words in ("torque rises, +", "brake holds, +", "torque rises, −", "brake holds, −"):
        expect(phase).to_have_attribute("aria-valuetext", words, timeout=TEST_MS)
    expect(key(page, "1 · Arm test")).to_be_disabled()
    expect(page.locator("[data-tag=brake_test_result]")).to_contain_text("passed", timeout=TEST_MS)
    watcher.until(lambda tags: tags["brake_test_result"] == "passed" and tags["power_phase"] == "off")
    level = watcher.tags["brake_test_level_nm"]
    held = panel(page).locator("dd").first.inner_text().replace("−", "-")
    plus, minus = (float(number) for number in re.findall(r"[-+]\d+", held))
    assert (plus, minus) == (
        pytest.approx(level, rel=0.05),
        pytest.approx(-level, rel=0.05),
    )  # what counts as held
    expect(page.locator("[data-tag=brake_test_due_at]")).to_have_text(re.compile(r"\d\d/\d\d/\d{4}"))


def test_stop_of_somebody_else_ends_it_and_the_brake_stays_closed(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "service")
    ready(page, watcher)
    begin(page)
    watcher.until(lambda tags: tags["brake_test_torque_nm"] > 10.0)
    watcher.do("stop")  # a viewer
    opened = False
    while watcher.look()["brake_test_phase"] != "idle":
        opened = opened or watcher.tags["brake_open"]
    expect(page.locator("[data-tag=brake_test_result]")).to_contain_text("ended early")
    watcher.until(lambda tags: tags["power_phase"] == "off")
    assert not opened
    assert watcher.tags["torque_act_nm"] == pytest.approx(0.0, abs=0.5)  # the drive is off


def test_it_is_offered_to_no_role_without_the_right(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "operator")
    ready(page, watcher)
    for name in ("1 · Arm test", "2 · Execute test"):
        expect(key(page, name)).to_be_disabled()
        expect(key(page, name)).to_have_attribute("title", "Your role may not do this.")
    assert watcher.ask("arm", action="brake_test")["code"] == "SEC-01"  # a viewer, past the page


@pytest.mark.slow
def test_what_is_armed_is_gone_after_ten_seconds(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "physicist")
    ready(page, watcher)
    key(page, "1 · Arm test").click()
    expect(key(page, "2 · Execute test")).to_be_enabled()
    watcher.until(lambda tags: tags["armed_action"] == "brake_test")
    watcher.until(lambda tags: tags["armed_action"] == "none")
    expect(key(page, "2 · Execute test")).to_be_disabled()
    expect(key(page, "2 · Execute test")).to_have_attribute("title", "Arm it first.")
    assert watcher.tags["brake_test_phase"] == "idle"


@pytest.fixture
def worn(tmp_path: Path) -> Iterator[Service]:
    """A machine whose brake holds a tenth of its torque, and is to be tested before every power-up by two persons."""
    add_users(tmp_path)
    Users(tmp_path).add("colleague", Role.SERVICE, PASSWORD)
    text = (configs_folder() / "hust_gantry.toml").read_text(encoding="utf-8")
    file = tmp_path / "worn.toml"
    text = text.replace("torque_share = 1.0 ", "torque_share = 0.1 ")
    text = text.replace("test_interval_power_ups = 100 ", "test_interval_power_ups = 1 ")
    file.write_text(text, encoding="utf-8")
    with Service(tmp_path, "--config", str(file), "--second-person") as service:
        yield service


def test_a_worn_brake_is_found_and_two_persons_unlock_it(browser: Browser, worn: Service) -> None:
    with (
        browser.new_context(viewport=SIZE, locale="en-GB") as one,
        browser.new_context(locale="en-GB") as other,
    ):
        with worn.page("viewer", queue=None) as watcher:
            first, second = enter(one, worn, "service"), enter(other, worn, "colleague")
            ready(first, watcher)
            expect(key(first, "2 · Execute test")).to_have_attribute(
                "title", "Another person must arm it first."
            )
            key(first, "1 · Arm test").click()
            expect(panel(first)).to_contain_text("You armed it: another person must execute it.")
            key(second, "1 · Arm test").click()
            expect(panel(first)).to_contain_text("Armed by colleague.")
            key(first, "2 · Execute test").click()
            expect(first.locator("[data-tag=brake_test_result]")).to_contain_text("FAILED", timeout=TEST_MS)
            expect(first.get_by_test_id("alarm")).to_contain_text("BRK-08")
            watcher.until(lambda tags: tags["power_phase"] == "off" and tags["reset_locked"])
        expect(key(first, "Power on")).to_be_disabled()
        expect(first.locator("#power-why")).to_contain_text("BRK-08 is active")
        with worn.page("admin") as nobody:
            assert nobody.ask("arm", action="reset_locked")["code"] == "SEC-01"
        first.locator("#tab-alarms").click()
        expect(first.get_by_text("Locked: only the service role may reset it.")).to_be_visible()
        expect(key(first, "2 · Execute reset")).to_be_disabled()
        key(second, "1 · Arm reset").click()
        key(first, "2 · Execute reset").click()
        expect(first.get_by_role("table", name="Active alarms").locator("tbody")).to_have_text("none")
        overdue_is_slow(first)


def overdue_is_slow(page: Page) -> None:
    """After a power-up without a test: abnormal on the page, and nothing fast is offered."""
    page.locator("#tab-operation").click()
    key(page, "Power on").click()
    page.get_by_text("Power: on").wait_for()
    expect(page.locator("[data-tag=brake_test_due_at]")).to_contain_text("OVERDUE")
    page.locator("#tab-settings").click()
    setting = page.locator("form.setting").filter(has=page.locator("#speed_setting_deg_s"))
    setting.get_by_role("textbox").fill("0.3")
    setting.get_by_role("button", name="Set").click()
    expect(page.locator("output[data-tag=speed_setting_deg_s]")).to_contain_text("0.300")
    page.locator("#tab-operation").click()
    page.get_by_label("Target").fill("2")
    move = page.get_by_role("button", name="Move to 2.00°")
    expect(move).to_have_attribute("title", "Brake test overdue: 1 °/s at most until one has passed.")
    expect(move).to_be_disabled()
