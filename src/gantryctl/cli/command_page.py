"""The reference page of the commands, and the page of `man gantryctl`.

`python -m gantryctl.cli.command_page docs/reference/cli.md packaging/gantryctl.1` writes them.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import click

from gantryctl.cli.main import GROUPS, cli

_HEAD = """\
# Commands

Written by `python -m gantryctl.cli.command_page docs/reference/cli.md packaging/gantryctl.1`; do not edit, a test
compares. `man gantryctl` says the same where it is installed.

Results go to standard output, messages to standard error; `--json` prints one JSON object and nothing else. Angles are
degrees at the load, speeds deg/s; r/min stands behind a number where it is meant: name plates of motors, requirement
sheets. `-` in the place of a file that is read is standard input.
"""
EXIT_CODES: Final = {
    "0": "done",
    "1": "done, and a criterion is not met, or a motion did not reach its end",
    "2": "the command line, a file that it names, or what it asks for in the present state; nothing has moved",
    "3": "drive, bus, instrument, service, state directory or disk",
    "4": "stopped by an alarm",
    "5": "a fault of gantryctl",
    "130": "interrupted by Ctrl-C, as other tools",
    "141": "standard output was closed before its end (`gantryctl ... | head`), as other tools",
}
ENVIRONMENT: Final = {
    "GANTRYCTL_STATE": "directory of the retained state and the recordings; `$XDG_STATE_HOME/gantryctl` when not set",
    "GANTRYCTL_TRACEBACK": "set: an internal error shows where it happened",
}


def reference_page() -> str:
    """The page as Markdown: every command with the text of its `--help`."""
    # Made from the commands themselves, and compared by a test: a help text and its page cannot differ.
    parts = [_HEAD]
    for title, rows in (
        ("exit code", EXIT_CODES),
        ("environment", {f"`{name}`": meaning for name, meaning in ENVIRONMENT.items()}),
    ):
        table = (f"| {name} | {meaning.replace('|', chr(92) + '|')} |\n" for name, meaning in rows.items())
        parts.append(f"| {title} | |\n|---|---|\n{''.join(table)}")
    for path, command in _commands(cli, ("gantryctl",)):
        context = click.Context(
            command,
            info_name=" ".join(path),
            terminal_width=100,
            max_content_width=100,
            help_option_names=cli.context_settings["help_option_names"],
        )
        parts.append(f"## `{' '.join(path)}`\n\n```text\n{command.get_help(context)}\n```\n")
    return "\n".join(parts)


def _commands(group: click.Group, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if not isinstance(command, click.Group) or command.invoke_without_command:
            yield (*path, name), command
        if isinstance(command, click.Group):
            yield from _commands(command, (*path, name))


def man_page() -> str:
    """The page of `man gantryctl`: what `--help` says of every command and option, in roff."""
    parts = [
        '.TH GANTRYCTL 1 "" "gantryctl" "User Commands"',
        ".SH NAME",
        "gantryctl \\- soft motion controller for big, slow, unbalanced rotary axes",
        ".SH SYNOPSIS",
        ".B gantryctl\n.I COMMAND\n[options]",
        ".SH DESCRIPTION",
        _roff(inspect.cleandoc(cli.help or "")),
    ]
    for title, commands in GROUPS.items():
        parts.append(f'.SH "{title.upper()}"')
        for name in commands:
            command = cli.get_command(click.Context(cli), name)
            assert command is not None
            parts.extend(_entries(command, ("gantryctl", name)))
    for title, rows in (("EXIT STATUS", EXIT_CODES), ("ENVIRONMENT", ENVIRONMENT)):
        parts.append(f'.SH "{title}"')
        parts.extend(f".TP\n.B {_roff(name)}\n{_roff(meaning)}" for name, meaning in rows.items())
    parts.append(".SH SEE ALSO\n.B gantryctl docs\nopens the whole documentation, without a network.")
    return "\n".join(parts) + "\n"


def _entries(command: click.Command, path: tuple[str, ...]) -> Iterator[str]:
    context = click.Context(command, info_name=" ".join(path))
    if not isinstance(command, click.Group) or command.invoke_without_command:
        usage = " ".join((*path, *command.collect_usage_pieces(context)))
        yield f".SS {_roff(usage)}\n{_roff(inspect.cleandoc(command.help or ''))}"
        for parameter in command.params:
            record = parameter.get_help_record(context)
            if record is not None and record[1]:
                yield f".TP\n.B {_roff(record[0])}\n{_roff(record[1])}"
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            part = command.get_command(context, name)
            assert part is not None
            yield from _entries(part, (*path, name))


def _roff(text: str) -> str:
    """Plain text for roff: paragraphs, and no character that means something at the begin of a line."""
    # \b begins a paragraph whose lines click leaves alone.
    text = text.replace("\b\n", "").replace("\\", "\\e").replace("-", "\\-")
    lines = [f"\\&{line}" if line.startswith((".", "'")) else line for line in text.splitlines()]
    return "\n".join(line or ".PP" for line in lines)


if __name__ == "__main__":
    for file, text in zip(sys.argv[1:], (reference_page(), man_page()), strict=False):
        Path(file).write_text(text, encoding="utf-8")
