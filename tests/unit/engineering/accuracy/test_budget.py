"""The budget of A against its Monte Carlo, against noise in coordinates, and against instruments that measure."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.engineering.accuracy.budget import (
    _last_digit_deg,
    budget,
    budget_text,
    procedure_figure,
    stated_budget,
    stop_times_s,
    table_budget,
)
from gantryctl.engineering.accuracy.noise import a_draws
from gantryctl.engineering.accuracy.paper import PAPER_TABLE
from gantryctl.engineering.accuracy.procedure.procedures import chord_procedure
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.accuracy.table import Direction, ErrorTable, RowKey
from gantryctl.engineering.instruments.sources import SimulatedInstrument, Source, sources_of
from gantryctl.errors import UsageError
from support.command_line import cli, done

PROCEDURE = chord_procedure("A")
TARGETS = np.degrees(PROCEDURE.targets_rad)
# A gear error of some waves: far enough from a perfect axis for A to be nearly a line in small errors.
ANGLES = (
    TARGETS + 0.004 * np.sin(np.radians(7.0 * TARGETS + 30.0)) + 0.002 * np.sin(np.radians(3.0 * TARGETS))
)
TIMES = stop_times_s(len(ANGLES))
FIGURE = procedure_figure(PROCEDURE)


def smaller(sources: tuple[Source, ...], by: float) -> list[Source]:
    return [replace(source, value=source.value / by) for source in sources]


def test_small_errors_are_what_the_law_of_propagation_says() -> None:
    """A tenth of a tracker's: the maximum of eq. (6) stays where it is, and the draws have 1.96 u on either side."""
    found = budget("t", FIGURE, ANGLES, TIMES, smaller(sources_of("tracker"), 10.0), draws=4000)
    # Quantiles of 4,000 draws are known to 3 %, and uniform sources have shorter tails.
    assert found.high_deg == pytest.approx(1.96 * found.combined_deg, rel=0.12)
    assert found.low_deg == pytest.approx(-1.96 * found.combined_deg, rel=0.12)
    rows = [row.contribution_deg for row in found.contributions]
    assert found.combined_deg == pytest.approx(math.sqrt(sum(row**2 for row in rows)))
    assert all(
        row.contribution_deg == pytest.approx(row.sensitivity * row.value) for row in found.contributions
    )


def test_noise_alone_is_that_of_two_coordinates() -> None:
    """The other way: noise on x and y of every point, chords between the points, A of each draw."""
    noise = [source for source in sources_of("tracker", noise_um=1.0) if source.name.startswith("noise")]
    found = budget("t", FIGURE, ANGLES, TIMES, noise)
    drawn = a_draws(PROCEDURE, np.radians(ANGLES), 2.5, 1e-6, draws=2000)
    assert found.combined_deg == pytest.approx(float(np.std(drawn)), rel=0.06)


@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_degrees_of_freedom_are_those_of_welch_and_satterthwaite(size: float) -> None:
    line = lambda angles: angles[..., 0]  # noqa: E731
    one = lambda a, _: np.ones((len(a), 1))  # noqa: E731
    sources = [
        Source("a", 3.0 * size, "deg", "normal", one, degrees_of_freedom=8.0),
        Source("b", 4.0 * size, "deg", "normal", one),
    ]
    found = budget("t", line, np.zeros(1), np.zeros(1), sources)
    assert found.combined_deg == pytest.approx(5.0 * size)
    # 5^4 / (3^4 / 8).
    assert found.degrees_of_freedom == pytest.approx(625.0 * 8.0 / 81.0)
    assert found.expanded_deg == pytest.approx(10.0 * size)


def measured_a(sources: list[Source], seed: int) -> float:
    """A of a test by an instrument that measures, reading by reading."""
    stops = iter(ANGLES)
    instrument = SimulatedInstrument("t", lambda _: float(next(stops)), sources, seed)
    return float(FIGURE(np.array([instrument.read(time).angle_deg for time in TIMES])))


def test_the_interval_covers_what_instruments_measure_and_not_what_a_liar_does() -> None:
    """40 tests by trackers of the data sheet: 95 +- 10 %. By trackers with three times its errors far fewer."""
    sources = list(sources_of("tracker"))
    found, true = budget("t", FIGURE, ANGLES, TIMES, sources), float(FIGURE(ANGLES))

    def covered(of: list[Source]) -> int:
        return sum(found.low_deg <= measured_a(of, seed) - true <= found.high_deg for seed in range(40))

    assert covered(sources) >= 34
    assert covered([replace(source, value=3.0 * source.value) for source in sources]) < 28


