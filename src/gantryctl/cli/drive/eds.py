"""`gantryctl eds`: what a drive has by its EDS or DCF, judged as the commissioning of a machine judges the drive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import config_option, json_option, machine_of, print_json
from gantryctl.cli.values import INPUT, Whole

if TYPE_CHECKING:
    from gantryctl.drives.od.facts import DriveFacts
    from gantryctl.drives.od.model import DeviceDescription
    from gantryctl.machine import Machine


@click.group()
def eds() -> None:
    """EDS and DCF files of drives."""


@eds.command()
@click.argument("file", type=INPUT)
@config_option
@click.option("--node", "node_id", type=Whole(1, 127), help="Node id that values of a DCF are wanted for.")
@json_option
def check(file: Path, config_file: Path | None, node_id: int | None, as_json: bool) -> int:
    """Say of the drive in FILE what `gantryctl commission` will say of it: the ledger of the machine, row by row.

    Without a machine file, that of the delivered CAN machine with the drive's own unit of speed. Exit code 1 when
    something is lacking that nothing makes up for and nobody may accept. A file is a promise: what the drive itself
    shows counts.
    """
    from gantryctl.drives.od.facts import facts_of
    from gantryctl.drives.od.reading import read_eds
    from gantryctl.operation.ledger.judging import impossible, known_of_model, ledger
    from gantryctl.operation.proofs import ledger_reasons
    from gantryctl.wiring.canopen import set_up_facts

    device = read_eds(file, node_id)
    facts = facts_of(device)
    machine = _delivered(facts) if config_file is None else machine_of(config_file)
    _must_be_on_bus(machine)
    rows = ledger(machine, set_up_facts(machine, facts))
    reasons = ledger_reasons(machine, rows, real=True)
    if as_json:
        print_json(
            {
                **_about(device),
                "usable": not impossible(rows),
                "known_of_model": known_of_model(machine, facts),
                "ledger": [row.in_english for row in rows],
                "reasons": [reason.text for reason in reasons],
            }
        )
        return int(bool(impossible(rows)))
    _heading(device, file)
    for line in known_of_model(machine, facts):
        click.echo(f"  {line}")
    for row in rows:
        click.echo(f"  {row.text}")
    # Real files break the standard in many ways (decision 0008): read all the same, but not in silence.
    if device.notes:
        click.echo("odd in this file, read all the same:")
        for note in device.notes:
            click.echo(f"  {note}")
    for reason in reasons:
        click.echo(reason.text)
    if not reasons:
        click.echo("nothing is lacking that commissioning does not show")
    return int(bool(impossible(rows)))


def _delivered(facts: DriveFacts) -> Machine:
    """The delivered CAN machine, with the unit of speed that the drive has by its profile or its 60A9."""
    from gantryctl.drives.od.velocity_units import unit_of_word
    from gantryctl.drives.profiles import profile_of
    from gantryctl.machine import configs_folder, load_machine, with_values

    machine, word = load_machine(configs_folder() / "hust_can.toml"), facts.value(0x60A9)
    unit = "profile" if profile_of(facts) is not None else None if word is None else unit_of_word(word)
    return machine if unit is None else with_values(machine, {"can.velocity_unit": unit})


def _must_be_on_bus(machine: Machine) -> None:
    from gantryctl.errors import UsageError

    if not machine.on_bus:
        raise UsageError(f'{machine.name}: [drive] kind = "{machine.drive.kind}" has no bus; use "canopen"')


def _heading(device: DeviceDescription, file: Path) -> None:
    info = device.info
    # CiA 306: an EDS describes a type of device, a DCF one device with the values of its node.
    kind = "DCF" if device.is_dcf else "EDS"
    maker = " ".join(part for part in (info.vendor_name, info.product_name) if part) or "no names in it"
    rates = ", ".join(f"{rate // 1000}" for rate in info.bit_rates)
    click.echo(f"{file}: {kind}, {maker}; {len(device.objects)} objects; kbit/s: {rates or 'not said'}")
    if device.is_dcf and device.node_id is not None:
        click.echo(
            f"values for node {device.node_id}; they are compared with the drive, never written from here"
        )


def _about(device: DeviceDescription) -> dict[str, Any]:
    return {
        "is_dcf": device.is_dcf,
        "node_id": device.node_id,
        "vendor": device.info.vendor_name,
        "product": device.info.product_name,
        "objects": len(device.objects),
        "notes": [note._asdict() for note in device.notes],
    }
