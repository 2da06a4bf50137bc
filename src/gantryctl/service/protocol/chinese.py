"""Sentences of the service in Chinese, for the page."""

from __future__ import annotations

from gantryctl.program import ALARMS
from gantryctl.program.alarms.words import Words


def phrases() -> dict[str, str]:
    """Every English template with its Chinese one."""
    rows = {
        english: chinese
        for row in ALARMS.values()
        for english, chinese in zip(row.english, row.chinese, strict=True)
    }
    return {**rows, **{words.english: words.chinese for words in Words}}
