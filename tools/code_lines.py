"""Lines of code and of comment in the Python sources: `python tools/code_lines.py [FOLDER ...]`.

A line of code holds a token that is neither comment nor docstring; a line of comment holds a comment
and nothing else. Blank lines and docstrings count as neither.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from pathlib import Path
from typing import NamedTuple

_EMPTY = {
    tokenize.NEWLINE,
    tokenize.NL,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
    tokenize.ENCODING,
}
# Tools talk to themselves in comments; those give no reason and are not counted.
_FOR_TOOLS = ("# type:", "# noqa", "# fmt:", "# pragma:")


class Lines(NamedTuple):
    """Counted lines of one file or folder."""

    code: int
    comment: int


def _docstring_lines(source: str) -> set[int]:
    found: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if ast.get_docstring(node, clean=False) is not None:
                found.update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return found


def lines_of(source: str) -> Lines:
    """Count one source text. Raises SyntaxError for one that is not Python."""
    documented = _docstring_lines(source)
    code: set[int] = set()
    comment: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            if not token.string.startswith(_FOR_TOOLS):
                comment.add(token.start[0])
        elif token.type not in _EMPTY:
            code.update(range(token.start[0], token.end[0] + 1))
    return Lines(len(code - documented), len(comment - code))


def main(folders: list[str]) -> None:
    """Print one row per package and the sum."""
    for folder in folders or ["src/gantryctl"]:
        root = Path(folder)
        rows: dict[str, Lines] = {}
        for path in sorted(root.rglob("*.py")):
            counted = lines_of(path.read_text(encoding="utf-8"))
            package = path.relative_to(root).parts[0]
            before = rows.get(package, Lines(0, 0))
            rows[package] = Lines(before.code + counted.code, before.comment + counted.comment)
        total = Lines(sum(row.code for row in rows.values()), sum(row.comment for row in rows.values()))
        for package, row in [*rows.items(), (folder, total)]:
            percent = 100.0 * row.comment / max(row.code, 1)
            print(f"{package:24s} {row.code:6d} code {row.comment:5d} comment  {percent:4.1f} %")


if __name__ == "__main__":
    main(sys.argv[1:])
