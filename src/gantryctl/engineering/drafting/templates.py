"""Templates: usual answers for a kind of axis, and the proportions by which the rest of a sheet follows from them.

One TOML file each, `configs/templates/*.toml`.
"""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from gantryctl.engineering.drafting.questions import Answers
from gantryctl.errors import UsageError
from gantryctl.machine import configs_folder, load_table
from gantryctl.machine.tables.axis import IdentityTable
from gantryctl.machine.tables.fields import Table, required_number, table, text


class TemplateIdentity(IdentityTable):
    """[template]: what kind of axis it is."""

    source: str = Field(
        min_length=1,
        max_length=300,
        examples=["usual figures of such an axis"],
        description="Where the figures come from.",
    )
    angle_source: str = text(
        "", 120, "What the usual required angle follows from; empty for a usual figure without a source."
    )


class Proportions(Table):
    """[proportions]: what changes with the size of the axis, and does so by rule."""

    radius_of_gyration_m: float = required_number(
        3.3,
        0.001,
        100.0,
        "sqrt(inertia / mass) of the load of [answers]; grows with the fifth root of the inertia.",
    )
    ring_radius_ratio: float = required_number(0.7, 0.05, 5.0, "Radius of the ring over it.")
    ring_ratio: float = required_number(13.0, 1.0, 100.0, "Turns of the pinion per turn of the axis.")
    pinion_teeth: int = required_number(20, 6, 500, "Teeth of the pinion.")
    grade: float = required_number(8.0, 1.0, 12.0, "Accuracy grade of the teeth by ISO 1328-1.")
    backlash_ratio: float = required_number(0.0036, 0.0, 0.2, "Backlash over the module.")
    friction_coefficient: float = required_number(
        0.0013, 0.0, 1.0, "Friction of the bearing at the radius of the ring over the weight of the load."
    )
    motor_speed_r_min: float = required_number(
        1000.0, 10.0, 10000.0, "Motor speed at the highest speed setting."
    )
    damping_ratio: float = required_number(0.02, 0.0, 0.5, "Damping ratio of the first mode.")
    base_frequency_ratio: float = required_number(
        3.5, 1.0, 100.0, "Frequency of the base over the first mode."
    )
    base_inertia_ratio: float = required_number(
        0.3, 0.01, 100.0, "Inertia of the base over that of the load."
    )
    resolution: float = required_number(100.0, 1.0, 1e6, "Required accuracy over one step of the encoder.")
    inertia_ratio_max: float = required_number(10.0, 0.1, 1000.0, "Load at the motor over rotor and input.")


class Template(Table):
    """A kind of axis."""

    template: TemplateIdentity = table("What kind of axis it is.")
    answers: Answers = table("Usual answers.")
    proportions: Proportions = table("What follows by rule.")


def template_names() -> list[str]:
    """Names of the delivered templates."""
    return sorted(path.stem for path in _folder().glob("*.toml"))


def load_template(name: str) -> Template:
    """Read a delivered template.

    Raises:
        UsageError: there is none of this name.
    """
    names = template_names()
    if name not in names:
        raise UsageError(f"--template {name}: there is none; choose {', '.join(names)}")
    return load_table(Template, _folder() / f"{name}.toml")


def _folder() -> Path:
    return configs_folder() / "templates"
