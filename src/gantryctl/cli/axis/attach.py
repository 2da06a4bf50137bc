"""`gantryctl attach` and `detach`: where the commands of a machine go."""

from __future__ import annotations

from pathlib import Path

import click

from gantryctl.cli.axis.service_axis import directory_of
from gantryctl.cli.options import ATTACHED, config_option, machine_of
from gantryctl.errors import CommandRefused
from gantryctl.machine import short_hash
from gantryctl.service.clients.link import ServiceLink


@click.command()
@config_option
def attach(config_file: Path | None) -> int:
    """From now on commands for this machine go to its running service, if they can: see --service."""
    machine = machine_of(config_file)
    with ServiceLink(directory_of(machine)) as link:
        running = link.tags["config_hash"]
    # Limits of this machine file would be checked against an axis with other ones.
    if running != short_hash(machine):
        raise CommandRefused(f"the service runs configuration {running}, this is {short_hash(machine)}")
    # Kept on the disk: it holds for all terminals and outlives this one.
    (directory_of(machine) / ATTACHED).touch()
    click.echo(f"commands for {machine.name} go to its service; gantryctl detach ends that")
    return 0


@click.command()
@config_option
def detach(config_file: Path | None) -> int:
    """Commands run on their own again."""
    (directory_of(machine_of(config_file)) / ATTACHED).unlink(missing_ok=True)
    click.echo("commands run on their own again")
    return 0
