"""The page on axes of other travel: its dial, its buttons, and refusals in the words of the service."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, Playwright, expect

from gantryctl.image import Direction
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.machine.effective import to_toml
from gantryctl.program.axis.command_checks import check_destination, check_target, way_to
from gantryctl.units import rad
from gantryctl.wiring.program import travel_settings
from support.axes import tilt
from support.browser import CHROMIUM, FLAGS, SIZE, enter
from support.modulo_machine import modulo_machine
from support.service_process import Page as Watcher
from support.service_process import Service, add_users

pytestmark = pytest.mark.slow

MACHINES = {
    # IEC 61217: angles are read from 0 to 360 deg, tags are signed.
    "iec": with_values(
        default_machine(),
        {"machine.name": "iec", "axis.display": "0..360", "axis.no_go_deg": ((-120.0, -60.0),)},
    ),
    "tilt": with_values(tilt(), {"machine.name": "tilt", "axis.no_go_deg": ((50.0, 60.0),)}),
    "azimuth": with_values(
        load_machine(configs_folder() / "azimuth_dish.toml"), {"axis.no_go_deg": ((-150.0, -120.0),)}
    ),
    "endless": modulo_machine(
        {"axis.pos_min_deg": 0.0, "axis.pos_max_deg": 360.0, "axis.no_go_deg": ((350.0, 10.0), (40.0, 60.0))}
    ),
}
# Angle where the axis stands, angles that a person types, and the directions of a turning axis.
TYPED: dict[str, tuple[float, list[str]]] = {
    "iec": (-20.0, ["340", "310", "-50", "250", "-90", "181", "200", "500", "0"]),
    "tilt": (20.0, ["49.9", "49.95", "55", "70", "95", "96", "-5", "-5.01", "200"]),
    "azimuth": (0.0, ["200", "270", "270.5", "-110", "-160", "-271", "400"]),
    "endless": (20.0, ["30", "45", "200", "355", "390", "-20"]),
}
WAYS = ("shortest", "positive", "negative")


@pytest.fixture(scope="module")
def browser(playwright: Playwright) -> Iterator[Browser]:
    made = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
    yield made
    made.close()


@contextmanager
def shown(browser: Browser, root: Path, machine: Machine, at_deg: float) -> Iterator[tuple[Page, Watcher]]:
    """The area with the move on a machine that stands at an angle, and somebody who has control and power."""
    add_users(root)
    file = root / "machine.toml"
    file.write_text(to_toml(with_values(machine, {"machine.name": "shown"})), encoding="utf-8")
    stand = [sys.executable, "-m", "gantryctl", "sim", "reset", f"--angle={at_deg}", "--config", str(file)]
    subprocess.run(stand, env={**os.environ, "GANTRYCTL_STATE": str(root)}, check=True, capture_output=True)
    with Service(root, "--config", str(file)) as service, service.page("service", queue=None) as watcher:
        watcher.power_up()
        context = browser.new_context(viewport=SIZE, locale="en-GB")
        page = enter(context, service, "viewer", "operation")
        yield page, watcher
        context.close()


# Words on the scale, and how many sectors lie on it.
SCALES: dict[str, tuple[set[str], set[str], int]] = {
    "iec": ({"0", "30", "330", "180-", "180+"}, {"-30", "+30", "210°"}, 1),
    "tilt": ({"-5", "+95", "+30", "+60"}, {"+90", "+120", "+180", "-30"}, 1),
    "azimuth": ({"-270", "+270", "0", "-150", "+150"}, {"+210"}, 1),
    "endless": ({"0", "30", "180", "330"}, {"-30", "360", "+30"}, 2),
}


def look_at_the_dial(page: Page, machine: Machine, name: str, pos_deg: float) -> None:
    """Words on the scale, sectors, ends, and no couch beside another machine than the paper's gantry."""
    there, missing, sectors = SCALES[name]
    page.keyboard.press("1")
    dial = page.locator(".drawing svg")
    words = words_of(dial)
    assert words >= there
    assert not words & missing
    assert dial.locator(".nogo").count() == sectors
    assert dial.locator(".limit").count() == (0 if machine.axis.modulo else 2)
    assert dial.locator(".couch").count() == (1 if name == "iec" else 0)
    told = page.locator(".overview [data-tag=pos_act_deg]").inner_text().replace("−", "-")
    assert float(told) == pytest.approx(machine.axis.read_deg(pos_deg), abs=0.006)


