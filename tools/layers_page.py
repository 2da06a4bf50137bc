"""Write the table of layers into `docs/architecture.md`: `python tools/layers_page.py`.

The rows come from the contract in `pyproject.toml`, the words from the first line of each package.
"""

from __future__ import annotations

import ast
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "architecture.md"
BEGIN = "<!-- layers: written by tools/layers_page.py from pyproject.toml -->\n"
END = "<!-- end of layers -->\n"


def first_line(module: str) -> str:
    """Return the first line of the docstring of a module of ours; empty for the compiled core."""
    place = ROOT / "src" / Path(*module.split("."))
    for path in (place / "__init__.py", place.with_suffix(".py")):
        if path.is_file():
            text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
            return text.partition("\n")[0]
    return "Compiled laws and plant (C++, nanobind)."


def contracts() -> list[dict[str, Any]]:
    """Return the contracts that the linter of imports enforces."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    found: list[dict[str, Any]] = settings["tool"]["importlinter"]["contracts"]
    return found


def table() -> Iterator[str]:
    """Yield the lines of the section: one row per layer, top first, then the further contracts."""
    layers, *further = contracts()
    yield "| row | package | holds |\n"
    yield "|---|---|---|\n"
    for number, row in enumerate(layers["layers"], 1):
        for name in row.replace("(", "").replace(")", "").split(" | "):
            yield f"| {number} | `{name}` | {first_line(f'gantryctl.{name}')} |\n"
    yield "\nFurther contracts, one line each:\n\n"
    for contract in further:
        yield f"- {contract['name']}.\n"


def with_table(page: str) -> str:
    """Return the page with the section between its two marks written anew."""
    head, _, rest = page.partition(BEGIN)
    _, _, tail = rest.partition(END)
    return "".join([head, BEGIN, *table(), END, tail])


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    sys.exit(0)
