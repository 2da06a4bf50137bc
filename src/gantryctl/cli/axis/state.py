"""Commands about the state of the axis: status, alarms, explain, reset, retain, sim."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import (
    config_option,
    json_option,
    machine_of,
    print_done,
    print_json,
    service_option,
    take_over_option,
    to_service,
)
from gantryctl.cli.values import FINITE

if TYPE_CHECKING:
    from gantryctl.machine import Machine
    from gantryctl.operation.state import MachineStatus
    from gantryctl.runtime import AlarmEntry


@click.command()
@config_option
@json_option
@service_option
@click.option("--watch", is_flag=True, help="Go on showing the axis of the running service until Ctrl-C.")
def status(config_file: Path | None, as_json: bool, service: bool, watch: bool) -> int:
    """Where the axis stands, what holds it, and what the last command did.

    --watch shows one line that goes on changing; where nobody looks at a terminal, or with --json, a line a second.
    """
    machine = machine_of(config_file)
    if watch:
        from gantryctl.cli.axis.service_state import watch_service

        # Without a service nothing changes between two commands.
        watch_service(machine, as_json=as_json)
        return 0
    tags, more = None, []
    if to_service(service, config_file):
        from gantryctl.cli.axis.service_state import service_rows, service_status

        found, tags = service_status(machine)
        more = service_rows(tags)
    else:
        from gantryctl.operation.state import machine_status

        found = machine_status(machine)
    if as_json:
        # The same keys with and without a service; what only a running one knows stands apart.
        print_json(asdict(found) | {"tags": tags})
        return 0
    click.echo(f"{found.machine}: {found.condition}")
    angle = "not known"
    if found.angle_deg is not None:
        angle = f"{machine.axis.dial.text(found.angle_deg, '.4f')} deg (motor encoder)"
    rows = [
        ("angle", angle),
        *more,
        ("encoder", found.encoder),
        ("last result", found.last_result or "-"),
        ("last alarm", found.last_alarm or "-"),
        ("power-ups, moves", f"{found.power_ups}, {found.moves}"),
        ("travelled", f"{found.travelled_deg:.1f} deg"),
        ("brake test", found.brake_test),
        ("quick stop", _quick_stop(machine, found)),
        ("state kept in", found.directory),
        *(("ledger", row) for row in found.ledger),
        *(("note", note) for note in found.notes),
    ]
    for name, value in rows:
        click.echo(f"  {name:<18}{value}")
    return 0


def _quick_stop(machine: Machine, found: MachineStatus) -> str:
    """Way of a quick stop from the highest setting, as `move` announces it of its own speed."""
    from gantryctl.machine.derived import rigid_stop

    top, dec = machine.speed.setting_max_deg_s, found.quick_dec_deg_s2
    way_deg, _ = rigid_stop(top, dec, float("inf"))
    return f"{way_deg:.2f} deg from {top:g} deg/s at {dec:.4g} deg/s2"


@click.command()
@config_option
@click.option("--last", is_flag=True, help="Only the newest one.")
@json_option
@service_option
def alarms(config_file: Path | None, last: bool, as_json: bool, service: bool) -> int:
    """Alarms of the past, newest first."""
    found: list[AlarmEntry]
    if to_service(service, config_file):
        from gantryctl.cli.axis.service_state import service_alarms

        found, holds = service_alarms(machine_of(config_file))
    else:
        from gantryctl.operation.state import read_retained

        retained = read_retained(machine_of(config_file))
        # Retained oldest first; a person looks for the newest.
        found = list(reversed(retained.alarms)) if retained else []
        holds = [retained.error_stop] if retained else []
    if last:
        found = found[:1]
    if as_json:
        print_json([asdict(alarm) for alarm in found])
    elif not found:
        click.echo("no alarms")
    # An earlier one of the same code was reset: the newest of it is what holds.
    left = set(holds)
    for alarm in found if not as_json else ():
        held = f" (holds the axis: {who_resets(alarm.code)})" if alarm.code in left else ""
        left.discard(alarm.code)
        click.echo(f"{alarm.at}  t = {alarm.time_s:.3f} s{held}\n  {alarm.text}")
    return 0


def who_resets(code: str) -> str:
    """Who may reset an alarm that holds the axis: never "reset" beside an alarm that says not to."""
    from gantryctl.operation.brake_policy import LOCKED

    return "only service resets it" if code in LOCKED else "gantryctl reset"


@click.command()
@click.argument("code", required=False)
def explain(code: str | None) -> int:
    """What an alarm code means, what is done and what to do. Without CODE: all codes."""
    from gantryctl.program.alarms.table import all_codes
    from gantryctl.program.alarms.table import explain as page

    if code is not None:
        click.echo(page(code))
        return 0
    for name, severity, title in all_codes():
        click.echo(f"{name:<11} {severity:<8} {title}")
    return 0


@click.command()
@config_option
@json_option
@service_option
@click.option("--yes", is_flag=True, help="Do not ask before what is locked is reset.")
@take_over_option
def reset(config_file: Path | None, as_json: bool, service: bool, yes: bool, take_over: bool) -> int:
    """Acknowledge what holds the axis: the alarm of the last stop, a failed brake test, a small motion while off.

    It never enables and never moves. What needs more than a look (a position that is not valid) stays. What is locked
    (`gantryctl explain CODE`) is asked for twice.
    """
    machine = machine_of(config_file)
    if to_service(service, config_file):
        from gantryctl.cli.axis.service_axis import ServiceAxis, held_codes

        axis = ServiceAxis(machine, take_over=take_over)
        tags = axis.look()
        locked = (
            (", ".join(held_codes(tags)) or "the position or the journal") if tags["reset_locked"] else ""
        )
    else:
        from gantryctl.operation.brake_policy import locked_code
        from gantryctl.operation.state import read_retained, reset_machine

        axis, locked = None, locked_code(read_retained(machine))
    # Whatever is locked takes two steps: at the service arm and execute, here a question (decision 0014).
    if locked and not yes and not click.confirm(f"{locked}: locked. Has the cause been removed?", err=True):
        return 2
    done = reset_machine(machine) if axis is None else axis.reset()
    print_done(done, as_json, reset=done)
    return 0


@click.group()
def retain() -> None:
    """The controller's retained memory."""


