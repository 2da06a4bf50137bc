"""`gantryctl state`: where the state of a machine lies, and how it is removed."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

import click

from gantryctl.cli.options import config_option, confirm, json_option, machine_of, print_json
from gantryctl.terminal import tell

_MEANINGS: Final = {
    "retain.*": "memory of the controller: zero, alarms, counters",
    "plant.json": "where the simulated machine stands",
    "bus.json": "what the last run counted on the bus",
    "machine.json": "which machine file it belongs to",
    "service.json": "settings of the service",
    "run.state": "how the last run of the service ended, and where",
    "traces": "recordings",
    "journal*": "journal: commands, alarms and logins",
    "opcua*": "key and certificates of OPC UA",
    "*.lock": "lets one command or service at a time run the machine",
    "lock": "lets one command or service at a time run the machine",
    "commissioning*": "what commissioning has proven",
}


class Part(NamedTuple):
    """An entry of a machine's directory."""

    path: Path
    size_bytes: int
    files: int
    changed: datetime

    @property
    def meaning(self) -> str:
        """What it holds."""
        return next((text for name, text in _MEANINGS.items() if self.path.match(name)), "")


@click.group()
def state() -> None:
    """Where the state of machines lies, and how it is removed."""


@state.command()
@config_option
@json_option
def show(config_file: Path | None, as_json: bool) -> None:
    """Where the state of the machine lies, what is in it, and what else lies beside it.

    GANTRYCTL_STATE names another place. Removing the package leaves all of it; whoever wants nothing left removes the
    directory that the first line names.
    """
    from gantryctl.operation.store import state_root

    root = state_root()
    folder = root / machine_of(config_file).name
    parts = list(_parts(folder))
    others = sorted(path for path in root.glob("*") if path != folder)
    if as_json:
        print_json(
            {
                "root": str(root),
                "directory": str(folder),
                "parts": [
                    {"path": str(part.path), "meaning": part.meaning, "size_bytes": part.size_bytes}
                    for part in parts
                ],
                "others": [str(path) for path in others],
            }
        )
        return
    click.echo(f"root       {root}")
    click.echo(f"directory  {folder}{'' if parts else ', empty'}")
    _list(parts)
    if others:
        click.echo("beside it, of other machines or of all:")
        for path in others:
            click.echo(f"  {path.name}")


@state.command()
@config_option
@click.option("--yes", is_flag=True, help="Do not ask.")
def remove(config_file: Path | None, yes: bool) -> None:
    """Remove the state of one machine: its memory, its recordings, and its journal with them.

    Everything is listed first, and asked about. Refused while a service or another command runs the machine. The next
    command begins with a new machine at 0 deg; `gantryctl backup create` keeps what there is.
    """
    from gantryctl.errors import CommandRefused, UsageError
    from gantryctl.operation.store import StateStore, state_root

    machine = machine_of(config_file)
    folder = state_root() / machine.name
    parts = list(_parts(folder))
    if not parts:
        click.echo(f"{folder}: there is nothing to remove")
        return
    if folder.is_symlink() or not (folder / "lock").is_file():
        raise UsageError(f"{folder}: no run of gantryctl has made this directory; it is left alone")
    # Held until all is gone: no run may begin in a directory that is going.
    with StateStore(machine) as store:
        if list(_parts(store.directory)) != parts:
            parts = list(_parts(store.directory))
        tell(f"in {folder}:")
        _list(parts, err=True)
        if not yes:
            confirm(f"Remove all of this, {sum(part.files for part in parts)} files?", "nothing is removed")
        try:
            shutil.rmtree(folder)
        except OSError as fault:
            raise CommandRefused(f"{fault.filename}: cannot be removed: {fault.strerror}") from None
    click.echo(f"{folder}: removed")


def _parts(folder: Path) -> Iterator[Part]:
    for path in sorted(folder.glob("*")):
        files = (
            [path]
            if not path.is_dir() or path.is_symlink()
            else [one for one in path.rglob("*") if one.is_file()]
        )
        about = [one.lstat() for one in files]
        changed = max((one.st_mtime for one in about), default=path.lstat().st_mtime)
        yield Part(
            path, sum(one.st_size for one in about), len(files), datetime.fromtimestamp(changed).astimezone()
        )


def _list(parts: list[Part], *, err: bool = False) -> None:
    for part in parts:
        size = (
            f"{part.size_bytes / 1e6:.1f} MB" if part.size_bytes >= 1e5 else f"{part.size_bytes / 1e3:.1f} kB"
        )
        many = f", {part.files} files" if part.path.is_dir() else ""
        click.echo(f"  {part.path.name:<18} {size:>10}{many}  {part.meaning}".rstrip(), err=err)
