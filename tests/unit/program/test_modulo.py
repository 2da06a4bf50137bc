"""A modulo axis: ways by direction, turns without end, and no bit lost in them. The judge is exact arithmetic."""

import math
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.errors import CommandRefused
from gantryctl.image import Direction
from gantryctl.program.alarms.codes import Code
from gantryctl.program.axis.command_checks import check_destination, require, way_to
from gantryctl.program.axis.motion_command import CommandStatus
from gantryctl.program.axis.turns import CRUISING_TURNS, Turns
from gantryctl.program.blocks import Inch
from gantryctl.program.settings import MonitorSettings, SpeedSettings, TravelSettings
from gantryctl.units import deg, rad
from unit.program import rig
from unit.program.rig import COUNTS_PER_TURN, RATIO, ZERO_COUNTS, Rig

TURN_COUNTS = Fraction(COUNTS_PER_TURN * 1144)
# Speed and ramps far beyond a gantry's, so that thousands of turns take seconds: 1000 turns/s. In a scan of 1 ms the
# speed changes by 40 deg/s, which is 0.04 deg of the position; the bands of the monitors are as much wider.
FAST_DEG_S = 360_000.0
ACC_DEG_S2 = 40_000.0
# A count is 7.5e-8 deg. A motion has ended when the axis is within the in-position window.
ARRIVED_DEG = 0.005
SHORTEST, POSITIVE, NEGATIVE = Direction.SHORTEST, Direction.POSITIVE, Direction.NEGATIVE


def modulo(turn_counts=TURN_COUNTS, period_s=0.001):
    """Settings of a modulo axis."""
    config = rig.settings(period_s=period_s, acc=ACC_DEG_S2, dec=ACC_DEG_S2)
    fast = rad(FAST_DEG_S)
    return replace(
        config,
        travel=TravelSettings(-math.inf, math.inf, -math.inf, math.inf, 0.0),
        speed=SpeedSettings(rad(0.6), fast, 1.05 * fast, 1.1 * fast),
        ramps=replace(config.ramps, jog_release_dec_rad_s2=rad(ACC_DEG_S2), jog_release_jerk_rad_s3=rad(1e9)),
        law=replace(config.law, turn_counts=turn_counts),
        monitors=replace(
            MonitorSettings(),
            speed_reading_max_rad_s=2.0 * fast,
            encoder_jump_base_rad=rad(0.2),
            encoder_drift_max_rad=rad(0.2),
            # Half a scan of the ramp's speed, by the gain of 10/s: 2 deg.
            following_error_base_rad=rad(8.0),
            velocity_deviation_rad_s=rad(100.0),
        ),
    )


class Table:
    """A modulo axis with power on, and its turns by exact arithmetic."""

    def __init__(self, period_s=0.001):
        self.rig = Rig(config=modulo(period_s=period_s))
        self.rig.power_up()
        self.axis = self.rig.axis
        # What a ramp of no machine adds to the speed in a scan is no oscillation.
        self.axis.monitors._oscillation = SimpleNamespace(scan=lambda swing_rad_s: None)

    @property
    def counts(self):
        """Way since 0 deg by the reading of the last scan, whole counts."""
        return int(self.rig.image.drive.pos_act_counts) - ZERO_COUNTS

    @property
    def true_deg(self):
        """Way since 0 deg by exact arithmetic."""
        return 360 * self.counts / TURN_COUNTS

    def finish(self):
        self.rig.until(lambda: self.axis.at_rest)
        assert not self.rig.codes

    def absolute(self, target_deg, direction=None):
        command = self.axis.motion.move_absolute(rad(target_deg), rad(FAST_DEG_S), direction)
        assert command.status is CommandStatus.ACTIVE, command.refusal
        self.finish()

    def relative(self, way_deg):
        command = self.axis.motion.move_relative(rad(way_deg), rad(FAST_DEG_S))
        assert command.status is CommandStatus.ACTIVE, command.refusal
        self.finish()

    def turn(self, sign, turns):
        """Turn without an end; halt after so many turns."""
        begin = self.counts
        command = self.axis.motion.move_velocity(sign * rad(FAST_DEG_S))
        assert command.status is CommandStatus.ACTIVE, command.refusal
        self.rig.until(lambda: abs(self.counts - begin) > turns * TURN_COUNTS)
        self.axis.motion.halt()
        self.finish()

    @property
    def shown_deg(self):
        return deg(self.axis.settings.travel.shown_rad(self.axis.pos_act_rad))

    def judge(self):
        """The angle that is shown is the true one, to a count."""
        apart = Fraction(self.shown_deg) - self.true_deg
        apart -= 360 * round(apart / 360)
        assert abs(apart) <= 360 / TURN_COUNTS


