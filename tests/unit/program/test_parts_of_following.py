"""Monitors of an axis that follows: each on both sides of its limit, both ways, at each scan period; figures by hand.

The reference machine: 385 N m at most, 257 rated, quick stop 5.5 deg/s2, permitted deviation of the speed 0.5 deg/s.
"""

import math
from dataclasses import replace

import pytest

from gantryctl.image import DriveState
from gantryctl.program import Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans
from unit.program.rig import RATIO

approx = pytest.approx

# --- following error, speed, travel, brake: monitors of an axis that follows ------------------------------------------


def monitors_of(parts, speed_deg_s=0.0):
    watch = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.virtual.vel_ref_rad_s = rad(speed_deg_s)
    parts.virtual.at_rest = speed_deg_s == 0.0
    parts.turn(speed_deg_s)
    return watch


def one_scan(parts, watch, *, error_deg=0.0, pos_deg=0.0, off_deg_s=0.0, command_deg_s=None):
    """A scan with a following error, at an angle, with the drive so far from its command."""
    speed = parts.virtual.vel_ref_rad_s
    command = speed if command_deg_s is None else rad(command_deg_s)

    def scan():
        parts.feedback.vel_rad_s = speed + rad(off_deg_s)
        watch.scan(rad(pos_deg), rad(error_deg), command * RATIO)

    return scan


@BOTH
@PERIODS
@pytest.mark.parametrize(
    ("speed_deg_s", "error_deg", "codes"),
    [(0.6, 0.0185, []), (0.6, 0.0187, ["CTL-12"]), (0.6, 0.0371, ["CTL-12"]), (0.6, 0.0373, ["CTL-03"]),
     (6.0, 0.0509, []), (6.0, 0.0511, ["CTL-12"]), (6.0, 0.1019, ["CTL-12"]), (6.0, 0.1021, ["CTL-03"]),
     (6.0, math.nan, ["CTL-03"])],
)  # fmt: skip
def test_the_following_error_warns_at_half_of_its_band_and_stops_at_the_band(
    period_s, way, speed_deg_s, error_deg, codes
):
    """0.03 deg and 12 ms of the speed: 0.0372 deg at 0.6 deg/s, 0.102 at 6, for 10 ms; either sign at either speed."""
    for sign in (1.0, -1.0):
        parts = Parts(period_s)
        watch = monitors_of(parts, sign * speed_deg_s)
        seconds = parts.after(one_scan(parts, watch, error_deg=way * error_deg), most_s=0.05)
        assert parts.codes == codes
        if codes == ["CTL-03"]:
            assert seconds == approx(
                period_s if math.isnan(error_deg) else max(0.010, 2 * period_s), abs=0.0021
            )
            assert parts.reaction("CTL-03") is Reaction.QUICK_STOP
        elif codes:
            assert seconds == period_s


@BOTH
@pytest.mark.parametrize(
    ("off_deg_s", "reaction"),
    [(0.49, Reaction.QUICK_STOP), (0.51, Reaction.TORQUE_OFF), (-0.51, Reaction.TORQUE_OFF)],
)
def test_only_a_drive_that_obeys_its_command_is_asked_for_a_ramp(way, off_deg_s, reaction):
    parts = Parts()
    watch = monitors_of(parts, way * 3.0)
    # The torque answers, so that the drive has not lost it.
    parts.feedback.torque_nm = 20.0
    parts.after(
        one_scan(parts, watch, error_deg=0.2, off_deg_s=off_deg_s), lambda: parts.alarms.first_out is not None
    )
    assert parts.codes[0] == "CTL-03"
    assert parts.reaction("CTL-03") is reaction


@BOTH
@PERIODS
@pytest.mark.parametrize(("off_deg_s", "told"), [(0.49, False), (0.51, True), (-0.49, False), (-0.51, True)])
def test_a_drive_half_a_degree_per_second_off_its_command_does_not_obey(period_s, way, off_deg_s, told):
    parts = Parts(period_s)
    watch = monitors_of(parts, way * 3.0)
    parts.feedback.torque_nm = 20.0
    scan = one_scan(parts, watch, off_deg_s=off_deg_s)
    seconds = parts.after(scan, lambda: "CTL-05" in parts.codes, 0.045)
    assert seconds == (approx(in_scans(0.020, period_s)) if told else math.inf)


