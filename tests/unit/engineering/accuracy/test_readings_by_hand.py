"""From what an axis does to what a report says: readings, plans, budgets and columns, each written down by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.accuracy.attended.run import AttendedTest
from gantryctl.engineering.accuracy.attended.session import ChordOrder, StopReading, new_session
from gantryctl.engineering.accuracy.iso230 import IsoFigures
from gantryctl.engineering.accuracy.job import AccuracyJob, _budget
from gantryctl.engineering.accuracy.procedure.measuring import InstrumentKind, measure
from gantryctl.engineering.accuracy.procedure.on_batch import Readings, random_gear_values
from gantryctl.engineering.accuracy.procedure.on_engine import _reading
from gantryctl.engineering.accuracy.procedure.plan import chord_plan, chord_test
from gantryctl.engineering.accuracy.report.page import _measured_remark
from gantryctl.engineering.accuracy.report.text import ISO_NAMES, _iso_lines
from gantryctl.engineering.instruments import Reading
from gantryctl.engineering.report.origin import Origin
from gantryctl.errors import InstrumentError
from gantryctl.machine import default_machine, with_values
from gantryctl.trace.table import Trace

MACHINE = default_machine()
PLAIN_RING = with_values(
    MACHINE, {"plant.load_encoder.noise_rad": 0.0, "plant.load_encoder.scale_error_rad": 0.0}
)
CHORDS = chord_test(MACHINE, "A")
# Base 90 deg, counter-clockwise: approach, base, and the stop 5 deg beyond it.
STOP = 2


def readings(axis_time_s: float = 537.0, **moved_deg: float) -> Readings:
    """All three at their targets, but for one stop of `load`, `ring` or `motor`."""
    angles = {name: np.array([CHORDS.targets_rad]) for name in ("load", "ring", "motor")}
    for name, way in moved_deg.items():
        angles[name][0, STOP] += math.radians(way)
    still = np.zeros((1, len(CHORDS.stops)))
    return Readings(angles["load"], angles["ring"], angles["motor"], still, still, axis_time_s)


@pytest.mark.parametrize(
    ("kind", "sees"), [(InstrumentKind.LOAD_ENCODER, "ring"), (InstrumentKind.MOTOR_SIDE, "motor")]
)
def test_an_encoder_sees_what_it_sits_on_and_nothing_else(kind: InstrumentKind, sees: str) -> None:
    """0.02 deg too far at the first chord; steps of the ring's 2^26 are 5e-6 deg."""
    moved, others = (
        measure(PLAIN_RING, kind, CHORDS, each, 0).table.errors_deg
        for each in (
            readings(**{sees: 0.02}),
            readings(**{name: 0.02 for name in ("load", "ring", "motor") if name != sees}),
        )
    )
    assert moved[0, 1] == pytest.approx(0.02, abs=2e-5)
    assert np.abs(others).max() < 2e-5


def test_a_drift_is_one_offset_in_a_short_test_and_noise_in_one_of_years() -> None:
    """A stand that creeps with 10 um over an hour: no chord sees it within a second, and after a thousand hours between
    two stops each reading has its own, as large for A as the noise of a reading.
    """
    job = AccuracyJob(CHORDS)

    def sensitivities(axis_time_s: float) -> tuple[float, float]:
        found = _budget(MACHINE, job, readings(axis_time_s, load=0.01))
        assert found is not None
        by_name = {row.name: row.sensitivity for row in found.contributions}
        return by_name["drift of the stand"], by_name["noise of a reading"]

    drift, noise = sensitivities(1.0)
    assert drift < 0.05 * noise
    drift, noise = sensitivities(36.0 * 3.6e6)
    assert drift == pytest.approx(noise, rel=1e-6)


def test_what_a_person_asks_for_comes_before_the_machine_file() -> None:
    machine = with_values(
        MACHINE, {"accuracy.displacements_deg": [3.0, 6.0], "accuracy.bases_deg": [10.0, -10.0]}
    )
    assert chord_plan(machine).displacements_deg == (3.0, 6.0)
    asked = chord_plan(machine, (45.0,), (4.0, 8.0))
    assert (asked.bases_deg, asked.displacements_deg) == ((45.0,), (4.0, 8.0))


