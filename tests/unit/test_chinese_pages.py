"""The operator's guide in Chinese says as much as the English one: section by section, command by command."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def shape(page: str) -> list[str]:
    """Kind of every block in its order, commands as they are, and codes and keys that stand in the text."""
    found = []
    for line in page.splitlines():
        if line.startswith("#"):
            found.append("section")
        elif line.startswith("    "):
            found.append(line.partition("  #")[0].strip())
        elif line.startswith("| ") or re.match(r"\d\. ", line):
            found.append(line[:2])
        found.extend(
            sorted(re.findall(r"[A-Z]{3}-\d\d|`[^`]*`", line)) if not line.startswith("    ") else []
        )
    return found


def differences(english: str, chinese: str) -> list[str]:
    """What only one of both has, section by section."""
    parts = [re.split(r"(?m)^(?=#)", page) for page in (english, chinese)]
    if len(parts[0]) != len(parts[1]):
        return [f"{len(parts[0])} sections and {len(parts[1])}"]
    return [
        f"{ours.splitlines()[0]}: {sorted(set(shape(theirs)) ^ set(shape(ours)))}"
        for theirs, ours in zip(*parts, strict=True)
        if sorted(shape(theirs)) != sorted(shape(ours))
    ]


@pytest.mark.parametrize("name", ["operate.md", "after-an-alarm.md"])
def test_both_languages_have_the_same_sections_commands_codes_and_rows(name: str) -> None:
    english = (DOCS / "how-to" / name).read_text(encoding="utf-8")
    chinese = (DOCS / "zh" / name).read_text(encoding="utf-8")
    assert differences(english, chinese) == []
    # a translation that has lost a command, a section or a row
    for lost in (r"    gantryctl .*\n", r"## .*\n", r"\| .*\|\n(?=\|[^-])"):
        assert differences(english, re.sub(rf"(?m)^{lost}", "", chinese, count=1)) != [], lost
