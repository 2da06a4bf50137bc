"""Two ways of control on one machine on a bus, by what its drive and an instrument at the load say."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.accuracy.procedure.on_batch import run_time_s
from gantryctl.engineering.accuracy.procedure.plan import chord_test
from gantryctl.engineering.accuracy.procedure.procedures import evaluate
from gantryctl.engineering.accuracy.statistics import statistics
from gantryctl.engineering.accuracy.uncertainty import COVERAGE_K, chord_uncertainty
from gantryctl.engineering.accuracy.verdict import AccuracyVerdict, ChordFigures, judge_chords
from gantryctl.engineering.analysis.measured.on_engine import experiment
from gantryctl.engineering.analysis.models.profiles import trapezoid_time_s
from gantryctl.engineering.comparison.key_figures import LONG_DEG, SHORT_DEG
from gantryctl.engineering.comparison.variants import check_same_plant
from gantryctl.engineering.identification.on_engine import EngineAxis
from gantryctl.engineering.identification.samples import MoveLog
from gantryctl.engineering.instruments import Instrument
from gantryctl.engineering.report.text import TextTable
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, Requirement, required_angle
from gantryctl.machine.places import fitted_stretch_deg
from gantryctl.operation.run import AxisRun

# Readings of the end of a dwell, s: two seconds of four of the first mode.
_DWELL_S: Final = 2.0
# Steps of the set-point below this are rest.
_REST_RAD_S: Final = 1e-9


class BusFigures(NamedTuple):
    """Figures of one way of control.

    Attributes:
        a_seen_deg, largest_chord_deg: A by eq. (6) and largest chord error, procedure A, as the instrument sees them.
        a_expanded_deg, largest_chord_expanded_deg: expanded uncertainties, k = 2, by what its readings state.
        load_error_short_deg_s, load_error_long_deg_s: largest difference of load speed and set-point, both as means
            between two readings, of the short and of the long move.
        time_short_s, time_long_s: of the set-point.
        torque_nm: largest of the motor at a scan.
    """

    a_seen_deg: float
    a_expanded_deg: float
    largest_chord_deg: float
    largest_chord_expanded_deg: float
    load_error_short_deg_s: float
    load_error_long_deg_s: float
    time_short_s: float
    time_long_s: float
    torque_nm: float

    @property
    def judged_by(self) -> ChordFigures:
        """What the chord test is judged by."""
        return ChordFigures(
            a_deg=self.a_seen_deg,
            largest_chord_deg=self.largest_chord_deg,
            a_expanded_deg=self.a_expanded_deg,
            largest_chord_expanded_deg=self.largest_chord_expanded_deg,
        )


class BusComparison(NamedTuple):
    """Names and figures of two machines, what measured the load, and what is required of both."""

    instrument: str
    required: Requirement
    rows: tuple[tuple[str, BusFigures], ...]

    @property
    def verdict(self) -> AccuracyVerdict:
        """The second machine as the instrument saw it, beside the requirement."""
        name, figures = self.rows[-1]
        return judge_chords(figures.judged_by, self.required, of=name)


def moves_text(machine: Machine) -> str:
    """What `compare_on_bus` does with each machine file, for the person who lets it move."""
    procedure = chord_test(machine, "A")
    stretches = [fitted_stretch_deg(machine, *stretch) for stretch in (SHORT_DEG, LONG_DEG)]
    low, high = (
        found(each[end] for each in (procedure.travel_deg, *stretches)) for end, found in ((0, min), (1, max))
    )
    speed, acc = machine.speed.setting_max_deg_s, machine.virtual_axis.acc_deg_s2
    # Each of them there and back.
    ways_s = sum(2.0 * trapezoid_time_s(end - begin, speed, acc) for begin, end in stretches)
    minutes = (run_time_s(machine, procedure) + ways_s) / 60.0
    return (
        f"moves from {machine.axis.dial.span(low, high)} deg and back for {minutes:.0f} minutes with each of the two "
        "machine files"
    )


def compare_on_bus(
    paper: Machine,
    improved: Machine,
    instrument_of: Callable[[AxisRun], Instrument],
    *,
    agree: Callable[[AxisRun], None] | None = None,
    progress: Callable[[str], None] | None = None,
) -> BusComparison:
    """Run both ways of control on the machine, one after the other: 20 minutes of axis time.

    The proofs of the second machine count for both: it is the one that will run.

    Raises:
        UsageError: the two are different machines. AlarmStop: the axis was stopped.
        ConfigError: a compensation needs a calibration that is missing or of another drive.
    """
    if not (paper.on_bus and improved.on_bus):
        raise UsageError(f"{paper.name} and {improved.name}: both or none with a drive on a bus")
    check_same_plant(paper, improved)
    rows, name = [], ""
    for machine in (paper, improved):
        with experiment(improved, controlled_as=machine, agree=agree, needs_torque=False) as run:
            axis = EngineAxis(machine, run, instrument_of(run), progress)
            name = axis.instrument
            rows.append((machine.name, _figures(machine, axis)))
    return BusComparison(name, required_angle(improved), tuple(rows))


def _figures(machine: Machine, axis: EngineAxis) -> BusFigures:
    fast = machine.speed.setting_max_deg_s
    procedure = chord_test(machine, "A")
    logs = [axis.go(stop.target_deg, fast) for stop in procedure.stops]
    read = np.array([_dwell(log) for log in logs])
    table = statistics(evaluate(procedure, read, machine.accuracy.chord_radius_m))
    # Readings of a dwell share what a set-up has wrong: their mean is no surer than one of them.
    known = chord_uncertainty(procedure, np.degrees(read), np.degrees([log.uncertainty_rad for log in logs]))
    quarter, half = (_move(machine, axis, stretch) for stretch in (SHORT_DEG, LONG_DEG))
    return BusFigures(
        a_seen_deg=table.a_deg,
        a_expanded_deg=COVERAGE_K * known.a_deg,
        largest_chord_deg=table.largest_deg,
        largest_chord_expanded_deg=COVERAGE_K * known.largest_chord_deg,
        load_error_short_deg_s=_load_error_deg_s(quarter),
        load_error_long_deg_s=_load_error_deg_s(half),
        time_short_s=_time_s(quarter),
        time_long_s=_time_s(half),
        torque_nm=max(float(np.max(np.abs(log.torque_nm))) for log in (quarter, half)),
    )


def _move(machine: Machine, axis: EngineAxis, stretch_deg: tuple[float, float]) -> MoveLog:
    start, end = fitted_stretch_deg(machine, *stretch_deg)
    axis.go(start, machine.speed.setting_max_deg_s)
    return axis.go(end, machine.speed.setting_max_deg_s)


def _dwell(log: MoveLog) -> float:
    """Mean of the readings at the end of a dwell, rad."""
    end = log.load_rad[-round(_DWELL_S / log.period_s) :]
    return float(np.mean(end[np.isfinite(end)]))


def _load_error_deg_s(log: MoveLog) -> float:
    """Way of the load between two readings minus that of the set-point, over the time between them."""
    at = np.flatnonzero(np.isfinite(log.load_rad))
    vel = log.vel_rad_s
    # By trapezoids: exact while the acceleration holds, where a sum of one end is half a scan of it off.
    asked = np.concatenate([[0.0], np.cumsum(0.5 * (vel[1:] + vel[:-1]))]) * log.period_s
    off = np.diff(log.load_rad[at]) - np.diff(asked[at])
    return math.degrees(float(np.max(np.abs(off / (np.diff(at) * log.period_s)))))


def _time_s(log: MoveLog) -> float:
    moving = np.flatnonzero(np.abs(log.vel_rad_s) > _REST_RAD_S)
    return float(moving[-1] - moving[0] + 1) * log.period_s


def bus_table(found: BusComparison) -> TextTable:
    """Both rows side by side."""
    heads = (
        "", "A seen\nproc. A", "load, short\ndeg/s", "load, long\ndeg/s", "short\ns", "long\ns", "torque\nN m",
    )  # fmt: skip
    rows = tuple(
        (
            name,
            f"{f.a_seen_deg:.4f}",
            f"{f.load_error_short_deg_s:.4f}",
            f"{f.load_error_long_deg_s:.4f}",
            f"{f.time_short_s:.2f}",
            f"{f.time_long_s:.2f}",
            f"{f.torque_nm:.1f}",
        )
        for name, f in found.rows
    )
    return TextTable(f"On the bus, the load watched by {found.instrument}", heads, rows)
