"""`gantryctl commission` that is asked to end: the axis stops, and no further step begins."""

from __future__ import annotations

import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import pytest

from gantryctl.cli.drive import commission
from gantryctl.commissioning import STEPS, Outcome, StepResult
from gantryctl.commissioning.watch import Halt, StepStopped
from gantryctl.machine import default_machine
from gantryctl.operation.client import Stop

pytestmark = pytest.mark.can
STEP, NEXT = STEPS[0], STEPS[1]


class Work:
    """Steps in whose first one somebody asks for the end, by one signal after the other."""

    resumed = complete = False
    machine = default_machine()

    def __init__(self, *signals: signal.Signals) -> None:
        self.signals, self.begun, self.asked = signals, list[str](), list[Stop]()

    def left(self, only: str | None = None) -> tuple[Any, ...]:
        return STEP, NEXT

    def start(self, again: bool) -> None:
        pass

    def do(self, step: Any, halt: Halt) -> StepResult:
        self.begun.append(step.key)
        for number in self.signals:
            signal.raise_signal(number)
            self.asked.append(halt.urgency)
        return StepResult(step.key, Outcome.PASSED, "")


def run(work: Work) -> None:
    commission._run(work, None, False, Path(), SimpleNamespace())  # type: ignore[arg-type]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_step_is_stopped_and_no_other_one_begins(number: signal.Signals) -> None:
    """Ctrl-C, the system, a terminal that is lost: none of them leaves a turning axis to a drive that is not proven."""
    before, work = signal.getsignal(number), Work(number)
    with pytest.raises(StepStopped, match="the command was asked to end"):
        run(work)
    assert (work.begun, work.asked) == ([STEP.key], [Stop.RAMP])
    assert signal.getsignal(number) is before


def test_asked_twice_it_is_a_quick_stop() -> None:
    work = Work(signal.SIGINT, signal.SIGINT)
    with pytest.raises(StepStopped):
        run(work)
    assert work.asked == [Stop.RAMP, Stop.QUICK]


def test_ctrl_c_answers_the_question_before_a_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the question would wait on for a yes or a no."""
    monkeypatch.setattr(click, "confirm", lambda text: signal.raise_signal(signal.SIGINT))
    halted: list[str] = []
    with pytest.raises(KeyboardInterrupt), commission.stop_signals(lambda: halted.append("stop")):
        commission._ask(Work(), STEP, None)  # type: ignore[arg-type]
    assert halted == []
