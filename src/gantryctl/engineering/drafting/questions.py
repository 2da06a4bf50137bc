"""The questions of `gantryctl new`: a dozen figures from which a sheet follows, each with unit, limits and default."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, Final

from gantryctl.errors import ConfigError, UsageError
from gantryctl.machine.loading import check_table
from gantryctl.machine.reading import Data, parse_toml, printable
from gantryctl.machine.specs import FieldSpec, Value, field_specs
from gantryctl.machine.tables.axis import AXIS_KIND, POS_MAX_DEG, POS_MIN_DEG, AxisKind
from gantryctl.machine.tables.fields import Table, number, required_number, table, text

BY_RULE: Final = 0.0
"""Answer to a question whose value then follows from the others."""


class Answers(Table):
    """[answers]: what one must know of an axis; 0 where the rule may answer."""

    pos_min_deg: float = POS_MIN_DEG
    pos_max_deg: float = POS_MAX_DEG
    speed_max_r_min: float = required_number(1.0, 1e-3, 60.0, "Highest speed.")
    acc_time_s: float = required_number(15.0, 0.05, 600.0, "From rest to the highest speed in a normal move.")
    angle_deg: float = required_number(0.1, 1e-5, 5.0, "Required accuracy of the angle.")
    stopping_angle_deg: float = required_number(
        4.0, 0.01, 90.0, "Permitted angle of a quick stop from that speed."
    )
    inertia_kg_m2: float = required_number(
        2e6, 0.01, 1e8, "Inertia of everything that turns, about the axis."
    )
    unbalance_nm: float = required_number(
        0.0, 0.0, 2e6, "Moment of the centre of mass about the axis, the largest."
    )
    wind_nm: float = required_number(0.0, 0.0, 2e6, "Largest moment of the wind about the axis.")
    first_mode_hz: float = required_number(
        2.0, 0.02, 500.0, "Lowest natural frequency of the load with the motor held."
    )
    friction_nm: float = number(
        BY_RULE, 0.0, 2e6, "Friction of the bearing while turning; 0 = by the template's rule."
    )
    gear_ratio: float = number(
        BY_RULE, 0.0, 50000.0, "Motor turns per turn of the axis; 0 = what speed and encoder allow."
    )
    kind: AxisKind = AXIS_KIND
    source: str = text("", 200, "Where the requirement comes from.")


class AnswersFile(Table):
    """A file of answers: the keys of `Answers` without a table."""

    answers: Answers = table("The answers.")


def questions() -> dict[str, FieldSpec]:
    """The questions by key, in the order in which they are asked."""
    return {spec.key: spec for spec in field_specs(AnswersFile).values()}


def answered(text: str, name: str) -> dict[str, Value]:
    """Answers of a file: `key = value`, a line each; those that are missing stay with the template.

    Raises:
        ConfigError: one line per problem.
    """
    return _checked(parse_toml(text, name), name)


def answered_by_options(options: tuple[str, ...]) -> dict[str, Value]:
    """Answers of `--set KEY=VALUE`.

    Raises:
        UsageError: no `=`. ConfigError: an unknown key, or a value that it does not accept.
    """
    data: Data = {}
    for option in options:
        key, sign, value = (part.strip() for part in option.partition("="))
        if not sign or not key:
            raise UsageError(f"--set {option}: write --set KEY=VALUE; the keys are {', '.join(questions())}")
        if key in data:
            raise UsageError(f"--set {option}: {key} is set twice")
        data[key] = _value(key, value)
    return _checked(data, "--set")


def _value(key: str, text: str) -> Any:
    """A value as TOML reads it; a text needs no quotes here."""
    try:
        value = tomllib.loads(f"v = {text}")["v"]
    except tomllib.TOMLDecodeError:
        return text
    spec = questions().get(key)
    return text if spec is not None and spec.kind == "text" and not isinstance(value, str) else value


def one_answer(key: str, text: str) -> Value:
    """Check one answer.

    Raises:
        ConfigError: with what the question accepts.
    """
    return _checked({key: _value(key, text)}, "answer")[key]


def _checked(data: Data, name: str) -> dict[str, Value]:
    unknown = [key for key in data if key not in questions()]
    if unknown:
        raise ConfigError([f"{name}: {_unknown(key)}" for key in unknown])
    # What is missing is filled with usual values only so that the rest can be checked as strictly as a file.
    usual = {key: spec.usual for key, spec in questions().items()}
    found = _whole_numbers(data)
    try:
        checked = check_table(AnswersFile, {"answers": usual | found}, name)
    except ConfigError as wrong:
        raise ConfigError(
            [line.replace("[answers] ", "").replace("answers.", "") for line in wrong.problems]
        ) from None
    return {key: getattr(checked.answers, key) for key in found}


def _unknown(key: str) -> str:
    near = get_close_matches(key, questions(), 1, 0.5)
    hint = f"did you mean {near[0]}?" if near else f"the keys are {', '.join(questions())}"
    return f"{printable(key)}: unknown key; {hint}"


def _whole_numbers(data: Mapping[str, Any]) -> Data:
    """A person who answers 5 means 5.0."""
    return {
        key: float(value) if isinstance(value, int) and not isinstance(value, bool) else value
        for key, value in data.items()
    }
