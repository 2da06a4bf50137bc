"""An encoder that shows nothing, or the wrong way, before power, at standstill, in a stop; couplings that slip.

Judged by the true angle of the motor; and nothing of it on a sound machine.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from gantryctl.program import Code, PowerPhase
from gantryctl.units import rad
from plant.plant_rig import AT_EVERY_SCAN_MS, CHECK_NM, PlantRig, at_scans, machine_at

NOMINAL_NM = 16_000.0
LIMIT_DEG = {6.0: 4.5, 3.0: 2.1, 1.0: 0.8}
STANDSTILL_DEG = 0.35
MOMENTS = pytest.mark.parametrize("moment_nm", [NOMINAL_NM, CHECK_NM])
WRONG = pytest.mark.parametrize("gain", [0.0, -1.0], ids=["frozen", "sign"])


def assert_in_doubt(rig: PlantRig, limit_deg: float, *codes: Code) -> None:
    assert rig.reach_deg <= limit_deg, rig.codes
    first = rig.axis.alarms.first_out
    assert first is not None
    assert first.code in codes, first.text
    assert rig.axis.feedback.in_doubt
    assert rig.phase is PowerPhase.OFF
    assert "axis moved" not in first.text
    assert first.definition.lock


@WRONG
@MOMENTS
@AT_EVERY_SCAN_MS
def test_the_torque_proof_shows_a_wrong_encoder_behind_the_closed_brake(
    scan_ms: float, moment_nm: float, gain: float
) -> None:
    rig = PlantRig(machine_at(scan_ms, moment_nm), holding_nm=moment_nm / 1144.0)
    rig.sim.encoder_gain = gain
    rig.mark()
    rig.say(power=True)
    rig.run(2.0)
    # 40 counts of the closed brake's elastic way.
    assert_in_doubt(rig, 1e-4, Code.ENC_02 if gain == 0.0 else Code.ENC_12)


def braced(scan_ms: float, holding_nm: float, brace_nm: float, gain: float = 1.0) -> PlantRig:
    """A gantry whose two motors the drive braces against each other, with power asked for."""
    second = {"plant.switches.second_pinion": True, "plant.second_pinion.preload_nm": brace_nm}
    rig = PlantRig(machine_at(scan_ms, **second), 45.0, holding_nm=holding_nm)
    rig.sim.encoder_gain = gain
    rig.mark()
    rig.say(power=True)
    return rig


BRACED = pytest.mark.parametrize(("holding_nm", "brace_nm"), [(12.0, 35.0), (-12.0, 35.0), (-12.0, -35.0)])


@BRACED
@AT_EVERY_SCAN_MS
def test_the_proof_counts_from_where_two_motors_that_brace_each_other_have_turned_the_shaft(
    scan_ms: float, holding_nm: float, brace_nm: float
) -> None:
    """Coming on they turn it by 29 counts against the closed brake, with the proof torque or against it."""
    rig = braced(scan_ms, holding_nm, brace_nm)
    rig.until(lambda: rig.phase is PowerPhase.PROVING, 0.1)
    begun = rig.axis.feedback.counts
    rig.run(0.010)
    # Each motor has half of the 30 N m: 12 of the 25 counts; two for the load that winds up meanwhile.
    assert (rig.axis.feedback.counts - begun) * holding_nm / 12.0 == pytest.approx(12.0, abs=3.0)
    rig.run(0.5)
    assert rig.phase is PowerPhase.ON, rig.texts


@WRONG
@BRACED
@AT_EVERY_SCAN_MS
def test_two_motors_that_brace_each_other_hide_no_wrong_encoder(
    scan_ms: float, holding_nm: float, brace_nm: float, gain: float
) -> None:
    """The load that winds up behind the proof may turn a mirrored reading back: then it shows as the brake opens."""
    rig = braced(scan_ms, holding_nm, brace_nm, gain)
    rig.run(2.0)
    assert_in_doubt(rig, STANDSTILL_DEG, *((Code.ENC_02,) if gain == 0.0 else (Code.ENC_12, Code.ENC_14)))


@WRONG
@MOMENTS
@AT_EVERY_SCAN_MS
def test_without_a_proof_it_shows_when_the_brake_has_opened(
    scan_ms: float, moment_nm: float, gain: float
) -> None:
    """A drive without 60B2, and no torque learned: the load begins to fall."""
    rig = PlantRig(machine_at(scan_ms, moment_nm))
    rig.axis.power._settings = replace(rig.axis.power._settings, torque_preload=False)
    rig.sim.encoder_gain = gain
    rig.mark()
    rig.say(power=True)
    rig.run(2.5)
    assert_in_doubt(rig, STANDSTILL_DEG, *((Code.ENC_02,) if gain == 0.0 else (Code.ENC_12, Code.ENC_14)))


@WRONG
@MOMENTS
@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("angle_deg", [90.0, 0.0, -60.0])
def test_at_standstill(angle_deg: float, scan_ms: float, moment_nm: float, gain: float) -> None:
    rig = PlantRig(machine_at(scan_ms, moment_nm), angle_deg, holding_nm=moment_nm / 1144.0)
    rig.power_up()
    rig.sim.encoder_gain = gain
    rig.mark()
    rig.run(3.0)
    if gain == 0.0:
        assert_in_doubt(rig, STANDSTILL_DEG, Code.ENC_02)
    elif rig.first:
        assert_in_doubt(rig, STANDSTILL_DEG, Code.ENC_12, Code.ENC_14)
    else:
        # Perfectly balanced nothing moves, and the sign shows in the first motion.
        assert angle_deg == 0.0
        assert rig.reach_deg < 0.001


@pytest.mark.parametrize("scan_ms", [4.0, 10.0])
def test_at_standstill_while_the_load_still_swings(scan_ms: float) -> None:
    """The loop stands 0.0001 deg beside its set-point as the reading freezes, and adds that up.

    Asked by its time alone it turned the shaft by 0.318 deg at scans of 10 ms, by 0.357 deg in seed 4462; asked as the
    torque goes away by 0.025 deg.
    """
    rig = PlantRig(machine_at(scan_ms, NOMINAL_NM), holding_nm=NOMINAL_NM / 1144.0)
    rig.power_up()
    rig.say(move=True, target_rad=rad(93.0), speed_rad_s=rad(6.0))
    rig.say(move=False)
    rig.until(lambda: rig.axis.virtual.at_rest, 10.0)
    rig.until(lambda: abs(rig.axis.pos_err_rad) > rad(0.0001), 1.0)
    rig.sim.encoder_gain = 0.0
    rig.mark()
    rig.run(3.0)
    assert_in_doubt(rig, 0.3 * STANDSTILL_DEG, Code.ENC_02)


def frozen_at_rest(**brake: object) -> PlantRig:
    """The encoder freezes 0.3 s after a move, at scans of 10 ms; until the shaft is moved to and fro."""
    rig = PlantRig(machine_at(10.0, NOMINAL_NM, **brake), holding_nm=NOMINAL_NM / 1144.0)
    rig.power_up(0.3)
    rig.say(move=True, target_rad=rad(93.0), speed_rad_s=rad(6.0))
    rig.say(move=False)
    rig.until(lambda: rig.axis.virtual.at_rest, 10.0)
    rig.run(0.3)
    rig.sim.encoder_gain = 0.0
    rig.mark()
    rig.until(lambda: rig.axis.liveness.asking, 1.0)
    return rig


def test_the_brake_closes_behind_an_answer() -> None:
    """Behind the brake nobody can ask: the time of hold by brake ends here in the scan after the question began."""
    rig = frozen_at_rest(**{"brake.hold": "servo"})
    hold_s = (rig.axis.monitors.rest_scans + 1) * rig.period_s
    rig = frozen_at_rest(**{"brake.hold": "brake", "brake.hold_brake_after_s": round(hold_s, 6)})
    rig.run(2.0)
    assert_in_doubt(rig, STANDSTILL_DEG, Code.ENC_02)


@AT_EVERY_SCAN_MS
@MOMENTS
@pytest.mark.parametrize("late_s", [0.0, 0.06])
def test_the_sign_turns_while_the_brake_closes(late_s: float, moment_nm: float, scan_ms: float) -> None:
    """The drive pushes the shaft on with all its torque until the brake has closed: 1.06 deg/s, unless it is seen."""
    rig = PlantRig(machine_at(scan_ms, moment_nm), 90.0, holding_nm=moment_nm / 1144.0)
    rig.power_up()
    rig.say(power=False)
    rig.until(lambda: rig.phase is PowerPhase.CLOSING, 1.0)
    rig.run(late_s)
    rig.sim.encoder_gain = -1.0
    rig.mark()
    rig.run(2.0)
    if rig.first:
        assert_in_doubt(rig, 0.1 * STANDSTILL_DEG, Code.ENC_12, Code.ENC_14)
    else:
        # The brake was first: the told angle is off by twice as little, and the next torque proof shows the sign.
        assert late_s
        assert rig.reach_deg < 0.001


@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("angle_deg", [90.0, -90.0])
def test_the_swing_of_a_sound_load_does_not_turn_the_shaft_against_the_torque(
    angle_deg: float, scan_ms: float
) -> None:
    """After a quick stop from full speed with the check moment, until power is off: a fifth of what is a wrong sign.

    By hand: a swing of the load at w = 15 rad/s with all of the torque limit T = 385 N m gives a PI speed loop
    (K = 77.7 N m s/rad, Ti = 10 ms) a speed of T w Ti / K = 0.74 rad/s at the motor, 0.037 deg/s at the gantry.
    """
    rig = PlantRig(machine_at(scan_ms, CHECK_NM, **{"virtual_axis.acc_deg_s2": 2.0}), angle_deg - 20.0)
    rig.power_up(0.5)
    rig.say(move=True, target_rad=rad(angle_deg + 40.0), speed_rad_s=rad(6.0))
    rig.until(lambda: rig.motor_deg >= angle_deg - 3.0)
    rig.say(quick_stop=True)
    rig.until(lambda: rig.phase is PowerPhase.CLOSING, 4.0)
    fastest = 0.0
    while rig.phase in (PowerPhase.CLOSING, PowerPhase.UNLOADING):
        reading = rig.axis.feedback
        if reading.torque_nm * reading.vel_rad_s < 0.0:
            fastest = max(fastest, abs(rig.motor_deg_s))
        rig.step()
    assert 0.0 < fastest < 0.037
    assert rig.codes == ["INT-06"]


@at_scans(10.0, left_s=[0.15, 0.08, 0.03, 0.0, -0.03], moment_nm=[NOMINAL_NM, CHECK_NM])
def test_frozen_in_the_last_instants_of_a_quick_stop(left_s: float, moment_nm: float, scan_ms: float) -> None:
    """Too slow for the speed to show it: then the torque does, which goes on as it braked."""
    rig = PlantRig(machine_at(scan_ms, moment_nm), 30.0)
    rig.power_up()
    rig.cruise_to(32.0, 1.0, 1.0)
    rig.say(quick_stop=True)
    rig.run(1.0 / 5.5 - left_s)
    rig.sim.encoder_gain = 0.0
    rig.mark()
    rig.run(3.0)
    assert rig.reach_deg <= STANDSTILL_DEG
    assert rig.axis.feedback.in_doubt or rig.reach_deg <= 0.03, rig.codes
    assert rig.phase in (PowerPhase.OFF, PowerPhase.TORQUE_HOLD)


@at_scans(10.0, gain=[0.02, 0.1, 0.5], sign=[1.0, -1.0], speed=[6.0, 3.0, 1.0])
def test_a_coupling_that_slips(gain: float, sign: float, speed: float, scan_ms: float) -> None:
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), 90.0 - 55.0 * sign)
    rig.power_up()
    rig.cruise_to(90.0 - 15.0 * sign, speed, sign)
    rig.sim.encoder_gain = gain
    rig.mark()
    rig.run(3.0)
    assert_in_doubt(rig, LIMIT_DEG[speed], Code.ENC_14)


@pytest.mark.parametrize(("scan_ms", "speed"), [(1.0, 3.0), (4.0, 3.0), (10.0, 6.0)])
def test_a_tenth_that_slips_at_once_is_seen_from_a_fifth_of_a_degree_per_second_on(
    scan_ms: float, speed: float
) -> None:
    """Less, or slowly, is no change that torque could not have made: only a load-side encoder shows it."""
    rig = PlantRig(machine_at(scan_ms), 20.0)
    rig.power_up()
    rig.cruise_to(60.0, speed, 1.0)
    rig.sim.encoder_gain = 0.9
    rig.mark()
    rig.run(3.0)
    assert_in_doubt(rig, LIMIT_DEG[speed], Code.ENC_14)


@AT_EVERY_SCAN_MS
@pytest.mark.parametrize(
    ("moment_nm", "feedback"),
    [
        (0.0, "interpolated"),
        (NOMINAL_NM, "interpolated"),
        (CHECK_NM, "interpolated"),
        (NOMINAL_NM, "ideal"),
    ],
)
def test_a_sound_encoder_may_stand_still(moment_nm: float, feedback: str, scan_ms: float) -> None:
    """Balanced at 0 deg the reading stands to the count: it is tried, it answers, and the axis stays where it is."""
    changes = {"drive.speed_loop.feedback": feedback}
    for angle_deg in (0.0, 90.0):
        rig = PlantRig(machine_at(scan_ms, moment_nm, **changes), angle_deg)
        rig.power_up()
        rig.mark()
        rig.run(6.0)
        assert not rig.codes
        # 64 counts of 2^22 turn the gantry by 5e-6 deg.
        assert rig.reach_deg < 3e-5
        if angle_deg == 90.0 and moment_nm and feedback == "interpolated":
            assert rig.axis.liveness.dithers == 0, "a load keeps the count alive"
