"""A over random gears: a job like any other, whose rows are those of each gear alone."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from gantryctl.engineering import identification
from gantryctl.engineering.accuracy.job import AccuracyJob, GearJob, ensemble_a
from gantryctl.engineering.accuracy.procedure.on_batch import random_gear, run_procedure
from gantryctl.engineering.accuracy.procedure.plan import chord_test
from gantryctl.engineering.accuracy.procedure.procedures import evaluate
from gantryctl.engineering.accuracy.statistics import accuracy_a
from gantryctl.machine import Calibration, Machine, default_machine, with_values
from support.improved import improved_machine

# A chord test of 40 s instead of 537 s: harder ramps, shorter rests.
MACHINE = with_values(
    default_machine(),
    {
        "accuracy.dwell_s": 0.5,
        "accuracy.average_s": 0.2,
        "virtual_axis.acc_deg_s2": 2.0,
        "virtual_axis.dec_deg_s2": 2.0,
    },
)


def test_gears_in_a_batch_have_the_accuracy_of_each_alone() -> None:
    procedure = chord_test(MACHINE, "A")
    gears = ensemble_a(MACHINE, AccuracyJob(procedure, seed=7, ensemble=3, threads=2))
    assert gears.seeds == (8, 9, 10)
    for seed, found in zip(gears.seeds, gears.a_deg, strict=True):
        angles = run_procedure([random_gear(MACHINE, seed)], procedure, threads=1).load_rad[0]
        assert found == float(
            accuracy_a(evaluate(procedure, angles, MACHINE.accuracy.chord_radius_m).errors_deg)
        )
    assert len(set(gears.a_deg)) == 3
    # In whatever chunk.
    later = GearJob(MACHINE, procedure, 7).rows(1, 2)["a_true_deg"]
    assert tuple(later) == gears.a_deg[1:]


def test_each_gear_has_the_calibration_that_was_found_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A map of another gear would compensate errors that are not there: here a calibration is numbered by its gear."""

    def calibrated(machines: Sequence[Machine], seeds: Sequence[int]) -> list[Calibration]:
        found = improved_machine().calibration
        assert found is not None
        assert [gear == random_gear(machine, seed) for gear, seed in zip(machines, seeds, strict=True)] == [
            True
        ] * 3
        return [
            found.model_copy(update={"origin": found.origin.model_copy(update={"version": seed})})
            for seed in seeds
        ]

    machine = improved_machine()
    monkeypatch.setattr(identification, "calibrate_each", calibrated)
    gears = GearJob(machine, chord_test(machine, "A"), 7)._gears(2, 3)
    assert [gear.calibration.origin.version for gear in gears if gear.calibration] == [10, 11, 12]
