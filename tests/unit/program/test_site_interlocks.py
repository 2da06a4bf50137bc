"""Collision, room door, second emergency-stop channel and loose wires (G7, G8, G10, G11) on an ideal drive."""

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, Mode
from gantryctl.program import AxisState, PowerPhase, Reaction
from gantryctl.program.monitors.site import SiteInterlocks
from gantryctl.units import rad
from unit.program.parts import PERIODS, Parts
from unit.program.rig import Rig, moving_rig, powered, press, settings
from unit.program.spoiling import expect

PERIODS_S = (0.001, 0.004, 0.01)
CLOSED = DigitalInputs(collision_ok=True, door_ok=True, estop_ok_2=True, motion_permit=True)


def fitted(period_s=0.001, **monitors) -> Rig:
    """A machine with every input, at 6 deg/s."""
    rig = moving_rig(config=settings(period_s=period_s, monitors=monitors))
    rig.drive.inputs = CLOSED
    rig.run(0.1)
    assert not rig.codes
    return rig


def shows(rig: Rig, **inputs: bool) -> None:
    rig.drive.inputs = CLOSED._replace(**inputs)


@pytest.mark.parametrize("period_s", PERIODS_S)
def test_g7_collision_is_a_quick_stop_in_the_first_scan(period_s):
    rig = fitted(period_s)
    shows(rig, collision_ok=False)
    expect(rig, "INT-01", Reaction.QUICK_STOP, 0.0, "The collision interlock opened at")
    assert rig.output.request is DriveRequest.QUICK_STOP


@pytest.mark.parametrize("name", ["collision_ok", "door_ok"])
def test_power_stays_off_while_an_interlock_is_open_and_nothing_is_raised(name):
    rig = Rig()
    shows(rig, **{name: False})
    rig.op(power=True)
    rig.run(0.5)
    assert not rig.codes, "a door that is open with power off is no alarm"
    assert rig.axis.power.phase is PowerPhase.OFF
    assert "open" in rig.refused()
    shows(rig)
    rig.op(power=False)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is PowerPhase.ON, 5.0)


def test_g7_an_open_collision_interlock_cannot_be_reset_and_closing_it_moves_nothing():
    rig = fitted()
    shows(rig, collision_ok=False)
    rig.run(3.0)
    rig.op(reset=True)
    assert "the collision interlock is open" in rig.refused()
    assert rig.axis.state is AxisState.ERROR_STOP
    shows(rig)
    rig.op(reset=False)
    rig.run(1.0)
    assert rig.axis.state is AxisState.ERROR_STOP
    rig.op(reset=True)
    rig.run(0.1)
    assert rig.axis.state is AxisState.DISABLED
    assert rig.output.request is DriveRequest.DISABLE


@pytest.mark.parametrize("period_s", PERIODS_S)
def test_g11_the_door_stops_on_the_ramp_and_stays_latched(period_s):
    rig = fitted(period_s)
    shows(rig, door_ok=False)
    rig.step()
    assert rig.codes == ["INT-07"]
    shows(rig)  # it closes again at once: the axis stops all the same
    rig.until(lambda: rig.axis.at_rest, 5.0)
    assert rig.axis.power.phase is PowerPhase.ON
    rig.op(power=True)
    rig.move(5.0)
    assert "INT-07 is active" in rig.refused()
    rig.op(reset=True)
    rig.op(reset=False)
    rig.move(rig.ref_deg + 1.0)
    rig.run(0.1)
    assert rig.axis.state is AxisState.DISCRETE_MOTION


def test_g11_an_open_door_cannot_be_reset():
    rig = fitted()
    shows(rig, door_ok=False)
    rig.run(3.0)
    rig.op(reset=True)
    assert "the room door is open" in rig.refused()
    assert rig.codes == ["INT-07"]


def test_g11_the_machine_file_makes_it_a_quick_stop():
    rig = fitted(door_quick_stop=True)
    shows(rig, door_ok=False)
    expect(rig, "INT-07", Reaction.QUICK_STOP, 0.0, "The room door opened at")


