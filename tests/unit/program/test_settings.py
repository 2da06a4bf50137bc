"""Times become scans, and ramps of one motion those of the machine."""

import math
from dataclasses import replace

import pytest

from gantryctl.program.settings import MonitorSettings, PowerSettings, RampSettings
from gantryctl.units import deg
from unit.program.rig import settings


@pytest.mark.parametrize(
    ("time_s", "period_s", "expected"),
    [
        (0.010, 0.001, 10),
        (0.010, 0.004, 3),  # rounded up: 12 ms, not 8
        (0.010, 0.010, 2),  # never a single reading
        (0.0, 0.001, 2),
        (0.250, 0.004, 63),
        (0.3, 0.1, 3),  # 0.3 / 0.1 is 2.9999999999999996 in binary
        (0.7, 0.1, 7),  # and 0.7 / 0.1 is 6.999999999999999
        (0.6, 0.2, 3),  # 0.6 / 0.2 is 2.9999999999999996
    ],
)
def test_scans(time_s, period_s, expected):
    assert settings(period_s=period_s).scans(time_s) == expected


def test_least():
    config = settings(period_s=0.010)
    assert config.scans(0.010, least=3) == 3
    assert config.scans(0.001, least=1) == 1


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ((1.0, None, None), (1.0, 8.0, 9.0)),
        ((None, 1.0, None), (7.0, 1.0, 9.0)),
        ((None, None, 1.0), (7.0, 8.0, 1.0)),
        ((None, None, None), (7.0, 8.0, 9.0)),
    ],
)
def test_ramps_of_one_motion_are_the_machines_but_for_what_is_given(given, kept):
    ramps = RampSettings(7.0, 8.0, 9.0, 10.0, 11.0, 12.0)
    below = ramps.below(*given)
    assert (below.acc_rad_s2, below.dec_rad_s2, below.jerk_rad_s3) == kept
    assert below.jog_release(6.0).dec_rad_s2 == 10.0


@pytest.mark.parametrize(("over_rad", "shown_rad"), [(math.pi, -math.pi), (3.0, 2.0 * math.pi - 3.0)])
def test_a_limit_has_its_sign_where_both_ends_of_travel_read_alike(over_rad, shown_rad):
    """As people read angles within a turn, -180 deg is 180 deg, which the other end is."""
    travel = replace(
        settings().travel, over_travel_min_rad=-over_rad, over_travel_max_rad=over_rad, read_within_turn=True
    )
    assert travel.read_end_rad(-over_rad) == pytest.approx(shown_rad)


def test_what_no_machine_file_changes():
    """The fault catalogue and the decisions give these figures; deg, s and N m."""
    config = settings()
    monitors, speed, power, thermal = config.monitors, config.speed, config.power, config.thermal
    # By hand without the enabling switch, and with a brake whose test is overdue.
    assert deg(speed.without_enabling_switch_rad_s) == pytest.approx(1.0)
    assert deg(speed.brake_overdue_rad_s) == pytest.approx(1.0)
    # A jump, a drift and a frozen count of the encoder; bad readings, and the age of one.
    assert deg(monitors.encoder_jump_base_rad) == pytest.approx(0.02)
    assert deg(monitors.encoder_jump_speed_rad_s) == pytest.approx(2.0)
    assert deg(monitors.encoder_drift_max_rad) == pytest.approx(0.045)
    assert deg(monitors.encoder_frozen_speed_rad_s) == pytest.approx(0.1)
    assert (monitors.encoder_frozen_time_s, monitors.reading_age_s) == (0.030, 0.030)
    assert (monitors.encoder_errors_max, monitors.encoder_errors_time_s) == (3, 0.100)
    # Channels of the emergency stop that differ (G10), contacts that chatter (G8).
    assert monitors.estop_discrepancy_time_s == 0.5
    assert (monitors.chatter_edges_max, monitors.chatter_time_s) == (5, 60.0)
    # The motor is warm, and too warm to move (G12).
    assert (thermal.warning_share, thermal.refusal_share) == (0.80, 0.95)
    # Torque is proven, given back and taken off, and the brake is watched.
    assert (power.proof_share, power.proof_excess_nm, power.proof_time_s) == (0.8, 60.0, 0.5)
    assert (power.settle_time_s, power.learn_time_s, power.unload_step_s) == (0.050, 1.0, 0.050)
    assert (power.sag_watch_s, power.slip_watch_s) == (0.200, 2.0)


def test_what_a_machine_file_leaves_out_is_not_watched_and_not_asked_for():
    monitors, travel = MonitorSettings(), settings().travel
    assert (monitors.door_quick_stop, monitors.encoder_battery, monitors.encoder_shows_twist) == (
        False,
        False,
        False,
    )
    unlimited = (
        monitors.encoder_still_time_s, monitors.torque_still_max_nm, monitors.speed_change_max_rad_s2,
        monitors.speed_change_per_torque,
    )  # fmt: skip
    assert unlimited == (math.inf,) * 4
    assert (travel.no_go_rad, travel.no_go_clearance_rad, travel.no_go_margin_rad, travel.no_go_lead_s) == (
        (),
        0,
        0,
        0,
    )
    assert not travel.read_within_turn
    power = PowerSettings(torque_max_nm=385.0, torque_rated_nm=257.0)
    assert (power.brake_by_drive, power.untestable, power.holding_torque_nm) == (False, None, 0.0)
    assert power.torque_preload
    assert deg(travel.turn_from_rad) == pytest.approx(-180.0)


@pytest.mark.parametrize(
    ("pos_deg", "read_deg"),
    [(30.0, 30.0), (-30.0, 330.0), (-90.0, 270.0), (360.0, 0.0), (-360.0, 0.0), (361.0, 361.0)],
)
def test_people_read_an_angle_from_0_to_360_deg_and_a_way_as_it_is(pos_deg, read_deg):
    travel = replace(settings().travel, read_within_turn=True)
    assert deg(travel.read_rad(math.radians(pos_deg))) == pytest.approx(read_deg)
    assert deg(settings().travel.read_rad(math.radians(pos_deg))) == pytest.approx(pos_deg)
