"""From a raw reading to an angle, and whether it may be believed: fault catalogue A9 to A14."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.machine import default_machine
from gantryctl.operation.home_reference import (
    ACCEPTED_DEG,
    AMBIGUOUS_DEG,
    AbsoluteReading,
    EncoderScale,
    RestVerdict,
    judge_reference,
    why_not_referenced,
)
from gantryctl.operation.opening import new_machine
from gantryctl.runtime import Retained

approx = pytest.approx
MACHINE = default_machine()
FRESH = new_machine(MACHINE, 20.0)
SCALE = FRESH.scale
REST = FRESH.retained
RAW = FRESH.drive.read().pos_act_counts
TURN = SCALE.identity.counts_per_turn


def reading_after(moved_deg: float, retained: Retained | None = REST, scale: EncoderScale = SCALE) -> float:
    """The raw reading when the gantry has moved while off."""
    return (RAW + moved_deg / scale.deg_per_count) % scale.range_counts


def verdict(moved_deg: float, retained: Retained | None = REST) -> RestVerdict:
    return judge_reference(SCALE, reading_after(moved_deg), retained).verdict


def why_not(reading: AbsoluteReading) -> str:
    reason = why_not_referenced(reading)
    assert reason is not None
    return reason.text


def test_the_scale_is_that_of_the_reference_encoder() -> None:
    assert SCALE.turn_deg == pytest.approx(0.3147, abs=1e-4)
    assert SCALE.deg_per_count * TURN == pytest.approx(SCALE.turn_deg)
    assert SCALE.range_counts == 2048 * 2048 * 4096


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("counts", "verdict"),
    [(1, RestVerdict.OK), (2, RestVerdict.MOVED), (20, RestVerdict.MOVED), (21, RestVerdict.NOT_VALID)],
)
def test_the_limits_of_a_motion_while_off_belong_to_what_they_permit(
    sign: int, counts: int, verdict: RestVerdict
) -> None:
    """An encoder whose counts are 0.05 deg: one is settled, 20 are the 1 deg that a person may acknowledge."""
    scale = SCALE._replace(
        identity=SCALE.identity._replace(counts_per_turn=7200), ratio=1.0, coarse_per_turn=7200
    )
    middle = scale.range_counts // 2
    retained = replace(REST, zero_offset_counts=middle, rest_position_counts=middle)
    assert judge_reference(scale, middle + sign * counts, retained).verdict is verdict


def test_unmoved_is_believed_with_angle_turn_and_step() -> None:
    reading = judge_reference(SCALE, RAW, REST)
    assert reading.verdict is RestVerdict.OK
    assert why_not_referenced(reading) is None
    assert reading.angle_deg == pytest.approx(20.0, abs=0.01)
    assert reading.moved_deg == 0.0
    assert reading.multi_turn * TURN + reading.single_turn * (TURN // 8192) == pytest.approx(RAW, abs=512)
    assert 0 <= reading.single_turn < 8192
    assert reading.margin_minus_deg == pytest.approx(464.5, abs=0.5)
    assert reading.margin_plus_deg == pytest.approx(464.5, abs=0.5)


# --- A11, A12, A13: moved while off -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("moved_deg", "expected"),
    [
        (0.03, RestVerdict.OK),
        (-0.0499, RestVerdict.OK),
        (0.0501, RestVerdict.MOVED),
        (0.2, RestVerdict.MOVED),
        (-0.8, RestVerdict.MOVED),
        # Within 0.05 deg of a motor turn, 0.3147 deg: whoever moved it by hand there proves it to service.
        (0.3, RestVerdict.TURNS),
        (-0.99, RestVerdict.TURNS),
        (1.01, RestVerdict.NOT_VALID),
        (-3.0, RestVerdict.NOT_VALID),
        (91.1, RestVerdict.NOT_VALID),
        (-150.0, RestVerdict.NOT_VALID),
    ],
)
def test_a_motion_while_off_is_judged_by_its_size(moved_deg: float, expected: RestVerdict) -> None:
    assert verdict(moved_deg) is expected


@pytest.mark.parametrize(
    ("moved_deg", "verdict"),
    [
        *((sign * moved, verdict) for sign in (1.0, -1.0) for moved, verdict in (
            (0.0499, RestVerdict.OK), (0.0501, RestVerdict.MOVED),
            # 0.31469 deg are a turn of the motor; three are 0.94406.
            (0.2646, RestVerdict.MOVED), (0.2648, RestVerdict.TURNS),
            (0.3646, RestVerdict.TURNS), (0.3648, RestVerdict.MOVED),
            (0.9940, RestVerdict.TURNS), (0.9960, RestVerdict.MOVED),
            (0.9999, RestVerdict.MOVED), (1.0001, RestVerdict.NOT_VALID),
        )),
    ],
)  # fmt: skip
def test_a_way_while_off_is_judged_alike_both_ways(moved_deg: float, verdict: RestVerdict) -> None:
    raw = (RAW + moved_deg / SCALE.deg_per_count) % SCALE.range_counts
    reading = judge_reference(SCALE, raw, REST)
    assert reading.moved_deg == approx(moved_deg, abs=1e-6)
    assert reading.verdict is verdict


@given(st.floats(-360.0, 360.0))
def test_no_motion_above_the_limit_is_accepted_in_silence(moved_deg: float) -> None:
    reading = judge_reference(SCALE, reading_after(moved_deg), REST)
    if abs(moved_deg) > ACCEPTED_DEG + 1e-6:
        text = why_not(reading)
        assert text.startswith(("ENC-08 ·", "ENC-09 ·", "ENC-10 ·"))
    if abs(moved_deg) > AMBIGUOUS_DEG + 1e-6:
        assert reading.verdict in (RestVerdict.NOT_VALID, RestVerdict.TURNS)


def test_the_ambiguity_of_the_range_is_never_a_proof() -> None:
    """Moved by the whole range of the encoder: no reading can show it, so it must not be mechanically possible."""
    whole_range_deg = SCALE.range_counts * SCALE.deg_per_count
    assert whole_range_deg > 2 * (SCALE.stops_deg[1] - SCALE.stops_deg[0])
    assert verdict(whole_range_deg) is RestVerdict.OK


def test_without_a_stored_rest_position_nothing_proves_the_angle() -> None:
    reading = judge_reference(SCALE, RAW, replace(REST, rest_position_counts=None))
    assert reading.verdict is RestVerdict.NOT_VALID
    assert "no rest position" in why_not(reading)


def test_an_angle_beyond_the_mechanical_stops_cannot_be_true() -> None:
    """Zero offset of elsewhere, rest position moved along: only the angle itself can tell."""
    shifted = round(RAW - 300.0 / SCALE.deg_per_count)
    reading = judge_reference(SCALE, RAW, replace(REST, zero_offset_counts=shifted))
    assert reading.verdict is RestVerdict.NOT_VALID
    assert "beyond the mechanical stops" in why_not(reading)


@pytest.mark.parametrize(
    ("moved_deg", "said"),
    [
        (1.0, "beyond the mechanical stops"),
        (-1.0, "beyond the mechanical stops"),
        (1.0001, "moved +1.000 deg while off, or"),
        (-1.0001, "moved -1.000 deg while off, or"),
    ],
)
def test_a_way_that_a_person_may_acknowledge_is_not_the_reason_against_an_angle(
    moved_deg: float, said: str
) -> None:
    """Up to 1 deg only the stops can have made it invalid; beyond, turns may be lost."""
    reading = judge_reference(SCALE, RAW, REST)._replace(verdict=RestVerdict.NOT_VALID, moved_deg=moved_deg)
    assert said in why_not(reading)
    assert ("beyond the mechanical stops" in why_not(reading)) is (abs(moved_deg) <= 1.0)


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize(("beyond_deg", "verdict"), [(-0.01, RestVerdict.OK), (0.01, RestVerdict.NOT_VALID)])
def test_no_angle_beyond_a_stop_is_true(end: int, beyond_deg: float, verdict: RestVerdict) -> None:
    angle = SCALE.stops_deg[end] + (beyond_deg if end else -beyond_deg)
    zero = round(RAW - angle / SCALE.deg_per_count)
    reading = judge_reference(SCALE, RAW, replace(REST, zero_offset_counts=zero))
    assert reading.angle_deg == approx(angle, abs=1e-5)
    assert reading.verdict is verdict


def test_an_angle_just_at_a_stop_is_within() -> None:
    """The stops themselves belong to the angles that can be true, to the last bit."""
    angle = judge_reference(SCALE, RAW, REST).angle_deg
    assert angle is not None
    beyond, before = math.nextafter(angle, math.inf), math.nextafter(angle, -math.inf)
    for stops, verdict in (
        ((angle, 190.0), RestVerdict.OK), ((beyond, 190.0), RestVerdict.NOT_VALID),
        ((-190.0, angle), RestVerdict.OK), ((-190.0, before), RestVerdict.NOT_VALID),
    ):  # fmt: skip
        assert judge_reference(SCALE._replace(stops_deg=stops), RAW, REST).verdict is verdict


# --- A10: lost turns --------------------------------------------------------------------------------------------------


@given(st.integers(-400, 400).filter(bool), st.floats(-0.99 * ACCEPTED_DEG, 0.99 * ACCEPTED_DEG))
def test_lost_turns_are_not_a_motion_to_be_acknowledged(turns: int, settling_deg: float) -> None:
    reading = judge_reference(SCALE, reading_after(turns * SCALE.turn_deg + settling_deg), REST)
    assert reading.verdict is RestVerdict.TURNS
    assert why_not(reading).startswith("ENC-08 ·")
    assert "set-zero" in why_not(reading)


# --- A14: another encoder ---------------------------------------------------------------------------------------------


def test_another_serial_is_refused_even_where_the_reading_fits() -> None:
    reading = judge_reference(SCALE, RAW, replace(REST, encoder_serial="SIM-0002"))
    assert reading.verdict is RestVerdict.OTHER_ENCODER
    assert why_not(reading).startswith("ENC-11 · the encoder is SIM-0001")


@pytest.mark.parametrize("retained", [None, replace(REST, zero_offset_counts=None)])
def test_without_a_zero_there_is_no_angle(retained: Retained | None) -> None:
    reading = judge_reference(SCALE, RAW, retained)
    assert reading.verdict is RestVerdict.NO_ZERO
    assert reading.angle_deg is None
    assert why_not(reading).startswith("ENC-10 ·")
    assert "no zero offset is stored" in why_not(reading)


# --- A9: the wrap of the range ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize(
    ("distance_deg", "fits"), [(5.01, True), (4.99, False), (0.0, False), (-30.0, False)]
)
def test_a_wrap_near_the_travel_is_refused(below: bool, distance_deg: float, fits: bool) -> None:
    """The zero offset that puts the end of the encoder's range so far from the travel's end."""
    edge_deg = SCALE.pos_min_deg - distance_deg if below else SCALE.pos_max_deg + distance_deg
    zero = round(-edge_deg / SCALE.deg_per_count) % SCALE.range_counts
    at_zero = replace(REST, zero_offset_counts=zero, rest_position_counts=zero)
    reading = judge_reference(SCALE, zero, at_zero)
    assert reading.verdict is (RestVerdict.OK if fits else RestVerdict.WRAP)
    if not fits:
        assert why_not(reading).startswith("CFG-ENC-01 ·")


@pytest.mark.parametrize("below", [True, False])
@pytest.mark.parametrize(("more_deg", "verdict"), [(0.01, RestVerdict.OK), (-0.01, RestVerdict.WRAP)])
def test_each_margin_to_the_wrap_counts(below: bool, more_deg: float, verdict: RestVerdict) -> None:
    margin = SCALE.wrap_margin_min_deg + more_deg
    low_deg = SCALE.pos_min_deg - margin if below else None
    zero_from_low = -low_deg if low_deg is not None else None
    range_deg = SCALE.range_counts * SCALE.deg_per_count
    zero_deg = zero_from_low if zero_from_low is not None else range_deg - SCALE.pos_max_deg - margin
    zero = round(zero_deg / SCALE.deg_per_count)
    raw = zero + 20.0 / SCALE.deg_per_count
    kept = replace(REST, zero_offset_counts=zero, rest_position_counts=round(raw))
    reading = judge_reference(SCALE, raw, kept)
    assert reading.verdict is verdict
    margins = (reading.margin_minus_deg, reading.margin_plus_deg)
    assert min(each for each in margins if each is not None) == approx(margin, abs=1e-5)


def test_margins_are_those_of_the_travel_wherever_0_deg_lies() -> None:
    """From 100 to 300 deg: 0 deg lies 95 deg below the range, so that the travel begins 5 deg above its end."""
    scale = SCALE._replace(pos_min_deg=100.0, pos_max_deg=300.0, stops_deg=(90.0, 310.0))
    zero = round((5.0 - 100.0) / scale.deg_per_count) % scale.range_counts
    raw = round(25.0 / scale.deg_per_count)
    kept = replace(REST, zero_offset_counts=zero, rest_position_counts=raw)
    reading = judge_reference(scale, raw, kept)
    assert reading.angle_deg == approx(120.0, abs=1e-5)
    range_deg = scale.range_counts * scale.deg_per_count
    assert (reading.margin_minus_deg, reading.margin_plus_deg) == approx((5.0, range_deg - 205.0), abs=1e-5)


@given(st.floats(-500.0, 500.0), st.integers(0, SCALE.range_counts - 1))
def test_unwrapping_never_jumps_wherever_the_wrap_is(angle_deg: float, zero: int) -> None:
    """Forced all the same, a wrap inside the travel still gives the true angle."""
    raw = (zero + angle_deg / SCALE.deg_per_count) % SCALE.range_counts
    back = (SCALE.unwrapped(raw, zero) - zero) * SCALE.deg_per_count
    assert back == pytest.approx(angle_deg, abs=1e-6)


def test_the_angle_is_the_same_from_every_branch() -> None:
    for turns in (-4096, 0, 4096):
        reading = judge_reference(SCALE, (RAW + turns * TURN) % SCALE.range_counts, REST)
        assert reading.angle_deg == pytest.approx(20.0, abs=0.01)
    assert math.isclose(SCALE.centred(SCALE.range_counts - 1), -1.0)


def test_a_modulo_axis_has_no_margins_and_no_stops() -> None:
    """At 250 deg beyond its zero, a place of its turn: 250 - 360."""
    scale = SCALE._replace(axis_turn_counts=Fraction(1144 * TURN))
    raw = (RAW + 230.0 / SCALE.deg_per_count) % SCALE.range_counts
    reading = judge_reference(scale, raw, replace(REST, rest_position_counts=round(raw)))
    assert (reading.margin_minus_deg, reading.margin_plus_deg) == (None, None)
    assert reading.verdict is RestVerdict.OK
    assert reading.angle_deg == pytest.approx(-110.0, abs=0.01)


def test_a_travel_far_from_0_deg_is_read_on_its_own_branch() -> None:
    """From 400 to 700 deg: half the range of 1288.9 deg lies on either side of 550 deg."""
    scale = SCALE._replace(pos_min_deg=400.0, pos_max_deg=700.0)
    for angle_deg in (410.0, 690.0):
        raw = (1000 + angle_deg / scale.deg_per_count) % scale.range_counts
        assert (scale.unwrapped(raw, 1000) - 1000) * scale.deg_per_count == approx(angle_deg, abs=1e-6)


def test_a_zero_of_no_encoder_is_not_that_of_this_one() -> None:
    """A memory that does not say whose zero it holds proves nothing."""
    assert verdict(0.0, replace(REST, encoder_serial="")) is RestVerdict.OTHER_ENCODER
