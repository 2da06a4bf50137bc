"""`gantryctl power`: power of the running service, which stays as it was switched."""

from __future__ import annotations

from pathlib import Path

import click

from gantryctl.cli.options import (
    config_option,
    confirm,
    machine_of,
    take_over_option,
)


@click.group()
def power() -> None:
    """Switch power at the running service on or off, and leave it so.

    It goes off by itself when the axis stands and nobody has control for [monitors] unheld_power_time_s.

    A command without a service has power only while it moves, and takes it off itself.
    """


@power.command()
@config_option
@click.option("--yes", is_flag=True, help="Do not ask before the brake opens.")
@take_over_option
def on(config_file: Path | None, yes: bool, take_over: bool) -> int:
    """Enable the drive and open the brake; the motor holds the load.

    Power stays on after the command, which leaves control free. Take control at the page or move the axis
    before [monitors] unheld_power_time_s have passed, 300 s as shipped; otherwise it is switched off.
    """
    return _switch(config_file, on=True, yes=yes, take_over=take_over)


@power.command()
@config_option
@take_over_option
def off(config_file: Path | None, take_over: bool) -> int:
    """Close the brake and disable the drive. What moves is stopped first, with --take-over."""
    return _switch(config_file, on=False, yes=True, take_over=take_over)


def _switch(config_file: Path | None, *, on: bool, yes: bool, take_over: bool) -> int:
    from gantryctl.cli.axis.service_axis import ServiceAxis

    machine = machine_of(config_file)
    axis = ServiceAxis(machine, take_over=take_over)
    # Without a claim on the axis: control is lost after 2 s of silence.
    axis.look()
    if on and not yes:
        confirm(
            f"{machine.name}: power on, the brake opens and the motor holds the load. Switch on?",
            "power stays off",
        )
    changed = axis.switch(on)
    word = "on" if on else "off"
    left_s = machine.monitors.unheld_power_time_s
    rest = f"; it goes off after {left_s:g} s at rest with nobody in control" if on else ""
    click.echo((f"power is {word}" if changed else f"power was {word} already") + rest)
    return 0