@retain.command("show")
@config_option
@json_option
@service_option
def retain_show(config_file: Path | None, as_json: bool, service: bool) -> int:
    """Everything the controller remembers over power-off."""
    from gantryctl.operation.state import read_retained, retained_rows

    machine = machine_of(config_file)
    if to_service(service, config_file):
        from gantryctl.cli.axis.service_state import service_retained

        retained = service_retained(machine)
    else:
        retained = read_retained(machine)
    # Before the first run there is no memory, which is no fault.
    if retained is None:
        if as_json:
            print_json(None)
        else:
            click.echo("nothing is retained yet: the machine has never run")
        return 0
    if as_json:
        print_json(asdict(retained))
        return 0
    rows = list(retained_rows(retained))
    width = max(len(name) for name, _ in rows) + 2
    for name, value in rows:
        click.echo(f"{name:<{width}}{value}")
    return 0


@click.group()
def sim() -> None:
    """The simulated machine."""


@sim.command("reset")
@config_option
@click.option(
    "--angle", type=FINITE, help="Where the axis stands, deg; 0 deg where travel has it, else its middle."
)
@json_option
def sim_reset(config_file: Path | None, angle: float | None, as_json: bool) -> int:
    """Throw the simulated machine and its memory away and put a new one there, brake closed."""
    from gantryctl.operation.state import reset_simulation

    machine = machine_of(config_file)
    angle = None if angle is None else machine.axis.meant_deg(angle)
    done = reset_simulation(machine, angle)
    print_done(done, as_json, reset=done, angle_deg=angle)
    return 0
