"""The tool that changes the core in C++: what it reads, and how a switch is written."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def tool(mutation_tool: None) -> SimpleNamespace:
    from mutation import cpp_switch, cpp_tokens, cpp_tree, planted
    from mutation.mutant import Change

    return SimpleNamespace(
        tokens=cpp_tokens,
        tree=cpp_tree,
        switch=cpp_switch,
        planted=planted,
        Change=Change,
    )


def test_every_source_of_the_core_is_read(tool: Any) -> None:
    for path in sorted((ROOT / "core").glob("*/*.hpp")):
        tool.tree.read(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "wrong",
    ["void f() { if (a <b) g(); }", "void f() { a = ; }", "void f() { goto end; }", 'void f() { "a; }'],
)
def test_what_is_not_understood_is_refused(tool: Any, wrong: str) -> None:
    with pytest.raises((tool.tokens.NotRead, IndexError)):
        tool.tree.read(wrong)


def switched(tool: Any, source: str, old: str, new: str) -> str | None:
    """The text of one planted change behind switch 7, in one line; None where there is none."""
    start = source.index(old)
    change = tool.Change("x", "core/x.hpp", start, start + len(old), new.encode(), 1, 1)
    found = tool.switch.Switched(source.encode(), {7: change})
    return None if found.alone else " ".join(found.text().replace("::gantry_mutation::", "").split())


def test_a_change_stands_beside_what_is_sound(tool: Any) -> None:
    body = "void f() { const T y = a - b * c; go(y); last = y; }"
    assert (
        switched(tool, body, "a - b", "a + b")
        == "void f() { const T y = ( on(7) ? (a + b * c) : (a - b * c)); go(y); last = y; }"
    )
    assert (
        switched(tool, body, "go(y);", "")
        == "void f() { const T y = a - b * c; { if (on(7)) { } else { go(y); } } last = y; }"
    )
    # An order of two statements.
    assert (
        switched(tool, body, "go(y); last = y;", "last = y; go(y);")
        == "void f() { const T y = a - b * c; { if (on(7)) { last = y; go(y); } else { go(y); last = y; } } }"
    )


def test_a_change_that_tears_an_expression_apart_takes_in_what_it_changes(tool: Any) -> None:
    """b becomes b + d: in a - b * c that is a - b + d * c, not a - (b + d) * c."""
    body = "void f() { y = a - b * c; }"
    assert switched(tool, body, "b", "b + d") == "void f() { y = ( on(7) ? (a - b + d * c) : (a - b * c)); }"


def test_a_name_that_is_declared_is_not_switched(tool: Any) -> None:
    assert switched(tool, "void f() { const T y = a; go(y); }", "T y = a; go(y)", "T z = a; go(z)") is None


def test_a_constant_is_computed_when_it_is_read(tool: Any) -> None:
    written = switched(tool, "constexpr double kStep = 0.5;", "0.5", "0.25")
    assert written is not None
    assert "struct kStep_number { operator double() const { return ( on(7) ? (0.25) : (0.5)); } };" in written


def test_every_bug_planted_in_the_core_fits_behind_a_switch(tool: Any) -> None:
    bugs = tool.planted.read_bugs(ROOT / tool.planted.FOLDER / "core.toml")
    changes = [tool.planted.change_of(bug, "core", ROOT) for bug in bugs]
    for file, some in tool.switch.numbered(changes).items():
        found = tool.switch.Switched((ROOT / file).read_bytes(), some)
        assert not found.alone, [some[number].name for number in found.alone]