@BOTH
@PERIODS
@pytest.mark.parametrize(
    ("released_deg_s", "told"), [(3.51, True), (3.49, False), (1.2, False), (-0.49, False), (-0.51, True)]
)
def test_a_drive_off_its_command_has_no_more_time_in_a_stop_and_one_on_its_ramp_obeys(
    period_s, way, released_deg_s, told
):
    """3 deg/s were commanded, and 3.6 were there in the last scan before the stop: between 3 and rest is its ramp."""
    parts = Parts(period_s)
    watch = monitors_of(parts, way * 3.0)
    parts.feedback.torque_nm = 20.0
    one_scan(parts, watch, off_deg_s=way * 0.6)()
    parts.feedback.vel_rad_s = way * rad(released_deg_s)
    seconds = parts.after(lambda: watch.scan_released(0.0), lambda: "CTL-05" in parts.codes, 0.045)
    assert seconds == (approx(in_scans(0.020, period_s) - period_s) if told else math.inf)
    if told:
        assert parts.reaction("CTL-05") is Reaction.TORQUE_OFF


def test_a_drive_without_torque_has_no_ramp_to_leave():
    parts = Parts()
    watch = monitors_of(parts, 3.0)
    one_scan(parts, watch, off_deg_s=0.6)()
    parts.feedback.state = DriveState.SWITCH_ON_DISABLED
    parts.feedback.vel_rad_s = rad(3.6)
    parts.after(lambda: watch.scan_released(0.0), most_s=0.045)
    assert parts.codes == []


@BOTH
@PERIODS
@pytest.mark.parametrize(
    ("speed_deg_s", "reaction"),
    [(6.59, None), (6.61, Reaction.QUICK_STOP), (7.19, Reaction.QUICK_STOP), (7.21, Reaction.TORQUE_OFF)],
)
def test_too_fast_is_6_6_deg_s_and_from_7_2_on_no_ramp_is_believed(period_s, way, speed_deg_s, reaction):
    parts = Parts(period_s, monitors={"velocity_deviation_rad_s": math.inf})
    watch = monitors_of(parts, way * speed_deg_s)
    seconds = parts.after(one_scan(parts, watch), lambda: "CTL-04" in parts.codes, 0.05)
    assert seconds == (math.inf if reaction is None else approx(in_scans(0.020, period_s)))
    if reaction is not None:
        assert parts.reaction("CTL-04") is reaction


@BOTH
@pytest.mark.parametrize(
    ("pos_deg", "speed_deg_s", "codes"),
    [(180.49, 0.0, []), (180.51, 0.0, ["LIM-02"]), (math.nan, 0.0, ["LIM-02"]),
     # 6 deg/s take 36 / 11 = 3.27 deg; away from the end they take nothing of it.
     (177.2, 6.0, []), (177.25, 6.0, ["CTL-10"]), (177.25, -6.0, []), (180.4, -6.0, []), (180.51, -6.0, ["LIM-02"])],
)  # fmt: skip
def test_a_quick_stop_must_end_inside_of_over_travel(way, pos_deg, speed_deg_s, codes):
    parts = Parts()
    watch = monitors_of(parts, way * speed_deg_s)
    if not speed_deg_s:
        parts.virtual.at_rest = False
    parts.after(one_scan(parts, watch, pos_deg=way * pos_deg), most_s=0.001)
    assert parts.codes == codes
    for code in codes:
        told = parts.alarms.active[Code(code)].values
        assert told["limit"] == approx(way * 180.5) or math.isnan(pos_deg)
        measured = pos_deg if code == "LIM-02" else speed_deg_s
        assert told["measured"] == approx(way * measured, nan_ok=True)


@BOTH
@pytest.mark.parametrize("end", [1.0, -1.0])
@pytest.mark.parametrize(("further_deg", "trips"), [(0.019, False), (0.021, True)])
def test_switched_on_beyond_the_end_it_trips_only_further_out(way, end, further_deg, trips):
    """0.02 deg, the window of standstill."""
    parts = Parts()
    watch = monitors_of(parts)
    watch.open_the_way_back(rad(end * 182.0))
    parts.virtual.at_rest = False
    parts.after(one_scan(parts, watch, pos_deg=end * (182.0 + way * further_deg)), most_s=0.001)
    assert bool(parts.codes) is (trips and way > 0.0)
    # The other end is where it always is.
    parts.after(one_scan(parts, watch, pos_deg=-end * 180.51), most_s=0.001)
    assert parts.codes == ["LIM-02"]


