"""`gantryctl drive save`: the parameters of a drive stored in it."""

from __future__ import annotations

from pathlib import Path

import click

from gantryctl.cli.drive.node import drive_node, profile_of_node
from gantryctl.cli.options import bus_log_option, config_option, confirm


@click.command()
@bus_log_option
@config_option
@click.option("--yes", is_flag=True, help="Do not ask.")
def save(config_file: Path | None, yes: bool) -> int:
    """Let the drive store its parameters (1010), so that they survive a power off; refused while it is enabled.

    Its profile says by which object; a drive that stores nothing, or by itself, is told of.
    """
    from gantryctl.drives.canopen.setup.parameters import save as store
    from gantryctl.drives.profiles import Saving

    if not yes:
        confirm("store the drive's present parameters for good?", "nothing is stored")
    with drive_node(config_file) as (node, settings, _):
        profile = profile_of_node(node, settings)
        done = store(node, Saving() if profile is None else profile.saving)
    click.echo(f"stored in {done.seconds:.1f} s" + (f"; {done.remark}" if done.remark else ""))
    return 0
