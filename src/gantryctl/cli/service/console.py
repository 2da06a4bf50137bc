"""`gantryctl console`: the page in a browser of this machine, which proves that it is one."""

from __future__ import annotations

import os
import webbrowser
from pathlib import Path

import click

from gantryctl.cli.options import config_option, machine_of
from gantryctl.errors import DeviceError, UsageError


@click.command()
@config_option
def console(config_file: Path | None) -> int:
    """Open the page of the running service in a browser here, as the console of this machine.

    A page that was not opened this way counts as a remote screen, whatever its address: tunnels and proxies end on this
    machine, too. BROWSER names the browser. The link is good once, within a minute, for a browser of the same user.
    """
    from gantryctl.cli.axis.service_axis import directory_of
    from gantryctl.service.clients.link import console_link

    # Not a proof, for anybody can unset it: a word to somebody who has forgotten where he is.
    if os.environ.get("SSH_CONNECTION"):
        raise UsageError("this shell came over ssh: the console is the screen of the machine itself")
    link = console_link(directory_of(machine_of(config_file)))
    if not link:
        raise DeviceError("the service runs without a page (--no-page)")
    if not webbrowser.open(link):
        raise DeviceError("no browser can be started here; the variable BROWSER names one")
    click.echo("the page opens in a browser of this machine")
    return 0
