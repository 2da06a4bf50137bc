"""`gantryctl drive gains`: the gains of the drive's speed loop, read and written."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.drive.node import drive_node, profile_of_node
from gantryctl.cli.options import bus_log_option, config_option, confirm, json_option, print_json
from gantryctl.cli.values import FINITE

if TYPE_CHECKING:
    from gantryctl.drives.canopen.setup.gains import GainChange, GainReading

_AT_MOTOR = {"kp": "N m s/rad", "ki": "N m/rad"}


@click.command()
@bus_log_option
@config_option
@click.option("--kp", type=FINITE, help="Proportional gain to be written, N m s/rad at the motor shaft.")
@click.option("--ki", type=FINITE, help="Integral gain to be written, N m/rad at the motor shaft.")
@click.option(
    "--kp-times", type=FINITE, help="Factor of the proportional gain, as `gantryctl tune` proposes it."
)
@click.option("--ki-times", type=FINITE, help="Factor of the integral gain.")
@click.option("--save", "store", is_flag=True, help="Let the drive store its parameters afterwards.")
@click.option("--yes", is_flag=True, help="Do not ask.")
@json_option
def gains(
    config_file: Path | None,
    kp: float | None,
    ki: float | None,
    kp_times: float | None,
    ki_times: float | None,
    store: bool,
    yes: bool,
    as_json: bool,
) -> int:
    """Show the gains of the drive's speed loop, where its profile names their objects, or write them.

    Written gains are read back; a drive that is enabled or turns is refused. The commissioning record is void then:
    `gantryctl commission` goes on with the step `sign`. After a power off the drive has the old gains unless --save, or
    `gantryctl drive save`, has stored the new ones.
    """
    from gantryctl.commissioning import void_control_proofs
    from gantryctl.drives.canopen.setup.gains import planned_changes, read_gains, write_gains
    from gantryctl.drives.canopen.setup.parameters import save
    from gantryctl.errors import DeviceError
    from gantryctl.operation.store import StateStore

    wanted, times = _given(kp=kp, ki=ki), _given(kp=kp_times, ki=ki_times)
    _check_given(wanted, times, store)
    with drive_node(config_file) as (node, settings, machine):
        profile = profile_of_node(node, settings)
        if profile is None or profile.speed_loop is None:
            who = (
                "no profile fits this drive" if profile is None else f"profile {profile.name} names no gains"
            )
            raise DeviceError(f"{who}: read and set them with the maker's tool, then measure")
        found = read_gains(node.sdo, profile.speed_loop)
        # Torque per ampere at the rated point.
        nm_per_a = machine.motor.torque_rated_nm / machine.motor.current_rated_a
        if wanted or times:
            in_current = {name: value / nm_per_a for name, value in wanted.items()}
            changes = planned_changes(found, in_current, times)
            if not as_json:
                for change in changes:
                    click.echo(f"{change.name}  {_change(change, nm_per_a)}")
            if not yes:
                confirm(
                    "write these gains to the drive? The commissioning record is void then",
                    "nothing is written",
                )
            with StateStore(machine) as state:
                # Before anything is written: a record must not outlive the gains that it was made with.
                void_control_proofs(machine, state)
                write_gains(node, changes, settings.increments_per_turn)
                saved = save(node, profile.saving) if store else None
            found = read_gains(node.sdo, profile.speed_loop)
            if not as_json:
                kept = (
                    "until power off"
                    if saved is None
                    else f"stored in {saved.seconds:.1f} s {saved.remark}".rstrip()
                )
                click.echo(
                    f"written and read back, {kept}; `gantryctl commission` goes on with the step sign"
                )
    shown = [_row(each, nm_per_a) for each in found]
    if as_json:
        print_json(shown)
        return 0
    click.echo(f"profile {profile.name} ({profile.tried.value})")
    for each in found:
        what = "the drive does not have it" if each.value is None else _value(each.value, each, nm_per_a)
        click.echo(f"  {each.name}  {each.gain.object}  {what}")
    return 0


def _given(**values: float | None) -> dict[str, float]:
    return {name: value for name, value in values.items() if value is not None}


def _check_given(wanted: dict[str, float], times: dict[str, float], store: bool) -> None:
    from gantryctl.errors import UsageError

    if twice := sorted(set(wanted) & set(times)):
        raise UsageError(f"--{twice[0]} and --{twice[0]}-times: give one of them")
    if store and not (wanted or times):
        raise UsageError("--save: give a gain to be written, or use `gantryctl drive save`")


def _row(reading: GainReading, nm_per_a: float) -> dict[str, object]:
    return {
        "name": reading.name,
        "object": reading.gain.object,
        "value": reading.value,
        "unit": reading.gain.unit,
        "at_the_motor": None if math.isnan(reading.si) else reading.si * nm_per_a,
    }


def _value(value: float, of: GainReading | GainChange, nm_per_a: float) -> str:
    """A gain in the unit of the drive, and at the motor shaft where that is known."""
    text = f"{value:g} {of.gain.unit or 'units of the drive'}"
    at_motor = value * of.gain.si * nm_per_a
    return text if math.isnan(at_motor) else f"{text} = {at_motor:.4g} {_AT_MOTOR[of.name]}"


def _change(change: GainChange, nm_per_a: float) -> str:
    before, after = (_value(value, change, nm_per_a) for value in (change.before, change.after))
    return f"{change.gain.object}  {before} -> {after}"
