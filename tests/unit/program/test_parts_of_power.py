"""Each judge of the power sequence on both sides of its limit, both ways, at each scan period; figures by hand."""

import math

import pytest

from gantryctl.image import DigitalInputs, DriveState
from gantryctl.program import BrakeTestOutcome, BrakeTestPhase, Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.power.brake_test import BrakeTest
from gantryctl.program.power.hold_watch import HoldWatch
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.power.ramp_watch import RampWatch
from gantryctl.program.power.rest import RestWatch
from gantryctl.program.power.slip_watch import SlipWatch
from gantryctl.program.power.torque_proof import TorqueProof
from gantryctl.program.power.wear import BrakeWear
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans
from unit.program.rig import settings

approx = pytest.approx

# --- the ramp of a drive that stops by itself: 6 deg/s at 5.5 deg/s2 --------------------------------------------------


def ramp_of(parts, speed_at):
    """Seconds until the alarm; `speed_at` gives the speed after so many seconds."""
    watch = RampWatch(parts.settings, parts.feedback, parts.alarms)
    parts.turn(speed_at(0.0))
    watch.begin()
    scans = 0

    def scan():
        nonlocal scans
        scans += 1
        parts.turn(speed_at(scans * parts.period_s))
        assert watch.obeyed(scans * parts.period_s) == (not parts.codes)

    return parts.after(scan, most_s=6.0)


@BOTH
@PERIODS
def test_a_drive_on_its_ramp_with_the_permitted_swing_is_believed_until_it_should_stand(period_s, way):
    """59 ms of reaction, then 5.5 deg/s2 with 0.45 deg/s to spare, which are too much from 0.25 s after the ramp on."""
    parts = Parts(period_s)
    seconds = ramp_of(parts, lambda t: way * (max(0.0, 6.0 - 5.5 * max(0.0, t - 0.059)) + 0.45 * (t > 0.059)))
    assert seconds == approx(6.0 / 5.5 + 0.25 + 0.05, abs=1.01 * period_s)
    assert parts.codes == ["DRV-07"]
    assert parts.reaction("DRV-07") is Reaction.TORQUE_OFF


@PERIODS
def test_a_drive_that_never_comes_to_rest_is_not_waited_for(period_s):
    """Now and then slower than what counts as rest, never for 50 ms, and never faster for so long: 6 / 5.5 + 3 s."""
    parts = Parts(period_s)
    seconds = ramp_of(parts, lambda t: max(6.0 - 5.5 * t, 0.06 if int(t / 0.03) % 2 else 0.04))
    assert seconds == approx(6.0 / 5.5 + 3.0, abs=1.01 * period_s)
    assert parts.codes == ["DRV-07"]


@BOTH
@PERIODS
def test_a_drive_that_swings_beyond_its_ramp_is_told_after_50_ms(period_s, way):
    """Nothing for 1.3 s, where the ramp has ended after 1.15 s; then 0.51 deg/s."""
    parts = Parts(period_s)
    seconds = ramp_of(parts, lambda t: way * (max(0.0, 6.0 - 5.5 * t) if t < 1.3 else 0.51))
    assert seconds == approx(1.3 + 0.05, abs=1.01 * period_s)


@PERIODS
def test_a_short_excess_over_the_ramp_is_forgotten(period_s):
    """Twice 39 ms at most, with 20 ms between them, are not 50 ms."""
    parts = Parts(period_s)
    seconds = ramp_of(
        parts, lambda t: 0.6 if 2.0 < t <= 2.039 or 2.060 < t <= 2.099 else max(0.0, 6.0 - 5.5 * t)
    )
    assert seconds > 4.0


# --- HOLD -------------------------------------------------------------------------------------------------------------


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


# --- slip -------------------------------------------------------------------------------------------------------------


@BOTH
@pytest.mark.parametrize(("degrees", "slips"), [(0.0199, False), (0.0201, True)])
def test_a_shaft_behind_the_brake_may_move_by_0_02_deg(way, degrees, slips):
    parts = Parts()
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(rad(30.0), unwinds=False)
    assert watch.slipped(rad(30.0 + way * degrees), Code.BRK_10) is slips
    watch.begin(rad(30.0), unwinds=False)
    assert watch.slipped_without_torque(rad(30.0 + way * degrees), 1.0, Code.BRK_04) is slips
    # What was set anew counts from where it is.
    watch.rebase()
    assert not watch.slipped(rad(-100.0), Code.BRK_10)
    assert watch.slipped(rad(-100.0 + way * degrees), Code.BRK_10) is slips


