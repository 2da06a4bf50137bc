"""How a field of the machine file is declared: bounds, unit, meaning and where its default comes from."""

from __future__ import annotations

from typing import Any, Final, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field

Source: TypeAlias = Literal["paper", "catalogue", "standard", "derived", "estimate", "calibrated", "choice"]
"""Where a default comes from; "choice" is a decision of this product, `plant.md` explains the others."""

UNIT: Final = "unit"
SOURCE: Final = "source"


class Table(BaseModel):
    """One table of the machine file: immutable, without unknown keys, without NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


def number(default: float, low: float, high: float, unit: str, source: Source, meaning: str) -> Any:
    """Declare a number with a default, both bounds included; `unit` is "-" for a pure number."""
    return Field(
        default=default,
        ge=low,
        le=high,
        description=meaning,
        json_schema_extra={UNIT: unit, SOURCE: source},
    )


def required_number(usual: float, low: float, high: float, unit: str, meaning: str) -> Any:
    """Declare a number that every machine file must give; `usual` is the reference machine's value."""
    return Field(ge=low, le=high, description=meaning, examples=[usual], json_schema_extra={UNIT: unit})


def choice(default: str, source: Source, meaning: str) -> Any:
    """Declare one word out of the annotation's `Literal`."""
    return Field(default=default, description=meaning, json_schema_extra={UNIT: "-", SOURCE: source})


def switch(default: bool, source: Source, meaning: str) -> Any:
    """Declare a true/false field."""
    return Field(default=default, description=meaning, json_schema_extra={UNIT: "-", SOURCE: source})


def text(default: str, longest: int, source: Source, meaning: str) -> Any:
    """Declare a free text of at most `longest` characters."""
    return Field(
        default=default,
        max_length=longest,
        description=meaning,
        json_schema_extra={UNIT: "-", SOURCE: source},
    )


def table(meaning: str, default: type[Table] | None = None) -> Any:
    """Declare a sub-table; without `default` the machine file must contain it."""
    if default is None:
        return Field(description=meaning)
    return Field(default_factory=default, description=meaning)
