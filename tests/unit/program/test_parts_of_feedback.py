"""The monitors of the encoder on both sides of their limits, both ways, at each scan period; figures by hand.

The reference machine: 1144 motor turns, 2^22 counts each, 6 deg/s, quick stop 5.5 deg/s2; full torque and brake change
the speed of the bare rotor by 169 deg/s2.
"""

import math

import pytest

from gantryctl.image import DriveFeedback, DriveState, EncoderFlag, LinkFlag
from gantryctl.program import Reaction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.program.feedback import Feedback
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans
from unit.program.rig import COUNTS_PER_DEG, RATIO, ZERO_COUNTS

approx = pytest.approx
ROTOR = {"speed_change_max_rad_s2": rad(169.0), "speed_change_per_torque": rad(0.08)}
ON, OFF = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED


class Encoder(Parts):
    """A reading that turns on with a speed, until a test changes something of it."""

    def __init__(self, period_s=0.001, speed_deg_s=0.0, *, state=ON, **arguments):
        super().__init__(period_s, **arguments)
        self.feedback = Feedback(self.settings, self.alarms)
        self.speed_deg_s, self.pos_deg = speed_deg_s, 10.0
        self.said = {"state": state, "brake_open": state is ON, "torque_act_nm": 0.0}
        self.command_deg_s = speed_deg_s
        for _ in range(20):
            self.scan()
        assert self.codes == []

    def scan(self, *, step_deg=0.0, counts=None, speed_deg_s=None, **said):
        """A scan in which the reading makes a step beside the way of its speed."""
        self.alarms.scan += self.feedback.periods
        self.pos_deg += self.speed_deg_s * self.period_s * self.feedback.periods + step_deg
        fields = {
            "pos_act_counts": round(ZERO_COUNTS + self.pos_deg * COUNTS_PER_DEG) if counts is None else counts,
            "vel_act_rad_s": rad(self.speed_deg_s if speed_deg_s is None else speed_deg_s) * RATIO,
            "torque_limited": False, "overload": 0.0,
        }  # fmt: skip
        self.feedback.scan(DriveFeedback(**(fields | self.said | said)), rad(self.command_deg_s) * RATIO)

    @property
    def read_deg(self):
        return (self.feedback.counts - ZERO_COUNTS) / COUNTS_PER_DEG


@BOTH
@pytest.mark.parametrize("speed_deg_s", [0.0, 6.0, -6.0])
@pytest.mark.parametrize(
    ("period_s", "most_deg"), [(0.001, 0.022), (0.004, 0.028), (0.010, 0.040), (0.020, 0.045)]
)
def test_a_jump_is_0_02_deg_and_what_2_deg_s_make_in_a_scan(period_s, most_deg, speed_deg_s, way):
    """Never more than 0.045 deg, also where the scan is long."""
    for more, jumps in ((-0.0005, False), (0.0005, True)):
        encoder = Encoder(period_s, speed_deg_s)
        encoder.scan(step_deg=way * (most_deg + more))
        assert ("ENC-01" in encoder.codes) is jumps
        assert encoder.feedback.in_doubt is (jumps or (most_deg == 0.045 and bool(encoder.codes)))
        if jumps:
            assert encoder.reaction("ENC-01") is Reaction.TORQUE_OFF
            values = encoder.alarms.active[Code.ENC_01].values
            assert (values["measured"], values["limit"]) == (
                approx(most_deg + more, abs=1e-4),
                approx(most_deg),
            )


@BOTH
@pytest.mark.parametrize("missed", [2, 5])
def test_over_missed_scans_the_way_of_the_speed_is_no_jump_and_a_jump_is_one(missed, way):
    for step_deg, jumps in ((0.0, False), (0.021, False), (0.023, True)):
        encoder = Encoder(speed_deg_s=6.0 * way)
        encoder.feedback.periods = missed
        encoder.scan(step_deg=way * step_deg)
        assert ("ENC-01" in encoder.codes) is jumps


@BOTH
@pytest.mark.parametrize(("period_s", "most_deg"), [(0.001, 0.022), (0.004, 0.028), (0.010, 0.040)])
def test_behind_a_late_telegram_a_reading_may_be_a_scan_later_still(period_s, most_deg, way):
    """The way of three scans at 6 deg/s: the late one, this one, and one by which it was sampled late too."""
    for more_deg, jumps in ((-0.0005, False), (0.0005, True)):
        encoder = Encoder(period_s, 6.0 * way)
        encoder.scan(counts=encoder.feedback.counts, age_scans=1)
        # Two of the three are its speed.
        encoder.scan(step_deg=way * (6.0 * period_s + most_deg + more_deg))
        assert ("ENC-01" in encoder.codes) is jumps


