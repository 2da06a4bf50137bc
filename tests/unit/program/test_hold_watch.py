"""HOLD: when torque is given back, and a load that moves under it, both ways, at each scan period; by hand."""

import math
from dataclasses import replace

import pytest

from gantryctl.image import DigitalInputs, DriveState
from gantryctl.program import Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans

approx = pytest.approx


def held(parts):
    return HoldWatch(parts.settings, parts.feedback, parts.alarms)


@pytest.mark.parametrize("state", DriveState)
def test_torque_is_given_back_in_no_state_that_is_a_fault_or_not_known(state):
    parts = Parts()
    parts.feedback.state = state
    able = {
        "OPERATION_ENABLED",
        "QUICK_STOP_ACTIVE",
        "SWITCH_ON_DISABLED",
        "READY_TO_SWITCH_ON",
        "SWITCHED_ON",
    }
    assert held(parts).possible() is (state.name in able)


@pytest.mark.parametrize(
    "inputs",
    [DigitalInputs(estop_ok=False), DigitalInputs(estop_ok_2=False), DigitalInputs(mains_ready=False)],
)
def test_torque_is_not_given_back_with_an_open_chain_or_without_mains(inputs):
    parts = Parts()
    assert held(parts).possible()
    parts.feedback.inputs = inputs
    assert not held(parts).possible()


def test_torque_is_not_given_back_on_a_reading_in_doubt():
    parts = Parts()
    parts.feedback.in_doubt = True
    assert not held(parts).possible()


@pytest.mark.parametrize(
    ("code", "reaction", "possible"),
    [
        *((code, None, False) for code in ("CAN-12", "CAN-14", "CTL-05", "DRV-05", "DRV-07", "DRV-13")),
        ("BRK-13", Reaction.TORQUE_OFF, False),
        ("ENC-01", Reaction.TORQUE_OFF, False),
        ("BRK-13", None, True),
        ("ENC-06", None, True),
        ("BRK-03", None, True),
        ("CTL-03", Reaction.TORQUE_OFF, True),
    ],
)
def test_after_an_alarm_that_says_the_drive_does_not_obey_torque_stays_off(code, reaction, possible):
    parts = Parts()
    parts.alarms.raise_(Code(code), reaction)
    assert held(parts).possible() is possible


@pytest.mark.parametrize("codes", [("BRK-03", "CAN-12"), ("CAN-12", "BRK-03")])
def test_another_master_forbids_torque_whichever_alarm_came_first(codes):
    parts = Parts()
    for code in codes:
        parts.alarms.raise_(Code(code))
    assert not held(parts).possible()


@BOTH
@PERIODS
@pytest.mark.parametrize(("speed_deg_s", "told_s"), [(0.099, math.inf), (0.101, 0.300)])
def test_a_load_that_the_motor_should_have_caught_is_told_after_300_ms(period_s, way, speed_deg_s, told_s):
    parts = Parts(period_s)
    watch = held(parts)
    parts.turn(way * speed_deg_s)
    # Torque against the motion: the drive brakes, and not hard enough.
    parts.feedback.torque_nm = -way * 69.0
    seconds = parts.after(lambda: watch.scan(0.0), most_s=1.0)
    assert seconds == (math.inf if told_s == math.inf else approx(in_scans(told_s, period_s) + period_s))
    if parts.codes:
        assert parts.codes == ["BRK-13"]
        assert parts.reaction("BRK-13") is Reaction.W, "nothing is better than the torque that is there"


def test_a_load_is_caught_from_the_moment_on_at_which_the_drive_has_torque():
    parts = Parts()
    watch = held(parts)
    parts.feedback.state = DriveState.READY_TO_SWITCH_ON
    parts.turn(0.2)
    assert parts.after(lambda: watch.scan(0.0), most_s=1.0) == math.inf
    assert not watch.has_held
    parts.feedback.state = DriveState.OPERATION_ENABLED
    parts.feedback.torque_nm = -20.0
    assert parts.after(lambda: watch.scan(0.0), most_s=1.0) == approx(0.301)
    assert watch.has_held
    watch.begin()
    assert not watch.has_held


