"""What reading blocks, cams and probes show one way they show the other way too, and nothing where nobody knows."""

from __future__ import annotations

import pytest

from gantryctl.image import DriveState, EncoderFlag
from gantryctl.program.blocks import (
    Cam,
    DigitalCamSwitch,
    ReadActualPosition,
    ReadAxisInfo,
    ReadMotionState,
    TouchProbe,
)
from gantryctl.units import rad
from unit.program.rig import Rig, powered

BOTH = pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])


@BOTH
def test_the_motion_state_is_that_of_the_way(way: float) -> None:
    """20 deg at 6 deg/s with 4 deg/s2: 1.5 s up, as long down, 3.33 s in all plus 1.5."""
    rig = powered()
    block = ReadMotionState(rig.axis)
    rig.move(way * 20.0)
    seen = []
    for _ in range(5):
        block()
        name = "up" * block.accelerating + "on" * block.constant_velocity + "down" * block.decelerating
        seen.append((name, block.direction_positive, block.direction_negative))
        rig.run(1.0)
    assert [name for name, _, _ in seen] == ["up", "up", "on", "on", "down"]
    assert all((plus, minus) == (way > 0.0, way < 0.0) for _, plus, minus in seen[1:])


def test_an_angle_in_doubt_is_not_valid_and_no_probe_takes_it() -> None:
    rig = powered()
    position, probe = ReadActualPosition(rig.axis), TouchProbe(rig.axis)
    probe(execute=True, trigger=False)
    position()
    assert position.valid
    rig.spoil = lambda drive: drive._replace(encoder=EncoderFlag.ALARM)
    rig.run(0.01)
    position()
    assert not position.valid
    probe(execute=True, trigger=True)
    assert probe.busy
    assert not probe.done


def test_a_drive_that_is_not_heard_is_not_ready() -> None:
    rig = Rig()
    info = ReadAxisInfo(rig.axis)
    rig.run(0.1)
    info()
    assert info.communication_ready
    assert info.ready_for_power_on
    rig.spoil = lambda drive: drive._replace(state=DriveState.UNKNOWN)
    rig.run(0.1)
    info()
    assert not info.communication_ready
    assert not info.ready_for_power_on


def switched(rig: Rig, cams: DigitalCamSwitch, target_deg: float) -> list[float]:
    """Angles at which the output changes on the way to a target."""
    found, before = [], cams.outputs[0]
    rig.move(target_deg)
    for _ in range(6000):
        rig.step()
        cams()
        if cams.outputs[0] is not before:
            before = cams.outputs[0]
            found.append(rig.pos_deg)
    return found


@BOTH
def test_a_time_cam_is_passed_either_way(way: float) -> None:
    """From 10 deg on for half a second, at 6 deg/s as far as 13 deg on the way there."""
    rig = powered()
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(way * 10.0), 0.0, duration_s=0.5)]])
    cams()
    assert switched(rig, cams, way * 20.0) == pytest.approx([way * 10.0, way * 13.0], abs=0.02)
    assert switched(rig, cams, 0.0) == pytest.approx([way * 10.0, way * 7.0], abs=0.02)


@BOTH
def test_a_cam_that_is_on_goes_off_so_far_outside_at_either_edge(way: float) -> None:
    """On between 8 and 12 deg; with a hysteresis of 1 deg off at 13 on the way up, and at 7 on the way down."""
    rig = powered()
    edges = sorted((way * 8.0, way * 12.0))
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(edges[0]), rad(edges[1]))]], hysteresis_rad=rad(1.0))
    cams()
    assert switched(rig, cams, way * 20.0) == pytest.approx([way * 8.0, way * 13.0], abs=0.02)
    assert switched(rig, cams, 0.0) == pytest.approx([way * 12.0, way * 7.0], abs=0.02)


def test_the_noise_of_a_reading_at_rest_is_no_direction() -> None:
    """0.005 deg/s to and fro of a drive that stands, after a way forwards."""
    from gantryctl.program.blocks.cam_switch import CamDirection

    rig = powered()
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(5.0), rad(20.0), CamDirection.POSITIVE)]])
    switched(rig, cams, 10.0)
    assert cams.outputs == (True,)
    for scan in range(100):
        noise = rad(0.005) * 1144.0 * (-1.0) ** scan
        rig.spoil = lambda drive, noise=noise: drive._replace(vel_act_rad_s=noise)
        rig.step()
        cams()
        assert cams.outputs == (True,)
