"""Chinese for everything that the service says to a person: complete, with the same numbers in it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from string import Formatter

import pytest

from gantryctl.program import ALARMS, Code
from gantryctl.program.alarms.chinese import ALARMS_ZH
from gantryctl.service.protocol.chinese import phrases

SOURCE = Path(__file__).resolve().parents[3] / "src" / "gantryctl"
FILES = sorted((SOURCE / "program").rglob("*.py")) + [
    SOURCE / "service" / f"{name}.py"
    for name in (
        "clients/hub",
        "command/arming",
        "command/authority",
        "command/inbox",
        "command/lease",
        "command/operator",
        "command/rules",
    )
]


def fields(template: str) -> set[str]:
    return {name for _, name, _, _ in Formatter().parse(template) if name}


def test_every_alarm_has_its_words_with_the_same_fields() -> None:
    assert set(ALARMS_ZH) == set(ALARMS)
    for code, row in ALARMS.items():
        words = ALARMS_ZH[code]
        assert fields(words.message) == fields(row.message), code
        assert all(words), code


def test_every_sentence_keeps_its_fields_and_is_chinese() -> None:
    for english, chinese in phrases().items():
        assert fields(chinese) == fields(english), english
        words = re.sub(r"\{\w+\}", "", chinese)
        assert re.search(r"[\u4e00-\u9fff°]|°/s", words), english


def pattern(template: str) -> str:
    """As the page matches it (hmi/src/lib/said.ts)."""
    parts = []
    for text, name, digits, _ in Formatter().parse(template):
        parts.append(re.escape(text))
        if name:
            parts.append(r"[-+]?[\d.]+" if digits else r"[A-Z]{3}-\d+" if name == "code" else ".+?")
    return "".join(parts)


def sample(node: ast.expr) -> str | None:
    """A text that this expression may give; None for what is no text."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if not isinstance(node, ast.JoinedStr):
        return None
    parts = []
    for part in node.values:
        if isinstance(part, ast.Constant):
            parts.append(str(part.value))
        elif isinstance(part, ast.FormattedValue):
            name = ast.unparse(part.value)
            number = part.format_spec or name in ("seq", "number", "behind", "most", "message.frame")
            word = "CTL-03" if name.endswith(".code") else "deg" if name == "unit" else "words"
            parts.append("1.5" if number or name == "code" else word)
    return "".join(parts)


def said_in(path: Path) -> Iterator[tuple[str, str]]:
    """Texts of refusals in one file: arguments of calls, and what is kept in a variable first."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        values: list[ast.expr] = []
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] == "refusal":
            values = [key.value for key in node.keywords if key.arg == "measured"]
        elif (
            isinstance(node, ast.Call) and ast.unparse(node.func) == "MessageRefused" and len(node.args) == 2
        ):
            if ast.unparse(node.args[0]) != "'SEC-05'":  # the page never sends what is not understood
                values = [node.args[1]]
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in (
            "text",
            "reason",
            "by",
            "words",
        ):
            values = [node.value]
        for value in values:
            options = [value.body, value.orelse] if isinstance(value, ast.IfExp) else [value]
            for text in map(sample, options):
                if text is not None:
                    yield f"{path.name}:{node.lineno}", text


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_reason_of_a_refusal_has_a_chinese_sentence(path: Path) -> None:
    """A new one goes to service/chinese.py; then `make page`."""
    known = re.compile("|".join(f"(?:{pattern(english)})" for english in phrases()))
    missing = [(where, text) for where, text in said_in(path) if not known.fullmatch(text)]
    assert missing == []


def test_the_check_would_find_a_missing_one() -> None:
    found = [text for path in FILES for _, text in said_in(path)]
    assert len(found) > 40
    assert "the mode changes at standstill only" in found
    assert Code.CTL_14 in ALARMS
