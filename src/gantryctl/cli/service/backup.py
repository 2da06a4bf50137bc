"""`gantryctl backup`: configuration, state, journal and accounts of a machine in one file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import config_option, json_option, machine_of, print_json
from gantryctl.cli.values import PATH
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.service.backup.archive import Manifest


@click.group()
def backup() -> None:
    """Configuration, state, journal and accounts of a machine as one file.

    Password hashes and private keys are in it, so the file is for its owner alone (mode 0600): keep it like a key.
    """


@backup.command()
@config_option
@click.argument("file", type=PATH)
@click.option(
    "--without-secrets", is_flag=True, help="Leave out accounts and private keys, to hand the file on."
)
@click.option("--recordings", is_flag=True, help="With the recordings, which may be gigabytes.")
@json_option
def create(
    config_file: Path | None, file: Path, without_secrets: bool, recordings: bool, as_json: bool
) -> int:
    """Write FILE; the service may run. Exit code 1 when the journal is not whole: it is in FILE as it is."""
    from gantryctl.operation.store import state_root
    from gantryctl.service.backup.create import create_backup

    made = create_backup(
        machine_of(config_file), state_root(), file, secrets=not without_secrets, recordings=recordings
    )
    _say(file, made, as_json)
    return int(bool(made.journal))


@backup.command()
@click.argument("file", type=PATH)
@json_option
def show(file: Path, as_json: bool) -> None:
    """Check every file in FILE against its hash, and say what the backup is of."""
    import tempfile

    from gantryctl.service.backup.archive import extract

    with tempfile.TemporaryDirectory() as folder:
        found = extract(file, Path(folder))
    _say(file, found, as_json)


@backup.command()
@click.argument("file", type=PATH)
@click.option(
    "--config", "config_file", type=PATH, help="Where the machine file goes; where it stood if not given."
)
@click.option("--accounts", is_flag=True, help="The accounts of the backup replace those that are here.")
@json_option
def restore(file: Path, config_file: Path | None, accounts: bool, as_json: bool) -> None:
    """Put FILE in the place of what is there, which is set aside. The service must not run.

    The axis gets no power until its angle was compared with a mark: `gantryctl encoder set-zero`.
    """
    from gantryctl.operation.store import state_root
    from gantryctl.service.backup.restore import restore_backup

    done = restore_backup(file, state_root(), config_file, accounts=accounts)
    place = "" if done.config_file is None else str(done.config_file)
    if as_json:
        values = {"config_file": place, "set_aside": str(done.set_aside), "kept": list(done.kept)}
        print_json({"file": str(file), **values, **_values(done.manifest)})
        return
    click.echo(f"{done.manifest.machine} is restored as on {done.manifest.made}")
    click.echo(f"machine file: {place or 'the reference gantry'}")
    for kept in done.kept:
        click.echo(f"not replaced: {kept}")
    click.echo(f"what was here before: {done.set_aside}")
    option = f" --config {place}" if place else ""
    click.echo(
        f"no power until the angle was compared: gantryctl encoder set-zero --angle A --witness TEXT{option}"
    )


def _say(file: Path, manifest: Manifest, as_json: bool) -> None:
    """Print what a backup is of."""
    if as_json:
        print_json({"file": str(file), **_values(manifest)})
        return
    size_mb = sum(content.size for content in manifest.files.values()) / 1e6
    click.echo(f"{file}: {manifest.machine}, {manifest.made}, by {manifest.by} on {manifest.host}")
    click.echo(f"{len(manifest.files)} files, {size_mb:.1f} MB, every one as its hash says")
    click.echo(f"machine file: {manifest.config_file or 'the reference gantry'}")
    click.echo(
        "with password hashes and private keys: keep it like a key"
        if manifest.secrets
        else "without accounts and private keys"
    )
    if manifest.journal:
        tell(f"warning: the journal in it is NOT intact: {manifest.journal}")


def _values(manifest: Manifest) -> dict[str, Any]:
    files = {name: content._asdict() for name, content in manifest.files.items()}
    return {**manifest._asdict(), "files": files}
