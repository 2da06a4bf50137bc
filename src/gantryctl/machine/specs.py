"""The schema as a flat list: one `FieldSpec` per key of the machine file, read from the models."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import Any, Final, Literal, TypeAlias, get_args, get_origin

from pydantic.fields import FieldInfo

from gantryctl.machine.reading import printable
from gantryctl.machine.tables.fields import BESIDE, SOURCE, Table, unit_of
from gantryctl.machine.tables.model import Machine
from gantryctl.units import behind

Kind: TypeAlias = Literal["number", "integer", "switch", "word", "text", "numbers", "texts", "pairs"]
Value: TypeAlias = "float | int | bool | str | tuple[float, ...] | tuple[str, ...]"


@dataclasses.dataclass(frozen=True, slots=True)
class FieldSpec:
    """One key: where it stands, what it accepts, what it means.

    `low` and `high` are in `unit`, both included; for "numbers" they hold for each element and `lengths` for
    the array; for "text" `lengths` counts characters, for "texts" the elements. `usual` is the default, or the
    reference machine's. `beside` is the sum that a default is computed by, from another key of the table.
    """

    table: str
    key: str
    kind: Kind
    unit: str
    meaning: str
    required: bool
    default: Value | None
    usual: Value | None
    source: str
    low: float = 0.0
    high: float = 0.0
    lengths: tuple[int, int] = (0, 0)
    words: tuple[str, ...] = ()
    pattern: bool = False
    beside: str = ""

    @property
    def path(self) -> str:
        """Dotted path, "plant.load.mass_kg"."""
        return f"{self.table}.{self.key}"

    @property
    def place(self) -> str:
        """Where it stands in the file, "[plant.load] mass_kg"."""
        return f"[{self.table}] {self.key}"

    @property
    def allowed(self) -> str:
        """What the key accepts, with its unit."""
        match self.kind:
            case "number" | "integer":
                return f"{self.low:.10g}..{self.high:.10g}{self.unit_text}"
            case "numbers":
                least, most = self.lengths
                count = f"{most}" if least == most else f"{least} to {most}"
                return f"{count} numbers, each {self.low:.10g}..{self.high:.10g}{self.unit_text}"
            case "pairs":
                each = f"{self.low:.10g}..{self.high:.10g}{self.unit_text}"
                return f"at most {self.lengths[1]} pairs [from, to], each number {each}"
            case "texts":
                return f"{self.lengths[0]} to {self.lengths[1]} words in quotes"
            case "switch":
                return "true, false"
            case "word":
                return ", ".join(f'"{word}"' for word in self.words)
            case "text":
                letters = "; letters, digits, '_', '-', '.'" if self.pattern else ""
                return f"{self.lengths[0]} to {self.lengths[1]} characters{letters}"

    @property
    def unit_text(self) -> str:
        """The unit as a suffix, empty for a pure number."""
        return behind(self.unit)


@functools.cache
def field_specs(root: type[Table] = Machine) -> dict[str, FieldSpec]:
    """Every key of a file by dotted path, in the order of the schema; the machine file unless another is named."""
    found: dict[str, FieldSpec] = {}
    for table_path, model in table_models(root).items():
        for key, info in model.model_fields.items():
            if _sub_table(info) is None:
                spec = _spec(table_path, key, info)
                found[spec.path] = spec
    return found


@functools.cache
def table_models(root: type[Table] = Machine) -> dict[str, type[Table]]:
    """The model of every table of a file by dotted path, in the order of the schema."""
    found: dict[str, type[Table]] = {}

    def visit(path: str, model: type[Table]) -> None:
        if path:
            found[path] = model
        for key, info in model.model_fields.items():
            sub = _sub_table(info)
            if sub is not None:
                visit(f"{path}.{key}" if path else key, sub)

    visit("", root)
    return found


def unknown_guesses(guesses: Sequence[str], specs: Mapping[str, FieldSpec]) -> str:
    """The rows of a list of guesses that are no keys of the file, for a message; "" where all are."""
    return ", ".join(printable(row) for row in guesses if row not in specs)


def value_at(machine: Machine, path: str) -> Value:
    """The effective value of the key at a dotted path."""
    value: Value = attrgetter(path)(machine)
    return value


def _sub_table(info: FieldInfo) -> type[Table] | None:
    kind = info.annotation
    return kind if isinstance(kind, type) and issubclass(kind, Table) else None


def _spec(table_path: str, key: str, info: FieldInfo) -> FieldSpec:
    annotation: Any = info.annotation
    metadata = list(info.metadata)
    kind: Kind
    words: tuple[str, ...] = ()
    if get_origin(annotation) is Literal:
        kind, words = "word", get_args(annotation)
    elif get_origin(annotation) is tuple and get_args(annotation)[0] is str:
        kind = "texts"
    elif get_origin(annotation) is tuple and get_origin(get_args(annotation)[0]) is tuple:
        kind = "pairs"
        metadata += get_args(get_args(annotation)[0])[0].__metadata__
    elif get_origin(annotation) is tuple:
        kind = "numbers"
        metadata += get_args(annotation)[0].__metadata__
    else:
        kinds: dict[type, Kind] = {float: "number", int: "integer", bool: "switch", str: "text"}
        kind = kinds[annotation]
    bounds = _bounds(metadata)
    extra = info.json_schema_extra
    notes = extra if isinstance(extra, dict) else {}
    given = next(iter(info.examples or ()), None)
    default = None if info.is_required() or BESIDE in notes else info.get_default()
    return FieldSpec(
        table=table_path,
        key=key,
        kind=kind,
        unit=unit_of(key, info),
        meaning=info.description or "",
        required=info.is_required(),
        default=default,
        usual=given if default is None else default,
        source=str(notes.get(SOURCE, "")),
        low=bounds.get("low", 0.0),
        high=bounds.get("high", 0.0),
        lengths=(int(bounds.get("least", 0)), int(bounds.get("most", 0))),
        words=words,
        pattern=any(getattr(item, "pattern", None) is not None for item in metadata),
        beside=str(notes.get(BESIDE, "")),
    )


# What `annotated_types` calls a bound, and what it is here.
_BOUNDS: Final = {"ge": "low", "le": "high", "min_length": "least", "max_length": "most"}


def _bounds(metadata: list[Any]) -> dict[str, float]:
    """Both bounds and both lengths out of pydantic's constraint list (a nested `Field` holds its own)."""
    found: dict[str, float] = {}
    for item in metadata:
        if isinstance(item, FieldInfo):
            found |= _bounds(item.metadata)
        found |= {name: getattr(item, key) for key, name in _BOUNDS.items() if hasattr(item, key)}
    return found
