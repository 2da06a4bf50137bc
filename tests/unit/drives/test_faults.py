"""Standing faults: the same names and the same meaning in the simulated drive and in the virtual one."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from gantryctl.drives.faults import BUS_ONLY, Faults, default_of, names, set_fault
from gantryctl.errors import UsageError
from gantryctl.image import DriveRequest, DriveState, EncoderFlag, LinkFlag, OutputImage
from gantryctl.machine import Machine, default_machine
from gantryctl.wiring.simulator import sim_drive
from unit.drives.virtual.bench import ENABLE, QUICK_STOP, Bench

MACHINE = default_machine()
RATIO = MACHINE.axis.ratio


class Shown(NamedTuple):
    """What a drive tells, and what is true."""

    angle_deg: float
    speed_deg_s: float
    torque_nm: float
    brake_contact_open: bool
    load_deg: float
    load_deg_s: float
    brake_open: bool


class InProcess:
    """Simulated drive, enabled at a speed."""

    def __init__(self, angle_deg: float, machine: Machine = MACHINE) -> None:
        self.drive = sim_drive(machine, angle_deg)

    def inject(self, name: str, value: Any) -> None:
        set_fault(self.drive.faults, name, value)

    def run(self, seconds: float, speed_deg_s: float, request: DriveRequest = DriveRequest.ENABLE) -> Shown:
        output = OutputImage(request, math.radians(speed_deg_s) * RATIO, brake_open=True)
        for _ in range(round(seconds / 1e-3)):
            self.drive.write(output)
        seen, truth = self.drive.read(), self.drive.truth()
        turns = seen.pos_act_counts / self.drive.identity().counts_per_turn
        return Shown(
            turns * 360.0 / RATIO,
            math.degrees(seen.vel_act_rad_s) / RATIO,
            seen.torque_act_nm,
            seen.brake_open,
            math.degrees(truth[0]),
            math.degrees(truth[1]),
            self.drive.sim.state["brake_closed"] == 0.0,
        )

    def quick_stop(self, seconds: float) -> Shown:
        return self.run(seconds, 0.0, DriveRequest.QUICK_STOP)


class OnBus:
    """Virtual drive behind frames, enabled at a speed."""

    def __init__(self, angle_deg: float) -> None:
        self.bench = Bench(angle_rad=math.radians(angle_deg)).set_up()
        self.bench.enable()

    def inject(self, name: str, value: Any) -> None:
        self.bench.inject(name, value)

    def run(self, seconds: float, speed_deg_s: float, word: int = ENABLE) -> Shown:
        bench = self.bench
        seen = bench.run(seconds, word, bench.turn(speed_deg_s))
        per_turn = bench.node.scaling.counts_per_turn
        return Shown(
            seen.position / per_turn * 360.0 / RATIO,
            bench.deg_s(seen.velocity),
            bench.node.scaling.nm(bench.up(0x6077)),
            bool(bench.up(0x60FD) & 1 << 19),
            bench.load_deg,
            bench.load_deg_s,
            bench.node.plant.brake_open,
        )

    def quick_stop(self, seconds: float) -> Shown:
        return self.run(seconds, 0.0, QUICK_STOP)


@pytest.fixture(params=[InProcess, OnBus])
def drive_at(request: pytest.FixtureRequest) -> Callable[[float], InProcess | OnBus]:
    return request.param


def turning(drive: InProcess | OnBus, deg_s: float = 1.0) -> InProcess | OnBus:
    drive.run(0.5, 0.0)
    # In one step: how the load gets to its speed is of no interest here.
    drive.run(2.0, deg_s)
    return drive


def test_a_frozen_reading_is_of_the_reading_alone(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = turning(drive_at(0.0))
    drive.inject("freeze_position", True)
    first = drive.run(0.02, 1.0)
    later = drive.run(1.0, 1.0)
    assert (later.angle_deg, later.speed_deg_s) == (first.angle_deg, 0.0)
    # The load swings at its first mode by some tenths of a degree a second after a step of the command.
    assert later.load_deg_s == pytest.approx(1.0, abs=0.3)


def test_a_frozen_encoder_fools_the_speed_loop_of_the_drive(
    drive_at: Callable[..., InProcess | OnBus],
) -> None:
    drive = turning(drive_at(0.0))
    drive.inject("encoder_gain", 0.0)
    first = drive.run(0.02, 1.0)
    later = drive.run(1.0, 1.0)
    # One count of the reading: where it froze lies between two.
    assert later.angle_deg == pytest.approx(first.angle_deg, abs=1e-4)
    # The loop sees no motion and raises the torque: 1 deg/s is far behind after a second.
    assert later.load_deg_s > 2.0


def test_an_encoder_that_slips_shows_less_than_the_shaft_turns(
    drive_at: Callable[..., InProcess | OnBus],
) -> None:
    drive = turning(drive_at(0.0))
    drive.inject("encoder_gain", 0.9)
    drive.run(3.0, 1.0)
    before = drive.run(0.02, 1.0)
    after = drive.run(5.0, 1.0)
    shown, true = after.angle_deg - before.angle_deg, after.load_deg - before.load_deg
    # The swing of the load, 0.02 deg of 5.
    assert shown / true == pytest.approx(0.9, abs=0.01)
    drive.inject("encoder_gain", 1.0)
    assert drive.run(1.0, 1.0).angle_deg - after.angle_deg == pytest.approx(1.0, abs=0.02)


def test_a_speed_reading_is_of_the_reading_alone(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = turning(drive_at(0.0))
    drive.inject("velocity_reading", math.radians(-2.5) * RATIO)
    seen = drive.run(1.0, 1.0)
    assert seen.speed_deg_s == pytest.approx(-2.5, abs=0.001)
    assert seen.load_deg_s == pytest.approx(1.0, abs=0.3)


def test_a_torque_reading_is_of_the_reading_alone(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = drive_at(0.0)
    before = drive.run(1.0, 0.0)
    drive.inject("torque_offset", 100.0)
    after = drive.run(1.0, 0.0)
    assert after.torque_nm - before.torque_nm == pytest.approx(100.0, abs=1.0)
    assert after.load_deg == pytest.approx(before.load_deg, abs=1e-3)


def test_a_drive_with_less_torque_falls_behind(drive_at: Callable[..., InProcess | OnBus]) -> None:
    """1 % of the limit of the reference machine is 3.9 N m: less than the friction of its gears."""
    drive = turning(drive_at(0.0))
    assert drive.run(1.0, 1.0).torque_nm > 3.9
    drive.inject("torque_limit_share", 0.01)
    slow = drive.run(3.0, 1.0)
    assert abs(slow.torque_nm) <= 3.9
    assert slow.load_deg_s < 0.5


def test_a_weak_brake_slips(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = drive_at(90.0)
    drive.run(1.0, 0.0)
    drive.inject("brake_torque_share", 0.0)
    drive.inject("no_torque", True)
    drive.inject("brake", "closed")
    slipping = drive.run(1.0, 0.0)
    assert not slipping.brake_open
    # Slow, for the friction of the gears holds nearly all of it; a brake that holds lets nothing move.
    assert abs(slipping.load_deg_s) > 0.02


def test_a_slow_brake_closes_later(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = drive_at(0.0)
    assert drive.run(1.0, 0.0).brake_open
    drive.inject("brake_close_slow_s", 0.5)
    drive.inject("brake", "closed")
    assert drive.run(0.5, 0.0).brake_open
    # The closing time of the reference machine is 200 ms.
    assert not drive.run(0.25, 0.0).brake_open


def test_contact_and_brake_are_apart(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = drive_at(0.0)
    drive.run(1.0, 0.0)
    drive.inject("brake_feedback", True)
    drive.inject("brake", "closed")
    seen = drive.run(1.0, 0.0)
    assert seen.brake_contact_open
    assert not seen.brake_open


def test_commands_that_are_not_followed(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = turning(drive_at(0.0))
    drive.inject("ignore_target", True)
    assert drive.run(1.0, 0.0).load_deg_s == pytest.approx(1.0, abs=0.3)
    drive.inject("ignore_target", False)
    drive.inject("command_sign", -1)
    drive.run(2.0, 1.0)
    assert drive.run(1.0, 1.0).load_deg_s == pytest.approx(-1.0, abs=0.3)
    drive.inject("command_sign", 1)
    drive.inject("never_move", True)
    drive.run(2.0, 1.0)
    assert drive.run(1.0, 1.0).load_deg_s == pytest.approx(0.0, abs=0.3)


def test_a_quick_stop_that_is_not_obeyed_goes_on(drive_at: Callable[..., InProcess | OnBus]) -> None:
    drive = turning(drive_at(0.0))
    drive.inject("quick_stop_off", True)
    assert drive.quick_stop(1.0).load_deg_s == pytest.approx(1.0, abs=0.3)


def test_what_the_simulated_drive_only_tells() -> None:
    drive = sim_drive(MACHINE)
    faults = drive.faults
    before = drive.read().pos_act_counts
    faults.position_offset, faults.warning, faults.limit_plus_ok = 5000, True, False
    set_fault(faults, "encoder_flags", int(EncoderFlag.CRC_ERROR))
    seen = drive.read()
    assert seen.pos_act_counts - before == 5000
    assert (seen.warning, seen.inputs.limit_plus_ok, seen.encoder) == (True, False, EncoderFlag.CRC_ERROR)
    for name in names():
        set_fault(faults, name, default_of(name))
    assert drive.read().pos_act_counts == before


def test_a_stuck_state_obeys_nothing_but_the_power() -> None:
    drive = InProcess(0.0)
    drive.run(0.1, 0.0)
    drive.inject("stuck_state", True)
    drive.run(0.1, 0.0, DriveRequest.DISABLE)
    assert drive.drive.state is DriveState.OPERATION_ENABLED
    drive.inject("ignore_target", True)
    assert drive.drive.read().link is LinkFlag.IGNORES_COMMAND
    drive.inject("mains_ready", False)
    drive.run(0.01, 0.0)
    assert drive.drive.state is DriveState.SWITCH_ON_DISABLED
    # Nor a reset, with the power or without: its fault stays.
    drive.inject("mains_ready", True)
    drive.drive.trip(0x7500)
    for request in (DriveRequest.ENABLE, DriveRequest.FAULT_RESET, DriveRequest.FAULT_RESET):
        drive.run(0.001, 0.0, request)
    assert (drive.drive.state, drive.drive.error_code) == (DriveState.FAULT, 0x7500)
    drive.inject("stuck_state", False)
    drive.run(0.001, 0.0, DriveRequest.FAULT_RESET)
    assert (drive.drive.state, drive.drive.error_code) == (DriveState.SWITCH_ON_DISABLED, 0)


def test_a_fault_that_is_over_leaves_no_trace() -> None:
    """A drive that was made anew with another torque limit and back goes on bit for bit as one that never was."""
    spoilt, sound = InProcess(30.0), InProcess(30.0)
    for drive in (spoilt, sound):
        drive.run(1.0, 0.5)
    spoilt.inject("torque_limit_share", 0.99)
    spoilt.inject("brake_close_slow_s", 0.1)
    for drive in (spoilt, sound):
        drive.run(0.2, 0.5)
    spoilt.inject("torque_limit_share", 1.0)
    spoilt.inject("brake_close_slow_s", 0.0)
    assert spoilt.run(1.0, 0.5) == sound.run(1.0, 0.5)
    assert spoilt.drive.plant_state() == sound.drive.plant_state()
    assert not spoilt.drive.faults.spoilt


def test_the_load_changes_under_way() -> None:
    drive = InProcess(90.0)
    before = drive.run(1.0, 0.0)
    drive.drive.change_plant("eccentric_moment_nm", 0.0)
    after = drive.run(2.0, 0.0)
    assert abs(before.torque_nm) > 10.0
    assert abs(after.torque_nm) < 0.5 * abs(before.torque_nm)
    with pytest.raises(UsageError, match="no parameter 'colour'"):
        drive.drive.change_plant("colour", 1.0)


def test_the_names_of_faults_in_force_are_kept() -> None:
    faults = Faults()
    assert not faults.spoilt
    faults.brake = "open"
    faults.velocity_reading = 3.0
    assert faults.spoilt == {"brake", "velocity_reading"}
    faults.brake = None
    assert faults.spoilt == {"velocity_reading"}
    assert set(names()) >= BUS_ONLY
    for name, value in (("encoder_gain", math.nan), ("encoder_gain", math.inf), ("brake_torque_share", 1.5)):
        with pytest.raises(UsageError, match=name):
            set_fault(faults, name, value)


@pytest.mark.parametrize(
    ("name", "bit", "good"),
    [
        ("estop_ok", 16, 1),
        ("enabling_switch", 17, 1),
        ("mains_ready", 18, 1),
        ("limit_minus_ok", 0, 0),
        ("limit_plus_ok", 1, 0),
        ("collision_ok", 20, 1),
        ("door_ok", 21, 1),
        ("estop_ok_2", 22, 1),
        ("motion_permit", 24, 1),
    ],
)
def test_each_input_can_be_off_alone(name: str, bit: int, good: int) -> None:
    on_bus, drive = OnBus(0.0), sim_drive(MACHINE)
    before, sound = on_bus.bench.up(0x60FD), drive.read().inputs
    # The last four are not on every machine: a simulated drive does not have them until a fault says otherwise.
    assert (before >> bit & 1, getattr(sound, name)) == (good, True if bit < 20 else None)
    on_bus.inject(name, False)
    set_fault(drive.faults, name, False)
    # Bit 3 is the interlock: the emergency stop of a virtual drive.
    others = ~(1 << bit | 1 << 3)
    assert on_bus.bench.up(0x60FD) >> bit & 1 == 1 - good
    assert on_bus.bench.up(0x60FD) & others == before & others
    assert drive.read().inputs == sound._replace(**{name: False})


def test_the_sensor_of_the_motor_shows_what_it_is_told_to() -> None:
    drive = sim_drive(default_machine())
    assert drive.read().motor_temp_c is None
    set_fault(drive.faults, "motor_temp_c", 156.0)
    assert drive.read().motor_temp_c == 156.0
