"""What holds one way holds the other way too, and at every scan period: proofs, guards and monitors of the axis."""

import math

import pytest

from gantryctl.image import DriveRequest
from gantryctl.program import AxisState, Reaction
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.units import rad
from unit.program.power_steps import P, slip
from unit.program.rig import RATIO, Rig, moving_rig, settings
from unit.program.spoiling import POSITION_ALONE, expect

BOTH = pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
PERIODS = pytest.mark.parametrize("period_s", [0.001, 0.004, 0.010])


@BOTH
def test_torque_against_the_proof_opens_no_brake(way):
    """A drive that pushes the wrong way with all it was asked for: the load would fall twice as hard."""
    rig = Rig(config=settings(holding_torque_nm=way * 40.0))
    rig.spoil = lambda drive: drive._replace(torque_act_nm=-drive.torque_act_nm)
    rig.op(power=True)
    for _ in range(800):
        rig.step()
        assert not rig.output.brake_open
    assert rig.codes == ["BRK-07"]
    assert "Torque -40 N m" in rig.first.text


@pytest.mark.parametrize(
    ("asked_nm", "given_nm"),
    [(384.0, 384.0), (-384.0, -384.0), (386.0, 385.0), (-386.0, -385.0), (math.inf, 385.0), (-math.inf, -385.0),
     (math.nan, 0.0)],
)  # fmt: skip
def test_torque_is_limited_both_ways_and_no_number_is_no_torque(asked_nm, given_nm):
    assert HoldingTorque(settings()).limited(asked_nm) == given_nm


@BOTH
def test_a_sag_counts_from_the_release_on(way):
    """0.012 deg while the brake opens and 0.012 deg afterwards are 0.024 deg; 0.020 are allowed."""
    rig = Rig()
    opened = False
    rig.spoil = lambda drive: drive._replace(brake_open=opened)
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.RELEASING)
    slip(rig, way * 0.012)
    assert rig.axis.power.phase is P.RELEASING
    opened = True
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH)
    assert not rig.codes
    slip(rig, way * 0.012)
    rig.run(0.3)
    assert rig.codes == ["BRK-10"]
    assert not rig.output.brake_open


@BOTH
@PERIODS
def test_a_drive_that_turns_on_in_a_quick_stop_is_seen_in_time(period_s, way):
    rig = moving_rig(at_deg=50.0 * way, config=settings(period_s=period_s))
    assert rig.vel_deg_s == pytest.approx(-6.0 if way > 0.0 else 6.0)
    rig.op(quick_stop=True)
    speed = rig.drive.vel_rad_s

    def runs_on(drive):
        rig.drive.vel_rad_s = speed
        return drive._replace(vel_act_rad_s=speed)

    rig.spoil = runs_on
    start = rig.scan
    rig.until(lambda: rig.axis.power.phase is P.TORQUE_OFF, 1.0)
    # The drive may react for 60 ms; at 5.5 deg/s2 the ramp is 0.5 deg/s lower after 91 ms; then 50 ms: 201 ms, and the
    # scans that end them.
    assert 0.2 <= (rig.scan - start) * period_s <= 0.21 + 2.0 * period_s
    assert rig.codes == ["INT-06", "DRV-07"]
    assert rig.output.request is DriveRequest.DISABLE


@BOTH
def test_at_its_torque_limit_a_drive_may_be_slow_and_not_turn_the_other_way(way):
    """A sign that is wrong in the drive: a quick stop would accelerate (B5)."""
    free = {"following_error_base_rad": math.inf, "torque_saturation_time_s": 10.0, **POSITION_ALONE}

    def spoiled(share):
        rig = Rig(config=settings(monitors=free))
        rig.power_up()
        rig.move(way * 100.0, 6.0)
        rig.run(2.0)
        rig.spoil = lambda drive: drive._replace(
            vel_act_rad_s=way * share * rad(6.0) * RATIO, torque_limited=True
        )
        rig.run(0.1)
        return rig

    assert "CTL-05" not in spoiled(0.5).codes
    assert "CTL-05" in spoiled(-0.5).codes
    # Faster than asked for is no drive that lags.
    assert "CTL-05" in spoiled(1.095).codes


@BOTH
def test_the_holding_torque_is_learned_in_the_window_only(way):
    """0.010 deg beside the set-point something pushes: that torque holds nothing."""
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    law, off_rad = rig.axis._law, 0.0

    def shifted(*given):
        vel, pos, error = law(*given)
        return vel, pos, error + off_rad

    rig.axis._law = shifted
    rig.run(0.3)
    kept_nm = rig.axis.holding_torque_nm
    off_rad = way * rad(0.010)
    rig.spoil = lambda drive: drive._replace(torque_act_nm=100.0)
    rig.run(0.5)
    assert rig.axis.holding_torque_nm == kept_nm
    off_rad = 0.0
    rig.run(0.5)
    assert rig.axis.holding_torque_nm > kept_nm + 10.0


@BOTH
@PERIODS
def test_an_encoder_that_froze_at_rest_is_seen_before_the_axis_goes_far(period_s, way):
    rig = Rig(config=settings(period_s=period_s))
    rig.power_up()
    held = rig.drive.read().pos_act_counts
    # Position and speed are of the same encoder.
    rig.spoil = lambda drive: drive._replace(pos_act_counts=held, vel_act_rad_s=0.0)
    start = rig.drive.pos_rad
    rig.move(way * 50.0)
    expect(rig, "ENC-02", Reaction.TORQUE_OFF, 1.0)
    assert abs(rig.drive.pos_rad - start) < rad(0.35), "class M-0"


@PERIODS
def test_readings_are_too_old_after_30_ms(period_s):
    rig = moving_rig(speed_deg_s=0.6, config=settings(period_s=period_s))
    frozen, age = rig.drive.read(), 0

    def old(drive):
        nonlocal age
        age += 1
        return frozen._replace(age_scans=age)

    rig.spoil = old
    scans = 0
    while not rig.codes:
        rig.step()
        scans += 1
        assert scans < 100
    # At least three scans; whole ones: 28 ms of 4 ms each, where 32 would be more than 30.
    assert scans == {0.001: 30, 0.004: 7, 0.010: 3}[period_s]
    assert rig.codes == ["CAN-07"]


@BOTH
@pytest.mark.parametrize("what", ["speed", "torque"])
def test_no_command_beyond_a_limit_leaves_the_program(what, way):
    rig = Rig()
    rig.power_up()
    if what == "speed":
        law = rig.axis._law
        # The clamp is 6.3 deg/s at the gantry.
        rig.axis._law = lambda *given: (way * rad(6.31) * RATIO, *law(*given)[1:])
    else:
        rig.axis.power.torque_ff_nm = way * 386.0
    rig.step()
    assert rig.codes == ["CTL-02"]
    assert rig.output.vel_cmd_rad_s == 0.0
    assert abs(rig.output.torque_ff_nm) <= 385.0
    rig.step()
    assert rig.axis.state is AxisState.ERROR_STOP


def test_a_doubted_angle_is_reset_by_service_only():
    """An alarm that an operator may reset, of a reading that is in doubt."""
    rig = Rig()
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(pos_act_counts=math.nan)
    rig.step()
    rig.spoil = None
    rig.run(2.0)
    assert rig.codes == ["CTL-02"]
    rig.op(power=False, reset=True)
    assert "position" in rig.refused()
    rig.op(reset=False)
    assert not rig.axis.feedback.position_valid
    rig.program.service = True
    rig.op(reset=True)
    rig.run(0.1)
    assert rig.axis.feedback.position_valid
    assert rig.codes == []
