"""Problems of a machine file as lines, `FILE: [table] key = value: allowed 0.1..20 deg; hint`."""

from __future__ import annotations

import difflib
import json
import math
import sys
from collections.abc import Collection, Mapping, Sequence
from types import UnionType
from typing import Any, Final, TypeAlias

from gantryctl.machine.reading import Data, printable
from gantryctl.machine.rules import axis, can, compensation, monitors, nodes, parts, plant, reaction
from gantryctl.machine.rules.book import ADVISED, REGISTERED, Limit, Rule, violations
from gantryctl.machine.specs import FieldSpec, field_specs, table_models, value_at
from gantryctl.machine.tables.fields import Table
from gantryctl.machine.tables.model import Machine

Location: TypeAlias = tuple[int | str, ...]

# A file that is wrong from end to end needs another kind of help than ten thousand lines.
MAX_LINES: Final = 500
# Looking for similar names is slow; a file with more unknown keys needs another kind of help.
_MAX_HINTS: Final = 50
_MUST_BE: Final[dict[str, tuple[type | UnionType, str]]] = {
    "number": (int | float, "a number"),
    "integer": (int, "a whole number"),
    "switch": (bool, "true or false"),
    "word": (str, "one word in quotes"),
    "text": (str, "text in quotes"),
    "numbers": (list, "an array of numbers"),
    "texts": (list, "an array of words in quotes"),
    "pairs": (list, "an array of pairs of numbers"),
}
_ELEMENTS: Final = {"numbers": "number", "texts": "text"}
# Python's bool is an int: it must come first.
_TYPE_NAMES: Final = {
    bool: "a boolean", str: "text", int: "a whole number", float: "a number with a point",
    list: "an array", dict: "a table",
}  # fmt: skip
# Mistakes of unit that people make: minutes, turns, kilo, degrees and radians.
_FACTORS: Final = {
    60.0: "per minute instead of per second?",
    360.0: "degrees where turns belong, or the other way round?",
    1000.0: "milli-units, or a forgotten kilo?",
    180.0 / math.pi: "degrees instead of radians?",
    math.pi / 180.0: "radians instead of degrees?",
}


# Former places of keys and tables, of a machine file or a requirement sheet.
_MOVED: Final = {
    "accuracy.tolerance_deg": "[required] angle_deg",
    "axis.stopping_angle_max_deg": "[required] stopping_angle_deg",
    "motion.stopping_angle_max_deg": "[required] stopping_angle_deg",
    "accuracy": "[required]",
    **{
        f"axis.{name}_deg": f"{name}_min_deg and {name}_max_deg, a signed angle for each side,"
        for name in ("over_travel", "limit_switch", "mechanical_stop")
    },
}

# In the order of the reference page and of the messages, whatever order the chapters are imported in.
_CHAPTERS: Final = [
    module.__name__ for module in (axis, parts, monitors, reaction, can, nodes, plant, compensation)
]

RULES: Final[tuple[Rule, ...]] = tuple(
    sorted(REGISTERED, key=lambda rule: _CHAPTERS.index(rule.check.__module__))
)


ADVICE: Final[tuple[Rule, ...]] = tuple(ADVISED)


def show_value(value: object, longest: int | None = 60) -> str:
    """Write a value as it would stand in the file, in one line of at most `longest` characters (None: in full)."""
    most = longest or sys.maxsize
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return printable(json.dumps(value, ensure_ascii=False), most)
    if isinstance(value, float):
        return repr(value)
    if isinstance(value, int):
        return str(value) if abs(value) < 10**40 else "a whole number of more than 40 digits"
    if isinstance(value, list | tuple):
        first = value[:6] if longest else value
        shown = ", ".join(show_value(item, longest) for item in first)
        return printable(f"[{shown}{', ...' if len(value) > len(first) else ''}]", most)
    if isinstance(value, dict):
        return "a table"
    return printable(value, most)


