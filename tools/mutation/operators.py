"""Mutants of a Python source: made on its syntax tree, written into its text, so that all else stays as it is."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator
from typing import Final, NamedTuple

from mutation.areas import is_severe
from mutation.mutant import Change

_COMPARED: Final[dict[type[ast.cmpop], tuple[str, tuple[str, ...]]]] = {
    ast.Lt: ("<", ("<=", ">")),
    ast.LtE: ("<=", ("<", ">=")),
    ast.Gt: (">", (">=", "<")),
    ast.GtE: (">=", (">", "<=")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
}
_ARITHMETIC: Final[dict[type[ast.operator], tuple[str, str]]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "+"),
    ast.Pow: ("**", "*"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.BitXor: ("^", "&"),
}
_NO_BEHAVIOUR: Final = {"__all__", "__slots__", "__match_args__"}
_TEXT_FUNCTIONS: Final = {"__repr__", "__str__", "__format__"}
_STATEMENTS: Final = (ast.Expr, ast.Raise, ast.Continue, ast.Break, ast.AugAssign)


class _Found(NamedTuple):
    operator: str
    start: int
    end: int
    new: str
    node: ast.expr | ast.stmt


class _Around(NamedTuple):
    """Where a node stands: the innermost function by name, the outermost, and what its statement defines."""

    inner: str
    outer: str
    names: tuple[str, ...]


class _Writer:
    """Positions in bytes of one source."""

    def __init__(self, source: bytes) -> None:
        self.source = source
        self._lines = [0]
        for line in source.splitlines(keepends=True):
            self._lines.append(self._lines[-1] + len(line))

    def start(self, node: ast.expr | ast.stmt) -> int:
        return self._lines[node.lineno - 1] + node.col_offset

    def end(self, node: ast.expr | ast.stmt) -> int:
        return self._lines[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)

    def text(self, node: ast.expr | ast.stmt) -> str:
        return self.source[self.start(node) : self.end(node)].decode()

    def between(self, left: ast.expr, right: ast.expr, sign: str) -> tuple[int, int] | None:
        """Where a sign stands between two operands."""
        begin = self.end(left)
        gap = re.sub(rb"#[^\n]*", lambda found: b" " * len(found[0]), self.source[begin : self.start(right)])
        pattern = rb"\s+".join(re.escape(word.encode()) for word in sign.split())
        found = re.search(pattern, gap)
        return (begin + found.start(), begin + found.end()) if found else None


def mutants(file: str, source: bytes) -> list[Change]:
    """Every mutant of one source, in the order of its text.

    Args:
        file: path from the root of the repository.
    """
    writer = _Writer(source)
    numbers: Counter[tuple[str, str]] = Counter()
    severe = is_severe(file)
    found = []
    for around, mutant in _walk(ast.parse(source), _Around("", "", ()), writer):
        number = numbers[around.inner, mutant.operator]
        numbers[around.inner, mutant.operator] += 1
        below = file.removeprefix("src/gantryctl/")
        name = f"{below}:{around.inner or ','.join(around.names) or 'module'}:{mutant.operator}:{number}"
        change = Change(
            name,
            file,
            mutant.start,
            mutant.end,
            mutant.new.encode(),
            mutant.node.lineno,
            mutant.node.end_lineno or mutant.node.lineno,
            around.outer,
            around.names,
            severe,
        )
        found.append(change)
    return found


def is_program(file: str, text: bytes) -> bool:
    """Whether a changed text is a program; what is not is no mutant. A check of 20 ms, so only before a trial."""
    if not file.endswith(".py"):
        return True
    try:
        compile(text, file, "exec")
    except SyntaxError:
        return False
    return True


def _walk(node: ast.AST, around: _Around, writer: _Writer) -> Iterator[tuple[_Around, _Found]]:
    for child in _children(node):
        if isinstance(child, ast.ClassDef):
            inner = _Around(f"{around.inner}.{child.name}".lstrip("."), around.outer, ())
        elif isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            if child.name in _TEXT_FUNCTIONS:
                continue
            name = f"{around.inner}.{child.name}".lstrip(".")
            inner = _Around(name, around.outer or name, ())
            # A default belongs to the module, but says something about the function alone.
            yield from _defaults(child, _Around(name, "", (child.name,)), writer)
        elif isinstance(child, ast.stmt) and not around.outer:
            inner = _Around(around.inner, "", _defined(child))
        else:
            inner = around
        if isinstance(child, ast.expr | ast.stmt):
            for found in _mutants_of(child, writer):
                yield inner, found
        yield from _walk(child, inner, writer)


def _defaults(
    function: ast.FunctionDef | ast.AsyncFunctionDef, around: _Around, writer: _Writer
) -> Iterator[tuple[_Around, _Found]]:
    for value in (*function.args.defaults, *function.args.kw_defaults):
        if value is not None:
            for found in _mutants_of(value, writer):
                yield around, found
            yield from _walk(value, around, writer)


def _defined(statement: ast.stmt) -> tuple[str, ...]:
    targets = statement.targets if isinstance(statement, ast.Assign) else [getattr(statement, "target", None)]
    return tuple(target.id for target in targets if isinstance(target, ast.Name))


def _children(node: ast.AST) -> Iterator[ast.AST]:
    """What may be changed below a node: no annotations, decorators, texts, names of exports, error texts."""
    if isinstance(node, ast.Raise | ast.JoinedStr | ast.arguments):
        return
    if isinstance(node, ast.Assign) and _NO_BEHAVIOUR & set(_defined(node)):
        return
    if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
        return
    for field, value in ast.iter_fields(node):
        if field in {
            "annotation",
            "returns",
            "decorator_list",
            "bases",
            "type_params",
            "args",
        } and isinstance(node, ast.AnnAssign | ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            continue
        if isinstance(value, list):
            yield from (each for each in value if isinstance(each, ast.AST))
        elif isinstance(value, ast.AST):
            yield value


def _mutants_of(node: ast.expr | ast.stmt, writer: _Writer) -> Iterator[_Found]:
    if isinstance(node, ast.Compare):
        yield from _of_compare(node, writer)
    elif isinstance(node, ast.BoolOp):
        yield from _of_bool(node, writer)
    elif isinstance(node, ast.BinOp):
        yield from _of_arithmetic(node, writer)
    elif isinstance(node, ast.UnaryOp):
        yield from _of_unary(node, writer)
    elif isinstance(node, ast.Constant):
        yield from _of_constant(node, writer)
    elif isinstance(node, ast.Call):
        yield from _of_call(node, writer)
    elif isinstance(node, ast.stmt):
        yield from _of_statement(node, writer)
    if isinstance(node, ast.If | ast.While | ast.IfExp) and _worth_negating(node.test):
        test = node.test
        yield _Found("negated", writer.start(test), writer.end(test), f"not ({writer.text(test)})", test)


def _worth_negating(test: ast.expr) -> bool:
    """Unless another operator does it (== is made !=, a `not` removed, True False), or only types hang on it."""
    if isinstance(test, ast.Compare) and len(test.ops) == 1:
        return isinstance(test.ops[0], ast.Lt | ast.LtE | ast.Gt | ast.GtE)
    return not isinstance(test, ast.UnaryOp | ast.Constant) and "TYPE_CHECKING" not in ast.dump(test)


def _of_compare(node: ast.Compare, writer: _Writer) -> Iterator[_Found]:
    left = node.left
    for operator, right in zip(node.ops, node.comparators, strict=True):
        sign, others = _COMPARED[type(operator)]
        place = writer.between(left, right, sign)
        if place:
            for name, other in zip(("compare", "turned"), others, strict=False):
                yield _Found(name, *place, other, node)
        left = right


def _of_bool(node: ast.BoolOp, writer: _Writer) -> Iterator[_Found]:
    sign, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
    for left, right in zip(node.values, node.values[1:], strict=False):
        place = writer.between(left, right, sign)
        if place:
            yield _Found("and_or", *place, other, node)
    for value in node.values:
        yield _Found("condition", writer.start(value), writer.end(value), str(sign == "and"), value)


def _of_arithmetic(node: ast.BinOp, writer: _Writer) -> Iterator[_Found]:
    if any(isinstance(side, ast.JoinedStr) or _is_text(side) for side in (node.left, node.right)):
        return
    sign, other = _ARITHMETIC.get(type(node.op), ("", ""))
    place = writer.between(node.left, node.right, sign) if sign else None
    if place:
        yield _Found("arithmetic", *place, other, node)


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)


def _of_unary(node: ast.UnaryOp, writer: _Writer) -> Iterator[_Found]:
    operand = f"({writer.text(node.operand)})"
    if isinstance(node.op, ast.Not):
        yield _Found("not", writer.start(node), writer.end(node), operand, node)
    elif isinstance(node.op, ast.USub):
        yield _Found("minus", writer.start(node), writer.end(node), operand, node)


def _of_constant(node: ast.Constant, writer: _Writer) -> Iterator[_Found]:
    value = node.value
    place = writer.start(node), writer.end(node)
    if isinstance(value, bool):
        yield _Found("constant", *place, str(not value), node)
    elif isinstance(value, int):
        yield _Found("constant", *place, str(value + 1), node)
    elif isinstance(value, float):
        yield _Found("constant", *place, repr(value * 1.5 or 1.0), node)


def _of_call(node: ast.Call, writer: _Writer) -> Iterator[_Found]:
    name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
    place = writer.start(node.func), writer.end(node.func)
    if name in {"min", "max"} and isinstance(node.func, ast.Name):
        yield _Found("min_max", *place, "max" if name == "min" else "min", node)
    elif name in {"abs", "fabs"} and len(node.args) == 1:
        yield _Found("abs", writer.start(node), writer.end(node), f"({writer.text(node.args[0])})", node)
    elif name == "copysign":
        yield _Found("copysign", writer.start(node), writer.end(node), f"({writer.text(node.args[0])})", node)
    elif name in {"radians", "degrees", "deg", "rad"} and len(node.args) == 1 and not node.keywords:
        yield _Found("unit", writer.start(node), writer.end(node), f"({writer.text(node.args[0])})", node)
    elif name in {"ceil", "floor"} and isinstance(node.func, ast.Attribute):
        other = writer.text(node.func).replace(name, "floor" if name == "ceil" else "ceil")
        yield _Found("round", *place, other, node)


def _of_statement(node: ast.stmt, writer: _Writer) -> Iterator[_Found]:
    place = writer.start(node), writer.end(node)
    removed = _Found("removed", *place, "pass", node)
    if isinstance(node, ast.Return):
        if node.value is None:
            yield removed
        elif not (isinstance(node.value, ast.Constant) and node.value.value is None):
            yield _Found("return", *place, "return None", node)
    elif isinstance(node, ast.Expr):
        if isinstance(node.value, ast.Call | ast.Await):
            yield removed
    elif isinstance(node, ast.Assign):
        if any(isinstance(target, ast.Attribute | ast.Subscript) for target in node.targets):
            yield removed
    elif isinstance(node, _STATEMENTS):
        yield removed
    if isinstance(node, ast.AugAssign):
        sign, other = _ARITHMETIC.get(type(node.op), ("", ""))
        gap = writer.between(node.target, node.value, f"{sign}=") if sign else None
        if gap:
            yield _Found("arithmetic", *gap, f"{other}=", node)
