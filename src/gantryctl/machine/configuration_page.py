"""The reference page of the machine file: `python -m gantryctl.machine.configuration_page FILE` writes it."""

from __future__ import annotations

import sys
from pathlib import Path

from gantryctl.machine.problems import show_value
from gantryctl.machine.reading import MAX_BYTES, MAX_DEPTH, MAX_LINE
from gantryctl.machine.rules.lines import RULES
from gantryctl.machine.specs import FieldSpec, field_specs, table_models

_HEAD = f"""\
# Machine file

Written by `python -m gantryctl.machine.configuration_page docs/reference/configuration.md`; do not edit, a test
compares.

A machine file is TOML. `gantryctl config init` writes one to start from, `config check` checks it,
`config show` prints every value in force with its origin and what follows from it, `config diff A B`
compares two, `config schema` prints the JSON schema for editors.

- Every key has bounds, both included, and its unit in its name. Angles are at the gantry unless the
  name or the meaning says motor. A whole number may stand for a number with a point, not the other way
  round; `"5"`, `true`, `nan` and `inf` are no numbers.
- An unknown key or table is an error. The required keys have no default; every other key that is left
  out has the value of the reference machine.
- All problems are reported at once, one line each: `FILE: [table] key = value: what is allowed; hint`.
- A file has at most {MAX_BYTES // 1024} KB, {MAX_LINE} characters a line and {MAX_DEPTH} levels; it is
  UTF-8 without a byte-order mark.
- `[plant]` describes the simulated world. The simulator and the static checks below read it, the
  controller does not.

*From* says where a default comes from: printed in the source paper, a maker's catalogue, a standard,
derived from other values, an estimate, calibrated against the paper's table 2, or a choice of this
product.
"""

_RULES_HEAD = """\
## Rules between keys

What two values that are right alone may not say together. A message names every key of its rule. These
rules are static: a rigid body and the name plates; `gantryctl stops` checks what needs the whole plant.
"""


def reference_page() -> str:
    """The page as Markdown."""
    parts = [_HEAD]
    for path, model in table_models().items():
        specs = [spec for spec in field_specs().values() if spec.table == path]
        if not specs:
            continue
        meaning = (model.__doc__ or "").strip().partition(": ")[2]
        parts.append(f"## `[{path}]`\n\n{meaning[:1].upper()}{meaning[1:]}\n")
        rows = ["| key | default | allowed | from | meaning |", "|---|---|---|---|---|"]
        rows += [_row(spec) for spec in specs]
        parts.append("\n".join(rows) + "\n")
    parts.append(_RULES_HEAD)
    parts.append("\n".join(_rules()) + "\n")
    return "\n".join(parts)


def _row(spec: FieldSpec) -> str:
    default = "**required**" if spec.default is None else f"`{show_value(spec.default, None)}`"
    return f"| `{spec.key}` | {default} | {spec.allowed} | {spec.source} | {spec.meaning} |"


def _rules() -> list[str]:
    rows = ["| rule | keys |", "|---|---|"]
    for rule in RULES:
        rows.append(f"| {rule.sentence} | {', '.join(f'`{path}`' for path in rule.paths)} |")
    return rows


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
