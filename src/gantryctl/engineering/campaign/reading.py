"""A campaign file to a `Campaign`, or the list of all its problems."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from gantryctl.engineering.accuracy.procedure.plan import chord_test, speeds_to_test
from gantryctl.engineering.campaign.distributions import range_of
from gantryctl.engineering.campaign.measures import TESTS
from gantryctl.engineering.campaign.population import PHASES_KEY, SCALE_KEY, Campaign, Control, Factor
from gantryctl.engineering.campaign.sampling import HYPERCUBE_MAX, SOBOL_MAX
from gantryctl.engineering.campaign.tables import (
    LAWS,
    CampaignFile,
    DiscreteTable,
    GearGradeTable,
    LognormalTable,
    NormalTable,
    PhasesTable,
    UniformTable,
)
from gantryctl.engineering.comparison.variants import check_same_plant, variants
from gantryctl.errors import ConfigError, UsageError
from gantryctl.machine import (
    Machine,
    Requirement,
    configs_folder,
    field_specs,
    load_machine,
    required_angle,
    required_speed_error,
    required_stopping_angle,
    show_value,
    with_values,
)
from gantryctl.machine.loading import check_table
from gantryctl.machine.places import reach_deg
from gantryctl.machine.problems import unknown_path
from gantryctl.machine.reading import Data, parse_toml, printable, read_text
from gantryctl.machine.specs import value_at
from gantryctl.units import DEG_S_PER_R_MIN

_NO_SUCH: Final = "; a shipped campaign goes by its name: "
_REQUIRED: Final = {
    "a_true_deg": required_angle,
    "a_measured_deg": required_angle,
    "angle_error_deg": required_angle,
    "speed_error_motor_deg_s": required_speed_error,
    "quick_stop_angle_deg": required_stopping_angle,
}
_MAPS: Final = ("vary", "drift", "set", "limits")


def campaigns_folder() -> Path:
    """Folder of the campaign files that are shipped."""
    return configs_folder() / "campaigns"


def shipped_campaigns() -> tuple[str, ...]:
    """Names of the campaign files that are shipped."""
    return tuple(sorted(path.stem for path in campaigns_folder().glob("*.toml")))


def load_campaign(path: Path | str) -> Campaign:
    """Read and check a campaign file, or a shipped one by its name.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    path = Path(path)
    if not path.exists() and path.name in shipped_campaigns():
        path = campaigns_folder() / f"{path.name}.toml"
    text = read_text(path, _NO_SUCH + ", ".join(shipped_campaigns()))
    return parse_campaign(text, str(path), path.parent)


def parse_campaign(text: str, name: str, folder: Path) -> Campaign:
    """Check the text of a campaign file.

    Args:
        name: stands in front of every problem.
        folder: where the machine files that it names are looked for first.

    Raises:
        ConfigError: one line per problem, all of them.
    """
    data = parse_toml(text, name)
    maps: dict[str, Any] = {part: data.pop(part, {}) for part in _MAPS}
    settings = check_table(CampaignFile, data, name)
    reader = _Reader(printable(name, 300), folder, settings)
    campaign = reader.campaign(text, maps)
    if reader.problems:
        raise ConfigError(reader.problems)
    return campaign


