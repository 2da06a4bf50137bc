"""All rules between keys, and the lines they give."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from gantryctl.machine.problems import show_value
from gantryctl.machine.rules import axis, can, compensation, monitors, parts, plant
from gantryctl.machine.rules.book import REGISTERED, Limit, Rule, violations
from gantryctl.machine.specs import field_specs, value_at
from gantryctl.machine.tables.model import Machine

# In the order of the reference page and of the messages, whatever order the chapters are imported in.
_CHAPTERS: Final = [module.__name__ for module in (axis, parts, monitors, can, plant, compensation)]

RULES: Final[tuple[Rule, ...]] = tuple(
    sorted(REGISTERED, key=lambda rule: _CHAPTERS.index(rule.check.__module__))
)


def contradictions(machine: Machine, name: str, unusable: Collection[str] = ()) -> list[str]:
    """One line per broken rule: `FILE: [table] key = value: what must hold; against [table] key = value`.

    Rules about a key in `unusable` are left out: its value is a stand-in for one that was refused already.
    """
    keys = {path for rule in RULES for path in rule.paths}
    silent = {path for path in keys if any(f"{path}.".startswith(f"{bad}.") for bad in unusable)}
    usable = [rule for rule in RULES if silent.isdisjoint(rule.paths)]
    return [f"{name}: {_line(machine, rule, wrong)}" for rule, wrong in violations(machine, usable)]


def _line(machine: Machine, rule: Rule, wrong: Limit | str) -> str:
    specs = [field_specs()[path] for path in rule.paths]
    first, *others = (
        f"{spec.place} = {show_value(value_at(machine, spec.path))}{spec.unit_text}" for spec in specs
    )
    demand = wrong.text(specs[0].unit_text) if isinstance(wrong, Limit) else wrong
    return f"{first}: {demand}" + (f"; against {', '.join(others)}" if others else "")