@BOTH
@PERIODS
@pytest.mark.parametrize(("off_deg_s", "told_s"), [(0.14, math.inf), (0.16, 0.83)])
def test_a_position_that_leaves_its_speed_by_0_045_deg_is_of_another_encoder(
    period_s, way, off_deg_s, told_s
):
    """What they differ by is forgotten with 0.3 s: 0.15 deg/s come to 0.045 deg in the end, 0.16 after 0.83 s."""
    for sign in (1.0, -1.0):
        encoder = Encoder(period_s, sign * 3.0)
        seconds = encoder.after(
            lambda e=encoder, s=sign: e.scan(speed_deg_s=s * 3.0 + way * off_deg_s), most_s=4.0
        )
        assert seconds == (math.inf if told_s == math.inf else approx(told_s, rel=0.06))
        assert encoder.codes == ([] if told_s == math.inf else ["ENC-12"])


@BOTH
@pytest.mark.parametrize(
    ("period_s", "by_drive", "any_way"), [(0.001, 0.2055, 0.369), (0.004, 0.222, 0.876), (0.010, 0.255, 1.89)]
)
def test_a_speed_cannot_change_by_more_than_the_ramp_or_torque_and_brake_make(
    period_s, by_drive, any_way, way
):
    """0.2 deg/s of resolution, and 5.5 deg/s2 of an enabled drive without torque; 169 deg/s2 behind the brake."""
    rows = [
        ({}, by_drive),
        ({"brake_open": False}, any_way),
        ({"state": OFF}, any_way),
        # Torque in the direction of the change: 0.08 deg/s2 for each N m.
        ({"torque_act_nm": way * 100.0}, min(any_way, by_drive + 8.0 * period_s)),
        ({"torque_act_nm": -way * 100.0}, by_drive),
    ]
    for said, most in rows:
        for share, wrong in ((0.99, False), (1.01, True)):
            encoder = Encoder(period_s, 3.0, monitors=ROTOR)
            encoder.scan(speed_deg_s=3.0 + way * share * most, **said)
            assert ("ENC-14" in encoder.codes) is wrong, (said, share)


@BOTH
@pytest.mark.parametrize(("period_s", "by_drive"), [(0.004, 0.222), (0.010, 0.255)])
@pytest.mark.parametrize(
    ("before_nm", "now_nm", "explains_nm"),
    [
        # Of a torque against the change what has gone of it, since the gear was twisted by it.
        (-100.0, -20.0, 80.0), (-100.0, 50.0, 150.0), (-20.0, -100.0, 0.0), (100.0, 20.0, 20.0),
        # No drive has so much.
        (-1e9, 0.0, 0.0), (-math.inf, 0.0, 0.0), (math.nan, 0.0, 0.0),
    ],
)  # fmt: skip
def test_a_gear_that_untwists_changes_the_speed(period_s, by_drive, before_nm, now_nm, explains_nm, way):
    """A limit that falls in a quick stop of a sound axis: 0.36 deg/s in 10 ms. 0.08 deg/s2 for each N m."""
    most = by_drive + 0.08 * explains_nm * period_s
    for share, wrong in ((0.98, False), (1.02, True)):
        encoder = Encoder(period_s, 3.0, monitors=ROTOR)
        for _ in range(100):
            encoder.scan(torque_act_nm=way * before_nm)
        encoder.scan(speed_deg_s=3.0 + way * share * most, torque_act_nm=way * now_nm)
        assert ("ENC-14" in encoder.codes) is wrong, share


@BOTH
@pytest.mark.parametrize(
    ("period_s", "by_drive", "any_way"), [(0.001, 0.2055, 0.369), (0.004, 0.222, 0.876), (0.010, 0.255, 1.89)]
)
def test_a_brake_that_opens_lets_go_a_gear_of_which_no_torque_tells(period_s, by_drive, any_way, way):
    """For so many scans as the power sequence says, in this one too; then as before."""
    for after_scans, most in ((0, any_way), (3, any_way), (4, by_drive)):
        for share, wrong in ((0.99, False), (1.01, True)):
            encoder = Encoder(period_s, 3.0, monitors=ROTOR)
            encoder.scan()
            encoder.feedback.brake_opens(4)
            for _ in range(after_scans):
                encoder.scan()
            encoder.scan(speed_deg_s=3.0 + way * share * most)
            assert ("ENC-14" in encoder.codes) is wrong, (after_scans, share)


@BOTH
@PERIODS
@pytest.mark.parametrize(("speed_deg_s", "wrong"), [(20.9, False), (21.1, True)])
def test_twice_the_highest_speed_of_the_motor_is_no_reading(period_s, way, speed_deg_s, wrong):
    """And the speed of before stands in for it."""
    encoder = Encoder(period_s)
    # A warning of the encoder lets every reading be looked at closely.
    encoder.scan(speed_deg_s=way * speed_deg_s, encoder=EncoderFlag.WARNING)
    assert ("ENC-14" in encoder.codes) is wrong
    if wrong:
        assert encoder.feedback.vel_rad_s == 0.0


