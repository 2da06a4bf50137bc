"""Bugs that people have thought of: tests/planted/<area>.toml, one `[[bug]]` each."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from mutation.mutant import Change

FOLDER: Final = "tests/planted"
_REQUIRED: Final = {"name", "file", "old", "new", "harm", "severe"}
_KNOWN: Final = _REQUIRED | {"tests"}


class StaleBug(ValueError):
    """The old text of a planted bug does not stand in its file exactly once."""


def read_bugs(path: Path) -> list[dict[str, Any]]:
    """The rows of one file.

    Raises:
        SystemExit: a row has a key too few or too many, or two have one name.
    """
    bugs: list[dict[str, Any]] = tomllib.loads(path.read_text(encoding="utf-8")).get("bug", [])
    names: set[str] = set()
    for bug in bugs:
        wrong = (_REQUIRED - set(bug)) | (set(bug) - _KNOWN)
        if wrong or bug["name"] in names:
            raise SystemExit(
                f"{path}: bug {bug.get('name')}: {', '.join(sorted(wrong)) or 'the name is taken'}"
            )
        names.add(bug["name"])
    return bugs


def change_of(bug: dict[str, Any], area: str, root: Path) -> Change:
    """A planted bug as a change of the sources as they are.

    Raises:
        StaleBug: the text does not fit.
    """
    source = (root / bug["file"]).read_bytes()
    old, new = bug["old"].encode(), bug["new"].encode()
    if source.count(old) != 1:
        raise StaleBug(
            f"{bug['name']}: `{bug['old']}` stands {source.count(old)} times in {bug['file']}, not once"
        )
    start = source.index(old)
    line = source[:start].count(b"\n") + 1
    end_line = line + old.rstrip().count(b"\n")
    return Change(
        f"planted/{area}/{bug['name']}",
        bug["file"],
        start,
        start + len(old),
        new,
        line,
        end_line,
        *(_place(source, line, end_line) if bug["file"].endswith(".py") else ("", ())),
        severe=bug["severe"],
        tests=tuple(bug.get("tests", ())),
    )


def _place(source: bytes, line: int, end_line: int) -> tuple[str, tuple[str, ...]]:
    """The outermost function around these lines, or what the statement there defines."""
    for name, node in _outermost(_tree(source), ""):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[0].lineno
            if body <= line and end_line <= (node.end_lineno or 0):
                return name, ()
            if node.lineno <= line < body:
                return "", (node.name,)
        elif node.lineno <= line <= (node.end_lineno or 0):
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            return "", tuple(target.id for target in targets if isinstance(target, ast.Name))
    return "", ()


@lru_cache(maxsize=4)  # bugs of one file stand together
def _tree(source: bytes) -> ast.Module:
    return ast.parse(source)


def _outermost(node: ast.Module | ast.ClassDef, name: str) -> Iterator[tuple[str, ast.stmt]]:
    for child in node.body:
        if isinstance(child, ast.ClassDef):
            yield from _outermost(child, f"{name}{child.name}.")
        else:
            yield f"{name}{getattr(child, 'name', '')}", child
