"""Watches of a motor of 0.64 N m: limits are parts of its torques, not figures of the reference machine; by hand.

The motor of a rotary table: 2.0 N m at most, 0.64 rated, a brake of 1.2, tested with 0.128.
"""

from dataclasses import replace

import pytest

from gantryctl.program import Reaction
from gantryctl.program.monitors.drag import DragWatch
from gantryctl.program.monitors.liveness import Liveness
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.monitors.thermal import MotorThermal
from gantryctl.program.monitors.torque import TorqueWatch
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.settings import ThermalSettings
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts
from unit.program.rig import RATIO, settings


def table(period_s=0.001, **monitors):
    config = settings(period_s=period_s, monitors=monitors)
    power = replace(
        config.power,
        torque_max_nm=2.0,
        torque_rated_nm=0.64,
        brake_torque_nm=1.2,
        test_torque_nm=0.128,
        proof_torque_nm=0.064,
    )
    thermal = ThermalSettings(torque_rated_nm=0.64, winding_max_c=120.0)
    return Parts(period_s, config=replace(config, power=power, thermal=thermal))


def torque_watch(parts):
    return TorqueWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)


@BOTH
@PERIODS
@pytest.mark.parametrize(("torque_nm", "codes"), [(0.0127, ["DRV-13"]), (0.0129, [])])
def test_nothing_is_2_percent_of_the_rated_torque(period_s, way, torque_nm, codes):
    parts = table(period_s)
    watch = torque_watch(parts)
    parts.turn(way * 3.0)
    parts.feedback.torque_nm = way * torque_nm
    parts.after(lambda: watch.scan(rad(-way * 0.06), 0.0), most_s=0.1)
    assert parts.codes == codes


@BOTH
@PERIODS
@pytest.mark.parametrize(("rise_nm", "codes"), [(0.61, ["BRK-14"]), (0.59, [])])
def test_a_brake_shows_by_half_of_its_torque(period_s, way, rise_nm, codes):
    parts = table(period_s)
    watch = torque_watch(parts)
    parts.turn(way * 2.9)
    watch.scan(rad(-way * 0.06), 0.0)
    parts.feedback.torque_nm = way * rise_nm
    parts.after(lambda: watch.scan(rad(-way * 0.06), 0.0), most_s=0.031)
    assert parts.codes == codes


@BOTH
@PERIODS
@pytest.mark.parametrize(("rise_nm", "codes"), [(0.98, ["BRK-14"]), (0.95, [])])
def test_a_brake_shows_beside_what_the_motor_accelerates_with(period_s, way, rise_nm, codes):
    """2.0 N m stop any load with 5.5 deg/s2, so 1 deg/s2 takes 0.364 at most: 0.6 are left of 0.964."""
    parts = table(period_s)
    watch = torque_watch(parts)
    parts.turn(way * 2.9)
    watch.scan(rad(-way * 0.06), 0.0)
    parts.feedback.torque_nm = way * rise_nm
    parts.virtual.acc_ref_rad_s2 = rad(way * 1.0)
    parts.after(lambda: watch.scan(rad(-way * 0.06), 0.0), most_s=0.031)
    assert parts.codes == codes