@pytest.mark.parametrize(("moved_deg", "codes"), [(0.149, []), (0.151, ["BRK-13"]), (math.nan, ["BRK-13"])])
def test_a_load_that_has_moved_in_hold_is_told(moved_deg, codes):
    parts = Parts()
    held(parts).scan(rad(moved_deg))
    assert parts.codes == codes


@pytest.mark.parametrize(("moved_deg", "codes"), [(0.19, []), (1.41, []), (1.42, ["BRK-13"])])
def test_a_slip_that_a_rotary_table_is_told_of_is_no_load_that_nothing_holds(moved_deg, codes):
    """Its slip is told beyond 0.1885 deg, and torque takes the load only then: 7.5 times that, as on the gantry."""
    parts = Parts()
    table = replace(parts.settings, power=replace(parts.settings.power, sag_max_rad=rad(0.1885)))
    HoldWatch(table, parts.feedback, parts.alarms).tell_if_moved(rad(moved_deg))
    assert parts.codes == codes


@BOTH
@PERIODS
def test_a_drive_that_pushes_the_load_along_loses_its_torque_after_50_ms(period_s, way):
    parts = Parts(period_s)
    watch = held(parts)
    parts.turn(way * 0.2)
    parts.feedback.torque_nm = way * 5.0
    seconds = parts.after(lambda: watch.scan(0.0), most_s=0.2)
    assert seconds == approx(in_scans(0.050, period_s))
    assert parts.reaction("BRK-13") is Reaction.TORQUE_OFF
    assert not parts.feedback.in_doubt, "the reading is sound, the drive is not"


@BOTH
@PERIODS
@pytest.mark.parametrize(("torque_nm", "doubted"), [(69.0, False), (71.0, True)])
def test_more_torque_against_a_motion_that_grows_than_any_load_needs_is_a_wrong_reading(
    period_s, way, torque_nm, doubted
):
    """The brake is tested with 70 N m."""
    parts = Parts(period_s)
    watch = held(parts)
    parts.feedback.torque_nm = -way * torque_nm
    speed = 0.2

    def scan():
        nonlocal speed
        speed += 0.001
        parts.turn(way * speed)
        watch.scan(rad(0.1))

    assert parts.after(scan, most_s=0.2) == (approx(in_scans(0.050, period_s)) if doubted else math.inf)
    assert parts.feedback.in_doubt is doubted
    if doubted:
        values = parts.alarms.active[Code.BRK_13].values
        assert values == approx({"measured": 0.1, "speed": speed})


@BOTH
def test_a_load_that_the_drive_slows_down_is_left_to_it(way):
    """Pushed along for 40 ms, then slower: the count begins anew."""
    parts = Parts()
    watch = held(parts)
    parts.feedback.torque_nm = way * 5.0
    for _ in range(4):
        parts.turn(way * 0.3)
        for _ in range(40):
            watch.scan(0.0)
        parts.turn(way * 0.2)
        watch.scan(0.0)
    assert parts.codes == []


@BOTH
def test_a_motor_that_gives_nothing_yet_drives_no_load(way):
    parts = Parts()
    watch = held(parts)
    parts.turn(way * 0.2)
    parts.feedback.torque_nm = 0.0
    assert parts.after(lambda: watch.scan(0.0), most_s=0.2) == math.inf


@BOTH
def test_a_drive_that_has_no_torque_yet_drives_no_load(way):
    """The load falls on until the drive is enabled, whatever the torque reading says."""
    parts = Parts()
    watch = held(parts)
    parts.feedback.state = DriveState.READY_TO_SWITCH_ON
    parts.turn(way * 0.2)
    parts.feedback.torque_nm = way * 5.0
    assert parts.after(lambda: watch.scan(0.0), most_s=1.0) == math.inf


def test_a_drive_that_holds_by_its_quick_stop_is_judged_like_an_enabled_one():
    """Quick stop active is torque at zero speed: 0.2 deg/s after 0.3 s is a load that moves."""
    parts = Parts()
    parts.feedback.state = DriveState.QUICK_STOP_ACTIVE
    watch = held(parts)
    parts.turn(0.2)
    parts.feedback.torque_nm = -5.0
    assert parts.after(lambda: watch.scan(0.0)) == approx(0.301)
    assert parts.codes == ["BRK-13"]
    assert watch.has_held
