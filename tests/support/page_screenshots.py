"""Pictures of every area for the documentation, of the real page on the real service.

    python tests/support/page_screenshots.py docs/hmi

Chinese texts need a font that has them (Debian: fonts-wqy-microhei).
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, Playwright, sync_playwright

from gantryctl.machine import configs_folder
from gantryctl.service.clients.link import console_link
from support.browser import (
    CHROMIUM,
    FLAGS,
    SIZE,
    Proxy,
    enter,
    launch,
    person_key,
    press,
    ready_to_jog,
    until_moving,
)
from support.commissioning_steps import do_before
from support.service_process import Page as Watcher
from support.service_process import Service, add_users

COLOURS = 96


class Album:
    """A folder of small pictures."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder

    def take(self, page: Page, name: str) -> None:
        picture = Image.open(io.BytesIO(page.screenshot(animations="disabled"))).convert("RGB")
        small = picture.quantize(COLOURS, dither=Image.Dither.NONE)
        small.save(self._folder / f"{name}.png", optimize=True)


def show(page: Page, area: str) -> None:
    page.locator(f"#tab-{area}").click()
    page.locator(f"[data-area={area}]").wait_for()


def move(page: Page, angle: str) -> None:
    show(page, "operation")
    page.get_by_label("Target").fill(angle)
    page.get_by_role("button", name=f"Move to {angle.replace('-', '−')}.00°").click()


def learn(page: Page, watcher: Watcher) -> None:
    """There and back at the top speed: then load and friction can be told apart."""
    show(page, "settings")
    speed = page.locator("form.setting").filter(has=page.locator("#speed_setting_deg_s"))
    speed.get_by_role("textbox").fill("1")
    speed.get_by_role("textbox").press("Enter")
    watcher.until(lambda tags: tags["speed_setting_deg_s"] == 6.0)
    move(page, "70")
    watcher.until(lambda tags: tags["pos_act_deg"] > 60.0)
    watcher.until(lambda tags: tags["in_position"])
    move(page, "-120")
    show(page, "display")
    page.get_by_label("Quantity").select_option(label="Torque")
    watcher.until(lambda tags: tags["eccentric_moment_nm"] is not None and tags["pos_act_deg"] < -40.0)


def in_motion(page: Page, watcher: Watcher, album: Album) -> None:
    """A jog and moves on the way, light and dark."""
    show(page, "operation")
    ready_to_jog(page)
    press(page)
    until_moving(watcher)
    watcher.until(lambda tags: tags["vel_ref_deg_s"] > 0.59)
    album.take(page, "operation")
    page.mouse.up()
    watcher.until(lambda tags: tags["at_rest"])
    learn(page, watcher)
    album.take(page, "display")
    person_key(page, "Dark")
    album.take(page, "display_dark")
    show(page, "operation")
    page.get_by_role("button", name="中文").click()
    album.take(page, "operation_chinese")
    page.get_by_role("button", name="English").click()
    for area in ("settings", "diagnosis"):
        show(page, area)
        album.take(page, f"{area}_dark")
    person_key(page, "Dark")
    for area in ("settings", "diagnosis"):
        show(page, area)
        album.take(page, area)


def after_a_stop(page: Page, watcher: Watcher, album: Album) -> None:
    """A quick stop in motion, in the scope and among the alarms."""
    watcher.until(lambda tags: tags["in_position"])
    move(page, "70")
    until_moving(watcher)
    show(page, "scope")
    page.get_by_role("button", name="normal").click()
    page.get_by_label("Trigger", exact=True).select_option("any new alarm")
    page.get_by_label("Add a channel").select_option("pos_err_deg")
    page.get_by_role("button", name="Start").click()
    watcher.until(lambda tags: abs(tags["vel_act_deg_s"] or 0.0) > 4.0)
    page.get_by_role("button", name="Quick stop").click()
    watcher.until(lambda tags: tags["at_rest"] and tags["power_phase"] == "off")
    page.get_by_test_id("scope-state").get_by_text("any new alarm ·").wait_for(timeout=60_000)
    page.get_by_role("button", name="Hold").click()
    album.take(page, "scope")
    show(page, "alarms")
    album.take(page, "alarms")
    person_key(page, "Dark")
    album.take(page, "alarms_dark")
    person_key(page, "Dark")
    page.get_by_role("button", name="中文").click()
    album.take(page, "alarms_chinese")
    page.get_by_role("button", name="English").click()


def brake_test(page: Page, watcher: Watcher, album: Album) -> None:
    """The test under way, in the second direction; it ends before this returns."""
    page.get_by_role("button", name="Reset", exact=True).click()
    watcher.until(lambda tags: tags["alarm_count"] == 0)
    show(page, "operation")
    page.get_by_role("button", name="1 · Arm test").click()
    page.get_by_role("button", name="2 · Execute test").click()
    watcher.until(lambda tags: tags["brake_test_phase"] == "minus_held")
    page.evaluate("document.querySelector('main').scrollTop = 1e6")
    album.take(page, "brake_test")
    watcher.until(lambda tags: tags["brake_test_result"] == "passed" and tags["power_phase"] == "off")
    page.get_by_text("passed").wait_for()
    page.get_by_text("Power: off").wait_for()


def commissioning(playwright: Playwright, album: Album) -> None:
    """Half of the steps have passed, on the screen of the machine; the next one moves."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        add_users(root)
        machine = str(configs_folder() / "hust_can.toml")
        with Service(root, "--config", machine) as service:
            do_before(service, "velocity")
            browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            context = browser.new_context(viewport=SIZE, locale="en-GB")
            context.new_page().goto(console_link(service.root / "hust_can"))
            page = enter(context, service, "service", "settings")
            page.get_by_role("button", name="Take control").click()
            page.locator(".nextstep[data-step=velocity]").scroll_into_view_if_needed()
            page.get_by_role("button", name="Give back").wait_for()
            album.take(page, "commissioning")
            browser.close()


def main() -> int:
    """Start everything, take the pictures, stop everything."""
    album = Album(Path(sys.argv[1]))
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        root = Path(folder)
        add_users(root)
        with Service(root) as service, service.page("viewer", queue=None) as watcher:
            proxy = Proxy(int(service.address.rsplit(":", 1)[1]))
            with launch(playwright, service, proxy) as browser:
                page = browser.new_context(viewport=SIZE, locale="en-GB").new_page()
                page.goto(f"http://{service.address}/")
                page.get_by_label("Password").wait_for()
                album.take(page, "login")
                page = enter(
                    browser.new_context(viewport=SIZE, locale="en-GB"), service, "physicist", frozen=True
                )
                in_motion(page, watcher, album)
                after_a_stop(page, watcher, album)
                brake_test(page, watcher, album)
                proxy.freeze()
                page.locator("[data-stale=true]").wait_for()
                album.take(page, "stale")
                proxy.thaw()
        commissioning(playwright, album)
    return 0


if __name__ == "__main__":
    sys.exit(main())