@BOTH
def test_back_inside_the_end_of_over_travel_is_where_it_was(way):
    parts = Parts()
    watch = monitors_of(parts)
    watch.open_the_way_back(rad(way * 182.0))
    watch.scan_released(rad(way * 180.6))
    parts.virtual.at_rest = False
    parts.after(one_scan(parts, watch, pos_deg=way * 181.9), most_s=0.001)
    assert parts.codes == []
    watch.scan_released(rad(way * 180.4))
    parts.after(one_scan(parts, watch, pos_deg=way * 180.51), most_s=0.001)
    assert parts.codes == ["LIM-02"]


@BOTH
@PERIODS
@pytest.mark.parametrize(("grows_deg", "told"), [(0.0049, False), (0.0052, True)])
def test_an_error_that_grows_by_the_window_at_the_torque_limit_is_told_after_200_ms(
    period_s, way, grows_deg, told
):
    parts = Parts(period_s)
    watch = monitors_of(parts, way * 3.0)
    parts.feedback.torque_limited = True
    parts.feedback.torque_nm = way * 10.0
    begun = 0.01
    one_scan(parts, watch, error_deg=way * begun)()
    scan = one_scan(parts, watch, error_deg=way * (begun + grows_deg))
    seconds = parts.after(scan, lambda: "CTL-07" in parts.codes, 0.4)
    assert seconds == (approx(in_scans(0.200, period_s) - period_s) if told else math.inf)
    if told:
        assert parts.alarms.active[Code.CTL_07].values["time_ms"] == approx(200.0)


@BOTH
@pytest.mark.parametrize(
    ("torque_nm", "told"), [(1539.0, False), (1541.0, True), (math.nan, True), (math.inf, True)]
)
def test_four_times_the_torque_of_the_motor_is_no_reading(way, torque_nm, told):
    for standing in (True, False):
        parts = Parts()
        watch = monitors_of(parts)
        parts.feedback.torque_nm = way * torque_nm
        watch._torque_watch = watch.drag = type("", (), {"__getattr__": lambda *_: lambda *_: None})()
        if standing:
            watch.scan_released(0.0)
        else:
            one_scan(parts, watch)()
        assert parts.codes == (["CTL-02"] if told else [])
        if told:
            assert parts.reaction("CTL-02") is Reaction.TORQUE_OFF


@BOTH
@PERIODS
@pytest.mark.parametrize(
    ("error_deg", "limited", "told_s", "reaction"),
    [
        (0.050, False, 0.300, Reaction.QUICK_STOP),
        (0.052, False, 0.0, Reaction.TORQUE_OFF),
        (0.0, True, 0.0, Reaction.TORQUE_OFF),
    ],
)
def test_a_brake_that_closes_in_motion_is_told_when_it_is_felt_or_late(
    period_s, way, error_deg, limited, told_s, reaction
):
    """Felt is half of the band, 0.051 deg at 6 deg/s, or the torque limit."""
    parts = Parts(period_s)
    watch = monitors_of(parts, 6.0)
    parts.feedback.brake_open, parts.feedback.torque_limited = False, limited
    scan = one_scan(parts, watch, error_deg=way * error_deg)
    assert parts.after(scan, lambda: "BRK-05" in parts.codes) == approx(
        max(period_s, in_scans(told_s, period_s))
    )
    assert parts.reaction("BRK-05") is reaction


@BOTH
@PERIODS
def test_in_position_is_0_005_deg_for_200_ms_and_standstill_0_02_deg_for_10_ms(period_s, way):
    parts = Parts(period_s)
    watch = monitors_of(parts)
    near, beside = (
        one_scan(parts, watch, error_deg=way * 0.0049),
        one_scan(parts, watch, error_deg=way * 0.0051),
    )
    assert parts.after(beside, lambda: watch.in_position, 1.0) == math.inf
    assert parts.after(near, lambda: watch.in_position) == approx(in_scans(0.200, period_s))
    beside()
    assert not watch.in_position
    # Once in the window, what leaves it is a matter of standstill.
    inside, outside = (
        one_scan(parts, watch, error_deg=way * 0.0149),
        one_scan(parts, watch, error_deg=way * 0.0201),
    )
    assert parts.after(inside, most_s=5.0) == math.inf
    seconds = parts.after(outside, lambda: "CTL-13" in parts.codes)
    assert seconds == approx(max(2 * period_s, 0.010), abs=0.0021)


@BOTH
@PERIODS
def test_three_seconds_beside_the_window_are_not_in_position(period_s, way):
    parts = Parts(period_s)
    watch = monitors_of(parts)
    assert parts.after(one_scan(parts, watch, error_deg=way * 0.0051)) == approx(3.0)
    assert parts.codes == ["CTL-11"]
    assert watch.not_in_position
    parts.after(one_scan(parts, watch, error_deg=0.0), lambda: watch.in_position, 0.5)
    assert not watch.not_in_position


