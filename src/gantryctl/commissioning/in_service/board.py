"""The board of commissioning: its steps, what they have shown and what is open, as values for whoever looks."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from gantryctl.commissioning.results import Outcome
from gantryctl.commissioning.run import Commissioning, Step
from gantryctl.operation.ledger.judging import unproven
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.memory.snapshot import publish_json
from gantryctl.service.protocol.messages import MessageRefused


class Board:
    """Steps and ledger of one commissioning. One thread shows, another one asks.

    Attributes:
        results: how often it was shown: whoever has seen fewer reads it again.
    """

    def __init__(self, memory: SharedMemory) -> None:
        self._memory = memory
        self.results = 0
        self._steps: dict[str, Step] = {}
        self._done: frozenset[str] = frozenset()

    def show(self, work: Commissioning, note: str = "") -> None:
        """Show what stands now.

        Args:
            note: what has just happened, "" for nothing to tell.
        """
        found, rows = work.progress.results, work.ledger
        steps = work.steps
        self._steps = {step.key: step for step in steps if offered(step)}
        self._done = frozenset(key for key, result in found.items() if result.outcome is not Outcome.FAILED)
        self._publish(
            {
                "machine": work.machine.name,
                "drive": work.progress.drive,
                "complete": work.complete,
                "note": note,
                "steps": [_row(step, work) for step in steps],
                "ledger": [row.text for row in rows],
                "open": [row.text for row in unproven(rows)],
            }
        )

    def refuse(self, machine: str, why: str) -> None:
        """Show why no step can be begun."""
        self._steps = {}
        self._publish(
            {
                "machine": machine, "drive": "", "complete": False, "note": why, "steps": [], "ledger": [],
                "open": [],
            }
        )  # fmt: skip

    def _publish(self, values: dict[str, Any]) -> None:
        publish_json(self._memory.commissioning, values)
        self.results += 1

    def step(self, key: str) -> Step:
        """The step with that key.

        Raises:
            MessageRefused: the page does not offer it.
        """
        found = self._steps.get(key)
        if found is None:
            raise MessageRefused(Code.CTL_14, reason=Words.STEP_UNKNOWN(step=key))
        return found

    def check_turn(self, step: Step) -> None:
        """Refuse a step whose turn has not come: each rests on those before it.

        Raises:
            MessageRefused: a step before it has not passed.
        """
        for each in self._steps.values():
            if each.key == step.key:
                return
            if each.required and each.key not in self._done:
                raise MessageRefused(Code.CTL_14, reason=Words.STEP_BEFORE(step=each.key))


def offered(step: Step) -> bool:
    """Whether the page has this step: neither a person's hands at the inputs nor an instrument are on a page."""
    return step.required and not step.by_hand


def _row(step: Step, work: Commissioning) -> dict[str, Any]:
    result = work.progress.results.get(step.key)
    shown = {} if result is None else {name: asdict(figure) for name, figure in result.figures.items()}
    return {
        "key": step.key,
        "title": step.title,
        "does": step.does,
        "moves": step.could_move(work.machine),
        "offered": offered(step),
        "outcome": "" if result is None else result.outcome.name.lower(),
        "proof": "" if result is None else result.proof,
        "to_do": "" if result is None else result.to_do,
        "at": "" if result is None else result.at,
        "by": "" if result is None else result.by,
        "figures": shown,
    }
