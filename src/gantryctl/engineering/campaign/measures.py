"""What is measured on a plant: each test takes machines and gives a few figures of each."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Final, NamedTuple, TypeAlias, TypeVar

import numpy as np

from gantryctl.engineering.accuracy.noise import a_draws
from gantryctl.engineering.accuracy.procedure.on_batch import run_procedure
from gantryctl.engineering.accuracy.procedure.plan import ChordPlan, chord_plan
from gantryctl.engineering.accuracy.procedure.procedures import Procedure, evaluate
from gantryctl.engineering.accuracy.report.report import SpeedRun
from gantryctl.engineering.accuracy.speed_test import speed_tests
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.engineering.campaign.tables import CampaignFile
from gantryctl.engineering.comparison.key_figures import Move, MoveFigures, moves_figures
from gantryctl.engineering.stops.limits import hardest_quick_stops
from gantryctl.engineering.stops.run import StopResult
from gantryctl.errors import GantryctlError
from gantryctl.machine import Machine
from gantryctl.machine.rules.reaction import REACTION_S
from gantryctl.units import DEG_S_PER_R_MIN

Figures: TypeAlias = "dict[str, float]"
T = TypeVar("T")


class Output(NamedTuple):
    """A figure of one plant.

    Attributes:
        digits: after the point, for people.
    """

    unit: str
    meaning: str
    digits: int = 4


class Subject(NamedTuple):
    """A plant under test.

    Attributes:
        row: number of its row: seed of the instrument's noise.
    """

    row: int
    machine: Machine


class PlantTest(NamedTuple):
    """A test that a campaign can order.

    Attributes:
        measure: figures of every subject, None for one that cannot be computed; at least those that are wanted.
    """

    outputs: dict[str, Output]
    measure: Callable[[Sequence[Subject], CampaignFile, Collection[str]], list[Figures | None]]


def _chord_test(
    subjects: Sequence[Subject], settings: CampaignFile, wanted: Collection[str]
) -> list[Figures | None]:
    # One plan for all, but where the travel itself varies.
    by_plan: dict[ChordPlan, list[int]] = {}
    for place, subject in enumerate(subjects):
        by_plan.setdefault(chord_plan(subject.machine), []).append(place)
    found: list[Figures | None] = [None] * len(subjects)
    for plan, places in by_plan.items():
        procedure = plan.procedure(settings.chord_test.procedure, settings.chord_test.runs)
        figures = _chord_figures([subjects[place] for place in places], procedure, wanted)
        for place, own in zip(places, figures, strict=True):
            found[place] = own
    return found


def _chord_figures(
    subjects: Sequence[Subject], procedure: Procedure, wanted: Collection[str]
) -> list[Figures | None]:
    readings = run_procedure([subject.machine for subject in subjects], procedure, threads=1)
    found: list[Figures | None] = []
    for k, (row, machine) in enumerate(subjects):
        angles, radius_m = readings.load_rad[k], machine.accuracy.chord_radius_m
        if not np.all(np.isfinite(angles)):
            found.append(None)
            continue
        figures = {
            "angle_error_deg": float(np.max(np.abs(np.degrees(angles - procedure.targets_rad)))),
            "a_true_deg": float(accuracy_a(evaluate(procedure, angles, radius_m).errors_deg)),
            "chord_speed_error_load_deg_s": float(np.degrees(np.max(readings.vel_err_load_rad_s[k]))),
        }
        if "a_measured_deg" in wanted:
            sigma_m = machine.accuracy.tracker_noise_um * 1e-6
            figures["a_measured_deg"] = float(
                np.median(a_draws(procedure, angles, radius_m, sigma_m, seed=row))
            )
        found.append(figures)
    return found


def _speed_test(
    subjects: Sequence[Subject], settings: CampaignFile, wanted: Collection[str]
) -> list[Figures | None]:
    speeds = [speed * DEG_S_PER_R_MIN for speed in settings.speed_test.speeds_r_min]

    def figures(runs: list[SpeedRun]) -> Figures:
        return {
            "speed_error_load_deg_s": max(run.load_error_deg_s or 0.0 for run in runs),
            "speed_error_motor_deg_s": max(run.motor_error_deg_s for run in runs),
            "stick_slip": float(any(run.stick_slip for run in runs)),
        }

    found = speed_tests([subject.machine for subject in subjects], speeds)
    return [_if_computed(each, figures) for each in found]


def _move(
    subjects: Sequence[Subject], settings: CampaignFile, wanted: Collection[str]
) -> list[Figures | None]:
    def figures(move: MoveFigures) -> Figures:
        return {f"move_{name}": value for name, value in move._asdict().items()}

    ends = settings.move.from_deg, settings.move.to_deg
    found = moves_figures([Move(subject.machine, *ends) for subject in subjects])
    return [_if_computed(each, figures) for each in found]


def _stops(
    subjects: Sequence[Subject], settings: CampaignFile, wanted: Collection[str]
) -> list[Figures | None]:
    def figures(stop: StopResult) -> Figures:
        return {
            # The speed is the highest setting of the machine.
            "quick_stop_angle_deg": stop.angle_deg + stop.speed_deg_s * REACTION_S,
            "quick_stop_load_angle_deg": stop.load_angle_deg,
            "quick_stop_reducer_nm": stop.torque_reducer_nm,
            "quick_stop_torque_limited": float(stop.torque_limited),
        }

    found = hardest_quick_stops([subject.machine for subject in subjects])
    return [_if_computed(each, figures) for each in found]


# Of a plant that swings up, a speed that is not reached.
NOT_COMPUTABLE: Final = (GantryctlError, ValueError, ArithmeticError)


def _if_computed(outcome: T | Exception, figures: Callable[[T], Figures]) -> Figures | None:
    """Figures of what a test has found; None where it cannot be computed."""
    if isinstance(outcome, NOT_COMPUTABLE):
        return None
    if isinstance(outcome, Exception):
        raise outcome
    return figures(outcome)


TESTS: Final = {
    "chord_test": PlantTest(
        {
            "a_true_deg": Output("deg", "A, true angles"),
            "a_measured_deg": Output("deg", "A as the tracker sees it, median of its noise"),
            "angle_error_deg": Output("deg", "largest angle error at a stop"),
            "chord_speed_error_load_deg_s": Output("deg/s", "speed error of the load in the chord test"),
        },
        _chord_test,
    ),
    "speed_test": PlantTest(
        {
            "speed_error_load_deg_s": Output("deg/s", "largest speed error of the load"),
            "speed_error_motor_deg_s": Output("deg/s", "largest speed error of the motor"),
            "stick_slip": Output("-", "1: the load sticks and slips", 0),
        },
        _speed_test,
    ),
    "move": PlantTest(
        {
            "move_time_s": Output("s", "time of the profile", 2),
            "move_load_error_deg_s": Output("deg/s", "speed error of the load in a move"),
            "move_motor_error_deg_s": Output("deg/s", "speed error of the motor in a move"),
            "move_base_um": Output("um", "base motion of a move, peak to peak", 1),
            "move_residual_um": Output("um", "base motion after a move", 2),
            "move_settling_s": Output(
                "s", "time until the load settles to 0.001 deg, by the envelope of its swing", 2
            ),
            "move_reducer_knm": Output("kN m", "torque at the reducer in a move", 2),
            "move_motor_nm": Output("N m", "torque of the motor in a move", 1),
        },
        _move,
    ),
    "stops": PlantTest(
        {
            "quick_stop_angle_deg": Output("deg", "quick stop from the highest speed, reaction included", 3),
            "quick_stop_load_angle_deg": Output("deg", "the same at the load, without reaction", 3),
            "quick_stop_reducer_nm": Output("N m", "torque at the reducer in a quick stop", 0),
            "quick_stop_torque_limited": Output("-", "1: the motor cannot give the deceleration", 0),
        },
        _stops,
    ),
}
