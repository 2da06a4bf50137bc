"""The gear model against other ways of computing it, honest on synthetic gears, and refuted where it is wrong."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from gantryctl.engineering.accuracy import gear
from gantryctl.engineering.accuracy.gear import (
    GRADES,
    READING_DEG,
    GearModel,
    GearStudy,
    Place,
    Prediction,
    Wave,
    gear_study,
    r_squared,
    study_text,
    waves_of,
    worth_of_the_fit,
)
from gantryctl.engineering.accuracy.paper import PAPER_TABLE
from gantryctl.engineering.accuracy.table import Direction, ErrorTable, Layout, RowKey
from gantryctl.errors import UsageError
from gantryctl.machine import default_machine
from gantryctl.units import SIGNED
from support.command_line import done

MACHINE = default_machine()
WAVES = waves_of(MACHINE)
WINDUP_RAD = 4e-5


def table_of(errors: np.ndarray, bases: tuple[float, ...] = (90.0, 0.0, -90.0)) -> ErrorTable:
    rows = tuple(RowKey(base, way) for base in bases for way in Direction)
    values = np.hstack([np.zeros((len(rows), 1)), errors.reshape(len(rows), -1)])
    return ErrorTable(rows, PAPER_TABLE.displacements_deg, values)


def synthetic(
    rng: np.random.Generator, bases: tuple[float, ...] = (90.0, 0.0, -90.0), extra: tuple[Wave, ...] = ()
) -> ErrorTable:
    """A gear of the prior, written down again: every wave with a phase of its own, every reading with an error."""
    grade, reading = rng.choice(GRADES), rng.choice(READING_DEG)
    waves = [
        (
            w.cycles,
            math.degrees(w.amplitude_rad)
            * 2.0 ** (0.5 * (grade - 8.0))
            * rng.normal(size=2)
            / math.sqrt(2.0),
        )
        for w in WAVES
    ]
    waves.append((1.0, math.degrees(WINDUP_RAD) * rng.normal(size=2)))
    waves += [(w.cycles, math.degrees(w.amplitude_rad) * rng.normal(size=2)) for w in extra]

    def angle(at_deg: float) -> float:
        at = math.radians(at_deg)
        return math.fsum(a * math.sin(n * at) + b * math.cos(n * at) for n, (a, b) in waves)

    errors = []
    for base in bases:
        for way in Direction:
            own = reading * rng.normal()
            for d in PAPER_TABLE.displacements_deg[1:]:
                error = way.sign * (angle(base + way.sign * d) - angle(base))
                errors.append(error + reading * rng.normal() - own)
    return table_of(np.array(errors), bases)


def covered(tables: list[ErrorTable]) -> float:
    """Part of the chords of the last base that lie in what the other bases predict."""
    inside = of = 0
    for table in tables:
        model = GearModel(table, WAVES, WINDUP_RAD)
        found = model.predict(np.array([place.row.base_deg == table.bases_deg[-1] for place in model.places]))
        inside, of = inside + found.covered, of + len(found.places)
    return inside / of


def test_the_waves_of_the_reference_gear() -> None:
    """60 um at 2.366 m are 25.36 urad; 90 urad behind a ring of 13 and 20 um at its pinion are 6.92 + 8.45."""
    found = {wave.cycles: 1e6 * wave.amplitude_rad for wave in waves_of(MACHINE)}
    assert found == pytest.approx(
        {
            1.0: 25.36, 2.0: 13.52, 3.0: 9.30, 4.0: 7.19, 5.0: 5.49, 6.0: 4.65, 7.0: 3.80, 8.0: 3.38, 9.0: 2.96,
            10.0: 2.54, 11.0: 2.11, 12.0: 2.11, 13.0: 15.38, 338.0: 3.38, 1144.0: 1.154, 2288.0: 3.077, 4576.0: 0.769,
        },
        abs=0.01,
    )  # fmt: skip


def test_the_moment_winds_up_gear_and_base_in_series(monkeypatch: pytest.MonkeyPatch) -> None:
    """15 990 N m on 512 and 1 161 MN m/rad: 31.2 + 13.8 urad."""
    seen: list[float] = []

    class Seen(GearModel):
        def __init__(self, table: ErrorTable, waves: tuple[Wave, ...], windup_rad: float) -> None:
            seen.append(windup_rad)
            super().__init__(table, waves, windup_rad)

    monkeypatch.setattr(gear, "GearModel", Seen)
    study = gear_study(PAPER_TABLE, MACHINE)
    assert seen == pytest.approx([45.0e-6], abs=0.05e-6)
    # Every row, and every base, from the others.
    assert [{place.row for place in part.places} for part in study.by_base] == [
        {row for row in PAPER_TABLE.rows if row.base_deg == base} for base in (90.0, 0.0, -90.0)
    ]
    assert [place.row for place in study.by_row.places[::4]] == list(PAPER_TABLE.rows)


def test_what_a_fit_is_worth_in_a_sentence_and_what_lies_outside() -> None:
    """Four chords of one base; intervals of 2, 4, 2 and 4 mdeg, 1.5 to either side in the mean; two are outside."""
    row = RowKey(0.0, Direction.CCW)
    low = np.array([-0.001, -0.002, -0.001, -0.002])
    found = Prediction(
        tuple(Place(row, d) for d in (5.0, 10.0, 15.0, 20.0)),
        np.array([0.0005, 0.0025, -0.0015, -0.0005]), np.zeros(4), low, -low,
    )  # fmt: skip
    study = GearStudy("t", 0.5, found, (found,), {8.0: 0.25, 9.0: 0.75})
    assert "2 of 4 then lie in their 95 % intervals, +-0.0015 deg" in worth_of_the_fit(study)
    lines = study_text(study, SIGNED).splitlines()[2:6]
    assert [line.endswith("outside") for line in lines] == [False, True, True, False]
    assert "8: 25 %, 9: 75 %" in study_text(study, SIGNED)


def test_r_squared_by_hand() -> None:
    """1 and 3 are 2 about their mean: all of it is left by 2 and 2, four times as much the other way round."""
    measured = np.array([1.0, 3.0])
    assert [r_squared(measured, np.array(told)) for told in ((1.0, 3.0), (2.0, 2.0), (3.0, 1.0))] == [
        1.0,
        0.0,
        -3.0,
    ]
    assert math.isnan(r_squared(np.array([2.0, 2.0]), measured))


def test_the_evidence_is_the_density_of_the_table() -> None:
    model = GearModel(PAPER_TABLE, WAVES, WINDUP_RAD)
    for grade, reading in ((6.0, 0.0004), (8.0, 0.0002), (9.0, 0.0008)):
        density = multivariate_normal(np.zeros(24), model.covariance(grade, reading))
        assert model.log_evidence(grade, reading) == pytest.approx(density.logpdf(model.errors_deg), rel=1e-9)


def test_two_grades_are_twice_the_amplitude_and_leave_readings_and_windup_as_they_are() -> None:
    """Tolerances of ISO 1328-1 grow by sqrt(2) a grade: four times the variance of two grades less."""
    model = GearModel(PAPER_TABLE, WAVES, 0.0)
    readings = model.covariance(8.0, 0.001) - model.covariance(8.0, 0.0)
    gear_8 = model.covariance(8.0, 0.0)
    assert model.covariance(10.0, 0.001) == pytest.approx(4.0 * gear_8 + readings, rel=1e-9)
    assert model.covariance(6.0, 0.001) == pytest.approx(0.25 * gear_8 + readings, rel=1e-9)
    wound = GearModel(PAPER_TABLE, WAVES, WINDUP_RAD)
    windup = wound.covariance(8.0, 0.0) - gear_8
    # One sine of a turn, in deg: chords of it from their base.
    at = np.radians([place.row.base_deg for place in wound.places])
    way = np.array([place.row.direction.sign for place in wound.places])
    there = at + way * np.radians([place.displacement_deg for place in wound.places])
    chords = np.degrees(WINDUP_RAD) * way * (np.sin(there) - np.sin(at))
    assert windup == pytest.approx(np.outer(chords, chords), rel=1e-6, abs=1e-12)
    assert wound.covariance(10.0, 0.0) == pytest.approx(4.0 * gear_8 + windup, rel=1e-9)


def test_the_prediction_is_that_of_the_coefficients(monkeypatch: pytest.MonkeyPatch) -> None:
    """Conjugate regression in the space of the waves: (S^-1 + X'N^-1 X)^-1 X'N^-1 y, another way to the same mean."""
    model = GearModel(PAPER_TABLE, WAVES, 0.0)
    monkeypatch.setattr(GearModel, "weights", lambda *_: {(8.0, 0.0003): 1.0})
    held = np.array([place.row.base_deg == 0.0 for place in model.places])
    found = model.predict(held)
    used, noise = model.basis[~held], 0.0003**2 * (np.eye(16) + np.kron(np.eye(4), np.ones((4, 4))))
    variance = np.degrees(np.array([w.amplitude_rad for w in WAVES] * 2)) ** 2 / 2.0
    scaled = used * np.sqrt(variance)
    precision = np.eye(len(variance)) + scaled.T @ np.linalg.solve(noise, scaled)
    mean = np.linalg.solve(precision, scaled.T @ np.linalg.solve(noise, model.errors_deg[~held]))
    ahead = model.basis[held] * np.sqrt(variance)
    assert found.mean_deg == pytest.approx(ahead @ mean, abs=1e-10)
    spread = ahead @ np.linalg.solve(precision, ahead.T)
    spread += 0.0003**2 * (np.eye(8) + np.kron(np.eye(2), np.ones((4, 4))))
    half = 1.959964 * np.sqrt(np.diag(spread))
    assert 0.5 * (found.high_deg - found.low_deg) == pytest.approx(half, rel=1e-4)


def test_the_fit_is_that_of_the_coefficients(monkeypatch: pytest.MonkeyPatch) -> None:
    """The waves of the mean coefficients, another way to the same chords; of two readings' errors the mean of both."""
    model = GearModel(PAPER_TABLE, WAVES, 0.0)
    scaled = model.basis * np.degrees(np.array([w.amplitude_rad for w in WAVES] * 2)) / math.sqrt(2.0)

    def fitted(reading_deg: float) -> np.ndarray:
        noise = reading_deg**2 * (np.eye(24) + np.kron(np.eye(6), np.ones((4, 4))))
        precision = np.eye(scaled.shape[1]) + scaled.T @ np.linalg.solve(noise, scaled)
        return scaled @ np.linalg.solve(precision, scaled.T @ np.linalg.solve(noise, model.errors_deg))

    monkeypatch.setattr(GearModel, "weights", lambda *_: {(8.0, 0.0003): 0.25, (8.0, 0.001): 0.75})
    assert model.fitted() == pytest.approx(0.25 * fitted(0.0003) + 0.75 * fitted(0.001), abs=1e-10)


def test_an_interval_of_two_grades_lies_between_theirs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of the probability each: 2.5 % below the low end, in the mean of both distributions."""
    model = GearModel(PAPER_TABLE, WAVES, WINDUP_RAD)
    held = np.array([place.row.base_deg == 0.0 for place in model.places])
    alone = []
    for pair in ((6.0, 0.0002), (9.0, 0.0008)):
        monkeypatch.setattr(GearModel, "weights", lambda *_, pair=pair: {pair: 1.0})
        alone.append(model.predict(held))
    monkeypatch.setattr(GearModel, "weights", lambda *_: {(6.0, 0.0002): 0.5, (9.0, 0.0008): 0.5})
    both = model.predict(held)
    assert both.mean_deg == pytest.approx(0.5 * (alone[0].mean_deg + alone[1].mean_deg), abs=1e-12)
    for end, below in ((both.low_deg, 0.025), (both.high_deg, 0.975)):
        parts = [
            norm.cdf(end, one.mean_deg, (one.high_deg - one.low_deg) / (2.0 * 1.959964)) for one in alone
        ]
        assert 0.5 * (parts[0] + parts[1]) == pytest.approx(np.full(8, below), abs=1e-5)


def test_the_weights_are_the_evidence_of_each_pair() -> None:
    """Two pairs are as likely as their densities are to each other."""
    model = GearModel(PAPER_TABLE, WAVES, WINDUP_RAD)
    found = model.weights()
    assert set(found) == {(grade, reading) for grade in GRADES for reading in READING_DEG}
    assert sum(found.values()) == pytest.approx(1.0)
    for one, other in (((8.0, 0.0004), (9.0, 0.0004)), ((8.0, 0.0004), (8.0, 0.0008))):
        apart = model.log_evidence(*one) - model.log_evidence(*other)
        assert math.log(found[one] / found[other]) == pytest.approx(apart, abs=1e-9)


def test_the_grid_is_that_of_the_grades_and_of_readings_from_2_5_to_40_um() -> None:
    """At 2.5 m: 5, 10, 20 and 40 um are about 0.0001, 0.0002, 0.0004 and 0.0008 deg."""
    assert GRADES == (5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
    assert READING_DEG == (0.00005, 0.0001, 0.0002, 0.0004, 0.0008)


def test_intervals_hold_95_percent_of_what_synthetic_gears_do() -> None:
    """100 gears of 8 chords; chords of a base go together, as some 3: 95 +- 3.8 % with 3 standard deviations."""
    rng = np.random.default_rng(5)
    assert 0.91 <= covered([synthetic(rng) for _ in range(100)]) <= 0.99


def test_a_gear_with_a_wave_in_no_list_refutes_the_model() -> None:
    """78 cycles a turn with an amplitude of 0.02 deg: nothing like it is in the intervals."""
    rng = np.random.default_rng(6)
    stranger = (Wave(78.0, math.radians(0.02)),)
    assert covered([synthetic(rng, extra=stranger) for _ in range(30)]) < 0.85


def test_enough_bases_do_predict_the_next() -> None:
    """Every 15 deg but the last: the ring's twelve waves are seen, and what is left out is told ahead."""
    rng = np.random.default_rng(7)
    bases = (*(float(b) for b in range(-180, 165, 15)), 52.5)
    missed = size = 0.0
    for _ in range(2):
        model = GearModel(synthetic(rng, bases), WAVES, WINDUP_RAD)
        found = model.predict(np.array([place.row.base_deg == 52.5 for place in model.places]))
        missed += float(np.sum((found.measured_deg - found.mean_deg) ** 2))
        size += float(np.sum(found.measured_deg**2))
    assert missed < 0.5 * size


def test_the_paper_s_table_predicts_nothing_and_the_intervals_own_up_to_it() -> None:
    study = gear_study(PAPER_TABLE, MACHINE)
    assert study.in_sample_r2 > 0.6
    assert study.by_row.r_squared < 0.0
    assert study.of_bases.r_squared < 0.0
    assert study.of_bases.covered >= 22
    assert sum(study.grades.values()) == pytest.approx(1.0)
    # Half of its probability is on grades 8 and 9, which the machine file has.
    assert study.grades[8.0] + study.grades[9.0] > 0.4


def test_two_bases_predict_each_other() -> None:
    two = ErrorTable(PAPER_TABLE.rows[:4], PAPER_TABLE.displacements_deg, PAPER_TABLE.errors_deg[:4])
    assert [len(part.places) for part in gear_study(two, MACHINE).by_base] == [8, 8]


def test_tables_that_tell_nothing_of_a_gear_are_refused() -> None:
    steps = ErrorTable(PAPER_TABLE.rows, PAPER_TABLE.displacements_deg, PAPER_TABLE.errors_deg, Layout.STEPS)
    with pytest.raises(UsageError, match="chords from the base"):
        gear_study(steps, MACHINE)
    single = ErrorTable(PAPER_TABLE.rows[:2], PAPER_TABLE.displacements_deg, PAPER_TABLE.errors_deg[:2])
    with pytest.raises(UsageError, match="two bases at least"):
        gear_study(single, MACHINE)


def test_the_command_prints_intervals_and_what_the_fit_is_worth(tmp_path: Path) -> None:
    text = done("accuracy", "gear").out
    assert text.count(" .. ") == 24
    assert "(a base; below 0" in text
    data = done("accuracy", "gear", "--json").json
    assert len(data["base_left_out"]["chords"]) == 24
    assert data["base_left_out"]["r2"] < 0.0
    assert "(a base; below 0" in done("accuracy", "run", "--no-speed-test", "--out", tmp_path).out.replace(
        "\n  ", " "
    )
