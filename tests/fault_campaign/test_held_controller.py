"""An encoder freezes in motion while the controller stands still: what the true plant does, and what is permitted."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from gantryctl.engineering.fault_campaign.draw import pair_scenario, random_scenario
from gantryctl.engineering.fault_campaign.machines import base_machine
from gantryctl.engineering.fault_campaign.play import play
from gantryctl.engineering.fault_campaign.scenario import PlannedFault, Scenario
from gantryctl.engineering.faults.limits import held_up_deg
from gantryctl.program.alarms import log
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.feedback import Feedback
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence
from support.fault_liars import LIARS

pytestmark = pytest.mark.can
FROZEN_S = 19.58


def scenario(drive: Literal["sim", "bus"], held_s: float) -> Scenario:
    """Pair 1016, ended 3 s after its faults: a move of 0.42 deg/s, both faults in the same scan."""
    drawn = pair_scenario(1, 1016, 4.0)
    faults = tuple(
        fault.model_copy(update={"args": {"late_s": held_s}} if fault.number == "F2" else {})
        for fault in drawn.faults
    )
    actions = tuple(each for each in drawn.actions if each.at_s < FROZEN_S)
    given = {"drive": drive, "faults": faults, "actions": actions, "duration_s": FROZEN_S + 3.0}
    return drawn.model_copy(update=given)


# The way of the true plant: 0.12, 1.48 and 3.10 deg in process, 0.15 and 0.51 deg where the drive stops by itself.
@pytest.mark.parametrize(
    ("drive", "held_s", "least_deg", "most_deg"),
    [
        ("sim", 0.04, 0.05, 0.35),
        ("sim", 0.31, 0.6, 2.8),
        ("sim", 0.5, 1.6, 5.1),
        ("bus", 0.04, 0.05, 0.35),
        ("bus", 0.31, 0.2, 0.8),
    ],
)
def test_the_torque_goes_as_soon_as_anybody_can_take_it(
    drive: Literal["sim", "bus"], held_s: float, least_deg: float, most_deg: float
) -> None:
    """In process only the controller can end it, on a bus the drive does so after its deadline of 50 ms."""
    played = play(scenario(drive, held_s), record=True)
    assert played.ok, played.violations
    rows = played.log
    assert rows is not None
    assert played.onset_s is not None
    after = rows["time_s"] >= played.onset_s - 1e-9
    way = np.abs(rows["pos_deg"][after] - rows["pos_deg"][after][0]).max()
    assert least_deg < way < most_deg
    off_s = rows["time_s"][after & (rows["enabled"] == 0.0)][0] - played.onset_s
    # The frozen count is seen 32 ms after the controller makes scans again at the latest; two scans and one of the log.
    assert off_s < held_s + 0.032 + 0.008 + 0.004


@pytest.mark.parametrize("held_s", [0.04, 0.31])
def test_a_program_that_leaves_torque_and_brake_as_they_are_is_found(
    held_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The limit permits no more than the time in which nobody could act, and what monitors need from there.

    After 0.31 s the axis goes 2.69 deg, where 2.61 are permitted, 1.48 with a sound program.
    """
    blind = (Code.ENC_02, Code.BRK_14)
    true = Feedback.doubt
    for code in blind:
        monkeypatch.setitem(log.ALARMS, code, log.ALARMS[code]._replace(reaction=Reaction.W))

    def doubt(self: Feedback, code: Code, /, **values: object) -> None:
        if code not in blind:
            true(self, code, **values)

    monkeypatch.setattr(Feedback, "doubt", doubt)
    monkeypatch.setattr(PowerSequence, "_stop_on_ramp", lambda self: self._enter(PowerPhase.QUICK_STOPPING))
    assert any(each.invariant == "INV-1" for each in play(scenario("sim", held_s)).violations)


def test_a_drive_on_a_bus_does_not_wait_for_its_controller() -> None:
    """Its own deadline bounds the way: a controller that never comes back permits no more than one of 0.5 s."""
    bus = base_machine("bus", False, "drive", 4.0)
    assert held_up_deg(bus, 0.42, np.inf) == held_up_deg(bus, 0.42, 0.5)
    sim = base_machine("sim", False, "drive", 4.0)
    assert held_up_deg(sim, 0.42, 0.5) > 1.5 * held_up_deg(bus, 0.42, 0.5)


def test_the_angle_is_judged_again_after_a_late_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    """Seed 22 finds a program that calls every angle valid; a scan that was late seconds before changes nothing."""
    drawn = random_scenario(1, 22, 4.0)
    late = PlannedFault(number="F1", at_s=0.5)
    scene = drawn.model_copy(update={"faults": (late, *drawn.faults)})
    LIARS["an angle that is called valid whatever the reading says"].plant(monkeypatch)
    told = [each for each in play(scene).violations if each.invariant == "INV-7"]
    assert any("called valid" in each.text for each in told), told
