"""`gantryctl tune`: the paper's procedure, or gains by margins; the result is a proposal."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.engineering.experiment import bus_experiment, machine_under_test, yes_option
from gantryctl.cli.options import (
    bus_log_option,
    choice_option,
    config_option,
    directory,
    json_option,
    number_option,
    out_option,
    print_json,
    write_json,
    write_text,
)
from gantryctl.cli.progress import metered
from gantryctl.cli.report import head_of, report_options
from gantryctl.cli.text import paragraph, print_table
from gantryctl.cli.values import check_lasting
from gantryctl.extras import need
from gantryctl.units import behind

if TYPE_CHECKING:
    from gantryctl.engineering.report.head import Made
    from gantryctl.engineering.tuning.by_margins import Conditions
    from gantryctl.engineering.tuning.on_bus import TuningSession
    from gantryctl.engineering.tuning.procedure import Criteria
    from gantryctl.engineering.tuning.result import Tuning
    from gantryctl.machine import Machine

DEFAULT_OUT = Path("tuning")
# A whole machine file: --config takes it as it is.
PROPOSAL = "proposal.toml"
# Axis time of either half on a bus, about: 244 s with hust_can.toml.
_ON_BUS_S = 250.0
# What waits for its second half, on a bus.
SESSION = "on_bus.json"


@click.command()
@bus_log_option
@config_option
@choice_option(
    "--method",
    ("trials", "margins"),
    "Trials on the simulated axis in the paper's order, or margins over the uncertain plant.",
)
@choice_option(
    "--plant", ("machine", "paper-drive"), "The axis of the machine file, or as the paper's drive saw it."
)
@number_option(
    ("--base-limit", "base_um"),
    150.0,
    "Base motion at which raising the acceleration stops, um p-p (method trials).",
)
@number_option(("--sensitivity",), 1.7, "Largest sensitivity peak (method margins).")
@number_option(
    ("--damping-left",),
    0.8,
    "Part of its own damping that the loop leaves the load at least (method margins).",
)
@click.option("--again", is_flag=True, help="On a bus: begin anew instead of going on.")
@yes_option
@click.option("--log", "with_log", is_flag=True, help="Print every trial.")
@out_option
@report_options
@json_option
def tune(
    config_file: Path | None,
    method: str,
    plant: str,
    base_um: float,
    sensitivity: float,
    damping_left: float,
    again: bool,
    yes: bool,
    with_log: bool,
    out: Path | None,
    as_json: bool,
    made: Made,
) -> int:
    """Tune the loops and write the result as a proposal, never over the machine file.

    The proposal is a whole machine file: use it with --config, or look at it with `gantryctl config diff`. It goes to
    --out (default: tuning/) with the log and a report. Exit code 1 when it is unstable somewhere on the uncertain
    plant.

    On a bus, always by margins: the first call measures drive and position loop and proposes; enter Kvp and Tvi with
    the maker's tool, then call it again with --config tuning/proposal.toml: it measures what the drive has now. Exit
    code 1 when that is not what was proposed.
    """
    from gantryctl.engineering.tuning.data import tuning_data
    from gantryctl.engineering.tuning.proposal import proposed_machine
    from gantryctl.engineering.tuning.result import tune as run
    from gantryctl.wiring.plant_effects import expect_one_pinion

    need("matplotlib")
    check_lasting(config_file, "tune")
    machine = machine_under_test(config_file, "tune")
    expect_one_pinion(machine, "tune")
    criteria, conditions = _criteria(base_um), _conditions(sensitivity, damping_left)
    if machine.on_bus:
        folder = directory(out or DEFAULT_OUT)
        return _tune_on_bus(machine, config_file, conditions, folder, again=again, yes=yes, as_json=as_json)
    with metered(1.0, quiet=as_json) as meter:
        result = run(
            machine,
            method,
            as_paper=plant == "paper-drive",
            criteria=criteria,
            conditions=conditions,
            watch=meter.reach,
        )
    # Refused before anything is written.
    proposed_machine(result)
    files = _write(result, directory(out or DEFAULT_OUT), config_file, made)
    if as_json:
        print_json(tuning_data(result))
    else:
        _show(result, with_log)
        for path in files:
            click.echo(f"wrote {path}")
    return 0 if result.proposal.verdict.stable else 1


def _tune_on_bus(
    machine: Machine,
    config_file: Path | None,
    conditions: Conditions,
    folder: Path,
    *,
    again: bool,
    yes: bool,
    as_json: bool,
) -> int:
    from gantryctl.engineering.identification.measure import quiet_machine
    from gantryctl.engineering.tuning import on_bus
    from gantryctl.engineering.tuning.gains import machine_with
    from gantryctl.machine import default_machine_path
    from gantryctl.machine.effective import to_toml
    from gantryctl.machine.schema import MACHINE_LINE, put_schemas
    from gantryctl.wiring.compensation import check_calibration

    waiting = None if again else on_bus.load_session(folder / SESSION)
    if waiting is None:
        # The model needs the inertia of this machine: before anything moves.
        check_calibration(machine)
    with bus_experiment(
        machine,
        on_bus.moves_text(machine),
        takes_s=_ON_BUS_S,
        yes=yes,
        quiet=as_json,
        controlled_as=quiet_machine(machine),
    ) as run:
        session = (
            on_bus.begin(machine, run, conditions) if waiting is None else on_bus.end(machine, run, waiting)
        )
    on_bus.store_session(folder / SESSION, session)
    if session.after is None:
        in_use = config_file or default_machine_path()
        proposal = MACHINE_LINE + to_toml(machine_with(machine, session.proposal))
        put_schemas([write_text(folder / PROPOSAL, proposal)])
        named = machine.control.compensation.calibration
        if named and (in_use.parent / named).is_file():
            write_text(folder / named, (in_use.parent / named).read_text("utf-8"))
    if as_json:
        print_json(on_bus.session_data(session))
    else:
        _show_on_bus(session, folder)
    return 0 if session.after is None or session.passed else 1


def _show_on_bus(session: TuningSession, folder: Path) -> None:
    loop, wanted = session.before.speed_loop, session.proposal
    click.echo(
        f"{session.machine}, {session.drive}, as found: Kvp {loop.kvp_nm_s_per_rad:.4g} N m s/rad, "
        f"Tvi {1e3 * loop.tvi_s:.3g} ms, {loop.inertia_kg_m2:.3g} kg m2 at the motor, dead time "
        f"{1e3 * loop.dead_time_s:.2f} ms; sensitivity {session.before.sensitivity:.2f} at "
        f"{session.before.sensitivity_hz:.3g} Hz"
    )
    if session.after is None:
        kvp, ki = (
            wanted.kvp_nm_s_per_rad / loop.kvp_nm_s_per_rad,
            wanted.kvp_nm_s_per_rad / wanted.tvi_s * loop.tvi_s / loop.kvp_nm_s_per_rad,
        )
        paragraph(
            f"proposed: Kvp {wanted.kvp_nm_s_per_rad:.4g} N m s/rad, Tvi {1e3 * wanted.tvi_s:.3g} ms, Kpp "
            f"{wanted.kpp_per_s:.4g} /s. Write them: gantryctl drive gains --kp-times {kvp:.3f} --ki-times {ki:.3f} "
            f"--save, where the profile of the drive names their objects; else enter in the maker's tool: proportional "
            f"gain x {kvp:.3f}, integral gain (where it is one of its own) x {ki:.3f}, save them there. Then gantryctl "
            f"tune --config {folder / PROPOSAL} --out {folder} measures what the drive has."
        )
        return
    for check in session.checks:
        told = (
            f"at most {check.allowed:.3g}"
            if math.isnan(check.wanted)
            else f"{check.wanted:.4g} +-{100.0 * check.allowed:.0f} %"
        )
        verdict = "pass" if check.passed else "FAIL"
        click.echo(f"{verdict}  {check.name}: {check.measured:.4g}{behind(check.unit)} ({told})")


def _criteria(base_um: float) -> Criteria:
    from gantryctl.engineering.tuning.procedure import Criteria
    from gantryctl.errors import UsageError

    if base_um <= 0.0:
        raise UsageError(f"--base-limit {base_um:g}: must be above 0 um")
    return Criteria(base_um=base_um)


def _conditions(sensitivity: float, damping_left: float) -> Conditions:
    from gantryctl.engineering.tuning.by_margins import Conditions
    from gantryctl.errors import UsageError

    if not 1.0 < sensitivity <= 10.0:
        raise UsageError(f"--sensitivity {sensitivity:g}: must be above 1 and at most 10")
    if not 0.0 < damping_left <= 10.0:
        raise UsageError(f"--damping-left {damping_left:g}: must be above 0 and at most 10")
    return Conditions(sensitivity=sensitivity, damping_left=damping_left)


def _write(result: Tuning, folder: Path, config_file: Path | None, made: Made) -> list[Path]:
    from gantryctl.engineering.tuning.data import tuning_data
    from gantryctl.engineering.tuning.page import render_tuning
    from gantryctl.engineering.tuning.proposal import write_proposal
    from gantryctl.machine import default_machine_path

    files = write_proposal(result, folder / PROPOSAL, config_file or default_machine_path())
    data = write_json(folder / "tuning.json", tuning_data(result))
    head = head_of(result.machine, made)
    return [*files, data, write_text(folder / "report.html", render_tuning(result, head))]


def _show(result: Tuning, with_log: bool) -> None:
    from gantryctl.engineering.tuning import text

    # The method by margins has no trials, and no claim to end at the paper's gains.
    if result.tuned is not None:
        if with_log:
            print_table(text.log_table(result.tuned))
        if result.paper is not None:
            print_table(text.paper_table(result))
    print_table(text.before_after_table(result))
    click.echo()
    for sentence in text.sentences(result):
        paragraph(sentence)
