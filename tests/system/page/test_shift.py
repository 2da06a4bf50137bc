"""Alarm sound, shift log, who is here, help: as a person uses them."""

from __future__ import annotations

from playwright.sync_api import BrowserContext, expect

from support.browser import enter
from support.service_process import Page as Watcher
from support.service_process import Service


def test_a_line_of_the_shift_log_is_kept_and_everybody_reads_who_wrote_it(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "service", "alarms")
    line = page.get_by_label("A line for the shift log")
    write = page.get_by_role("button", name="Write")
    expect(write).to_be_disabled()
    line.fill("  the door is repaired 门  ")
    line.press("Enter")
    log = page.get_by_role("region", name="Shift log")
    expect(log.locator("li").first).to_contain_text("the door is repaired 门")
    expect(log.locator("li").first).to_contain_text("service")
    here = page.get_by_role("region", name="Here now")
    expect(here.locator("li").filter(has_text="you")).to_have_count(1)
    expect(here).to_contain_text("viewer")
    other = enter(context, page_service, "viewer", "alarms")
    expect(other.get_by_role("region", name="Shift log")).to_contain_text("the door is repaired 门")
    expect(other.get_by_label("A line for the shift log")).to_have_count(0)


def test_the_sound_is_off_at_first_and_says_when_the_browser_keeps_it_silent(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "viewer", "settings")
    sound = page.get_by_label("Alarm sound")
    expect(sound).to_have_value("off")
    sound.select_option("on")
    page.reload()
    page.locator("[data-stale=false]").wait_for()
    expect(sound).to_have_value("on")
    note = page.get_by_test_id("note")
    expect(note).to_contain_text("keeps it silent until you press a key or click here")
    note.click()
    expect(note).not_to_contain_text("silent")


def test_f1_explains_the_present_area_and_escape_stops_all_the_same(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = enter(context, page_service, "viewer", "alarms")
    page.keyboard.press("F1")
    shown = page.get_by_role("region", name="Help")
    expect(shown).to_contain_text("Acknowledge says that you have seen it")
    expect(page.get_by_role("button", name="Stop", exact=True)).to_be_visible()
    page.keyboard.press("6")
    expect(shown).to_contain_text("Samples of up to eight tags")
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("note")).to_have_text("Done.")
    page.get_by_role("button", name="中文").click()
    expect(page.get_by_role("region", name="帮助")).to_contain_text("触发前后")
    page.keyboard.press("F1")
    expect(page.get_by_role("region", name="帮助")).to_have_count(0)
