"""Every field against every kind of wrong value: refused, and the line names table, key, value, range."""

import json
import math
import tomllib
from functools import cache

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import default_machine, default_machine_path, field_specs, parse_machine, with_values
from gantryctl.machine.loading import check
from gantryctl.machine.problems import show_value

TEXT = default_machine_path().read_text(encoding="utf-8")

WRONG_FOR_ALL = [math.nan, math.inf, -math.inf, [], ["x"], [[1.0]], {"x": 1.0}, 10**400, -(10**30)]
WRONG = {
    "number": ["5", "", True, False, 1e300, -1e300],
    "integer": ["5", "", True, 8.0, 0.5, 2**70],
    "switch": ["true", 0, 1, 1.0],
    "word": ["", "Sim", "no such word", True, 1, 1.0],
    "text": [True, 1, 1.0, "x" * 301],
    "texts": ["x", True, 1.0, [1.0], [True], [["x"]], ["x"] * 201],
    "pairs": [
        "x",
        True,
        1.0,
        [1.0],
        [[1.0]],
        [[1.0, 2.0, 3.0]],
        [["1.0", 2.0]],
        [[1.0, 1e9]],
        [[1.0, 2.0]] * 9,
    ],
    "numbers": ["5", True, 1.0, [True], [math.nan], [math.inf], ["1.0"], [[1.0]], [1.0] * 40],
}


DATA = json.dumps(tomllib.loads(TEXT))


def data():
    return json.loads(DATA)


def refused(path, value):
    """The lines that refuse a value at a dotted path."""
    return refused_together({path: value})


def refused_together(values):
    """The lines that refuse values at dotted paths."""
    changed = data()
    for path, value in values.items():
        *tables, key = path.split(".")
        table = changed
        for part in tables:
            table = table[part]
        table[key] = value
    with pytest.raises(ConfigError) as caught:
        check(changed, "f.toml")
    return caught.value.problems


def wrong_values(spec):
    """Every kind of wrong value of a field."""
    # Words in an array are what an array of texts is made of; a word that is no key is the rule's (test_rules.py).
    right = (
        ([], ["x"])
        if spec.kind == "texts"
        else ([],)
        if spec.kind in ("numbers", "pairs") and not spec.lengths[0]
        else ()
    )
    return [value for value in WRONG_FOR_ALL if value not in right] + WRONG[spec.kind]


@cache
def refused_everywhere(turn):
    """The lines of a file in which every field has the wrong value whose turn it is: one file for 350 fields."""
    wrong = {path: wrong_values(spec) for path, spec in field_specs().items()}
    return refused_together({path: values[turn] for path, values in wrong.items() if turn < len(values)})


@pytest.mark.parametrize("path", field_specs())
def test_wrong_values_are_refused_with_field_value_and_range(path):
    spec = field_specs()[path]
    for turn, value in enumerate(wrong_values(spec)):
        lines = refused_everywhere(turn)
        place = f"f.toml: {spec.place}"
        about = [line for line in lines if line.startswith((f"{place} = ", f"{place}[", f"{place}: "))]
        assert about, value
        line = about[0]
        assert "\n" not in line
        if not isinstance(value, dict | list):
            assert show_value(value) in line
        assert spec.allowed in line
        assert all(other.startswith("f.toml: ") for other in lines)


@pytest.mark.parametrize("path", [p for p, s in field_specs().items() if s.kind in ("number", "integer")])
def test_values_just_outside_the_bounds_are_refused(path):
    spec = field_specs()[path]
    whole = spec.kind == "integer"
    below = int(spec.low) - 1 if whole else math.nextafter(spec.low, -math.inf)
    above = int(spec.high) + 1 if whole else math.nextafter(spec.high, math.inf)
    for value in (below, above):
        assert f"allowed {spec.allowed}" in refused(path, value)[0]


