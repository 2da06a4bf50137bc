"""Planted bugs and argued mutants: each fits the source as it is, and counts as what became of it."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).resolve().parents[3]

pytestmark = pytest.mark.usefixtures("mutation_tool")


def test_every_planted_bug_still_fits_its_source_and_is_a_program() -> None:
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


def test_a_planted_bug_whose_text_is_gone_is_told() -> None:
    from mutation import planted

    bug = {"name": "x", "file": "tools/check_house.py", "old": "no such text", "new": "", "severe": True}
    with pytest.raises(planted.StaleBug, match="stands 0 times"):
        planted.change_of(bug, "tools", ROOT)


def test_a_planted_bug_counts_by_what_became_of_it() -> None:
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


def test_every_argued_mutant_is_the_one_that_was_argued() -> None:
    """Numbers move with the text: a row whose lines are not those of its mutant argues for nothing."""
    from mutation.evidence import argued_rows, read_argued

    rows, argued = argued_rows(ROOT), read_argued(ROOT)
    assert [row["name"] for row in rows if row["name"] not in argued] == []
    assert all(len(reason) > 20 for reason in argued.values())


def test_an_argued_mutant_that_has_moved_is_open_again(tmp_path: Path) -> None:
    from mutation.evidence import argue, read_argued

    law = tmp_path / "src" / "gantryctl" / "law.py"
    law.parent.mkdir(parents=True)
    law.write_text("def limit(x):\n    return min(x, 8.0) if x > 0.0 else 0.0\n")
    argue(tmp_path, "law.py:limit:compare:0", "At 0 itself both are 0.")
    assert read_argued(tmp_path) == {"law.py:limit:compare:0": "At 0 itself both are 0."}
    # The same name, by now another comparison.
    law.write_text("def limit(x):\n    assert x > -9.0\n    return min(x, 8.0) if x > 0.0 else 0.0\n")
    assert read_argued(tmp_path) == {}