def words_of(dial: Locator) -> set[str]:
    return {str(each).replace("−", "-") for each in dial.locator("text").all_text_contents()}


def judged(machine: Machine, here_deg: float, target_deg: float, way: str) -> str:
    """What the program says of a target; "" where it would go there."""
    travel, here, target = travel_settings(machine), rad(here_deg), rad(target_deg)
    direction = Direction[way.upper()] if way else None
    refused = check_destination(here, target, direction, travel)
    if way and refused is None:
        assert direction is not None
        window = rad(machine.monitors.in_position_window_deg)
        refused = check_target(here, here + way_to(here, target, direction, window), travel)
    return "" if refused is None else f"{refused.code} {refused.text}"


@pytest.mark.parametrize("name", MACHINES)
def test_the_page_is_that_of_the_axis_and_refuses_in_the_words_of_the_service(
    browser: Browser, tmp_path: Path, name: str
) -> None:
    machine, (at_deg, typed) = MACHINES[name], TYPED[name]
    axis = machine.axis
    with shown(browser, tmp_path, machine, at_deg) as (page, watcher):
        look_at_the_dial(page, machine, name, watcher.tags["pos_act_deg"])
        page.keyboard.press("2")
        said = page.locator(".move p[role=alert]")
        here_deg = watcher.tags["pos_ref_deg"]
        permitted = 0
        refused: list[tuple[str, dict[str, Any]]] = []
        for text in typed:
            page.get_by_label("Target").fill(text)
            for way in WAYS if axis.modulo else ("",):
                if axis.modulo:
                    page.get_by_label("Direction").select_option(way)
                target_deg = axis.meant_deg(float(text))
                if wanted := judged(machine, here_deg, target_deg, way):
                    expect(said).to_have_text(wanted)
                    refused.append((wanted, {"target_deg": target_deg} | ({"direction": way} if way else {})))
                else:
                    expect(said).to_have_count(0)
                    permitted += 1
        # In a row: who is silent for long loses control.
        watcher.look()
        watcher.do("take", over=False)
        for wanted, keys in refused:
            reply = watcher.ask("move", **keys)
            assert not reply["ok"]
            assert f"{reply['code']} {reply['text']}" == wanted
        assert len(refused) >= 3
        assert permitted >= 2
        # No button offers what would be refused whichever way.
        buttons = page.locator("#move-quick button").all()
        assert 3 <= len(buttons) <= 5
        for button in buttons:
            button.click()
            told = float(button.inner_text().rstrip("°").replace("−", "-"))
            ways = WAYS if axis.modulo else ("",)
            assert "" in {judged(machine, here_deg, axis.meant_deg(told), way) for way in ways}


def test_two_angles_of_one_place_lie_apart_and_the_scale_says_which(browser: Browser, tmp_path: Path) -> None:
    """At 200 and at -160 deg of a travel of +-270 deg the index points alike; track and scale tell them."""
    machine = with_values(MACHINES["azimuth"], {"axis.no_go_deg": ()})
    found = {}
    for at_deg in (200.0, -160.0):
        root = tmp_path / f"{at_deg:g}"
        root.mkdir()
        with shown(browser, root, machine, at_deg) as (page, _):
            page.keyboard.press("1")
            dial = page.locator(".drawing svg")
            words = words_of(dial)
            found[at_deg] = (words, dial.locator(".now").get_attribute("transform"))
    assert {"+180", "+210"} <= found[200.0][0]
    assert {"-180", "-150"} <= found[-160.0][0]
    assert found[200.0][1] != found[-160.0][1]
