"""`gantryctl user`: who may log in at the page."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import json_option, print_json

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
def user_add(name: str, role: str) -> int:
    """Add a user; asks for the password (12 characters at least)."""
    from gantryctl.service.protocol.roles import Role

    _users().add(name, Role(role), _password())
    click.echo(f"user {name} may log in as {role}")
    return 0


@user.command("passwd")
@click.argument("name")
def user_passwd(name: str) -> int:
    """Change a password; ends the sessions of this user."""
    _users().set_password(name, _password())
    click.echo(f"user {name} has a new password")
    return 0


@user.command("remove")
@click.argument("name")
def user_remove(name: str) -> int:
    """Remove a user; ends its sessions."""
    _users().remove(name)
    click.echo(f"user {name} is gone")
    return 0


@user.command("list")
@json_option
def user_list(as_json: bool) -> int:
    """List users and their roles."""
    # Passwords are kept as hashes only; what is shown is when each was set.
    users = _users().all()
    if as_json:
        print_json([{"name": u.name, "role": str(u.role), "password_set": u.since} for u in users.values()])
        return 0
    for each in users.values():
        click.echo(f"{each.name:<32} {each.role:<10} password of {each.since}")
    if not users:
        click.echo("no users: gantryctl user add NAME --role operator")
    return 0


def _users() -> Users:
    from gantryctl.operation.store import state_root
    from gantryctl.service.supervisor.users import Users

    return Users(state_root())


def _password() -> str:
    # On a terminal it is asked for twice and not shown; a script writes one line to standard input. Never an option:
    # the arguments of a process are there for every user of the computer to read.
    if sys.stdin.isatty():
        found: str = click.prompt("Password", hide_input=True, confirmation_prompt="Again")
        return found
    return sys.stdin.readline().rstrip("\r\n")
