"""The page in Chinese: alarms and refusals too, though the service says everything in English."""

from __future__ import annotations

import json
import re
from string import Formatter

import pytest
from playwright.sync_api import BrowserContext, Page, WebSocketRoute, expect

from gantryctl.program import ALARMS
from gantryctl.program.alarms.codes import Definition
from gantryctl.program.alarms.log import messages_to_wire, to_wire
from gantryctl.program.alarms.words import Words
from support.browser import add_cookie, address, take_control
from support.service_process import Page as Watcher
from support.service_process import Service

INTERNATIONAL = {
    "NMT",
    "SYNC",
    "SDO",
    "EMCY",
    "TPDO",
    "RPDO",
    "PDO",
    "OPERATIONAL",
    "CAN",
    "UTC",
    "OPC",
    "Power",
    "gantryctl",
    "users",
    "Content",
    "Type",
    "application",
    "json",
}
STEPS = (
    Words.QUICK_STOP,
    Words.AT_REST_AFTER(time_ms=131.0),
    Words.MOVED_TO(way=0.03, position=12.34),
)


def row(number: int, definition: Definition) -> dict[str, object]:
    """An alarm with numbers in it, as the service sends it."""
    english = definition.english
    values: dict[str, object] = {
        name: 12.5 if digits else Words.MODE_AT_REST
        for _, name, digits, _ in Formatter().parse(english.message)
        if name
    }
    return {
        "id": number, "code": str(definition.code), "severity": definition.severity.value, "title": english.title,
        "measured": english.message.format(**values), "values": to_wire(values), "done": "Quick stop",
        "steps": messages_to_wire(*STEPS), "to_do": english.to_do,
        "cause": english.cause, "text": "", "at": "2026-11-20T10:11:12.000+00:00", "time_s": 1.5,
        "pos_act_deg": 12.34, "active": True, "first_out": number == 1, "follows": "", "lock": definition.lock,
        "acknowledged_by": "",
    }  # fmt: skip


def in_chinese(context: BrowserContext, service: Service, area: str) -> Page:
    url = address(service)
    add_cookie(context, url, service.log_in("operator"))
    context.add_init_script("localStorage.setItem('gantryctl.language', 'zh')")
    page = context.new_page()
    page.goto(f"{url}#{area}")
    return page


def english(text: str) -> list[str]:
    """Words that are left, but for names that are the same everywhere and keys of the machine file."""
    without_keys = re.sub(r"`[^`]*`|\[[\w.]+\]|\w+_\w+|docs/\S+|\b\w+\.json\b", "", text)
    return [word for word in re.findall(r"[A-Za-z]{3,}", without_keys) if word not in INTERNATIONAL]


@pytest.mark.slow
def test_every_alarm_is_chinese(context: BrowserContext, page_service: Service) -> None:
    """All codes at once, put into what the service sends."""
    rows = [row(number, definition) for number, definition in enumerate(ALARMS.values(), 1)]

    def with_all_alarms(socket: WebSocketRoute) -> None:
        def forward(text: str | bytes) -> None:
            message = json.loads(text)
            if message["type"] == "status":
                message["tags"]["alarms"] = rows
            socket.send(json.dumps(message))

        socket.connect_to_server().on_message(forward)

    context.route_web_socket("**/api/v1/socket", with_all_alarms)
    page = in_chinese(context, page_service, "alarms")
    table = page.get_by_role("table", name="当前报警")
    detail = page.get_by_label("所选报警")
    for definition in ALARMS.values():
        code = str(definition.code)
        table.get_by_role("button", name=code, exact=True).click()
        expect(detail.get_by_role("heading", level=2).first).to_contain_text(code)
        shown = detail.locator("dd").all_inner_texts()
        assert english(" ".join(shown[:4]).replace(code, "")) == [], code
        for number in re.findall(r"\d+\.\d+", str(rows[list(ALARMS).index(definition.code)]["measured"])):
            assert number in shown[0], code


def test_a_stop_and_a_refusal_are_told_in_chinese(
    context: BrowserContext, page_service: Service, watcher: Watcher
) -> None:
    page = in_chinese(context, page_service, "operation")
    take_control(page, "取得控制权", "交还")
    if not watcher.look()["power"]:
        page.get_by_role("button", name="上电").click()
    watcher.until(lambda tags: bool(tags["power"]))
    page.locator("#tab-alarms").click()
    page.get_by_role("button", name="快速停止").click()
    watcher.until(lambda tags: tags["at_rest"] and tags["power_phase"] == "off")
    detail = page.get_by_label("所选报警").locator("dd")
    expect(detail.first).to_contain_text("操作员要求快速停止")
    assert english(" ".join(detail.all_inner_texts()[:4])) == []
    page.locator("#tab-operation").click()
    # Power is not offered beside a latched alarm, and the reason stands there.
    expect(page.get_by_role("button", name="上电")).to_be_disabled()
    why = page.locator("#power-why")
    expect(why).to_contain_text("INT-06 已锁存（操作员要求快速停止")
    assert english(why.inner_text().replace("PWR", "").replace("INT", "")) == []
    page.get_by_role("button", name="复位").click()
    watcher.until(lambda tags: tags["alarm_count"] == 0)
