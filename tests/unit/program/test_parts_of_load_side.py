"""The second encoder, and the turns of a modulo axis behind it; by a law that shows what it was given."""

import math
from dataclasses import fields, replace
from fractions import Fraction
from types import SimpleNamespace

import pytest

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog
from gantryctl.program.axis import turns as axis_turns
from gantryctl.program.axis.load_side import LoadSide
from gantryctl.program.monitors.calibration_watch import Finding
from gantryctl.program.settings import CalibrationWatchSettings, CompensationSettings
from gantryctl.units import deg, rad
from unit.program.parts import BOTH, PERIODS, Parts, in_scans
from unit.program.rig import Rig, settings
from unit.program.test_modulo import modulo

approx = pytest.approx
TURN_COUNTS = 360_000.0


class Law:
    """A law that keeps what it was asked, and answers what a test says."""

    def __init__(self):
        self.asked, self.turned_rad, self.pos_rad = [], [], 0.0
        self.torque_nm = self.disagreement_rad = self.change_nm = 0.0
        self.restarts = self.forgotten = 0

    def copy(self):
        return self

    def scan(self, _law, ref, vel, acc, counts, ring, torque):
        self.asked.append(SimpleNamespace(ref=ref, vel=vel, acc=acc, counts=counts, ring=ring, torque=torque))
        return 1.0, self.pos_rad, 0.0, self.torque_nm, self.disagreement_rad, self.change_nm

    scan_again = scan

    def restart(self):
        self.restarts += 1

    def forget_bias(self):
        self.forgotten += 1

    def lead(self, pos_rad):
        return 0.01 * pos_rad

    def resting_position(self, _law, _counts):
        return self.pos_rad

    def turn_back(self, angle_rad):
        self.turned_rad.append(angle_rad)


def load_side(period_s=0.001, *, modulo=False, **said):
    parts, law = Parts(period_s), Law()
    if modulo:
        turning = SimpleNamespace(turn_counts=Fraction(int(TURN_COUNTS)))
        parts.settings = SimpleNamespace(
            law=turning, power=parts.settings.power, scans=parts.settings.scans, period_s=period_s
        )
    compensation = CompensationSettings(law, **said)
    side = LoadSide(parts.settings, compensation, None, parts.feedback, parts.alarms)
    return parts, law, side


@BOTH
@PERIODS
@pytest.mark.parametrize(("degrees", "told"), [(0.0499, False), (0.0501, True), (math.nan, True)])
def test_two_encoders_may_disagree_by_0_05_deg_and_by_more_for_20_ms(period_s, way, degrees, told):
    parts, law, side = load_side(period_s, load_encoder=True)
    law.disagreement_rad = way * rad(degrees)
    seconds = parts.after(lambda: side.scan(parts.virtual, 0.0), most_s=0.2)
    assert seconds == (approx(in_scans(0.020, period_s)) if told else math.inf)
    assert parts.codes == (["ENC-07"] if told else [])
    assert parts.feedback.in_doubt is told


def test_a_disagreement_counts_in_a_row_and_anew_when_the_axis_follows_again():
    parts, law, side = load_side(load_encoder=True)
    for again in (lambda: side.scan(parts.virtual, 0.0), side.begin, side.begin):
        law.disagreement_rad = rad(1.0)
        for _ in range(19):
            side.scan(parts.virtual, 0.0)
        law.disagreement_rad = 0.0
        again()
    assert parts.codes == []


def test_an_encoder_that_nobody_reads_disagrees_with_nothing():
    parts, law, side = load_side()
    law.disagreement_rad = math.nan
    assert parts.after(lambda: side.scan(parts.virtual, 0.0), most_s=0.1) == math.inf


