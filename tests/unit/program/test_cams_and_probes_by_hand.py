"""Cam switches and touch probes, scan by scan, on an axis of which a test says what it shows; in rad and rad/s."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import UsageError
from gantryctl.program import Code
from gantryctl.program.blocks.cam_switch import Cam, CamDirection, DigitalCamSwitch
from gantryctl.program.blocks.touch_probe import AbortTrigger, TouchProbe, between
from gantryctl.program.settings import TravelSettings
from unit.program.parts import BOTH
from unit.program.rig import settings

LINEAR = settings().travel
MODULO = TravelSettings(-math.inf, math.inf, -math.inf, math.inf)
REST_RAD_S = 0.25
PERIOD_S = 0.5


def axis_of(travel: TravelSettings = LINEAR) -> Any:
    refusals: list[object] = []
    return SimpleNamespace(
        settings=SimpleNamespace(
            travel=travel, speed=SimpleNamespace(rest_rad_s=REST_RAD_S), period_s=PERIOD_S
        ),
        virtual=SimpleNamespace(pos_ref_rad=0.0, vel_ref_rad_s=0.0),
        feedback=SimpleNamespace(position_valid=True, vel_rad_s=0.0),
        pos_act_rad=0.0,
        time_s=0.0,
        refusals=refusals,
        report_refusal=refusals.append,
    )


def at(cams: DigitalCamSwitch, pos: float, vel: float = 0.0, time_s: float | None = None) -> tuple[bool, ...]:
    """One scan there."""
    axis = cams.axis
    axis.pos_act_rad, axis.feedback.vel_rad_s = pos, vel
    axis.time_s = axis.time_s + PERIOD_S if time_s is None else time_s
    cams()
    return cams.outputs


# --- between two angles -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pos", "inside"), [(0.999, False), (1.0, True), (2.0, True), (2.001, False), (1.0 + math.tau, False)]
)
def test_an_angle_of_a_linear_axis_lies_between_two_others_both_included(pos, inside):
    assert between(axis_of(), pos, 1.0, 2.0) is inside


def test_what_counts_before_and_beyond_is_added_on_its_side():
    for axis, turn in ((axis_of(), 0.0), (axis_of(MODULO), math.tau)):
        for pos, inside in ((0.49, False), (0.51, True), (2.24, True), (2.26, False)):
            assert between(axis, pos + turn, 1.0, 2.0, before_rad=0.5, beyond_rad=0.25) is inside


@pytest.mark.parametrize("turns", [-2, 0, 3])
def test_of_a_modulo_axis_it_goes_from_the_first_angle_on_forward_in_every_turn(turns):
    axis = axis_of(MODULO)
    for first, last, inside, outside in (
        (1.0, 2.0, (1.001, 1.5, 1.999), (0.9, 2.1, 4.0, -1.0)),
        # From 5 over the end of the turn to 1: 2.28 rad.
        (5.0, 1.0, (5.001, 6.0, 0.0, 0.999), (1.1, 3.0, 4.9)),
        # A whole turn and more is every angle.
        (1.0, 1.0 + math.tau, (0.0, 1.0, 4.0), ()),
        (1.0, 1.0 + 1.5 * math.tau, (0.0, 1.0, 4.0, 6.0), ()),
    ):
        for pos in inside:
            assert between(axis, pos + turns * math.tau, first, last), (pos, first, last)
        for pos in outside:
            assert not between(axis, pos + turns * math.tau, first, last), (pos, first, last)


def test_the_edges_of_a_window_of_a_modulo_axis_belong_to_it():
    axis = axis_of(MODULO)
    assert between(axis, 0.5, 0.5, 1.0)
    assert between(axis, 1.0, 0.5, 1.0)
    assert not between(axis, 1.0000001, 0.5, 1.0)
    assert not between(axis, 0.4999999, 0.5, 1.0)


# --- cams -------------------------------------------------------------------------------------------------------------


def test_a_new_cam_switch_shows_nothing():
    cams = DigitalCamSwitch(axis_of(), [[Cam(0.0, 1.0)], [Cam(0.0, 1.0)]])
    assert cams.outputs == (False, False)
    assert cams.in_operation is False


@BOTH
def test_a_cam_acts_in_its_direction_and_at_rest_in_the_last_one(way):
    """A speed of rest says nothing of the direction: the reading of a drive at rest is noise."""
    forward, back = CamDirection.POSITIVE, CamDirection.NEGATIVE
    cams = DigitalCamSwitch(axis_of(), [[Cam(-9.0, 9.0, forward)], [Cam(-9.0, 9.0, back)], [Cam(-9.0, 9.0)]])
    assert at(cams, 0.0) == (True, False, True), "nothing has moved yet"
    turning = (way > 0.0, way < 0.0, True)
    assert at(cams, 0.0, way * 0.3) == turning
    for vel in (0.0, REST_RAD_S, -REST_RAD_S, 0.2, -0.2):
        assert at(cams, 0.0, vel) == turning, vel


@BOTH
def test_each_edge_lies_earlier_by_its_compensation_in_either_direction(way):
    """2 rad/s: on 0.2 rad before the edge that comes, off 0.4 before the one that is left, as at half a rad/s."""
    for speed in (2.0, 0.5):
        cams = DigitalCamSwitch(axis_of(), [[Cam(-1.0, 1.0)]], on_s=0.1, off_s=0.2)
        before, left = 1.0 + 0.1 * speed, 1.0 - 0.2 * speed
        for pos, on in (
            (-before - 0.01, False),
            (-before + 0.01, True),
            (left - 0.01, True),
            (left + 0.01, False),
        ):
            assert at(cams, way * pos, way * speed) == (on,), (pos, speed)


def test_hysteresis_holds_a_cam_that_is_on_both_sides_of_it():
    cams = DigitalCamSwitch(axis_of(), [[Cam(-1.0, 1.0)]], hysteresis_rad=0.25)
    for pos, on in (
        (1.1, False), (0.9, True), (1.2, True), (1.3, False), (1.2, False),
        (-1.1, False), (-0.9, True), (-1.2, True), (-1.3, False),
    ):  # fmt: skip
        assert at(cams, pos) == (on,), pos


@pytest.mark.parametrize("travel", [LINEAR, MODULO])
@BOTH
def test_a_pulse_begins_as_the_axis_comes_to_its_angle_and_lasts_its_time(way, travel):
    """On to the angle itself, or over it; from it away, or at rest there, begins none."""
    cam = Cam(1.0, 0.0, duration_s=2.0)
    for before, then, on in (
        (1.0 - way * 0.1, 1.0, True),
        (1.0 - way * 0.1, 1.0 + way * 0.1, True),
        (1.0, 1.0 + way * 0.1, False),
        (1.0, 1.0, False),
        (1.0 - way * 0.2, 1.0 - way * 0.1, False),
        (1.0 + way * 0.1, 1.0 + way * 0.2, False),
    ):
        cams = DigitalCamSwitch(axis_of(travel), [[cam]])
        assert at(cams, before, time_s=10.0) == (False,), "one scan is no way"
        assert at(cams, then, time_s=10.5) == (on,), (before, then)
        if on:
            assert at(cams, then, time_s=12.0) == (True,)
            assert at(cams, then, time_s=12.5) == (False,)


@BOTH
def test_a_pulse_of_a_modulo_axis_is_no_matter_of_whole_turns(way):
    """The zero moves on by a turn between two scans; at half a turn from its angle no pulse begins."""
    cams = DigitalCamSwitch(axis_of(MODULO), [[Cam(0.1, 0.0, duration_s=2.0)]])
    at(cams, 0.1 - way * 0.05)
    assert at(cams, 0.1 + way * 0.05 - way * math.tau) == (True,)
    cams = DigitalCamSwitch(axis_of(MODULO), [[Cam(0.1, 0.0, duration_s=2.0)]])
    at(cams, 0.1 + math.pi - way * 0.05)
    assert at(cams, 0.1 + math.pi + way * 0.05) == (False,)


@BOTH
def test_a_pulse_begins_earlier_by_its_compensation_and_in_its_direction_only(way):
    """0.5 s at 1 rad/s: half a rad before its angle."""
    acts = CamDirection.POSITIVE if way > 0.0 else CamDirection.NEGATIVE
    other = CamDirection.NEGATIVE if way > 0.0 else CamDirection.POSITIVE
    cams = DigitalCamSwitch(axis_of(), [[Cam(0.0, 0.0, acts, 2.0)], [Cam(0.0, 0.0, other, 2.0)]], on_s=0.5)
    assert at(cams, -way * 0.6, way) == (False, False)
    assert at(cams, -way * 0.45, way, time_s=10.0) == (True, False)
    # It is passed once.
    assert at(cams, -way * 0.3, way, time_s=10.5) == (True, False)
    assert at(cams, -way * 0.2, way, time_s=12.0) == (False, False)


def test_a_cam_switch_that_stops_forgets_its_pulses_and_where_it_was():
    cams = DigitalCamSwitch(axis_of(), [[Cam(1.0, 0.0, duration_s=9.0)], [Cam(0.0, 3.0)]])
    at(cams, 0.9)
    assert at(cams, 1.1) == (True, True)
    cams(enable=False)
    assert (cams.in_operation, cams.outputs) == (False, (False, False))
    assert at(cams, 0.9) == (False, True), "no way from 1.1 back to 0.9"
    assert cams.in_operation


@pytest.mark.parametrize("set_point", [False, True])
def test_a_switch_of_the_set_point_needs_no_reading(set_point):
    cams = DigitalCamSwitch(axis_of(), [[Cam(1.0, 2.0)]], set_point=set_point)
    axis = cams.axis
    axis.virtual.pos_ref_rad, axis.virtual.vel_ref_rad_s = 1.5, 1.0
    axis.feedback.position_valid = False
    assert at(cams, 0.0, -1.0) == (set_point,)
    axis.feedback.position_valid = True
    assert at(cams, 0.0, -1.0) == (set_point,)
    axis.virtual.pos_ref_rad = 0.0
    assert at(cams, 1.5, -1.0) == (not set_point,)


@pytest.mark.parametrize("duration_s", [0.0, 0.5, None])
def test_a_pulse_may_be_as_short_as_anybody_likes(duration_s):
    assert Cam(0.0, 1.0, duration_s=duration_s).duration_s == duration_s


@pytest.mark.parametrize("duration_s", [-0.001, -1.0, math.nan, math.inf])
def test_a_time_that_is_none_is_refused(duration_s):
    with pytest.raises(UsageError):
        Cam(0.0, 1.0, duration_s=duration_s)


@pytest.mark.parametrize(
    "wrong",
    [{"on_s": math.inf}, {"off_s": math.nan}, {"hysteresis_rad": -0.1}, {"hysteresis_rad": math.pi}],
)
def test_a_compensation_or_a_hysteresis_that_is_none_is_refused(wrong):
    with pytest.raises(UsageError):
        DigitalCamSwitch(axis_of(), [[Cam(0.0, 1.0)]], **wrong)
    assert DigitalCamSwitch(axis_of(), [], hysteresis_rad=0.0).outputs == ()


def test_the_directions_have_the_numbers_of_plcopen():
    assert [int(direction) for direction in CamDirection] == [0, 1, 2]


# --- probes -----------------------------------------------------------------------------------------------------------


@BOTH
def test_a_probe_keeps_the_angle_of_its_edge_and_how_late_it_may_be(way):
    axis = axis_of(MODULO)
    probe = TouchProbe(axis)
    assert (probe.busy, probe.done, probe.command_aborted, probe.uncertainty_rad) == (
        False,
        False,
        False,
        0.0,
    )
    assert math.isnan(probe.recorded_position_rad)
    axis.pos_act_rad, axis.feedback.vel_rad_s = way * (1.0 + math.tau), way * 3.0
    probe(execute=True, trigger=False)
    assert (probe.busy, probe.done) == (True, False)
    probe(execute=True, trigger=True)
    assert (probe.busy, probe.done) == (False, True)
    assert probe.recorded_position_rad == pytest.approx(way * 1.0)
    assert probe.uncertainty_rad == 1.5
    # What comes later is not of this probe; it shows for as long as Execute stays.
    axis.pos_act_rad = 2.0
    probe(execute=True, trigger=False)
    probe(execute=True, trigger=True)
    assert probe.recorded_position_rad == pytest.approx(way * 1.0)
    probe(execute=False, trigger=False)
    assert not probe.done
    # Armed again it knows nothing of that.
    probe(execute=True, trigger=False)
    assert probe.busy
    assert math.isnan(probe.recorded_position_rad)
    assert probe.uncertainty_rad == 0.0


def test_a_level_that_is_true_when_the_probe_is_armed_is_no_edge():
    probe = TouchProbe(axis_of())
    probe(execute=True, trigger=True)
    assert probe.busy
    probe(execute=True, trigger=False)
    probe(execute=True, trigger=True)
    assert probe.done


def test_no_probe_is_armed_without_execute():
    probe = TouchProbe(axis_of())
    probe(execute=False, trigger=False)
    assert not probe.busy


def test_a_probe_whose_execute_falls_goes_on():
    probe = TouchProbe(axis_of())
    probe(execute=True, trigger=False)
    probe(execute=False, trigger=False)
    assert probe.busy
    probe(execute=False, trigger=True)
    assert probe.done


def test_an_angle_that_is_not_known_is_not_kept():
    axis = axis_of()
    probe = TouchProbe(axis)
    probe(execute=True, trigger=False)
    axis.feedback.position_valid = False
    probe(execute=True, trigger=True)
    assert probe.busy
    axis.feedback.position_valid = True
    probe(execute=True, trigger=False)
    probe(execute=True, trigger=True)
    assert probe.done


@pytest.mark.parametrize(("pos", "kept"), [(0.9, False), (1.5, True), (2.1, False)])
def test_with_a_window_an_edge_outside_it_does_not_count(pos, kept):
    axis = axis_of()
    axis.pos_act_rad = pos
    for window_only in (True, False):
        probe = TouchProbe(axis)
        inputs = {"window_only": window_only, "first_position_rad": 1.0, "last_position_rad": 2.0}
        probe(execute=True, trigger=False, **inputs)
        probe(execute=True, trigger=True, **inputs)
        assert probe.done is (kept or not window_only)


@pytest.mark.parametrize("window", [(math.nan, 1.0), (0.0, math.inf)])
def test_a_window_without_an_end_is_refused_in_degrees_until_execute_falls(window):
    axis = axis_of()
    probe = TouchProbe(axis)
    probe(
        execute=True,
        trigger=False,
        window_only=True,
        first_position_rad=window[0],
        last_position_rad=window[1],
    )
    assert (probe.busy, probe.error, probe.error_id) == (False, True, Code.CTL_01)
    (refused,) = axis.refusals
    assert refused.values["allowed"].values == {"low": -360.0, "high": 360.0}
    assert "position must be within -360.00 and 360.00 deg" in probe.error_text
    probe(execute=False, trigger=False)
    assert not probe.error


def test_a_probe_that_is_given_up_shows_that_until_execute_falls():
    probe = TouchProbe(axis_of())
    abort = AbortTrigger(probe)
    assert (abort.done, abort.error) == (False, False)
    abort(execute=True)
    assert abort.done, "also where nothing waits"
    assert not probe.command_aborted
    abort(execute=False)
    assert not abort.done
    probe(execute=True, trigger=False)
    abort(execute=False)
    assert probe.busy
    abort(execute=True)
    assert (abort.done, probe.busy, probe.command_aborted) == (True, False, True)
    probe(execute=True, trigger=True)
    assert not probe.done
    # Held, it gives up nothing more; given up twice, it stays so.
    assert probe.abort() is False
    assert probe.command_aborted
    probe(execute=False, trigger=False)
    assert not probe.command_aborted
    probe(execute=True, trigger=False)
    abort(execute=True)
    assert probe.busy
    assert probe.abort() is True
