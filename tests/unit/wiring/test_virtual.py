"""Machine file to a virtual drive and the nodes beside it: name plates, times and signs, each figure by hand."""

from __future__ import annotations

import math

import pytest

from gantryctl.errors import ConfigError
from gantryctl.machine import configs_folder, default_machine, load_machine, with_values
from gantryctl.wiring.plant_effects import expect_one_pinion
from gantryctl.wiring.virtual import drive_hardware, drive_kind, virtual_bus
from gantryctl.wiring.virtual_nodes import load_encoder, virtual_neighbours, watchdog_s, wired
from support.modulo_machine import modulo_machine

pytestmark = pytest.mark.can
approx = pytest.approx
# The reference gantry with numbers of which no two are alike.
MACHINE = with_values(
    default_machine(),
    {
        "brake.open_time_ms": 90.0,
        "brake.close_time_ms": 140.0,
        "brake.owner": "object_60FE",
        "drive.speed_loop.overload_time_s": 50.0,
        "motor.current_rated_a": 68.0,
        "motor.speed_max_r_min": 1800.0,
        "plant.encoder.mounting_turns": 2000,
        "axis.limit_switch_min_deg": -182.5,
        "axis.limit_switch_max_deg": 183.0,
        "can.outputs.brake_release": 0,
        "can.outputs.watchdog": 5,
        "can.watchdog_ms": 80.0,
    },
)
WITH_NODES = load_machine(configs_folder() / "hust_can_nodes.toml")


def test_the_virtual_drive_has_the_figures_of_the_file_at_the_motor() -> None:
    """1144 motor turns; 5.4 and 0.39336 deg/s2 at the gantry are 107.82 and 7.854 rad/s2 at the motor."""
    made = drive_hardware(MACHINE)
    assert (made.torque_rated_nm, made.torque_max_nm, made.overload_time_s) == (257.0, 385.0, 50.0)
    assert made.current_rated_a == 68.0
    assert made.speed_max_rad_s == approx(188.4956, rel=1e-6)  # 1800 r/min
    assert made.quick_dec_rad_s2 == approx(107.8195, rel=1e-6)
    assert made.normal_acc_rad_s2 == approx(7.853982, rel=1e-6)  # 450 deg/s2
    assert (made.brake_open_s, made.brake_close_s) == (0.09, 0.14)
    assert made.limit_switches_rad == approx((-3.185226, 3.193953), rel=1e-6)
    assert (made.fine_counts_per_turn, made.turns) == (4_194_304, 4096)
    assert made.count_offset == 2000.0 * 4_194_304.0
    assert made.start_angle_rad == 0.0
    assert drive_hardware(MACHINE, -45.0).start_angle_rad == approx(-math.pi / 4.0)
    assert (made.brake_owner, made.output_bits) == ("object_60FE", (("brake_release", 0), ("watchdog", 5)))
    assert (made.watchdog_s, made.enable_relay) == (0.08, False)
    assert made.encoder_serial == "SIM-hust_gantry"


def test_a_modulo_axis_has_no_limit_switches() -> None:
    assert drive_hardware(modulo_machine()).limit_switches_rad == (-math.inf, math.inf)


def test_a_machine_of_two_pinions_is_not_computed_with_one() -> None:
    two = {"plant.switches.second_pinion": True}
    expect_one_pinion(MACHINE, "a virtual drive on a bus")
    with pytest.raises(ConfigError, match="must be false for a virtual drive on a bus"):
        drive_hardware(with_values(MACHINE, two))


@pytest.mark.parametrize(("inverted", "offset"), [(False, 1000), (True, -1000)])
def test_the_zero_of_an_inverted_ring_lies_on_the_other_side(inverted: bool, offset: int) -> None:
    """It reads `zero_counts` at 0 deg and counts down: the ring's own count there has the other sign."""
    machine = with_values(
        WITH_NODES, {"can.load_encoder.zero_counts": 1000, "can.load_encoder.inverted": inverted}
    )
    found = load_encoder(machine)
    assert found is not None
    assert (found.counts, found.offset, found.inverted) == (67_108_864, offset, inverted)
    assert found.step_rad == approx(2.0 * math.pi / 67_108_864)
    assert (found.noise_rad, found.latency_s) == (2.0e-7, 62.5e-6)
    # 4 urad of scale error: twice, 5 and 37 times in a turn.
    assert [waves for waves, _, _ in found.scale] == [2.0, 5.0, 37.0]
    assert [gain for _, gain, _ in found.scale] == approx([4.0e-6, 2.4e-6, 1.6e-6])


def test_a_machine_without_a_ring_encoder_has_none() -> None:
    assert load_encoder(MACHINE) is None


def test_bit_0_is_wired_and_minus_1_is_not() -> None:
    inputs = with_values(default_machine(), {"can.inputs.estop_ok": 0, "can.inputs.door_ok": -1}).can.inputs
    found = wired(inputs)
    assert found["estop_ok"] == 0
    assert "door_ok" not in found


@pytest.mark.parametrize(("bit", "seconds"), [(-1, 0.0), (0, 0.08), (5, 0.08)])
def test_a_watchdog_that_no_output_works_is_none(bit: int, seconds: float) -> None:
    assert watchdog_s(with_values(MACHINE, {"can.outputs.watchdog": bit})) == seconds


@pytest.mark.parametrize(("io", "encoder"), [(True, True), (True, False), (False, True), (False, False)])
def test_each_node_of_the_file_is_there_unless_it_is_left_out(io: bool, encoder: bool) -> None:
    link, drive, both = virtual_bus(WITH_NODES)
    link.close()
    assert None not in both
    found = virtual_neighbours(WITH_NODES, drive, lambda can_id, data: None, io=io, encoder=encoder)
    assert [each is not None for each in found] == [io, encoder]
    link, _, none = virtual_bus(load_machine(configs_folder() / "hust_can.toml"))
    link.close()
    assert list(none) == [None, None]


def test_a_virtual_drive_is_called_after_its_table_and_its_quirks() -> None:
    """Increments of a turn and what 1000 of a torque means are those of the machine: the maker's tool sets them."""
    of_table = {"can.virtual_drive": "Elmo Gold (DCF)@", "can.increments_per_turn": 65_536}
    machine = with_values(default_machine(), of_table | {"can.torque_reference": 1.5})
    kind = drive_kind(machine)
    assert kind.name == "Elmo Gold (DCF)"
    assert (kind.counts_per_turn, kind.torque_reference) == (65_536, 1.5)
    assert drive_kind(machine, ["sparse"]).name == "Elmo Gold (DCF)+sparse"
    assert drive_kind(default_machine(), ["sparse"]).name == "sparse"
