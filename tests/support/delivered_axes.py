"""Axes that come with the product and are no gantry of the paper: two machine files, and a draft of each template."""

from __future__ import annotations

from functools import cache
from typing import Final

from gantryctl.engineering.drafting.choice import draft_with
from gantryctl.engineering.drafting.sheets import Answered, drafted_sheet, sheet_values
from gantryctl.engineering.drafting.templates import load_template, template_names
from gantryctl.engineering.sizing.motors import delivered_motors, load_motors
from gantryctl.machine import Machine, configs_folder, load_machine

CONFIGS: Final = ("azimuth_dish", "rotary_table")
DRAFTS: Final = tuple(f"draft of {name}" for name in template_names())


@cache
def axis_of(name: str) -> Machine:
    """A delivered machine file by its name, or "draft of TEMPLATE" with the usual answers."""
    template = name.removeprefix("draft of ")
    if template == name:
        return load_machine(configs_folder() / f"{name}.toml")
    values = sheet_values(Answered.of(load_template(template), {}), f"my_{template}")
    sheet = drafted_sheet(values, "sheet")
    return draft_with(sheet, load_motors(delivered_motors()), f"my_{template}").machine()
