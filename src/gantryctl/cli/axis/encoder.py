"""`gantryctl encoder show|set-zero`: the absolute reference."""

from __future__ import annotations

from pathlib import Path

import click

from gantryctl.cli.options import (
    bus_log_option,
    config_option,
    json_option,
    machine_of,
    print_done,
    print_json,
)
from gantryctl.cli.values import FINITE


@click.group()
def encoder() -> None:
    """Absolute encoder: reading and zero offset."""


@encoder.command()
@bus_log_option
@config_option
@json_option
def show(config_file: Path | None, as_json: bool) -> int:
    """Serial, raw reading, zero offset, angle, wrap margin, stored rest position, verdict."""
    from gantryctl.operation.state import encoder_report

    report = encoder_report(machine_of(config_file))
    if as_json:
        print_json(report.as_dict())
        return 0
    for name, value in report.rows():
        click.echo(f"{name:<22}{value}")
    return 0


@encoder.command("set-zero")
@bus_log_option
@config_option
@click.option("--angle", type=FINITE, required=True, help="The true angle of the axis now, deg.")
@click.option("--witness", required=True, help="What proves it: mark, laser, protocol number.")
@json_option
def set_zero(config_file: Path | None, angle: float, witness: str, as_json: bool) -> int:
    """Set the zero offset so that the present position reads ANGLE.

    Only at standstill with the brake closed: refused while another controller has enabled the drive, and where the
    axis moves between two readings. The offset is stored with the encoder's serial and who set it; nothing is written
    into the encoder.
    """
    from gantryctl.operation.state import set_encoder_zero

    machine = machine_of(config_file)
    angle = machine.axis.meant_deg(angle)
    done = set_encoder_zero(machine, angle, witness)
    print_done(done, as_json, set_zero=done)
    return 0
