"""The walks of `docs/architecture.md` are ways that real runs take: each function is entered, in the order named."""

from __future__ import annotations

import ast
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import NamedTuple

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
