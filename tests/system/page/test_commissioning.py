"""Commissioning at the page: its panel in every window, the axis handed over, steps begun, motions that are ended."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, Locator, Page, Playwright, expect

from gantryctl.commissioning.run import STEPS
from gantryctl.machine import configs_folder
from gantryctl.service.clients.link import console_link
from support.browser import CHROMIUM, FLAGS, SIZE, enter
from support.commissioning_steps import STILL, do_before
from support.page_geometry import faults_of_layout, grey_without_reason, heavy_findings
from support.page_shown import IN_CONTROL, Shown
from support.service_process import Service, add_users

SIZES = ((360, 640), (640, 360), (1024, 768), (1920, 1080))
# Processes take turns, on a busy computer.
TURNS_MS = 60_000
MOVES_DEG_S = 0.02
"""A thirtieth of the lowest speed setting; a drive at rest shows less than 0.001."""

LONG_PROOF = (
    '[brake] owner = "drive": the drive works the brake itself and opens it whenever it is enabled;'
    " 000007FF-00470402-1 shows it by 60FD bit 19, heartbeat_moved_deg 0, process_data_moved_deg 0"
)
HANDED_OVER: dict[str, Any] = {"commissioning_available": True, "commissioning": "waiting"} | IN_CONTROL
PHASES: dict[str, dict[str, Any]] = {
    "none": {"commissioning_available": True},
    "still": HANDED_OVER,
    "moves": HANDED_OVER,
    "running": HANDED_OVER
    | {"commissioning": "running", "commissioning_step": "stops", "commissioning_left_s": 22.0},
    "done": HANDED_OVER,
}


def board(done: int, note: str = "") -> dict[str, Any]:
    """What the service shows when so many of all steps have passed, with the longest proofs."""
    return {
        "machine": "hust_can", "drive": "000007FF-00470402-1", "complete": done == len(STEPS), "note": note,
        "steps": [
            {
                "key": step.key, "title": step.title, "does": step.does, "moves": step.moves,
                "offered": step.required and not step.by_hand, "outcome": "passed" if number < done else "",
                "proof": LONG_PROOF if number < done else "", "to_do": LONG_PROOF if number < done else "",
                "at": "", "by": "",
            }
            for number, step in enumerate(STEPS)
        ],
        "ledger": [], "open": [f"stops_without_commands: {LONG_PROOF}"],
    }  # fmt: skip


def number(key: str) -> int:
    return [step.key for step in STEPS].index(key)


BOARDS = {
    "none": board(0),
    "still": board(0),
    "moves": board(number("turn"), f"step stops stopped by service: {LONG_PROOF}"),
    "running": board(number("stops")),
    "done": board(len(STEPS)),
}


@pytest.fixture(scope="module")
def shown(playwright: Playwright) -> Iterator[Shown]:
    browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
    yield Shown(browser)
    browser.close()


def show(shown: Shown, phase: str, language: str = "en", theme: str = "light") -> Locator:
    """The panel in one phase, on a screen that nothing proves to be at the machine."""
    shown.context.unroute("**/api/v1/commissioning")
    shown.context.route("**/api/v1/commissioning", lambda route: route.fulfill(json=BOARDS[phase]))
    shown.show(PHASES[phase], language, theme)
    shown.go("settings")
    panel = shown.page.get_by_test_id("commissioning")
    if phase != "none":
        panel.locator("tr[data-key=accuracy]").wait_for()
    return panel


def assert_fits(shown: Shown, size: tuple[int, int], where: object) -> None:
    """From top to bottom: the panel is longer than a screen."""
    shown.resize(*size)
    found = list[str]()
    height = int(shown.page.evaluate("document.querySelector('main').scrollHeight"))
    for top in range(0, height, size[1] // 2):
        shown.scroll(top)
        found += faults_of_layout(shown.page)
    assert found == [], where
    assert grey_without_reason(shown.page) == [], where
    shown.scroll(0)


@pytest.mark.parametrize("phase", ["none", "moves"])
def test_the_panel_fits_a_telephone_and_has_no_findings(shown: Shown, phase: str) -> None:
    show(shown, phase)
    assert_fits(shown, SIZES[0], phase)
    assert heavy_findings(shown.page) == []


@pytest.mark.slow
@pytest.mark.parametrize("language", ["en", "zh"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_panel_fits_every_window(shown: Shown, language: str, theme: str) -> None:
    for phase in PHASES:
        show(shown, phase, language, theme)
        for size in SIZES:
            assert_fits(shown, size, (phase, size))
            assert heavy_findings(shown.page) == [], (phase, size)


def test_a_planted_fault_of_the_panel_is_found(shown: Shown) -> None:
    panel = show(shown, "moves")
    panel.evaluate("(e) => { e.querySelector('.proof').style.whiteSpace = 'nowrap' }")
    with pytest.raises(AssertionError, match=r"outside|spills"):
        assert_fits(shown, SIZES[0], "planted")


def test_what_moves_is_named_and_is_offered_at_the_machine_only(shown: Shown) -> None:
    panel = show(shown, "moves")
    step = panel.locator(".nextstep[data-step=turn]")
    expect(step).to_contain_text("Could move: the whole travel")
    expect(step.get_by_role("button", name="Arm")).to_be_disabled()
    expect(step.get_by_role("button", name="Run this step")).to_be_disabled()
    expect(step).to_contain_text("console")
    # What comes after it waits for it, what came before may be done again.
    panel.locator("tr[data-key=pdo]").get_by_role("button", name="Again").click()
    step = panel.locator(".nextstep[data-step=pdo]")
    expect(step).to_contain_text("Nothing moves in it.")
    assert "commission_step" in shown.tap(".nextstep[data-step=pdo] button")
    show(shown, "running")
    expect(panel.get_by_role("status").first).to_have_text("step under way · Stops · 22 s left")
    expect(panel.get_by_role("button", name="End commissioning")).to_be_disabled()
    show(shown, "done")
    expect(panel).to_contain_text("Every required step has passed")


def test_in_chinese_its_own_words_stand_beside_english_proofs(shown: Shown) -> None:
    panel = show(shown, "done", "zh")
    latin = panel.evaluate(
        "(e) => { for (const own of e.querySelectorAll('[lang=en]')) own.remove(); return e.innerText }"
    )
    # What is left in Latin letters is a name or a unit.
    assert set(re.findall(r"[A-Za-z]{2,}", latin)) <= {"SYNC", "SDO"}
    assert {"调试", "速度阶跃", "通过"} <= set(re.split(r"\s+", latin))


# --- on the real service --------------------------------------------------------------------------


@pytest.fixture
def service(tmp_path: Path) -> Iterator[Service]:
    add_users(tmp_path)
    with Service(tmp_path, "--config", str(configs_folder() / "hust_can.toml")) as made:
        yield made


@pytest.fixture
def browser(playwright: Playwright) -> Iterator[Browser]:
    made = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
    yield made
    made.close()


@pytest.fixture
def context(browser: Browser, service: Service) -> BrowserContext:
    """A browser that has proven that it is on the machine of the service."""
    made = browser.new_context(viewport=SIZE, locale="en-GB")
    made.new_page().goto(console_link(service.root / "hust_can"))
    return made


def panel_of(page: Page) -> Locator:
    return page.get_by_test_id("commissioning")


def until_phase(page: Page, text: str) -> None:
    expect(page.locator("[data-tag=commissioning]")).to_contain_text(text, timeout=TURNS_MS)


def take(page: Page) -> None:
    """Unless this page has control."""
    key = page.get_by_role("button", name="Take control")
    if key.is_visible():
        key.click()
    page.get_by_role("button", name="Give back").wait_for(timeout=TURNS_MS)


def press(page: Page, key: str) -> None:
    """Begin a step, again where it has passed, armed before where the page wants that."""
    take(page)
    step = panel_of(page).locator(f".nextstep[data-step={key}]")
    again = panel_of(page).locator(f"tr[data-key={key}]").get_by_role("button", name="Again")
    step.or_(again).first.wait_for(timeout=TURNS_MS)
    if not step.is_visible():
        again.click()
    arm = step.get_by_role("button", name="Arm")
    if arm.is_visible():
        arm.click()
    step.get_by_role("button", name="Run this step").click()


def press_until(page: Page, key: str, seen: Callable[[], None]) -> None:
    """A busy computer may lose control, or refuse a press on a picture that was too old: a person presses again."""
    for _ in range(5):
        press(page, key)
        with suppress(AssertionError):
            seen()
            return
    raise AssertionError(f"{key} was not seen")


def run(page: Page, key: str) -> None:
    """One step to its end."""
    row = panel_of(page).locator(f"tr[data-key={key}]")
    shown = re.compile("passed|not_testable")
    press_until(page, key, lambda: expect(row).to_have_attribute("data-outcome", shown, timeout=15_000))


@pytest.mark.slow
def test_steps_from_the_first_to_one_that_is_armed(
    service: Service, context: BrowserContext, browser: Browser
) -> None:
    page = enter(context, service, "service", "settings")
    panel = panel_of(page)
    begin = panel.get_by_role("button", name="Begin commissioning")
    expect(begin).to_be_disabled()
    take(page)
    begin.click()
    until_phase(page, "waits for the next step")
    # Control ended with the controller.
    expect(panel.get_by_role("button", name="Run this step")).to_be_disabled()
    for key in STILL:
        run(page, key)
    # What comes now is enabled and brakes: named with what could move, armed first.
    moving = panel.locator(".nextstep[data-step=silence]")
    expect(moving).to_contain_text("Could move: the axis may sag by less than 0.05 deg", timeout=TURNS_MS)
    expect(moving.get_by_role("button", name="Run this step")).to_be_disabled()
    # Elsewhere it is offered to nobody.
    other = enter(browser.new_context(viewport=SIZE, locale="en-GB"), service, "service", "settings")
    far = panel_of(other).locator(".nextstep[data-step=silence]")
    expect(far.get_by_role("button", name="Arm")).to_be_disabled()
    other.close()
    run(page, "silence")
    take(page)
    panel.get_by_role("button", name="End commissioning").click()
    expect(begin).to_be_visible(timeout=TURNS_MS)
    # The controller has the axis again.
    take(page)
    expect(begin).to_be_enabled()


@pytest.mark.slow
def test_a_motion_begun_at_the_page_ends_by_its_stop_and_with_the_page(
    service: Service, context: BrowserContext
) -> None:
    """In the step that moves longest before the whole travel: 20 s of its axis, which the virtual drive makes in 1.3 s.

    Of the velocity step, 4 s of motion, nothing is left before a person has seen it: 0.2 s.
    """
    do_before(service, "stops")
    with service.page("viewer", queue=None) as watcher:

        def until_moving() -> None:
            """The axis moves in the step."""
            watcher.say("alive")  # takes what has come meanwhile
            watcher.until(lambda tags: abs(tags["vel_act_deg_s"] or 0.0) > MOVES_DEG_S)

        def assert_ended(how: Callable[[Page], None], told: str) -> None:
            page = enter(context, service, "service", "settings")
            press_until(page, "stops", until_moving)
            before = row.inner_text()
            how(page)
            expect(note).to_contain_text(told, timeout=15_000)
            page.close()
            until_phase(watching, "waits for the next step")
            # It has shown nothing; what stood before stands.
            assert row.inner_text() == before

        watching = enter(context, service, "service", "settings")
        row = panel_of(watching).locator("tr[data-key=stops]")
        note = watching.get_by_test_id("commission_note")
        expect(panel_of(watching).locator("tr[data-key=loop]")).to_have_attribute("data-outcome", "passed")
        assert_ended(
            lambda page: page.get_by_role("button", name="Stop", exact=True).click(), "stopped by service"
        )
        assert_ended(lambda page: page.close(), "who watches it, has gone")
        watcher.until(lambda tags: tags["authority_user"] == "")