@dataclass
class _Reader:
    """Collects the problems of one file."""

    name: str
    folder: Path
    settings: CampaignFile

    def __post_init__(self) -> None:
        self.problems: list[str] = []

    def campaign(self, text: str, maps: Mapping[str, Any]) -> Campaign:
        changes = self._table("set", maps["set"])
        machine = self._machine("campaign", self.settings.campaign.machine, changes)
        factors = self._factors("vary", maps["vary"], machine)
        drift = self._factors("drift", maps["drift"], machine)
        controls = self._controls(machine, changes)
        made = Campaign(self.settings, text, controls, factors, drift, {}, {})
        self._check_tests(machine)
        named = self._limits(maps["limits"], made)
        required = {} if self.problems else _required(machine, made)
        missing = {name: limit for name, limit in required.items() if name not in named}
        made = replace(
            made,
            limits={**named, **{name: (limit.limit,) for name, limit in missing.items()}},
            required={name: limit.origin for name, limit in missing.items()},
        )
        self._check_size(made)
        if not factors:
            self._say(
                "[vary]: nothing varies; give at least one table [vary.NAME] with law, keys and numbers"
            )
        needing = any(each.machine.control.compensation.needs_calibration for each in controls)
        if drift and not needing:
            self._say(
                "[drift]: changes plants after their identification, and nothing here is identified; give "
                "[improved], or vary these keys in [vary]"
            )
        return made

    def _say(self, line: str) -> None:
        self.problems.append(f"{self.name}: {line}")

    def _table(self, name: str, value: Any) -> Data:
        if isinstance(value, dict):
            return value
        self._say(f"{name} = {show_value(value)}: must be a table")
        return {}

    def _machine(self, table: str, file: str, changes: Data) -> Machine:
        beside = self.folder / file
        path = beside if beside.exists() else configs_folder() / file
        if not path.exists():
            raise ConfigError(
                [
                    f"{self.name}: [{table}] machine = {show_value(file)}: no such file, neither beside the campaign "
                    "file nor among the shipped ones"
                ]
            )
        machine = load_machine(path)
        if machine.drive.kind != "sim":
            raise ConfigError(
                [
                    f'{self.name}: [{table}] machine = {show_value(file)}: has [drive] kind = "{machine.drive.kind}"; '
                    'plants of a campaign are simulated: use "sim"'
                ]
            )
        try:
            return with_values(machine, changes) if changes else machine
        except ConfigError as wrong:
            raise ConfigError([f"{self.name}: [set]: {line}" for line in wrong.problems]) from None

    def _factors(self, part: str, value: Any, machine: Machine) -> tuple[Factor, ...]:
        found: list[Factor] = []
        for name, data in self._table(part, value).items():
            place = f"[{part}.{printable(name)}]"
            if not isinstance(data, dict):
                self._say(f"[{part}] {printable(name)} = {show_value(data)}: must be a table {place}")
                continue
            law = data.get("law")
            if not isinstance(law, str) or law not in LAWS:
                self._say(f"{place} law = {show_value(law)}: allowed {', '.join(LAWS)}")
                continue
            try:
                read = check_table(LAWS[law], data, f"{self.name}: {place}")
            except ConfigError as wrong:
                self.problems += wrong.problems
                continue
            factor = _factor(name, read)
            before = len(self.problems)
            self._check_law(place, factor)
            if len(self.problems) > before:
                continue
            for key in factor.keys:
                self._check_key(place, factor, key, machine)
                if any(key in other.keys for other in found):
                    self._say(f"{place} keys: {key} varies in another table of [{part}] already")
                if part == "drift" and not key.startswith("plant."):
                    self._say(f"{place} keys: {key} is no property of the plant; only keys of [plant] drift")
            if len(self.problems) == before:
                found.append(factor)
        return tuple(found)

    def _check_law(self, place: str, factor: Factor) -> None:
        law = factor.law
        if isinstance(law, UniformTable) and not law.low < law.high:
            self._say(f"{place} low = {law.low:g}: must be below high = {law.high:g}")
        if isinstance(law, DiscreteTable | GearGradeTable):
            values = law.grades if isinstance(law, GearGradeTable) else law.values
            if law.weights and len(law.weights) != len(values):
                self._say(
                    f"{place} weights: has {len(law.weights)} numbers, must have {len(values)}, one a value"
                )
            elif law.weights and not sum(law.weights) > 0.0:
                self._say(f"{place} weights: all are 0; at least one must be above 0")

    def _check_key(self, place: str, factor: Factor, key: str, machine: Machine) -> None:
        spec = field_specs().get(key)
        if spec is None:
            self._say(f"{place} keys: {unknown_path(key)}")
            return
        if isinstance(factor.law, PhasesTable):
            return
        if spec.kind not in ("number", "integer"):
            self._say(f"{place} keys: {key} is no number but takes {spec.allowed}; put its value into [set]")
            return
        own = value_at(machine, key)
        assert isinstance(own, int | float)
        if factor.relative and own == 0:
            self._say(f"{place} relative = true: {key} is 0 in {machine.name}, and so is every part of it")
            return
        ends = sorted(end * own if factor.relative else end for end in range_of(factor.law))
        # Laws without an end pass every limit somewhere: how often is counted, not forbidden.
        for end in (end for end in ends if math.isfinite(end)):
            if not spec.low <= end <= spec.high and not isinstance(factor.law, LognormalTable):
                self._say(f"{place}: gives {spec.place} = {end:.6g}{spec.unit_text}, allowed {spec.allowed}")
        if spec.kind == "integer" and not isinstance(factor.law, DiscreteTable):
            self._say(f'{place} keys: {key} takes whole numbers; use law = "discrete"')

    def _controls(self, machine: Machine, changes: Data) -> tuple[Control, ...]:
        table = self.settings.improved
        if not table.machine:
            return (Control("", machine),)
        improved = self._machine("improved", table.machine, changes)
        try:
            check_same_plant(machine, improved)
        except UsageError as wrong:
            self._say(f"[improved] machine = {show_value(table.machine)}: {wrong}")
            return (Control("", machine),)
        rows = variants(machine, improved)
        named = {_slug(row.name): row.machine for row in rows}
        chosen = table.variants or (_slug(rows[0].name), _slug(rows[-1].name))
        for name in (name for name in chosen if name not in named):
            near = difflib.get_close_matches(name, named, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            self._say(f"[improved] variants: {show_value(name)} is not one of {', '.join(named)}{hint}")
        return tuple(Control(name, named[name]) for name in chosen if name in named)

    def _check_tests(self, machine: Machine) -> None:
        order = self.settings.campaign
        for test in (test for test in order.tests if test not in TESTS):
            self._say(f"[campaign] tests: {show_value(test)} is not one of {', '.join(TESTS)}")
        known = [name for test in order.tests if test in TESTS for name in TESTS[test].outputs]
        for name in (name for name in order.outputs if name not in known):
            near = difflib.get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            self._say(f"[campaign] outputs: {show_value(name)} is not one of {', '.join(known)}{hint}")
        if "chord_test" in order.tests:
            try:
                chord_test(machine, self.settings.chord_test.procedure)
            except UsageError as wrong:
                self._say(f"[chord_test]: {wrong}")
        if "speed_test" in order.tests:
            try:
                speeds_to_test(machine, [r * DEG_S_PER_R_MIN for r in self.settings.speed_test.speeds_r_min])
            except UsageError as wrong:
                self._say(f"[speed_test]: {wrong}")
        low, high = reach_deg(machine)
        for key, angle in (("from_deg", self.settings.move.from_deg), ("to_deg", self.settings.move.to_deg)):
            if "move" in order.tests and not low <= angle <= high:
                self._say(
                    f"[move] {key} = {angle:g}: the travel goes from {machine.axis.dial.span(low, high)} deg"
                )

    def _limits(self, value: Any, made: Campaign) -> dict[str, tuple[float, ...]]:
        found = {}
        figures = made.figures if not self.problems else {}
        for name, limits in self._table("limits", value).items():
            if figures and name not in figures:
                near = difflib.get_close_matches(name, figures, 1)
                hint = f"; did you mean {near[0]}?" if near else ""
                self._say(f"[limits] {printable(name)}: is not one of {', '.join(figures)}{hint}")
                continue
            right = isinstance(limits, list) and limits and all(_is_limit(limit) for limit in limits)
            if not right:
                self._say(
                    f"[limits] {printable(name)} = {show_value(limits)}: must be an array of numbers above 0"
                )
                continue
            found[name] = tuple(map(float, limits))
        return found

    def _check_size(self, made: Campaign) -> None:
        order, design = self.settings.campaign, made.design
        count = order.count
        if order.sampling == "sensitivity" and count & (count - 1):
            below = 2 ** (count.bit_length() - 1)
            self._say(f"[campaign] count = {count}: must be a power of 2: {below} or {2 * below}")
        if order.sampling in ("sobol", "sensitivity") and count > SOBOL_MAX:
            self._say(f"[campaign] count = {count}: with sampling = {order.sampling} at most {SOBOL_MAX}")
        if order.sampling == "latin_hypercube" and count * design.dimensions > HYPERCUBE_MAX:
            most = HYPERCUBE_MAX // design.dimensions
            self._say(
                f"[campaign] count = {count}: a Latin hypercube of {design.dimensions} coordinates has at most {most} "
                'plants; sampling = "sobol" or "monte_carlo" has room for more'
            )


def _factor(name: str, law: Any) -> Factor:
    if isinstance(law, PhasesTable):
        return Factor(name, (PHASES_KEY,), law)
    if isinstance(law, GearGradeTable):
        return Factor(name, (SCALE_KEY,), law)
    assert isinstance(law, UniformTable | NormalTable | LognormalTable | DiscreteTable)
    return Factor(name, law.keys, law, law.relative)


def _required(machine: Machine, made: Campaign) -> dict[str, Requirement]:
    """What the machine requires of the figures of a campaign."""
    return {name: _REQUIRED[name](machine) for name in made.figures if name in _REQUIRED}


def _slug(name: str) -> str:
    """Name of a row of the comparison as it stands in a file: "gear map alone" is gear_map_alone."""
    return "_".join("".join(c if c.isalnum() else " " for c in name).split())


def _is_limit(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < math.inf
