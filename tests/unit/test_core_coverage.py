"""Branches of the core as gcov tells them: instances of a template are one, calls that could throw do not count."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

_SPEC = importlib.util.spec_from_file_location(
    "core_coverage", Path(__file__).parents[2] / "tools/core_coverage.py"
)
assert _SPEC is not None
assert _SPEC.loader is not None
core_coverage = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(core_coverage)


def branch(count: int, *, throw: bool = False, fallthrough: bool = False) -> dict[str, Any]:
    return {"count": count, "throw": throw, "fallthrough": fallthrough}


def row(number: int, count: int, *branches: dict[str, Any]) -> dict[str, Any]:
    return {"line_number": number, "count": count, "branches": list(branches)}


def test_a_branch_is_covered_when_one_instance_took_it(tmp_path: Path) -> None:
    lines = [
        row(3, 5, branch(5), branch(0)),
        row(3, 2, branch(0), branch(2)),
        row(4, 0, branch(0), branch(0)),
        row(4, 1, branch(1), branch(0)),
        row(5, 1, branch(1, fallthrough=True), branch(0, throw=True), branch(0), branch(1)),
    ]
    report = {"current_working_directory": str(tmp_path), "files": [
        {"file": "core/control/law.hpp", "lines": lines},
        {"file": "core/plant/drive.hpp", "lines": lines},
    ]}  # fmt: skip
    found = core_coverage.lines_of([report], tmp_path / "core/control")
    assert {at: tuple(line) for at, line in found["law.hpp"].items()} == {
        3: (True, (True, True)),
        4: (True, (True, False)),
        5: (True, (False, True)),
    }
    assert list(found) == ["law.hpp"]