def expected_way(here, target, direction):
    """The way by hand, in exact arithmetic; half a turn goes forward."""
    forward = (target - here) % 360
    if direction is NEGATIVE:
        return forward - 360 if forward else forward
    return forward if direction is POSITIVE or forward <= 180 else forward - 360


EIGHTHS = st.integers(-8 * 360, 8 * 360).map(lambda n: Fraction(n, 8))
ABSOLUTE = st.tuples(EIGHTHS, st.sampled_from([None, SHORTEST, POSITIVE, NEGATIVE]))
RELATIVE = st.integers(-8 * 2000, 8 * 2000).map(lambda n: Fraction(n, 8))


def run_moves(moves):
    """Make the moves; the way since 0 deg that they should be, deg."""
    table, at = Table(), Fraction(0)
    for move in moves:
        if isinstance(move, tuple):
            target, direction = move
            at += expected_way(at, target, direction)
            table.absolute(float(target), direction)
        else:
            at += move
            table.relative(float(move))
        assert float(table.true_deg - at) == pytest.approx(0.0, abs=ARRIVED_DEG)
        # Rounding of the set-points, degrees in binary radians: a hundredth of a count after some hundred turns.
        ref = Fraction(deg(table.axis.virtual.pos_ref_rad)) - at
        assert abs(float(ref - 360 * round(ref / 360))) < 1e-9
        table.judge()
    return table


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(ABSOLUTE, RELATIVE), min_size=1, max_size=4))
def test_any_row_of_moves_ends_where_exact_arithmetic_says(moves):
    run_moves(moves)


def test_ten_thousand_turns_are_exact_to_a_count():
    table = Table()
    table.turn(+1.0, 10_000)
    assert table.true_deg > 3_600_000
    table.judge()
    turns_made = round(table.true_deg / 360)
    table.absolute(123.0, SHORTEST)
    table.judge()
    assert float(table.true_deg % 360) == pytest.approx(123.0, abs=ARRIVED_DEG)
    # The set-point alone: on the angle of its turn to a thousandth of a count.
    ref = table.axis.virtual.pos_ref_rad
    assert abs(math.remainder(ref - rad(123.0), math.tau)) < 1e-3 * math.tau / float(TURN_COUNTS)
    table.turn(-1.0, 10_000)
    table.absolute(0.0, SHORTEST)
    table.judge()
    assert abs(round(table.true_deg / 360)) < turns_made


def test_the_set_point_of_a_motion_without_end_never_grows():
    table = Table()
    table.axis.motion.move_velocity(rad(FAST_DEG_S))
    furthest = 0.0
    ways = []
    last = None
    for _ in range(15_000):
        table.rig.step()
        ref = table.axis.virtual.pos_ref_rad
        furthest = max(furthest, abs(ref))
        if last is not None:
            ways.append(math.remainder(ref - last, math.tau))
        last = ref
    # 5 turns a scan beyond the bound at most, in the ramp from rest (4500 turns) twice as far: it is no cruise yet.
    assert furthest < (4500 + CRUISING_TURNS) * math.tau
    assert table.true_deg > 360 * 5000
    # At its speed it goes on by the same way in every scan, also where its zero moves on: 1 turn is 0 here.
    assert max(map(abs, ways[-4000:])) < 1e-9
    assert not table.rig.codes


@pytest.mark.parametrize(
    ("here", "target", "direction", "way"),
    [
        (10.0, 350.0, SHORTEST, -20.0),
        (10.0, 350.0, POSITIVE, 340.0),
        (10.0, 350.0, NEGATIVE, -20.0),
        (350.0, 10.0, SHORTEST, 20.0),
        (350.0, 10.0, NEGATIVE, -340.0),
        (0.0, 180.0, SHORTEST, 180.0),
        (180.0, 0.0, SHORTEST, 180.0),
        (0.0, -180.0, SHORTEST, 180.0),
        (90.001, 90.0, POSITIVE, -0.001),  # within the window: nobody means a whole turn
        (90.01, 90.0, POSITIVE, 359.99),
        (89.999, 90.0, NEGATIVE, 0.001),
        (89.99, 90.0, NEGATIVE, -359.99),
        (0.0, 360.0, POSITIVE, 0.0),
    ],
)
def test_the_way_by_direction(here, target, direction, way):
    assert deg(way_to(rad(here), rad(target), direction, rad(0.005))) == pytest.approx(way, abs=1e-9)


