"""Any value in any field of a machine file, at the command line: refused in lines, or run within limits."""

from __future__ import annotations

import copy
import json
import os
import tomllib
from collections.abc import Iterator
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.machine import default_machine_path, field_specs
from gantryctl.machine.specs import table_models
from support.command_line import Answer, cli
from support.examples import examples

RAW = tomllib.loads(default_machine_path().read_text(encoding="utf-8"))
SPECS = field_specs()
TABLES = set(table_models())


@pytest.fixture(scope="module", autouse=True)
def _place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    here = Path.cwd()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GANTRYCTL_STATE", str(tmp_path_factory.mktemp("state")))
        os.chdir(tmp_path_factory.mktemp("work"))
        yield
    os.chdir(here)


def toml(value: Any) -> str:
    """One TOML value."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    if isinstance(value, bool | str):
        return json.dumps(value).replace("\x7f", "\\u007f")
    if isinstance(value, date | datetime | time):
        return value.isoformat()
    return repr(value)


def lines(table: dict[str, Any], path: str) -> Iterator[str]:
    """A table of the machine file and those below it."""
    below = {
        key: value for key, value in table.items() if f"{path}{key}" in TABLES and isinstance(value, dict)
    }
    for key, value in table.items():
        if key not in below:
            yield f"{json.dumps(key)} = {toml(value)}"
    for key, value in below.items():
        yield f"[{path}{key}]"
        yield from lines(value, f"{path}{key}.")


def file_with(changes: dict[str, Any]) -> Path:
    """The reference machine's file with some keys changed."""
    data = copy.deepcopy(RAW)
    for path, value in changes.items():
        *tables, key = path.split(".")
        table = data
        for name in tables:
            if not isinstance(table.get(name), dict):
                table[name] = {}
            table = table[name]
        table[key] = value
    file = Path("any.toml")
    file.write_text("\n".join([*lines(data, ""), ""]), encoding="utf-8")
    return file


def test_the_unchanged_file_is_accepted() -> None:
    assert cli("config", "check", file_with({})).code == 0
    assert cli("move", "0.2", "--fresh", "--no-trace", "--config", "any.toml").code == 0


def refused_in_lines(answer: Answer) -> bool:
    """Whether it was refused; then every line names the file or the machine, and what is wrong."""
    if answer.code != 2:
        return False
    assert answer.out == ""
    for line in answer.err.splitlines():
        assert line.startswith(("error: any.toml: ", "error: hust_gantry: ")), line
        assert line.isprintable()
    return True


ANYTHING = st.recursive(
    st.booleans() | st.integers(-(10**20), 10**20) | st.floats() | st.text(st.characters(codec="utf-8"), max_size=12)
    | st.dates() | st.times(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("ab c\"", max_size=5), inner, max_size=2),
    max_leaves=4,
)  # fmt: skip


@settings(max_examples=examples(100))
@given(
    st.dictionaries(
        st.sampled_from([*SPECS, "axis", "plant.load", "nothing", "axis.nothing"]),
        ANYTHING,
        min_size=1,
        max_size=3,
    )
)
def test_anything_in_any_field(changes: dict[str, Any]) -> None:
    file = file_with(changes)
    answer = cli("config", "check", file)
    assert refused_in_lines(answer) or answer.code == 0
    again = cli("config", "show", file, "--json")
    assert again.code == answer.code
    if answer.code == 0:
        values = again.json["values"]
        for path in changes.keys() & SPECS.keys():
            spec, kept = SPECS[path], values[path]["value"]
            if spec.kind in ("number", "integer"):
                assert spec.low <= kept <= spec.high


@st.composite
def within_bounds(draw: st.DrawFn) -> dict[str, Any]:
    """Some keys, each anywhere within its own bounds, often at an end of them or near the reference."""
    found: dict[str, Any] = {}
    for path in draw(st.lists(st.sampled_from(sorted(SPECS)), min_size=1, max_size=4, unique=True)):
        spec = SPECS[path]
        if spec.kind == "switch":
            found[path] = draw(st.booleans())
        elif spec.kind == "word":
            found[path] = draw(st.sampled_from(spec.words))
        elif spec.kind == "integer":
            found[path] = draw(st.integers(int(spec.low), int(spec.high)))
        elif spec.kind == "number":
            usual = spec.usual if isinstance(spec.usual, float) else spec.low
            near = st.floats(0.5, 2.0).map(lambda k, x=usual: k * x)
            found[path] = draw(st.sampled_from([spec.low, spec.high]) | st.floats(spec.low, spec.high) | near)
    return found


@settings(max_examples=examples(25))
@given(within_bounds())
def test_a_machine_with_any_allowed_values_moves_within_limits_or_says_why_not(
    changes: dict[str, Any],
) -> None:
    changes |= {"machine.name": "hust_gantry"}
    file = file_with(changes)
    if refused_in_lines(cli("config", "check", file)):
        return
    answer = cli("move", "0.2", "--fresh", "--no-trace", "--json", "--config", file)
    if answer.code == 2 and answer.out == "":
        assert refused_in_lines(answer)
        return
    assert answer.code in (0, 1, 2, 4), answer
    found = answer.json
    assert (found["error"] is None) is (answer.code in (0, 1))
    summary = found["summary"]
    if summary is None:
        return
    values = cli("config", "show", file, "--json").json["values"]
    torque = values["motor.torque_max_nm"]["value"]
    assert summary["torque_max_nm"] <= torque * (1.0 + 1e-9)
    assert summary["peak_deg_s"] <= values["speed.setting_max_deg_s"]["value"] * (1.0 + 1e-9)
    if answer.code == 0:
        window = values["monitors.in_position_window_deg"]["value"]
        assert abs(summary["end_deg"] - 0.2) <= window + 0.001  # and the way that the brake lets it settle


@settings(max_examples=examples(12))
@given(within_bounds())
def test_other_commands_on_any_allowed_machine(changes: dict[str, Any]) -> None:
    changes |= {"machine.name": "hust_gantry"}
    file = file_with(changes)
    if refused_in_lines(cli("config", "check", file)):
        return
    for command in (
        ["speed-test", "--speed", "3"],
        ["stops", "--speed", "1"],
        ["sim", "reset"],
        ["status"],
        ["encoder", "show"],
    ):
        answer = cli(*command, "--json", "--config", file)
        if answer.code in (0, 1):
            assert answer.json is not None
        else:
            assert answer.code in (2, 3)
            assert answer.err.startswith("error: ")
