"""The WebAssembly of the core takes every number of plant and drive that the Python module has.

Without a compiler: by the names in `core/web/axis.cpp` and in the headers (bits: tests/system/test_wasm.py).
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gantryctl import _core

CORE = Path(__file__).parents[2] / "core"


def names_of(params: type) -> set[str]:
    return {
        name for name in dir(params) if not name.startswith("_") and not callable(getattr(params(), name))
    }


@pytest.mark.parametrize(
    ("params", "of", "header"),
    [(_core.PlantParams, "plant", "params.hpp"), (_core.DriveParams, "drive", "drive.hpp")],
)
def test_every_number_has_a_place(params: type, of: str, header: str) -> None:
    listed = set(re.findall(r"^  X\((\w+),", (CORE / "plant" / header).read_text("utf-8"), re.MULTILINE))
    source = (CORE / "web" / "axis.cpp").read_text("utf-8").replace("\\n", "\n")
    by_hand = set(re.findall(rf"\b{of}\.(\w+)(?:\[\d+\])?$", source, re.MULTILINE))
    assert by_hand
    assert names_of(params) <= listed | by_hand
    assert by_hand <= names_of(params)
