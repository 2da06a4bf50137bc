"""The table of layers on the architecture page is the contract that the linter of imports enforces."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("layers_page", ROOT / "tools" / "layers_page.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_page_is_up_to_date(tool: ModuleType) -> None:
    page = tool.PAGE.read_text(encoding="utf-8")
    assert page == tool.with_table(page), "run: python tools/layers_page.py"


def test_every_package_of_the_tree_stands_in_the_table(tool: ModuleType) -> None:
    table = "".join(tool.table())
    packages = [path.parent.name for path in (ROOT / "src" / "gantryctl").glob("*/__init__.py")]
    assert len(packages) > 10
    assert [name for name in packages if f"| `{name}` |" not in table] == []
