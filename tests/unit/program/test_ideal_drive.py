"""The ideal drive: the port's promises, and that it does exactly what it is told."""

import pytest

from gantryctl.drives.ideal import IdealDrive
from gantryctl.image import DigitalInputs, DriveRequest, DriveState, OutputImage
from gantryctl.ports import Drive
from gantryctl.units import deg, rad
from unit.program.rig import COUNTS_PER_TURN, RATIO


@pytest.fixture
def drive():
    return IdealDrive(0.001, COUNTS_PER_TURN, RATIO, pos_rad=rad(10.0))


def enable(drive, **output):
    for _ in range(4):
        drive.write(OutputImage(DriveRequest.ENABLE, brake_open=True, **output))


def test_it_is_a_drive(drive):
    assert isinstance(drive, Drive)
    assert drive.identity().counts_per_turn == COUNTS_PER_TURN


def test_it_walks_the_states_one_a_scan(drive):
    seen = [drive.read().state]
    for _ in range(4):
        drive.write(OutputImage(DriveRequest.ENABLE))
        seen.append(drive.read().state)
    assert seen == [2, 3, 4, 5, 5]


def test_it_integrates_the_speed(drive):
    enable(drive)
    for _ in range(1000):
        drive.write(OutputImage(DriveRequest.ENABLE, rad(2.0) * RATIO, 0.0, True))
    assert deg(drive.pos_rad) == pytest.approx(12.0, rel=1e-12)
    assert drive.read().vel_act_rad_s == rad(2.0) * RATIO


@pytest.mark.parametrize("brake_open", [True, False])
def test_it_does_not_move_unless_enabled_with_the_brake_open(drive, brake_open):
    for _ in range(100):
        drive.write(OutputImage(DriveRequest.DISABLE, 100.0, 0.0, brake_open))
    enable_closed = OutputImage(DriveRequest.ENABLE, 100.0, 0.0, False)
    for _ in range(100):
        drive.write(enable_closed)
    assert deg(drive.pos_rad) == pytest.approx(10.0)


def test_quick_stop_ramps_and_holds(drive):
    enable(drive, vel_cmd_rad_s=rad(6.0) * RATIO)
    drive.write(OutputImage(DriveRequest.ENABLE, rad(6.0) * RATIO, 0.0, True))
    before = drive.pos_rad
    for _ in range(2000):
        drive.write(OutputImage(DriveRequest.QUICK_STOP, 0.0, 0.0, True))
    assert deg(drive.pos_rad - before) == pytest.approx(36.0 / 11.0, abs=0.01)
    assert drive.state is DriveState.QUICK_STOP_ACTIVE


def test_faults_need_a_fault_reset(drive):
    enable(drive)
    drive.error_code = 1
    drive.write(OutputImage(DriveRequest.ENABLE))
    assert drive.state is DriveState.FAULT
    drive.write(OutputImage(DriveRequest.FAULT_RESET))
    assert drive.state is DriveState.SWITCH_ON_DISABLED


def test_emergency_stop_takes_the_torque_off(drive):
    enable(drive, torque_ff_nm=5.0)
    assert drive.read().torque_act_nm == 5.0
    drive.inputs = DigitalInputs(estop_ok=False)
    drive.write(OutputImage(DriveRequest.ENABLE, 1.0, 5.0, True))
    assert drive.read().torque_act_nm == 0.0
    assert not drive.read().brake_open


def test_close_twice(drive):
    enable(drive)
    drive.close()
    drive.close()
    assert drive.read().state is DriveState.SWITCH_ON_DISABLED