@BOTH
def test_an_axis_that_has_not_arrived_has_not_left_its_place(way):
    """0.025 deg: more than the window of standstill, of an axis that was never in position."""
    parts = Parts()
    parts.after(one_scan(parts, monitors_of(parts), error_deg=way * 0.025), lambda: False, 0.5)
    assert parts.codes == ["CTL-12"]


IN_A_ROW = {
    # What is wrong, its alarm, its time; and what may come between: a scan in the band, or beside the warning.
    "following error": ({"error_deg": 0.2}, "CTL-03", 0.010, {}),
    "following error beside its warning": ({"error_deg": 0.2}, "CTL-03", 0.010, {"error_deg": 0.06}),
    "velocity deviation": ({"off_deg_s": 0.6}, "CTL-05", 0.020, {}),
    "overspeed": ({"off_deg_s": 0.7, "command_deg_s": 6.7}, "CTL-04", 0.020, {}),
    "saturation": ({"error_deg": 0.04}, "CTL-07", 0.200, {}),
    "brake": ({}, "BRK-05", 0.300, {}),
}


@pytest.mark.parametrize("name", IN_A_ROW)
def test_a_condition_counts_in_a_row(name):
    """Nearly its time, a good scan, and nearly its time again."""
    wrong, code, time_s, between = IN_A_ROW[name]
    parts = Parts()
    watch = monitors_of(parts, 6.0)
    parts.feedback.torque_nm = 20.0
    bad, good = one_scan(parts, watch, **wrong), one_scan(parts, watch, **between)
    for again in range(3):
        parts.feedback.torque_limited = name == "saturation"
        parts.feedback.brake_open = name != "brake"
        if name == "saturation":
            one_scan(parts, watch, error_deg=0.01)()
        # The scan before has counted as one of saturation.
        for _ in range(round(time_s * 1000) - (2 if name == "saturation" else 1)):
            bad()
        assert code not in parts.codes, again
        parts.feedback.torque_limited, parts.feedback.brake_open = False, True
        good()
    parts.feedback.torque_limited, parts.feedback.brake_open = name == "saturation", name != "brake"
    if name == "saturation":
        one_scan(parts, watch, error_deg=0.01)()
    assert parts.after(bad, lambda: code in parts.codes, 0.5) == approx(time_s, abs=0.0011)


@BOTH
def test_an_error_grows_from_where_it_was_as_the_torque_came_to_its_limit(way):
    """0.04 deg in a first saturation grow by 0.004; in a second one 0.01 grow by 0.02, and the window is 0.005."""
    parts = Parts()
    watch = monitors_of(parts, way * 6.0)
    parts.feedback.torque_nm = 20.0
    for begun, grown, told in ((0.04, 0.044, False), (0.01, 0.03, True)):
        parts.feedback.torque_limited = False
        one_scan(parts, watch)()
        parts.feedback.torque_limited = True
        one_scan(parts, watch, error_deg=way * begun)()
        parts.after(one_scan(parts, watch, error_deg=way * grown), lambda: "CTL-07" in parts.codes, 0.3)
        assert ("CTL-07" in parts.codes) is told


@BOTH
def test_a_speed_that_swings_about_that_of_the_set_point_is_told(way):
    """3 deg/s and 0.3 to either side, five times in a second; 3 deg/s more or less are no swing."""
    parts = Parts()
    watch = monitors_of(parts, way * 3.0)
    parts.feedback.torque_nm = 20.0

    def scan():
        side = 1.0 if parts.alarms.scan // 100 % 2 else -1.0
        one_scan(parts, watch, off_deg_s=side * 0.3)()

    assert parts.after(scan, lambda: "CTL-08" in parts.codes, 3.0) < 1.5
    assert parts.alarms.time_s > 0.9
    parts = Parts()
    steady = one_scan(parts, monitors_of(parts, way * 3.0))
    assert parts.after(steady, lambda: "CTL-08" in parts.codes, 3.0) == math.inf