def test_a_table_has_its_rounding_as_a_source() -> None:
    found = table_budget(PAPER_TABLE, "tracker", sources_of("tracker"))
    rounding = found.contributions[-1]
    assert rounding.name == "rounding of the table (+-5e-05 deg)"
    assert rounding.value == pytest.approx(0.5e-4 / math.sqrt(3.0))
    # Every printed chord error alone: what A changes by, as squares; the zero column is exact.
    slopes = []
    for row in range(6):
        for column in range(1, 5):
            step = np.zeros((6, 5))
            step[row, column] = 1e-7
            up, down = PAPER_TABLE.errors_deg + step, PAPER_TABLE.errors_deg - step
            slopes.append(float(accuracy_a(up) - accuracy_a(down)) / 2e-7)
    assert rounding.sensitivity == pytest.approx(math.hypot(*slopes), rel=1e-4)
    exact = ErrorTable(
        PAPER_TABLE.rows, PAPER_TABLE.displacements_deg, PAPER_TABLE.errors_deg * (1.0 + 1e-9 * math.pi)
    )
    assert (
        len(table_budget(exact, "tracker", sources_of("tracker")).contributions)
        == len(found.contributions) - 1
    )
    # Two of five rows measured by a level are worth less than by a tracker: 0.05 % of 20 deg are 0.01 deg.
    level = table_budget(PAPER_TABLE, "level", sources_of("level"))
    assert level.combined_deg > found.combined_deg


@pytest.mark.parametrize(("sign", "slope"), [(1.0, 7.0), (-1.0, 3.0)])
def test_a_scale_stretches_the_stops_of_a_table_where_they_were(sign: float, slope: float) -> None:
    """Errors of 2 deg at 5 deg and 1 deg at 10 deg, all rows alike: A is 2, from the first column to the zero column.

    By 1 % too long 7 deg are 0.07 deg more; where the errors are -2 and -1, 3 deg are 0.03 deg more and A less so.
    """
    rows = tuple(RowKey(base, way) for base in (90.0, 0.0) for way in Direction)
    table = ErrorTable(rows, (0.0, 5.0, 10.0), np.array([[0.0, sign * 2.0, sign * 1.0]] * 4))
    scale = Source("scale", 1e-4, "-", "normal", lambda angles, _: angles[:, None])
    (row, _) = table_budget(table, "t", [scale]).contributions
    assert row.sensitivity == pytest.approx(slope, rel=1e-5)


def test_an_autocollimator_stretches_what_the_axis_stands_beside_its_faces() -> None:
    """Errors of 0.03 and 0.01 deg at 15 deg: A is six S, 6 x 0.02 / sqrt(2), and a scale makes it longer by its part.

    1 % uniform is 0.01 / sqrt(3): of 0.0849 deg 0.00049.
    """
    rows = tuple(RowKey(0.0, way) for way in Direction)
    table = ErrorTable(rows, (0.0, 15.0), np.array([[0.0, 0.03], [0.0, 0.01]]))
    found = table_budget(table, "t", sources_of("autocollimator"))
    (scale,) = (row for row in found.contributions if "autocollimator, scale" in row.name)
    assert scale.sensitivity == pytest.approx(0.08485, rel=1e-3)
    assert scale.contribution_deg == pytest.approx(0.00049, rel=1e-2)


def test_a_chord_of_half_a_degree_is_rounded_too() -> None:
    """Errors of 0.1 and 0.3 deg: A is six S, and each error moves S by 1 / sqrt(2) of itself."""
    rows = tuple(RowKey(base, Direction.CCW) for base in (0.0, 90.0))
    table = ErrorTable(rows, (0.0, 0.5), np.array([[0.0, 0.1], [0.0, 0.3]]))
    (row,) = table_budget(table, "t", []).contributions
    assert row.name == "rounding of the table (+-0.05 deg)"
    assert row.sensitivity == pytest.approx(6.0, rel=1e-5)


def test_the_error_of_a_base_is_in_every_chord_of_its_row() -> None:
    """Two rows, 2.1 and 1.9 deg at 5 deg, -0.9 and -1.1 at 10: S is their distance by sqrt(2) in both columns.

    A base that reads 1 more leaves all chords of its row 1 less: both S shrink by 1 / sqrt(2), and A by 2 x 3 of them.
    """
    rows = tuple(RowKey(base, Direction.CCW) for base in (0.0, 90.0))
    table = ErrorTable(rows, (0.0, 5.0, 10.0), np.array([[0.0, 2.1, -0.9], [0.0, 1.9, -1.1]]))
    base = Source("base", 1e-4, "deg", "normal", lambda a, _: np.eye(len(a))[:, :1])
    assert table_budget(table, "t", [base]).contributions[0].sensitivity == pytest.approx(
        6.0 / math.sqrt(2.0), rel=1e-5
    )


@pytest.mark.parametrize(
    ("error_deg", "digit_deg"), [(0.3, 0.1), (0.32, 0.01), (-0.000123, 1e-6), (0.0000004, 0.0), (1.0, 0.1)]
)
def test_the_last_digit_of_a_table_is_the_smallest_that_one_of_its_errors_has(
    error_deg: float, digit_deg: float
) -> None:
    """Beside one of a single digit; more than six digits are no rounding."""
    assert _last_digit_deg(np.array([[0.0, 0.1], [0.0, error_deg]])) == pytest.approx(digit_deg, rel=1e-12)