@pytest.mark.parametrize("path", [p for p, s in field_specs().items() if s.kind == "numbers"])
def test_elements_and_lengths_of_arrays(path):
    spec = field_specs()[path]
    usual = list(spec.usual)
    for value in (
        math.nextafter(spec.low, -math.inf),
        math.nextafter(spec.high, math.inf),
        math.nan,
        "1.0",
        True,
    ):
        line = refused(path, [*usual[:-1], value])[0]
        assert line.startswith(f"f.toml: {spec.place}[{max(len(usual) - 1, 0)}] = ")
    assert "has 40 numbers" in refused(path, [spec.low] * 40)[0]
    # An array of no numbers says that the value is derived.
    if spec.lengths[0]:
        assert "has 0 numbers" in refused(path, [])[0]


def test_a_shorter_ring_map_is_accepted():
    assert with_values(
        default_machine(), {"plant.gear_error.ring_um": (60.0, 32.0)}
    ).plant.gear_error.ring_um == (60.0, 32.0)


@pytest.mark.parametrize("path", field_specs())
def test_a_missing_key_is_refused_or_takes_its_default(path):
    spec = field_specs()[path]
    changed = data()
    *tables, key = path.split(".")
    table = changed
    for part in tables:
        table = table[part]
    del table[key]
    if spec.required:
        with pytest.raises(ConfigError) as caught:
            check(changed, "f.toml")
        assert caught.value.problems == (f"f.toml: {spec.place}: is missing; allowed {spec.allowed}",)
    elif path not in ("machine.description", "required.source"):
        assert check(changed, "f.toml") == default_machine()


@pytest.mark.parametrize("path", field_specs())
def test_a_misspelt_key_is_refused_with_a_hint(path):
    spec = field_specs()[path]
    changed = data()
    *tables, key = path.split(".")
    table = changed
    for part in tables:
        table = table[part]
    table[key[:-1] + "q"] = table.pop(key)
    with pytest.raises(ConfigError) as caught:
        check(changed, "f.toml")
    line = next(line for line in caught.value.problems if "unknown key" in line)
    assert line.startswith(f"f.toml: [{spec.table}] {key[:-1]}q = ")
    if len(key) > 4:
        assert "did you mean" in line


def test_whole_numbers_stand_for_numbers_with_a_point():
    machine = parse_machine(TEXT.replace("pos_max_deg = 180.0", "pos_max_deg = 180"))
    assert machine == default_machine()
    assert isinstance(machine.axis.pos_max_deg, float)


# --- the exact words ---


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("acc_deg_s2 = 0.39335664335664333", "acc_deg_s2 = 450.0",
         "[virtual_axis] quick_dec_deg_s2 = 5.4 deg/s2: must be at least 450 deg/s2: the axis must stop faster than "
         "it starts; against [virtual_axis] acc_deg_s2 = 450.0 deg/s2; acc_deg_s2 is 1144 x the usual 0.393357: "
         "a value at the motor where one at the load belongs?"),
        ("kpp_per_s = 10.0 ", 'kpp_per_s = "10"',
         '[control] kpp_per_s = "10": is text, must be a number; allowed 0.001..1000 1/s'),
        ("kvf = 1.0 ", "kvf = true", "[control] kvf = true: is a boolean, must be a number; allowed 0..1.5"),
        ("kvf = 1.0 ", "kvf = 1979-05-27",
         "[control] kvf = 1979-05-27: is a date or time, must be a number; allowed 0..1.5"),
        ("kvf = 1.0 ", "kvf = 1e400", "[control] kvf = inf: is not a finite number; allowed 0..1.5"),
        ("turns = 4096 ", "turns = 4096.0",
         "[encoder] turns = 4096.0: is a number with a point, must be a whole number; "
         "allowed 1..16777216 turns"),
        ('kind = "sim" ', 'kind = "idel"',
         '[drive] kind = "idel": allowed "sim", "ideal", "canopen"; did you mean "ideal"?'),
        ("base = true", 'base = "on"',
         '[plant.switches] base = "on": is text, must be true or false; allowed true, false'),
        ("eccentric_sign = -1.0", "eccentric_sign = 0.5",
         "[plant.load] eccentric_sign = 0.5: allowed -1 or 1"),
        ("kpp_per_s", "kp_per_s", "[control] kp_per_s = 10.0: unknown key; did you mean kpp_per_s?"),
        ("kpp_per_s = 10.0", "kpp_per_s = 10.0\nquick_dec_deg_s2 = 3",
         "[control] quick_dec_deg_s2 = 3: unknown key; did you mean [virtual_axis] quick_dec_deg_s2?"),
        ("[accuracy]", "[accuracy]\ntolerance_deg = 0.01",
         "[accuracy] tolerance_deg = 0.01: unknown key; it is [required] angle_deg now"),
        ("[axis]", "[axis]\nstopping_angle_max_deg = 3.0",
         "[axis] stopping_angle_max_deg = 3.0: unknown key; it is [required] stopping_angle_deg now"),
        ("[drive.speed_loop]", "[speed_loop]",
         "[speed_loop]: unknown table; did you mean [drive.speed_loop]?"),
        ("[monitors]", "[monitor]", "[monitor]: unknown table; did you mean [monitors]?"),
        ("[monitors]", "[[monitors]]", "[monitors] = [a table]: is an array, must be a table"),
        ('name = "hust_gantry"', 'name = "a b"',
         "[machine] name = \"a b\": allowed 1 to 64 characters; letters, digits, '_', '-', '.'"),
        ('name = "hust_gantry"', 'name = "\\u001b[31m"',
         "[machine] name = \"\\u001b[31m\": allowed 1 to 64 characters; letters, digits, '_', '-', '.'"),
        ("[axis]", "[axes]",
         "[axis]: the table is missing; it must give pos_min_deg, pos_max_deg, reducer_ratio, ring_ratio"),
    ],
)  # fmt: skip
def test_the_exact_line(old, new, line):
    assert TEXT.count(old) >= 1
    with pytest.raises(ConfigError) as caught:
        parse_machine(TEXT.replace(old, new, 1), "f.toml")
    assert f"f.toml: {line}" in caught.value.problems


