"""The checker of the core's folders must be able to find something."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def checker() -> ModuleType:
    path = Path(__file__).parents[2] / "tools" / "check_core_layers.py"
    spec = importlib.util.spec_from_file_location("check_core_layers", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "include", ['#include "plant/gear.hpp"', '# include "../plant/gear.hpp"', "#include <loop/run.hpp>"]
)
def test_a_law_that_includes_physics_is_found(checker: ModuleType, tmp_path: Path, include: str) -> None:
    (tmp_path / "control").mkdir()
    (tmp_path / "control" / "law.hpp").write_text(f"#pragma once\n{include}\n")
    assert len(list(checker.wrong_includes(tmp_path))) == 1


def test_laws_may_include_laws_and_the_loop_everything(checker: ModuleType, tmp_path: Path) -> None:
    for folder, include in (("control", "control/clamp.hpp"), ("loop", "plant/gear.hpp")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "a.hpp").write_text(f'#include "{include}"\n')
    assert not list(checker.wrong_includes(tmp_path))