def describe(
    errors: Sequence[Mapping[str, Any]], data: Data, name: str, root: type[Table] = Machine
) -> tuple[list[str], set[str]]:
    """Turn pydantic's errors into lines; give the dotted paths that cannot be used as well.

    Args:
        errors: what pydantic found. data: the file as it was read. name: of the file.
        root: model of the whole file.
    """
    name = printable(name, 300)
    lines: list[str] = []
    unusable: set[str] = set()
    hints = _MAX_HINTS
    for error in errors:
        where: Location = error["loc"]
        # A default beside a key that was refused: that key has its line.
        if error["type"] == "default_factory_not_called":
            unusable.add(_path(where))
            continue
        if error["type"] == "extra_forbidden":
            hint = _similar(where, data, root) if hints > 0 else ""
            hints -= 1
            line = _unknown(where, data, hint)
        else:
            unusable.add(_path(where))
            if error["type"] == "missing":
                line = _missing(where, root)
            elif error["type"] == "value_error":
                line = f"{_place(where, root)} = {show_value(_found(where, data))}: {error['ctx']['error']}"
            else:
                line = _wrong(where, data, root)
        line = f"{name}: {line}"
        if line not in lines[-20:]:
            lines.append(line)
    if len(lines) > MAX_LINES:
        lines[MAX_LINES:] = [f"{name}: and {len(lines) - MAX_LINES} problems more"]
    return lines, unusable


def _path(where: Location) -> str:
    """Dotted path of the key, without array positions."""
    return ".".join(str(part) for part in where if isinstance(part, str))


def _place(where: Location, root: type[Table]) -> str:
    """Name a location as it stands in the file: "[table] key" or "[table]"."""
    names = [printable(part) for part in where if isinstance(part, str)]
    if ".".join(names) in table_models(root):
        return f"[{'.'.join(names)}]"
    index = "".join(f"[{part}]" for part in where if isinstance(part, int))
    table = f"[{'.'.join(names[:-1])}] " if len(names) > 1 else ""
    return f"{table}{names[-1]}{index}" if names else "the file"


def _found(where: Location, data: Data) -> object:
    """Value of the file at a location; the deepest there is."""
    value: Any = data
    for part in where:
        try:
            value = value[part]
        except (KeyError, IndexError, TypeError):
            break
    return value


def _missing(where: Location, root: type[Table]) -> str:
    path = _path(where)
    spec = field_specs(root).get(path)
    if spec is not None:
        return f"{spec.place}: is missing; allowed {spec.allowed}"
    specs = field_specs(root).values()
    keys = [spec.key for spec in specs if spec.required and spec.path.startswith(path + ".")]
    return f"[{path}]: the table is missing; it must give {', '.join(keys)}"


def _unknown(where: Location, data: Data, hint: str) -> str:
    value = _found(where, data)
    if isinstance(value, dict) or (isinstance(value, list) and value and isinstance(value[0], dict)):
        return f"[{'.'.join(printable(part) for part in where)}]: unknown table{hint}"
    return f"{_place(where, Table)} = {show_value(value)}: unknown key{hint}"


def unknown_path(path: str) -> str:
    """Say that no key has this dotted path, and which one may be meant."""
    near = difflib.get_close_matches(path, field_specs(), 1)
    return f"{printable(path)}: no key has this path{f'; did you mean {near[0]}?' if near else ''}"


def _similar(where: Location, data: Data, root: type[Table]) -> str:
    """Hint "; did you mean ...?" for an unknown key or table, or ""."""
    table, key = ".".join(str(part) for part in where[:-1]), str(where[-1])
    moved = _MOVED.get(f"{table}.{key}" if table else key)
    if moved is not None:
        return f"; it is {moved} now"
    if isinstance(_found(where, data), dict):
        whole = f"{table}.{key}" if table else key
        by_name = [path for path in table_models(root) if path.split(".")[-1] == key]
        near = by_name[:1] or difflib.get_close_matches(whole, table_models(root), 1)
        return f"; did you mean [{near[0]}]?" if near else ""
    specs = field_specs(root).values()
    for candidates in (
        {spec.key: spec.key for spec in specs if spec.table == table},
        {spec.key: spec.place for spec in specs},
    ):
        near = difflib.get_close_matches(key, candidates, 1, 0.75)
        if near:
            return f"; did you mean {candidates[near[0]]}?"
    return ""


