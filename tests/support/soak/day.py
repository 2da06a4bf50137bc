"""A day of treatment, by seed: one person at a page with control, one who looks on."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from playwright.sync_api import Browser, Locator, Page, expect
from playwright.sync_api import Error as PageError

from support.browser import MOVING_DEG_S, SIZE, address, enter, person_key
from support.service_process import PASSWORD, Service
from support.soak.watch import Observer

FARTHEST_DEG = 150.0
"""Never so far out that a jog meets the end of the travel."""
AREAS = ("display", "operation", "settings", "alarms", "diagnosis")
PATIENCE_S = 60.0
SESSION_S = 7 * 3600.0
"""The one who looks on logs in anew after so long: a session ends after 8 h, used or not."""
ARRIVED_DEG = 1e-3
"""The page sends six decimals; a set-point at rest is its target."""


class Day:
    """What both people do. Everything goes through the pages: mouse and keyboard.

    Args:
        trouble: takes what went wrong: `stop` or `stuck`, and a sentence.

    Attributes:
        step: called once at the next chance within a gesture, then None: a step of the clock while the axis moves.
        gestures: how many there were.
    """

    def __init__(
        self,
        browser: Browser,
        service: Service,
        observer: Observer,
        seed: int,
        trouble: Callable[[str, str], None],
    ) -> None:
        self._browser, self._service, self._observer = browser, service, observer
        self._chance, self._trouble = random.Random(seed), trouble
        self.step: Callable[[], None] | None = None
        self.gestures = 0
        self._page = self._come("operator")
        self.onlooker = self._enter("physicist", "display")
        self._login_s = time.monotonic()
        self._devtools = self.onlooker.context.new_cdp_session(self.onlooker)

    def page_kb(self) -> int:
        """Heap of the page of the one who looks on, after its garbage is collected; it is never loaded anew."""
        self._devtools.send("HeapProfiler.collectGarbage")
        return int(self._devtools.send("Runtime.getHeapUsage")["usedSize"]) // 1024

    def look_on(self) -> None:
        """The one who looks on: the page is fresh, goes to another area; the list of recordings keeps the session."""
        page = self.onlooker
        try:
            expect(page.locator("[data-stale=false]")).to_have_count(1, timeout=10_000)
            page.locator("#tab-diagnosis").click()
            self._key(page, "List recordings").click()
            page.locator(f"#tab-{self._chance.choice(AREAS)}").click()
            if time.monotonic() > self._login_s + SESSION_S:
                person_key(page, "Log out")
                self._log_in(page, "physicist")
                self._login_s = time.monotonic()
        except (PageError, AssertionError) as fault:
            self._trouble("stuck", f"the page that looks on: {str(fault)[:400]}")

    def session(self) -> Iterator[str]:
        """One patient: power on, gestures, power off, and what belongs to a day; yields between them."""
        chance = self._chance
        with self._telling("power on"):
            self._power_on()
        yield "power on"
        for _ in range(chance.randrange(4, 10)):
            gesture = chance.choices(
                (self._move, self._jog, self._increment, self._pause, self._halt, self._speed, self._reload),
                (5, 5, 3, 3, 1, 1, 1),
            )[0]
            with self._telling(gesture.__name__.strip("_")):
                gesture()
                self.gestures += 1
            yield gesture.__name__.strip("_")
        with self._telling("power off"):
            self._key(self._page, "Power off").click()
            self._observer.until(lambda tags: tags["power_phase"] == "off")
        yield "power off"
        self._pause()
        between = chance.choices(
            (self._pause, self._change_people, self._test_brake, self._reload), (4, 2, 1, 2)
        )[0]
        with self._telling(between.__name__.strip("_")):
            between()
        yield between.__name__.strip("_")

    @contextmanager
    def _telling(self, what: str) -> Iterator[None]:
        """A page that does not do what it is asked for is told, and opened anew."""
        try:
            yield
        except (PageError, AssertionError, TimeoutError) as fault:
            self._trouble("stuck", f"{what}: {str(fault)[:400]}")
            self._page.context.close()
            self._page = self._come("operator")
            self._take()

    def _enter(self, role: str, area: str) -> Page:
        context = self._browser.new_context(viewport=SIZE, locale="en-GB")  # type: ignore[arg-type]
        context.set_default_timeout(PATIENCE_S * 1e3)
        return enter(context, self._service, role, area)

    def _come(self, user: str) -> Page:
        """Log in by name and password."""
        context = self._browser.new_context(viewport=SIZE, locale="en-GB")  # type: ignore[arg-type]
        context.set_default_timeout(PATIENCE_S * 1e3)
        page = context.new_page()
        page.goto(f"{address(self._service)}#operation")
        self._log_in(page, user)
        return page

    @staticmethod
    def _log_in(page: Page, user: str) -> None:
        page.get_by_label("User").fill(user)
        page.get_by_label("Password").fill(PASSWORD)
        page.get_by_role("button", name="Log in").click()
        page.locator("[data-stale=false]").wait_for()
        page.locator("#tab-operation").click()

    @staticmethod
    def _key(page: Page, name: str) -> Locator:
        return page.get_by_role("button", name=name, exact=True)

    def _take(self) -> None:
        give = self._key(self._page, "Give back")
        if not give.count():
            self._key(self._page, "Take control").click()
            give.wait_for()

    def _power_on(self) -> None:
        self._take()
        if not self._observer.tags["power"]:
            self._key(self._page, "Power on").click()
        self._observer.until(lambda tags: bool(tags["power"]))

    def _mode(self, name: str) -> None:
        if self._observer.tags["mode"] != name:
            self._key(self._page, name).click()
            self._observer.until(lambda tags: tags["mode"] == name)

    def _at_rest(self) -> None:
        self._observer.until(lambda tags: bool(tags["at_rest"]), 2 * PATIENCE_S)

    def _stand(self, seconds: float) -> None:
        """Let time pass; half way the clock is stepped when that is due."""
        time.sleep(seconds / 2)
        if self.step is not None:
            self.step()
            self.step = None
        time.sleep(seconds / 2)

    def _target_deg(self) -> float:
        here = float(self._observer.tags["pos_ref_deg"])
        low, high = max(-FARTHEST_DEG, here - 12.0), min(FARTHEST_DEG, here + 12.0)
        target = round(self._chance.uniform(low, high), 2)
        return target if abs(target - here) > 1.0 else round(here + (2.0 if here < 0.0 else -2.0), 2)

    def _start_move(self) -> float:
        """Type an angle and press the button; it moves."""
        target = self._target_deg()
        self._page.get_by_label("Target").fill(f"{target:.2f}")
        self._page.locator(".move form > button").first.click()
        self._observer.until(lambda tags: abs(tags["vel_ref_deg_s"]) > MOVING_DEG_S)
        return target

    def _move(self) -> None:
        begin_s = time.monotonic()
        target = self._start_move()
        self._stand(2.0)
        self._at_rest()
        # The picture in which rest began is in the history: a move that was stopped on the way ends elsewhere.
        stood = self._observer.tags["pos_ref_deg"]
        if abs(stood - target) > ARRIVED_DEG:
            took_s = time.monotonic() - begin_s
            self._trouble("stop", f"a move to {target} deg ended at {stood:.4f} deg after {took_s:.1f} s")

    def _halt(self) -> None:
        self._start_move()
        self._stand(1.0)
        self._key(self._page, "Halt").click()
        self._at_rest()

    def _jog(self) -> None:
        """Hold a key; the set-point moves until it is let go."""
        page = self._page
        self._mode("continuous")
        key = "forward" if self._observer.tags["pos_ref_deg"] < 0.0 else "reverse"
        page.locator(f"[data-hold={key}]:enabled").hover()
        page.mouse.down()
        try:
            self._observer.until(lambda tags: abs(tags["vel_ref_deg_s"]) > MOVING_DEG_S)
            begin_s = time.monotonic()
            self._stand(self._chance.uniform(1.0, 6.0))
            held = self._observer.since(begin_s)
        finally:
            page.mouse.up()
        slowest = min(abs(each.vel_ref_deg_s) for each in held)
        if slowest <= MOVING_DEG_S / 2:
            self._trouble("stop", f"a held key: {slowest:.4f} deg/s among {len(held)} pictures")
        self._at_rest()

    def _increment(self) -> None:
        self._mode("incremental")
        begin = self._observer.tags["pos_ref_deg"]
        sign = "+" if begin < 0.0 else "\N{MINUS SIGN}"
        step_deg = float(self._observer.tags["increment_deg"])
        self._key(self._page, f"{sign}{step_deg:.2f}°").click()
        wanted = begin + (step_deg if begin < 0.0 else -step_deg)
        self._observer.until(lambda tags: tags["at_rest"] and abs(tags["pos_ref_deg"] - begin) > step_deg / 2)
        stood = self._observer.tags["pos_ref_deg"]
        if abs(stood - wanted) > ARRIVED_DEG:
            self._trouble("stop", f"an increment to {wanted:.4f} deg ended at {stood:.4f} deg")

    def _pause(self) -> None:
        """Stand: at rest with power on as off."""
        self._stand(self._chance.uniform(3.0, 20.0))

    def _speed(self) -> None:
        self._page.locator("#tab-settings").click()
        form = self._page.locator("form.setting").filter(has=self._page.locator("#speed_setting_deg_s"))
        # The page offers no setting that is in force already.
        in_force = self._observer.tags["speed_setting_deg_s"]
        rpm = self._chance.choice(
            [r for r in ("0.1", "0.15", "0.125") if abs(6.0 * float(r) - in_force) > 1e-6]
        )
        form.get_by_role("textbox").fill(rpm)
        form.get_by_role("button", name="Set").click()
        self._observer.until(lambda tags: abs(tags["speed_setting_deg_s"] - 6.0 * float(rpm)) < 1e-6)
        self._page.locator("#tab-operation").click()

    def _reload(self) -> None:
        """Control is lost with the page, and taken again."""
        self._page.reload()
        self._page.locator("[data-stale=false]").wait_for()
        self._page.locator("#tab-operation").click()
        self._take()

    def _change_people(self) -> None:
        person_key(self._page, "Log out")
        self._log_in(self._page, "operator")

    def _test_brake(self) -> None:
        """The physicist comes, tests, and goes."""
        page = self._page
        tests = self._observer.tags["brake_tests"]
        person_key(page, "Log out")
        self._log_in(page, "physicist")
        self._take()
        self._key(page, "1 · Arm test").click()
        self._key(page, "2 · Execute test").click()
        self._observer.until(lambda tags: tags["brake_tests"] > tests and tags["power_phase"] == "off")
        if (result := self._observer.tags["brake_test_result"]) != "passed":
            self._trouble("stop", f"a brake test: {result}")
        person_key(page, "Log out")
        self._log_in(page, "operator")
