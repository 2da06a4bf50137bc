"""The reference page of the machine file: `python -m gantryctl.machine.configuration_page FILE` writes it.

Its prose is `configuration_page.md` beside this file, with places for tables and bounds.
"""

from __future__ import annotations

import sys
from pathlib import Path
from string import Template

from gantryctl.machine.problems import ADVICE, RULES, show_value
from gantryctl.machine.reading import MAX_BYTES, MAX_DEPTH, MAX_LINE
from gantryctl.machine.specs import FieldSpec, field_specs, table_models


def reference_page() -> str:
    """The page as Markdown."""
    parts = []
    for path, model in table_models().items():
        rows = [_row(spec) for spec in field_specs().values() if spec.table == path]
        if rows:
            meaning = (model.__doc__ or "").strip().partition(": ")[2]
            parts += [f"## `[{path}]`\n", f"{meaning[:1].upper()}{meaning[1:]}\n"]
            parts += ["| key | default | allowed | from | meaning |\n|---|---|---|---|---|", *rows, ""]
    keys = {rule: ", ".join(f"`{path}`" for path in rule.paths) for rule in (*RULES, *ADVICE)}
    rules = "\n".join(
        f"| {'Warned of: ' if rule in ADVICE else ''}{rule.sentence} | {named} |"
        for rule, named in keys.items()
    )
    prose = Template(Path(__file__).with_suffix(".md").read_text(encoding="utf-8"))
    bounds = {"file_kb": MAX_BYTES // 1024, "line": MAX_LINE, "depth": MAX_DEPTH}
    return prose.substitute(bounds, tables="\n".join(parts), rules=rules)


def _row(spec: FieldSpec) -> str:
    if spec.beside:
        default = f"`{spec.beside}`"
    else:
        default = "**required**" if spec.default is None else f"`{show_value(spec.default, None)}`"
    return f"| `{spec.key}` | {default} | {spec.allowed} | {spec.source} | {spec.meaning} |"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
