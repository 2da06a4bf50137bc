"""Hold-to-run in a browser behind a slow network: what is moved as long as it is quick, and refused in words when not.

Every kind of network, in virtual time: `tests/unit/service/test_slow_network.py`; 300 gestures: `test_gestures.py`.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from support.browser import (
    SIZE,
    Proxy,
    enter,
    farthest_deg,
    look_on,
    press,
    press_until_moving,
    ready_to_jog,
    take_control,
)
from support.service_process import Page as Watcher
from support.service_process import Service

READY_TO_JOG = {
    "en-GB": ("Take control", "Give back", "Power on", "continuous"),
    "zh-CN": ("取得控制权", "交还", "上电", "连续"),
}
TOO_SLOW = {
    "en-GB": "limit 150 ms for a held key: use a nearer screen",
    "zh-CN": "按住运行的限值为 150 ms：请使用更近的屏幕",
}


@pytest.fixture
def slow(proxy: Proxy) -> Iterator[Proxy]:
    yield proxy
    proxy.lag_s = 0.0


def test_with_40_ms_there_and_back_a_key_moves_and_stops(
    browser: Browser, page_service: Service, watcher: Watcher, slow: Proxy
) -> None:
    slow.lag_s = 0.020
    with browser.new_context(viewport=SIZE, locale="en-GB") as context:
        page = enter(context, page_service, "operator", frozen=True)
        ready_to_jog(page)
        press_until_moving(page, watcher)
        shown = page.locator("[data-tag=round_trip_ms]").inner_text()
        assert float(shown.split()[0]) >= 40.0
        slow.freeze()
        farthest = farthest_deg(watcher)
        watcher.until(lambda tags: tags["at_rest"])
        assert watcher.tags["pos_ref_deg"] <= farthest
        slow.thaw()
        assert set(look_on(watcher, 20)) == {0.0}
        page.mouse.up()


@pytest.mark.parametrize("language", ["en-GB", pytest.param("zh-CN", marks=pytest.mark.slow)])
def test_with_200_ms_a_press_is_refused_and_the_page_says_why_and_what_to_do(
    language: str, browser: Browser, page_service: Service, watcher: Watcher, slow: Proxy
) -> None:
    take, give, power, continuous = READY_TO_JOG[language]
    slow.lag_s = 0.100
    with browser.new_context(viewport=SIZE, locale=language) as context:
        page = enter(context, page_service, "operator", frozen=True)
        take_control(page, take, give)
        if not watcher.tags["power"]:
            page.get_by_role("button", name=power).click()
            watcher.until(lambda tags: tags["power"])
        page.get_by_role("button", name=continuous, exact=True).click()
        page.locator("[data-hold=forward]:enabled").wait_for()
        press(page)
        expect(page.get_by_role("status").filter(has_text=TOO_SLOW[language])).to_have_count(
            2
        )  # at the key, and below
        assert set(look_on(watcher, 20)) == {0.0}
        page.mouse.up()
