"""`gantryctl user`: who may log in at the page."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import json_option, print_json
from gantryctl.terminal import is_terminal, tell

if TYPE_CHECKING:
    from gantryctl.service.supervisor.users import Users

# Stand here so that the help imports nothing of the service.
ROLES = ("viewer", "operator", "physicist", "service", "admin")


@click.group()
def user() -> None:
    """Users of the operator page. Passwords are asked for, or read from standard input, never given as arguments."""


@user.command("add")
@click.argument("name")
@click.option("--role", type=click.Choice(ROLES), required=True, help="What the user may do.")
@click.option("--person", default="", help="Whose account it is, unless it has the name of that person.")
def user_add(name: str, role: str, person: str) -> int:
    """Add a user; asks for the password (12 characters at least).

    Two accounts of one person count as one person for `serve --second-person`. An account stands for the account of the
    system with the same name, too: that of the command line.
    """
    from gantryctl.service.protocol.roles import Role

    _users().add(name, Role(role), _password(), person)
    click.echo(f"user {name} may log in as {role}")
    _wait_until_kept()
    return 0


@user.command("passwd")
@click.argument("name")
def user_passwd(name: str) -> int:
    """Change a password; ends the sessions of this user."""
    _users().set_password(name, _password())
    click.echo(f"user {name} has a new password")
    _wait_until_kept()
    return 0


@user.command("person")
@click.argument("name")
@click.argument("person")
def user_person(name: str, person: str) -> int:
    """Say that user NAME is an account of PERSON; ends its sessions."""
    _users().set_person(name, person)
    click.echo(f"user {name} is an account of {person}")
    _wait_until_kept()
    return 0


@user.command("remove")
@click.argument("name")
def user_remove(name: str) -> int:
    """Remove a user; ends its sessions."""
    _users().remove(name)
    click.echo(f"user {name} is gone")
    _wait_until_kept()
    return 0


@user.command("list")
@json_option
def user_list(as_json: bool) -> int:
    """List users, their roles and persons."""
    # Passwords are kept as hashes only; what is shown is when each was set.
    users = _users().all()
    if as_json:
        print_json(
            [
                {"name": u.name, "role": str(u.role), "person": u.person, "password_set": u.since}
                for u in users.values()
            ]
        )
        return 0
    for each in users.values():
        click.echo(f"{each.name:<32} {each.role:<10} {each.person:<32} password of {each.since}")
    if not users:
        click.echo("no users: gantryctl user add NAME --role operator")
    return 0


def _users() -> Users:
    from gantryctl.operation.store import state_root
    from gantryctl.service.supervisor.users import Users

    return Users(state_root())


def _wait_until_kept() -> None:
    """Wait until the journals of running services have the change, or say that they do not."""
    from gantryctl.operation.store import state_root
    from gantryctl.program.alarms.codes import Code
    from gantryctl.program.alarms.log import refusal
    from gantryctl.program.alarms.words import Words
    from gantryctl.service.supervisor.users_kept import WAIT_S, not_kept, running

    for machine in not_kept(_users(), running(state_root())):
        late = refusal(Code.JRN_03, reason=Words.USERS_WAIT(machine=machine, limit=WAIT_S))
        tell(f"{late.line}; look at the disk, and at `gantryctl journal show`")


def _password() -> str:
    # On a terminal it is asked for twice and not shown; a script writes one line to standard input. Never an option:
    # the arguments of a process are there for every user of the computer to read.
    if is_terminal(sys.stdin):
        found: str = click.prompt("Password", hide_input=True, confirmation_prompt="Again")
        return found
    return "" if sys.stdin is None else sys.stdin.readline().rstrip("\r\n")
