"""Mutants of a C++ source of the core: the same kinds as of Python (operators.py), made on its tree.

A change replaces a whole expression or statement, so that it can stand beside the sound one behind a switch. What the
core writes as functions counts as what it means: both, either, negate, select; clamp is a limit with two sides.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from mutation.areas import is_severe
from mutation.cpp_tree import Node, read
from mutation.mutant import Change

SWITCH: Final = "::gantry_mutation::"

_OTHERS: Final[dict[str, tuple[tuple[str, str], ...]]] = {
    "<": (("compare", "<="), ("turned", ">")),
    "<=": (("compare", "<"), ("turned", ">=")),
    ">": (("compare", ">="), ("turned", "<")),
    ">=": (("compare", ">"), ("turned", "<=")),
    "==": (("compare", "!="),),
    "!=": (("compare", "=="),),
    "&&": (("and_or", "||"),),
    "||": (("and_or", "&&"),),
    "+": (("arithmetic", "-"),),
    "-": (("arithmetic", "+"),),
    "*": (("arithmetic", "/"),),
    "/": (("arithmetic", "*"),),
    "%": (("arithmetic", "+"),),
    "<<": (("arithmetic", ">>"),),
    ">>": (("arithmetic", "<<"),),
    "&": (("arithmetic", "|"),),
    "|": (("arithmetic", "&"),),
    "^": (("arithmetic", "&"),),
}
_SUM_ASSIGN: Final = {"+=": "-=", "-=": "+=", "*=": "/=", "/=": "*="}


Written = Callable[[Node], str]


class _Found(NamedTuple):
    operator: str
    node: Node
    new: str


def cpp_mutants(file: str, source: bytes) -> list[Change]:
    """Every mutant of one source, in the order of its text.

    Args:
        file: path from the root of the repository.
    """
    text = source.decode("latin-1")  # a character is a byte: positions are both
    tree = read(text)
    numbers: Counter[tuple[str, str]] = Counter()
    severe = is_severe(file)
    found = []
    for top in tree.children:
        for mutant in _mutants(top, text):
            around = top.sign or "file"
            number = numbers[around, mutant.operator]
            numbers[around, mutant.operator] += 1
            line = text.count("\n", 0, mutant.node.start) + 1
            found.append(
                Change(
                    f"{file}:{around}:{mutant.operator}:{number}",
                    file,
                    mutant.node.start,
                    mutant.node.end,
                    mutant.new.encode("latin-1"),
                    line,
                    line,
                    around,
                    severe=severe,
                )
            )
    return found


def _mutants(top: Node, text: str) -> Iterator[_Found]:
    def written(node: Node) -> str:
        return text[node.start : node.end]

    def visit(node: Node) -> Iterator[_Found]:
        yield from _of_node(node, written)
        children = node.children
        if node.kind == "index":  # a number there is a place in memory
            children = [child for child in children if child.kind != "number"]
        for child in children:
            yield from visit(child)

    yield from visit(top)


def _of_node(node: Node, written: Written) -> Iterator[_Found]:
    if node.kind == "binary":
        yield from _of_binary(node, written)
    elif node.kind == "unary" and node.sign in {"-", "!"}:
        yield _Found("minus" if node.sign == "-" else "not", node, f"({written(node.children[0])})")
    elif node.kind == "number":
        yield _Found("constant", node, _other_number(node.sign))
    elif node.kind == "name" and node.sign in {"true", "false"}:
        yield _Found("constant", node, "false" if node.sign == "true" else "true")
    elif node.kind == "call":
        yield from _of_call(node, written)
    elif node.kind == "expression":
        yield from _of_statement(node, written)
    elif node.kind == "jump":
        yield _Found("removed", node, ";")
    condition = node.condition
    # Of !x and a == b another operator makes the contrary.
    if condition is not None and condition.sign not in {"!", "==", "!="}:
        yield _Found("negated", condition, f"!({written(condition)})")


def _of_binary(node: Node, written: Written) -> Iterator[_Found]:
    left, right = node.children
    for operator, sign in _OTHERS[node.sign]:
        yield _Found(operator, node, f"({written(left)} {sign} {written(right)})")
    if node.sign in {"&&", "||"}:
        for operand in (left, right):
            yield _Found("condition", operand, "true" if node.sign == "&&" else "false")


def _of_call(node: Node, written: Written) -> Iterator[_Found]:
    name, given = node.sign, node.children[1:]
    words = [written(each) for each in given]
    called = written(node.children[0])

    def other(new: str) -> str:
        return f"{called[: len(called) - len(name)]}{new}({', '.join(words)})"

    if name in {"min", "max"} and len(given) == 2:
        yield _Found("min_max", node, other("max" if name == "min" else "min"))
    elif name in {"both", "either"} and len(given) == 2:
        yield _Found("and_or", node, other("either" if name == "both" else "both"))
        for word in words:
            yield _Found("condition", node, f"({word})")
    elif name == "negate" and len(given) == 1:
        yield _Found("not", node, f"({words[0]})")
    elif name == "select" and len(given) == 3:
        yield _Found("negated", node, f"{called}({words[0]}, {words[2]}, {words[1]})")
        yield _Found("condition", node, f"({words[1]})")
        yield _Found("condition", node, f"({words[2]})")
    elif name == "clamp" and len(given) == 3:
        yield _Found("one_side", node, f"{called}({words[0]}, {SWITCH}lowest({words[1]}), {words[2]})")
        yield _Found("one_side", node, f"{called}({words[0]}, {words[1]}, {SWITCH}highest({words[2]}))")
    elif name in {"vabs", "fabs", "abs", "vround", "flush_subnormal"} and len(given) == 1:
        yield _Found("abs" if name.endswith("abs") else "round", node, f"({words[0]})")
    elif name == "sign" and len(given) == 1:
        yield _Found("sign", node, f"(-{written(node)})")


def _of_statement(node: Node, written: Written) -> Iterator[_Found]:
    value = node.children[0]
    yield _Found("removed", node, ";")
    if value.kind == "assign" and value.sign in _SUM_ASSIGN:
        left, right = value.children
        yield _Found("arithmetic", node, f"{written(left)} {_SUM_ASSIGN[value.sign]} {written(right)};")


def _other_number(text: str) -> str:
    """x 1.5 of a number with a point, 1 more of a whole one; 1.0 instead of 0.0."""
    if re.fullmatch(r"\d+[uUlL]*|0[xX][0-9a-fA-F]+[uUlL]*", text):
        return f"({text} + 1)"
    value = float.fromhex(text) if text[:2] in {"0x", "0X"} else float(text.rstrip("fF"))
    return f"({text} * 1.5)" if value else "1.0"
