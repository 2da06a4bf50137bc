"""The reference page of the commands: `python -m gantryctl.cli.command_page FILE` writes it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import click

from gantryctl.cli.main import cli

_HEAD = """\
# Commands

Written by `python -m gantryctl.cli.command_page docs/reference/cli.md`; do not edit, a test compares.

Results go to standard output, messages to standard error; `--json` prints one JSON object and nothing else. Angles are
degrees at the load, speeds deg/s; speeds of the speed test are r/min, as their options say. `-` in the place of a file
that is read is standard input.

| exit code | |
|---|---|
| 0 | done |
| 1 | done, and a criterion is not met, or a motion did not reach its end |
| 2 | the command line, a file that it names, or what it asks for in the present state; nothing has moved |
| 3 | drive, bus, instrument, service, state directory or disk |
| 4 | stopped by an alarm |
| 5 | a fault of gantryctl |
| 130 | interrupted by Ctrl-C, as other tools |
| 141 | standard output was closed before its end (`gantryctl ... \\| head`), as other tools |

| environment | |
|---|---|
| `GANTRYCTL_STATE` | directory of the retained state and the recordings; `$XDG_STATE_HOME/gantryctl` when not set |
| `GANTRYCTL_TRACEBACK` | set: an internal error shows where it happened |
"""


def reference_page() -> str:
    """The page as Markdown: every command with the text of its `--help`."""
    # Made from the commands themselves, and compared by a test: a help text and its page cannot differ.
    parts = [_HEAD]
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


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
