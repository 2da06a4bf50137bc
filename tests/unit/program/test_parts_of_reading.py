"""A reading that stands or turns against the torque: on both sides of its limit, both ways; figures by hand.

The reference machine: 385 N m at most, 257 rated, quick stop 5.5 deg/s2, permitted deviation of the speed 0.5 deg/s.
"""

import math

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.program.monitors.liveness import Liveness
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans

approx = pytest.approx

# --- a reading that stands, or turns against the torque ---------------------------------------------------------------


def lives(period_s=0.001, **monitors):
    parts = Parts(period_s, monitors={"encoder_still_time_s": 0.5, "torque_still_max_nm": 15.0} | monitors)
    return parts, Liveness(parts.settings, parts.feedback, parts.holding, parts.alarms)


@BOTH
@PERIODS
@pytest.mark.parametrize("ramp", [True, False], ids=["ramp", "one jump"])
def test_a_torque_that_goes_on_leaving_a_standing_count_is_asked_about_and_one_jump_is_not(
    period_s, way, ramp
):
    """20 N m more in every scan, above the bound of 15, is a speed loop; 300 N m at once is a wrong reading."""
    parts, watch = lives(period_s)
    scans = iter(range(10_000))

    def stand() -> None:
        scan = next(scans)
        parts.feedback.torque_nm = way * (20.0 * scan if ramp else 300.0 * (scan > 2))
        watch.stand(proven=True)

    seconds = parts.after(stand, lambda: watch.dithers > 0, most_s=1.0)
    # The count must have stood for 30 ms, three scans at least; else for the half second that anything may stand.
    asked_s = max(0.030, 3 * period_s) if ramp else 0.5
    assert seconds == approx(asked_s, abs=2.5 * period_s)
    # Under a torque that leaves there is no time for small questions: 4096 counts of 2^22 in 8 ms, else 8 of them.
    half_s = max(period_s, 0.008)
    assert watch.vel_rad_s * half_s * 2**22 / math.tau == approx(4096.0 if ramp else 8.0)


@BOTH
@PERIODS
@pytest.mark.parametrize("frozen", [True, False])
def test_a_reading_that_froze_at_the_end_of_a_motion_is_asked_about_in_the_first_scan_at_rest(
    period_s, way, frozen
):
    """The last 0.1 s of a ramp, in which the torque leaves by 20 N m: a sound count still changes in each scan."""
    parts, watch = lives(period_s)

    def move() -> None:
        parts.feedback.torque_nm += way * 200.0 * period_s
        parts.feedback.counts += 0.0 if frozen else 1.0
        watch.move()

    assert parts.after(move, most_s=0.1) == math.inf
    assert (watch.dithers, watch.vel_rad_s) == (0, 0.0)
    seconds = parts.after(lambda: watch.stand(proven=True), lambda: watch.dithers > 0, most_s=1.0)
    assert seconds == approx(period_s if frozen else 0.5, abs=1.5 * period_s)


def test_a_motion_ends_a_question():
    parts, watch = lives()
    parts.after(lambda: watch.stand(proven=True), lambda: watch.dithers > 0, most_s=1.0)
    assert watch.asking
    parts.after(watch.move, lambda: True)
    assert not watch.asking
    assert watch.vel_rad_s == 0.0


@BOTH
@PERIODS
@pytest.mark.parametrize(("torque_nm", "frozen"), [(26.9, False), (27.1, True), (math.nan, True)])
def test_a_count_that_stands_under_more_torque_than_moves_the_shaft_is_frozen(
    period_s, way, torque_nm, frozen
):
    """15 N m beside the 12 that hold the load, for 30 ms."""
    parts, watch = lives(period_s)
    parts.holding.mean_nm = way * 12.0
    parts.feedback.torque_nm = way * torque_nm
    seconds = parts.after(watch.stop, most_s=0.5)
    # The first scan sees the count for the first time.
    assert seconds == (approx(in_scans(0.030, period_s) + period_s) if frozen else math.inf)
    assert parts.codes == (["ENC-02"] if frozen else [])
    assert parts.feedback.in_doubt is frozen


@PERIODS
@pytest.mark.parametrize(("proven", "patience_s"), [(True, 0.500), (False, 0.050)])
def test_a_count_that_stands_is_tried_harder_each_time_and_then_frozen(period_s, proven, patience_s):
    """To and fro by 8, 64, 512 and 4096 counts, each way in 8 ms."""
    parts, watch = lives(period_s)
    tried, ways = [], []

    def scan():
        before, speed = watch.dithers, watch.vel_rad_s
        watch.stand(proven=proven)
        if watch.dithers > before:
            tried.append(parts.alarms.scan * period_s)
            ways.append(0.0)
        if ways and watch.vel_rad_s > 0.0:
            ways[-1] += watch.vel_rad_s * period_s
        assert watch.vel_rad_s >= 0.0 or speed <= 0.0, "a scan of nothing between forth and back"

    seconds = parts.after(scan, most_s=2.0)
    assert parts.codes == ["ENC-02"]
    assert tried[0] == approx(in_scans(patience_s, period_s) + period_s)
    per_count = 2.0 * math.pi / 2**22
    assert [way / per_count for way in ways] == approx([8.0, 64.0, 512.0, 4096.0])
    said = parts.alarms.active[Code.ENC_02].values
    assert said["measured"].values == {"value": 4096}
    assert said["time_ms"] == approx((seconds - period_s) * 1e3)
    assert seconds < patience_s + 4 * 0.016 + 40 * period_s