def test_a_reading_on_the_engine_is_the_mean_of_the_end_of_the_dwell() -> None:
    """Of 6 s the last 2: the load at 1.5 rad on a base that leans by 0.25, so the ring at 1.25; before it swung."""
    period_s = 1e-3 * MACHINE.control.scan_period_ms
    count = round(MACHINE.accuracy.dwell_s / period_s)
    end = np.arange(count) >= count - round(MACHINE.accuracy.average_s / period_s)
    found = _reading(
        Trace(
            {
                "time_s": period_s * np.arange(count),
                "pos_act_rad": np.where(end, 1.0, 7.0),
                "pos_load_rad": np.where(end, 1.5, 8.0),
                "pos_base_rad": np.where(end, 0.25, 3.0),
                "vel_ref_rad_s": np.zeros(count),
                "vel_act_rad_s": np.zeros(count),
                "vel_motor_rad_s": np.where(end, 0.0, -2.0 * MACHINE.axis.ratio),
                "vel_load_rad_s": np.where(end, 0.0, 3.0),
            }
        ),
        MACHINE,
    )
    # Speed errors are of the whole way to the stop, the motor's at the axis.
    assert found == pytest.approx((1.5, 1.25, 1.0, 2.0, 3.0))


def test_phases_of_random_gears_lie_all_round() -> None:
    """900 of them: their mean vector is that of strangers, 1/30; of half a turn it would be 2/pi."""
    phases = np.array([random_gear_values(seed)["plant.gear_error.phases_rad"] for seed in range(50)])
    assert abs(np.mean(np.exp(1j * phases))) < 4.0 / 30.0


def test_both_readings_are_uncertain_after_a_restart() -> None:
    """0.002 deg that a gantry repeats within, and three times sqrt(0.01^2 + 0.001^2): 0.0321 deg."""
    last = StopReading(1, 90.0, 90.0, 0.01, 90.0, "2026-11-28T10:00:00Z")
    session = replace(new_session(MACHINE, ChordOrder(chord_plan(MACHINE))), readings=(last,))
    run: Any = SimpleNamespace(machine=MACHINE)
    nothing: Any = None
    test = AttendedTest(run, session, nothing, nothing, nothing)
    (check,) = test._checked(Reading(90.032, 0.001)).checks
    assert (check.difference_deg, check.allowed_deg) == pytest.approx((0.032, 0.03215), abs=1e-5)
    with pytest.raises(InstrumentError, match=r"0\.03215 deg are allowed"):
        test._checked(Reading(89.9678, 0.001))


def test_the_true_figures_of_iso_230_2_stand_before_the_measured_ones() -> None:
    """1, 2, 3 .. mdeg of the axis, twice that through its instrument."""
    names = [attribute for attribute, _, _ in ISO_NAMES]
    true, measured = (
        IsoFigures(5, True, None, **{name: factor * k * 1e-3 for k, name in enumerate(names, 1)})
        for factor in (1.0, 2.0)
    )
    report: Any = SimpleNamespace(iso=true, iso_measured=measured, true=True)
    _, head, *rows = _iso_lines(report).splitlines()
    assert head.split() == ["true", "measured"]
    for k, row in enumerate(rows, 1):
        first, second = (float(word) for word in row.split() if word.lstrip("+").startswith("0."))
        assert (first, second) == (pytest.approx(k * 1e-3), pytest.approx(2e-3 * k))


def test_the_uncertainty_beside_a_measured_a_is_the_expanded_one() -> None:
    """k = 2 of 0.0012 deg."""
    report: Any = SimpleNamespace(uncertainty=SimpleNamespace(a_deg=0.0012), origin=Origin.MEASURED)
    assert _measured_remark(report) == "measured, ± 0.0024° (k = 2)"
