"""Random machine files: valid ones come back equal, none is refused, no wrong one gives a traceback."""

import math
import random
import tomllib

from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.errors import ConfigError
from gantryctl.machine import (
    Machine,
    config_hash,
    default_machine,
    default_machine_path,
    effective_values,
    field_specs,
    load_machine,
    parse_machine,
    with_values,
)
from gantryctl.machine.effective import to_toml
from gantryctl.machine.loading import check
from support.examples import examples

MACHINE = default_machine()
VALUES = effective_values(MACHINE)
RAW = default_machine_path().read_bytes()

# Bound to each other too closely to be varied one by one; `consistent_changes` varies them together.
BOUND = {
    "axis.over_travel_min_deg", "axis.over_travel_max_deg", "axis.limit_switch_min_deg",
    "axis.limit_switch_max_deg", "axis.mechanical_stop_min_deg", "axis.mechanical_stop_max_deg",
    "axis.pos_min_deg", "axis.pos_max_deg", "required.stopping_angle_deg", "axis.ring_ratio", "brake.test_torque_nm",
    "control.scan_period_ms",
    "drive.speed_loop.cycle_us", "plant.load.eccentric_sign", "speed.command_clamp_deg_s",
    "speed.drive_ceiling_deg_s", "speed.overspeed_trip_deg_s", "speed.setting_max_deg_s",
}  # fmt: skip
FREE = [path for path, spec in field_specs().items() if spec.kind == "number" and path not in BOUND]


def consistent_changes(draw):
    """Changes that break no rule: `draw(low, high)` gives a number."""
    changes = {path: VALUES[path] * draw(0.97, 1.03) for path in FREE}
    changes["axis.pos_min_deg"] = low = draw(-180.0, 100.0)
    changes["axis.pos_max_deg"] = high = low + draw(1.0, 180.0 - low)
    changes["axis.over_travel_min_deg"] = low_trip = low - draw(0.1, 1.0)
    changes["axis.over_travel_max_deg"] = high_trip = high + draw(0.1, 1.0)
    changes["axis.limit_switch_min_deg"] = low_switch = low_trip - draw(0.1, 5.0)
    changes["axis.limit_switch_max_deg"] = high_switch = high_trip + draw(0.1, 5.0)
    changes["speed.setting_max_deg_s"] = fastest = draw(1.0, 6.0)
    # The quick stop from there, the time-out of the heartbeat (150 ms + 3 %, the longest reaction) and some more.
    quickest = fastest**2 / (2.0 * changes["virtual_axis.quick_dec_deg_s2"]) + 0.16 * fastest
    changes["required.stopping_angle_deg"] = stop = quickest + draw(0.2, 6.0)
    changes["axis.mechanical_stop_min_deg"] = low_switch - stop - draw(0.0, 3.0)
    changes["axis.mechanical_stop_max_deg"] = high_switch + stop + draw(0.0, 3.0)
    changes["speed.command_clamp_deg_s"] = clamp = fastest * draw(1.05, 1.2)
    changes["speed.drive_ceiling_deg_s"] = ceiling = clamp * draw(1.0, 1.1)
    changes["speed.overspeed_trip_deg_s"] = ceiling * draw(1.001, 1.1)
    changes["drive.speed_loop.cycle_us"] = cycle = draw(50.0, 250.0)
    changes["control.scan_period_ms"] = cycle * int(draw(2.0, 16.0)) / 1000.0
    changes["brake.test_torque_nm"] = draw(70.0, 200.0)
    changes["plant.load.eccentric_sign"] = math.copysign(1.0, draw(-1.0, 1.0))
    changes["axis.ring_ratio"] = int(draw(312.0, 339.0)) / 26
    changes["plant.gear_error.phases_rad"] = [draw(0.0, 2.0 * math.pi) for _ in range(18)]
    changes["plant.gear_error.ring_um"] = [draw(0.0, 100.0) for _ in range(int(draw(1.0, 12.99)))]
    for path, spec in field_specs().items():
        if spec.kind == "switch":
            changes[path] = draw(0.0, 1.0) < 0.5
        elif spec.kind == "word":
            changes[path] = spec.words[int(draw(0.0, len(spec.words) - 0.001))]
    changes["axis.kind"] = "linear"
    # A cycle passes at most a quarter of a period of the cogging: 127 us at the highest ceiling and ratio drawn here.
    changes["plant.switches.cogging"] &= cycle < 120.0
    # A second pinion has gears and a drive of its own, which no bus has.
    changes["plant.switches.second_pinion"] &= (
        not changes["plant.switches.rigid"] and changes["drive.kind"] != "canopen"
    )
    _agree(changes)
    # The moment observer follows within a limit; the delivered machine has 0, which no factor changes.
    changes["control.compensation.moment_observer.limit_nm"] = draw(1.0, 1e5)
    changes["control.compensation.backlash_observer.limit_deg"] = draw(0.001, 0.1)
    changes["can.stepped"] &= not changes["can.commissioning_required"]
    if changes["drive.kind"] == "canopen":  # SYNC has whole milliseconds, and the controller no brake output
        changes |= {"drive.speed_loop.cycle_us": 125.0, "control.scan_period_ms": 4.0, "brake.owner": "drive"}
    # An encoder node has a node id, and a load-side loop on a bus a source.
    loop_on_bus = changes["drive.kind"] == "canopen" and changes["control.compensation.load_encoder.active"]
    if loop_on_bus and changes["can.load_encoder.source"] == "none":
        changes["can.load_encoder.source"] = "60E4"
    if changes["can.load_encoder.source"] == "node":
        changes["can.load_encoder.node"] = 100 + int(draw(0.0, 19.99))
    return changes


