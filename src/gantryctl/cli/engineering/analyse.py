"""`gantryctl analyse`: linear analysis of the loop as it is configured and runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from gantryctl.cli.engineering.experiment import bus_experiment, machine_under_test, yes_option
from gantryctl.cli.options import (
    bus_log_option,
    choice_option,
    config_option,
    directory,
    json_option,
    machine_of,
    out_option,
    print_json,
    write_json,
)
from gantryctl.cli.progress import metered
from gantryctl.cli.text import paragraph, print_table
from gantryctl.cli.values import FINITE
from gantryctl.extras import need

if TYPE_CHECKING:
    from gantryctl.engineering.analysis.measured.response import MeasuredResponse
    from gantryctl.engineering.analysis.models.robust import RobustReport
    from gantryctl.engineering.analysis.study import Study

# Pictures and data go here when --plot names no folder.
DEFAULT_OUT = Path("analysis")
# Where to measure when --at is not given.
_AT_DEG: Final = 75.0


@click.command()
@bus_log_option
@config_option
@click.option(
    "--plant",
    type=click.Choice(["rigid", "two-mass", "full"]),
    help="Which bodies move by themselves; full, with the rocking base, unless [plant.switches] rigid = true.",
)
@choice_option(
    "--friction",
    ("none", "sliding", "holding"),
    "Small-signal friction: absent, while turning, while standing.",
)
@click.option(
    "--robust", "with_robust", is_flag=True, help="Worst case over stiffness, damping and inertias."
)
@click.option(
    "--measure",
    "with_measured",
    is_flag=True,
    help="Measure frequency responses on the axis, simulated or on a bus.",
)
@click.option("--at", "angle_deg", type=FINITE, help=f"Where to --measure, deg; {_AT_DEG:g} when not given.")
@click.option(
    "--torque",
    "torque_nm",
    type=FINITE,
    help="Test torque to --measure with, N m; 4 % of the rated torque when not given.",
)
@click.option("--plot", is_flag=True, help=f"Write pictures to --out (default: {DEFAULT_OUT}/).")
@out_option
@yes_option
@json_option
def analyse(
    config_file: Path | None,
    plant: str | None,
    friction: str,
    with_robust: bool,
    with_measured: bool,
    angle_deg: float | None,
    torque_nm: float | None,
    plot: bool,
    out: Path | None,
    yes: bool,
    as_json: bool,
) -> int:
    """Linear analysis of the loop as configured, sampled and delayed as it runs.

    Eq. (5) in symbols and numbers, margins at each cut, bandwidths, poles, modes, and what they mean. The plant is
    that of [plant]. Where compensations feed the load back, margins of the whole loop too. Exit code 1 when the loop
    is unstable.
    """
    from gantryctl.engineering.analysis.models.mechanics import Friction, PlantKind
    from gantryctl.engineering.analysis.models.robust import robust_report
    from gantryctl.engineering.analysis.study import study
    from gantryctl.errors import UsageError

    for option, given in (("--at", angle_deg), ("--torque", torque_nm)):
        # The linear analysis is of the file's values, at no angle: somebody would read it as of the one that he named.
        if given is not None and not with_measured:
            raise UsageError(f"{option}: is for --measure; the analysis of the model has neither")
    if plot:
        need("matplotlib")
    machine = machine_of(config_file)
    # A machine that is simulated rigid is analysed rigid.
    kind = PlantKind(plant) if plant else PlantKind.RIGID if machine.plant.switches.rigid else PlantKind.FULL
    result = study(machine, kind, Friction(friction))
    robust = robust_report(machine) if with_robust else None
    measured = []
    if with_measured:
        measured = _measured(
            config_file, _AT_DEG if angle_deg is None else angle_deg, torque_nm, yes, quiet=as_json
        )
    folder = directory(out or DEFAULT_OUT) if plot or out is not None else None
    files = _plot(result, robust is not None, measured, folder) if plot and folder is not None else []
    data = _data(result, robust, measured) if as_json or folder is not None else {}
    if folder is not None:
        files.append(write_json(folder / "analysis.json", data))
    if as_json:
        print_json(data)
    else:
        _show(result, robust, measured)
        for path in files:
            click.echo(f"wrote {path}")
    whole = result.load_side is None or result.load_side.stable
    return 0 if result.stable and whole else 1


def _measured(
    config_file: Path | None, angle_deg: float, torque_nm: float | None, yes: bool, *, quiet: bool
) -> list[MeasuredResponse]:
    from gantryctl.engineering.analysis.measured.response import (
        axis_time_s,
        conditions,
        measure_on,
        measure_simulated,
        starts_at_deg,
    )
    from gantryctl.engineering.identification.measure import quiet_machine
    from gantryctl.errors import UsageError

    machine = machine_under_test(config_file, "--measure")
    angle_deg = machine.axis.meant_deg(angle_deg)
    if not machine.axis.pos_min_deg < angle_deg < machine.axis.pos_max_deg:
        raise UsageError(
            f"--at {angle_deg:g}: must lie within travel, "
            f"{machine.axis.dial.span(machine.axis.pos_min_deg, machine.axis.pos_max_deg)} deg"
        )
    chosen = conditions(machine, angle_deg, torque_nm)
    # Every condition is checked before the first one is measured, which takes a minute.
    starts = [starts_at_deg(machine, how) for how in chosen]
    if not machine.on_bus:
        measured = []
        with metered(len(chosen), quiet=quiet) as meter:
            for how in chosen:
                measured.append(measure_simulated(machine, how))
                meter.advance(1.0)
        return measured
    largest_nm = max(how.torque_nm for how in chosen)
    dial, takes_s = machine.axis.dial, axis_time_s(machine, chosen)
    begin, end = (dial.text(at, ".1f") for at in (min(starts), 2.0 * angle_deg - min(starts)))
    moves = (
        f"moves to {dial.text(angle_deg, '.1f')} deg at up to {machine.speed.setting_max_deg_s:g} deg/s, then for "
        f"about {takes_s / 60.0:.0f} minutes stands there, moves to {begin} deg and turns slowly to {end} deg, with "
        f"a test signal of +-{largest_nm:.3g} N m on its speed command"
    )
    with bus_experiment(
        machine, moves, takes_s=takes_s, yes=yes, quiet=quiet, controlled_as=quiet_machine(machine)
    ) as run:
        return [measure_on(machine, run, how) for how in chosen]


def _plot(study: Study, with_damping: bool, measured: list[MeasuredResponse], folder: Path) -> list[Path]:
    # matplotlib is imported for pictures only.
    from gantryctl.engineering.analysis import figures

    files = [*figures.frequency_plots(study, folder), figures.time_responses(study, folder)]
    if with_damping:
        files.append(figures.damping_over_stiffness(study.machine, folder))
    if measured:
        files.append(figures.measured_response(measured, folder))
    return files


def _data(study: Study, robust: RobustReport | None, measured: list[MeasuredResponse]) -> dict[str, Any]:
    from gantryctl.engineering.analysis.data import measured_data, robust_data, study_data

    data = study_data(study)
    if robust is not None:
        data["robust"] = robust_data(robust)
    if measured:
        data["measured"] = [measured_data(result) for result in measured]
    return data


def _show(study: Study, robust: RobustReport | None, measured: list[MeasuredResponse]) -> None:
    from gantryctl.engineering.analysis import text
    from gantryctl.engineering.analysis.models.paper_loop import rigid_loop

    loop = rigid_loop(study.machine)
    click.echo(f"{text.study_name(study)}\n{text.timing(study.settings)}\n")
    for line in (*text.EQUATION_5, "", *text.equation_5_numbers(loop)):
        click.echo(line)
    click.echo(
        f"poles {_roots(loop.position.poles.tolist())}; zeros {_roots(loop.position.zeros.tolist())} rad/s"
    )
    # A rigid plant has no modes: empty tables are left out.
    for table in text.study_tables(study) + ([text.robust_table(robust.margins)] if robust else []):
        if table.rows:
            print_table(table)
    click.echo()
    sentences = text.sentences(study) + (text.robust_sentences(robust) if robust else [])
    for sentence in sentences + [text.measured_sentence(result) for result in measured]:
        paragraph(sentence)


def _roots(roots: list[complex]) -> str:
    """One of each pair, as text."""
    # Complex roots come in pairs; the lower half plane says nothing new.
    shown = [root for root in roots if root.imag >= 0.0]
    return ", ".join(f"{r.real:.4g}" + (f" ± {r.imag:.4g}j" if r.imag else "") for r in shown)
