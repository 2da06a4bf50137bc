"""The stop behind a failed program, scan by scan: what holds a load holds it on, and nothing else keeps its torque."""

from __future__ import annotations

import pytest

from gantryctl.image import (
    DriveFeedback,
    DriveRequest,
    DriveState,
    EncoderFlag,
    InputImage,
    OperatorCommand,
    OutputImage,
)
from gantryctl.runtime.stopping import REFERENCE_STOP, StopProgram, stop_output

HELD = OutputImage(DriveRequest.ENABLE, 0.0, 27.0, brake_open=False, horn=True, torque_holds=True)
ON, QUICK, OFF = DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.SWITCH_ON_DISABLED
GONE = OutputImage(horn=True)


def seen(time_s: float, state: DriveState, motor_rad_s: float = 0.0, torque_nm: float = 27.0) -> InputImage:
    drive = DriveFeedback(state, 0, motor_rad_s, torque_nm, False, False, 0.0, EncoderFlag.NONE)
    return InputImage(0, time_s, drive, OperatorCommand())


def holding() -> StopProgram:
    program = StopProgram(stop_output(HELD), (), REFERENCE_STOP)
    assert program.scan(seen(0.0, ON)) == stop_output(HELD)
    return program


@pytest.mark.parametrize(
    ("last", "then"),
    [
        (HELD, HELD._replace(lamp=True)),
        (HELD._replace(request=DriveRequest.QUICK_STOP), HELD._replace(request=DriveRequest.QUICK_STOP, lamp=True)),
        # HOLD has no speed, no open brake and no target that was reached.
        (HELD._replace(vel_cmd_rad_s=3.0, brake_open=True, in_position=True, at_rest=True), HELD._replace(lamp=True)),
        # The liars: torque off, and torque on a brake that is trusted.
        (HELD._replace(request=DriveRequest.DISABLE), OutputImage(DriveRequest.QUICK_STOP)),
        (HELD._replace(request=DriveRequest.FAULT_RESET), OutputImage(DriveRequest.QUICK_STOP)),
        (HELD._replace(torque_holds=False), OutputImage(DriveRequest.QUICK_STOP)),
        (OutputImage(DriveRequest.ENABLE, 5.0, 27.0, True), OutputImage(DriveRequest.QUICK_STOP, brake_open=True)),
    ],
)  # fmt: skip
def test_what_a_drive_is_told_as_its_program_fails(last: OutputImage, then: OutputImage) -> None:
    assert stop_output(last) == then


@pytest.mark.parametrize("state", [ON, QUICK, DriveState.UNKNOWN])
def test_torque_is_held_on_for_hours_while_the_drive_gives_it_or_is_not_heard(state: DriveState) -> None:
    program = holding()
    for time_s in (0.3, 0.35, 3.0, 3.1, 36_000.0):
        assert program.scan(seen(time_s, state)) == stop_output(HELD)
    assert program.holding


@pytest.mark.parametrize("state", [DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE, OFF])
def test_a_drive_that_has_let_go_is_asked_for_no_torque_any_more(state: DriveState) -> None:
    program = holding()
    assert program.scan(seen(0.1, state)) == GONE
    assert not program.holding
    # Nor when it comes back by itself.
    assert program.scan(seen(0.2, ON)) == GONE


@pytest.mark.parametrize(("time_s", "holds"), [(2.9, True), (3.0, False)])
def test_a_drive_on_its_way_to_torque_has_the_time_of_a_ramp(time_s: float, holds: bool) -> None:
    """3 s; HOLD had just begun as the program failed."""
    program = StopProgram(stop_output(HELD), (), REFERENCE_STOP)
    assert program.scan(seen(0.0, OFF)) == stop_output(HELD)
    program.scan(seen(time_s, DriveState.SWITCHED_ON))
    assert program.holding is holds


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("speeds", "torque_nm", "holds"),
    [
        # From 5 rad/s of the motor on, 50 ms and no slower: torque that drives the load.
        ([6.0, 7.0, 8.0, 9.0, 10.0], 27.0, False),
        ([6.0, 7.0, 8.0, 9.0], 27.0, True),
        ([6.0, 7.0, 8.0, 9.0, 8.5, 9.0, 10.0], 27.0, True),
        ([4.9] * 9, 27.0, True),
        # A load that torque slows, whatever its speed.
        ([6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0], -27.0, True),
    ],
)
def test_torque_that_drives_the_load_is_taken_off(
    way: float, speeds: list[float], torque_nm: float, holds: bool
) -> None:
    program = holding()
    for number, speed in enumerate(speeds, 1):
        program.scan(seen(0.01 * number, ON, way * speed, way * torque_nm))
    assert program.holding is holds