@pytest.mark.parametrize("period_s", PERIODS_S)
def test_a_permit_taken_away_stops_on_the_ramp_and_nothing_goes_on_when_it_is_back(period_s):
    rig = fitted(period_s)
    shows(rig, motion_permit=False)
    rig.step()
    assert rig.codes == ["INT-08"]
    shows(rig)  # it is back at once: the axis stops all the same, with power on
    rig.until(lambda: rig.axis.at_rest, 5.0)
    assert rig.axis.power.phase is PowerPhase.ON
    rig.move(5.0)
    assert "INT-08 is active" in rig.refused()
    rig.op(reset=True)
    rig.op(reset=False)
    rig.run(1.0)
    assert rig.axis.at_rest, "the reset alone moves nothing"
    rig.move(rig.ref_deg + 1.0)
    rig.run(0.1)
    assert rig.axis.state is AxisState.DISCRETE_MOTION


def test_a_missing_permit_cannot_be_reset():
    rig = fitted()
    shows(rig, motion_permit=False)
    rig.run(3.0)
    rig.op(reset=True)
    assert "the motion permit is not given" in rig.refused()
    assert rig.codes == ["INT-08"]


def test_a_held_key_does_not_go_on_when_the_permit_is_back():
    """Hold-to-run: a new press is a new motion, a key that was held all the time is not."""
    rig = powered()
    rig.drive.inputs = CLOSED
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(0.6))
    press(rig, forward=True)
    rig.hold_key(2.0)
    assert not rig.axis.at_rest
    shows(rig, motion_permit=False)
    rig.hold_key(2.0)
    assert rig.axis.at_rest
    shows(rig)
    rig.hold_key(0.1)
    rig.op(reset=True)
    rig.op(reset=False)
    assert not rig.codes
    rig.hold_key(2.0)
    assert rig.axis.at_rest
    rig.op(forward=False)
    rig.run(0.1)
    press(rig, forward=True)
    rig.hold_key(1.0)
    assert not rig.axis.at_rest


def test_at_standstill_a_missing_permit_refuses_motion_and_raises_nothing():
    rig = Rig()
    shows(rig, motion_permit=False)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is PowerPhase.ON, 5.0)
    rig.move(5.0)
    assert "the motion permit is not given" in rig.refused()
    rig.run(1.0)
    assert not rig.codes
    assert rig.axis.at_rest
    shows(rig)
    rig.run(0.1)
    rig.move(5.0)
    rig.run(0.1)
    assert rig.axis.state is AxisState.DISCRETE_MOTION


@pytest.mark.parametrize("period_s", PERIODS_S)
@pytest.mark.parametrize("name", ["collision_ok", "door_ok", "motion_permit"])
def test_g8_pulses_of_one_scan_are_latched_and_the_sixth_in_a_minute_is_a_loose_wire(name, period_s):
    rig = Rig(config=settings(period_s=period_s))
    for pulse in range(6):
        assert not rig.codes, pulse
        shows(rig, **{name: False})
        rig.step()
        shows(rig)
        rig.run(11.9)  # six edges within 59.5 s
    assert rig.codes == ["INT-02"]
    rig.op(power=True)
    rig.run(0.5)
    assert rig.axis.power.phase is PowerPhase.OFF, "not without a reset"


def test_g8_six_in_more_than_a_minute_are_none():
    rig = Rig()
    for _ in range(8):
        shows(rig, door_ok=False)
        rig.step()
        shows(rig)
        rig.run(12.1)  # six edges take 60.5 s
    assert not rig.codes


@pytest.mark.parametrize("period_s", PERIODS_S)
@pytest.mark.parametrize("open_channel", ["estop_ok", "estop_ok_2"])
def test_g10_either_channel_is_the_emergency_stop_and_a_difference_locks(open_channel, period_s):
    rig = fitted(period_s)
    shows(rig, **{open_channel: False})
    expect(rig, "INT-03", Reaction.TORQUE_OFF, 0.0)
    # Half a second from the scan that shows it, less the two that `expect` has made.
    rig.run(0.47)
    assert "INT-04" not in rig.codes
    rig.run(0.03)
    assert "INT-04" in rig.codes
    rig.run(2.0)
    shows(rig)
    rig.op(reset=True)
    assert "service role only" in rig.refused()
    assert rig.axis.state is AxisState.ERROR_STOP


