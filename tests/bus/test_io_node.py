"""Inputs, outputs and the brake on an I/O node (CiA 401) beside the drive: what fails stops the true axis."""

from __future__ import annotations

import math
from typing import Any, cast

import pytest

from bus.bus_rig import CHECK_M, NOMINAL_M, QUICK_STOP_DEG, TORQUE_OFF_DEG, BusRig
from bus.io_machines import IO, ON_DRIVE, io_machine
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.errors import DeviceError
from gantryctl.machine import configs_folder, load_machine
from gantryctl.machine.rules.reaction import silent_angle_deg
from gantryctl.program import PowerPhase
from gantryctl.wiring.canopen import canopen_settings
from gantryctl.wiring.virtual import virtual_bus

pytestmark = pytest.mark.can


def rest(rig: BusRig, seconds: float = 5.0) -> None:
    """Off, braked and at rest, and it stays so."""
    rig.run(seconds)
    assert rig.axis.power.phase is PowerPhase.OFF, rig.axis.power.phase
    assert not rig.ticks[-1].brake_open
    assert rig.ticks[-1].state in (State.SWITCH_ON_DISABLED, State.FAULT)
    # Swing of the load against the closed brake: 0.01 deg/s on the motor side after six seconds.
    assert abs(rig.ticks[-1].vel_deg_s) < 0.02


def off(rig: BusRig) -> None:
    """Leave the axis without power."""
    rig.command(power=False, move=False, quick_stop=False)
    rig.run(4.0)
    rig.engine.close()


def reaction_scans(rig: BusRig, code: str) -> int:
    """SYNCs from now to the alarm, the first of them included."""
    for n in range(1, 100):
        rig.run(rig.machine.control.scan_period_ms * 1e-3)
        if code in rig.codes:
            return n
    raise AssertionError(rig.told)


@pytest.mark.parametrize("scan_ms", [1.0, 4.0, 10.0])
def test_an_input_acts_with_the_first_sync_after_it(scan_ms: float) -> None:
    """Sampled at SYNC, answered and judged in that scan: one scan, whatever its length, for each input."""
    rig = BusRig(io_machine(scan_ms), 20.0).power_up()
    rig.cruise(1.0)
    rig.inject("input", "off", name="motion_permit")
    assert reaction_scans(rig, "INT-08") == 1
    for name, code in (("door_ok", "INT-07"), ("collision_ok", "INT-01"), ("estop_ok", "INT-03")):
        rig.inject("input", "off", name=name)
        assert reaction_scans(rig, code) == 1, name
    rig.run(1.0)
    rig.engine.close()


@pytest.mark.parametrize(
    ("speed", "scan_ms"), [(6.0, 4.0), (-3.0, 10.0), pytest.param(1.0, 1.0, marks=pytest.mark.slow)]
)
def test_a_silent_node_is_a_quick_stop_and_its_brake_closes_by_itself(speed: float, scan_ms: float) -> None:
    rig = BusRig(io_machine(scan_ms, {"plant.load.eccentricity_m": NOMINAL_M}), 60.0).power_up().cruise(speed)
    begun = len(rig.ticks)
    rig.io.slave.silent = True
    rest(rig)
    assert rig.stops[0] == "CAN-16", rig.told
    assert "inputs and outputs" in rig.first_told
    assert rig.way_deg(begun - 1) < QUICK_STOP_DEG[abs(speed)]
    assert not rig.enabled_again(begun)
    # The node has seen that it hears no controller: the error value of the brake output is off.
    assert rig.levels["brake_release"] is False
    # Inputs of a lost node are not good, and no reset brings power back before it was set up again.
    assert not rig.drive.read().inputs.estop_ok
    rig.command(power=False, move=False)
    rig.command(reset=True)
    rig.run(0.5)
    assert "CAN-16" in {str(code) for code in rig.axis.alarms.active}
    rig.engine.close()


