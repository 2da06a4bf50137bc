"""Tables and paragraphs on a terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from gantryctl.engineering.report.text import TextTable


def print_table(table: TextTable) -> None:
    """A table of text, words left, numbers right; an empty line and the title above it where it has one."""
    from rich.console import Console
    from rich.table import Table

    shown = Table(
        box=None, pad_edge=False, title=table.title or None, title_justify="left", title_style="bold"
    )
    for number, head in enumerate(table.heads):
        shown.add_column(head, justify="left" if number in table.left else "right")
    for row in table.rows:
        shown.add_row(*row)
    console = Console(width=120, highlight=False)
    if table.title:
        console.print()
    console.print(shown)


def paragraph(text: str) -> None:
    """One sentence of a list, wrapped."""
    import textwrap

    # A command that is told must not be cut behind one of its hyphens: it is copied.
    click.echo(textwrap.fill(text, 110, initial_indent="- ", subsequent_indent="  ", break_on_hyphens=False))


def shown(value: float, digits: int) -> float:
    """Round a number for people."""
    # -0.0 + 0.0 is 0.0: no minus before a zero.
    return round(value, digits) + 0.0