def _wrong(where: Location, data: Data, root: type[Table]) -> str:
    spec = field_specs(root).get(_path(where))
    value = _found(where, data)
    if spec is None:
        return f"{_place(where, root)} = {show_value(value)}: is {_type_name(value)}, must be a table"
    element = isinstance(where[-1], int)
    start = f"{_place(where, root)} = {show_value(value)}: "
    types, must_be = _MUST_BE[_ELEMENTS.get(spec.kind, spec.kind) if element else spec.kind]
    if not isinstance(value, types) or isinstance(value, bool) != (types is bool):
        return f"{start}is {_type_name(value)}, must be {must_be}; allowed {spec.allowed}"
    if isinstance(value, float) and not math.isfinite(value):
        return f"{start}is not a finite number; allowed {spec.allowed}"
    if isinstance(value, list):
        start += f"has {len(value)} {'words' if spec.kind == 'texts' else 'numbers'}; "
    return f"{start}allowed {spec.allowed}{_unit_hint(spec, value, data)}"


def _type_name(value: object) -> str:
    return next((name for kind, name in _TYPE_NAMES.items() if isinstance(value, kind)), "a date or time")


def _unit_hint(spec: FieldSpec, value: object, data: Data) -> str:
    """Name the unit mistake when the value is the usual one times a well-known factor."""
    if spec.words and isinstance(value, str):
        near = difflib.get_close_matches(value, spec.words, 1)
        return f'; did you mean "{near[0]}"?' if near else ""
    ratios = [_float(_found(("axis", key), data)) for key in ("reducer_ratio", "ring_ratio")]
    mistake = _unit_mistake(spec, value, (ratios[0] or 0.0) * (ratios[1] or 0.0))
    return f"; {mistake}" if mistake else ""


def _unit_mistake(spec: FieldSpec, value: object, ratio: float) -> str:
    """What makes a value the usual one times a well-known factor, or ""."""
    number, usual = _float(value), _float(spec.usual)
    if number is None or not usual:
        return ""
    factors = dict(_FACTORS)
    if ratio:
        factors[ratio] = "a value at the motor where one at the load belongs?"
    for factor, meaning in factors.items():
        if math.isclose(number, usual * factor, rel_tol=1e-3):
            return f"{factor:.4g} x the usual {usual:.6g}: {meaning}"
    return ""


def _float(value: object) -> float | None:
    """Finite number as a float, else None; a whole number may be too large for one."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def contradictions(machine: Machine, name: str, unusable: Collection[str] = ()) -> list[str]:
    """One line per broken rule: `FILE: [table] key = value: what must hold; against [table] key = value`.

    Rules about a key in `unusable` are left out: its value is a stand-in for one that was refused already.
    """
    keys = {path for rule in RULES for path in rule.paths}
    silent = {path for path in keys if any(f"{path}.".startswith(f"{bad}.") for bad in unusable)}
    usable = [rule for rule in RULES if silent.isdisjoint(rule.paths)]
    return [f"{name}: {_broken(machine, rule, wrong)}" for rule, wrong in violations(machine, usable)]


def warnings_of(machine: Machine) -> list[str]:
    """One line per advice that a machine does not follow, `[table] key = value: what it costs; against ...`."""
    return [_broken(machine, rule, wrong) for rule, wrong in violations(machine, ADVICE)]


def _broken(machine: Machine, rule: Rule, wrong: Limit | str) -> str:
    specs = [field_specs()[path] for path in rule.paths]
    first, *others = (
        f"{spec.place} = {show_value(value_at(machine, spec.path))}{spec.unit_text}" for spec in specs
    )
    demand = wrong.text(specs[0].unit_text) if isinstance(wrong, Limit) else wrong
    line = f"{first}: {demand}" + (f"; against {', '.join(others)}" if others else "")
    # Wide bounds, for axes of every size, let a wrong unit through to the rules.
    for spec in specs:
        mistake = _unit_mistake(spec, value_at(machine, spec.path), machine.axis.ratio)
        if mistake:
            line += f"; {spec.key} is {mistake}"
    return line