@PERIODS
@pytest.mark.parametrize(("change_nm", "told"), [(999.0, False), (1001.0, True)])
def test_a_moment_beyond_what_a_person_expects_is_told_after_5_s(period_s, change_nm, told):
    parts, law, side = load_side(period_s, moment_limit_nm=1000.0)
    law.change_nm = change_nm
    seconds = parts.after(lambda: side.scan(parts.virtual, 0.0), most_s=6.0)
    assert seconds == (approx(5.0, abs=1.01 * period_s) if told else math.inf)
    if told:
        assert parts.alarms.active[Code.CTL_19].values == {"measured": approx(1.001), "limit": approx(1.0)}
    # A second without it, and it counts anew.
    parts, law, side = load_side(period_s, moment_limit_nm=1000.0)
    for scan in range(round(8.0 / period_s)):
        law.change_nm = 0.0 if scan == round(4.0 / period_s) else 2000.0
        side.scan(parts.virtual, 0.0)
    assert parts.codes == []


def test_the_torque_of_a_law_is_that_of_a_following_axis_only():
    parts, law, side = load_side()
    law.torque_nm = 7.0
    side.scan(parts.virtual, 0.0)
    assert side.torque_ff_nm == 7.0
    side.resting(0.0)
    assert side.torque_ff_nm == 0.0


@BOTH
def test_the_laws_count_from_the_turn_that_the_set_point_is_in(way):
    """It changes at 216 deg, a tenth of a turn beyond +-180, so that nothing goes to and fro there."""
    parts, law, side = load_side(modulo=True)
    for degrees, turns in (
        (179.0, 0),
        (181.0, 0),
        (215.0, 0),
        (217.0, 1),
        (181.0, 1),
        (145.0, 1),
        (143.0, 0),
    ):
        parts.virtual.pos_ref_rad = rad(way * degrees)
        law.pos_rad = rad(1.0)
        _, pos, _ = side.scan(parts.virtual, way * degrees * 1000.0)
        asked = law.asked[-1]
        assert deg(asked.ref) == approx(way * (degrees - 360.0 * turns))
        assert asked.counts == approx(way * 1000.0 * (degrees - 360.0 * turns))
        assert deg(pos) == approx(1.0 + way * 360.0 * turns)
    assert [deg(angle) for angle in law.turned_rad] == approx([way * 360.0, -way * 360.0])


@BOTH
def test_an_encoder_of_one_turn_goes_round_with_the_axis(way):
    parts, law, side = load_side(modulo=True)
    parts.virtual.pos_ref_rad = rad(way * 190.0)
    for ring_deg, shown_deg in ((-170.0, 190.0), (190.0, 190.0), (-529.9, 190.1)):
        parts.feedback.pos_ring_rad = rad(way * ring_deg)
        side.scan(parts.virtual, 0.0)
        assert deg(law.asked[-1].ring) == approx(way * shown_deg)
    parts.feedback.pos_ring_rad = math.nan
    side.scan(parts.virtual, 0.0)
    assert math.isnan(law.asked[-1].ring)


@BOTH
def test_a_zero_that_has_moved_on_by_turns_changes_nothing_for_the_laws(way):
    parts, law, side = load_side(modulo=True)
    parts.virtual.pos_ref_rad = rad(way * 725.0)
    side.scan(parts.virtual, way * 725_000.0)
    before = law.asked[-1]
    turned = list(law.turned_rad)
    side.turn_back(int(way * 2))
    parts.virtual.pos_ref_rad = rad(way * 5.0)
    _, pos, _ = side.scan(parts.virtual, way * 5000.0)
    assert deg(law.asked[-1].ref) == approx(deg(before.ref)) == approx(way * 5.0)
    assert law.asked[-1].counts == approx(before.counts)
    assert pos == approx(0.0)
    assert law.turned_rad == turned


