"""Seeds that once broke something hold today; those of a fault that is known and open still break."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

from gantryctl.engineering.fault_campaign.axis_pairs import axis_pair_scenario
from gantryctl.engineering.fault_campaign.draw import (
    axis_scenario,
    pair_scenario,
    random_scenario,
    wide_scenario,
)
from gantryctl.engineering.fault_campaign.play import play
from support.fault_liars import LIARS, SCAN_MS, found_by

pytestmark = pytest.mark.can
SEEDS: dict[str, list[dict[str, Any]]] = tomllib.loads(
    (Path(__file__).parents[1] / "data" / "fault_seeds.toml").read_text()
)
KINDS = {
    "random": random_scenario,
    "pairs": pair_scenario,
    "wide": wide_scenario,
    "axes": axis_scenario,
    "axis-pairs": axis_pair_scenario,
}
FOUND = {
    "an encoder alarm that only warns": 137,
    "a limit switch that only warns": 70,
    "a room door that only warns": 161,
    "a lease that never runs out": 22,
    "torque taken off before the brake has closed": 2,
    "an angle that is called valid whatever the reading says": 22,
    "a brake that slips without torque coming back": 344,
}
"""First seed on the simulated drive that finds each planted bug (`python -m support.fault_liars`)."""


# The bus takes more than a second each, and so does a draft: of those the ones that the program broke are in the fast
# suite.
@pytest.mark.parametrize(
    "row",
    [
        pytest.param(
            row,
            id=str(row["number"]),
            marks=[pytest.mark.slow] if row["drive"] == "bus" or row.get("slow") else [],
        )
        for row in SEEDS["seed"]
    ],
)
def test_a_seed_that_once_broke_holds(row: dict[str, Any]) -> None:
    kind, scan_ms = row.get("kind", "random"), row.get("scan_ms", SCAN_MS) or None
    drive = {"drive": row["drive"]} if kind in ("axes", "axis-pairs") else {}
    played = play(KINDS[kind](1, row["number"], scan_ms, **drive))
    assert played.scenario.drive == row["drive"]
    assert played.ok, (row["why"], played.violations)


def test_every_planted_bug_has_a_seed() -> None:
    assert set(FOUND) == set(LIARS)


@pytest.mark.parametrize("name", FOUND)
def test_a_planted_bug_is_found(name: str) -> None:
    assert play(random_scenario(1, FOUND[name], SCAN_MS)).ok
    assert found_by(LIARS[name], FOUND[name])


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 5000, 250))
def test_five_thousand_seeds(first: int) -> None:
    """In twenty parts, so that a run that was ended goes on with `-k`; `gantryctl faults campaign` uses every core."""
    broken = [
        (seed, played.violations)
        for seed in range(first, first + 250)
        if not (played := play(random_scenario(1, seed, SCAN_MS))).ok
    ]
    assert broken == []
