"""`gantryctl new`: a requirement sheet and a whole machine file from a dozen answers."""

from __future__ import annotations

from pathlib import Path

import click

from gantryctl.cli.drafting import (
    answer_options,
    check_name,
    drafted,
    gears_option,
    motor_option,
    report,
    sheet_of,
    write_new,
)
from gantryctl.cli.options import json_option
from gantryctl.cli.values import PATH


@click.command()
@click.argument("name")
@click.option("--template", "template_name", metavar="KIND", help="Kind of axis; asked for when not given.")
@answer_options
@motor_option
@gears_option
@click.option("--out", "folder", type=PATH, default=".", help="Directory of both files.  [default: here]")
@click.option("--force", is_flag=True, help="Overwrite files of these names.")
@json_option
def new(
    name: str,
    template_name: str | None,
    answers_file: Path | None,
    options: tuple[str, ...],
    motor_files: tuple[Path, ...],
    gears: int,
    folder: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Write a requirement sheet NAME_sheet.toml and a whole machine file NAME.toml from a dozen answers.

    Asks each question with its unit and a default of the template, unless answers are given with --answers or --set;
    what is not answered then is the template's. Kinds: crane_slew, gantry, rotary_table, telescope_azimuth,
    tilt_table, wind_turbine_yaw. Every value that is still a guess is listed.

    The draft is tried with random gears of its grade on the full plant: what 95 % of them keep is printed beside what
    is required, and where the usual grade is too coarse the coarsest that keeps it is taken.
    """
    from gantryctl.engineering.drafting.choice import with_enough_grade
    from gantryctl.engineering.drafting.open_items import gears_of_grade
    from gantryctl.engineering.drafting.sheets import drafted_sheet
    from gantryctl.engineering.drafting.writing import machine_text, sheet_text

    check_name(name, "NAME")
    answered, values = sheet_of(name, template_name, answers_file, options, as_json)
    made = drafted(drafted_sheet(values, f"sheet of {name}"), motor_files, name)
    tried = gears_of_grade(made, gears) if gears else None
    finer = None if tried is None else with_enough_grade(values, tried)
    if tried is not None and tried.enough is not None and finer is not None:
        values, tried = finer, tried._replace(drafted=tried.enough)
        made = drafted(drafted_sheet(values, f"sheet of {name}"), motor_files, name)
    sheet_path, machine_path = folder / f"{name}_sheet.toml", folder / f"{name}.toml"
    texts = {
        sheet_path: sheet_text(values, answered.template.template.name),
        machine_path: machine_text(made),
    }
    schemas = write_new(texts, force)
    report(made, tried, list(texts), schemas, values, as_json)
