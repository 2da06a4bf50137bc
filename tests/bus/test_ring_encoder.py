"""Encoder on the ring, as 60E4 of the drive or as a node of its own (CiA 406): the load is where it is told to be."""

from __future__ import annotations

import math

import pytest

from bus.bus_rig import TORQUE_OFF_DEG, BusRig, bus_machine
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.faults import frame_fault
from gantryctl.errors import DeviceError
from gantryctl.machine import Machine, with_values
from gantryctl.program import PowerPhase
from gantryctl.wiring.canopen import canopen_settings
from gantryctl.wiring.virtual import virtual_bus

pytestmark = pytest.mark.can

LOOP = {"control.compensation.load_encoder.active": True}
NODE = {"can.load_encoder.source": "node", "can.load_encoder.node": 4}
DRIVE = {"can.load_encoder.source": "60E4"}
SOURCES = [pytest.param(NODE, id="node"), pytest.param(DRIVE, id="60E4", marks=pytest.mark.slow)]


def ring_machine(
    source: dict[str, object], changes: dict[str, object] | None = None, scan_ms: float = 4.0
) -> Machine:
    return bus_machine("drive", scan_ms, changes=LOOP | source | (changes or {}))


def off(rig: BusRig) -> None:
    """Leave the axis without power."""
    rig.command(power=False, move=False)
    rig.run(6.0)
    rig.engine.close()


def load_deg(rig: BusRig) -> float:
    """True angle of the load."""
    return math.degrees(rig.node.truth()[0])


@pytest.mark.parametrize("source", [NODE, DRIVE], ids=["node", "60E4"])
def test_the_reading_is_the_true_angle_of_the_load(source: dict[str, object]) -> None:
    rig = BusRig(ring_machine(source), -40.0).power_up().cruise(6.0)
    reading = math.degrees(rig.drive.read().pos_ring_rad)
    load, _, _, _, base, *_ = rig.node.truth()
    # The ring is read from the frame, which rocks by 0.003 deg. Sampled at this SYNC, 62.5 us old: 0.00038 deg at
    # 6 deg/s; three terms of the scale error, 8e-6 rad: 0.00046 deg; noise and steps less.
    assert reading == pytest.approx(math.degrees(load - base), abs=0.0009)
    off(rig)


@pytest.mark.parametrize("source", SOURCES)
def test_the_loop_through_the_ring_puts_the_load_where_it_is_told(source: dict[str, object]) -> None:
    rig = BusRig(ring_machine(source), 60.0).power_up()
    rig.command(move=True, target_rad=math.radians(62.0), speed_rad_s=math.radians(1.0))
    rig.run(14.0)
    assert rig.codes == []
    # The motor encoder alone leaves the gear error: 0.003 deg and more. Dead band 1e-4 deg, scale error 2.3e-4 deg.
    assert load_deg(rig) == pytest.approx(62.0, abs=0.0008)
    off(rig)


@pytest.mark.slow
def test_without_the_loop_the_gear_error_stays() -> None:
    """The test above can fail: the same move by the motor encoder alone."""
    rig = BusRig(bus_machine("drive", 4.0), 60.0).power_up()
    rig.command(move=True, target_rad=math.radians(62.0), speed_rad_s=math.radians(1.0))
    rig.run(14.0)
    assert abs(load_deg(rig) - 62.0) > 0.0008
    off(rig)


@pytest.mark.parametrize("angle", [180.2, pytest.param(-180.2, marks=pytest.mark.slow)])
def test_an_encoder_of_one_turn_knows_no_half_turn_from_its_opposite(angle: float) -> None:
    """The ring shows -179.8 deg where the axis is at +180.2 deg; the motor counts the turns."""
    rig = BusRig(ring_machine(NODE, {"can.load_encoder.zero_counts": 12_345}), angle).power_up()
    rig.run(2.0)
    assert rig.codes == []
    target = math.copysign(175.0, angle)
    rig.command(move=True, target_rad=math.radians(target), speed_rad_s=math.radians(3.0))
    rig.run(8.0)
    assert rig.codes == []
    assert load_deg(rig) == pytest.approx(target, abs=0.001)
    off(rig)


