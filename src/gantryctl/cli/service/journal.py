"""`gantryctl journal`: what happened, and whether the record of it is whole."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import PATH, config_option, json_option, machine_of, print_json

if TYPE_CHECKING:
    from gantryctl.service.recorder.journal import Anchor


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
    """Show the newest events, oldest of them first."""
    from gantryctl.service.recorder.journal import read_journal

    rows = read_journal(_directory(config_file), limit=count, newest=True)
    if as_json:
        print_json([{"seq": row.seq, **row.values, "hash": row.hash} for row in rows])
        return 0
    for row in rows:
        v = row.values
        who = f"{v['user']} ({v['role']}, {v['place']})" if v["user"] else "-"
        click.echo(f"{row.seq:>6}  {v['utc']}  {v['kind']:<9} {who:<32} {v['text']}")
    return 0


@journal.command("anchor")
@config_option
def journal_anchor(config_file: Path | None) -> int:
    """Print number, hash and date of the newest event: one line to keep elsewhere, every day for example.

    Whoever can write the journal could make a whole new one; not one in which these lines are true.
    """
    from gantryctl.service.recorder.journal import anchor

    click.echo(" ".join(str(part) for part in anchor(_directory(config_file))))
    return 0


@journal.command("verify")
@config_option
@click.option("--anchor", "anchor_file", type=PATH, help="Lines of `journal anchor` that must be true.")
@json_option
def journal_verify(config_file: Path | None, anchor_file: Path | None, as_json: bool) -> int:
    """Check every event and its hash. Exit code 1 when the journal is not whole."""
    from gantryctl.service.recorder.journal import verify

    # The chain alone proves that nothing was changed in between; only lines kept elsewhere find a journal made anew.
    anchors = [] if anchor_file is None else _anchors(anchor_file)
    verdict = verify(_directory(config_file), anchors)
    if as_json:
        print_json(
            {
                "rows": verdict.rows,
                "first": verdict.first,
                "anchors_given": len(anchors),
                "anchors_found": verdict.anchors,
                "intact": not verdict.wrong,
                "wrong": verdict.wrong,
            }
        )
    elif verdict.wrong:
        click.echo(f"NOT intact: {verdict.wrong}")
    else:
        since = f" from number {verdict.first} on" if verdict.first > 1 else ""
        click.echo(f"{verdict.rows} events{since}, chain intact")
        if anchors:
            # Events taken out by size or age leave a chain that begins later: their anchors are no fault.
            gone = "" if verdict.anchors == len(anchors) else ", the others are of events taken out since"
            click.echo(f"{verdict.anchors} of {len(anchors)} anchors found{gone}")
    return int(bool(verdict.wrong))


def _anchors(file: Path) -> list[Anchor]:
    """Read the lines of a file.

    Raises:
        UsageError: it cannot be read, or one is no line of `journal anchor`.
    """
    from gantryctl.errors import UsageError
    from gantryctl.service.recorder.journal import Anchor

    try:
        lines = [line.split() for line in file.read_text(encoding="utf-8").splitlines() if line.strip()]
        found = [Anchor(int(seq), digest, utc) for seq, digest, utc in lines]
    except OSError as fault:
        raise UsageError(f"{file}: {fault.strerror or fault}") from fault
    except ValueError:
        raise UsageError(f"{file}: not lines of `gantryctl journal anchor`") from None
    if not found:
        raise UsageError(f"{file}: is empty; `gantryctl journal anchor >> {file}` adds a line")
    return found


@journal.command("export")
@config_option
@click.argument("file", type=PATH)
def journal_export(config_file: Path | None, file: Path) -> int:
    """Write all events as JSON lines to FILE, with their hashes."""
    from gantryctl.errors import UsageError
    from gantryctl.service.recorder.journal import read_journal

    directory, after, count = _directory(config_file), 0, 0
    try:
        # Never over another export: it may be the only proof of events that were taken out since.
        with file.open("x", encoding="utf-8") as out:
            # In portions: a journal may hold 500 MB.
            while rows := read_journal(directory, after):
                for row in rows:
                    out.write(json.dumps({"seq": row.seq, **row.values, "hash": row.hash}) + "\n")
                after, count = rows[-1].seq, count + len(rows)
    except FileExistsError:
        raise UsageError(f"{file}: is there already") from None
    click.echo(f"{count} events in {file}")
    return 0