@BOTH
@PERIODS
@pytest.mark.parametrize(("command_deg_s", "told"), [(0.099, False), (0.101, True)])
def test_a_count_that_stands_for_30_ms_while_a_speed_is_commanded_is_frozen(
    period_s, way, command_deg_s, told
):
    encoder = Encoder(period_s)
    encoder.command_deg_s = way * command_deg_s
    seconds = encoder.after(encoder.scan, most_s=0.2)
    assert seconds == (approx(in_scans(0.030, period_s)) if told else math.inf)
    assert encoder.codes == (["ENC-02"] if told else [])


@BOTH
@pytest.mark.parametrize(
    ("period_s", "by_drive", "by_brake"),
    [(0.001, 0.122, 0.1845), (0.004, 0.188, 0.438), (0.010, 0.320, 0.945)],
)
def test_a_count_that_stands_after_a_speed_that_nothing_could_have_taken_away_is_frozen(
    period_s, by_drive, by_brake, way
):
    """0.1 deg/s, and four times 5.5 deg/s2 of a drive, or half of 169 with the brake closed, within a scan."""
    for brake_open, limit in ((True, by_drive), (False, by_brake)):
        for share, told in ((0.98, False), (1.02, True)):
            free = {"encoder_drift_max_rad": math.inf, "speed_change_base_rad_s": rad(10.0)}
            encoder = Encoder(period_s, way * share * limit, monitors=ROTOR | free)
            encoder.said["brake_open"] = brake_open
            encoder.scan()
            assert encoder.codes == []
            encoder.command_deg_s = encoder.speed_deg_s = 0.0
            seconds = encoder.after(encoder.scan, most_s=0.2)
            assert (seconds == approx(in_scans(0.030, period_s))) is told, (brake_open, share, seconds)


@BOTH
@pytest.mark.parametrize(("period_s", "by_brake"), [(0.001, 0.1845), (0.004, 0.438), (0.010, 0.945)])
@pytest.mark.parametrize("brake_open", [True, False], ids=["contact open", "contact closed"])
def test_an_encoder_that_freezes_within_a_scan_is_seen_by_what_it_showed_before(
    period_s, by_brake, brake_open, way
):
    """The way of a tenth of the scan, then nothing: nine tenths of the speed are gone, more than a brake takes."""
    for lost_deg_s, told in ((0.98 * by_brake, False), (1.02 * by_brake, True)):
        speed_deg_s = way * lost_deg_s / 0.9
        encoder = Encoder(period_s, speed_deg_s, monitors=ROTOR | {"speed_change_base_rad_s": rad(10.0)})
        encoder.said["brake_open"] = brake_open
        encoder.command_deg_s, encoder.speed_deg_s = 0.0, 0.1 * speed_deg_s
        encoder.scan()
        encoder.speed_deg_s = 0.0
        seconds = encoder.after(encoder.scan, most_s=0.2)
        assert seconds == (approx(in_scans(0.030, period_s)) if told else math.inf)
        assert encoder.codes == (["ENC-02"] if told else [])


@PERIODS
@pytest.mark.parametrize("uneven", ["missed scans", "late telegram", "late SYNC"])
def test_steps_of_more_than_a_scan_are_no_speed_that_was_lost(period_s, uneven):
    """1.6 times what a brake may take, shown by a step over two scans: 0.8 times in each."""
    speed_deg_s = 0.8 * (0.1 + 84.5 * period_s)
    encoder = Encoder(period_s, speed_deg_s, monitors=ROTOR | {"speed_change_base_rad_s": rad(10.0)})
    encoder.command_deg_s = 0.0
    match uneven:
        case "missed scans":
            encoder.feedback.periods = 2
            encoder.scan()
            encoder.feedback.periods = 1
        case "late telegram":
            encoder.scan(counts=encoder.feedback.counts, age_scans=1)
            encoder.scan()
        case "late SYNC":
            encoder.scan(step_deg=speed_deg_s * period_s, spread_scans=1.0)
    encoder.speed_deg_s *= 0.01
    encoder.scan()
    encoder.speed_deg_s = 0.0
    encoder.scan()
    assert encoder.after(encoder.scan, most_s=0.2) == math.inf
    assert encoder.codes in ([], ["CAN-07"])


def test_a_count_that_moves_again_counts_anew():
    encoder = Encoder()
    encoder.command_deg_s = 1.0
    for _ in range(5):
        for _ in range(29):
            encoder.scan()
        encoder.scan(step_deg=1e-5)
    assert encoder.codes == []


