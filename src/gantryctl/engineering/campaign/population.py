"""A campaign, and the plant of each of its rows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from gantryctl.engineering.campaign.distributions import Law, quantile
from gantryctl.engineering.campaign.measures import TESTS, Output
from gantryctl.engineering.campaign.sampling import Design, unit_points
from gantryctl.engineering.campaign.tables import CampaignFile, PhasesTable
from gantryctl.machine import Machine, calibration_toml, config_hash, field_specs
from gantryctl.machine.specs import Value, value_at

Floats = NDArray[np.float64]
Values: TypeAlias = "dict[str, Value]"

PHASES_KEY: Final = "plant.gear_error.phases_rad"
SCALE_KEY: Final = "plant.gear_error.scale"


@dataclass(frozen=True)
class Factor:
    """Keys of the machine that vary together.

    Attributes:
        name: of its table, [vary.NAME] or [drift.NAME].
        relative: the numbers of the law are factors of each key's own value.
    """

    name: str
    keys: tuple[str, ...]
    law: Law | PhasesTable
    relative: bool = False

    @property
    def width(self) -> int:
        """Coordinates of the design that it takes."""
        return field_specs()[PHASES_KEY].lengths[1] if isinstance(self.law, PhasesTable) else 1

    def draw(self, points: Floats) -> list[float | tuple[float, ...]]:
        """What the law gives at points of shape (rows, width)."""
        if isinstance(self.law, PhasesTable):
            return [tuple(row) for row in (2.0 * np.pi * points).tolist()]
        return [float(value) for value in quantile(self.law, points[:, 0]).tolist()]

    def set(self, drawn: float | tuple[float, ...], values: Values) -> None:
        """Put what was drawn for one plant into its values, which hold the present ones."""
        for key in self.keys:
            if isinstance(drawn, tuple):
                values[key] = drawn
                continue
            present = values[key]
            assert isinstance(present, int | float)
            value = drawn * present if self.relative else drawn
            whole = field_specs()[key].kind == "integer" and value.is_integer()
            values[key] = int(value) if whole else value


class Control(NamedTuple):
    """A way of control that every plant gets.

    Attributes:
        name: part of the name of its figures; "" for the machine of the campaign.
        machine: with the base plant.
    """

    name: str
    machine: Machine


class Plant(NamedTuple):
    """Plant of one row.

    Attributes:
        values: of the keys that vary. drifted: the same after the drift.
    """

    row: int
    values: Values
    drifted: Values


@dataclass(frozen=True)
class Campaign:
    """A campaign file with everything that it names.

    Attributes:
        settings: its tables. text: of the file.
        controls: ways of control, the machine of the campaign first.
        factors, drift: what varies from plant to plant, and what changes after identification.
        limits: limits of figures, by figure.
        required: who requires a limit that the campaign file does not name, by figure.
    """

    settings: CampaignFile
    text: str
    controls: tuple[Control, ...]
    factors: tuple[Factor, ...]
    drift: tuple[Factor, ...]
    limits: Mapping[str, tuple[float, ...]]
    required: Mapping[str, str]

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.settings.campaign.name

    @property
    def design(self) -> Design:
        """How the plants are drawn."""
        order = self.settings.campaign
        widths = tuple(factor.width for factor in (*self.factors, *self.drift))
        return Design(order.sampling, order.count, order.seed, widths)

    @property
    def figures(self) -> dict[str, Output]:
        """Figures that are kept of every plant and control."""
        order = self.settings.campaign
        found = {name: output for test in order.tests for name, output in TESTS[test].outputs.items()}
        return {name: output for name, output in found.items() if not order.outputs or name in order.outputs}

    @property
    def columns(self) -> dict[str, Output]:
        """Figures by the name of their column, "CONTROL.FIGURE" where there is more than one control."""
        return {
            column_name(control.name, name): output
            for control in self.controls
            for name, output in self.figures.items()
        }

    @property
    def varied_keys(self) -> tuple[str, ...]:
        """Keys that vary or drift."""
        return tuple(dict.fromkeys(key for factor in (*self.factors, *self.drift) for key in factor.keys))

    @property
    def hash(self) -> str:
        """SHA-256 of all that decides a row; not of the number of rows where a row does not depend on it."""
        order = self.settings.campaign
        tables = self.settings.model_dump(mode="json", exclude={"campaign"})
        content = {
            "controls": [(each.name, _machine_hash(each.machine)) for each in self.controls],
            "factors": [_plain(factor) for factor in self.factors],
            "drift": [_plain(factor) for factor in self.drift],
            "settings": {test: tables.get(test) for test in order.tests},
            "figures": list(self.figures),
            "sampling": [
                order.sampling,
                order.seed,
                order.count if order.sampling == "latin_hypercube" else None,
            ],
        }
        text = json.dumps(content, sort_keys=True, allow_nan=False)
        return hashlib.sha256(text.encode("ascii")).hexdigest()

    def plants(self, first: int, count: int) -> Iterator[Plant]:
        """Plants of rows `first` to `first + count - 1`; their values are not checked."""
        design = self.design
        points = unit_points(design, first, count)
        ends = np.cumsum((0, *design.widths))
        drawn = [
            factor.draw(points[:, low:high])
            for factor, low, high in zip((*self.factors, *self.drift), ends[:-1], ends[1:], strict=True)
        ]
        base = {key: value_at(self.controls[0].machine, key) for key in self.varied_keys}
        for k in range(count):
            values = dict(base)
            _set_all(self.factors, [column[k] for column in drawn[: len(self.factors)]], values)
            drifted = dict(values)
            _set_all(self.drift, [column[k] for column in drawn[len(self.factors) :]], drifted)
            yield Plant(first + k, values, drifted)


def column_name(control: str, figure: str) -> str:
    """Name of the column of a figure."""
    return f"{control}.{figure}" if control else figure


def _set_all(factors: Sequence[Factor], drawn: Sequence[float | tuple[float, ...]], values: Values) -> None:
    for factor, value in zip(factors, drawn, strict=True):
        factor.set(value, values)


def _machine_hash(machine: Machine) -> list[str]:
    calibration = machine.calibration
    return [config_hash(machine), "" if calibration is None else calibration_toml(calibration)]


def _plain(factor: Factor) -> dict[str, Any]:
    law = factor.law.model_dump(mode="json", exclude={"keys", "relative"})
    return {"name": factor.name, "keys": factor.keys, "relative": factor.relative, "law": law}
