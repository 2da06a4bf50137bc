"""`explain` knows every code that anything in the program can say."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import gantryctl
from gantryctl.errors import CommandRefused
from gantryctl.operation.notices import all_codes, explain

CODE = re.compile(r"\b((?:CFG-)?(?:ENC|DRV|BRK|CAN|CTL|LIM|INT|THM|PWR|SYS)-\d\d)\b")
OPERATING = ("operation", "program", "runtime", "cli")
"""The packages whose messages a person meets when an axis runs."""


def codes_in_the_source() -> set[str]:
    root = Path(gantryctl.__file__).parent
    files = [file for package in OPERATING for file in (root / package).rglob("*.py")]
    assert len(files) > 50
    return {code for file in files for code in CODE.findall(file.read_text(encoding="utf-8"))}


def test_every_code_in_the_source_is_explained() -> None:
    known = {code for code, _, _ in all_codes()}
    assert codes_in_the_source() <= known


@pytest.mark.parametrize("code", [code for code, _, _ in all_codes()])
def test_every_page_says_what_happened_what_is_done_and_what_to_do(code: str) -> None:
    page = explain(code)
    head, _, *rows = page.splitlines()
    assert head.startswith(code + " ")
    assert [row.split("  ")[0].strip().split(" ")[0] for row in rows] == [
        "Message",
        "Cause",
        "Reaction",
        "What",
    ]
    assert all(len(row) > 12 for row in rows)
    assert "{" not in page


def test_codes_are_sorted_and_told_apart() -> None:
    codes = [code for code, _, _ in all_codes()]
    assert codes == sorted(codes)
    assert len(set(codes)) == len(codes)


def test_a_code_is_found_in_small_letters_and_with_spaces() -> None:
    assert explain(" enc-09 ") == explain("ENC-09")
    assert explain("ctl-03") == explain("CTL-03")


@pytest.mark.parametrize("code", ["", "xx", "ENC", "ENC-99", "CTL-33", "\x1b[31m", "SYS-99"])
def test_an_unknown_code_is_refused_with_a_hint(code: str) -> None:
    with pytest.raises(CommandRefused, match="unknown code"):
        explain(code)


def test_the_hint_names_codes_of_the_same_kind() -> None:
    with pytest.raises(CommandRefused, match=r"ENC-08.*ENC-09"):
        explain("ENC")
