"""The tables of the page of populations are those of the evidence."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_page_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location("populations_page", ROOT / "tools" / "populations_page.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    page = tool.PAGE.read_text(encoding="utf-8")
    assert page == tool.with_tables(page), "run: python tools/populations_page.py"
    assert page.count("| `a_true_deg` |") >= 4
