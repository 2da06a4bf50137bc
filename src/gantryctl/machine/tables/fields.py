"""Declaration of a field of the machine file: bounds, unit, meaning and source of its default."""

from __future__ import annotations

from typing import Any, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

from gantryctl.units import name_ending

Source: TypeAlias = Literal["paper", "catalogue", "standard", "derived", "estimate", "calibrated", "choice"]
"""Where a default comes from; "choice", where none is named, is a decision of this product.

`plant.md` explains the others.
"""

UNIT: Final = "unit"
SOURCE: Final = "source"
BESIDE: Final = "beside"

# By the end of a key, as the reference page, the messages and the JSON schema write it.
UNITS: Final = {
    "deg": "deg", "deg_s": "deg/s", "deg_s2": "deg/s2", "deg_s3": "deg/s3", "rad": "rad", "rad_s": "rad/s",
    "r_min": "r/min", "nm": "N m", "nm_per_rad": "N m/rad", "nm_s_per_rad": "N m s/rad", "kg": "kg",
    "kg_m2": "kg m2", "m": "m", "mm": "mm", "um": "um", "s": "s", "ms": "ms", "us": "us", "days": "d", "hours": "h",
    "hz": "Hz", "c": "degC", "per_s": "1/s", "kw": "kW", "a": "A", "turns": "turns",
    "n_per_m": "N/m", "k": "K", "per_k": "1/K", "nm_per_rad2": "N m/rad2", "nm_per_rad3": "N m/rad3",
    "per_turn": "1/turn", "cycles_per_turn": "-",
}  # fmt: skip


def unit_of(key: str, info: FieldInfo) -> str:
    """Unit of a field: of its declaration, else of the end of its name; "-" for a pure number."""
    notes = info.json_schema_extra
    given = str(notes.get(UNIT, "")) if isinstance(notes, dict) else ""
    return given or UNITS.get(name_ending(f"_{key}", UNITS), "-")


def _add_units(schema: dict[str, Any], model: type[BaseModel]) -> None:
    for key, info in model.model_fields.items():
        if not (isinstance(info.annotation, type) and issubclass(info.annotation, Table)):
            schema["properties"][key][UNIT] = unit_of(key, info)


class Table(BaseModel):
    """Table of the machine file: immutable, without unknown keys, without NaN or infinity."""

    model_config = ConfigDict(
        frozen=True,
        defer_build=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        json_schema_extra=_add_units,
        model_title_generator=lambda model: model.__name__.removesuffix("Table"),
    )


def _field(meaning: str, notes: dict[str, Any], **limits: Any) -> Any:
    return Field(description=meaning, json_schema_extra=notes, **limits)


def number(
    default: float, low: float, high: float, meaning: str, source: Source = "choice", unit: str = ""
) -> Any:
    """Declare a number with a default, both bounds included; `unit` only where the key does not end with it."""
    return _field(meaning, {UNIT: unit, SOURCE: source}, default=default, ge=low, le=high)


def numbers(
    default: tuple[float, ...], least: int, most: int, meaning: str, source: Source = "choice"
) -> Any:
    """Declare an array of `least` to `most` numbers, whose bounds stand in the annotation."""
    return _field(meaning, {SOURCE: source}, default=default, min_length=least, max_length=most)


def required_number(usual: float, low: float, high: float, meaning: str, unit: str = "") -> Any:
    """Declare a number that every machine file must give; `usual` is the reference machine's value."""
    return _field(meaning, {UNIT: unit}, ge=low, le=high, examples=[usual])


def beside(other: str, distance: float, usual: float, meaning: str) -> Any:
    """Declare a number that stands `distance` beside that of the key `other`, declared before, unless it is given.

    Within the bounds of travel and 100 more; `usual` is the reference machine's value.
    """

    def default(given: dict[str, Any]) -> float:
        return float(given[other]) + distance

    sign = "-" if distance < 0.0 else "+"
    notes = {UNIT: "", SOURCE: "choice", BESIDE: f"{other} {sign} {abs(distance):g}"}
    return _field(meaning, notes, default_factory=default, ge=-3700.0, le=3700.0, examples=[usual])


def choice(default: str, meaning: str, source: Source = "choice") -> Any:
    """Declare one word out of the annotation's `Literal`."""
    return _field(meaning, {SOURCE: source}, default=default)


def switch(default: bool, meaning: str, source: Source = "choice") -> Any:
    """Declare a true/false field."""
    return _field(meaning, {SOURCE: source}, default=default)


def text(default: str, longest: int, meaning: str, source: Source = "choice") -> Any:
    """Declare a free text of at most `longest` characters."""
    return _field(meaning, {SOURCE: source}, default=default, max_length=longest)


def pairs(most: int, meaning: str, source: Source = "choice") -> Any:
    """Declare an array of at most `most` pairs of numbers, whose bounds stand in the annotation; empty by default."""
    return _field(meaning, {SOURCE: source}, default=(), max_length=most)


def texts(least: int, most: int, meaning: str, source: Source = "choice") -> Any:
    """Declare an array of `least` to `most` texts, empty by default."""
    return _field(meaning, {SOURCE: source}, default=(), min_length=least, max_length=most)


def table(meaning: str, default: type[Table] | None = None) -> Any:
    """Declare a sub-table; without `default` the machine file must contain it."""
    if default is None:
        return Field(description=meaning)
    return Field(default_factory=default, description=meaning)
