"""Hold-to-run under chance: random presses, ends and failures of a slow network. Every one of them ends at rest.

On a quiet machine: `pytest -m slow tests/system/page/test_gestures.py`; the figures go to `docs/evidence`.
"""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
from playwright.sync_api import Browser, BrowserContext, Page

from support.browser import SIZE, Proxy, enter, farthest_deg, look_on, press_until_moving, ready_to_jog
from support.service_process import Page as Watcher
from support.service_process import Service

pytestmark = pytest.mark.slow
SEQUENCES = 300
FREEZES = 10
LAGS_S = (0.0, 0.005, 0.010, 0.020, 0.040)
"""One way: up to 80 ms there and back, where every press is taken."""
SLOWEST_STOP_S = 0.25 + 0.05 + 0.7
"""Lease, one frame until it is seen, and the jog-release ramp from 0.6 deg/s with its jerk (0.62 s, `stops`)."""
Evidence = Callable[[str, dict[str, object]], None]


def _synthetic(name: str) -> Callable[[Page], object]:
    return lambda page: page.evaluate(f"() => {{ dispatchEvent(new Event('{name}')) }}")


def _key_event(name: str) -> Callable[[Page], object]:
    return lambda page: page.locator("[data-hold][aria-pressed=true]").dispatch_event(name)


ENDINGS: dict[str, Callable[[Page], object]] = {
    "button up": lambda page: page.mouse.up(),
    "drawn away, button up": lambda page: (page.mouse.move(5, 700), page.mouse.up()),
    "other key": lambda page: page.locator("[data-hold][aria-pressed=false]").dispatch_event(
        "pointerdown", {"button": 0}
    ),
    "Esc": lambda page: page.keyboard.press("Escape"),
    "blur": _synthetic("blur"),
    "pagehide": _synthetic("pagehide"),
    "pointercancel": _key_event("pointercancel"),
    "lost capture": _key_event("lostpointercapture"),
    "other area": lambda page: page.keyboard.press("4"),
    "reload": lambda page: page.reload(),
    "closed": lambda page: page.close(),
}


class Person:
    """Somebody at the page; comes back after closing it."""

    def __init__(self, browser: Browser, service: Service, watcher: Watcher, proxy: Proxy) -> None:
        self._browser, self._service = browser, service
        self._watcher, self._proxy = watcher, proxy
        self.context: BrowserContext | None = None

    def come(self) -> Page:
        """A page that is ready to jog, at rest."""
        if self.context is not None:
            self.context.close()
        self._watcher.until(lambda tags: tags["at_rest"] and not tags["authority_user"])
        self.context = self._browser.new_context(viewport=SIZE, locale="en-GB")
        page = enter(self.context, self._service, "operator", frozen=True)
        ready_to_jog(page)
        return page

    def ready(self, page: Page | None) -> Page:
        """The same page when it still can."""
        if page is None or page.is_closed() or not page.locator("[data-hold=forward]:enabled").count():
            return self.come()
        return page


def test_every_random_gesture_ends_at_rest(
    browser: Browser, page_service: Service, watcher: Watcher, proxy: Proxy, evidence: Evidence
) -> None:
    chance = random.Random(20261121)
    person = Person(browser, page_service, watcher, proxy)
    page: Page | None = None
    worst_s, lost, counts = 0.0, 0, dict.fromkeys([*ENDINGS, "freeze"], 0)
    lags = dict.fromkeys(LAGS_S, 0)
    for number in range(SEQUENCES):
        proxy.lag_s = chance.choice(LAGS_S)
        lags[proxy.lag_s] += 1
        page = person.ready(page)
        ending = chance.choice(list(counts))
        counts[ending] += 1
        # Back and forth: 300 presses one way would use the cable up.
        sign = 1.0 if watcher.look()["pos_ref_deg"] < 0.0 else -1.0
        lost += press_until_moving(page, watcher, "forward" if sign > 0.0 else "reverse")
        look_on(watcher, chance.randrange(6))
        if ending == "freeze":
            farthest = farthest_deg(watcher, sign=sign)
            proxy.frozen_for(chance.uniform(0.4, 1.2))
        else:
            ENDINGS[ending](page)
            farthest = farthest_deg(watcher, sign=sign)
        began_s = watcher.tags["time_s"]
        watcher.until(lambda tags: tags["at_rest"])
        assert sign * watcher.tags["pos_ref_deg"] <= sign * farthest, (number, ending)
        worst_s = max(worst_s, watcher.tags["time_s"] - began_s)
        assert set(look_on(watcher, 10)) == {0.0}, (number, ending)
        if not page.is_closed():
            page.locator("[data-stale=false]").wait_for()
            page.mouse.up()
    proxy.lag_s = 0.0
    if person.context is not None:
        person.context.close()
    evidence(
        "page_gestures",
        {
            "sequences": SEQUENCES,
            "round_trips_ms": {f"{2e3 * lag_s:.0f}": n for lag_s, n in lags.items()},
            "endings": counts,
            "presses_not_taken": lost,
            "longest_stop_s": round(worst_s, 3),
        },
    )
    assert worst_s <= SLOWEST_STOP_S


def test_how_short_a_freeze_it_survives(
    context: BrowserContext, page_service: Service, watcher: Watcher, proxy: Proxy, evidence: Evidence
) -> None:
    """Ten of each length at 0, 20 and 40 ms there and back: 60 and 120 ms stop nothing, 400 ms always does, once.

    200 ms may stop it: the first renewals after it name frames of just that age.
    """
    found: dict[str, dict[str, int]] = {}
    page = enter(context, page_service, "operator", frozen=True)
    ready_to_jog(page)
    for lag_s in (0.0, 0.010, 0.020):
        proxy.lag_s = lag_s
        stops = found[f"{2e3 * lag_s:.0f}"] = dict.fromkeys(("60", "120", "200", "400"), 0)
        for frozen_ms in stops:
            for _ in range(FREEZES):
                held = page.locator("[data-hold][aria-pressed=true]")
                if not held.count() or abs(watcher.tags["pos_ref_deg"]) > 170.0:
                    page.mouse.up()
                    watcher.until(lambda tags: tags["at_rest"])
                    press_until_moving(
                        page, watcher, "reverse" if watcher.tags["pos_ref_deg"] > 0.0 else "forward"
                    )
                proxy.frozen_for(float(frozen_ms) / 1000)
                speeds = [abs(speed) for speed in look_on(watcher, 12 + int(frozen_ms) // 50)]
                stops[frozen_ms] += min(speeds) == 0.0
                # At rest it stays so.
                assert 0.0 not in speeds or set(speeds[speeds.index(0.0) :]) == {0.0}
    page.mouse.up()
    proxy.lag_s = 0.0
    evidence("page_freezes", {"freezes_each": FREEZES, "stops_by_round_trip_and_freeze_ms": found})
    for stops in found.values():
        assert (stops["60"], stops["120"], stops["400"]) == (0, 0, FREEZES)