@BOTH
@pytest.mark.parametrize(
    ("ring_deg", "added_deg"),
    [(-175.0, 360.0), (179.0, 0.0), (1.0, 0.0), (-1.0, 360.0), (-541.0, 720.0), (math.nan, 0.0)],
)
def test_an_encoder_that_shows_another_turn_at_rest_is_read_in_that_of_the_motor(way, ring_deg, added_deg):
    """The motor says 180 deg; 181 deg of difference are a turn, 179 are two encoders that disagree."""
    parts, law, side = load_side(load_encoder=True)
    law.pos_rad = rad(way * 180.0)
    parts.feedback.pos_ring_rad = rad(way * ring_deg)
    assert side.resting(0.0) == law.pos_rad
    parts.virtual.pos_ref_rad = law.pos_rad
    side.scan(parts.virtual, 0.0)
    assert deg(law.asked[-1].ring) == approx(way * (ring_deg + added_deg), nan_ok=True)
    # Two that agree again need no turn.
    parts.feedback.pos_ring_rad = law.pos_rad
    side.resting(0.0)
    side.scan(parts.virtual, 0.0)
    assert deg(law.asked[-1].ring) == approx(way * 180.0)


def test_the_laws_begin_without_memory_each_time_the_axis_follows():
    _, law, side = load_side()
    side.begin()
    side.begin()
    assert (law.restarts, law.forgotten) == (2, 0)


@BOTH
def test_a_new_reference_puts_the_motor_ahead_by_the_lead_and_forgets_what_the_encoders_differed_by(way):
    _, law, side = load_side()
    assert side.new_reference(way * 2.0) == approx(way * 2.02)
    assert law.forgotten == 1


def test_a_command_of_the_same_scan_is_not_watched_twice():
    parts, law, side = load_side(load_encoder=True, moment_limit_nm=1.0)
    law.disagreement_rad, law.change_nm, law.torque_nm = rad(1.0), 2.0, 3.0
    side.scan_again(parts.virtual, 0.0)
    assert (side.disagreement_rad, side.moment_change_nm) == (0.0, 0.0)
    assert side.torque_ff_nm == 3.0


@BOTH
def test_the_laws_go_over_to_the_next_turn_beyond_0_6_of_it(way):
    """1.2 pi itself is still of this turn; the next number is of the next."""
    for ref_rad, turned in ((1.2 * math.pi, []), (math.nextafter(1.2 * math.pi, 4.0), [way * math.tau])):
        parts, law, side = load_side(modulo=True)
        parts.virtual.pos_ref_rad = way * ref_rad
        side.scan(parts.virtual, 0.0)
        assert law.turned_rad == turned


class Plain(Law):
    """The bare law, in the form of one with memory."""

    def scan(self, law, ref, vel, acc, counts, ring, torque):
        super().scan(law, ref, vel, acc, counts, ring, torque)
        return *law.scan(ref, vel, counts), 0.0, 0.0, 0.0

    scan_again = scan

    def resting_position(self, law, counts):
        return law.scan(0.0, 0.0, counts)[1]


@BOTH
def test_laws_keep_their_angles_when_the_zero_of_the_axis_moves_on(way):
    """By 300 deg: at 216 deg they count from the next turn; at rest the zero moves on by it, and the angles stay."""
    law = Plain()
    rig = Rig(config=replace(modulo(), compensation=CompensationSettings(law)))
    rig.power_up()
    command = rig.axis.motion.move_relative(way * rad(300.0), rad(360.0))
    rig.until(lambda: not command.alive, 5.0)
    rig.run(0.1)
    assert rig.ref_deg == approx(-60.0 * way)
    assert [deg(angle) for angle in law.turned_rad] == approx([360.0 * way])
    assert deg(law.asked[-1].ref) == approx(-60.0 * way)


@BOTH
def test_laws_keep_their_angles_when_the_zero_moves_on_at_speed(way, monkeypatch):
    """10 turns/s; the zero of a cruise moves on by each turn here, and the laws never go back by one for it."""
    monkeypatch.setattr(axis_turns, "CRUISING_TURNS", 1)
    law = Plain()
    rig = Rig(config=replace(modulo(), compensation=CompensationSettings(law)))
    rig.power_up()
    rig.axis.motion.move_velocity(way * rad(3600.0))
    rig.run(0.1)
    law.turned_rad.clear()
    rig.run(0.4)
    assert abs(rig.ref_deg) < 2.0 * 360.0, "the zero has moved on"
    assert [deg(angle) for angle in law.turned_rad] == approx([360.0 * way] * 4)


