"""Bugs for the fault campaign to find: each is planted in the program, and seeds are played until one breaks.

`python -m support.fault_liars --seeds 2000` (with `tests` on PYTHONPATH) prints the first seed that finds each. Seeds
that hold nothing on which the bug could act are counted and not played: there the program does the same as without it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Final, NamedTuple

import pytest

from gantryctl.engineering.fault_campaign.draw import random_scenario
from gantryctl.engineering.fault_campaign.play import play
from gantryctl.engineering.fault_campaign.scenario import Scenario
from gantryctl.program.alarms import log
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.feedback import Feedback
from gantryctl.program.gantry import GantryProgram
from gantryctl.program.power import sequence
from gantryctl.program.power.phases import PowerPhase
from gantryctl.program.power.sequence import PowerSequence

SCAN_MS: Final = 4.0


class Liar(NamedTuple):
    """A bug: how it is planted, and where it could act."""

    plant: Callable[[pytest.MonkeyPatch], None]
    acts: Callable[[Scenario], bool]


def _reacts(reaction: Reaction, *codes: Code) -> Callable[[pytest.MonkeyPatch], None]:
    def plant(patch: pytest.MonkeyPatch) -> None:
        for code in codes:
            patch.setitem(log.ALARMS, code, log.ALARMS[code]._replace(reaction=reaction))

    return plant


def _has(*numbers: str) -> Callable[[Scenario], bool]:
    return lambda scenario: any(fault.number in numbers for fault in scenario.faults)


def _no_lease(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(GantryProgram, "_check_lease", lambda self: None)


def _torque_before_brake(patch: pytest.MonkeyPatch) -> None:
    def closing(self: PowerSequence, pos_rad: float) -> None:
        self._enter(PowerPhase.DISABLING)

    # The table of the steps, not the class: it holds the functions themselves.
    patch.setitem(sequence._STEPS, PowerPhase.CLOSING, closing)


def _encoder_alarm_warns(patch: pytest.MonkeyPatch) -> None:
    """In the table of alarms, and where the reading is doubted: either alone asks for torque off."""
    _reacts(Reaction.W, Code.ENC_05)(patch)
    true = Feedback.doubt

    def doubt(self: Feedback, code: Code, /, **values: object) -> None:
        if code is Code.ENC_05:
            self._alarms.raise_(code, Reaction.W, **values)
        else:
            true(self, code, **values)

    patch.setattr(Feedback, "doubt", doubt)


def _always_valid(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Feedback, "position_valid", True)


def _switches_off(scenario: Scenario) -> bool:
    """By a person, where the controller works the brake; a drive that owns it closes it by itself."""
    owns = scenario.drive == "bus" and scenario.brake_owner == "drive" and not scenario.beside
    return not owns and any(each.do == "power_off" for each in scenario.actions)


LIARS: Final[dict[str, Liar]] = {
    "an encoder alarm that only warns": Liar(_encoder_alarm_warns, _has("A6")),
    "a limit switch that only warns": Liar(_reacts(Reaction.W, Code.LIM_03, Code.LIM_04), _has("G3", "G4")),
    "a room door that only warns": Liar(_reacts(Reaction.W, Code.INT_07), _has("G11")),
    "a lease that never runs out": Liar(
        _no_lease, lambda scenario: any(each.lease_s is not None for each in scenario.actions)
    ),
    "torque taken off before the brake has closed": Liar(_torque_before_brake, _switches_off),
    "an angle that is called valid whatever the reading says": Liar(
        _always_valid, _has("A1", "A1b", "A2", "A2b", "A10", "A15b")
    ),
    "a brake that slips without torque coming back": Liar(
        _reacts(Reaction.W, Code.BRK_03, Code.BRK_04), _has("C3", "C4")
    ),
}


def found_by(liar: Liar, seed: int) -> list[str]:
    """What breaks in a seed with the bug."""
    with pytest.MonkeyPatch.context() as patch:
        liar.plant(patch)
        return [str(each) for each in play(random_scenario(1, seed, SCAN_MS)).violations]


def main() -> int:
    """Find each; 1 when one was not found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=2000)
    asked, missed = parser.parse_args(), 0
    for name, liar in LIARS.items():
        played = 0
        for seed in range(asked.seeds):
            if not liar.acts(random_scenario(1, seed, SCAN_MS)):
                continue
            played += 1
            if broken := found_by(liar, seed):
                print(f"{name}: seed {seed}, the {played}. that it could act on: {broken[0]}", flush=True)
                break
        else:
            missed += 1
            print(f"{name}: not found in {asked.seeds} seeds", flush=True)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
