"""Sheets and drafts as files: every value with its unit, its origin and its rule behind it, and the list of guesses."""

from __future__ import annotations

from typing import Final

from gantryctl.engineering.drafting.draft import Draft
from gantryctl.engineering.drafting.origin import Drafted, Origin, Values, guesses
from gantryctl.engineering.sizing.sheet import Sheet
from gantryctl.machine import field_specs
from gantryctl.machine.effective import toml_tables
from gantryctl.machine.schema import MACHINE_LINE, SHEET_LINE
from gantryctl.machine.specs import FieldSpec

_ORIGINS: Final = """\
# Behind each value: unit, origin, rule. "sheet": of the requirement sheet. "catalogue": the motor's file.
# "computed": by the rule behind it. "choice": a decision that fits any axis. "guess": nobody has measured or decided it
# yet; the rows of `guesses` below name all of them. Replace a guess by what you know and delete its row."""


def machine_text(draft: Draft) -> str:
    """The machine file of a draft."""
    sheet, motor = draft.fit.train.sheet.sheet, draft.fit.motor
    head = (
        f"{MACHINE_LINE}"
        f"# Drafted from requirement sheet {sheet.name} with motor {motor.name} ({motor.identity.source}).\n"
        f"{_ORIGINS}\n"
        "# Then: gantryctl config check, gantryctl stops, gantryctl tune, gantryctl accuracy run. The simulator alone\n"
        "# reads [plant].\n\n"
    )
    return head + _tables(draft.values, field_specs())


def sheet_text(values: Values, template: str) -> str:
    """The requirement sheet of a person's answers."""
    head = (
        f"{SHEET_LINE}# Requirement sheet of template {template}.\n{_ORIGINS}\n"
        "# Then: gantryctl size this_file, gantryctl config init machine.toml --sheet this_file.\n\n"
    )
    return head + _tables(values, field_specs(Sheet))


def guess_lines(values: Values) -> list[str]:
    """The guesses, a line each: key, value, unit, rule."""
    return [_line(path, values[path]) for path in guesses(values)]


def _line(path: str, drafted: Drafted) -> str:
    table, _, key = path.rpartition(".")
    value = drafted.value
    shown = (
        f"{len(value)} numbers"
        if isinstance(value, tuple)
        else f"{value:g}"
        if isinstance(value, float)
        else value
    )
    return f"[{table}] {key} = {shown}: {drafted.rule}"


def _tables(values: Values, specs: dict[str, FieldSpec]) -> str:
    comments = {}
    for path, drafted in values.items():
        unit = specs[path].unit
        # A choice without a reason needs no words.
        origin = "" if drafted.origin is Origin.CHOICE and not drafted.rule else drafted.comment
        words = ", ".join(word for word in ("" if unit == "-" else unit, origin) if word)
        if words:
            comments[path] = words
    return toml_tables({path: drafted.value for path, drafted in values.items()}, comments=comments)
