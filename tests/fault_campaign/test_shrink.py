"""The smallest scenario that still breaks, and the matrix of every fault in every phase."""

from __future__ import annotations

import pytest

from gantryctl.engineering.fault_campaign import shrink as shrinking
from gantryctl.engineering.fault_campaign.draw import random_scenario
from gantryctl.engineering.fault_campaign.matrix import CELLS, Cell, cell, no_sense, run_cell
from gantryctl.engineering.fault_campaign.person import _jog
from gantryctl.engineering.fault_campaign.play import Played
from gantryctl.engineering.fault_campaign.scenario import Action, Scenario
from gantryctl.engineering.fault_campaign.shrink import shrink
from gantryctl.engineering.faults.case import Phase
from gantryctl.engineering.faults.catalogue import CATALOGUE, fault_case
from gantryctl.engineering.faults.oracle.axis_oracle import Violation
from gantryctl.errors import UsageError
from gantryctl.program.power.sequence import PowerSequence

pytestmark = pytest.mark.can


def breaks_on(monkeypatch: pytest.MonkeyPatch, number: str, deed: str) -> None:
    """An axis that breaks INV-3 where this fault meets this deed, whatever else there is."""

    def played(scenario: Scenario) -> Played:
        fault = any(each.number == number for each in scenario.faults)
        asked = any(each.do == deed and each.at_s < scenario.duration_s for each in scenario.actions)
        found = (Violation("INV-3", 20.0, "far"),) if fault and asked and scenario.duration_s > 20.0 else ()
        return Played(scenario, violations=found)

    monkeypatch.setattr(shrinking, "play", played)


def test_only_what_is_needed_to_break_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = next(
        each
        for each in (random_scenario(1, seed) for seed in range(500))
        if len(each.faults) == 3 and any(action.do == "jog" and action.at_s < 20.0 for action in each.actions)
    )
    number = drawn.faults[1].number
    breaks_on(monkeypatch, number, "jog")
    said: list[str] = []
    found = shrink(drawn, said.append)
    left = found.played.scenario
    assert [each.number for each in left.faults] == [number]
    assert [each.do for each in left.actions] == ["jog"]
    assert (left.plant_seed, left.duration_s, found.invariant) == (None, 20.2, "INV-3")
    assert left.faults[0].at_s == round(left.faults[0].at_s)
    assert said
    few = shrink(drawn, said.append, trials_max=3)
    assert few.trials <= 4


def test_a_scenario_is_shrunk_to_what_broke_first_and_to_nothing_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without its second jog it breaks another way: both jogs are needed for what was found."""
    jogs = tuple(Action(at_s=at_s, do="jog", speed_deg_s=1.0, for_s=0.5) for at_s in (1.0, 2.0))
    whole = Scenario(duration_s=5.0, scan_ms=10.0, actions=jogs)

    def played(scenario: Scenario) -> Played:
        what = "INV-3" if len(scenario.actions) == 2 else "INV-1"
        return Played(scenario, violations=(Violation(what, 4.9, "far"),))

    monkeypatch.setattr(shrinking, "play", played)
    found = shrink(whole, lambda _: None)
    assert (found.invariant, len(found.played.scenario.actions)) == ("INV-3", 2)
    assert found.played.violations[0].invariant == "INV-3"


def test_a_network_that_goes_renews_a_key_no_longer() -> None:
    """Held from 1.03 s to 3.03 s, renewed until 1.53 s."""
    for lease_s, last_s in ((None, 3.03), (0.5, 1.53)):
        action = Action(at_s=1.0, do="jog", speed_deg_s=1.0, for_s=2.0, lease_s=lease_s)
        changes = list(_jog(action))
        assert max(each.at_s for each in changes if each.renews) == pytest.approx(last_s, abs=0.031)
        assert changes[-1].at_s == pytest.approx(3.03)


def test_what_does_not_break_is_not_shrunk() -> None:
    with pytest.raises(UsageError, match="nothing breaks"):
        shrink(Scenario(duration_s=0.5, scan_ms=10.0), print)


def test_every_cell_of_the_matrix_has_one_number() -> None:
    assert 8 * 5 * 12 * 3 * len(CATALOGUE) <= CELLS
    seen = {number * 100_003 % CELLS for number in range(CELLS)}
    assert len(seen) == CELLS
    sample = [cell(number) for number in range(2000)]
    assert {each.phase for each in sample} == set(Phase)
    assert {each.scan_ms for each in sample} == {1.0, 4.0, 10.0}
    assert len({each.angle_deg for each in sample}) == 12
    assert len({each.case.number for each in sample}) == len(CATALOGUE)
    assert {(each.drive, each.beside) for each in sample} == {("sim", False), ("bus", False), ("bus", True)}
    with pytest.raises(UsageError, match="has cells 0 to"):
        cell(CELLS)


def at(
    number: str, phase: Phase, drive: str = "sim", speed_deg_s: float = 6.0, angle_deg: float = 45.0
) -> Cell:
    return Cell(
        fault_case(number), "bus" if drive == "bus" else "sim", phase, speed_deg_s, angle_deg, 10.0, "drive"
    )


def test_a_cell_without_sense_has_its_reason() -> None:
    assert no_sense(at("E1", Phase.CRUISE)) == "only on a bus"
    assert no_sense(at("A4", Phase.CRUISE, "bus")) == "only on the simulated drive"
    assert no_sense(at("E20", Phase.CRUISE, "bus")) == "only with nodes beside the drive"
    assert no_sense(at("E20", Phase.CRUISE, "bus")._replace(beside=True)) == ""
    assert (
        no_sense(at("A2", Phase.HOLD))
        == "phase 'held by torque because the brake is not trusted': for its own rows"
    )
    assert no_sense(at("A2", Phase.OFF, speed_deg_s=1.0)) == "a phase at standstill has no speed: run once"
    assert (
        run_cell(at("A2", Phase.CRUISE, angle_deg=-165.0))["refused"]
        == "the run-up does not fit into the travel"
    )


@pytest.mark.slow
@pytest.mark.parametrize("waits", [False, True])
def test_a_drive_off_the_bus_is_run_with_nodes_beside_it(
    waits: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """E9 at standstill under torque: a brake on the I/O node that waits for the heartbeat of the drive is found."""
    if waits:
        monkeypatch.setattr(PowerSequence, "_stop_unseen", lambda self, elapsed_s: None)
    found = run_cell(at("E9", Phase.ENABLED, "bus")._replace(beside=True))
    assert found["refused"] == ""
    assert any("INV-6" in each for each in found["violations"]) is waits


def test_a_cell_is_run_and_judged() -> None:
    found = run_cell(at("D1", Phase.CRUISE, speed_deg_s=1.0))
    assert (found["violations"], found["stops"], found["refused"]) == ([], "DRV-01", "")
    assert found["way_deg"] < found["limit_deg"]
    elsewhere = run_cell(at("A7", Phase.ENABLED))
    assert (elsewhere["violations"], elsewhere["stops"]) == ([], "")
