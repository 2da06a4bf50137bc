"""The words of a stop: commanded until the drive has shown it, and nothing of a turning axis that is not so."""

from __future__ import annotations

import pytest

from gantryctl.image import DriveFeedback, DriveState, StopCause, SystemStop
from gantryctl.program import Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.table import ALARMS
from gantryctl.units import rad
from unit.program.rig import COUNTS_PER_DEG, RATIO, Rig

OFF = DriveState.SWITCH_ON_DISABLED
SPEED_DEG_S = 3.0
UNCONFIRMED = "commanded, not confirmed: press the emergency stop"


def moving() -> Rig:
    rig = Rig()
    rig.power_up()
    rig.move(90.0, SPEED_DEG_S)
    rig.run(2.0)
    assert not rig.codes
    return rig


def running_on(rig: Rig, **said: object):
    """A drive that says anything, and turns on at the speed of before."""
    assert rig.image is not None
    begun, counts = rig.scan, rig.image.drive.pos_act_counts

    def spoil(drive: DriveFeedback) -> DriveFeedback:
        way_deg = SPEED_DEG_S * (rig.scan - begun) * rig.period_s
        return drive._replace(
            pos_act_counts=counts + way_deg * COUNTS_PER_DEG, vel_act_rad_s=rad(SPEED_DEG_S) * RATIO, **said
        )

    return spoil


def raise_(rig: Rig, reaction: Reaction) -> str:
    """An alarm of a class, and its words in the scan in which it was raised."""
    if reaction is Reaction.QUICK_STOP:
        rig.op(quick_stop=True)
    else:
        rig.axis.alarms.raise_(Code.CTL_02, reaction, measured="a test")
        rig.step()
    assert rig.first is not None
    return rig.first.done


@pytest.mark.parametrize(
    ("reaction", "commanded", "shown"),
    [
        (Reaction.QUICK_STOP, "Quick stop commanded", "Quick stop, at rest after"),
        (Reaction.TORQUE_OFF, "Torque off and brake commanded", "orque off after"),
    ],
)
def test_what_is_commanded_is_told_as_that_until_it_is_shown(
    reaction: Reaction, commanded: str, shown: str
) -> None:
    rig = moving()
    assert raise_(rig, reaction) == commanded
    rig.until(lambda: rig.axis.is_off, 5.0)
    assert shown in rig.first.done
    assert "commanded" not in rig.first.done


def test_off_and_closed_of_a_drive_that_turns_on_confirm_nothing() -> None:
    rig = moving()
    raise_(rig, Reaction.TORQUE_OFF)
    rig.spoil = running_on(rig, state=OFF, brake_open=False)
    rig.run(2.1)
    assert rig.first.done == f"Torque off and brake {UNCONFIRMED}"


def test_a_quick_stop_that_ends_in_a_turning_axis_is_told_as_that() -> None:
    """Off and closed are shown when the drive leaves its quick stop, and the axis has never slowed down."""
    rig = moving()
    rig.spoil = running_on(rig, state=OFF, brake_open=False)
    raise_(rig, Reaction.QUICK_STOP)
    rig.run(6.0)
    told = rig.first.done
    assert f"orque off and brake {UNCONFIRMED}" in told
    for lie in ("torque off after", "brake closed after", "at rest", "othing was switched on"):
        assert lie not in told.lower()


def test_a_drive_that_stays_enabled_is_not_told_as_off() -> None:
    rig = moving()
    raise_(rig, Reaction.TORQUE_OFF)
    rig.spoil = running_on(rig, state=DriveState.OPERATION_ENABLED, brake_open=True)
    rig.run(0.6)
    assert rig.first.done == f"Torque off and brake {UNCONFIRMED}"


def test_nothing_was_switched_on_is_not_said_of_a_moving_axis() -> None:
    rig = Rig()
    rig.run(0.5)
    rig.spoil = running_on(rig)
    rig.run(5.0)
    assert rig.first is not None
    assert "othing was switched on" not in rig.first.done
    # Torque was asked for to hold it: an alarm of its own tells that it moves all the same.
    assert rig.codes == ["BRK-04", "BRK-13"]
    assert "3.00 deg/s" in rig.axis.alarms.history[-1].text


def test_of_a_standing_axis_it_is_said() -> None:
    rig = Rig()
    rig.run(0.5)
    rig.system_stop = SystemStop(StopCause.FROZEN, 2.0, 0.05, 0.0)
    rig.run(0.5)
    assert rig.first.done == "Nothing was switched on"


def test_of_a_drive_that_is_not_heard_while_it_is_switched_on_nobody_knows() -> None:
    """It may give torque since the last command that it heard (campaign seed 2041)."""
    rig = Rig()
    rig.run(0.1)
    rig.op(power=True)
    rig.spoil = lambda drive: drive._replace(state=DriveState.UNKNOWN)
    rig.run(0.05)
    raise_(rig, Reaction.TORQUE_OFF)
    rig.until(lambda: rig.axis.is_off, 5.0)
    assert "othing was switched on" not in rig.first.done
    assert "not confirmed" in rig.first.done


def test_without_a_contact_a_shaft_at_rest_needs_no_emergency_stop() -> None:
    rig = moving()
    rig.spoil = lambda drive: drive._replace(brake_contact=False)
    raise_(rig, Reaction.TORQUE_OFF)
    rig.until(lambda: rig.axis.is_off, 5.0)
    assert "brake commanded closed, not confirmed" in rig.first.done
    assert "emergency stop" not in rig.first.done


def test_no_row_says_reset_and_do_not_reset_at_once() -> None:
    told = 0
    for code, row in ALARMS.items():
        for text, no, others in (
            (row.english, "do not reset", ("then reset", "reset when", "resets")),
            (row.chinese, "请勿复位", ("然后复位", "后复位")),
        ):
            if no in text.to_do.lower():
                told += 1
                # "holds the axis: gantryctl reset" is said of what everybody may reset.
                assert row.lock, code
                assert not any(other in text.to_do.lower() for other in others), code
    assert told >= 10
