"""`gantryctl journal`: what happened, and whether the record of it is whole."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import config_option, json_option, machine_of, print_json
from gantryctl.cli.values import INPUT, PATH, Whole

if TYPE_CHECKING:
    from gantryctl.service.recorder.journal.chain import Anchor


@click.group()
def journal() -> None:
    """The service's journal: commands, alarms, control, settings, logins."""


def _directory(config_file: Path | None) -> Path:
    from gantryctl.operation.store import state_root

    return state_root() / machine_of(config_file).name


@journal.command("show")
@config_option
@click.option("--last", "count", type=Whole(1, 100_000), default=20, show_default=True, help="How many.")
@click.option("--notes", "notes_only", is_flag=True, help="The lines of the shift log only.")
@json_option
def journal_show(config_file: Path | None, count: int, notes_only: bool, as_json: bool) -> int:
    """Show the newest events, oldest of them first."""
    from gantryctl.service.protocol.messages import NOTE
    from gantryctl.service.recorder.journal.reading import read_journal

    kind = NOTE if notes_only else ""
    rows = read_journal(_directory(config_file), limit=count, newest=True, kind=kind)
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
    """Print number, hash and date of the newest event, and the journal's name: one line to keep elsewhere.

    The service keeps such a line every day by itself, outside the state directory. Whoever can write the journal and
    has its key could make a whole new one; not one in which the lines that you keep on another machine are true.
    """
    from gantryctl.service.recorder.journal.reading import anchor

    click.echo(anchor(_directory(config_file)).line)
    return 0


@journal.command("copy")
@config_option
@click.argument("file", type=PATH)
def journal_copy(config_file: Path | None, file: Path) -> int:
    """Copy the journal to FILE, for another machine; an older copy of it there is replaced.

    An older copy must have nothing that the journal has not: otherwise it is left as it is, and the exit code is 2.
    """
    from gantryctl.service.recorder.journal.places import places_of
    from gantryctl.service.recorder.journal.reading import anchor, copy_journal

    directory = _directory(config_file)
    newest = anchor(directory)
    found = copy_journal(places_of(directory).database, file)
    since = f", {found.only_one} of them new" if found.same else ""
    click.echo(f"events up to {newest.seq} in {file}{since}")
    return 0


@journal.command("verify")
@config_option
@click.option("--anchor", "anchor_file", type=INPUT, help="Lines of `journal anchor` that must be true.")
@click.option("--file", type=PATH, help="Check this file: a copy, or one that was moved aside.")
@click.option("--copy", "copy_file", type=PATH, help="Compare with this copy, event by event.")
@click.option("--key", "key_file", type=INPUT, help="Key of the journal, where it is not in its place.")
@click.option("--without-key", is_flag=True, help="Check the chain only, not the seals.")
@json_option
def journal_verify(
    config_file: Path | None,
    anchor_file: Path | None,
    file: Path | None,
    copy_file: Path | None,
    key_file: Path | None,
    without_key: bool,
    as_json: bool,
) -> int:
    """Check every event, its hash and its seal, and the newest one against its mirrors.

    Exit code 1 when the journal is not whole: then it says which events are certain, changed and missing.
    """
    from gantryctl.errors import UsageError
    from gantryctl.service.recorder.journal.key import read_key
    from gantryctl.service.recorder.journal.places import places_of
    from gantryctl.service.recorder.journal.proof import kept_anchors, verify, verify_file
    from gantryctl.service.recorder.journal.reading import compare

    if key_file is not None and without_key:
        raise UsageError("--key or --without-key, not both")
    places = places_of(_directory(config_file))
    # The chain alone proves that nothing was changed in between; only lines kept elsewhere find a journal made anew.
    anchors = [] if anchor_file is None else _anchors(anchor_file)
    key = None if without_key else read_key(key_file or places.key) if file or key_file else None
    if file is not None:
        known = [*kept_anchors(places.anchors), *anchors]
        verdict = verify_file(file, key, anchors=known, given=anchors)
    else:
        verdict = verify(places.directory, anchors, key=key, keyed=not without_key)
    compared = None if copy_file is None else compare(file or places.database, copy_file)
    wrong = verdict.wrong or (compared.trouble if compared is not None else "")
    if as_json:
        print_json(
            {
                "rows": verdict.rows,
                "first": verdict.first,
                "anchors_given": len(anchors),
                "anchors_found": verdict.anchors,
                "sealed": verdict.sealed,
                "intact": not wrong,
                "wrong": wrong,
                "certain": verdict.certain,
                "changed": verdict.changed,
                "missing": verdict.missing,
                "copy": None if compared is None else compared._asdict(),
            }
        )
        return int(bool(wrong))
    if verdict.wrong:
        click.echo(f"NOT intact: {verdict.wrong}")
        for name in ("certain", "changed", "missing"):
            click.echo(f"  {name:<8} {', '.join(map(str, getattr(verdict, name))) or 'no event'}")
    else:
        since = f" from number {verdict.first} on" if verdict.first > 1 else ""
        checked = "chain and seals intact" if verdict.sealed else "chain intact, seals not checked"
        click.echo(f"{verdict.rows} events{since}, {checked}")
        if anchors:
            # Events taken out by size or age leave a chain that begins later: their anchors are no fault.
            gone = "" if verdict.anchors == len(anchors) else ", the others are of events taken out since"
            click.echo(f"{verdict.anchors} of {len(anchors)} anchors found{gone}")
    if compared is not None:
        click.echo(
            f"copy: NOT alike: {compared.trouble}"
            if compared.trouble
            else f"copy: {compared.same} events alike, {compared.only_one} newer ones only in the journal"
        )
    return int(bool(wrong))


def _anchors(file: Path) -> list[Anchor]:
    """Read the lines of a file.

    Raises:
        UsageError: it cannot be read, or one is no line of `journal anchor`.
    """
    from gantryctl.errors import UsageError
    from gantryctl.files import unreadable
    from gantryctl.service.recorder.journal.chain import anchors_in

    try:
        found = anchors_in(file.read_text(encoding="utf-8-sig"))
    except OSError as fault:
        raise unreadable(file, fault) from fault
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
    from gantryctl.files import unwritable
    from gantryctl.service.recorder.journal.reading import read_journal

    directory, after, count = _directory(config_file), 0, 0
    # Before a file is made for nothing.
    read_journal(directory, limit=1)
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
    except OSError as fault:
        raise unwritable(file, fault) from fault
    click.echo(f"{count} events in {file}")
    return 0
