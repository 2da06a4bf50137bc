"""Rows of a campaign, as a job of the scheduler."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.campaign.measures import NOT_COMPUTABLE, TESTS, Figures, Subject
from gantryctl.engineering.campaign.population import Campaign, Control, Plant, column_name
from gantryctl.engineering.identification import calibrate_each
from gantryctl.engineering.scheduler.job import Rows
from gantryctl.machine import Calibration, Machine
from gantryctl.machine.variation import RefusedValue, Variation

INDEX: Final = "row"
REFUSED: Final = "refused_by"
IDENTIFICATION: Final = "identification"
DRIFT: Final = "drift"
# Two packs of the widest instruction set; only plants under the same control share one.
_LANES: Final = 16


@dataclass(frozen=True)
class CampaignJob:
    """Figures of the plants of a campaign.

    A plant that the checks of the machine refuse, or a test that cannot be computed, has a row too: its column
    "refused_by" names why, and its figures are NaN.
    """

    campaign: Campaign

    @property
    def pack(self) -> int:
        """Plants that fill the packs of the compiled core."""
        return _LANES

    def rows(self, first: int, count: int) -> Rows:
        """Columns "row", "refused_by", a number per key that varies, and the figures."""
        plants = list(self.campaign.plants(first, count))
        runs = [_Run(plant) for plant in plants]
        self._identify(runs)
        self._measure(runs)
        found: Rows = {
            INDEX: np.arange(first, first + count),
            REFUSED: np.array([run.refused_by for run in runs], dtype=object),
        }
        for key in self.campaign.varied_keys:
            # Arrays, such as phases, follow from the campaign and the number of the row.
            if not isinstance(plants[0].values[key], tuple):
                found[key] = np.array([plant.drifted[key] for plant in plants], dtype=np.float64)
        nothing = dict.fromkeys(self.campaign.columns, np.nan)
        table = [nothing if run.refused_by else run.figures for run in runs]
        return found | {name: np.array([row[name] for row in table]) for name in nothing}

    def _identify(self, runs: Sequence[_Run]) -> None:
        """Refuse plants, and identify those whose control lives on measured values."""
        calibrated = [each for each in self.campaign.controls if _needs_calibration(each.machine)]
        if not calibrated:
            return
        variation = Variation(calibrated[-1].machine, self.campaign.varied_keys)
        known: list[tuple[_Run, Machine]] = []
        for run in runs:
            machine = variation.of(run.plant.values)
            if isinstance(machine, RefusedValue):
                run.refused_by = str(machine)
            else:
                known.append((run, machine))
        # Compensations know only what was measured on this plant, before it drifts (decision 0010).
        found = calibrate_each([machine for _, machine in known], [run.plant.row for run, _ in known])
        for (run, _), calibration in zip(known, found, strict=True):
            if isinstance(calibration, (*NOT_COMPUTABLE, np.linalg.LinAlgError)):
                run.refused_by = IDENTIFICATION
            elif isinstance(calibration, Exception):
                raise calibration
            else:
                run.calibration = calibration

    def _measure(self, runs: Sequence[_Run]) -> None:
        """All plants under all controls at once: they go through the compiled core side by side."""
        made = [
            _Measured(run, control.name, Subject(run.plant.row, machine))
            for control in self.campaign.controls
            for run, machine in self._drifted(control, runs)
        ]
        made = [each for each in made if not each.run.refused_by]
        settings, wanted = self.campaign.settings, self.campaign.figures
        for name in settings.campaign.tests:
            test = TESTS[name]
            if made and not set(wanted).isdisjoint(test.outputs):
                figures = test.measure([each.subject for each in made], settings, wanted)
                for each, found in zip(made, figures, strict=True):
                    each.run.keep(name, each.control, found)

    def _drifted(self, control: Control, runs: Sequence[_Run]) -> Iterator[tuple[_Run, Machine]]:
        """Machines of the plants as they are after the drift, under one control; refuses plants."""
        variation = Variation(control.machine, self.campaign.varied_keys)
        for run in runs:
            if run.refused_by:
                continue
            machine = variation.of(run.plant.drifted)
            if isinstance(machine, RefusedValue):
                before = variation.of(run.plant.values)
                drifts = not isinstance(before, RefusedValue)
                run.refused_by = f"{DRIFT}: {machine}" if drifts else str(before)
                continue
            calibrated = _needs_calibration(control.machine)
            yield run, machine.calibrated(run.calibration) if calibrated else machine


class _Run:
    """One plant on its way through the tests."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.refused_by = ""
        self.calibration: Calibration | None = None
        self.figures: Figures = {}

    def keep(self, test: str, control: str, found: Figures | None) -> None:
        """Keep what a test has found; a figure that is not finite is left out."""
        if found is None or not np.all(np.isfinite(list(found.values()))):
            self.refused_by = self.refused_by or test
        else:
            self.figures |= {column_name(control, name): value for name, value in found.items()}


class _Measured(NamedTuple):
    """A plant under one control."""

    run: _Run
    control: str
    subject: Subject


def _needs_calibration(machine: Machine) -> bool:
    return machine.control.compensation.needs_calibration
