"""Injection as data: when, where, which kind, its arguments, for how long; from a file too."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from gantryctl.engineering.faults.kinds.kind import Kind, Place, Value
from gantryctl.engineering.faults.seams import KINDS
from gantryctl.errors import UsageError

_STRICT: Final = ConfigDict(strict=True, frozen=True, extra="forbid", allow_inf_nan=False)
_MAX_BYTES: Final = 256 * 1024
_MAX_INJECTIONS: Final = 100


class When(BaseModel):
    """Moment of an injection; exactly one of these. Without any: as soon as the axis is in its phase.

    Attributes:
        after_s: time after the axis has come into its phase.
        angle_deg: true motor-side angle that the axis passes.
        state: name of a power phase that the axis enters, e.g. "QUICK_STOPPING".
        event: code of an alarm, e.g. "DRV-01".
    """

    model_config = _STRICT

    after_s: Annotated[float, Field(ge=0.0, le=3600.0)] | None = None
    angle_deg: Annotated[float, Field(ge=-400.0, le=400.0)] | None = None
    state: str | None = None
    event: str | None = None

    @model_validator(mode="after")
    def _one(self) -> When:
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"when: one of after_s, angle_deg, state, event, got {' and '.join(given)}")
        return self

    @property
    def by_clock(self) -> bool:
        """It comes at its time, whatever the axis does."""
        return self.angle_deg is None and self.state is None and self.event is None


class Injection(BaseModel):
    """One fault: when it begins, where it acts, which kind it is, and for how long.

    Attributes:
        for_s: time after which a standing fault is over; None: it stays.
    """

    model_config = _STRICT

    where: Place
    kind: str
    args: dict[str, Value] = Field(default_factory=dict)
    when: When = When()
    for_s: Annotated[float, Field(gt=0.0, le=3600.0)] | None = None

    @field_validator("where", mode="before")
    @classmethod
    def _place(cls, value: object) -> object:
        # Strict mode takes no word for a member; a file has nothing else.
        if value not in list(Place):
            raise ValueError(f"must be one of {', '.join(Place)}, got {value!r}")
        return Place(str(value))

    @model_validator(mode="after")
    def _known(self) -> Injection:
        found = KINDS.get((self.where, self.kind))
        if found is None:
            there = ", ".join(name for place, name in KINDS if place is self.where)
            raise ValueError(f"there is no fault '{self.kind}' of the {self.where}; there are: {there}")
        for name in self.args:
            if name not in found.arguments:
                takes = ", ".join(found.arguments) or "none"
                raise ValueError(f"{self.where} {self.kind} has no argument '{name}'; it takes: {takes}")
        for name, argument in found.arguments.items():
            if name not in self.args and argument.default is None:
                raise ValueError(f"{self.where} {self.kind} needs the argument '{name}'")
            if name in self.args and (wrong := argument.fault_of(self.args[name])) is not None:
                raise ValueError(f"{self.where} {self.kind}: {name} {wrong}")
        return self

    @property
    def row(self) -> Kind:
        """Its kind."""
        return KINDS[self.where, self.kind]

    @property
    def values(self) -> dict[str, Any]:
        """Arguments, defaults included."""
        return {name: self.args.get(name, argument.default) for name, argument in self.row.arguments.items()}

    @property
    def text(self) -> str:
        """For people: "encoder gain value=0"."""
        args = " ".join(f"{name}={value:g}" if isinstance(value, float) else f"{name}={value}"
                        for name, value in self.args.items())  # fmt: skip
        return " ".join(part for part in (self.where, self.kind, args) if part)


def injection(
    where: str, kind: str, /, for_s: float | None = None, when: When | None = None, **args: Value
) -> Injection:
    """An injection in one line, for catalogue and tests.

    Raises:
        UsageError: no such kind, or arguments that it does not take.
    """
    return parse_injection(
        {"where": where, "kind": kind, "args": args, "for_s": for_s, "when": when or When()}
    )


def parse_injection(data: Mapping[str, Any], name: str = "injection") -> Injection:
    """An injection from a table of a file.

    Raises:
        UsageError: what is wrong, with the place.
    """
    try:
        return Injection.model_validate(dict(data))
    except ValidationError as wrong:
        first = wrong.errors(include_context=False)[0]
    except UnicodeEncodeError:  # half of a pair of JSON, "\\ud800", in a value that a message would repeat
        raise UsageError(f"{name}: has a text that UTF-8 cannot hold") from None
    # Not inside: the context of a raised error keeps its frames (machine/loading.py).
    place = ".".join(str(part) for part in (name, *first["loc"]))
    raise UsageError(f"{place}: {first['msg'].removeprefix('Value error, ')}")


def read_document(path: Path) -> Any:
    """What a TOML or JSON file holds, not looked at yet.

    Raises:
        UsageError: the file cannot be read, is too large, or is neither.
    """
    try:
        content = path.read_bytes()
    except OSError as fault:
        raise UsageError(f"{path}: cannot be read: {fault.strerror or fault}") from None
    if len(content) > _MAX_BYTES:
        raise UsageError(f"{path}: {len(content)} bytes, at most {_MAX_BYTES} permitted")
    try:
        text = content.decode("utf-8-sig")
        return json.loads(text) if path.suffix.lower() == ".json" else tomllib.loads(text)
    except (ValueError, RecursionError) as wrong:
        raise UsageError(f"{path}: {wrong}") from None


def load_injections(path: Path) -> tuple[Injection, ...]:
    """Injections of a TOML or JSON file: `[[injection]]` tables.

    Raises:
        UsageError: the file cannot be read, or something in it is wrong.
    """
    data = read_document(path)
    rows = data.get("injection") if isinstance(data, dict) else None
    unknown = sorted(set(data) - {"injection"}) if isinstance(data, dict) else []
    if unknown:
        raise UsageError(f"{path}: unknown key '{unknown[0]}'; a file has [[injection]] tables only")
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise UsageError(f"{path}: there is no [[injection]] table")
    if len(rows) > _MAX_INJECTIONS:
        raise UsageError(f"{path}: {len(rows)} injections, at most {_MAX_INJECTIONS} permitted")
    return tuple(parse_injection(row, f"{path}: injection[{number}]") for number, row in enumerate(rows))


def finite(value: float, name: str, low: float, high: float) -> float:
    """A number within its range.

    Raises:
        UsageError: it is not.
    """
    if not (math.isfinite(value) and low <= value <= high):
        raise UsageError(f"{name} must be from {low:g} to {high:g}, got {value:g}")
    return value
