"""Hold-to-run in a real browser: it moves while a key is held, and stops whatever ends that.

Speed and angles are the controller's own, seen by a second connection that does not pass through the browser.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, Playwright, expect

from support.browser import (
    Proxy,
    browser_to_kill,
    enter,
    farthest_deg,
    kill,
    look_on,
    press_until_moving,
    ready_to_jog,
    until_moving,
)
from support.service_process import Page as Watcher
from support.service_process import Service

FRAMES_AFTER = 20
"""A second of status frames: longer than any lease or reconnection."""
FRAMES_OF_A_LEASE = 8


def at_rest_before(watcher: Watcher, farthest: float) -> None:
    """It comes to rest no farther than allowed, and does not start again."""
    watcher.until(lambda tags: tags["at_rest"])
    assert watcher.tags["pos_ref_deg"] <= farthest
    assert set(look_on(watcher, FRAMES_AFTER)) == {0.0}


def jogging(context: BrowserContext, service: Service, watcher: Watcher) -> Page:
    page = enter(context, service, "operator")
    ready_to_jog(page)
    press_until_moving(page, watcher)
    return page


def test_it_moves_while_held_with_a_lease_that_can_be_seen(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = jogging(context, page_service, watcher)
    key = page.locator("[data-hold=forward]")
    expect(key).to_have_attribute("aria-pressed", "true")
    expect(key.locator(".lease")).to_contain_text(
        "stops by itself in 2"
    )  # 200 to 250 ms: renewed every 30 ms
    page.mouse.up()
    at_rest_before(watcher, farthest_deg(watcher, lease_s=0.0))
    expect(page.get_by_text("Released.")).to_be_visible()


def test_space_bar_is_a_key_too(context: BrowserContext, page_service: Service, watcher: Watcher) -> None:
    page = enter(context, page_service, "operator")
    ready_to_jog(page)
    page.locator("[data-hold=reverse]").focus()
    page.keyboard.down(" ")
    watcher.until(lambda tags: tags["vel_ref_deg_s"] < -0.05)
    page.keyboard.up(" ")
    at_rest_before(watcher, watcher.tags["pos_ref_deg"])


ENDINGS: dict[str, Callable[[Page], object]] = {
    "both keys": lambda page: page.locator("[data-hold=reverse]").dispatch_event(
        "pointerdown", {"button": 0}
    ),
    "pointercancel": lambda page: page.locator("[data-hold=forward]").dispatch_event("pointercancel"),
    "lost capture": lambda page: page.locator("[data-hold=forward]").dispatch_event("lostpointercapture"),
    "window loses focus": lambda page: page.evaluate("() => { dispatchEvent(new Event('blur')) }"),
    "page hidden": lambda page: page.evaluate(
        "() => { document.dispatchEvent(new Event('visibilitychange')) }"
    ),
    "Esc": lambda page: page.keyboard.press("Escape"),
    "Stop button": lambda page: page.locator(".stopkey").dispatch_event("click"),
    "another area": lambda page: page.keyboard.press("1"),
}


def test_it_stops_however_the_press_ends(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "operator")
    ready_to_jog(page)
    for name, end in ENDINGS.items():
        press_until_moving(page, watcher)
        end(page)
        farthest = farthest_deg(watcher)
        watcher.until(lambda tags: tags["at_rest"])
        assert watcher.tags["pos_ref_deg"] <= farthest, name
        assert set(look_on(watcher, FRAMES_OF_A_LEASE)) == {0.0}, name
        page.mouse.up()


@pytest.mark.parametrize("leave", ["close", pytest.param("elsewhere", marks=pytest.mark.slow)])
def test_it_stops_when_the_page_is_left(
    leave: str, context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = jogging(context, page_service, watcher)
    page.close() if leave == "close" else page.goto("about:blank")
    at_rest_before(watcher, farthest_deg(watcher))


def test_it_stops_when_the_browser_is_killed(
    playwright: Playwright, page_service: Service, watcher: Watcher, tmp_path: Path
) -> None:
    with browser_to_kill(playwright, tmp_path) as context:
        jogging(context, page_service, watcher)
        kill(tmp_path)
        at_rest_before(watcher, farthest_deg(watcher))


def frozen_page(context: BrowserContext, service: Service) -> Page:
    page = enter(context, service, "operator", frozen=True)
    ready_to_jog(page)
    return page


def test_a_short_freeze_of_the_network_does_not_stop_it(
    context: BrowserContext, page_service: Service, watcher: Watcher, proxy: Proxy
) -> None:
    """60 to 200 ms, ten times each: test_gestures.py, on a quiet computer."""
    page = frozen_page(context, page_service)
    # Here a page may have waited for a processor when the freeze comes, and both together are longer than the lease.
    for _ in range(3):
        press_until_moving(page, watcher)
        proxy.frozen_for(0.12)
        slowest_deg_s = min(look_on(watcher, FRAMES_AFTER))
        page.mouse.up()
        if slowest_deg_s > 0.0:
            break
        watcher.until(lambda tags: tags["at_rest"])
        page.locator("[data-hold=forward]:enabled").wait_for()
    assert slowest_deg_s > 0.0


@pytest.mark.parametrize(
    "frozen_ms", [pytest.param(400, marks=pytest.mark.slow), 800, pytest.param(1200, marks=pytest.mark.slow)]
)
def test_a_long_freeze_stops_it_once_and_for_good(
    frozen_ms: int, context: BrowserContext, page_service: Service, watcher: Watcher, proxy: Proxy
) -> None:
    """The button is still down after the thaw: only a new press may move the axis again."""
    page = frozen_page(context, page_service)
    press_until_moving(page, watcher)
    farthest = farthest_deg(watcher)
    proxy.frozen_for(frozen_ms / 1000)
    at_rest_before(watcher, farthest)
    expect(page.locator("[data-hold=forward]")).to_have_attribute("aria-pressed", "false")
    page.locator("[data-stale=false]").wait_for()
    page.mouse.up()
    press_until_moving(page, watcher)


@pytest.mark.parametrize(
    "frozen_ms", [pytest.param(120, marks=pytest.mark.slow), 400, pytest.param(1000, marks=pytest.mark.slow)]
)
def test_press_and_release_within_a_freeze_move_nothing(
    frozen_ms: int, context: BrowserContext, page_service: Service, watcher: Watcher, proxy: Proxy
) -> None:
    page = frozen_page(context, page_service)
    page.locator("[data-hold=forward]").hover()
    before = watcher.look()["pos_ref_deg"]
    proxy.freeze()
    page.mouse.down()
    page.mouse.up()
    proxy.frozen_for(frozen_ms / 1000)
    assert set(look_on(watcher, FRAMES_AFTER + frozen_ms // 50)) == {0.0}
    assert watcher.tags["pos_ref_deg"] == before


def test_stale_data_are_shown_stale_and_nothing_that_moves_is_offered(
    context: BrowserContext, page_service: Service, watcher: Watcher, proxy: Proxy
) -> None:
    page = frozen_page(context, page_service)
    proxy.freeze()
    # 500 ms for the page, the rest for a machine that runs other tests beside it.
    expect(page.locator("[data-stale=true]")).to_be_attached(timeout=1500)
    expect(page.get_by_test_id("stale")).to_contain_text("STALE DATA")
    moving = page.locator("button[data-motion]")
    assert moving.count() >= 10
    assert all(moving.nth(i).is_disabled() for i in range(moving.count()))
    expect(page.locator(".stopkey")).to_be_enabled()
    proxy.thaw()
    page.locator("[data-stale=false]").wait_for()
    expect(page.locator("[data-hold=forward]")).to_be_enabled()


def test_data_that_arrive_late_are_stale_though_they_arrive(
    context: BrowserContext, page_service: Service, watcher: Watcher, proxy: Proxy
) -> None:
    """A lag of 700 ms at the full rate of frames: their own numbers tell, and it does not wear off."""
    page = frozen_page(context, page_service)
    proxy.lag_s = 0.7
    try:
        page.locator("[data-stale=true]").wait_for()
        look_on(watcher, 3 * FRAMES_AFTER)
        expect(page.locator("[data-stale=true]")).to_be_attached()
        expect(page.get_by_test_id("connection")).to_have_text("Connected, data stale")
        expect(page.locator("[data-hold=forward]")).to_be_disabled()
    finally:
        proxy.lag_s = 0.0
    page.locator("[data-stale=false]").wait_for()


@pytest.mark.parametrize("end", ["touchEnd", pytest.param("touchCancel", marks=pytest.mark.slow)])
def test_a_finger_is_a_key_too(
    end: str, context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    """A real touch of the browser; `touchCancel` is what a system gesture does to it."""
    page = enter(context, page_service, "operator")
    ready_to_jog(page)
    box = page.locator("[data-hold=forward]").bounding_box()
    assert box is not None
    finger = {"x": box["x"] + 20, "y": box["y"] + 20}
    browser = context.new_cdp_session(page)
    browser.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [finger]})
    until_moving(watcher)
    browser.send("Input.dispatchTouchEvent", {"type": end, "touchPoints": []})
    at_rest_before(watcher, farthest_deg(watcher))
