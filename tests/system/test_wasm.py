"""The core as WebAssembly: the bits of the Python module in node, and gains that a reader drags in the documentation.

Slow, since a compiler runs (Zig, of `requirements/dist.txt`): `python -m pytest -m slow tests/system/test_wasm.py`.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from gantryctl import _core
from gantryctl.engineering.batch import ClosedLoop
from gantryctl.engineering.tuning.bench import Bench
from gantryctl.engineering.tuning.gains import configured, machine_with
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.machine.places import fitted_stretch_deg, one_flank_deg
from gantryctl.motion import SetPoint, hold, plan_move
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import drive_params, plant_params
from support.browser import CHROMIUM, FLAGS
from support.delivered_axes import axis_of

pytestmark = pytest.mark.slow
ROOT = Path(__file__).parents[2]
NODE = ("node", str(ROOT / "tests" / "support" / "run_axis.mjs"))

EFFECTS = ("tooth_pitch", "thermal", "ageing", "cogging", "encoder_errors", "cable", "second_pinion")
AXES = {
    "hust_gantry": {},
    "hust_gantry by Runge-Kutta": {"plant.integration.scheme": "rk4"},
    "hust_gantry with an ideal current loop": {"drive.current_loop.ideal": True},
    "hust_gantry rigid": {"plant.switches.rigid": True},
    "hust_gantry at 4 ms": {"control.scan_period_ms": 4.0},
    "hust_gantry with every effect": {f"plant.switches.{name}": True for name in EFFECTS},
    "azimuth_dish": {},
    "rotary_table": {},
    "draft of crane_slew": {},
    "draft of telescope_azimuth": {},
}
"""Gear and direct, wind and none, each form of the plant that has code of its own."""


class Run(NamedTuple):
    """Plans one after the other on a standing axis, with their scans, and the log of each by the Python module."""

    given: dict[str, Any]
    logs: list[np.ndarray[Any, np.dtype[np.float64]]]


@pytest.fixture(scope="module")
def tool() -> Iterator[ModuleType]:
    pytest.importorskip("ziglang", reason="ziglang is missing: requirements/dist.txt")
    sys.path.insert(0, str(ROOT / "tools"))
    import build_wasm

    yield build_wasm
    sys.path.remove(str(ROOT / "tools"))


@pytest.fixture(scope="module")
def wasm(tool: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file: Path = tmp_path_factory.mktemp("wasm") / "axis.wasm"
    tool.compile_axis(file)
    return file


def machine_of(name: str) -> Machine:
    base = name if name.startswith("draft") else name.split(maxsplit=1)[0]
    machine = default_machine() if base == "hust_gantry" else axis_of(base)
    return with_values(machine, AXES[name])


def run_of(tool: ModuleType, machine: Machine) -> Run:
    """A step of the set-point, and a move behind it."""
    integration, period_s = machine.plant.integration, machine.control.scan_period_ms * 1e-3
    sim = _core.GantrySim(
        plant_params(machine), drive_params(machine), period_s, integration.scheme, integration.rk4_steps
    )
    sim.count_offset = float(machine.plant.encoder.mounting_turns * machine.encoder.fine_counts_per_turn)
    here = rad(one_flank_deg(machine))
    loop = ClosedLoop.standing_at(sim, position_law(machine), here)
    step = here + rad(machine.monitors.in_position_window_deg)
    start, end = fitted_stretch_deg(machine, one_flank_deg(machine), 3.0)
    move = plan_move(SetPoint(step, 0.0, 0.0), step + rad(end - start), motion_limits(machine))
    plans, logs = [], []
    for plan, duration_s in ((hold(here), 0.5), (hold(step), 1.0), (move, min(move.duration + 1.0, 8.0))):
        log = loop.run(plan, duration_s)
        logs.append(np.array([log[name] for name in log.columns]))
        plans.append({"plan": tool.plan_of(plan), "scans": len(log)})
    return Run({"numbers": tool.numbers_of(machine), "stands_rad": here, "plans": plans}, logs)


def in_node(wasm: Path, runs: Sequence[Run]) -> list[list[np.ndarray[Any, np.dtype[np.float64]]]]:
    """Logs of the same runs by the WebAssembly in node."""
    given, out = wasm.with_name("runs.json"), wasm.with_name("logs.bin")
    given.write_text(json.dumps([run.given for run in runs], allow_nan=False), encoding="utf-8")
    subprocess.run([*NODE, str(wasm), str(given), str(out)], check=True)
    numbers, found = np.fromfile(out), []
    for run in runs:
        logs = []
        for log in run.logs:
            logs.append(numbers[: log.size].reshape(log.shape))
            numbers = numbers[log.size :]
        found.append(logs)
    assert numbers.size == 0
    return found


def alike(one: Sequence[np.ndarray[Any, Any]], other: Sequence[np.ndarray[Any, Any]]) -> bool:
    """Bit for bit, -0 and NaN included."""
    return all(a.tobytes() == b.tobytes() for a, b in zip(one, other, strict=True))


def test_the_same_run_gives_the_same_bits(tool: ModuleType, wasm: Path) -> None:
    runs = [run_of(tool, machine_of(name)) for name in AXES]
    for name, run, logs in zip(AXES, runs, in_node(wasm, runs), strict=True):
        assert np.ptp(run.logs[-1][_core.LOG_COLUMNS.index("pos_load_rad")]) > rad(0.5), name
        assert alike(run.logs, logs), name


def test_the_last_bit_of_a_number_is_seen(tool: ModuleType, wasm: Path) -> None:
    """The liar: a gain that is off by its last bit."""
    run = run_of(tool, default_machine())
    numbers = run.given["numbers"]
    numbers["drive.kvp_nm_s_per_rad"] = float(np.nextafter(numbers["drive.kvp_nm_s_per_rad"], 0.0))
    assert not alike(run.logs, in_node(wasm, [run])[0])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"law.kvf": None}, "law.kvf: 1 finite numbers are needed"),
        ({"law.kwf": 1.0}, "no place for law.kwf"),
        ({"plant.wind_wave_nm": [1.0]}, "plant.wind_wave_nm: 24 finite numbers are needed"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(
    tool: ModuleType, wasm: Path, change: dict[str, Any], words: str
) -> None:
    numbers = {
        name: value
        for name, value in (tool.numbers_of(default_machine()) | change).items()
        if value is not None
    }
    given = wasm.with_name("wrong.json")
    given.write_text(json.dumps([{"numbers": numbers, "stands_rad": 0.0, "plans": []}]), encoding="utf-8")
    said = subprocess.run(
        [*NODE, str(wasm), str(given), str(wasm.with_name("none.bin"))],
        check=False,
        capture_output=True,
        text=True,
    )
    assert said.returncode != 0
    assert words in said.stderr


@pytest.fixture(scope="module")
def page_file(tool: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with the place for it and the scripts of `make wasm`, as the site puts them together."""
    folder = tmp_path_factory.mktemp("page")
    tool.make(folder)
    made = subprocess.run(
        ["npm", "run", "--silent", "build-gains", "--", "--outDir", str(folder / "site")],
        check=False,
        capture_output=True,
        text=True,
        cwd=ROOT / "hmi",
    )
    assert made.returncode == 0, made.stderr
    page = folder / "page.html"
    scripts = "".join(f'<script src="{name}"></script>' for name in ("gains_data.js", "site/gains.js"))
    page.write_text(
        '<!doctype html><html lang="en"><meta charset="utf-8"><link rel="stylesheet" href="site/gains.css">'
        f'<title>gains</title><div class="gains-to-drag"></div>{scripts}</html>',
        encoding="utf-8",
    )
    return page


