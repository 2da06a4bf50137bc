"""The tool that changes the sources must find places to change, and tests that see it."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def tool(mutation_tool: None) -> Any:
    from mutation import operators

    return operators


SOURCE = b'''"""A docstring with 5 < 6."""
LIMIT: int = 3
__all__ = ["law"]


class Law:
    def scan(self, speed, limit=2.0):
        """Also 1 and 2."""
        # the sign: speed < limit is not meant here
        if not (abs(speed) < limit and self.ready):
            raise ValueError(f"speed {speed} above {limit + 1}")
        self.count = min(self.count + 1, LIMIT)
        return -speed
'''


def changed_lines(tool: Any) -> list[str]:
    before = SOURCE.decode().split("\n")
    found = []
    for change in tool.mutants("src/gantryctl/program/power/law.py", SOURCE):
        after = change.applied(SOURCE).decode().split("\n")
        assert len(after) == len(before)
        (line,) = [new.strip() for old, new in zip(before, after, strict=True) if old != new]
        found.append(line)
    return found


def test_the_mutants_of_a_small_law_are_these_and_no_others(tool: Any) -> None:
    condition = "if not (abs(speed) < limit and self.ready):"
    counted = "self.count = min(self.count + 1, LIMIT)"
    assert sorted(changed_lines(tool)) == sorted(
        [
            "LIMIT: int = 4",
            "def scan(self, speed, limit=3.0):",
            condition.replace("not ", ""),
            condition.replace("<", "<="),
            condition.replace("<", ">"),
            condition.replace("and", "or"),
            condition.replace("abs(speed) < limit", "True"),
            condition.replace("self.ready", "True"),
            condition.replace("abs(speed)", "(speed)"),
            "pass",  # the error
            "pass",  # the count
            counted.replace("min", "max"),
            counted.replace("+", "-"),
            counted.replace("1", "2"),
            "return None",
            "return (speed)",
        ]
    )


def test_names_of_mutants_do_not_depend_on_the_lines_above(tool: Any) -> None:
    file = "src/gantryctl/program/power/law.py"
    names = [change.name for change in tool.mutants(file, SOURCE)]
    moved = [change.name for change in tool.mutants(file, b'"""More."""\n\nX = "a"\n' + SOURCE)]
    assert names == moved
    assert len(set(names)) == len(names)
    assert "program/power/law.py:Law.scan:compare:0" in names


def test_every_planted_bug_still_fits_its_source_and_is_a_program(tool: Any) -> None:
    """Compiled together where they lie apart: a whole source for each of 1,300 bugs takes half a minute."""
    from mutation import planted

    by_file = defaultdict(list)
    for path in sorted((ROOT / planted.FOLDER).glob("*.toml")):
        for bug in [] if path.stem == "argued" else planted.read_bugs(path):
            change = planted.change_of(bug, path.stem, ROOT)
            by_file[change.file].append(change)
    assert sum(map(len, by_file.values())) >= 58
    for file, changes in by_file.items():
        source, left = (ROOT / file).read_bytes(), changes if file.endswith(".py") else []
        while left:
            together, others, end = [], [], -1
            for change in sorted(left, key=lambda each: each.start):
                apart = change.start > end
                (together if apart else others).append(change)
                end = change.end if apart else end
            text = source
            for change in reversed(together):
                text = change.applied(text)
            compile(text, f"{file}: {', '.join(change.name for change in together)}", "exec")
            left = others


def test_a_planted_bug_whose_text_is_gone_is_told(tool: Any) -> None:
    from mutation import planted

    bug = {"name": "x", "file": "tools/check_house.py", "old": "no such text", "new": "", "severe": True}
    with pytest.raises(planted.StaleBug, match="stands 0 times"):
        planted.change_of(bug, "tools", ROOT)


def test_a_planted_bug_counts_by_what_became_of_it(tool: Any) -> None:
    from mutation.evidence import planted_summary
    from mutation.trial import Fate, Trial

    fates = {
        "a": Fate.KILLED,
        "b": Fate.TIMEOUT,
        "c": Fate.SURVIVED,
        "d": Fate.UNCOVERED,
        "e": Fate.STALE,
        "f": None,
    }
    rows = []
    for name, fate in fates.items():
        change = SimpleNamespace(name=f"planted/x/{name}", severe=name in "acf")
        rows.append((change, None if fate is None else Trial(change.name, fate)))
    assert planted_summary("x", rows) == {
        "name": "x", "bugs": 6, "severe": 3, "tried": 4, "severe_tried": 2, "killed": 2, "survived": 1, "uncovered": 1,
        "open": ["c", "d"],
    }  # fmt: skip


def test_every_argued_mutant_is_the_one_that_was_argued(tool: Any) -> None:
    """Numbers move with the text: a row whose lines are not those of its mutant argues for nothing."""
    from mutation.evidence import argued_rows, read_argued

    rows, argued = argued_rows(ROOT), read_argued(ROOT)
    assert [row["name"] for row in rows if row["name"] not in argued] == []
    assert all(len(reason) > 20 for reason in argued.values())


def test_an_argued_mutant_that_has_moved_is_open_again(tool: Any, tmp_path: Path) -> None:
    from mutation.evidence import argue, read_argued

    law = tmp_path / "src" / "gantryctl" / "law.py"
    law.parent.mkdir(parents=True)
    law.write_text("def limit(x):\n    return min(x, 8.0) if x > 0.0 else 0.0\n")
    argue(tmp_path, "law.py:limit:compare:0", "At 0 itself both are 0.")
    assert read_argued(tmp_path) == {"law.py:limit:compare:0": "At 0 itself both are 0."}
    # The same name, by now another comparison.
    law.write_text("def limit(x):\n    assert x > -9.0\n    return min(x, 8.0) if x > 0.0 else 0.0\n")
    assert read_argued(tmp_path) == {}