def test_a_node_that_restarts_loses_its_outputs_and_the_axis_stops() -> None:
    rig = BusRig(io_machine(), 60.0).power_up().cruise(6.0)
    begun = len(rig.ticks)
    rig.io.boot()
    # By its boot-up message, long before its telegrams are missed.
    assert reaction_scans(rig, "CAN-16") == 1
    rest(rig)
    assert rig.stops[0] == "CAN-16", rig.told
    # The brake closes at once, against the drive's ramp: shorter than torque off and brake.
    assert rig.way_deg(begun - 1) < TORQUE_OFF_DEG[6.0]
    assert rig.drive.lost
    rig.drive.set_up_again()
    rig.command(power=False, move=False, reset=True)
    rig.run(0.5)
    rig.command(reset=False)
    assert not rig.axis.alarms.active, rig.told
    rig.power_up()
    off(rig)


def test_a_node_that_is_dead_leaves_no_fault_in_the_drive_when_the_controller_leaves() -> None:
    """The drive is off and answers: 1016 = 0, so that it does not miss a controller that has left."""
    rig = BusRig(io_machine())
    rig.run(0.1)
    rig.io.slave.silent = True
    rig.run(0.1)
    rig.engine.close()
    assert rig.node.od.number(0x1016, 1) == 0


def test_telegrams_missed_for_less_than_30_ms_stop_nothing() -> None:
    rig = BusRig(io_machine(), 60.0).power_up().cruise(3.0)
    rig.io.slave.silent = True
    rig.run(0.024)
    rig.io.slave.silent = False
    rig.run(1.0)
    assert rig.codes == []
    off(rig)


def test_outputs_show_what_the_axis_does() -> None:
    rig = BusRig(io_machine(), 20.0)
    rig.run(0.1)
    assert not any(rig.levels[name] for name in ("brake_release", "lamp", "in_position", "horn"))
    rig.power_up().run(1.0)
    assert {name for name, on in rig.levels.items() if on} == {
        "brake_release",
        "lamp",
        "in_position",
        "at_rest",
    }
    rig.cruise(3.0)
    assert {name for name, on in rig.levels.items() if on} == {"brake_release", "lamp"}
    # The set-point is at rest at once, the motor is not.
    rig.command(move=False, quick_stop=True)
    rig.run(0.2)
    assert not rig.levels["at_rest"]
    rig.command(power=False, quick_stop=False)
    rig.run(4.0)
    assert not any(rig.levels[name] for name in ("brake_release", "lamp", "horn")), rig.levels
    assert rig.levels["at_rest"]
    rig.engine.close()


def test_the_horn_sounds_where_a_closed_brake_lets_the_load_go() -> None:
    rig = BusRig(io_machine(changes={"plant.load.eccentricity_m": CHECK_M}), 90.0)
    rig.run(0.2)
    rig.inject("brake", "torque", share=0.02)
    rig.run(4.0)
    assert rig.levels["horn"], rig.told
    rig.node.faults.brake_torque_share = 1.0
    rig.engine.close()


def test_outputs_without_effect_keep_the_brake_closed() -> None:
    rig = BusRig(io_machine(), 20.0)
    rig.io.outputs_dead = True
    rig.command(power=True)
    rig.run(4.0)
    assert rig.stops[0] == "BRK-01", rig.told
    assert not rig.ticks[-1].brake_open
    rig.engine.close()


@pytest.mark.slow
def test_a_brake_relay_that_welds_is_told_and_the_load_stays() -> None:
    rig = BusRig(io_machine(), 60.0).power_up().cruise(3.0)
    rig.io.outputs_dead = True
    rig.command(move=False, quick_stop=True)
    rig.run(8.0)
    assert "BRK-06" in rig.codes, rig.told
    # The drive gives the torque back (HOLD): the load does not fall through the open brake.
    assert abs(rig.ticks[-1].vel_deg_s) < 0.05
    assert rig.levels["horn"] is False
    rig.io.outputs_dead = False
    rig.engine.close()