@PERIODS
def test_a_torque_that_leaves_while_the_shaft_is_asked_ends_the_small_questions(period_s):
    """5 N m more in every scan from the first try on: what comes behind it is the last."""
    parts, watch = lives(period_s)
    ways = []

    def scan():
        before = watch.dithers
        parts.feedback.torque_nm += 5.0 * (before > 0)
        watch.stand(proven=True)
        ways.extend([0.0] * (watch.dithers - before))
        if ways and watch.vel_rad_s > 0.0:
            ways[-1] += watch.vel_rad_s * period_s

    parts.after(scan, most_s=2.0)
    assert parts.codes == ["ENC-02"]
    assert [way * 2**22 / math.tau for way in ways] == approx([8.0, 4096.0])


def test_a_count_that_moves_at_the_first_try_lives():
    parts, watch = lives()

    def scan():
        watch.stand(proven=True)
        parts.feedback.counts += watch.vel_rad_s * parts.period_s * 2**22 / (2.0 * math.pi)

    assert parts.after(scan, most_s=3.0) == math.inf
    assert 4 <= watch.dithers <= 6
    assert parts.feedback.counts == approx(parts.feedback.counts // 1, abs=8.0)


def test_the_shaft_is_back_where_it_was_after_a_try():
    _, watch = lives()
    parts, watch = lives()
    way = 0.0

    def scan():
        nonlocal way
        watch.stand(proven=True)
        way += watch.vel_rad_s * parts.period_s

    parts.after(scan, lambda: watch.dithers == 2 and watch.vel_rad_s == 0.0, 1.0)
    assert watch.dithers == 2
    parts, watch = lives()
    way = 0.0
    parts.after(scan, lambda: watch.dithers == 2, 1.0)
    assert way - watch.vel_rad_s * parts.period_s == approx(0.0, abs=1e-12)


@BOTH
@pytest.mark.parametrize(
    ("torque_nm", "limited", "growth", "wrong"),
    [
        (309.0, False, 0.16, True),
        (307.0, False, 0.16, False),
        (100.0, True, 0.16, True),
        (309.0, False, 0.14, False),
    ],
)
def test_a_speed_that_grows_against_80_percent_of_the_torque_is_of_the_wrong_sign(
    way, torque_nm, limited, growth, wrong
):
    """308 of 385 N m, or the drive at its limit, and 0.15 deg/s more than the slowest."""
    parts, watch = lives()
    parts.feedback.torque_limited = limited
    parts.feedback.torque_nm = -way * torque_nm
    for scan, deg_s in enumerate((0.3, 0.2, 0.2 + 0.5 * growth, 0.2 + growth)):
        parts.alarms.scan = 100 + scan
        parts.turn(way * deg_s)
        assert parts.feedback.torque_nm * parts.feedback.vel_rad_s < watch.against
        watch.drive_against()
    assert parts.codes == (["ENC-12"] if wrong else [])
    assert parts.feedback.in_doubt is wrong


def test_the_slowest_speed_is_that_of_the_same_push():
    parts, watch = lives()
    parts.feedback.torque_nm = -350.0
    for scan, deg_s in ((100, 0.2), (101, 0.2), (103, 0.5), (104, 0.6)):
        parts.alarms.scan = scan
        parts.turn(deg_s)
        watch.drive_against()
    assert parts.codes == []
    # 70 N m at 0.1 deg/s: less of it is never asked about.
    assert watch.against == approx(-70.0 * rad(0.1))


@PERIODS
def test_the_longest_time_of_an_answer_is_that_of_the_patience_and_four_tries(period_s):
    """A frozen count is told by then, and not much before: what people are promised is no guess."""
    parts, watch = lives(period_s)
    seconds = parts.after(lambda: watch.stand(proven=True), most_s=2.0)
    assert parts.codes == ["ENC-02"]
    # The first scan sees the count for the first time; each try begins in a scan of its own.
    assert 0.0 <= watch.answer_s - seconds <= 4 * period_s


def test_a_count_that_stands_because_nothing_newer_came_is_not_tried():
    parts, watch = lives()
    parts.feedback.age = 1
    parts.after(lambda: watch.stand(proven=True), lambda: watch.dithers > 0, most_s=2.0)
    assert watch.dithers == 0


def test_a_question_ends_with_the_rest_in_which_it_was_asked():
    """A motion came between: nothing is added to the commands of the next rest, and it is asked anew."""
    parts, watch = lives()
    parts.after(lambda: watch.stand(proven=True), lambda: watch.asking, 1.0)
    assert watch.vel_rad_s > 0.0
    parts.alarms.scan += 100
    watch.stand(proven=True)
    assert (watch.asking, watch.vel_rad_s) == (False, 0.0)
    assert parts.after(lambda: watch.stand(proven=True), lambda: watch.asking, 1.0) == approx(0.500)
    assert watch.vel_rad_s * 0.008 * 2**22 / math.tau == approx(8.0), "the first question again"


def test_a_reading_that_answers_a_harder_question_begins_with_the_first_again():
    """Steps of 512 counts: it answers the third question each time it stands, and is never frozen."""
    parts, watch = lives()
    shaft, asked = 0.0, []

    def scan():
        nonlocal shaft
        before = watch.dithers
        watch.stand(proven=True)
        if watch.dithers > before:
            asked.append(round(watch.vel_rad_s * 0.008 * 2**22 / math.tau))
        shaft += watch.vel_rad_s * parts.period_s * 2**22 / math.tau
        parts.feedback.counts = 512.0 * round((shaft + 100.0) / 512.0)

    assert parts.after(scan, most_s=2.5) == math.inf
    assert asked[:9] == 3 * [8, 64, 512]