def test_g10_channels_that_still_differ_cannot_be_reset_by_service():
    rig = fitted()
    # Both open first: the emergency stop itself; then one channel closes and the other is stuck open.
    shows(rig, estop_ok=False, estop_ok_2=False)
    rig.run(2.0)
    assert rig.codes == ["INT-03"], "channels that switch together differ at no time"
    shows(rig, estop_ok_2=False)
    rig.run(1.0)
    assert rig.codes == ["INT-03", "INT-04"]
    assert "chain" in str(rig.axis.reset(service=True))
    shows(rig)
    rig.run(0.1)
    assert rig.axis.reset(service=True) is None


def test_differences_of_two_channels_are_not_added_up():
    """0.4 s twice, each less than the half second that locks, with both channels alike for 20 ms between them."""
    rig = fitted()
    for _ in range(2):
        shows(rig, estop_ok=False)
        rig.run(0.4)
        shows(rig, estop_ok=False, estop_ok_2=False)
        rig.run(0.02)
    assert "INT-04" not in rig.codes


def test_channels_that_switch_100_ms_apart_are_no_alarm():
    rig = fitted()
    shows(rig, estop_ok=False)
    rig.run(0.1)
    shows(rig, estop_ok=False, estop_ok_2=False)
    rig.run(3.0)
    shows(rig, estop_ok=False)
    rig.run(0.1)
    shows(rig)
    rig.run(0.1)
    assert rig.codes == ["INT-03"]


def test_a_machine_without_these_inputs_is_not_watched():
    rig = moving_rig()
    rig.run(1.0)
    assert rig.drive.inputs == DigitalInputs()
    assert not rig.codes


@pytest.mark.parametrize("name", ["collision_ok", "door_ok", "motion_permit"])
@PERIODS
@pytest.mark.parametrize(("lasts_s", "loose"), [(59.0, True), (61.0, False)])
def test_six_openings_within_a_minute_are_a_loose_wire_at_any_time_of_the_day(name, period_s, lasts_s, loose):
    parts = Parts(period_s)
    site = SiteInterlocks(parts.settings, parts.feedback, parts.alarms)
    for opening in range(6):
        parts.alarms.time_s = 5000.0 + opening * lasts_s / 5.0
        for closed in (True, False):
            parts.feedback.inputs = DigitalInputs(**{name: closed})
            site.scan(0.0, powered=False, moving=False)
    assert parts.codes == (["INT-02"] if loose else [])
    assert parts.alarms.horn is False


def test_each_input_has_its_own_count_of_openings():
    """Five of each within a minute are people."""
    parts = Parts()
    site = SiteInterlocks(parts.settings, parts.feedback, parts.alarms)
    for opening in range(5):
        for number, name in enumerate(("collision_ok", "door_ok", "motion_permit")):
            parts.alarms.time_s = 3.0 * opening + number
            for closed in (True, False):
                parts.feedback.inputs = DigitalInputs(**{name: closed})
                site.scan(0.0, powered=False, moving=False)
    assert parts.codes == []


@pytest.mark.parametrize("name", ["collision_ok", "door_ok", "motion_permit"])
def test_the_last_six_openings_count_whenever_the_one_before_was(name):
    """Of seven within 85 s the last six lie within 55."""
    parts = Parts()
    site = SiteInterlocks(parts.settings, parts.feedback, parts.alarms)
    for time_s in (0.0, 30.0, 41.0, 52.0, 63.0, 74.0, 85.0):
        assert parts.codes == []
        parts.alarms.time_s = time_s
        for closed in (True, False):
            parts.feedback.inputs = DigitalInputs(**{name: closed})
            site.scan(0.0, powered=False, moving=False)
    assert parts.codes == ["INT-02"]


@pytest.mark.parametrize("name", ["collision_ok", "door_ok"])
def test_an_interlock_that_opens_under_torque_at_rest_is_told(name):
    rig = powered()
    rig.drive.inputs = CLOSED
    rig.run(0.1)
    shows(rig, **{name: False})
    rig.step()
    assert rig.codes == ["INT-01" if name == "collision_ok" else "INT-07"]
