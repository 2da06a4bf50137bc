"""The torque proof, its ramp to the preload, the holding torque that is learned: both ways; figures by hand."""

import math

import pytest

from gantryctl.program import Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.power.holding_torque import HoldingTorque
from gantryctl.program.power.torque_proof import TorqueProof
from gantryctl.program.power.twist import Twist
from unit.program.parts import BOTH, PERIODS, Parts
from unit.program.rig import settings

approx = pytest.approx


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


# N m and counts of each scan of 10 ms from the one in which 30 N m were asked for, 2.2 s after a stop by the brake: a
# load that swings turns the shaft against the torque, and the 4 counts by the torque are lost in it.
_SWINGING = (
    (0.0, 0), (0.3, -1), (30.1, 0), (30.1, 0), (30.6, -1), (27.5, -2), (24.9, -4), (21.6, -5), (18.8, -7), (15.9, -7),
    (15.9, -9), (16.2, -10),
)  # fmt: skip


@BOTH
@pytest.mark.parametrize(
    ("at_once", "codes"),
    [(0, []), (-2, ["ENC-12"]), (-4, ["ENC-12"])],
    ids=["turned with it", "not at all", "turned against it"],
)
def test_a_load_that_swings_makes_no_wrong_sign_of_a_shaft_that_the_torque_turned_at_once(
    way, at_once, codes
):
    """From -1 to 0 where the swing goes on to -2: by 2 counts the torque has turned the shaft as it came.

    The same swing with a wrong sign of the torque's part, and without any: the swing alone shows nothing.
    """
    parts = Parts(0.010, monitors={"encoder_shows_twist": True})
    proof, _ = proof_of(parts, way * 15.0)
    begun, given = parts.feedback.counts, False
    for scans, (torque_nm, counts) in enumerate(_SWINGING[1:], start=1):
        parts.feedback.torque_nm = way * torque_nm
        parts.feedback.counts = begun + way * (counts + (at_once if torque_nm > 1.0 else 0))
        if given:
            proof.settling_torque_nm(scans - 2)
        else:
            given = proof.given(scans)
    assert given
    assert proof.settled(10) is not bool(codes)
    assert parts.codes == codes
    assert parts.feedback.in_doubt is bool(codes)


@BOTH
@pytest.mark.parametrize(("turned", "codes"), [(4, []), (0, ["ENC-12"])])
def test_what_the_shaft_turned_on_as_before_is_not_the_torque(way, turned, codes):
    """4 counts in each scan of 4 ms against the torque, which comes within two scans."""
    parts = Parts(0.004, monitors={"encoder_shows_twist": True})
    proof, _ = proof_of(parts, way * 15.0)
    begun = parts.feedback.counts
    for scans, torque_nm in enumerate((0.0, 0.0, 12.0, 30.0), start=1):
        parts.feedback.torque_nm = way * torque_nm
        parts.feedback.counts = begun - way * (4 * scans - (turned if scans == 4 else 0))
        given = proof.given(scans)
    assert given
    assert proof.settled(26) is not bool(codes)
    assert parts.codes == codes


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
@pytest.mark.parametrize(
    ("turns_deg_s", "codes"), [(0.1, ["DRV-14"]), (0.0, ["DRV-14"]), (-0.019, ["DRV-14"]), (-0.1, ["ENC-12"])]
)
def test_too_much_torque_is_a_wrong_reading_of_it_unless_the_shaft_turns_against_it(way, turns_deg_s, codes):
    """A brake that slips turns with the torque; a shaft that turns against 91 N m is read with the wrong sign."""
    parts = Parts()
    proof, _ = proof_of(parts, way * 12.0)
    parts.feedback.torque_nm = way * 91.0
    parts.turn(way * turns_deg_s)
    assert not proof.given(1)
    assert parts.codes == codes
    assert parts.feedback.in_doubt is (codes == ["ENC-12"])


@BOTH
@pytest.mark.parametrize(
    ("counts", "stood"), [(0.0, True), (0.99, True), (1.0, False), (-0.99, True), (-1.0, False)]
)
def test_a_reading_that_shows_nothing_while_torque_goes_is_frozen(counts, stood, way):
    """A count either way is enough: behind a stop the load swings too."""
    parts = Parts(monitors={"encoder_shows_twist": True})
    twist = Twist(parts.settings, parts.feedback)
    twist.begin(-30.0 * way)
    parts.feedback.counts += counts
    twist.scan()
    parts.feedback.counts -= counts
    twist.scan()
    assert twist.stood(-30.0 * way) is stood
    assert parts.codes == (["ENC-02"] if stood else [])


@BOTH
@pytest.mark.parametrize(("torque_nm", "asked"), [(1.64, False), (1.65, True)])
def test_a_torque_that_turns_the_shaft_by_less_than_a_step_asks_nothing(torque_nm, asked, way):
    parts = Parts(monitors={"encoder_shows_twist": True, "twist_least_nm": 1.65})
    twist = Twist(parts.settings, parts.feedback)
    twist.begin(way * torque_nm)
    twist.scan()
    assert twist.shown(way * torque_nm) is not asked
    assert parts.codes == (["ENC-02"] if asked else [])


def test_an_encoder_of_coarse_steps_may_show_nothing_while_torque_goes():
    parts = Parts()
    twist = Twist(parts.settings, parts.feedback)
    twist.begin(-30.0)
    twist.scan()
    assert not twist.stood(-30.0)
