"""Progress of a command: one line of a terminal, written over and taken away; nothing in a log or with --json."""

from __future__ import annotations

import io
import time
from contextlib import redirect_stderr

import pytest

from gantryctl.cli.main import COMMANDS, GROUPS
from gantryctl.cli.progress import metered
from support.command_line import Terminal, done


def said(err: io.StringIO, monkeypatch: pytest.MonkeyPatch, *, quiet: bool = False) -> str:
    """What is said of a work of 100 parts, each of which takes a second."""
    clock = iter(range(1000))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(clock)))
    with redirect_stderr(err), metered(100.0, quiet=quiet) as meter:
        for part in range(100):
            meter.reach(part + 1.0)
        assert meter.done == 100.0
    return err.getvalue()


def test_a_terminal_sees_one_line_that_is_gone_at_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    text = said(Terminal(), monkeypatch)
    lines = [line.rstrip() for line in text.split("\r") if line.strip()]
    assert lines[0] == "  2 %, about 98 s left"
    assert lines[-1].startswith("  9")
    assert "\n" not in text
    assert text.endswith("\r")
    assert not text.split("\r")[-2].strip()


def test_nothing_is_said_where_nobody_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    assert said(io.StringIO(), monkeypatch) == ""
    assert said(Terminal(), monkeypatch, quiet=True) == ""


def test_the_help_has_every_command_once_in_a_group() -> None:
    assert sum(map(len, GROUPS.values())) == len(COMMANDS)
    text = done("--help").out
    places = [text.index(f"\n{title}:\n") for title in GROUPS]
    assert places == sorted(places)
    for title, after in zip(GROUPS, [*places[1:], len(text)], strict=True):
        part = text[text.index(f"\n{title}:\n") : after]
        assert all(f"\n  {name} " in part for name in GROUPS[title])
