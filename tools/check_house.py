"""Check what no linter knows about the shape of the sources.

- No circle of imports: an import inside a function or for type checkers only counts as any other.
- No class cut in two by inheritance: a concrete base class with one subclass, both in one wing.
- A folder holds at most 14 files.
- An assert narrows a type: `python -O` leaves it out, so it must not be what refuses something.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

MAX_FILES = 14
MAY_BE_CUT = {
    "AxisProgram",  # the user's program derives from it, and the shipped one does too
    "NamedPath",  # a type of option that is used itself, and by the one for recordings
}
ABSTRACT = {"ABC", "Protocol", "Enum", "IntEnum", "StrEnum", "IntFlag", "NamedTuple", "TypedDict"}


class Module(NamedTuple):
    """One source file.

    Attributes:
        names: what a name imported here is called in full.
        classes: the base classes of each class by its name, as they are written; None for an abstract class.
        asserted: what its asserts say.
    """

    names: dict[str, str]
    classes: dict[str, list[str] | None]
    asserted: list[str]


def read_modules(src: Path) -> dict[str, Module]:
    """Every module under `src` by its dotted name, packages by the name of their folder."""
    found = {}
    for path in sorted(src.rglob("*.py*")):  # with the stub of the compiled core
        if path.suffix not in {".py", ".pyi"}:
            continue
        parts = path.relative_to(src).with_suffix("").parts
        tree = ast.parse(path.read_text(encoding="utf-8"))
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = _module(tree)
    return found


def _module(tree: ast.Module) -> Module:
    module = Module({}, {}, [])
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            module.names.update({alias.asname or alias.name: alias.name for alias in node.names})
        elif isinstance(node, ast.ImportFrom):  # relative ones are forbidden by the style of this project
            module.names.update({a.asname or a.name: f"{node.module}.{a.name}" for a in node.names})
        elif isinstance(node, ast.ClassDef):
            bases = [ast.unparse(base).partition("[")[0] for base in node.bases]
            abstract = any(base.rpartition(".")[2] in ABSTRACT for base in bases) or any(
                "abstractmethod" in ast.unparse(decorator)
                for item in node.body
                if isinstance(item, ast.FunctionDef)
                for decorator in item.decorator_list
            )
            module.classes[node.name] = None if abstract else bases
        elif isinstance(node, ast.Assert):
            module.asserted.append(ast.unparse(node.test))
    return module


def circles(modules: Mapping[str, Module]) -> Iterator[str]:
    """Every group of modules that import each other, by whatever way round."""
    graph: dict[str, set[str]] = {}
    for name, module in modules.items():
        named = (full if full in modules else full.rpartition(".")[0] for full in module.names.values())
        graph[name] = {target for target in named if target in modules}
    reached = {name: _reached(name, graph) for name in graph}
    groups = {frozenset(other for other in reached[name] if name in reached[other]) for name in graph}
    for group in sorted(sorted(group) for group in groups if group):
        yield f"circle of imports: {', '.join(group)}"


def _reached(name: str, graph: Mapping[str, set[str]]) -> set[str]:
    found: set[str] = set()
    ahead = set(graph[name])
    while ahead:
        found |= ahead
        ahead = set().union(*(graph[each] for each in ahead)) - found
    return found


def cut_classes(modules: Mapping[str, Module]) -> Iterator[str]:
    """Concrete classes with one subclass in the same wing: a class whose other half stands elsewhere."""
    known = {
        f"{name}.{cls}": bases for name, module in modules.items() for cls, bases in module.classes.items()
    }
    subclasses: dict[str, list[str]] = defaultdict(list)
    for name, module in modules.items():
        for cls, bases in module.classes.items():
            for base in bases or ():
                subclasses[_full_name(base, name, modules)].append(f"{name}.{cls}")
    for base, found in sorted(subclasses.items()):
        one_wing = base.split(".")[:2] == found[0].split(".")[:2]
        if (
            known.get(base) is not None
            and len(found) == 1
            and one_wing
            and base.rpartition(".")[2] not in MAY_BE_CUT
        ):
            yield f"class cut by inheritance: {base} has one subclass, {found[0]}"


def _full_name(name: str, module: str, modules: Mapping[str, Module]) -> str:
    """Where a class is defined that a module calls by this name, through every package that hands it on."""
    while module in modules and name not in modules[module].classes:
        full = modules[module].names.get(name)
        if full is None:
            break
        module, _, name = full.rpartition(".")
    return f"{module}.{name}"


def full_folders(src: Path) -> Iterator[str]:
    """Folders with more files than a reader can hold in the head."""
    files = Counter(path.parent for path in src.rglob("*.py") if path.stem not in {"__init__", "__main__"})
    for folder, count in sorted(files.items()):
        if count > MAX_FILES:
            yield f"{folder.relative_to(src)}: {count} files, at most {MAX_FILES}"


def checking_asserts(modules: Mapping[str, Module]) -> Iterator[str]:
    """Asserts that do more than tell a type checker what the code before them made sure of."""
    for name, module in sorted(modules.items()):
        for asserted in module.asserted:
            if not re.fullmatch(r"[\w.]+ is not None|isinstance\([^()]*\)", asserted):
                yield f"{name}: assert {asserted}: python -O leaves it out; raise an error"


def main() -> int:
    """Print every finding; 1 when there is one."""
    src = Path(__file__).resolve().parent.parent / "src"
    modules = read_modules(src)
    findings = [*circles(modules), *cut_classes(modules), *full_folders(src), *checking_asserts(modules)]
    print(*findings, sep="\n", end="\n" if findings else "")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
