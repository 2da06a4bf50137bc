"""The walks of `docs/architecture.md` are ways that real runs take: each function is entered, in the order named."""

from __future__ import annotations

import ast
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NamedTuple

import pytest

from gantryctl.drives.simulated import SimDrive
from gantryctl.machine import default_machine, default_machine_path, load_machine
from gantryctl.program import AxisState
from gantryctl.wiring.engine import build_engine
from support.command_line import done
from support.whole_service import PageInProcess, with_page

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "architecture.md"
PACKAGE = ROOT / "src" / "gantryctl"
STEP = re.compile(r"^\d+\. `([\w./]+)` `([\w.]+)`", re.MULTILINE)
"""`file` `function`; files of the page and of the core are named from the root of the repository."""


class Step(NamedTuple):
    """One step of a walk."""

    file: str
    function: str

    @property
    def ours(self) -> bool:
        """Whether it is Python of the package, which a run can be watched in."""
        return self.file.endswith(".py")


def walks() -> dict[str, list[Step]]:
    """The walks of the page by their headings."""
    text = PAGE.read_text(encoding="utf-8").partition("## Five walks\n")[2]
    sections = re.split(r"^### ", text, flags=re.MULTILINE)[1:]
    return {
        section.partition("\n")[0]: [Step(*found) for found in STEP.findall(section)] for section in sections
    }


def functions(path: Path) -> set[str]:
    """Qualified names of everything that a file defines."""
    found: set[str] = set()

    def visit(node: ast.AST, prefix: str) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                found.add(f"{prefix}{child.name}")
                inner = f"{prefix}{child.name}."
                visit(child, inner if isinstance(child, ast.ClassDef) else f"{inner}<locals>.")
            else:
                visit(child, prefix)

    visit(ast.parse(path.read_text(encoding="utf-8")), "")
    return found


class Watch:
    """What of the steps of a walk was entered, in order."""

    def __init__(self, steps: list[Step]) -> None:
        self.steps = steps
        self.reached = 0
        self._names = {step.function for step in steps}

    def __call__(self, frame: FrameType, event: str, argument: object) -> None:
        code = frame.f_code
        if event != "call" or code.co_qualname not in self._names or self.reached == len(self.steps):
            return
        step = self.steps[self.reached]
        if code.co_qualname == step.function and code.co_filename.endswith(f"gantryctl/{step.file}"):
            self.reached += 1


@contextmanager
def watched(steps: list[Step]) -> Iterator[Watch]:
    """Watch this thread and the threads begun inside."""
    watch = Watch(steps)
    before = sys.getprofile()
    threading.setprofile(watch)
    sys.setprofile(watch)
    try:
        yield watch
    finally:
        sys.setprofile(before)
        threading.setprofile(None)


def moved(tmp_path: Path) -> None:
    done("move", "5", "--json")


def stopped(tmp_path: Path) -> None:
    async def script(page: PageInProcess) -> None:
        await set_going(page)
        assert (await page.ask("stop"))["ok"]
        await page.until(lambda: page.controller.axis.at_rest)

    with_page(default_machine(), tmp_path, script)


def alarmed(tmp_path: Path) -> None:
    async def script(page: PageInProcess) -> None:
        await set_going(page)
        drive = page.controller.engine.drive
        assert isinstance(drive, SimDrive)
        drive.trip(0x7305)
        await page.until(lambda: bool(page.status.get("alarms")))
        assert page.status["alarms"][0]["code"] == "DRV-01"

    with_page(default_machine(), tmp_path, script)


def read_from_the_bus(tmp_path: Path) -> None:
    machine = load_machine(ROOT / "configs" / "hust_can.toml")
    engine = build_engine(machine)
    engine.run_for(0.1)
    engine.close()


def configured(tmp_path: Path) -> None:
    build_engine(load_machine(default_machine_path()))


async def set_going(page: PageInProcess) -> None:
    """Control, power, and a move that is under way."""
    for kind, values in (("take", {"over": False}), ("power", {"on": True})):
        answer = await page.ask(kind, **values)
        assert answer["ok"], str(answer)
    await page.until(lambda: page.controller.axis.state is AxisState.STANDSTILL)
    assert (await page.ask("move", target_deg=90.0))["ok"]
    await page.until(lambda: not page.controller.axis.at_rest)


RUNS: dict[str, Callable[[Path], None]] = {
    "A move": moved,
    "A stop": stopped,
    "An alarm": alarmed,
    "A CAN frame": read_from_the_bus,
    "A configuration key": configured,
}


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))


def test_the_page_has_the_walks_that_are_watched() -> None:
    assert [heading.partition(":")[0] for heading in walks()] == list(RUNS)
    assert all(len(steps) >= 7 for steps in walks().values())


@pytest.mark.parametrize("heading", walks(), ids=lambda heading: heading.partition(":")[0])
def test_every_name_exists(heading: str) -> None:
    for step in walks()[heading]:
        if step.ours:
            assert step.function in functions(PACKAGE / step.file), step
        else:
            assert step.function in (ROOT / step.file).read_text(encoding="utf-8"), step


@pytest.mark.parametrize("heading", walks(), ids=lambda heading: heading.partition(":")[0])
def test_the_run_takes_that_way(heading: str, tmp_path: Path) -> None:
    steps = [step for step in walks()[heading] if step.ours]
    with watched(steps) as watch:
        RUNS[heading.partition(":")[0]](tmp_path)
    assert watch.reached == len(steps), f"never entered after the step before it: {steps[watch.reached]}"
