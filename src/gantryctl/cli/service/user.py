"""`gantryctl user`: who may log in at the page."""

from __future__ import annotations

import sys

import click

from gantryctl.cli.options import json_option, print_json

ROLES = ("viewer", "operator", "physicist", "service", "admin")


@click.group()
def user() -> None:
    """Users of the operator page. Passwords are asked for, or read from standard input, never given as arguments."""


@user.command("add")
@click.argument("name")
@click.option("--role", type=click.Choice(ROLES), required=True, help="What the user may do.")
def user_add(name: str, role: str) -> int:
    """A new user; asks for the password (12 characters at least)."""
    from gantryctl.operation.store import state_root
    from gantryctl.service.protocol.roles import Role
    from gantryctl.service.supervisor.users import Users

    Users(state_root()).add(name, Role(role), _password())
    click.echo(f"user {name} may log in as {role}")
    return 0


@user.command("passwd")
@click.argument("name")
def user_passwd(name: str) -> int:
    """Another password; ends the sessions of this user."""
    from gantryctl.operation.store import state_root
    from gantryctl.service.supervisor.users import Users

    Users(state_root()).set_password(name, _password())
    click.echo(f"user {name} has a new password")
    return 0


@user.command("remove")
@click.argument("name")
def user_remove(name: str) -> int:
    """Take a user out; ends its sessions."""
    from gantryctl.operation.store import state_root
    from gantryctl.service.supervisor.users import Users

    Users(state_root()).remove(name)
    click.echo(f"user {name} is gone")
    return 0


@user.command("list")
@json_option
def user_list(as_json: bool) -> int:
    """All users with their roles."""
    from gantryctl.operation.store import state_root
    from gantryctl.service.supervisor.users import Users

    users = Users(state_root()).all()
    if as_json:
        print_json([{"name": u.name, "role": str(u.role), "password_set": u.since} for u in users.values()])
        return 0
    for each in users.values():
        click.echo(f"{each.name:<32} {each.role:<10} password of {each.since}")
    if not users:
        click.echo("no users: gantryctl user add NAME --role operator")
    return 0


def _password() -> str:
    """Asked for twice on a terminal, one line of standard input otherwise."""
    if sys.stdin.isatty():
        found: str = click.prompt("Password", hide_input=True, confirmation_prompt="Again")
        return found
    return sys.stdin.readline().rstrip("\r\n")
