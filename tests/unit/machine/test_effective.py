"""Values in force: origin, hash, differences, schema, reference page."""

import hashlib
import json
from pathlib import Path

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import (
    config_hash,
    default_machine,
    diff_machines,
    effective_values,
    field_specs,
    origins,
    parse_machine,
    short_hash,
    with_values,
)
from gantryctl.machine.configuration_page import reference_page

ROOT = Path(__file__).parents[3]
MACHINE = default_machine()
SHORT = """
[machine]
name = "short"
[axis]
pos_min_deg = -180
pos_max_deg = 180
reducer_ratio = 88
ring_ratio = 13
[motor]
power_rated_kw = 31
torque_rated_nm = 257
torque_max_nm = 385
speed_rated_r_min = 1150
speed_max_r_min = 2000
inertia_kg_m2 = 0.232
[encoder]
counts_per_turn = 8192
turns = 4096
[plant.load]
mass_kg = 2e5
"""


def test_the_shortest_file_is_the_reference_machine_under_another_name():
    machine = parse_machine(SHORT)
    assert [d.path for d in diff_machines(machine, MACHINE)] == [
        "machine.name",
        "machine.description",
        "required.source",
    ]


def test_origins():
    found = origins(parse_machine(SHORT))
    assert list(found) == list(field_specs())
    assert {path for path, origin in found.items() if origin == "file"} == {
        path for path, spec in field_specs().items() if spec.required
    } | {"plant.load.mass_kg"}
    assert set(origins(MACHINE).values()) == {"file"}


def test_hash_depends_on_values_not_on_their_writing():
    assert config_hash(parse_machine(SHORT)) == config_hash(
        parse_machine(SHORT.replace("= 180", "= 1.8e2") + "eccentric_angle_deg = -0.0\n")
    )
    text = json.dumps(effective_values(MACHINE), sort_keys=True, separators=(",", ":"))
    assert config_hash(MACHINE) == hashlib.sha256(text.encode()).hexdigest()
    assert short_hash(MACHINE) == config_hash(MACHINE)[:12]


@pytest.mark.parametrize("path", field_specs())
def test_hash_and_diff_notice_every_field(path):
    value = effective_values(MACHINE)[path]
    spec = field_specs()[path]
    other = {
        "number": lambda: value * 1.5 + 0.001,
        "integer": lambda: value + 1,
        "switch": lambda: not value,
        "word": lambda: next(word for word in spec.words if word != value),
        "text": lambda: value + "x",
        "numbers": lambda: (*value[:-1], sum(value[-1:]) + 0.001),
        "texts": lambda: (*value, "axis.kind"),
        "pairs": lambda: (*value, (10.0, 20.0)),
    }[spec.kind]()
    changed = copy_with(MACHINE, path.split("."), other)
    assert config_hash(changed) != config_hash(MACHINE)
    assert [(d.path, d.first, d.second) for d in diff_machines(MACHINE, changed)] == [(path, value, other)]


def copy_with(table, path, value):
    """A copy with one value replaced and nothing checked."""
    name, *rest = path
    return table.model_copy(update={name: copy_with(getattr(table, name), rest, value) if rest else value})


def test_with_values_leaves_the_machine_alone():
    changed = with_values(MACHINE, {"plant.switches.rigid": True, "plant.gear_error.phases_rad": (0.0,) * 18})
    assert changed.plant.switches.rigid
    assert changed.plant.gear_error.phases_rad == (0.0,) * 18
    assert not MACHINE.plant.switches.rigid
    assert with_values(MACHINE, {}) == MACHINE


@pytest.mark.parametrize(
    "path", ["plant.switches.rigit", "nonsense", "plant", "axis.pos_min_deg.x", "", "a.b.c"]
)
def test_with_values_refuses_unknown_paths(path):
    with pytest.raises(ConfigError):
        with_values(MACHINE, {path: 1.0})


def test_reference_page_is_the_one_written_from_the_schema():
    committed = (ROOT / "docs" / "reference" / "configuration.md").read_text(encoding="utf-8")
    assert committed == reference_page(), (
        "run: python -m gantryctl.machine.configuration_page docs/reference/configuration.md"
    )
    for path, spec in field_specs().items():
        assert f"| `{spec.key}` |" in committed, path
