"""The tool that changes the sources lies beside the product, in tools/."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def mutation_tool(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package `mutation` can be imported; afterwards no other test finds it."""
    monkeypatch.syspath_prepend(str(ROOT / "tools"))
    yield
    for name in [name for name in sys.modules if name.partition(".")[0] == "mutation"]:
        del sys.modules[name]