@PERIODS
@pytest.mark.parametrize(("every_s", "stops"), [(0.040, True), (0.060, False)])
def test_three_bad_readings_in_a_tenth_of_a_second_stop(period_s, every_s, stops):
    every = round(every_s / period_s)
    encoder = Encoder(period_s, 3.0)
    for scan in range(4 * every):
        bad = scan % every == 0
        encoder.scan(
            encoder=EncoderFlag.CRC_ERROR if bad else EncoderFlag.NONE, **({"counts": 12345} if bad else {})
        )
        if not encoder.feedback.in_doubt:
            assert encoder.read_deg == approx(encoder.pos_deg, abs=1e-4), "the prediction of one scan"
    assert ("ENC-04" in encoder.codes) is stops
    assert encoder.feedback.in_doubt is stops


def test_a_bad_reading_over_missed_scans_is_predicted_over_them():
    encoder = Encoder(0.001, -6.0)
    encoder.feedback.periods = 4
    encoder.scan(encoder=EncoderFlag.CRC_ERROR, counts=0)
    assert encoder.read_deg == approx(encoder.pos_deg, abs=1e-5)
    assert encoder.codes == ["ENC-03"]


@pytest.mark.parametrize(
    ("flag", "codes"),
    [
        (LinkFlag.BUS_DOWN, ["CAN-08"]),
        (LinkFlag.BUS_DOWN | LinkFlag.BUS_OFF, ["CAN-08"]),
        (LinkFlag.BUS_DOWN | LinkFlag.QUEUE_FULL, ["CAN-08"]),
        (LinkFlag.RESTARTED, ["DRV-11"]),
        (LinkFlag.HEARTBEAT_LOST, ["CAN-06"]),
        (LinkFlag.NOT_OPERATIONAL, ["CAN-13"]),
        (LinkFlag.OTHER_MASTER, ["CAN-12"]),
        (LinkFlag.TWO_SENDERS, ["CAN-14"]),
        (LinkFlag.IO_LOST, ["CAN-16"]),
        (LinkFlag.LOAD_ENCODER_LOST, ["CAN-16"]),
        (LinkFlag.WRONG_MODE, ["DRV-06"]),
        (LinkFlag.STALE_TARGET, ["DRV-08"]),
        (LinkFlag.LOCAL_CONTROL, ["DRV-05"]),
        (LinkFlag.IGNORES_COMMAND, ["DRV-05"]),
        (LinkFlag.NEVER_FOLLOWED, ["DRV-05"]),
        (LinkFlag.OVERLOADED, ["CAN-10"]),
        (LinkFlag.WRONG_LENGTH, ["CAN-04"]),
        (LinkFlag.SYNC_UNSEEN, ["CAN-01"]),
        (LinkFlag.EMERGENCY, ["DRV-12"]),
        (LinkFlag.EMERGENCY_FLOOD, ["CAN-09"]),
        (LinkFlag.SYNC_JITTER, ["CAN-02"]),
        (LinkFlag.ERROR_PASSIVE, ["CAN-15"]),
        (LinkFlag.QUEUE_FULL, ["CAN-15"]),
        # The first cause is told, the others follow from it; another master locks whatever else is wrong.
        (LinkFlag.RESTARTED | LinkFlag.NOT_OPERATIONAL | LinkFlag.WRONG_MODE, ["DRV-11"]),
        (LinkFlag.HEARTBEAT_LOST | LinkFlag.OTHER_MASTER, ["CAN-06", "CAN-12"]),
        (LinkFlag.LATE, []),
    ],
    ids=str,
)
def test_each_fault_of_the_connection_has_its_alarm_in_the_first_scan(flag, codes):
    encoder = Encoder(speed_deg_s=0.6)
    encoder.scan(link=flag)
    assert encoder.codes == codes


@pytest.mark.parametrize(
    ("flag", "words"),
    [
        (LinkFlag.BUS_DOWN, Words.BUS_FAILED),
        (LinkFlag.BUS_DOWN | LinkFlag.BUS_OFF, Words.BUS_OFF),
        (LinkFlag.BUS_DOWN | LinkFlag.QUEUE_FULL, Words.QUEUE_FULL),
        (LinkFlag.IO_LOST, Words.IO_NODE),
        (LinkFlag.LOAD_ENCODER_LOST, Words.LOAD_ENCODER_NODE),
        (LinkFlag.LOCAL_CONTROL, Words.LOCAL_CONTROL),
        (LinkFlag.IGNORES_COMMAND, Words.NOT_FOLLOWING),
    ],
    ids=str,
)
def test_an_alarm_of_several_causes_names_the_one(flag, words):
    """Who is sent to the wrong node, or told of a switch that nobody turned, looks in the wrong place."""
    encoder = Encoder(speed_deg_s=0.6)
    encoder.scan(link=flag)
    (alarm,) = encoder.alarms.active.values()
    assert words in alarm.values.values()


@pytest.mark.parametrize(
    "flag", [LinkFlag.BUS_DOWN, LinkFlag.RESTARTED, LinkFlag.HEARTBEAT_LOST, LinkFlag.NOT_OPERATIONAL]
)
@pytest.mark.parametrize("age", [0, 1])
def test_an_old_reading_of_a_lost_drive_is_in_doubt(flag, age):
    encoder = Encoder(speed_deg_s=0.6)
    encoder.scan(link=flag, age_scans=age)
    assert encoder.feedback.in_doubt is (age > 0)