def _agree(changes):
    """Compensations ask for a calibration, an encoder, and a profile without steps."""
    at = "control.compensation."
    changes[at + "calibration"] = "m.calibration.toml"
    for needs_encoder in ("load_encoder.own_errors", "damping.active"):
        changes[at + needs_encoder] &= changes[at + "load_encoder.active"]
    changes["plant.load_encoder.fitted"] |= changes[at + "load_encoder.active"]
    smooth = changes["virtual_axis.profile"] == "jerk_limited"
    for needs_smoothness in ("torque.acceleration", "windup.active"):
        changes[at + needs_smoothness] &= smooth
    for needed in ("moment_observer.active", "windup.active", "windup.reversal"):
        changes[at + "backlash_observer.active"] &= changes[at + needed]
    changes["virtual_axis.gentle_end"] &= smooth


def test_a_thousand_valid_machines_are_accepted_and_come_back():
    for seed in range(1000):
        machine = with_values(MACHINE, consistent_changes(random.Random(seed).uniform))
        if seed % 10 == 0:
            again = parse_machine(to_toml(machine))
            assert again == machine
            assert config_hash(again) == config_hash(machine)


@settings(max_examples=examples(150))
@given(
    st.dictionaries(st.sampled_from(FREE), st.floats(0.97, 1.03), max_size=6),
    st.text(st.characters(codec="utf-8"), max_size=100),
)
def test_any_valid_variation_comes_back_equal(factors, description):
    changes = {path: VALUES[path] * factor for path, factor in factors.items()}
    machine = with_values(MACHINE, changes | {"machine.description": description})
    again = parse_machine(to_toml(machine))
    assert again == machine
    assert config_hash(again) == config_hash(machine)
    assert again.machine.description == description


def accepted_or_refused(call, *arguments):
    """The machine, or None after a refusal in finished lines; any other exception is a failure."""
    problems = ()
    try:
        return call(*arguments)
    except ConfigError as error:
        problems = error.problems
    assert problems
    assert all(line.isprintable() for line in problems)
    return None


@given(content=st.binary(max_size=400))
def test_random_bytes_are_refused(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("bytes") / "f.toml"
    path.write_bytes(content)
    assert accepted_or_refused(load_machine, path) is None


@settings(max_examples=examples(300))
@given(st.integers(0, len(RAW) - 1), st.integers(0, 8), st.binary(max_size=6))
def test_a_damaged_file_is_accepted_or_refused(tmp_path_factory, start, length, piece):
    path = tmp_path_factory.getbasetemp() / "damaged.toml"
    path.write_bytes(RAW[:start] + piece + RAW[start + length :])
    machine = accepted_or_refused(load_machine, path)
    assert machine is None or isinstance(machine, Machine)


TOML_VALUES = st.recursive(
    st.one_of(
        st.booleans(), st.integers(), st.floats(), st.text(max_size=20),
        st.dates(), st.datetimes(), st.times(),
        st.integers(-(10**400), 10**400),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@settings(max_examples=examples(400))
@given(st.sampled_from([*field_specs(), "axis", "plant", "plant.load", "drive.speed_loop"]), TOML_VALUES)
def test_any_value_anywhere_is_accepted_within_bounds_or_refused(path, value):
    data = tomllib.loads(RAW.decode())
    *tables, key = path.split(".")
    table = data
    for part in tables:
        table = table[part]
    table[key] = value
    machine = accepted_or_refused(check, data, "f.toml")
    if machine is not None and path in field_specs():
        spec = field_specs()[path]
        kept = effective_values(machine)[path]
        if spec.kind in ("number", "integer"):
            assert spec.low <= kept <= spec.high


@given(st.text(max_size=200))
def test_random_text_is_refused(text):
    assert accepted_or_refused(parse_machine, text) is None