def test_the_current_direction_is_that_of_the_last_motion():
    table = Table()
    table.absolute(350.0, Direction.CURRENT)  # positive since the start
    assert float(table.true_deg) == pytest.approx(350.0, abs=ARRIVED_DEG)
    table.absolute(300.0, NEGATIVE)
    table.absolute(310.0, Direction.CURRENT)
    assert float(table.true_deg) == pytest.approx(310.0 - 360.0, abs=ARRIVED_DEG)
    table.absolute(300.0, Direction.CURRENT)  # on, 10 deg back
    assert float(table.true_deg) == pytest.approx(300.0 - 360.0, abs=ARRIVED_DEG)
    # What is kept of the plans is the set-point of the turn that is counted now.
    assert table.axis.virtual.plans[-1][1].pos_end == table.axis.virtual.pos_ref_rad


def test_a_motion_of_no_length_has_no_direction():
    table = Table()
    table.absolute(300.0, NEGATIVE)
    table.absolute(300.0, SHORTEST)
    table.absolute(290.0, Direction.CURRENT)  # on, 10 deg back
    assert float(table.true_deg) == pytest.approx(290.0 - 360.0, abs=ARRIVED_DEG)


def test_a_direction_is_kept_while_it_moves():
    """A target that lies within the way to rest is reached a turn later: no way back."""
    table = Table()
    table.axis.motion.move_velocity(rad(FAST_DEG_S))
    table.rig.run(0.5)
    stopping_deg = deg(table.axis.virtual.rest_point_rad() - table.axis.virtual.pos_ref_rad)
    assert stopping_deg > 360.0
    command = table.axis.motion.move_absolute(0.0, rad(FAST_DEG_S), POSITIVE)
    assert command.status is CommandStatus.ACTIVE
    while not table.axis.at_rest:
        table.rig.step()
        assert table.axis.virtual.vel_ref_rad_s >= 0.0
    assert math.remainder(float(table.true_deg), 360.0) == pytest.approx(0.0, abs=ARRIVED_DEG)


def test_an_angle_beyond_a_turn_is_refused_and_by_way_it_is_not():
    table = Table()
    command = table.axis.motion.move_absolute(rad(400.0), rad(10.0))
    assert command.status is CommandStatus.ERROR
    assert command.refusal.code is Code.CTL_01
    table.relative(400.0)
    assert float(table.true_deg) == pytest.approx(400.0, abs=ARRIVED_DEG)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan])
def test_an_increment_of_an_axis_without_ends_has_no_largest_one(bad):
    inch = Inch(Rig(config=modulo()).axis)
    inch(forward=True, backward=False, distance_rad=rad(bad), velocity_rad_s=rad(10.0))
    assert inch.error_id is Code.CTL_01
    assert inch.error_text.startswith("increment must be above 0, got ")


def test_a_linear_axis_refuses_a_direction():
    linear = rig.settings().travel
    with pytest.raises(CommandRefused, match="a direction is for a modulo axis"):
        require(check_destination(0.0, rad(10.0), SHORTEST, linear))
    assert check_destination(0.0, rad(10.0), None, linear) is None
    bench = Rig()
    bench.power_up()
    command = bench.axis.motion.move_absolute(rad(10.0), rad(6.0), POSITIVE)
    assert command.status is CommandStatus.ERROR
    assert bench.axis.at_rest


def test_a_new_reference_takes_any_angle_of_the_turn():
    table = Table()
    table.relative(1000.0)
    assert table.axis.set_position(rad(359.0)) is None
    assert table.shown_deg == pytest.approx(359.0, abs=1e-7)
    table.absolute(1.0)
    assert float(table.true_deg) == pytest.approx(1002.0, abs=ARRIVED_DEG)
    assert table.axis.set_position(rad(361.0)).code is Code.CTL_01


# --- the zero between two counts, and over a power cycle ---------------------------------------------------------

GEARS = st.tuples(st.integers(1, 5000), st.integers(1, 97)).map(lambda gear: Fraction(*gear))
WHOLE = st.integers(-(2**45), 2**45)


@given(GEARS, st.integers(6, 22), WHOLE, st.lists(st.integers(-(10**6), 10**6), max_size=20))
def test_the_zero_after_any_turns_is_the_nearest_double(gear, bits, zero, made):
    turns = Turns(gear * 2**bits, zero)
    for each in made:
        found = turns.move_on(each)
        assert isinstance(found, float)
    if made:
        assert found == float(zero + sum(made) * gear * 2**bits)


@given(GEARS, st.integers(6, 22), st.integers(1, 65536), WHOLE, WHOLE)
def test_a_zero_that_is_kept_gives_the_same_angle_after_a_power_cycle(gear, bits, motor_turns, zero, counts):
    """The encoder's range is no whole number of turns of the axis: after the cycle it shows any multiple less."""
    turn, span = gear * 2**bits, motor_turns * 2**bits
    kept = Turns(turn, zero).kept_zero(counts, span)
    assert (counts % span - kept - (counts - zero)) % turn == 0
    assert abs(counts % span - kept) <= turn.numerator


