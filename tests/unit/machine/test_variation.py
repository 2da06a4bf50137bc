"""A variation is the machine that a file with these values gives, or is refused where the file is."""

from __future__ import annotations

import functools
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.errors import ConfigError
from gantryctl.machine import (
    Machine,
    default_machine,
    default_machine_path,
    effective_values,
    field_specs,
    load_machine,
    with_values,
)
from gantryctl.machine.variation import RefusedValue, Variation

NUMBERS = [path for path, spec in field_specs().items() if spec.kind in ("number", "integer", "numbers")]


@functools.cache
def improved() -> Machine:
    return load_machine(default_machine_path().with_name("hust_improved.toml"))


@st.composite
def changes(draw: st.DrawFn) -> dict[str, Any]:
    """A few keys near their values in the machine, some of them beyond a limit."""
    present = effective_values(improved())
    found: dict[str, Any] = {}
    for path in draw(st.lists(st.sampled_from(NUMBERS), min_size=1, max_size=6, unique=True)):
        factor = draw(st.sampled_from([1.0, 1.0, 0.999, 1.02, 0.8, 1e9, -1.0]))
        value: Any = present[path]
        match field_specs()[path].kind:
            case "numbers":
                found[path] = tuple(factor * item for item in value)
            case "integer":
                found[path] = int(value * factor)
            case _:
                found[path] = value * factor
    return found


@settings(max_examples=150)
@given(changes())
def test_a_variation_is_the_machine_of_a_file_with_these_values(values: dict[str, Any]) -> None:
    varied = Variation(improved(), list(values)).of(values)
    if isinstance(varied, RefusedValue):
        with pytest.raises(ConfigError) as refused:
            with_values(improved(), values)
        place = field_specs()[varied.path].place
        assert any(place in line for line in refused.value.problems), (varied, refused.value.problems)
        return
    slow = with_values(improved(), values)
    assert varied == slow
    assert effective_values(varied) == effective_values(slow)
    assert varied.model_fields_set == slow.model_fields_set
    assert varied.calibration is slow.calibration
    # NaN-free floats with equal repr have equal bits.
    assert repr(effective_values(varied)) == repr(effective_values(slow))


def test_limits_rules_and_checks_of_one_field_refuse_by_name() -> None:
    def refused(path: str, value: float) -> str:
        answer = Variation(default_machine(), [path]).of({path: value})
        assert isinstance(answer, RefusedValue)
        return str(answer)

    assert refused("plant.load.mass_kg", 0.05) == "plant.load.mass_kg: limits"
    assert refused("plant.load.mass_kg", float("nan")) == "plant.load.mass_kg: limits"
    assert refused("plant.load.eccentric_sign", 0.5) == "plant.load.eccentric_sign: limits"
    assert refused("plant.load.mass_kg", 100.0) == "plant.load.inertia_kg_m2: load_size_is_credible"


def test_an_unknown_key_is_named() -> None:
    with pytest.raises(ConfigError, match=r"plant\.load\.mas_kg.*did you mean plant\.load\.mass_kg"):
        Variation(default_machine(), ["plant.load.mas_kg"])
