"""The built page as files: small, self-contained, and of the same tables as the service."""

from __future__ import annotations

import gzip
import importlib.util
import re
from pathlib import Path

from gantryctl.commissioning import STEPS
from gantryctl.machine import default_machine

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "src" / "gantryctl" / "gateway" / "page"
NAMES_ONLY = ("http://www.w3.org/", "https://svelte.dev/e/")
"""Namespaces, and where an error of the framework is explained: text, never fetched."""


def files() -> list[Path]:
    return [path for path in PAGE.rglob("*") if path.is_file()]


def test_the_page_weighs_less_than_150_kb_gzipped() -> None:
    assert (PAGE / "index.html").exists()
    assert sum(len(gzip.compress(path.read_bytes(), 9)) for path in files()) < 150_000


def test_no_file_names_another_host() -> None:
    for path in files():
        found = re.findall(r"(?:https?:)?//[\w.-]+\.[a-z]{2,}/[^\s\"'`)]*", path.read_text(encoding="utf-8"))
        assert [address for address in found if not address.startswith(NAMES_ONLY)] == [], path


def test_the_first_file_has_nothing_inline() -> None:
    text = (PAGE / "index.html").read_text(encoding="utf-8")
    assert re.findall(r"<script(?![^>]*src=)|<style| style=| on\w+=", text) == []


def test_the_tables_of_the_page_are_those_of_the_service() -> None:
    """After a change: make page."""
    spec = importlib.util.spec_from_file_location("page_tables", ROOT / "tools" / "page_tables.py")
    assert spec is not None
    assert spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    for name, text in tables.texts().items():
        assert (ROOT / "hmi/src/lib" / name).read_text(encoding="utf-8") == text


def test_steps_of_commissioning_have_the_same_figures_in_chinese() -> None:
    """How far the axis could move: a person who reads Chinese stands as far away."""
    text = (ROOT / "hmi/src/lib/steps_zh.ts").read_text(encoding="utf-8")
    chinese = {key: told for key, *told in re.findall(r"(\w+): \['(.*?)', '(.*?)', '(.*?)'\]", text)}
    assert chinese.keys() == {step.key for step in STEPS}
    for step in STEPS:
        _, does, moves = chinese[step.key]
        for english, other in ((step.does, does), (step.could_move(default_machine()), moves)):
            assert bool(english) is bool(other), step.key
            assert re.findall(r"\d+\.?\d*", english) == re.findall(r"\d+\.?\d*", other), step.key


def test_the_lock_file_names_no_package_host() -> None:
    text = (ROOT / "hmi" / "package-lock.json").read_text(encoding="utf-8")
    assert '"resolved"' not in text
    assert '"integrity"' in text