@BOTH
@pytest.mark.parametrize(
    ("share", "limited", "told"),
    [(0.5, True, False), (0.5, False, True), (-0.5, True, True), (1.2, True, True), (0.0, True, False)],
)
def test_only_a_drive_at_its_torque_limit_may_be_slow_and_only_in_its_direction(way, share, limited, told):
    parts = Parts()
    watch = monitors_of(parts, way * 3.0)
    parts.feedback.torque_nm, parts.feedback.torque_limited = way * 20.0, limited
    scan = one_scan(parts, watch, off_deg_s=way * 3.0 * (share - 1.0))
    assert (parts.after(scan, lambda: "CTL-05" in parts.codes, 0.05) < math.inf) is told


@BOTH
def test_values_of_an_alarm_are_degrees_and_have_no_sign(way):
    parts = Parts()
    watch = monitors_of(parts, way * 6.0)
    parts.feedback.torque_nm = 20.0
    one_scan(parts, watch, error_deg=-way * 0.06)()
    assert parts.alarms.active[Code.CTL_12].values == approx(
        {"measured": 0.06, "limit": 0.051, "trip": 0.102}
    )
    parts.feedback.brake_open = False
    one_scan(parts, watch, error_deg=-way * 0.06)()
    assert parts.alarms.active[Code.BRK_05].values == approx({"measured": way * 6.0, "error": 0.06})
    parts.feedback.brake_open = True
    parts.after(one_scan(parts, watch, error_deg=-way * 0.2), lambda: "CTL-03" in parts.codes, 0.02)
    assert parts.alarms.active[Code.CTL_03].values == approx({"measured": 0.2, "limit": 0.102, "speed": 6.0})


@BOTH
def test_a_drive_that_comes_back_to_its_ramp_has_its_time_anew(way):
    """3 deg/s were commanded; nearly 20 ms at 3.6 in a stop, a scan at 3, and nearly 20 ms again."""
    parts = Parts()
    watch = monitors_of(parts, way * 3.0)
    parts.feedback.torque_nm = 20.0
    one_scan(parts, watch, off_deg_s=way * 0.6)()
    for speed_deg_s, scans in ((3.6, 18), (3.0, 1), (3.6, 19)):
        parts.turn(way * speed_deg_s)
        for _ in range(scans):
            watch.scan_released(0.0)
    assert parts.codes == []


def test_an_axis_that_leaves_its_place_is_in_position_no_more():
    parts = Parts()
    watch = monitors_of(parts)
    watch.open_the_way_back(rad(182.0))
    parts.after(one_scan(parts, watch), lambda: watch.in_position, 1.0)
    assert watch.rest_scans >= 200
    parts.virtual.at_rest = False
    one_scan(parts, watch)()
    assert not watch.in_position
    assert watch.rest_scans == 0
    # And the end of over-travel is where it was: the set-point is inside.
    one_scan(parts, watch, pos_deg=180.51)()
    assert parts.codes == ["LIM-02"]


def test_torque_of_a_drive_that_is_off_is_watched_while_the_axis_is_released():
    parts = Parts()
    watch = monitors_of(parts)
    parts.feedback.state, parts.feedback.torque_nm = DriveState.SWITCH_ON_DISABLED, 26.0
    assert parts.after(lambda: watch.scan_released(0.0), most_s=0.5) == approx(0.100)
    assert parts.codes == ["DRV-14"]


@BOTH
@pytest.mark.parametrize("turns", [1.0, -1.0])
@pytest.mark.parametrize(("more_deg", "trips"), [(-0.01, False), (0.01, True)])
def test_before_a_sector_the_way_until_a_stop_acts_counts_in_the_direction_of_motion(
    way, turns, more_deg, trips
):
    """3 deg/s for 10 ms are 0.03 deg, and 9 / 11 = 0.818 of the ramp: at 59.152 deg they end at a sector at 60."""
    parts = Parts()
    sector = (rad(60.0), rad(120.0)) if way > 0.0 else (rad(-120.0), rad(-60.0))
    travel = replace(parts.settings.travel, no_go_rad=(sector,), no_go_lead_s=0.010)
    parts.settings = replace(parts.settings, travel=travel)
    watch = monitors_of(parts, turns * way * 3.0)
    watch.open_the_way_back(0.0)
    ramp_deg = 9.0 / 11.0
    one_scan(parts, watch, pos_deg=way * (60.0 - 0.03 - ramp_deg + more_deg))()
    assert parts.codes == (["LIM-06"] if trips and turns > 0.0 else [])


@BOTH
@pytest.mark.parametrize("end", [1.0, -1.0])
def test_both_limits_go_on_with_the_turns(way, end):
    """180.5 deg from a zero that lies a turn further on."""
    for at_deg, codes in ((180.49, []), (180.51, ["LIM-02"])):
        parts = Parts()
        watch = monitors_of(parts)
        parts.virtual.at_rest = False
        watch.turn_back(way)
        one_scan(parts, watch, pos_deg=end * at_deg - way * 360.0)()
        assert parts.codes == codes


