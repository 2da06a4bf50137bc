"""Several people at once, their roles, and pages of strangers."""

from __future__ import annotations

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from gantryctl.gateway.access import COOKIE
from gantryctl.service.protocol.roles import Action, Role, may
from support.browser import SIZE, enter, press_until_moving, ready_to_jog
from support.service_process import Page as Watcher
from support.service_process import Service


def test_a_foreign_page_gets_no_connection(page_service: Service) -> None:
    """Its browser sends the cookie along; `Origin` tells where it comes from."""
    cookie = page_service.log_in("operator")
    with pytest.raises(InvalidStatus) as refused:
        connect(
            f"ws://{page_service.address}/api/v1/socket",
            origin="http://evil.example",
            additional_headers={"Cookie": f"{COOKIE}={cookie}"},
        )
    assert refused.value.response.status_code == 403


def test_one_has_control_the_other_sees_who_and_can_stop(
    context: BrowserContext, browser: Browser, page_service: Service, watcher: Watcher
) -> None:
    first = enter(context, page_service, "operator")
    ready_to_jog(first)
    with browser.new_context(viewport=SIZE, locale="en-GB") as other:
        second = enter(other, page_service, "physicist")
        expect(second.get_by_test_id("control")).to_contain_text("operator")
        expect(second.locator("[data-hold=forward]")).to_be_disabled()
        press_until_moving(first, watcher)
        expect(second.get_by_role("button", name="Take over")).to_be_disabled()  # only at standstill
        second.get_by_role("button", name="Stop", exact=True).click()
        watcher.until(lambda tags: tags["at_rest"])
        expect(first.locator("[data-hold=forward]")).to_have_attribute("aria-pressed", "false")
        first.mouse.up()
        second.get_by_role("button", name="Take over").click()
        expect(second.get_by_test_id("control")).to_contain_text("you")
        expect(first.get_by_test_id("control")).to_contain_text("physicist")
        expect(first.locator("[data-hold=forward]")).to_be_disabled()
        press_until_moving(second, watcher)
        second.mouse.up()


def offered(page: Page) -> set[Action]:
    """Actions that the page offers to somebody who has control at standstill with the power on."""
    found = set()
    page.locator("#tab-operation").click()
    page.get_by_label("Target").fill("1")
    for action, name in {
        Action.POWER: "Power off",
        Action.MODE: "incremental",
        Action.RESET: "Reset",
    }.items():
        if page.get_by_role("button", name=name, exact=True).is_enabled():
            found.add(action)
    if page.locator("[data-hold=forward]").is_enabled():
        found.add(Action.JOG)
    if page.get_by_role("button", name="Move to 1.00°").is_enabled():
        found.add(Action.MOVE)
    page.locator("#tab-settings").click()
    for action, tag in {
        Action.SPEED: "speed_setting_deg_s",
        Action.INCREMENT: "increment_deg",
        Action.OVERRIDE: "override_percent",
        Action.ACCELERATION: "acc_setting_deg_s2",
    }.items():
        setting = page.locator("form.setting").filter(has=page.locator(f"#{tag}"))
        setting.get_by_role("textbox").fill("0.3")
        if setting.get_by_role("button").is_enabled():
            found.add(action)
    return found


QUICK = (Role.VIEWER, Role.PHYSICIST)


@pytest.mark.parametrize(
    "role", [role if role in QUICK else pytest.param(role, marks=pytest.mark.slow) for role in Role]
)
def test_each_role_is_offered_what_the_table_allows_and_no_more(
    role: Role, context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, str(role))
    if may(role, Action.AUTHORITY):
        ready_to_jog(page)
    else:
        expect(page.get_by_role("button", name="Take control")).to_be_disabled()
    expect(page.get_by_role("button", name="Stop", exact=True)).to_be_enabled()
    asked = {
        Action.POWER, Action.MODE, Action.RESET, Action.JOG, Action.MOVE, Action.SPEED, Action.INCREMENT,
        Action.OVERRIDE, Action.ACCELERATION,
    }  # fmt: skip
    wanted = {action for action in asked if may(role, action)}
    if offered(page) != wanted:  # a busy computer shows stale data for a moment
        page.locator("[data-stale=false]").wait_for()
        assert offered(page) == wanted
