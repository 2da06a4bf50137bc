"""`gantryctl analyse`: linear analysis of the loop as it is configured and runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import (
    FINITE,
    config_option,
    directory,
    json_option,
    machine_of,
    out_option,
    print_json,
)
from gantryctl.cli.text import paragraph, print_table

if TYPE_CHECKING:
    from gantryctl.engineering.analysis.measured.response import Measured
    from gantryctl.engineering.analysis.robust_report import RobustReport
    from gantryctl.engineering.analysis.study import Study
    from gantryctl.machine import Machine

DEFAULT_OUT = Path("analysis")


@click.command()
@config_option
@click.option(
    "--plant",
    type=click.Choice(["rigid", "two-mass", "full"]),
    help="Which bodies move by themselves; full, with the rocking base, unless [plant.switches] rigid = true.",
)
@click.option(
    "--friction",
    type=click.Choice(["none", "sliding", "holding"]),
    default="none",
    show_default=True,
    help="Small-signal friction: absent, while turning, while standing.",
)
@click.option(
    "--robust", "with_robust", is_flag=True, help="Worst case over stiffness, damping and inertias."
)
@click.option(
    "--measure", "with_measured", is_flag=True, help="Measure frequency responses on the simulated axis."
)
@click.option(
    "--at", "angle_deg", type=FINITE, default=75.0, show_default=True, help="Where to measure, deg."
)
@click.option(
    "--torque", "torque_nm", type=FINITE, help="Test torque, N m; 4 % of the rated torque when not given."
)
@click.option("--plot", is_flag=True, help=f"Write pictures to --out (default: {DEFAULT_OUT}/).")
@out_option
@json_option
def analyse(
    config_file: Path | None,
    plant: str | None,
    friction: str,
    with_robust: bool,
    with_measured: bool,
    angle_deg: float,
    torque_nm: float | None,
    plot: bool,
    out: Path | None,
    as_json: bool,
) -> int:
    """Linear analysis of the loop as configured, sampled and delayed as it runs.

    Eq. (5) in symbols and numbers, margins at each cut, bandwidths, poles, modes, and what they mean. The plant is
    that of [plant]. Exit code 1 when the loop is unstable.
    """
    from gantryctl.engineering.analysis.models.mechanics import Friction, PlantKind
    from gantryctl.engineering.analysis.study import study

    machine = machine_of(config_file)
    kind = PlantKind(plant) if plant else PlantKind.RIGID if machine.plant.switches.rigid else PlantKind.FULL
    result = study(machine, kind, Friction(friction))
    robust = _robust(machine) if with_robust else None
    measured = _measured(machine, angle_deg, torque_nm) if with_measured else []
    folder = directory(out or DEFAULT_OUT) if plot or out is not None else None
    files = _plot(result, robust is not None, measured, folder) if plot and folder is not None else []
    data = _data(result, robust, measured) if as_json or folder is not None else {}
    if folder is not None:
        files.append(_write(folder / "analysis.json", data))
    if as_json:
        print_json(data)
    else:
        _show(result, robust, measured)
        for path in files:
            click.echo(f"wrote {path}")
    return 0 if result.stable else 1


def _robust(machine: Machine) -> RobustReport:
    from gantryctl.engineering.analysis.robust_report import robust_report

    return robust_report(machine)


def _measured(machine: Machine, angle_deg: float, torque_nm: float | None) -> list[Measured]:
    from gantryctl.engineering.analysis.measured.response import conditions, measure_simulated, starts_at_deg
    from gantryctl.errors import UsageError

    if not machine.axis.pos_min_deg < angle_deg < machine.axis.pos_max_deg:
        raise UsageError(
            f"--at {angle_deg:g}: must lie within travel, "
            f"{machine.axis.pos_min_deg:g}..{machine.axis.pos_max_deg:g} deg"
        )
    if machine.drive.kind != "sim":
        raise UsageError(f'--measure needs [drive] kind = "sim", this machine has "{machine.drive.kind}"')
    chosen = conditions(machine, angle_deg, torque_nm)
    for how in chosen:
        starts_at_deg(machine, how)
    return [measure_simulated(machine, how) for how in chosen]


def _plot(study: Study, with_damping: bool, measured: list[Measured], folder: Path) -> list[Path]:
    from gantryctl.engineering.analysis.figures import frequency_plots
    from gantryctl.engineering.analysis.figures_time import (
        damping_over_stiffness,
        measured_response,
        time_responses,
    )

    files = [*frequency_plots(study, folder), time_responses(study, folder)]
    if with_damping:
        files.append(damping_over_stiffness(study.machine, folder))
    if measured:
        files.append(measured_response(measured, folder))
    return files


def _data(study: Study, robust: RobustReport | None, measured: list[Measured]) -> dict[str, Any]:
    from gantryctl.engineering.analysis.data import study_data
    from gantryctl.engineering.analysis.measured.response import measured_data
    from gantryctl.engineering.analysis.robust_report import robust_data

    data = study_data(study)
    if robust is not None:
        data["robust"] = robust_data(robust)
    if measured:
        data["measured"] = [measured_data(result) for result in measured]
    return data


def _write(path: Path, data: dict[str, Any]) -> Path:
    import json

    from gantryctl.errors import UsageError

    try:
        path.write_text(json.dumps(data, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as fault:
        raise UsageError(f"{path}: cannot be written: {fault.strerror or fault}") from None
    return path


def _show(study: Study, robust: RobustReport | None, measured: list[Measured]) -> None:
    from gantryctl.engineering.analysis import tables
    from gantryctl.engineering.analysis.figures import name_of
    from gantryctl.engineering.analysis.measured.response import sentence
    from gantryctl.engineering.analysis.models import equation5
    from gantryctl.engineering.analysis.models.paper_loop import rigid_loop
    from gantryctl.engineering.analysis.robust_report import robust_sentences
    from gantryctl.engineering.analysis.text import sentences, timing

    loop = rigid_loop(study.machine)
    click.echo(f"{name_of(study)}\n{timing(study.settings)}\n")
    for line in (*equation5.SYMBOLS, "", *equation5.numbers(loop)):
        click.echo(line)
    click.echo(
        f"poles {_roots(loop.position.poles.tolist())}; zeros {_roots(loop.position.zeros.tolist())} rad/s"
    )
    shown = [
        tables.equation_5_table(study),
        tables.margins_table(study),
        tables.closed_table(study),
        tables.modes_table(study),
        tables.poles_table(study),
    ]
    if robust is not None:
        shown.append(tables.robust_table(robust.margins))
    for table in shown:
        if table.rows:
            print_table(table)
    words = sentences(study)
    if robust is not None:
        words += robust_sentences(robust)
    words += [sentence(result) for result in measured]
    click.echo()
    for text in words:
        paragraph(text)


def _roots(roots: list[complex]) -> str:
    """One of each pair, as text."""
    shown = [root for root in roots if root.imag >= 0.0]
    return ", ".join(f"{r.real:.4g}" + (f" ± {r.imag:.4g}j" if r.imag else "") for r in shown)