class Watch:
    """A watch of the calibration that keeps what it was shown."""

    def __init__(self, found):
        self.seen, self.rests, self.found = [], 0, found

    def scan(self, *seen):
        self.seen.append(seen)

    def rest(self):
        self.rests += 1
        return self.rests == 2


@pytest.mark.parametrize(("load_encoder", "backlash_rad"), [(True, 0.5), (False, 0.0)])
def test_the_calibration_is_watched_in_motion_and_told_of_at_rest(load_encoder, backlash_rad):
    """What the second encoder shows of the backlash counts where it is read; once told, the newest figures stand."""
    parts, law, side = load_side(load_encoder=load_encoder)
    law.backlash_change_rad, law.disagreement_rad = 0.5, rad(0.01)
    watch = side.watch = Watch({"scale": Finding(rad(0.2), rad(0.1))})
    virtual = parts.virtual
    virtual.pos_ref_rad, virtual.vel_ref_rad_s, virtual.acc_ref_rad_s2 = 1.0, 2.0, 3.0
    parts.feedback.torque_nm = 4.0
    virtual.at_rest = False
    side.scan(virtual, 0.0)
    assert watch.seen == [(1.0, 2.0, 3.0, 4.0, rad(0.01), backlash_rad)]
    assert watch.rests == 0
    virtual.at_rest = True
    side.scan(virtual, 0.0)
    assert (len(watch.seen), parts.codes) == (1, [])
    side.scan(virtual, 0.0)
    assert parts.codes == ["CTL-22"]
    watch.found = {"scale": Finding(rad(0.3), rad(0.1))}
    side.warn_stale()
    (said,) = parts.alarms.active[Code.CTL_22].values["measured"]
    assert said.values == {"measured": approx(0.3), "limit": approx(0.1)}


def test_a_machine_without_a_watch_has_nothing_to_warn_of():
    parts, _, side = load_side()
    side.warn_stale()
    assert parts.codes == []


@BOTH
def test_encoders_that_differ_by_the_limit_agree_and_beyond_it_are_told_in_degrees(way):
    parts, law, side = load_side(load_encoder=True, disagreement_rad=0.5)
    law.disagreement_rad = way * 0.5
    assert parts.after(lambda: side.scan(parts.virtual, 0.0), most_s=0.1) == math.inf
    law.disagreement_rad = way * 0.6
    parts.after(lambda: side.scan(parts.virtual, 0.0), most_s=0.1)
    values = parts.alarms.active[Code.ENC_07].values
    assert values == {"measured": approx(deg(way * 0.6)), "limit": approx(deg(0.5))}


def test_a_moment_at_the_limit_is_one_that_a_person_expects():
    parts, law, side = load_side(0.010, moment_limit_nm=1000.0)
    law.change_nm = 1000.0
    assert parts.after(lambda: side.scan(parts.virtual, 0.0), most_s=5.1) == math.inf


@pytest.mark.parametrize("preload", [True, False])
def test_a_calibration_is_watched_where_the_drive_adds_the_torque_that_is_asked_for(preload):
    figures = dict.fromkeys((field.name for field in fields(CalibrationWatchSettings)), 1.0)
    watch = CalibrationWatchSettings(**figures | {"identity": "1"})
    config = settings(torque_preload=preload)
    side = LoadSide(config, CompensationSettings(Law(), watch=watch), None, Parts().feedback, AlarmLog())
    assert (side.watch is not None) is preload


def test_a_moment_counts_from_its_first_scan_to_the_scan_in_which_5_s_are_over():
    parts, law, side = load_side(0.010, moment_limit_nm=1000.0)
    for change_nm in (0.0, 2000.0):
        law.change_nm = change_nm
        side.scan(parts.virtual, 0.0)
    assert parts.after(lambda: side.scan(parts.virtual, 0.0), most_s=6.0) == approx(4.99)
