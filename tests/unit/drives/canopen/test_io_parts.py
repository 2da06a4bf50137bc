"""Parts of the nodes beside the drive: levels to names, names to bits, edges of the watchdog, turns of the ring."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from gantryctl.drives.canopen.nodes.inputs import InputReader
from gantryctl.drives.canopen.nodes.outputs import OutputWriter, Watchdog
from gantryctl.drives.canopen.nodes.ring_encoder import RingAngle
from gantryctl.drives.canopen.settings import (
    CanopenSettings,
    InputBits,
    IoNodeSettings,
    LoadEncoderSettings,
    OutputBits,
)
from gantryctl.image import DigitalInputs, OutputImage
from gantryctl.machine import default_machine, with_values
from gantryctl.wiring.canopen import canopen_settings

NOTHING = InputBits(*[None] * len(InputBits._fields))


def settings(**io: object) -> CanopenSettings:
    machine = with_values(default_machine(), {"drive.kind": "canopen", "control.scan_period_ms": 4.0} | io)
    return canopen_settings(machine)


def test_a_bit_of_the_node_comes_before_one_of_the_drive() -> None:
    reader = InputReader(NOTHING._replace(estop_ok=16, door_ok=17), NOTHING._replace(estop_ok=3))
    for drive, node, estop, door in (
        (3 << 16, 0, False, True),
        (0, 8, True, False),
        (3 << 16, 8, True, True),
    ):
        inputs = reader.read(drive, node)
        assert (inputs.estop_ok, inputs.door_ok) == (estop, door)


def test_inputs_are_one_object_while_nothing_changes() -> None:
    """The program looks at them only where the object is another one, or something is open."""
    reader = InputReader(InputBits(estop_ok=16), NOTHING._replace(door_ok=0))
    first = reader.read(1 << 16, 1)
    assert reader.read(1 << 16 | 1 << 30, 1) is first
    assert reader.read(1 << 16, 0) is not first


def test_what_is_not_wired_counts_as_good_or_is_not_there() -> None:
    assert InputReader(NOTHING, None).read(None, None) == DigitalInputs()
    assert InputReader(InputBits(), None).read(None, None) == DigitalInputs()
    assert InputReader(InputBits(), None).read(0b11, None)[2:4] == (False, False)


@pytest.mark.parametrize(("bits", "minus_ok", "plus_ok"), [(0b01, False, True), (0b10, True, False)])
def test_each_limit_switch_is_that_of_its_end(bits: int, minus_ok: bool, plus_ok: bool) -> None:
    """CiA 402: bit 0 of 60FD is the negative limit, bit 1 the positive one."""
    seen = InputReader(InputBits(), None).read(bits, None)
    assert (seen.limit_minus_ok, seen.limit_plus_ok) == (minus_ok, plus_ok)


def test_every_input_of_a_lost_node_is_in_its_safe_state() -> None:
    bits = InputBits(*range(len(InputBits._fields)))
    reader = InputReader(NOTHING, bits)
    good = reader.read(None, ~(1 << bits.limit_minus | 1 << bits.limit_plus))
    assert good == DigitalInputs(collision_ok=True, door_ok=True, estop_ok_2=True, motion_permit=True)
    assert not any(reader.read(None, None))
    assert reader.brake_contact() is None
    for name, contact in (("brake_open", reader.brake_contact), ("watchdog_closed", reader.watchdog_contact)):
        for level in (True, False):
            reader.read(None, level << getattr(bits, name))
            assert contact() is level


def test_a_chain_with_one_channel_on_a_lost_node_does_not_differ() -> None:
    """It is open: two channels that differ would be a welded contact, which it is not."""
    reader = InputReader(NOTHING._replace(estop_ok=16), NOTHING._replace(estop_ok_2=0))
    assert reader.read(1 << 16, 1).estop_closed
    lost = reader.read(1 << 16, None)
    assert (lost.estop_ok, lost.estop_ok_2) == (False, False)
    # Nor with the other channel there; where there is one channel only, there is no second one to be open.
    reader = InputReader(NOTHING._replace(estop_ok_2=16), NOTHING._replace(estop_ok=0))
    assert reader.read(1 << 16, 1).estop_closed
    lost = reader.read(1 << 16, None)
    assert (lost.estop_ok, lost.estop_ok_2) == (False, False)
    lost = InputReader(NOTHING, NOTHING._replace(estop_ok=0)).read(None, None)
    assert (lost.estop_ok, lost.estop_ok_2) == (False, None)


@pytest.mark.parametrize(
    ("relay_s", "period_s", "scans"), [(0.1, 0.004, 6), (0.1, 0.001, 25), (0.05, 0.010, 1), (1.0, 0.001, 250)]
)
def test_the_watchdog_has_an_edge_every_quarter_of_its_time(
    relay_s: float, period_s: float, scans: int
) -> None:
    watchdog = Watchdog(relay_s, period_s)
    levels = [watchdog.scan(well=True) for _ in range(2000)]
    gaps = [n for n, (a, b) in enumerate(pairwise(levels)) if a is not b]
    assert {b - a for a, b in pairwise(gaps)} == {scans}
    longest_s = scans * period_s
    assert longest_s <= max(relay_s / 4.0, period_s) + 1e-9
    # One late edge keeps the relay closed.
    assert 2.0 * longest_s < relay_s


def test_a_watchdog_that_is_not_well_makes_no_edge() -> None:
    watchdog = Watchdog(0.1, 0.004)
    for level in (False, True):
        while watchdog.scan(well=True) is not level:
            pass
        assert {watchdog.scan(well=False) for _ in range(200)} == {level}


def test_outputs_go_where_they_are_wired_and_all_are_off_at_the_start() -> None:
    io = {
        "can.io.node": 3,
        "can.io.outputs.horn": 9,
        "can.io.outputs.in_position": 0,
        "can.outputs.at_rest": 31,
    }
    writer = OutputWriter(settings(**io))
    assert (writer.drive_word, writer.node_word) == (0, 0)
    writer.take(OutputImage(horn=True, in_position=True, at_rest=True), brake_released=False, well=True)
    assert (writer.drive_word, writer.node_word) == (1 << 31, 1 << 9 | 1)
    writer.take(OutputImage(lamp=True), brake_released=True, well=True)
    assert (writer.drive_word, writer.node_word) == (0, 0)


@pytest.mark.parametrize("owner", ["object_60FE", "controller_output"])
def test_the_brake_is_closed_unless_it_is_released(owner: str) -> None:
    """Bit 0 of 60FE sets the brake; an output of the controller releases it."""
    io: dict[str, object] = {"brake.owner": owner}
    io |= {"can.outputs.brake_release": 16} if owner == "controller_output" else {}
    writer = OutputWriter(settings(**io))
    closed, released = (1, 0) if owner == "object_60FE" else (0, 1 << 16)
    assert writer.drive_word == closed
    writer.take(OutputImage(), brake_released=True, well=True)
    assert writer.drive_word == released
    # It is the sequence behind the program's command that releases it, never the command alone.
    writer.take(OutputImage(brake_open=True), brake_released=False, well=True)
    assert writer.drive_word == closed


def test_the_machine_file_names_places() -> None:
    can = with_values(
        default_machine(),
        {
            "drive.kind": "canopen",
            "control.scan_period_ms": 4.0,
            "can.io.node": 3,
            "can.io.inputs.door_ok": 9,
        },
    ).can
    assert can.input_place("door_ok") == "6000 bit 9 of node 3"
    assert can.input_place("estop_ok") == "60FD bit 16"
    assert can.input_place("collision_ok") == ""
    assert can.output_place("horn") == ""


TURN = 1 << 20


@pytest.mark.parametrize("span", [TURN, 1 << 32])
@pytest.mark.parametrize("inverted", [False, True])
def test_the_ring_goes_on_over_its_wrap(span: int, inverted: bool) -> None:
    ring = RingAngle(LoadEncoderSettings(4, TURN, 1000, inverted), span, 0.004)
    sign = -1 if inverted else 1
    # 0.5 deg a step from -170 to +190 deg: over the wrap of the turn, never over that of the angle.
    for n in range(721):
        angle = -170.0 + 0.5 * n
        raw = sign * (round(angle / 360.0 * TURN) + 1000) % span
        ring.take(raw, 1)
        assert math.degrees(ring.after(0)) == pytest.approx(angle, abs=360.0 / TURN)
    # Missed telegrams: it goes on with its speed, 125 deg/s here.
    assert math.degrees(ring.after(5)) == pytest.approx(190.0 + 2.5, abs=0.01)


def test_a_missing_reading_of_the_ring_goes_on_with_the_speed_of_the_scans_that_have_passed() -> None:
    """Half a degree a scan, 1000 steps a degree. Only a sample newer than the one before is a reading."""
    ring = RingAngle(LoadEncoderSettings(4, 360_000, 0, False), 1 << 32, 0.004)
    assert math.isnan(ring.read(0, 0))
    for periods, reading, age, angle in (
        (1, 0.0, 0, 0.0),
        (1, 0.5, 0, 0.5),
        (1, 0.5, 1, 1.0),  # two telegrams are missing
        (1, 0.5, 2, 1.5),
        (1, 2.0, 0, 2.0),
        (1, 2.0, 1, 2.5),
        (4, 4.5, 0, 4.5),  # the controller was held up for three scans
        (1, 4.5, 1, 5.0),
        (1, 5.0, 1, 5.5),  # that one was late
        (1, 4.0, 0, 4.0),  # and back
        (1, 4.0, 1, 3.5),
    ):
        ring.begin(periods)
        assert math.degrees(ring.read(round(1000 * reading), age)) == pytest.approx(angle, abs=1e-9)


def test_a_turn_of_an_odd_number_of_steps_stands_behind_its_first_reading() -> None:
    """45 steps of 8 deg; a speed is known from the second reading on."""
    ring = RingAngle(LoadEncoderSettings(4, 45, 0, False), 1 << 32, 0.004)
    ring.take(1, 1)
    assert [math.degrees(ring.after(scans)) for scans in (0, 5)] == pytest.approx([8.0, 8.0])


def test_the_io_node_is_sent_what_is_wired_to_it_and_no_more() -> None:
    assert IoNodeSettings(3, NOTHING, OutputBits(horn=9)).outputs.mask == 1 << 9
