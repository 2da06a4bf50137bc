"""A change takes effect in a process that has imported the sources already, or is told to need a fresh one."""

from __future__ import annotations

import gc
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

import pytest

SOURCE = """
def above(most):
    def rule(number):
        return number > most
    return rule

RULES = {"a": above(3)}
"""


@pytest.fixture
def warm(mutation_tool: None) -> Any:
    from mutation import warm

    return warm


@pytest.mark.parametrize(
    ("new", "function", "seen"),
    [("number >= most", "above", True), ("number >= 3", "above", None), ("number >= most", "", None)],
)
def test_a_closure_that_a_module_made_when_it_was_imported_is_changed_too(
    warm: Any, new: str, function: str, seen: bool | None
) -> None:
    """Not one that would have other variables, nor what no function holds."""
    path, made = "/tree/rules.py", dict[str, Any]()
    exec(compile(SOURCE, path, "exec"), made)  # noqa: S102 - the source above
    functions: list[FunctionType] = [made["above"], made["RULES"]["a"]]
    tests = object.__new__(warm.WarmTests)
    tests._tree = SimpleNamespace(root=Path("/tree"))
    tests._functions = {(path, each.__code__.co_qualname): [each] for each in functions}
    change = SimpleNamespace(file="rules.py", function=function, name="a change")
    text = SOURCE.replace("number > most", new).encode()
    if seen is None:
        with pytest.raises(warm.NotPatched):
            tests._patch(change, text)
    else:
        tests._patch(change, text)()
        assert made["RULES"]["a"](3) is seen
        assert made["above"](4)(4)


def test_what_the_collection_of_tests_has_frozen_is_changed_too(
    warm: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As tests/conftest.py does: else every change wants a fresh process, a hundred times as long."""
    path, made = str(tmp_path / "rules.py"), dict[str, Any]()

    def collect(**_: object) -> None:
        exec(compile(SOURCE, path, "exec"), made)  # noqa: S102 - the source above
        gc.freeze()

    hook = SimpleNamespace(pytest_sessionstart=lambda **_: None, pytest_collection=collect)
    plugins = SimpleNamespace(register=lambda *_: None)
    config = SimpleNamespace(pluginmanager=plugins, _do_configure=lambda: None, hook=hook)
    monkeypatch.setattr(warm, "_prepareconfig", lambda *_: config)
    monkeypatch.setattr(warm, "Session", SimpleNamespace(from_config=lambda _: SimpleNamespace(items=[])))
    tests = warm.WarmTests(SimpleNamespace(root=tmp_path), [])
    gc.unfreeze()
    assert tests._functions[path, "above"] == [made["above"]]