@pytest.mark.parametrize("where", ["node", pytest.param("drive", marks=pytest.mark.slow)])
def test_a_controller_that_dies_leaves_a_braked_axis(where: str) -> None:
    """Not one frame more: the drive ramps by its own watch, the brake output falls by itself."""
    changes: dict[str, object] = (
        dict.fromkeys(IO, -1) | {"can.io.node": 0} | ON_DRIVE if where == "drive" else {}
    )
    rig = BusRig(io_machine(changes=changes), 60.0).power_up().cruise(6.0)
    begun = len(rig.ticks)
    for _ in range(6000):
        rig.drive.link.pause(0.001)
    assert not rig.ticks[-1].brake_open
    assert rig.ticks[-1].state is State.FAULT
    assert abs(rig.ticks[-1].vel_deg_s) < 0.02
    # 1400:05 after 50 ms, then the ramp; a brake on the node closes 150 ms after the last heartbeat and helps.
    assert rig.way_deg(begun - 1) < 4.0
    rig.engine.close()


@pytest.mark.parametrize(
    "place", ["can.io.outputs.watchdog", pytest.param("can.outputs.watchdog", marks=pytest.mark.slow)]
)
def test_a_watchdog_relay_stops_the_axis_of_a_dead_controller(place: str) -> None:
    """A drive without 1016 and 1400:05 goes on at its last speed; the relay ends it within the computed way."""
    machine = io_machine(changes={place: 20, "can.virtual_drive": "unwatched"})
    rig = BusRig(machine, 60.0).power_up().cruise(6.0)
    begun = len(rig.ticks)
    for _ in range(5000):
        rig.drive.link.pause(0.001)
    assert abs(rig.ticks[-1].vel_deg_s) < 0.02
    assert not rig.ticks[-1].brake_open
    assert rig.way_deg(begun - 1) < silent_angle_deg(machine, machine.can.watchdog_ms, brake=True)
    rig.engine.close()


@pytest.mark.slow
def test_without_the_relay_such_a_drive_goes_on(oracle: Oracle) -> None:
    """The test above can fail. The brake on the node closes against the drive, which does not care."""
    machine = io_machine(changes={"can.virtual_drive": "unwatched"})
    rig = BusRig(machine, 60.0).power_up().cruise(3.0)
    begun = len(rig.ticks)
    for _ in range(5000):
        rig.drive.link.pause(0.001)
    assert rig.ticks[-1].state is State.ENABLED
    assert rig.ticks[-1].torque_nm > 100.0 or rig.way_deg(begun - 1) > 4.0
    assert oracle.caught("INV-1")
    rig.engine.close()


