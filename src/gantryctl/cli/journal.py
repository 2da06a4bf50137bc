"""`gantryctl journal`: what happened, and whether the record of it is whole."""

from __future__ import annotations

import json
from pathlib import Path

import click

from gantryctl.cli.options import PATH, config_option, json_option, machine_of, print_json


@click.group()
def journal() -> None:
    """The service's journal: commands, alarms, control, settings, logins."""


def _directory(config_file: Path | None) -> Path:
    from gantryctl.operation.store import state_root

    return state_root() / machine_of(config_file).name


@journal.command("show")
@config_option
@click.option(
    "--last", "count", type=click.IntRange(1, 100_000), default=20, show_default=True, help="How many."
)
@json_option
def journal_show(config_file: Path | None, count: int, as_json: bool) -> int:
    """The newest events, oldest of them first."""
    from gantryctl.service.journal import read_journal

    rows = read_journal(_directory(config_file), limit=count, newest=True)
    if as_json:
        print_json([{"seq": row.seq, **row.values, "hash": row.hash} for row in rows])
        return 0
    for row in rows:
        v = row.values
        who = f"{v['user']} ({v['role']}, {v['place']})" if v["user"] else "-"
        click.echo(f"{row.seq:>6}  {v['utc']}  {v['kind']:<9} {who:<32} {v['text']}")
    return 0


@journal.command("verify")
@config_option
@json_option
def journal_verify(config_file: Path | None, as_json: bool) -> int:
    """Look at every event and its hash. Exit code 1 when the journal is not whole."""
    from gantryctl.service.journal import verify

    verdict = verify(_directory(config_file))
    if as_json:
        print_json({"rows": verdict.rows, "intact": not verdict.wrong, "wrong": verdict.wrong})
    elif verdict.wrong:
        click.echo(f"NOT intact: {verdict.wrong}")
    else:
        click.echo(f"{verdict.rows} events, chain intact")
    return int(bool(verdict.wrong))


@journal.command("export")
@config_option
@click.argument("file", type=PATH)
def journal_export(config_file: Path | None, file: Path) -> int:
    """Write all events as JSON lines to FILE, with their hashes."""
    from gantryctl.errors import UsageError
    from gantryctl.service.journal import read_journal

    directory, after, count = _directory(config_file), 0, 0
    try:
        with file.open("x", encoding="utf-8") as out:
            while rows := read_journal(directory, after):
                for row in rows:
                    out.write(json.dumps({"seq": row.seq, **row.values, "hash": row.hash}) + "\n")
                after, count = rows[-1].seq, count + len(rows)
    except FileExistsError:
        raise UsageError(f"{file}: is there already") from None
    click.echo(f"{count} events in {file}")
    return 0
