"""Branches of several recordings count together, on the sources as they are now."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import coverage
import pytest

AREA = "service/command"
FILE = f"src/gantryctl/{AREA}/sign.py"
NOW = "def sign(value):\n    if value > 0:\n        return 1\n    return -1\n"
POSITIVE, NEGATIVE = [(-1, 2), (2, 3), (3, -1)], [(-1, 2), (2, 4), (4, -1)]


@pytest.fixture
def tool(mutation_tool: None) -> Any:
    from mutation import branches

    return branches


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / FILE).parent.mkdir(parents=True)
    (tmp_path / FILE).write_text(NOW)
    (tmp_path / "recorded").mkdir()
    return tmp_path


def recorded(root: Path, part: str, ways: list[tuple[int, int]], text: str = NOW) -> None:
    """What `python -m mutation record` keeps of a part whose tests went these ways."""
    data = coverage.CoverageData(basename=str(root / "recorded" / f"coverage.{part}"))
    data.add_arcs({f"/of/another/computer/{FILE}": ways})
    data.close()
    (root / "recorded" / f"tests.{part}.json").write_text(json.dumps({"texts": {FILE: text}}))


def counted(tool: Any, root: Path) -> tuple[int, int, list[list[int]]]:
    rows, missing = tool.branches(root / "recorded", [AREA], root)
    return rows[AREA]["covered"], rows[AREA]["branches"], missing.get(FILE, [])


def test_parts_of_a_folder_count_together(tool: Any, root: Path) -> None:
    recorded(root, "one", POSITIVE)
    assert counted(tool, root) == (1, 2, [[2, 4]])
    recorded(root, "two", NEGATIVE)
    assert counted(tool, root) == (2, 2, [])


def test_a_part_of_an_older_source_counts_where_lines_have_only_moved(tool: Any, root: Path) -> None:
    recorded(root, "new", POSITIVE)
    moved = [(a + 1 if a > 0 else a - 1, b + 1 if b > 0 else b - 1) for a, b in NEGATIVE]
    recorded(root, "old", moved, "LIMIT = 0\n" + NOW)
    assert counted(tool, root) == (2, 2, [])


def test_a_branch_of_a_line_that_has_changed_does_not_count(tool: Any, root: Path) -> None:
    recorded(root, "old", [*POSITIVE, *NEGATIVE], NOW.replace("value > 0", "value >= 0"))
    assert counted(tool, root) == (0, 2, [[2, 3], [2, 4]])


def test_a_source_that_no_part_has_seen_counts(tool: Any, root: Path) -> None:
    recorded(root, "one", [*POSITIVE, *NEGATIVE])
    (root / FILE).with_name("other.py").write_text(NOW)
    assert counted(tool, root)[:2] == (2, 4)


def test_what_only_a_type_checker_reads_is_no_branch(tool: Any, root: Path) -> None:
    recorded(root, "one", [*POSITIVE, *NEGATIVE])
    checked = (
        "if not TYPE_CHECKING:\n    A = 1\n"
        "def one(value):\n    match value:\n        case 1:\n            return 1\n"
        "        case _:\n            assert_never(value)\n"
        "if __name__ == '__main__':\n    one(1)\n"
    )
    (root / FILE).with_name("other.py").write_text(checked)
    assert counted(tool, root)[:2] == (2, 2)


def test_rows_of_other_areas_stay(tool: Any, root: Path) -> None:
    (root / "docs/evidence").mkdir(parents=True)
    tool.write({"program": {"name": "program", "branches": 4, "covered": 3}}, root)
    tool.write({AREA: {"name": AREA, "branches": 2, "covered": 2}}, root)
    kept = json.loads((root / tool.EVIDENCE).read_text())["areas"]
    assert [row["name"] for row in kept] == ["program", AREA]


def test_a_folder_without_a_recording_is_told(tool: Any, root: Path) -> None:
    with pytest.raises(SystemExit, match="record first"):
        tool.branches(root / "recorded", [AREA], root)