@pytest.mark.parametrize("relay", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_relay_takes_the_torque_of_a_drive_that_keeps_it(relay: bool) -> None:
    """D3: told after 0.2 s; no edges from then on, so the relay opens 0.1 s later. Without one the torque stays."""
    machine = io_machine(changes={"can.io.outputs.watchdog": 20} if relay else {})
    rig = BusRig(machine, 60.0).power_up()
    rig.inject("drive", "stuck_state")
    rig.command(power=False)
    rig.until(lambda: "DRV-03" in rig.codes, 3.0)
    rig.run(0.2)
    assert (rig.ticks[-1].state is State.SWITCH_ON_DISABLED) is relay
    assert not rig.ticks[-1].brake_open
    rig.engine.close()


def test_the_brake_test_works_with_an_output_of_the_controller() -> None:
    rig = BusRig(io_machine(), 20.0)
    rig.run(0.2)
    rig.command(brake_test=True)
    rig.run(12.0)
    assert rig.axis.brake_test.result.outcome.name == "PASSED", rig.axis.brake_test.result
    rig.engine.close()


def opened(changes: dict[str, object], **spoilt: Any) -> CanopenDrive:
    machine = io_machine(changes=changes)
    link, drive, neighbours = virtual_bus(machine)
    assert neighbours.io is not None
    for name, value in spoilt.items():
        setattr(neighbours.io.slave, name, value)
    return CanopenDrive(link, canopen_settings(machine), drive).open()


def test_a_node_that_cannot_be_used_is_refused_at_the_start() -> None:
    with pytest.raises(DeviceError, match="node 3, I/O: its telegrams cannot be mapped"):
        opened({}, mapping_ignored=True)
    with pytest.raises(DeviceError, match="node 3 does not answer"):
        opened({}, silent=True)


def test_a_brake_on_a_node_without_error_values_is_refused() -> None:
    machine = io_machine()
    link, drive, neighbours = virtual_bus(machine)
    assert neighbours.io is not None
    # 6207 is not there: nobody knows what the outputs do when the controller is gone.
    cast("dict[int, object]", neighbours.io.slave.od.visible.objects).pop(0x6207)
    with pytest.raises(DeviceError, match=r"6207:01.*error value"):
        CanopenDrive(link, canopen_settings(machine), drive).open()


def test_everything_that_is_written_is_there() -> None:
    rig = BusRig(io_machine())
    od = rig.io.slave.od
    assert [od.number(0x6206, n) for n in (1, 2)] == [0xFF, 0xFF]
    assert [od.number(0x6207, n) for n in (1, 2)] == [0, 0]
    assert od.number(0x1016, 1) == 127 << 16 | 150
    assert od.number(0x1017) == 50
    assert math.isclose(od.number(0x1006), 4000)
    rig.engine.close()


def test_another_node_in_the_place_of_one_is_refused() -> None:
    rig = BusRig(io_machine())
    rig.run(0.1)
    rig.io.slave.boot()
    rig.io.slave.od.readers[0x1018, 4] = lambda: 99
    rig.run(0.1)
    assert rig.drive.lost
    with pytest.raises(DeviceError, match="another node"):
        rig.drive.set_up_again()
    rig.engine.close()


def test_the_example_machine_moves_its_load_to_where_it_is_told() -> None:
    machine = load_machine(configs_folder() / "hust_can_nodes.toml")
    rig = BusRig(machine, 20.0).power_up()
    rig.command(move=True, target_rad=math.radians(20.5), speed_rad_s=math.radians(1.0))
    rig.run(8.0)
    assert rig.codes == []
    # By the encoder on the ring: scale error 0.0005 deg, dead band 0.0001 deg.
    assert math.degrees(rig.node.truth()[0]) == pytest.approx(20.5, abs=0.001)
    health = rig.drive.health()
    assert [node.node for node in health.nodes] == [3, 4]
    assert all(node.missed == 0 for node in health.nodes)
    off(rig)


@pytest.mark.parametrize("scan_ms", [4.0, 10.0])
def test_the_brake_does_not_wait_for_the_heartbeat_of_a_drive_off_the_bus(scan_ms: float) -> None:
    """At standstill the drive takes its torque off 60 ms after its last command, and nobody hears of it.

    Neither torque nor brake for 126 and 140 ms, which were 214 and 230 while the brake waited for the heartbeat; 200 ms
    are permitted, the time in which a brake must close.
    """
    rig = BusRig(io_machine(scan_ms, {"plant.load.eccentricity_m": CHECK_M}), 60.0).power_up()
    begun = len(rig.ticks)
    rig.inject("frame", "drive_silent")
    rig.run(1.5)
    assert rig.stops[:2] == ["CAN-03", "CAN-06"], rig.told
    free_ms = sum(tick.brake_open and tick.state is State.FAULT for tick in rig.ticks[begun:])
    # A scan of 10 ms more than was measured.
    assert 0 < free_ms <= 150
    assert not rig.ticks[-1].brake_open
    # Of a fault at standstill.
    assert rig.way_deg(begun - 1) < 0.35
    rig.engine.close()