@PERIODS
def test_the_state_of_a_drive_that_is_not_heard_is_unknown_after_30_ms_and_the_motor_may_have_torque(
    period_s,
):
    encoder = Encoder(period_s, 0.6)
    old = math.floor(0.030 / period_s + 1e-9)  # 30, 7 and 3 scans
    for age in range(1, old):
        encoder.scan(link=LinkFlag.LATE, age_scans=age)
        assert encoder.feedback.state is ON
    assert encoder.codes == []
    encoder.scan(link=LinkFlag.LATE, age_scans=old)
    assert encoder.codes == ["CAN-03"]
    values = encoder.alarms.active[Code.CAN_03].values
    assert (values["time_ms"], values["limit"]) == (
        approx(1e3 * old * period_s),
        approx(1e3 * old * period_s),
    )
    assert values["measured"] is Words.TELEGRAM_POSITION
    assert encoder.feedback.state is DriveState.UNKNOWN
    assert encoder.feedback.state_old
    assert encoder.feedback.energised
    assert not encoder.feedback.position_valid
    encoder.scan(link=LinkFlag.LATE, age_scans=old + 1)
    assert not encoder.feedback.position_valid, "in every scan until one comes"
    encoder.scan(state=OFF)
    assert not encoder.feedback.state_old
    assert not encoder.feedback.energised


@PERIODS
def test_inputs_that_do_not_come_are_told_after_30_ms(period_s):
    encoder = Encoder(period_s, 0.6)
    old = math.floor(0.030 / period_s + 1e-9)
    encoder.scan(link=LinkFlag.LATE, inputs_age_scans=old - 1)
    assert encoder.codes == []
    assert encoder.feedback.brake_known
    encoder.scan(link=LinkFlag.LATE, inputs_age_scans=old)
    assert encoder.codes == ["CAN-03"]
    assert encoder.alarms.active[Code.CAN_03].values["measured"] is Words.TELEGRAM_INPUTS
    assert not encoder.feedback.brake_known
    assert encoder.feedback.state is ON


@PERIODS
@pytest.mark.parametrize("jump_deg", [0.0, 0.06])
def test_a_stop_without_positions_ends_where_its_speeds_led_and_a_jump_beyond_is_one(period_s, jump_deg):
    """From 3 deg/s by 6 deg/s2 it is 3^2 / (2 * 6) = 0.75 deg; it was ENC-01, and ENC-02 as the axis then stood."""
    encoder = Encoder(period_s, 3.0)
    held, scans = encoder.feedback.counts, round(0.5 / period_s)
    encoder.command_deg_s = 0.0
    for scan in range(1, scans + 1):
        encoder.speed_deg_s = 3.0 - 6.0 * (scan - 0.5) * period_s
        encoder.scan(counts=held, age_scans=scan, link=LinkFlag.LATE, speed_deg_s=3.0 - 6.0 * scan * period_s)
    encoder.speed_deg_s = 0.0
    encoder.scan(step_deg=jump_deg)
    assert encoder.read_deg == approx(10.0 + 20.0 * 3.0 * period_s + 0.75 + jump_deg, abs=1e-4)
    for _ in range(round(0.06 / period_s)):
        encoder.scan()
    assert encoder.codes == (["CAN-03", "ENC-01"] if jump_deg else ["CAN-03"])


@PERIODS
def test_a_speed_is_known_while_it_or_the_position_is_not_too_old(period_s):
    encoder = Encoder(period_s, 0.6)
    old = math.floor(0.030 / period_s + 1e-9)
    for age, speed_age, known in ((0, old, True), (old, 0, True), (old - 1, old, True), (old, old, False)):
        encoder.scan(age_scans=age, speed_age_scans=speed_age)
        assert encoder.feedback.speed_known is known, (age, speed_age)


@BOTH
def test_at_rest_is_slower_than_a_fiftieth_of_a_degree_per_second(way):
    parts = Parts()
    for speed_deg_s, slow in ((0.0199, True), (0.0201, False), (math.nan, False)):
        parts.turn(way * speed_deg_s)
        assert parts.feedback.slow is slow


@pytest.mark.parametrize(
    ("before", "energised"),
    [(ON, True), (DriveState.QUICK_STOP_ACTIVE, True), (DriveState.FAULT_REACTION_ACTIVE, True), (OFF, False),
     (DriveState.SWITCHED_ON, False), (DriveState.FAULT, False)],
)  # fmt: skip
def test_a_motor_has_torque_as_long_as_nobody_knows_better(before, energised):
    encoder = Encoder(state=before)
    assert encoder.feedback.energised is energised
    encoder.scan(state=DriveState.UNKNOWN)
    assert encoder.feedback.energised is energised