def test_a_window_that_was_left_must_be_kept_for_its_whole_time_again():
    """200 ms; 150 of them before the window was left."""
    parts = Parts()
    watch = monitors_of(parts)
    for _ in range(150):
        one_scan(parts, watch)()
    one_scan(parts, watch, error_deg=0.006)()
    assert parts.after(one_scan(parts, watch), lambda: watch.in_position, 1.0) == approx(0.200)
    one_scan(parts, watch, error_deg=0.006)()
    assert not watch.in_position
    assert parts.after(one_scan(parts, watch), lambda: watch.in_position, 1.0) == approx(0.200)


COUNTS = {
    "following error": ({"error_deg": 0.2}, {}, "CTL-03", 0.010),
    "deviation": ({"off_deg_s": 0.6}, {"torque_nm": 20.0}, "CTL-05", 0.020),
    "torque limit": ({"error_deg": 0.02}, {"torque_limited": True}, "CTL-07", 0.200),
    "brake": ({}, {"brake_open": False}, "BRK-05", 0.300),
}


@pytest.mark.parametrize("name", COUNTS)
def test_after_a_reset_each_monitor_counts_anew(name):
    """Two scans before its time is over the monitors are reset; then it takes all of its time."""
    scan, said, code, time_s = COUNTS[name]
    parts = Parts()
    watch = monitors_of(parts, 3.0)
    for field, value in said.items():
        setattr(parts.feedback, field, value)

    def begin():
        if name == "torque limit":
            one_scan(parts, watch, error_deg=0.001)()

    begin()
    for _ in range(round(time_s / parts.period_s) - 2):
        one_scan(parts, watch, **scan)()
    assert code not in parts.codes
    watch.reset()
    begin()
    seconds = parts.after(one_scan(parts, watch, **scan), lambda: code in parts.codes, 0.5)
    assert seconds == approx(time_s - (parts.period_s if name == "torque limit" else 0.0))


@BOTH
def test_an_axis_that_leaves_standstill_for_nine_scans_at_a_time_has_kept_it(way):
    """10 ms are permitted; one scan within the window begins them anew."""
    parts = Parts()
    watch = monitors_of(parts)
    parts.after(lambda: watch.scan(0.0, 0.0, 0.0), lambda: watch.in_position)
    for _ in range(5):
        for _ in range(9):
            watch.scan(0.0, way * rad(0.025), 0.0)
        watch.scan(0.0, 0.0, 0.0)
    assert "CTL-13" not in parts.codes


def test_a_brake_that_closed_by_itself_at_rest_is_told_as_closed_where_it_was_commanded_open():
    parts = Parts()
    watch = monitors_of(parts)
    parts.feedback.brake_open = False
    parts.after(lambda: watch.scan(0.0, 0.0, 0.0), most_s=0.5)
    values = parts.alarms.active[Code.BRK_06].values
    assert (values["measured"], values["command"]) == (Words.CLOSED, Words.OPEN)


@BOTH
def test_an_axis_that_follows_is_watched_for_torque_that_is_lost(way):
    """3 deg/s, 0.06 off its command, and no torque for 50 ms."""
    parts = Parts()
    scan = one_scan(parts, monitors_of(parts, way * 3.0), off_deg_s=-way * 0.06)
    assert parts.after(scan, most_s=0.1) == approx(0.050, abs=0.0011)
    assert parts.codes == ["DRV-13"]


@BOTH
def test_the_torque_of_an_axis_in_position_is_learned_and_judged(way):
    """In position after 200 ms; learned by 95 % within 3 s more. 95 % of 257 N m are too much for 250 ms more."""
    parts = Parts()
    parts.feedback.torque_nm = way * 100.0
    scan = one_scan(parts, monitors_of(parts))
    parts.after(scan, most_s=0.19)
    assert parts.holding.mean_nm == 0.0
    parts.after(scan, lambda: False, most_s=3.0)
    assert parts.holding.mean_nm == approx(way * 95.0, rel=0.01)
    assert parts.codes == []
    parts = Parts()
    parts.feedback.torque_nm = way * 0.95 * 257.0
    assert parts.after(one_scan(parts, monitors_of(parts))) == approx(0.450, abs=0.0021)
    assert (parts.codes, parts.reaction("CTL-06")) == (["CTL-06"], Reaction.QUICK_STOP)
