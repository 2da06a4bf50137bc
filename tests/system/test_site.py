"""The site of the documentation, opened as a file: its search finds, and nothing comes from elsewhere."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path

import pytest
from playwright.sync_api import Page, sync_playwright

from support.browser import CHROMIUM, FLAGS

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build" / "site"
spec = importlib.util.spec_from_file_location("build_site", ROOT / "tools" / "build_site.py")
assert spec is not None
assert spec.loader is not None
build_site = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = build_site
spec.loader.exec_module(build_site)


def found(page: Page, words: str) -> list[str]:
    """Where the results of a search lead, best first."""
    page.goto((SITE / "search.html").as_uri() + f"?q={words}")
    page.get_by_text(re.compile("Search finished|did not match")).wait_for()
    return [str(link.get_attribute("href")) for link in page.locator("#search-results li a").all()]


def test_the_site_is_whole_and_its_search_works_without_a_network() -> None:
    pytest.importorskip("sphinx")
    # `make test` has built it: then nothing is done again
    assert build_site.build(SITE) == ""
    assert list(build_site.problems(SITE)) == []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page()
        loaded, errors = set[str](), list[str]()
        page.on("request", lambda request: loaded.add(request.url.partition(":")[0]))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto((SITE / "index.html").as_uri())
        page.wait_for_url("**/docs/index.html")
        assert found(page, "ENC-01")[0] == "docs/reference/alarms.html#enc-01-position-jumped"
        assert "docs/how-to/describe-a-machine.html" in found(page, "config check")
        assert "docs/zh/alarms.html" in found(page, "编码器")
        assert found(page, "编码猫") == []
        browser.close()
    assert loaded <= {"file", "data"}
    assert errors == []


def test_what_refers_to_nothing_is_told(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    docs = tmp_path / "source" / "docs"
    docs.mkdir(parents=True)
    (docs / "index.md").write_text("# Index\n\n| to do | |\n|---|---|\n| [A](a.md) | |\n", encoding="utf-8")
    (docs / "a.md").write_text(
        "# A\n\n[1](a.md#gone)\n\n[2](gone.md)\n\n[3](../gone.py)\n\n[4](#gone)\n\n![5](gone.png)\n",
        encoding="utf-8",
    )
    (docs / "alone.md").write_text("# Alone\n", encoding="utf-8")
    said = build_site.build(tmp_path / "site", tmp_path / "source")
    for place in ("a.md:3", "a.md:5", "a.md:7", "a.md:9", "a.md:11", "alone.md"):
        assert place in said, said
    assert not (tmp_path / "site").exists()


def test_a_page_that_loads_from_elsewhere_or_refers_to_nothing_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.html").write_text(
        '<h1 id="here"></h1><a href="#here"></a><a href="https://example.org"></a><img src="data:,">'
        '<a href="#gone"></a><a href="b.html"></a><script src="https://example.org/a.js"></script>',
        encoding="utf-8",
    )
    (tmp_path / "a.css").write_text("@font-face { src: url(https://example.org/f) }", encoding="utf-8")
    assert list(build_site.problems(tmp_path)) == [
        "a.html: #gone is not there",
        "a.html: b.html is not there",
        "a.html: loads https://example.org/a.js",
        "a.css: loads from elsewhere",
    ]
