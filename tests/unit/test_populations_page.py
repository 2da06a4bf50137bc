"""The tables and figures of the page of populations are those of the evidence, however much of it there is."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(name="tool")
def the_tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("populations_page", ROOT / "tools" / "populations_page.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool


def test_the_page_is_up_to_date(tool: ModuleType) -> None:
    page = tool.PAGE.read_text(encoding="utf-8")
    assert page == tool.filled(page), "run: python tools/populations_page.py"
    assert page.count("| `a_true_deg` |") >= 4


def test_every_figure_is_there_small_with_text_and_no_other(tool: ModuleType) -> None:
    page = tool.PAGE.read_text(encoding="utf-8")
    shown = set(re.findall(r"!\[.*?\]\((populations_\w+\.svg)\)", page))
    assert {"populations_gears_a_true_deg.svg", "populations_compensations_a_true_deg.svg"} <= shown
    assert {path.name for path in tool.PAGE.parent.glob("populations_*.svg")} == shown
    for name in shown:
        text = (tool.PAGE.parent / name).read_text(encoding="utf-8")
        assert len(text) < 40_000, name
        assert "<text" in text
        assert "0.0113<" in text or "a_true" not in name or "sensitivity" in name


def test_the_same_evidence_gives_the_same_figure(tool: ModuleType) -> None:
    parts = tool._parts("gears")
    first, again = (tool._svg(next(iter(tool._figures("gears", parts)))[2], "x") for _ in range(2))
    assert first == again
    assert "grade 6<" in first


def test_a_campaign_without_evidence_has_a_place(tool: ModuleType, tmp_path: Path) -> None:
    tool.EVIDENCE = tmp_path
    page = tool.filled("<!-- campaign gears: written by a tool -->\nold\n<!-- end -->")
    assert page == "<!-- campaign gears: written by a tool -->\nNot run yet.\n<!-- end -->"