@pytest.mark.parametrize(("battery", "doubted"), [(True, True), (False, False)])
def test_an_empty_battery_at_the_start_leaves_the_angle_unknown(battery, doubted):
    parts = Parts(monitors={"encoder_battery": battery})
    feedback = Feedback(parts.settings, parts.alarms)
    reading = DriveFeedback(OFF, float(ZERO_COUNTS), 0.0, 0.0, False, False, 0.0, EncoderFlag.BATTERY)
    feedback.scan(reading, 0.0)
    assert feedback.in_doubt is doubted
    assert parts.codes == (["ENC-13"] if battery else [])


def test_an_empty_battery_of_an_encoder_with_its_supply_is_a_warning():
    encoder = Encoder(monitors={"encoder_battery": True})
    encoder.scan(encoder=EncoderFlag.BATTERY)
    assert encoder.codes == ["ENC-13"]
    assert not encoder.feedback.in_doubt


def test_an_angle_that_service_has_compared_is_valid_and_counts_its_faults_anew():
    encoder = Encoder(speed_deg_s=0.0)
    for _ in range(2):
        encoder.scan(encoder=EncoderFlag.CRC_ERROR)
    encoder.scan(counts=math.nan)
    assert encoder.feedback.in_doubt
    encoder.feedback.accept_position()
    encoder.alarms.clear()
    assert encoder.feedback.position_valid
    encoder.scan(encoder=EncoderFlag.CRC_ERROR)
    assert encoder.codes == ["ENC-03"]
    assert encoder.feedback.position_valid


@BOTH
def test_a_drift_of_before_counts_no_more_when_the_angle_was_accepted(way):
    encoder = Encoder(speed_deg_s=0.0)
    for _ in range(2):
        encoder.scan(step_deg=way * 0.021)
    encoder.feedback.accept_position()
    encoder.scan(step_deg=way * 0.021)
    assert encoder.codes == []


@BOTH
@PERIODS
def test_a_count_that_stands_after_steps_without_a_speed_reading_is_frozen(period_s, way):
    """0.5 deg/s by the steps of the position, either way; the telegram of the speed says nothing yet."""
    free = {"encoder_drift_max_rad": math.inf, "speed_change_base_rad_s": rad(10.0)}
    encoder = Encoder(period_s, monitors=ROTOR | free)
    for _ in range(3):
        encoder.scan(step_deg=way * 0.5 * period_s)
    seconds = encoder.after(encoder.scan, most_s=0.2)
    assert seconds == approx(in_scans(0.030, period_s))
    assert encoder.codes == ["ENC-02"]
    assert encoder.alarms.active[Code.ENC_02].values["measured"].values["value"] == approx(0.5, rel=1e-3)


@BOTH
def test_a_sample_that_was_late_by_a_known_time_is_no_drift_either_way(way):
    """9 ms late in a scan of 4 ms, at 6 deg/s 0.054 deg further on, and in time again: 0.045 deg are permitted."""
    encoder = Encoder(0.004, way * 6.0)
    for late in (1.0, -1.0):
        encoder.scan(step_deg=late * way * 0.054, spread_scans=late * 2.25)
    for _ in range(20):
        encoder.scan()
    assert encoder.codes == []


@BOTH
@PERIODS
@pytest.mark.parametrize(("share", "told"), [(0.95, False), (1.05, True)])
def test_a_count_that_stands_after_a_part_of_a_step_froze_within_it(period_s, way, share, told):
    """Missing is more than the brake takes within a scan, 0.945 deg/s in 10 ms; left is nearly rest."""
    free = {
        "encoder_drift_max_rad": math.inf,
        "speed_change_base_rad_s": rad(10.0),
        "encoder_jump_base_rad": rad(1.0),
    }
    encoder = Encoder(period_s, monitors=ROTOR | free)
    brake = {0.001: 0.1845, 0.004: 0.438, 0.010: 0.945}[period_s]
    left_deg_s, missing = 0.05, brake * share
    for _ in range(3):
        encoder.scan(step_deg=way * (left_deg_s + missing) * period_s)
    encoder.scan(step_deg=way * left_deg_s * period_s)
    seconds = encoder.after(encoder.scan, most_s=0.2)
    assert (seconds == approx(in_scans(0.030, period_s))) is told
    assert encoder.codes == (["ENC-02"] if told else [])


@BOTH
def test_samples_that_come_later_and_later_are_no_drift(way):
    """Half a scan of 4 ms later each time, 0.012 deg at 6 deg/s: five are more than the 0.045 deg permitted."""
    encoder = Encoder(0.004, way * 6.0)
    for _ in range(6):
        encoder.scan(step_deg=way * 0.012, spread_scans=0.5)
    assert encoder.codes == []


