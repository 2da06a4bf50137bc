"""The ideal drive: the angle is the integral of the speed command, to the bit."""

from __future__ import annotations

import math

import pytest

from gantryctl.drives.ideal import IdealDrive
from gantryctl.image import DriveRequest, OutputImage
from gantryctl.machine import default_machine, with_values
from gantryctl.wiring.simulator import ideal_drive

IDEAL = with_values(default_machine(), {"drive.kind": "ideal"})


def enabled() -> IdealDrive:
    drive = ideal_drive(IDEAL, 15.0)
    for _ in range(3):
        drive.write(OutputImage(DriveRequest.ENABLE))
    return drive


def test_it_stands_where_it_is_put() -> None:
    assert math.degrees(ideal_drive(IDEAL, -33.0).pos_rad) == pytest.approx(-33.0)


def test_the_angle_is_the_integral_of_the_speed() -> None:
    drive = enabled()
    vel = math.radians(2.0) * IDEAL.axis.ratio
    for _ in range(500):
        drive.write(OutputImage(DriveRequest.ENABLE, vel, brake_open=True))
    assert math.degrees(drive.pos_rad) == pytest.approx(16.0, abs=1e-9)
    assert drive.read().vel_act_rad_s == vel


def test_against_its_brake_it_stands() -> None:
    drive = enabled()
    drive.write(OutputImage(DriveRequest.ENABLE, 100.0, brake_open=False))
    assert drive.read().vel_act_rad_s == 0.0


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_quick_stop_has_the_deceleration_of_the_machine_file(sign: float) -> None:
    drive = enabled()
    vel = sign * math.radians(5.4) * IDEAL.axis.ratio
    drive.write(OutputImage(DriveRequest.ENABLE, vel, brake_open=True))
    scans = 0
    while drive.vel_rad_s != 0.0:
        drive.write(OutputImage(DriveRequest.QUICK_STOP, brake_open=True))
        scans += 1
    assert scans * 1e-3 == pytest.approx(5.4 / IDEAL.virtual_axis.quick_dec_deg_s2, abs=2e-3)


def test_a_drive_that_is_off_has_no_torque() -> None:
    drive = enabled()
    told = []
    for request in (DriveRequest.ENABLE, DriveRequest.QUICK_STOP, DriveRequest.DISABLE):
        drive.write(OutputImage(request, torque_ff_nm=12.0))
        told.append(drive.read().torque_act_nm)
    assert told == [12.0, 12.0, 0.0]


def test_whole_counts_only() -> None:
    assert float(enabled().read().pos_act_counts).is_integer()
