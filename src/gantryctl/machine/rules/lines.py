"""All rules between keys, and the lines they give."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Final

from gantryctl.machine.rules import axis, can, compensation, monitors, parts, plant
from gantryctl.machine.rules.book import Rule, violations

if TYPE_CHECKING:
    from gantryctl.machine.tables.model import Machine

RULES: Final[tuple[Rule, ...]] = (
    *axis.book.rules,
    *parts.book.rules,
    *monitors.book.rules,
    *can.book.rules,
    *plant.book.rules,
    *compensation.book.rules,
)


def contradictions(machine: Machine, name: str, unusable: Collection[str] = ()) -> list[str]:
    """One line per broken rule: `FILE: [table] key = value: what must hold; against [table] key = value`.

    Rules about a key in `unusable` are left out: its value is a stand-in for one that was refused already.
    """
    keys = {path for rule in RULES for path in rule.paths}
    silent = {path for path in keys if any(f"{path}.".startswith(f"{bad}.") for bad in unusable)}
    usable = [rule for rule in RULES if silent.isdisjoint(rule.paths)]
    return [f"{name}: {_line(machine, rule, wrong)}" for rule, wrong in violations(machine, usable)]


def _line(machine: Machine, rule: Rule, wrong: str) -> str:
    from gantryctl.machine.problems import show_value
    from gantryctl.machine.specs import field_specs, value_at

    shown = []
    for path in rule.paths:
        spec = field_specs()[path]
        shown.append(f"{spec.place} = {show_value(value_at(machine, path))}{spec.unit_text}")
    others = f"; against {', '.join(shown[1:])}" if len(shown) > 1 else ""
    return f"{shown[0]}: {wrong}{others}"