def test_liar_a_zero_kept_within_the_range_as_that_of_a_linear_axis_is_found():
    """3.58 turns of the axis are 0.58 of a turn."""
    zero, span = ZERO_COUNTS, 4096 * COUNTS_PER_TURN
    counts = zero + 2 * span + 1000
    kept = zero % span
    assert (counts % span - kept - (counts - zero)) % TURN_COUNTS != 0


def test_liar_a_zero_that_moves_a_turn_too_few_stops_the_axis(monkeypatch):
    """The set-point counts the turns and the zero does not: a following error of a turn."""
    true = Turns.move_on
    monkeypatch.setattr(Turns, "move_on", lambda turns, made: true(turns, made - (1 if made > 0 else -1)))
    table = Table()
    with pytest.raises(AssertionError):
        run_moves([Fraction(720), (Fraction(90), None)])
    table.relative(350.0)  # within a turn nothing moves on


def test_liar_a_motor_turn_too_few_in_the_zero_is_seen_by_exact_arithmetic(monkeypatch):
    """A gear of 1143 : 1 in the turns, 1144 : 1 in the law: every turn leaves 0.3 deg."""
    wrong = modulo(Fraction(COUNTS_PER_TURN * 1143))
    table = Table()
    bench = Rig(config=wrong)
    bench.power_up()
    table.rig, table.axis = bench, bench.axis
    command = table.axis.motion.move_relative(rad(720.0), rad(FAST_DEG_S))
    assert command.status is CommandStatus.ACTIVE
    table.rig.until(lambda: table.axis.at_rest)
    table.rig.run(0.2)
    with pytest.raises(AssertionError):
        table.judge()
    assert RATIO == 1144.0


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_angle_of_the_scan_in_which_the_zero_moves_on_is_that_of_the_new_zero(way):
    """At rest at 300 deg the turn is taken off; no scan shows an angle of one turn beside a set-point of another."""
    turning = Rig(config=modulo())
    turning.power_up()
    before = turning.axis.zero_counts
    turning.axis.motion.move_relative(rad(way * 300.0), rad(FAST_DEG_S))
    while turning.axis.zero_counts == before:
        turning.step()
        assert turning.pos_deg == pytest.approx(turning.ref_deg, abs=100.0), "what the fast axis lags by"
    assert turning.pos_deg == pytest.approx(-way * 60.0, abs=0.1)


def test_the_turns_go_on_from_a_position_that_was_set():
    turning = Rig(config=modulo())
    turning.power_up()
    assert turning.axis.set_position(rad(90.0)) is None
    turning.axis.motion.move_relative(rad(300.0), rad(FAST_DEG_S))
    turning.run(2.0)
    assert turning.axis.at_rest
    assert turning.pos_deg == pytest.approx(30.0, abs=ARRIVED_DEG)


def test_the_time_at_which_a_motion_ended_stays_when_its_turn_is_taken_off():
    turning = Rig(config=modulo())
    turning.power_up()
    before = turning.axis.zero_counts
    turning.axis.motion.move_relative(rad(300.0), rad(FAST_DEG_S))
    end_s = turning.axis.plan_end_s
    assert end_s > turning.scan * turning.period_s
    turning.run(2.0)
    assert turning.axis.zero_counts != before
    assert turning.axis.plan_end_s == end_s


def test_a_motion_without_an_end_never_rests():
    turning = Rig(config=modulo())
    turning.power_up()
    turning.axis.motion.move_velocity(rad(3600.0))
    turning.run(0.5)
    for _ in range(100):
        turning.step()
        assert not turning.axis.virtual.at_rest
        assert not turning.output.at_rest
    assert turning.axis.plan_end_s == math.inf


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_limits_before_a_sector_go_back_with_the_turn(way):
    """Set to 300 deg it is at -60 deg in the next scan, and no nearer to the sector from 170 to 190 deg."""
    config = modulo()
    sector = (rad(170.0), rad(190.0))
    config = replace(config, travel=replace(config.travel, no_go_rad=(sector,), no_go_clearance_rad=rad(1.0)))
    axis_rig = Rig(config=config)
    axis_rig.step()
    assert axis_rig.axis.set_position(way * rad(300.0)) is None
    axis_rig.power_up()
    assert axis_rig.pos_deg == pytest.approx(way * -60.0, abs=1e-6)
    assert axis_rig.codes == []
