"""`gantryctl accuracy run|report|stats` and `gantryctl speed-test`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.engineering.accuracy_end import finish
from gantryctl.cli.engineering.at_the_load import SIMULATED_CERTIFICATE, certificate_option
from gantryctl.cli.engineering.experiment import (
    bus_experiment,
    machine_under_test,
    plan_options,
    speeds_option,
    yes_option,
)
from gantryctl.cli.engineering.measure import measure
from gantryctl.cli.options import (
    bus_log_option,
    choice_option,
    config_option,
    directory,
    fresh_option,
    json_option,
    machine_of,
    out_option,
    print_json,
    real_time_option,
    seed_option,
    simulated_machine,
    write_text,
)
from gantryctl.cli.progress import metered
from gantryctl.cli.report import head_of, report_options
from gantryctl.cli.values import FINITE, INPUT, PATH, Whole
from gantryctl.extras import need
from gantryctl.units import SIGNED

if TYPE_CHECKING:
    from gantryctl.engineering.accuracy.budget import Budget
    from gantryctl.engineering.accuracy.procedure.procedures import Procedure
    from gantryctl.engineering.accuracy.table import ErrorTable
    from gantryctl.engineering.report.head import Made
    from gantryctl.machine import Machine, Requirement

# A report is three files.
DEFAULT_OUT = Path("accuracy_report")


@click.group()
def accuracy() -> None:
    """The chord test: run it, measure it on a machine, report it, or evaluate a table."""


accuracy.add_command(measure)


@accuracy.command("run")
@bus_log_option
@config_option
@click.option(
    "--procedure", "name", type=click.Choice(["A", "B", "C", "D", "E"]), default="A", show_default=True
)
@click.option("--chord", type=click.Choice(["base", "adjacent"]), default="base", show_default=True)
@click.option("--runs", type=Whole(1, 100), default=1, show_default=True, help="ISO 230-2 needs 5.")
@plan_options
@speeds_option
@click.option("--ensemble", type=Whole(0, 100_000), default=0, help="Number of random gears beside it.")
@click.option("--radius-m", type=FINITE, help="Chord radius; [accuracy] chord_radius_m when not given.")
@click.option("--noise-um", type=FINITE, help="Tracker noise per coordinate; [accuracy] tracker_noise_um.")
@click.option("--speed-test/--no-speed-test", "with_speed", default=True, help="The speed test as well.")
@click.option("--threads", type=Whole(1, 256), help="For the ensemble; no effect on the result.")
@choice_option(
    "--instrument",
    ("tracker", "load-encoder", "motor-side"),
    "What measures; motor-side readings get no accuracy verdict.",
)
@click.option(
    "--on-engine", is_flag=True, help="Scan by scan with the PLC program instead of the compiled loop."
)
@seed_option
@out_option
@report_options
@json_option
@fresh_option
@real_time_option
def run_(
    config_file: Path | None,
    name: str,
    chord: str,
    runs: int,
    bases_deg: tuple[float, ...],
    displacements_deg: tuple[float, ...],
    speeds_deg_s: tuple[float, ...],
    ensemble: int,
    radius_m: float | None,
    noise_um: float | None,
    with_speed: bool,
    threads: int | None,
    instrument: str,
    on_engine: bool,
    seed: int,
    out: Path | None,
    as_json: bool,
    fresh: bool,
    real_time: bool,
    made: Made,
) -> int:
    """Run the chord test and the speed test on the simulated axis and write report.html, report.json, table.csv.

    Always starts from a new machine and leaves the retained state alone (--fresh changes nothing). --real-time
    takes as long as the machine would. Exit code 1 when a criterion is not met.
    """
    from gantryctl.engineering.accuracy.job import AccuracyJob, accuracy_report
    from gantryctl.engineering.accuracy.procedure.measuring import InstrumentKind
    from gantryctl.engineering.accuracy.procedure.plan import chord_test, speeds_to_test
    from gantryctl.engineering.accuracy.procedure.procedures import Chord
    from gantryctl.engineering.report.head import MeasuredBy

    need("matplotlib")
    machine = _with_instrument(_measurable(config_file, instrument), radius_m, noise_um)
    if machine.on_bus:
        # The speed test comes from the compiled loop, which has no bus.
        with_speed = False
    procedure = chord_test(
        machine,
        name,
        runs=runs,
        chord=Chord(chord),
        bases_deg=bases_deg,
        displacements_deg=displacements_deg,
    )
    speeds = speeds_to_test(machine, speeds_deg_s) if with_speed else ()
    # Before anything runs: a long test must not end at a folder that cannot be made.
    folder = directory(out or DEFAULT_OUT)
    if not as_json:
        click.echo(_announce(machine, procedure, real_time=real_time))
    kind = InstrumentKind(instrument)
    job = AccuracyJob(procedure, seed, ensemble, with_speed, threads, kind, on_engine, real_time, speeds)

    def progress(index: int, target_deg: float) -> None:
        if not as_json:
            click.echo(
                f"stop {index + 1} of {len(procedure.stops)}: {machine.axis.dial.text(target_deg, '.1f')} deg"
            )

    with metered(max(1, ensemble), quiet=as_json) as meter:
        report = accuracy_report(machine, job, made.version, made.date, progress, meter.reach)
    measured_by = MeasuredBy(report.source, SIMULATED_CERTIFICATE)
    return finish(report, machine, made, measured_by, folder, as_json)


def _announce(machine: Machine, procedure: Procedure, *, real_time: bool) -> str:
    ends = machine.axis.dial.span(*procedure.travel_deg)
    clock = "real" if real_time or machine.paced_by_clock else "virtual"
    return (
        f"{machine.name}: chord test {procedure.name}, {len(procedure.stops)} stops from {ends} deg, "
        f"{machine.accuracy.dwell_s:g} s each, on the simulated axis in {clock} time\n"
    )


def _with_instrument(machine: Machine, radius_m: float | None, noise_um: float | None) -> Machine:
    from gantryctl.machine import with_values

    changes: dict[str, object] = {}
    if radius_m is not None:
        # Through the machine file's own rules: a radius of 0 is refused there.
        changes["accuracy.chord_radius_m"] = radius_m
    if noise_um is not None:
        changes["accuracy.tracker_noise_um"] = noise_um
    return with_values(machine, changes) if changes else machine


def _measurable(config_file: Path | None, instrument: str) -> Machine:
    """A machine whose load this instrument can read: a simulated one, or a virtual drive with its side channel."""
    from gantryctl.errors import UsageError

    machine = machine_of(config_file)
    if not machine.on_bus:
        return simulated_machine(config_file, "accuracy run")
    if machine.can.interface == "simulated" or machine.can.side_channel or instrument == "motor-side":
        return machine
    raise UsageError(
        f"{machine.name}: nothing here reads the angle of the load · --instrument motor-side, or measure with a "
        "tracker and evaluate it: gantryctl accuracy report --measured FILE"
    )


_judged_by = click.option(
    "--config",
    "config_file",
    type=PATH,
    help="Machine file whose [required] judges; without it see --required.",
)
_budget_option = choice_option(
    "--budget",
    ("tracker", "level", "autocollimator", "ring-encoder", "ring-encoder-2-heads"),
    "Instrument whose errors make the uncertainty budget of A, by its data sheet.",
)
_required_option = click.option(
    "--required", "required_deg", type=FINITE, help="Required accuracy, deg, in place of a machine file's."
)


def _required(machine: Machine | None, required_deg: float | None) -> Requirement | None:
    """What judges a table that was measured elsewhere; None = nothing does, and no verdict is told."""
    from gantryctl.errors import UsageError
    from gantryctl.machine import Requirement, required_angle

    if required_deg is None:
        return None if machine is None else required_angle(machine)
    if not required_deg > 0.0:
        raise UsageError(f"--required {required_deg:g}: must be above 0 deg")
    return Requirement(required_deg, "--required")


@accuracy.command()
@_judged_by
@_required_option
@_budget_option
@click.option(
    "--measured", type=INPUT, required=True, help="CSV of an instrument: chords in mm or errors in deg."
)
@click.option("--radius-m", type=FINITE, help="Radius of the target circle, for chords in mm.")
@click.option(
    "--motor-side", is_flag=True, help="The readings are of the motor encoder: no accuracy verdict."
)
@click.option(
    "--measured-with", default="", metavar="TEXT", help="Instrument: type and serial number, for the report."
)
@certificate_option
@out_option
@report_options
@json_option
def report(
    config_file: Path | None,
    required_deg: float | None,
    budget: str,
    measured: Path,
    radius_m: float | None,
    motor_side: bool,
    measured_with: str,
    certificate: str,
    out: Path | None,
    as_json: bool,
    made: Made,
) -> int:
    """Report a chord test that was measured elsewhere.

    It is judged by the machine of --config or by --required, and gets no verdict without either: the reference
    machine's requirement is no judge of another machine's table. Exit code 1 when the criterion is not met.
    """
    from gantryctl.engineering.accuracy.report.report import AccuracyReport
    from gantryctl.engineering.accuracy.table_csv import read_error_table
    from gantryctl.engineering.report.head import MeasuredBy
    from gantryctl.engineering.report.origin import Origin
    from gantryctl.machine import is_reference_machine, short_hash

    need("matplotlib")
    machine = machine_of(config_file) if config_file is not None else None
    table = read_error_table(measured, radius_m)
    result = AccuracyReport(
        machine=measured.name if machine is None else machine.name,
        config_hash="-" if machine is None else short_hash(machine),
        version=made.version,
        created=made.date,
        seed=0,
        source=measured.name,
        measures_load=not motor_side,
        measured=table,
        origin=Origin.MEASURED,
        radius_m=radius_m,
        required=_required(machine, required_deg),
        dial=SIGNED if machine is None else machine.axis.dial,
        of_reference=machine is not None and is_reference_machine(machine),
        budget=None if motor_side else _table_budget(table, budget, radius_m),
    )
    measured_by = MeasuredBy(measured_with or f"not named; readings from {measured.name}", certificate)
    return finish(result, machine, made, measured_by, out or DEFAULT_OUT, as_json)


@accuracy.command()
@click.argument("table", type=INPUT)
@_judged_by
@_required_option
@_budget_option
@click.option("--radius-m", type=FINITE, help="Radius of the target circle, for chords in mm.")
@json_option
def stats(
    table: Path,
    config_file: Path | None,
    required_deg: float | None,
    budget: str,
    radius_m: float | None,
    as_json: bool,
) -> int:
    """Statistics of an error table (CSV: base_deg, direction, displacement_deg, error_deg or chord_mm).

    TABLE may also be the name of a shipped example: paper_table2.csv. It is judged by the machine of --config or by
    --required, and gets no verdict without either. Exit code 1 when the criterion is not met.
    """
    from gantryctl.cli.engineering.accuracy_end import exit_code
    from gantryctl.engineering.accuracy.budget import budget_data
    from gantryctl.engineering.accuracy.report.data import table_data, verdict_data
    from gantryctl.engineering.accuracy.report.report import AccuracyReport
    from gantryctl.engineering.accuracy.report.text import text_report
    from gantryctl.engineering.accuracy.table_csv import read_error_table
    from gantryctl.engineering.report.origin import Origin
    from gantryctl.machine import is_reference_machine

    # The statistics need no machine: any table of errors will do.
    errors = read_error_table(_shipped(table), radius_m)
    machine = machine_of(config_file) if config_file is not None else None
    made = AccuracyReport(
        machine="", config_hash="", version="", seed=0, source=table.name, measured=errors,
        origin=Origin.MEASURED, radius_m=radius_m, required=_required(machine, required_deg),
        dial=SIGNED if machine is None else machine.axis.dial,
        of_reference=machine is not None and is_reference_machine(machine),
        budget=_table_budget(errors, budget, radius_m),
    )  # fmt: skip
    if as_json:
        print_json(
            {**table_data(errors), "verdict": verdict_data(made.verdict), "budget": budget_data(made.budget)}
        )
    else:
        click.echo(text_report(made))
    return exit_code(made)


def _table_budget(table: ErrorTable, instrument: str, radius_m: float | None) -> Budget | None:
    """Budget of A of a table, by the data sheet of an instrument; None for one row, which has no A."""
    from gantryctl.engineering.accuracy.budget import table_budget
    from gantryctl.engineering.accuracy.table import Layout
    from gantryctl.engineering.instruments.sources import sources_of

    if len(table.rows) < 2 or table.layout is not Layout.APART:
        return None
    sources = sources_of(instrument) if radius_m is None else sources_of(instrument, radius_m)
    return table_budget(table, f"{instrument.replace('-', ' ')} by its data sheet, no certificate", sources)


@accuracy.command()
@click.argument("table", type=INPUT, default="paper_table2.csv")
@config_option
@click.option("--radius-m", type=FINITE, help="Radius of the target circle, for chords in mm.")
@json_option
def gear(table: Path, config_file: Path | None, radius_m: float | None, as_json: bool) -> None:
    """What a table of chord errors tells of the gear, and what it predicts of places that were left out.

    TABLE as for `accuracy stats`; default: the paper's. The gear's waves have the amplitudes of the machine file and
    unknown phases, the grade is weighed by the evidence. Every base is predicted from the others, with 95 % intervals.
    """
    from gantryctl.engineering.accuracy.gear import gear_study, study_data, study_text
    from gantryctl.engineering.accuracy.table_csv import read_error_table

    machine = machine_of(config_file)
    study = gear_study(read_error_table(_shipped(table), radius_m), machine, table.name)
    if as_json:
        print_json(study_data(study))
    else:
        click.echo(study_text(study, machine.axis.dial))


@accuracy.command("isocentre")
@config_option
@click.option(
    "--step-deg", type=Whole(5, 60), default=10, show_default=True, help="Between two angles of the table."
)
@json_option
def isocentre_(config_file: Path | None, step_deg: int, as_json: bool) -> None:
    """Where the isocentre goes over the travel, and the star shot's circle: weight and tracks of [plant.structure].

    Computed, in closed form; no axis moves. Six numbers an angle: shift x, y, z in the room, tilt of the nozzle.
    """
    from gantryctl.engineering.accuracy.isocentre import (
        angles_of,
        isocentre,
        isocentre_data,
        isocentre_text,
    )

    machine = machine_of(config_file)
    found = isocentre(machine, angles_of(machine, step_deg))
    if as_json:
        print_json(isocentre_data(found, machine))
    else:
        click.echo(isocentre_text(found, machine.axis.dial))


def _shipped(table: Path) -> Path:
    """A file, or the shipped example of that name."""
    from gantryctl.machine import default_machine_path

    # The shipped tables can be named without knowing where the package lies.
    example = default_machine_path().parent / "examples" / table.name
    return example if not table.exists() and table.parent == Path() and example.is_file() else table


@click.command("speed-test")
@bus_log_option
@config_option
@speeds_option
@out_option
@report_options
@yes_option
@json_option
def speed_test(
    config_file: Path | None,
    speeds_deg_s: tuple[float, ...],
    out: Path | None,
    yes: bool,
    as_json: bool,
    made: Made,
) -> int:
    """Reach each speed both ways; judge the speed error of the motor side over the whole move.

    The limit is [required] speed_error_ratio of the machine. The load side is reported beside it. On a bus the axis
    moves, by what the drive reports at every SYNC (606C), and the load side is not measured. Exit code 1 when a run
    fails.
    """
    from gantryctl.engineering.accuracy.procedure.plan import speeds_to_test
    from gantryctl.engineering.accuracy.report.data import speed_data
    from gantryctl.engineering.accuracy.report.page import render_speed_test
    from gantryctl.engineering.accuracy.report.text import speed_lines
    from gantryctl.engineering.accuracy.speed_test import speed_test as run_speeds
    from gantryctl.engineering.accuracy.speed_test import speed_test_on, speed_test_s

    machine = machine_under_test(config_file, "speed-test")
    file = directory(out) / "report.html" if out is not None else None
    wanted = speeds_to_test(machine, speeds_deg_s)
    if machine.on_bus:
        moves = f"moves both ways through the travel at {', '.join(f'{speed:g}' for speed in wanted)} deg/s"
        takes_s = speed_test_s(machine, wanted)
        with bus_experiment(
            machine, moves, takes_s=takes_s, yes=yes, quiet=as_json, needs_torque=False
        ) as run:
            runs = speed_test_on(run, wanted)
    else:
        # From the compiled loop, in a second.
        runs = run_speeds(machine, wanted)
    if file is not None:
        write_text(file, render_speed_test(runs, head_of(machine, made)))
    if as_json:
        print_json([speed_data(run) for run in runs])
    else:
        click.echo(speed_lines(runs))
        if file is not None:
            click.echo(f"report: {file.resolve()}")
    return int(not all(run.passed for run in runs))
