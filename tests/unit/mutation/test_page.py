"""Planted bugs of the page: what vitest says becomes the fate of a bug."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FOUND = """
 Failed Tests 1

 FAIL  tests/live.test.ts > a key that is held > ends with blur of the window
AssertionError: expected 'forward' to be null
"""
BROKEN = """
 Failed Suites 1

 FAIL  tests/live.test.ts [ tests/live.test.ts ]
Error: Transform failed with 1 error:
"""

pytestmark = pytest.mark.usefixtures("mutation_tool")


def test_a_failed_test_finds_a_bug_and_a_page_that_does_not_compile_finds_none() -> None:
    from mutation.page_campaign import fate_of
    from mutation.trial import Fate

    assert fate_of(0, " Test Files  1 passed (1)\n") == (Fate.SURVIVED, "")
    test = "tests/live.test.ts > a key that is held > ends with blur of the window"
    assert fate_of(1, FOUND) == (Fate.KILLED, test)
    assert fate_of(1, BROKEN) == (Fate.STALE, "")


def test_every_planted_bug_of_the_page_names_its_tests() -> None:
    from mutation import planted
    from mutation.page_campaign import is_page

    of_page = 0
    for path in sorted((ROOT / planted.FOLDER).glob("*.toml")):
        for bug in [] if path.stem == "argued" else planted.read_bugs(path):
            if is_page(planted.change_of(bug, path.stem, ROOT)):
                of_page += 1
                assert bug.get("tests"), bug["name"]
                assert all((ROOT / test).is_file() for test in bug["tests"]), bug["name"]
    assert of_page > 0