def drags(parts, way, excess_nm, acc_deg_s2=0.0):
    """A motion that needs so much more than any load does that the brake is tested for."""
    watch = DragWatch(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    watch.model.add = lambda *_: None
    parts.virtual.vel_ref_rad_s, parts.virtual.acc_ref_rad_s2 = way * rad(3.0), way * rad(acc_deg_s2)
    parts.feedback.torque_nm = way * (0.128 + excess_nm)
    parts.after(lambda: watch.scan(0.0), lambda: False, most_s=4.0)


@BOTH
@pytest.mark.parametrize(
    ("excess_nm", "acc_deg_s2", "codes"),
    [(0.12, 0.0, ["BRK-02"]), (0.09, 0.0, []), (0.48, 1.0, ["BRK-02"]), (0.45, 1.0, [])],
)
def test_a_drag_is_15_percent_of_the_rated_torque_beyond_that_of_the_brake_test(
    way, excess_nm, acc_deg_s2, codes
):
    """0.096 N m beyond 0.128, and 0.364 where the axis speeds up with 1 deg/s2, until it has learned its load."""
    parts = table()
    drags(parts, way, excess_nm, acc_deg_s2)
    assert parts.codes == codes


@BOTH
@pytest.mark.parametrize(
    ("excess_nm", "reaction"), [(0.65, Reaction.TORQUE_OFF), (0.55, Reaction.HLT), (0.15, Reaction.W)]
)
def test_a_brake_that_is_turned_from_the_start_shows_by_half_of_its_torque(way, excess_nm, reaction):
    """0.6 N m; 30 % of the rated torque, 0.192, end the motion on its ramp."""
    parts = table()
    drags(parts, way, excess_nm)
    assert parts.reaction("BRK-02") is reaction


@BOTH
@PERIODS
@pytest.mark.parametrize(("torque_nm", "codes"), [(0.39, ["CTL-06"]), (0.38, [])])
def test_a_load_is_heavy_from_60_percent_of_the_rated_torque_on(period_s, way, torque_nm, codes):
    parts = table(period_s)
    parts.feedback.torque_nm = way * torque_nm
    watch = torque_watch(parts)
    parts.after(watch.standing, most_s=1.0)
    assert parts.codes == codes


@BOTH
@pytest.mark.parametrize(("torque_nm", "codes"), [(8.1, ["CTL-02"]), (7.9, [])])
def test_four_times_the_torque_of_the_motor_is_no_reading(way, torque_nm, codes):
    parts = table()
    watch = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.feedback.torque_nm = way * torque_nm
    watch.scan_released(0.0)
    assert parts.codes == codes


@BOTH
@pytest.mark.parametrize(("torque_nm", "doubted"), [(0.13, True), (0.12, False)])
def test_more_torque_than_that_of_the_brake_test_against_a_load_that_goes_on_is_read_the_wrong_way(
    way, torque_nm, doubted
):
    parts = table()
    watch = HoldWatch(parts.settings, parts.feedback, parts.alarms)
    parts.turn(way * 0.2)
    parts.feedback.torque_nm = -way * torque_nm
    parts.after(lambda: watch.scan(0.0), most_s=0.1)
    assert parts.feedback.in_doubt is doubted


@BOTH
@pytest.mark.parametrize(("torque_nm", "codes"), [(0.58, ["THM-01"]), (0.565, [])])
def test_a_motor_warms_by_its_own_rated_torque(way, torque_nm, codes):
    """For good: (0.58 / 0.64)^2 are 82 %, (0.565 / 0.64)^2 are 78; it warns at 80."""
    parts = table()
    watch = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.torque_nm = way * torque_nm
    watch.scan(1e6)
    assert parts.codes == codes


@pytest.mark.parametrize(("winding_c", "codes"), [(105.0, ["THM-01"]), (103.0, [])])
def test_a_winding_is_judged_by_what_it_may_have(winding_c, codes):
    """120 C are 80 K over 40 C: 80 % of them are 104 C."""
    parts = table()
    watch = MotorThermal(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.motor_temp_c = winding_c
    watch.scan(0.1)
    assert parts.codes == codes


@BOTH
@pytest.mark.parametrize(("pos_deg", "codes"), [(171.6, ["CTL-10"]), (171.4, [])])
def test_the_end_of_travel_is_looked_ahead_to_by_the_quick_stop_of_the_axis(way, pos_deg, codes):
    """0.5 deg/s2 take 9 deg from 3 deg/s, and 180.5 deg trip; with 5.5 deg/s2 it would be 0.8 deg."""
    parts = table()
    ramps = replace(parts.settings.ramps, quick_dec_rad_s2=rad(0.5))
    parts.settings = replace(parts.settings, ramps=ramps)
    watch = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    parts.virtual.vel_ref_rad_s, parts.virtual.at_rest = way * rad(3.0), False
    parts.turn(way * 3.0)
    watch.scan(way * rad(pos_deg), 0.0, way * rad(3.0) * RATIO)
    assert parts.codes == codes


@BOTH
@pytest.mark.parametrize(("torque_nm", "codes"), [(1.61, ["ENC-12"]), (1.59, [])])
def test_a_speed_that_grows_against_80_percent_of_the_torque_is_of_the_wrong_sign(way, torque_nm, codes):
    parts = table()
    watch = Liveness(parts.settings, parts.feedback, parts.holding, parts.alarms)
    parts.feedback.torque_nm = -way * torque_nm
    for scan, deg_s in enumerate((0.2, 0.36)):
        parts.alarms.scan = 100 + scan
        parts.turn(way * deg_s)
        watch.drive_against()
    assert parts.codes == codes
    # Of less than the torque of the brake test at 0.1 deg/s nobody asks.
    assert watch.against == pytest.approx(-0.128 * rad(0.1))


@BOTH
@pytest.mark.parametrize(("deg_s", "codes"), [(0.0165, ["ENC-14"]), (0.0155, [])])
def test_a_load_swings_by_40_percent_of_the_torque_at_most(way, deg_s, codes):
    """0.8 N m of 40 deg/s2 each turn half of 0.032 deg/s round in a scan of 1 ms."""
    parts = table(encoder_shows_twist=True, speed_change_per_torque=rad(40.0))
    parts.alarms.scan = 100
    parts.feedback._judge_turn(way * rad(deg_s), -way * rad(deg_s))
    assert parts.codes == codes


@BOTH
@pytest.mark.parametrize(("load_nm", "proof_nm"), [(0.02, 0.064), (0.1, 0.1)])
def test_the_proof_is_that_of_the_load_where_it_needs_more_either_way(way, load_nm, proof_nm):
    holding = HoldingTorque(table().settings)
    holding.mean_nm = way * load_nm
    holding.preload()
    assert holding.preload_nm == way * load_nm
    assert holding.proof_nm == way * proof_nm