@pytest.mark.parametrize("inverted", [False, True])
def test_direction_and_zero_are_of_the_machine_file(inverted: bool) -> None:
    rig = BusRig(
        ring_machine(NODE, {"can.load_encoder.inverted": inverted, "can.load_encoder.zero_counts": -77}), 33.0
    )
    assert math.degrees(rig.drive.read().pos_ring_rad) == pytest.approx(load_deg(rig), abs=0.0005)
    rig.engine.close()


@pytest.mark.slow
def test_a_wrong_direction_stops_the_axis_within_the_reach_of_the_loop() -> None:
    """At power-up both encoders are 66 deg apart: the loop may move the load by its limit, not more."""
    # The angle that is told is wrong by the limit, and no angle may be told that is wrong by 0.05 deg.
    machine = ring_machine(NODE, {"control.compensation.load_encoder.limit_deg": 0.045})
    rig = BusRig(machine, 33.0)
    node, plant = rig.ring, rig.node.plant
    node._reading = lambda: -plant.ring_counts() % (1 << 26)
    rig.command(power=True)
    rig.run(3.0)
    assert rig.stops[0] in ("ENC-07", "CTL-03"), rig.told
    assert rig.way_deg(0) < 0.06
    rig.run(5.0)
    rig.engine.close()


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        ("silent", "CAN-16"),
        pytest.param("jump", "ENC-07", marks=pytest.mark.slow),
        pytest.param("alarm", "ENC-07", marks=pytest.mark.slow),
    ],
)
def test_a_ring_encoder_that_fails_stops_the_axis(spoil: str, code: str) -> None:
    rig = BusRig(ring_machine(NODE), 20.0).power_up().cruise(6.0)
    begun = len(rig.ticks)
    match spoil:
        case "silent":
            rig.ring.slave.silent = True
        case "jump":
            rig.ring.jump = round(0.2 / 360.0 * 2**26)
        case "alarm":
            rig.ring.alarm = True
    rig.run(6.0)
    assert rig.stops[0] == code, rig.told
    assert rig.axis.power.phase is PowerPhase.OFF
    # A reading that nobody believes, or none: seen after 50 ms at the most, then torque off and brake.
    assert rig.way_deg(begun - 1) < TORQUE_OFF_DEG[6.0] + 0.3
    rig.engine.close()


def test_a_late_reading_is_noticed_where_it_is_wrong_by_more_than_both_may_differ() -> None:
    """20 ms at 6 deg/s are 0.12 deg; both encoders may differ by 0.05 deg."""
    rig = BusRig(ring_machine(NODE), 20.0).power_up().cruise(6.0)
    rig.ring.slave.tpdo[1] = frame_fault("delay", 5)
    rig.run(1.0)
    assert rig.stops[0] == "ENC-07", rig.told
    assert not rig.axis.feedback.position_valid
    rig.run(3.0)
    rig.engine.close()


@pytest.mark.slow
def test_a_frozen_ring_encoder_is_noticed() -> None:
    rig = BusRig(ring_machine(NODE), 20.0).power_up().cruise(3.0)
    rig.ring.frozen = True
    rig.run(1.0)
    assert rig.stops[0] == "ENC-07", rig.told
    rig.run(6.0)
    rig.engine.close()


@pytest.mark.slow
def test_telegrams_missed_for_24_ms_stop_nothing() -> None:
    rig = BusRig(ring_machine(NODE), 20.0).power_up().cruise(6.0)
    rig.ring.slave.silent = True
    rig.run(0.024)
    rig.ring.slave.silent = False
    rig.run(1.0)
    assert rig.codes == []
    off(rig)


def test_an_encoder_with_too_few_steps_is_refused() -> None:
    machine = ring_machine(NODE)
    link, drive, _ = virtual_bus(with_values(machine, {"can.load_encoder.counts_per_turn": 2**20}))
    with pytest.raises(DeviceError, match="6501, 6502"):
        CanopenDrive(link, canopen_settings(machine), drive).open()