def test_what_the_sources_draw_is_added_to_the_readings() -> None:
    """Two that have no other draws than 1 and 0.5 deg on each reading: the figure goes up by both."""

    def always(size: float) -> Any:
        return SimpleNamespace(
            **vars(replace(sources_of("level")[0], name=str(size))),
            covariance=lambda angles, times: np.eye(len(angles)),
            draws=lambda angles, times, draws, rng: np.full((draws, len(angles)), size),
        )

    found = budget("t", lambda angles: angles[..., 1], np.zeros(3), np.zeros(3), [always(1.0), always(0.5)])
    assert (found.low_deg, found.high_deg) == (1.5, 1.5)
    assert [row.sensitivity for row in found.contributions] == pytest.approx([1.0, 1.0])


def test_the_interval_of_the_draws_leaves_2_5_percent_on_either_side() -> None:
    """101 draws of 0, 1, .. 100 deg."""
    rising: Any = SimpleNamespace(
        **vars(sources_of("level")[0]),
        covariance=lambda angles, times: np.eye(len(angles)),
        draws=lambda angles, times, draws, rng: np.arange(float(draws))[:, None],
    )
    found = budget("t", lambda angles: angles[..., 0], np.zeros(1), np.zeros(1), [rising], draws=101)
    assert (found.low_deg, found.high_deg) == pytest.approx((2.5, 97.5))


def test_a_budget_is_the_same_each_time_it_is_asked_for() -> None:
    """2,000 draws of the same numbers, by whatever way."""
    sources = sources_of("tracker")
    first, again, other = (table_budget(PAPER_TABLE, "t", sources, *seed) for seed in ((), (0,), (1,)))
    assert first == again
    assert first.draws == 2000
    assert first.low_deg != other.low_deg
    found = [budget("t", FIGURE, ANGLES, TIMES, sources, **seed) for seed in ({}, {"seed": 0})]
    assert found[0] == found[1]
    stated = np.full(len(ANGLES), 2e-4)
    assert stated_budget(PROCEDURE, ANGLES, stated) == stated_budget(PROCEDURE, ANGLES, stated, seed=0)


def test_of_stops_that_are_not_read_alike_each_counts_with_its_own_statement() -> None:
    """Every second stop is known three times better."""
    stated = np.where(np.arange(len(ANGLES)) % 2, 1e-4, 3e-4)
    slope = np.array(
        [
            float(FIGURE(ANGLES + 1e-6 * (np.arange(len(ANGLES)) == k)) - FIGURE(ANGLES)) / 1e-6
            for k in range(len(ANGLES))
        ]
    )
    found = stated_budget(PROCEDURE, ANGLES, stated)
    assert found.combined_deg == pytest.approx(float(np.linalg.norm(slope * stated)), rel=1e-3)
    assert found.contributions[0].value == 3e-4


def test_the_first_stop_is_read_a_stop_after_the_start() -> None:
    assert stop_times_s(3).tolist() == [15.0, 30.0, 45.0]


def test_readings_of_which_only_a_statement_is_known_are_one_row() -> None:
    stated = np.full(len(ANGLES), 2e-4)
    found = stated_budget(PROCEDURE, ANGLES, stated)
    (row,) = found.contributions
    assert row.value == 2e-4
    # A statement is no sample: its degrees of freedom are without end, and so are those of the sum.
    assert found.degrees_of_freedom == math.inf
    slope = [
        float(FIGURE(ANGLES + 1e-6 * (np.arange(len(ANGLES)) == k)) - FIGURE(ANGLES)) / 1e-6
        for k in range(len(ANGLES))
    ]
    assert found.combined_deg == pytest.approx(2e-4 * math.sqrt(sum(each**2 for each in slope)), rel=1e-3)
    with pytest.raises(UsageError, match="no reading has an uncertainty"):
        stated_budget(PROCEDURE, ANGLES, np.zeros(len(ANGLES)))


def test_every_a_has_its_budget_beside_it() -> None:
    answer = done("accuracy", "stats", "paper_table2.csv").out
    assert "uncertainty of A, tracker by its data sheet, no certificate" in answer
    assert "expanded, k = 2: " in answer
    assert max(len(line) for line in answer.splitlines()) <= 100
    data = done("accuracy", "stats", "paper_table2.csv", "--budget", "level", "--json").json["budget"]
    assert data["instrument"] == "level by its data sheet, no certificate"
    assert data["expanded_deg"] == pytest.approx(2.0 * data["combined_deg"])
    blind = cli("accuracy", "stats", "paper_table2.csv", "--budget", "autocollimator")
    assert (blind.code, "--displacement 15" in blind.err) == (2, True)
    found = budget_text(table_budget(PAPER_TABLE, "t", sources_of("ring-encoder-2-heads")))
    assert max(len(line) for line in found.splitlines()) <= 100
