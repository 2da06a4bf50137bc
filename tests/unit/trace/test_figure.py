"""Pictures of a recording: whole turns of a modulo axis are neither steps nor errors in them."""

import numpy as np
import pytest

from gantryctl.trace.figure import chosen, draw, overview
from gantryctl.trace.table import Trace
from gantryctl.units import SIGNED, Dial

COLUMNS = ("time_s", "pos_ref_rad", "pos_act_rad", "pos_load_rad", "vel_ref_rad_s", "vel_act_rad_s")


def recording(ref_deg, load_deg, speed_deg_s=0.0):
    """The motor side is 0.001 deg behind its set-point."""
    rows = np.column_stack(
        (
            np.arange(len(ref_deg)) * 0.1, np.radians(ref_deg), np.radians(np.asarray(ref_deg) - 0.001),
            np.radians(load_deg), np.full(len(ref_deg), np.radians(speed_deg_s)), np.zeros(len(ref_deg)),
        )
    )  # fmt: skip
    return Trace.from_rows(COLUMNS, rows, {})


def test_a_zero_that_moves_on_by_turns_is_no_step_and_no_error():
    """The axis turns to 800 deg, and rests: two turns go into its zero. The plant counts from a turn before."""
    way = np.linspace(0.0, 800.0, 81)
    ref = np.concatenate((way, np.full(10, 80.0)))
    load = np.concatenate((way, np.full(10, 800.0))) - 360.0 - 0.002
    angle, error, *_ = overview(recording(ref, load))
    lines = {line.label: line.values for line in angle.lines}
    assert lines["set-point"][-1] == pytest.approx(800.0)
    for values in lines.values():
        assert np.max(np.abs(np.diff(values))) < 11.0
        assert values == pytest.approx(lines["set-point"], abs=0.003)
    for line, size_mdeg in zip(error.lines, (2.0, 1.0), strict=True):
        assert line.values == pytest.approx(size_mdeg, abs=1e-6)


def test_an_axis_that_turns_through_zero_has_no_step():
    """10 deg a row: from 350 deg to 0 deg is no more than from 340 deg to 350 deg."""
    ref = np.arange(0.0, 800.0, 10.0) % 360.0
    for line in overview(recording(ref, ref))[0].lines:
        assert np.diff(line.values) == pytest.approx(10.0)


def test_errors_of_speed_are_whole_and_gaps_stay_gaps():
    ref = np.array([np.nan, 10.0, 20.0, np.nan, 30.0])
    panels = overview(recording(ref, ref, speed_deg_s=400.0))
    assert panels[3].lines[0].values == pytest.approx(400.0)
    assert panels[0].lines[0].values == pytest.approx(ref, nan_ok=True)


def test_angles_of_a_linear_axis_are_those_of_the_recording():
    ref = np.linspace(-179.0, 179.0, 500)
    trace = recording(ref, ref - 0.01)
    line = overview(trace)[0].lines[0]
    assert np.array_equal(line.values, np.degrees(1.0) * trace["pos_ref_rad"])


def test_a_recording_says_how_people_read_its_angles():
    """Only angles of the axis: an error is no angle of a turn."""
    ref = np.linspace(-30.0, 30.0, 61)
    signed = recording(ref, ref)
    read = Trace.from_rows(COLUMNS, np.column_stack([signed[name] for name in COLUMNS]), Dial(0.0).metadata())
    dials = {panel.title: panel.dial for panel in overview(read)}
    assert dials.pop("Angle") == Dial(0.0)
    assert set(dials.values()) == {SIGNED}
    assert {panel.dial for panel in overview(signed)} == {SIGNED}
    assert chosen(read, ["pos_act_rad"])[0].dial == Dial(0.0)
    assert chosen(read, ["vel_act_rad_s"])[0].dial == SIGNED
    angle = draw(read, overview(read), "").axes[0]
    angle.figure.canvas.draw()
    assert {label.get_text() for label in angle.get_yticklabels()} >= {"340", "0", "20"}