@BOTH
@pytest.mark.parametrize(
    ("degrees", "at_s", "slips"),
    [(0.049, 0.29, False), (0.051, 0.29, True), (0.049, 0.31, False), (0.051, 0.31, True)],
)
def test_a_gear_may_unwind_by_0_03_deg_more_for_300_ms(way, degrees, at_s, slips):
    parts = Parts()
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    watch.begin(0.0, unwinds=True)
    assert watch.slipped_without_torque(rad(way * degrees), at_s, Code.BRK_04) is slips
    # From then on it counts from there, and as any other: 0.021 deg back.
    if not slips:
        back = rad(way * (degrees - 0.021))
        assert watch.slipped_without_torque(back, at_s + 0.02, Code.BRK_04) is (at_s > 0.3)


@BOTH
@PERIODS
def test_a_doubted_reading_that_jumps_is_no_slip_and_one_that_turns_is(period_s, way):
    parts = Parts(period_s)
    watch = SlipWatch(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.in_doubt = True
    watch.begin(0.0, unwinds=False)
    parts.turn(way * 0.019)
    assert not watch.slipped_without_torque(rad(way * 5.0), 1.0, Code.BRK_04)
    # It counts from there on; with the speed of a shaft that turns it is believed after 50 ms.
    parts.turn(way * 0.021)
    assert not watch.slipped_without_torque(rad(way * 5.019), 1.0, Code.BRK_04)
    turns = parts.after(lambda: watch.slipped_without_torque(rad(way * 6.0), 1.0, Code.BRK_04), most_s=0.5)
    assert turns == approx(in_scans(0.050, period_s))


# --- torque -----------------------------------------------------------------------------------------------------------


def proof_of(parts, holding_nm=0.0):
    parts.holding.mean_nm = holding_nm
    parts.holding.preload()
    proof = TorqueProof(parts.settings, parts.feedback, parts.alarms, parts.holding)
    return proof, proof.begin()


@BOTH
@pytest.mark.parametrize(
    ("torque_nm", "proven", "codes"),
    [(23.9, False, []), (24.0, True, []), (89.9, True, []), (90.1, False, ["DRV-14"]), (-24.0, False, []),
     (-89.9, False, []), (-90.1, False, ["DRV-14"]), (math.nan, False, ["DRV-14"])],
)  # fmt: skip
def test_80_percent_of_30_nm_prove_it_and_60_more_are_a_wrong_reading(way, torque_nm, proven, codes):
    parts = Parts()
    proof, asked = proof_of(parts, way * 12.0)
    assert asked == way * 30.0
    parts.feedback.torque_nm = way * torque_nm
    assert proof.given(1) is proven
    assert parts.codes == codes
    assert parts.holding.believed is not bool(codes)
    if codes:
        assert parts.reaction("DRV-14") is Reaction.QUICK_STOP


@PERIODS
def test_the_motor_has_half_a_second_to_give_the_proof(period_s):
    parts = Parts(period_s)
    proof, _ = proof_of(parts)
    scans = 0

    def scan():
        nonlocal scans
        scans += 1
        proof.given(scans)

    assert parts.after(scan, most_s=1.0) == approx(0.5 + period_s)
    assert parts.codes == ["BRK-07"]


@BOTH
@PERIODS
def test_from_the_proof_to_the_preload_in_50_ms_and_as_long_again(period_s, way):
    parts = Parts(period_s)
    proof, _ = proof_of(parts, way * 10.0)
    ramp = math.ceil(0.050 / period_s - 1e-9)  # 50, 13 and 5 scans
    assert proof.settling_torque_nm(ramp) == approx(way * 10.0)
    assert proof.settling_torque_nm(5 * ramp) == approx(way * 10.0)
    assert proof.settling_torque_nm(1) == approx(way * (30.0 - 20.0 / ramp))
    assert not proof.settled(2 * ramp - 1)
    assert proof.settled(2 * ramp)


@BOTH
@pytest.mark.parametrize(("counts", "codes"), [(1, []), (0, ["ENC-02"]), (-1, ["ENC-12"]), (25, [])])
def test_a_fine_encoder_shows_the_turn_against_the_brake_in_the_direction_of_the_torque(way, counts, codes):
    parts = Parts(monitors={"encoder_shows_twist": True})
    proof, _ = proof_of(parts, way * 12.0)
    parts.feedback.torque_nm = way * 30.0
    begun = parts.feedback.counts
    parts.feedback.counts = begun + way * counts
    proof.given(1)
    parts.feedback.counts = begun  # the load swings back
    for scans in range(99):
        proof.settling_torque_nm(scans)
    assert proof.settled(100) is not bool(codes)
    assert parts.codes == codes
    assert parts.feedback.in_doubt is bool(codes)
    if codes == ["ENC-02"]:
        assert parts.alarms.active[Code.ENC_02].values["time_ms"] == approx(100.0)


@BOTH
@PERIODS
def test_the_holding_torque_is_learned_within_its_second_and_below_60_percent_of_the_rated_torque(
    period_s, way
):
    holding = HoldingTorque(settings(period_s=period_s))
    for _ in range(round(1.0 / period_s)):
        holding.learn(way * 100.0)
    assert holding.mean_nm == approx(way * 63.2, abs=0.3)  # 1 - 1/e
    kept = holding.mean_nm
    # 154.2 of 257 N m
    for wrong in (154.3, math.nan, math.inf):
        holding.learn(way * wrong)
        holding.learn(-way * wrong)
    assert holding.mean_nm == kept
    holding.believed = False
    holding.learn(0.0)
    assert holding.mean_nm == kept
    holding.believed = True
    holding.learn(way * 154.1)
    assert abs(holding.mean_nm) > abs(kept)


@BOTH
@PERIODS
def test_rest_is_50_ms_below_a_fiftieth_of_a_degree_per_second_and_300_ms_after_a_brake_stop(period_s, way):
    parts = Parts(period_s)
    rest = RestWatch(parts.settings, parts.feedback)
    parts.turn(way * 0.0201)
    assert parts.after(rest.scan, rest.scan, 0.5) == math.inf
    rest.begin()
    parts.turn(way * 0.0199)
    found = []
    assert parts.after(lambda: found.append(rest.scan()), lambda: found[-1]) == approx(
        in_scans(0.050, period_s)
    )
    assert not rest.after_brake_stop
    left = parts.after(rest.scan, lambda: rest.after_brake_stop)
    assert left == approx(in_scans(0.300, period_s) - in_scans(0.050, period_s))
    parts.turn(way * 0.021)
    assert not rest.scan()
    parts.turn(0.0)
    assert not rest.scan(), "it counts anew"
    assert not rest.after_brake_stop


@BOTH
@PERIODS
def test_what_the_brake_takes_is_its_torque_times_the_angle_of_the_motor(period_s, way):
    """400 N m, 1 s at 6 deg/s: 6 x 1144 deg of the motor are 119.8 rad, 47.9 kJ."""
    parts = Parts(period_s)
    wear = BrakeWear(parts.settings, parts.feedback, parts.alarms)
    parts.feedback.brake_open = False
    parts.turn(way * 6.0)
    for _ in range(round(1.0 / period_s)):
        wear.scan()
    assert wear.energy_j == approx(47.92e3, rel=1e-3)
    kept = wear.energy_j
    parts.feedback.brake_open = True
    wear.scan()
    parts.feedback.brake_open, parts.feedback.in_doubt = False, True
    wear.scan()
    assert wear.energy_j == kept
    # A scan that was missed was a scan of the stop, too.
    parts.feedback.in_doubt, parts.feedback.periods = False, 3
    wear.scan()
    assert wear.energy_j - kept == approx(3.0 * 47.92e3 * period_s, rel=1e-3)


def test_a_stop_by_the_brake_counts_above_a_tenth_of_a_degree_per_second():
    parts = Parts(brake_stops_max=5)
    wear = BrakeWear(parts.settings, parts.feedback, parts.alarms)
    wear.restore(2)
    wear.begin(rad(0.099))
    assert wear.stops == 0
    wear.begin(rad(0.101))
    wear.begin(math.nan)
    assert (wear.stops, parts.codes) == (2, [])
    wear.begin(rad(6.0))
    assert (wear.stops, parts.codes) == (3, ["BRK-09"])


def test_brake_stops_of_earlier_runs_are_told_at_once():
    parts = Parts(brake_stops_max=5)
    BrakeWear(parts.settings, parts.feedback, parts.alarms).restore(4)
    assert parts.codes == []
    BrakeWear(parts.settings, parts.feedback, parts.alarms).restore(5)
    assert parts.codes == ["BRK-09"]


# --- the brake test as a law: 65 N m beside 12 that hold the load, the motor gives what it is asked for ---------------

LEVEL_NM, HOLD_NM = 65.0, 12.0
P = BrakeTestPhase


class Motor:
    """A motor that gives what it was asked for a scan before, unless a test says otherwise."""

    def __init__(self, period_s=0.001):
        self.test = BrakeTest(LEVEL_NM, rad(0.02), 385.0, period_s)
        self.period_s, self.torque_nm, self.pos_rad = period_s, HOLD_NM, 0.0
        self.gives = lambda asked_nm: asked_nm
        self.test.prepare(HOLD_NM)
        self.test.begin()

    def scan(self):
        self.torque_nm = self.gives(self.test.scan(self.torque_nm, self.pos_rad))

    def to(self, phase, most_s=10.0):
        """Seconds until a phase begins."""
        for scans in range(1, math.ceil(most_s / self.period_s) + 1):
            self.scan()
            if self.test.phase is phase:
                return scans * self.period_s
        raise AssertionError(f"{phase} is not reached, {self.test.result}")


@PERIODS
def test_the_torque_goes_up_over_and_back_in_its_time(period_s):
    motor, slack_s = Motor(period_s), 3.01 * period_s + 0.02
    assert motor.test.left_s == approx(0.5 + 2.0 + 1.0 + 2.0 + 0.5)
    assert motor.to(P.PLUS_HELD) == approx(0.5, abs=slack_s)
    assert motor.test.left_s == approx(5.5)
    assert motor.torque_nm == approx(HOLD_NM + LEVEL_NM, abs=3.3)
    assert motor.to(P.MINUS_RISING) == approx(2.0, abs=1e-6)
    assert motor.to(P.MINUS_HELD) == approx(1.0, abs=slack_s)
    assert motor.torque_nm == approx(HOLD_NM - LEVEL_NM, abs=3.3)
    assert motor.to(P.RELIEVING) == approx(2.0, abs=1e-6)
    assert motor.test.outcome is BrakeTestOutcome.PASSED
    assert motor.to(P.DISABLING) == approx(0.5, abs=slack_s)
    assert motor.torque_nm == approx(HOLD_NM, abs=3.3)
    assert motor.test.plus_nm == approx(LEVEL_NM, rel=0.01)
    assert motor.test.minus_nm == approx(-LEVEL_NM, rel=0.01)


@PERIODS
@pytest.mark.parametrize(("phase", "time_s"), [(P.PLUS_RISING, 0.5 + 1.0), (P.MINUS_RISING, 1.0 + 1.0)])
@pytest.mark.parametrize(("share", "given"), [(0.951, True), (0.949, False)])
def test_95_percent_must_be_given_within_a_second_after_the_ramp(period_s, phase, time_s, share, given):
    """61.75 of 65 N m, either way."""
    motor = Motor(period_s)
    if phase is P.MINUS_RISING:
        motor.to(P.MINUS_RISING)
    sign = 1.0 if phase is P.PLUS_RISING else -1.0
    most_nm = share * LEVEL_NM
    motor.gives = lambda asked: HOLD_NM + sign * min(most_nm, sign * (asked - HOLD_NM))
    if given:
        motor.to(P.PLUS_HELD if sign > 0.0 else P.MINUS_HELD, time_s)
        return
    assert motor.to(P.RELIEVING) == approx(in_scans(time_s, period_s) + period_s)
    assert motor.test.outcome is BrakeTestOutcome.FAILED


@PERIODS
@pytest.mark.parametrize("phase", [P.PLUS_HELD, P.MINUS_HELD])
@pytest.mark.parametrize(("share", "outcome"), [(0.955, None), (0.945, BrakeTestOutcome.FAILED)])
def test_the_mean_of_two_seconds_must_be_95_percent(period_s, phase, share, outcome):
    motor = Motor(period_s)
    motor.to(phase)
    sign = 1.0 if phase is P.PLUS_HELD else -1.0
    motor.torque_nm = HOLD_NM + sign * share * LEVEL_NM
    motor.gives = lambda _: HOLD_NM + sign * share * LEVEL_NM
    for _ in range(round(1.99 / period_s)):
        motor.scan()
        assert motor.test.phase is phase
    for _ in range(math.ceil(0.02 / period_s)):
        motor.scan()
    assert motor.test.phase is not phase
    assert (motor.test.outcome is BrakeTestOutcome.FAILED) is (outcome is not None)


@pytest.mark.parametrize("phase", [P.PLUS_RISING, P.PLUS_HELD, P.MINUS_RISING, P.MINUS_HELD])
def test_torque_of_the_wrong_direction_passes_no_side(phase):
    """One side would be tested twice, the other not at all."""
    motor = Motor()
    if phase is not P.PLUS_RISING:
        motor.to(phase)
    sign = 1.0 if phase in (P.PLUS_RISING, P.PLUS_HELD) else -1.0
    motor.torque_nm = HOLD_NM - sign * LEVEL_NM
    motor.gives = lambda _: HOLD_NM - sign * LEVEL_NM
    # A second after the ramp, or the two seconds of holding.
    motor.to(P.RELIEVING, 2.01)
    assert motor.test.outcome is BrakeTestOutcome.FAILED
    plus, minus = math.isnan(motor.test.plus_nm), math.isnan(motor.test.minus_nm)
    assert (plus, minus) == (phase is P.PLUS_RISING, phase is not P.MINUS_HELD)


@PERIODS
@pytest.mark.parametrize(("left_nm", "time_s"), [(3.2, 0.5), (3.3, 1.5), (-3.2, 0.5), (-3.3, 1.5)])
def test_the_torque_is_back_at_5_percent_or_goes_off_after_a_second_and_a_half(period_s, left_nm, time_s):
    """3.25 of 65 N m, above or below what holds the load."""
    motor = Motor(period_s)
    motor.to(P.RELIEVING)
    sign = math.copysign(1.0, left_nm)
    motor.gives = lambda asked: HOLD_NM + sign * max(sign * (asked - HOLD_NM), abs(left_nm))
    assert motor.to(P.DISABLING) == approx(time_s, abs=1e-6 if time_s > 1.0 else 2.01 * period_s)


@BOTH
@pytest.mark.parametrize("phase", [P.PLUS_RISING, P.PLUS_HELD, P.MINUS_RISING, P.MINUS_HELD])
@pytest.mark.parametrize(("degrees", "fails"), [(0.0199, False), (0.0201, True), (math.nan, True)])
def test_a_brake_that_slips_ends_the_test_in_that_scan_without_a_ramp(way, phase, degrees, fails):
    motor = Motor()
    if phase is not P.PLUS_RISING:
        motor.to(phase)
    else:
        motor.scan()
    motor.pos_rad = way * rad(degrees)
    motor.scan()
    assert (motor.test.outcome is BrakeTestOutcome.FAILED) is fails
    assert (motor.test.on_brake_nm == 0.0) is fails
    assert (motor.test.phase in (P.RELIEVING, P.DISABLING)) is fails


@BOTH
def test_a_brake_that_bears_nothing_gets_no_more_than_twice_the_level(way):
    """The motor gives nothing: what is asked for grows to 12 + 130 N m, and on the other side to 12 - 130."""
    motor = Motor()
    if way < 0.0:
        motor.to(P.MINUS_RISING)
        for _ in range(1000):
            motor.scan()
    asked = []
    motor.gives = lambda nm: asked.append(nm) or HOLD_NM
    for _ in range(1400):
        motor.scan()
    assert max(way * nm for nm in asked) == approx(way * HOLD_NM + 130.0, abs=0.5)


@pytest.mark.parametrize(("preload_nm", "most_nm"), [(300.0, 385.0), (-300.0, -385.0)])
def test_no_torque_beyond_that_of_the_motor_is_asked_for(preload_nm, most_nm):
    test = BrakeTest(LEVEL_NM, rad(0.02), 385.0, 0.001)
    test.prepare(preload_nm)
    test.begin()
    asked = [test.scan(0.0, 0.0) for _ in range(1000)]
    assert max(asked, key=abs) == most_nm


def test_a_test_that_is_stopped_before_the_torque_is_on_its_way_off():
    test = BrakeTest(LEVEL_NM, rad(0.02), 385.0, 0.001)
    assert test.phase is P.IDLE
    assert not test.under_way
    test.prepare(0.0)
    assert test.phase is P.ENABLING
    assert test.under_way
    assert not test.running
    assert test.left_s == 0.0
    test.end(BrakeTestOutcome.ABORTED, Words.STOPPED)
    assert test.phase is P.DISABLING
    assert test.finish().outcome is BrakeTestOutcome.ABORTED
    assert test.count == 1
    assert test.phase is P.IDLE


def test_the_first_verdict_stays_but_for_a_brake_that_slips_afterwards():
    motor = Motor()
    motor.to(P.RELIEVING)
    motor.test.end(BrakeTestOutcome.ABORTED, Words.STOPPED)
    assert motor.test.outcome is BrakeTestOutcome.PASSED
    motor.to(P.DISABLING)
    motor.test.slipped_afterwards()
    assert motor.test.finish().outcome is BrakeTestOutcome.FAILED
    motor.test.prepare(HOLD_NM)
    assert motor.test.outcome is BrakeTestOutcome.NONE
    assert math.isnan(motor.test.plus_nm)
    motor.test.end(BrakeTestOutcome.ABORTED, Words.STOPPED)
    motor.test.slipped_afterwards()
    assert motor.test.finish().outcome is BrakeTestOutcome.ABORTED, "what was not tested has not failed"
