"""Tables of a campaign file."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

from pydantic import Field

from gantryctl.machine.tables.fields import Table, choice, number, numbers, switch, table, text

COUNT_MAX: Final = 1_000_000_000
_GRADES: Final = (4.0, 12.0)


def _texts(least: int, most: int, meaning: str, default: tuple[str, ...] | None = None) -> Any:
    limits: dict[str, Any] = {"min_length": least, "max_length": most, "description": meaning}
    return Field(**limits) if default is None else Field(default=default, **limits)


class CampaignTable(Table):
    """[campaign]: what is measured on how many plants."""

    name: str = Field(
        min_length=1,
        max_length=64,
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$",
        examples=["gears"],
        description="Short name, used for the folder of the result: letters, digits, '_', '-', '.'.",
    )
    description: str = text("", 300, "One line for people.")
    machine: str = text(
        "hust_gantry.toml", 200, "Machine file: beside the campaign file, else one that is shipped."
    )
    tests: tuple[str, ...] = _texts(
        1, 4, "What is measured: chord_test, speed_test, move, stops.", ("chord_test",)
    )
    outputs: tuple[str, ...] = _texts(0, 40, "Figures to keep; none for all of the tests.", ())
    sampling: Literal["monte_carlo", "sobol", "latin_hypercube", "sensitivity"] = choice(
        "monte_carlo", "How plants are drawn; sensitivity: for Sobol indices, count is the base sample."
    )
    count: int = number(
        1000, 2, COUNT_MAX, "Plants; of a sensitivity analysis the base sample, a power of 2."
    )
    seed: int = number(0, 0, 2**31 - 1, "Seed of everything random.")


class UniformTable(Table):
    """[vary.NAME] law = "uniform"."""

    law: Literal["uniform"] = choice("uniform", "Every value between two equally likely.")
    keys: tuple[str, ...] = _texts(1, 40, "Keys of the machine file that move together.")
    relative: bool = switch(False, "The numbers are factors of the machine's own value.")
    low: float = Field(ge=-1e12, le=1e12, description="Smallest value.")
    high: float = Field(ge=-1e12, le=1e12, description="Largest value.")


class NormalTable(Table):
    """[vary.NAME] law = "normal"."""

    law: Literal["normal"] = choice("normal", "Gauss.")
    keys: tuple[str, ...] = _texts(1, 40, "Keys of the machine file that move together.")
    relative: bool = switch(False, "The numbers are factors of the machine's own value.")
    mean: float = Field(ge=-1e12, le=1e12, description="Mean.")
    deviation: float = Field(ge=1e-12, le=1e12, description="Standard deviation.")


class LognormalTable(Table):
    """[vary.NAME] law = "lognormal"."""

    law: Literal["lognormal"] = choice("lognormal", "The logarithm is normal: always of one sign.")
    keys: tuple[str, ...] = _texts(1, 40, "Keys of the machine file that move together.")
    relative: bool = switch(False, "The median is a factor of the machine's own value.")
    median: float = Field(ge=1e-12, le=1e12, description="Median.")
    spread: float = Field(
        ge=1.0001, le=100.0, description="Geometric standard deviation: 68 % within median / and x spread."
    )


class DiscreteTable(Table):
    """[vary.NAME] law = "discrete"."""

    law: Literal["discrete"] = choice("discrete", "One of several values.")
    keys: tuple[str, ...] = _texts(1, 40, "Keys of the machine file that move together.")
    relative: bool = switch(False, "The values are factors of the machine's own value.")
    values: tuple[Annotated[float, Field(ge=-1e12, le=1e12)], ...] = Field(
        min_length=1, max_length=200, description="Values."
    )
    weights: tuple[Annotated[float, Field(ge=0.0, le=1e12)], ...] = numbers(
        (), 0, 200, "How often each comes, in proportion; none: equally often."
    )


class GearGradeTable(Table):
    """[vary.NAME] law = "gear_grade"."""

    law: Literal["gear_grade"] = choice(
        "gear_grade", "Accuracy grades of ISO 1328: [plant.gear_error] scale = sqrt(2)^(grade - 8)."
    )
    grades: tuple[Annotated[float, Field(ge=_GRADES[0], le=_GRADES[1])], ...] = Field(
        min_length=1, max_length=20, description="Grades; the amplitudes of [plant.gear_error] are grade 8."
    )
    weights: tuple[Annotated[float, Field(ge=0.0, le=1e12)], ...] = numbers(
        (), 0, 20, "How often each comes, in proportion; none: equally often."
    )


class PhasesTable(Table):
    """[vary.NAME] law = "phases"."""

    law: Literal["phases"] = choice(
        "phases", "Another gear of the same grade: every phase of [plant.gear_error] between 0 and 2 pi."
    )


LAWS: Final[dict[str, type[Table]]] = {
    "uniform": UniformTable,
    "normal": NormalTable,
    "lognormal": LognormalTable,
    "discrete": DiscreteTable,
    "gear_grade": GearGradeTable,
    "phases": PhasesTable,
}


class ChordTestTable(Table):
    """[chord_test]: how A is measured."""

    procedure: Literal["A", "B", "C", "D"] = choice("A", "Order of the stops.")
    runs: int = number(1, 1, 20, "Times that all stops are visited.")


class SpeedTestTable(Table):
    """[speed_test]: moves at constant speed, both ways."""

    speeds_r_min: tuple[Annotated[float, Field(ge=0.001, le=10.0)], ...] = numbers(
        (), 0, 10, "Speeds at the load; none: those of the machine, as `gantryctl speed-test` takes them."
    )


class MoveTable(Table):
    """[move]: one move from rest to rest, with the highest speed setting."""

    from_deg: float = number(0.0, -3600.0, 3600.0, "Where it begins.")
    to_deg: float = number(90.0, -3600.0, 3600.0, "Where it ends.")


class ImprovedTable(Table):
    """[improved]: a second way of control on the same plants, each identified anew."""

    machine: str = text(
        "",
        200,
        "Machine file with the same plant and another control, such as hust_improved.toml; none for none.",
    )
    variants: tuple[str, ...] = _texts(
        0, 40, "Rows of `gantryctl compare` to measure, by name; none: the first and the last.", ()
    )


class CampaignFile(Table):
    """Tables of a campaign file that have the same keys in every file."""

    campaign: CampaignTable = table("What is measured on how many plants.")
    chord_test: ChordTestTable = table("How A is measured.", ChordTestTable)
    speed_test: SpeedTestTable = table("Moves at constant speed.", SpeedTestTable)
    move: MoveTable = table("One move.", MoveTable)
    improved: ImprovedTable = table("A second way of control.", ImprovedTable)
