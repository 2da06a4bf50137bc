"""Which tests a change calls for: those that run it, or those that import what it has made."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

SOURCE = """
def row(number):
    return number + 1

def used(number):
    return number - 1

ROWS = [row(1)]
"""
FILE = "src/gantryctl/here/rows.py"


@pytest.fixture
def selection(mutation_tool: None, tmp_path: Path) -> Any:
    """Of three tests: one runs `used`, one imports the module, one does neither."""
    from mutation.selection import Selection

    (tmp_path / "src/gantryctl/here").mkdir(parents=True)
    (tmp_path / FILE).write_text(SOURCE, encoding="utf-8")
    texts = {
        "runs": "import gantryctl",
        "imports": "from gantryctl.here import names, rows",
        "else": "from gantryctl.here import narrows",
    }
    tests = {}
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text, encoding="utf-8")
        tests[f"{name}.py::test"] = {"passed": True, "seconds": 0.1, "fixtures": []}
    kept = {
        "tests": tests, "fixtures": {}, "contexts": ["", "runs.py::test"], "lines": {FILE: {"3": "1", "6": "2"}},
        "texts": {FILE: SOURCE},
    }  # fmt: skip
    (tmp_path / "tests.all.json").write_text(json.dumps(kept), encoding="utf-8")
    return Selection(tmp_path, tmp_path)


@pytest.mark.parametrize(
    ("line", "function", "names", "tests", "at_import"),
    [
        (6, "used", (), ["runs"], False), (3, "row", (), ["imports", "runs"], True),
        (8, "", ("ROWS",), ["imports", "runs"], True),
    ],
)  # fmt: skip
def test_what_acts_when_a_module_is_imported_is_tried_with_the_tests_that_import_it(
    selection: Any, line: int, function: str, names: tuple[str, ...], tests: list[str], at_import: bool
) -> None:
    from mutation.mutant import Change

    change = Change("a change", FILE, 0, 0, b"", line, line, function, names)
    assert sorted(selection.covering(change)) == [f"{name}.py::test" for name in tests]
    assert selection.acts_at_import(change) is at_import
