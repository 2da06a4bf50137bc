"""`gantryctl commission`: a CAN machine, step by step, each step with its proof."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.engineering.at_the_load import (
    SIMULATED,
    certificate_of,
    instrument_options,
    open_instrument,
)
from gantryctl.cli.options import (
    asking,
    bus_log_option,
    config_option,
    directory,
    out_option,
    proven_machine,
    stop_signals,
)
from gantryctl.cli.report import head_of, report_options
from gantryctl.extras import need

if TYPE_CHECKING:
    from gantryctl.commissioning import Commissioning, Step, StepResult
    from gantryctl.engineering.report.head import Made
    from gantryctl.machine import Machine

DEFAULT_OUT = Path("commissioning_report")


@click.group(invoke_without_command=True)
@bus_log_option
@config_option
@click.option(
    "--with-sim", is_flag=True, help="With a virtual drive in this process: one terminal, no adapter."
)
@click.option("--dry-run", is_flag=True, help="Say what would be done and what could move; touch nothing.")
@click.option("--only", metavar="STEP", help="This step only, even if it has passed.")
@click.option("--again", is_flag=True, help="From the start, though an earlier run has got further.")
@click.option("--yes", is_flag=True, help="Do not ask before steps that move.")
@instrument_options(default=None)
@out_option
@report_options
@click.pass_context
def commission(
    context: click.Context,
    config_file: Path | None,
    with_sim: bool,
    dry_run: bool,
    only: str | None,
    again: bool,
    yes: bool,
    place: str | None,
    uncertainty_deg: float | None,
    certificate: str,
    out: Path | None,
    made: Made,
) -> int:
    """Commission a CAN machine step by step: what a step does, what could move and how far, its proof and result.

    An interrupted commissioning goes on where it ended, as long as configuration and drive are the same. It ends with a
    report (HTML and JSON, with a hash) and the record without which the machine does not move. Exit code 1 when a step
    has failed.
    """
    if context.invoked_subcommand is not None:
        return 0
    from gantryctl.machine import default_machine_path
    from gantryctl.operation.store import StateStore, state_root

    machine = proven_machine(config_file or default_machine_path().parent / "hust_can.toml")
    if with_sim:
        machine = _with_virtual_drive(machine)
    if dry_run:
        _announce(machine)
        return 0
    need("matplotlib")
    # Records of a virtual drive go to a place of their own: they prove nothing of a real one.
    root = state_root() / "simulated" if with_sim else None
    folder = directory(out or DEFAULT_OUT)
    if root is not None:
        _acknowledge(machine, root)
    with StateStore(machine, root) as store:
        from gantryctl.commissioning import Commissioning

        # A virtual gantry hurts no one, so its steps are not asked for.
        # The gantry of this process is watched by a simulated tracker where no other instrument is named.
        place = place or (SIMULATED if with_sim else None)
        work = Commissioning(
            machine,
            store,
            folder,
            click.echo,
            lambda step: yes or with_sim or _ask(work, step, only),
            None if place is None else lambda run: open_instrument(run, place, uncertainty_deg, seed=0),
            certificate_of(place, certificate),
        )
        return _run(work, only, again, folder, made)


@commission.command()
@config_option
@click.option(
    "--lack",
    "lacks",
    required=True,
    multiple=True,
    metavar="NAME",
    help="Row of the ledger that is lacking: limits_torque, or an input of [can.inputs]; may be given several times.",
)
@click.option("--by", required=True, metavar="NAME", help="Who answers for it.")
@click.option("--because", required=True, metavar="TEXT", help="Why the machine is safe without it.")
def accept(config_file: Path | None, lacks: tuple[str, ...], by: str, because: str) -> int:
    """Accept by name what the drive or the machine lacks.

    It covers a lack, never a failed proof, and it ends with any change of the drive, its firmware, its parameters or
    the configuration. `commission` says what is lacking.
    """
    from gantryctl.errors import CommandRefused
    from gantryctl.machine import default_machine_path
    from gantryctl.operation.ledger.acceptance import (
        Acceptance,
        binding_of,
        check_acceptance,
        ledger_path,
        load_acceptances,
        store_acceptances,
    )
    from gantryctl.operation.ledger.kept_facts import facts_path, load_facts
    from gantryctl.operation.proofs import must_be_proven, read_ledger
    from gantryctl.operation.state import operator_name
    from gantryctl.operation.store import StateStore, now_text

    machine = proven_machine(config_file or default_machine_path().parent / "hust_can.toml")
    if not must_be_proven(machine):
        raise CommandRefused(f"{machine.name}: a simulated or virtual drive needs no acceptance")
    with StateStore(machine) as store:
        facts = load_facts(facts_path(store.directory, machine))
        if facts is None:
            raise CommandRefused(
                f"{machine.name}: its drive was never set up, and an acceptance belongs to one drive: "
                "`gantryctl commission` sets it up and says what is lacking"
            )
        rows, bound_to = read_ledger(machine, store.directory), binding_of(machine, facts)
        for what in lacks:
            check_acceptance(rows, what, by, because)
        made = [
            Acceptance(what, by.strip(), because.strip(), now_text(), operator_name(), bound_to)
            for what in lacks
        ]
        path = ledger_path(store.directory, machine)
        store_acceptances(path, (*load_acceptances(path), *made))
        for row in read_ledger(machine, store.directory):
            click.echo(row.text)
    return 0


def _acknowledge(machine: Machine, root: Path) -> None:
    """Reset what has stopped an earlier rehearsal: no other command reaches the states of a virtual drive."""
    from gantryctl.operation.state import reset_machine
    from gantryctl.operation.store import StateStore

    with StateStore(machine, root) as store:
        kept = store.load_retained()
    if kept is not None and kept.error_stop:
        click.echo(reset_machine(machine, root))


def _with_virtual_drive(machine: Machine) -> Machine:
    from gantryctl.machine import with_values

    # In virtual time: the bus, its side channel and its adapter are left out, everything else is as commissioned. With
    # an EDS the virtual drive has what that drive has.
    return with_values(
        machine,
        {
            "can.interface": "simulated",
            "can.stepped": False,
            "can.side_channel": "",
            "can.channel": "",
            "can.virtual_drive": machine.can.virtual_drive or machine.can.eds,
        },
    )


def _announce(machine: Machine) -> None:
    from gantryctl.commissioning import STEPS

    for number, step in enumerate(STEPS, start=1):
        only = " (only a drive that lacks the object)" if step.makes_up else ""
        only = " (on its own, --only)" if step.by_hand else only
        click.echo(f"{number:2}. {step.title}: {step.does}{only}")
        click.echo(f"    {step.key}; could move: {step.could_move(machine) or 'nothing'}")


def _ask(work: Commissioning, step: Step, only: str | None) -> bool:
    """Ask before the first step of a reach: one yes holds for all that reach no further."""
    together = [each for each in work.left(only) if each.reach == step.reach]
    could = "; ".join(f"{each.title}: {each.could_move(work.machine)}" for each in together)
    with asking():
        return click.confirm(f"could move: {could}. Is everybody away from the axis?")


def _run(work: Commissioning, only: str | None, again: bool, folder: Path, made: Made) -> int:
    from gantryctl.commissioning import Outcome, write_report
    from gantryctl.commissioning.watch import Halt
    from gantryctl.operation.client import Stop

    halt = Halt()

    def stop() -> None:
        halt.ask(Stop.RAMP if halt.urgency is Stop.NO else Stop.QUICK, "the command was asked to end")

    # Asked twice: another drive than before begins from the start, and which drive it is shows on the bus.
    steps = work.left(only)
    work.start(again)
    steps = steps if only else work.left()
    if work.resumed and not again and not only and steps:
        click.echo(f"goes on with: {steps[0].title}")
    ended_badly = False
    # In this order and not beyond a failure: each step relies on what the ones before it have proven.
    for step in steps:
        click.echo(f"{step.title}: {step.does}")
        # The axis is not left to a drive whose watch is not proven yet, whoever ends the command or loses its terminal.
        with stop_signals(stop):
            result = work.do(step, halt)
        halt.check()
        if result is None:
            click.echo("  left out")
            ended_badly = True
            break
        _print(result)
        if result.outcome is Outcome.FAILED:
            ended_badly = True
            break
    if work.complete:
        # Before the report, whose ledger reads it.
        click.echo(f"record: {work.record()}")
    spent_s = sum(result.axis_s for result in work.progress.results.values())
    click.echo(f"time of the axis, all steps: {spent_s / 60.0:.1f} min")
    head = head_of(work.machine, made, directory=work.store.directory)
    page = write_report(work.progress, work.ledger, folder, head)
    click.echo(f"report: {page.resolve()} ({work.progress.hash[:16]})")
    return int(ended_badly)


def _print(result: StepResult) -> None:
    click.echo(
        f"  {result.outcome.value}: {result.proof} ({result.seconds:.1f} s; axis {result.axis_s:.1f} s)"
    )
    if result.to_do:
        click.echo(f"  to do: {result.to_do}")