@BOTH
def test_the_way_of_telegrams_that_were_missed_is_no_jump_and_a_jump_later_on_is_one(way):
    """Three scans of 4 ms at 6 deg/s without a position are 0.072 deg, and 0.028 are permitted in one scan."""
    for later, jumps in ((0, False), (4, True)):
        encoder = Encoder(0.004, way * 6.0)
        stood = encoder.feedback.counts
        for age in (1, 2, 3):
            encoder.scan(counts=stood, age_scans=age)
        for _ in range(later):
            encoder.scan()
        encoder.scan(step_deg=way * (0.072 if later else 0.0))
        assert ("ENC-01" in encoder.codes) is jumps, later


@BOTH
def test_a_speed_that_comes_after_telegrams_that_did_not_may_have_changed_for_longer(way):
    """0.369 deg/s in a scan of 1 ms behind the brake; 1 deg/s in the first two scans after three without a speed."""
    for old, later, wrong in ((3, 0, False), (3, 1, False), (3, 2, True), (0, 0, True)):
        encoder = Encoder(speed_deg_s=way * 3.0, monitors=ROTOR)
        for age in range(1, old + 1):
            encoder.scan(speed_age_scans=age)
        for _ in range(later):
            encoder.scan()
        encoder.scan(speed_deg_s=way * 4.0, brake_open=False)
        assert ("ENC-14" in encoder.codes) is wrong


@BOTH
def test_an_old_reading_does_not_stand(way):
    """100 ms of one telegram that the bus says is old: late, and no frozen encoder."""
    encoder = Encoder(speed_deg_s=way * 3.0)
    stood = encoder.feedback.counts
    for age in range(1, 100):
        encoder.scan(counts=stood, age_scans=age)
    assert "CAN-07" in encoder.codes
    assert "ENC-02" not in encoder.codes
    assert encoder.feedback.unchanged_scans == 0


def test_a_drive_that_is_lost_is_not_told_as_late():
    """Its heartbeat is missing: that its telegrams are missing as well is no other cause."""
    encoder = Encoder()
    for age in range(1, 60):
        encoder.scan(
            counts=encoder.feedback.counts, age_scans=age, link=LinkFlag.LATE | LinkFlag.HEARTBEAT_LOST
        )
    assert "CAN-06" in encoder.codes
    assert "CAN-03" not in encoder.codes


def test_a_reading_in_doubt_stays_so_when_the_drive_disobeys():
    encoder = Encoder()
    encoder.feedback.in_doubt = True
    encoder.feedback.disobeyed(Code.CTL_05, measured=1.0, command=0.0, limit=0.5)
    assert encoder.feedback.in_doubt
    sound = Encoder()
    sound.feedback.disobeyed(Code.CTL_05, measured=1.0, command=0.0, limit=0.5)
    assert not sound.feedback.in_doubt


@pytest.mark.parametrize("late", ["now", "before"])
def test_whether_a_drive_that_disobeys_on_late_telegrams_turns_or_reads_wrong_nobody_knows(late):
    """Its torque would tell: it is older than the speed, or may have been."""
    encoder = Encoder()
    if late == "now":
        encoder.feedback.age = 1
    else:
        encoder.alarms.raise_(Code.CAN_07, measured=30.0, limit=30.0)
    encoder.feedback.disobeyed(Code.CTL_05, measured=1.0, command=0.0, limit=0.5)
    assert encoder.feedback.in_doubt


def test_an_encoder_has_its_alarm_as_long_as_it_shows_it():
    encoder = Encoder()
    encoder.scan(encoder=EncoderFlag.ALARM)
    assert encoder.feedback.encoder_alarm
    encoder.scan()
    assert not encoder.feedback.encoder_alarm
    assert encoder.feedback.in_doubt, "until service has compared the angle"


@BOTH
@PERIODS
@pytest.mark.parametrize(
    ("speed_deg_s", "way_deg", "frozen"),
    [(1.0, 0.0, True), (1.0, 0.0028, True), (1.0, 0.0031, False), (0.11, 0.0, True), (0.09, 0.0, False)],
)
def test_a_reading_that_comes_again_nearer_than_any_axis_comes_to_rest_is_frozen(
    period_s, way, speed_deg_s, way_deg, frozen
):
    """No positions for forty scans of a stop by the brake. From 1 deg/s 169 deg/s2 take 0.00296 deg."""
    encoder = Encoder(period_s, way * speed_deg_s, monitors=ROTOR)
    encoder.command_deg_s, last = 0.0, encoder.feedback.counts
    for age in range(1, 41):
        encoder.scan(counts=last, age_scans=age, speed_age_scans=age)
    stopped = {"state": OFF, "brake_open": False, "speed_deg_s": 0.0}
    again = last + way * way_deg * COUNTS_PER_DEG
    scans = 0
    while "ENC-02" not in encoder.codes and scans < 100:
        encoder.scan(counts=again, **stopped)
        scans += 1
    # The first reading that comes again makes a step, and stands from the next on; 30 ms, three scans at least.
    stands_s = in_scans(0.030, period_s) + period_s * (way_deg > 0.0)
    assert scans == (round(stands_s / period_s) if frozen else 100)
    assert encoder.feedback.position_valid is not frozen


