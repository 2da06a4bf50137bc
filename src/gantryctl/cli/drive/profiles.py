"""`gantryctl drive profiles`: what is known of drive models and no object of them says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import json_option, print_json

if TYPE_CHECKING:
    from gantryctl.drives.profiles import DriveProfile


@click.group(invoke_without_command=True)
@json_option
@click.pass_context
def profiles(context: click.Context, as_json: bool) -> int:
    """List the profiles of drive models; `show` prints one."""
    if context.invoked_subcommand is not None:
        return 0
    from gantryctl.drives.profiles import load_profile, profile_names

    found = [load_profile(name) for name in profile_names()]
    if as_json:
        print_json([_data(profile) for profile in found])
        return 0
    width = max(len(profile.name) for profile in found)
    for profile in found:
        model = f"{profile.maker} {profile.model}"
        unit = profile.units.velocity or "set by the tool"
        click.echo(f"{profile.name:{width}}  {model:38} {unit:16} {profile.tried.value}")
    return 0


@profiles.command()
@click.argument("name")
@json_option
def show(name: str, as_json: bool) -> int:
    """Print the profile NAME, or that in FILE.toml."""
    from gantryctl.drives.profiles import load_profile
    from gantryctl.drives.profiles.page import profile_lines

    profile = load_profile(name)
    if as_json:
        print_json(_data(profile))
        return 0
    lines = profile_lines(profile)
    width = max(len(what) for what, _ in lines)
    for what, text in lines:
        click.echo(f"{what:{width}}  {text}")
    return 0


def _data(profile: DriveProfile) -> dict[str, object]:
    return profile.model_dump(mode="json")