def test_a_gain_is_dragged_and_the_answer_drawn_anew_without_a_network(page_file: Path) -> None:
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page()
        loaded, errors = set[str](), list[str]()
        page.on("request", lambda request: loaded.add(request.url.partition(":")[0]))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(page_file.as_uri())
        said = page.locator("[role=status]")
        said.wait_for()
        # What `gantryctl tune` finds of the same gains (docs/explanation/tuning.md: the load overshoots by a third).
        step = Bench(default_machine()).position_step(configured(default_machine()))
        words = f"by {100 * step.motor_overshoot:.1f} %, the load by {100 * step.load_overshoot:.1f} %"
        assert words in str(said.text_content())
        first = said.text_content()
        page.get_by_label("Kpp").fill("0.5")
        page.wait_for_function(
            "first => document.querySelector('[role=status]').textContent !== first", arg=first
        )
        softer = machine_with(
            default_machine(), replace(configured(default_machine()), kpp_per_s=10.0 * 8**0.5)
        )
        step = Bench(softer).position_step(configured(softer))
        assert f"the load by {100 * step.load_overshoot:.1f} %" in str(said.text_content())
        assert page.locator(".chart canvas").count() == 2
        page.get_by_role("button", name="As in the machine file").click()
        page.wait_for_function(
            "first => document.querySelector('[role=status]').textContent === first", arg=first
        )
        page.get_by_label("Machine").select_option("rotary_table")
        page.wait_for_function(
            "first => document.querySelector('[role=status]').textContent !== first", arg=first
        )
        browser.close()
    assert loaded <= {"file", "data"}
    assert errors == []