def test_all_problems_at_once_fields_and_rules():
    text = (
        TEXT.replace("kpp_per_s = 10.0", "kpp_per_s = nan")
        .replace("tvi_ms = 10.0", "tvi_sec = 10.0")
        .replace("torque_rated_nm = 257.0", "")
        .replace("command_clamp_deg_s = 6.3", "command_clamp_deg_s = 6.2")
        .replace("average_s = 2.0", "average_s = 20.0")
    )
    with pytest.raises(ConfigError) as caught:
        parse_machine(text, "f.toml")
    keys = ["torque_rated_nm", "kpp_per_s", "tvi_sec", "command_clamp_deg_s", "average_s"]
    assert len(caught.value.problems) == len(keys)
    for key in keys:
        assert sum(f"] {key}" in line.partition("; against")[0] for line in caught.value.problems) == 1


def test_no_rule_speaks_about_a_refused_value():
    # The clamp is refused by its bounds; the rule clamp against setting would only repeat it with a stand-in.
    lines = refused("speed.command_clamp_deg_s", "fast")
    assert len(lines) == 1


def test_names_from_the_file_cannot_forge_a_line_or_colour_a_terminal():
    evil = "x\n f.toml: [axis] fine\x1b[31m\u202e"
    changed = data()
    changed["control"][evil] = evil
    changed[evil] = {evil: 1}
    with pytest.raises(ConfigError) as caught:
        check(changed, "f\n.toml")
    for line in caught.value.problems:
        assert line.isprintable()
        assert line.startswith("f\\n.toml: ")


@pytest.mark.parametrize(
    ("path", "unit"),
    [
        ("axis.pos_min_deg", "deg"),
        ("virtual_axis.jerk_deg_s3", "deg/s3"),
        ("plant.transmission.rest_stiffness_nm_per_rad", "N m/rad"),
        ("drive.speed_loop.kvp_nm_s_per_rad", "N m s/rad"),
        ("monitors.following_error_per_speed_s", "s"),
        ("encoder.turns", "turns"),
        ("encoder.lines", "1/turn"),  # named in the declaration
        ("control.compensation.gear_map.cycles_per_turn", "-"),
        ("axis.reducer_ratio", "-"),
        ("plant.load.eccentric_sign", "-"),
    ],
)
def test_the_unit_of_a_key_is_the_end_of_its_name(path: str, unit: str) -> None:
    assert field_specs()[path].unit == unit