def in_gap(period_s, speeds_deg_s, *, speed_ages=None, brake_open=True):
    """Positions are missing from now on, and these speeds come meanwhile; scans until the encoder is called frozen."""
    encoder = Encoder(period_s, speeds_deg_s[0], monitors=ROTOR)
    encoder.said["brake_open"] = brake_open
    last, ages = encoder.feedback.counts, speed_ages or [0] * len(speeds_deg_s)
    for age, (speed_deg_s, speed_age) in enumerate(zip(speeds_deg_s, ages, strict=True), 1):
        encoder.scan(counts=last, age_scans=age, speed_age_scans=speed_age, speed_deg_s=speed_deg_s)
        if "ENC-02" in encoder.codes:
            assert encoder.reaction("ENC-02") is Reaction.TORQUE_OFF
            values = encoder.alarms.active[Code.ENC_02].values
            assert values["measured"].values["value"] == approx(abs(speeds_deg_s[0]), abs=1e-9)
            return age
    assert encoder.feedback.in_doubt is False
    return None


@BOTH
@pytest.mark.parametrize(
    ("period_s", "brake_open", "least_deg_s"),
    # 0.1 deg/s, and what 22 deg/s2 of a quick stop, or half of 169 by a closed brake, take away within the scan.
    [(0.001, True, 0.122), (0.004, True, 0.188), (0.010, True, 0.320), (0.004, False, 0.438)],
)
def test_a_speed_that_falls_to_nothing_while_positions_are_missing_is_of_a_frozen_encoder(
    period_s, brake_open, least_deg_s, way
):
    """It stands 30 ms, three scans at least: behind the gap its count stands where it may as well have come to rest."""
    stands = round(in_scans(0.030, period_s) / period_s)
    for deg_s, scans in ((least_deg_s + 0.001, 5 + stands), (least_deg_s - 0.001, None)):
        speeds = [way * deg_s] * 5 + [0.0] * 40
        assert in_gap(period_s, speeds, brake_open=brake_open) == scans


@BOTH
def test_a_speed_that_is_old_or_falls_on_its_way_or_does_not_stay_is_of_no_frozen_encoder(way):
    """A sound stop of 5.5 deg/s2 in a gap; a speed that is old as it stands, or was; and 28 of the 30 ms."""
    ramp = [way * max(0.0, 0.6 - 0.022 * scan) for scan in range(80)]
    assert in_gap(0.004, ramp) is None
    stops = [way * 0.9] * 5 + [0.0] * 40
    assert in_gap(0.004, stops, speed_ages=[0] * 5 + [1] + [0] * 39) is None
    assert in_gap(0.004, stops, speed_ages=[0] * 4 + [1] + [0] * 40) is None
    assert in_gap(0.004, stops, speed_ages=[1] * 4 + [0] * 41) == 13
    assert in_gap(0.004, ([way * 0.9] * 5 + [0.0] * 7) * 3) is None


def test_a_reading_that_moves_on_behind_a_gap_may_stand_later_where_it_was():
    """It swings back to the count of before the gap, and rests there 0.1 s after the telegrams came again."""
    encoder = Encoder(0.001, 1.0, monitors=ROTOR)
    encoder.command_deg_s, last = 0.0, encoder.feedback.counts
    for age in range(1, 41):
        encoder.scan(counts=last, age_scans=age, speed_age_scans=age)
    stopped = {"state": OFF, "brake_open": False, "speed_deg_s": 0.0}
    for scan in range(100):
        encoder.scan(counts=last + 20.0 * (100 - scan), **stopped)
    for _ in range(100):
        encoder.scan(counts=last, **stopped)
    assert "ENC-02" not in encoder.codes


@BOTH
@pytest.mark.parametrize(
    ("moved", "wrong"), [(None, False), (Reaction.QUICK_STOP, True), (Reaction.TORQUE_OFF, False)]
)
def test_a_contact_that_the_axis_has_shown_to_lie_explains_no_stop(way, moved, wrong):
    """0.5 deg/s that are gone in 4 ms: a brake may take 0.2 + 169 x 0.004 = 0.88 deg/s, the drive 0.22.

    One that moved on freely says that its brake is open (BRK-05, quick stop), one that felt it that it is closed.
    """
    encoder = Encoder(0.004, way * 0.5, monitors=ROTOR)
    encoder.said["brake_open"] = False
    if moved is not None:
        encoder.alarms.raise_(Code.BRK_05, moved, measured=0.5, error=0.0)
    encoder.scan(step_deg=-way * 0.5 * 0.004, speed_deg_s=0.0)
    assert ("ENC-14" in encoder.codes) is wrong
