"""Ctrl-C, SIGTERM and a lost terminal reach an experiment on a machine until it has closed, and may hold the load."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.cli.engineering.experiment import asking, bus_experiment
from gantryctl.machine import default_machine
from gantryctl.operation.client import Stop

MACHINE = default_machine()
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def come(number: signal.Signals) -> None:
    handler = signal.getsignal(number)
    assert callable(handler), "the process would end, with the axis under power"
    handler(number, None)


def run_of(stop: Stop = Stop.NO) -> Any:
    return SimpleNamespace(stop=stop, must_ask=False, observe=lambda observer: None)


@pytest.mark.parametrize("number", SIGNALS)
def test_signals_stop_an_experiment_from_its_power_up_to_its_end(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, seen = run_of(), []

    @contextmanager
    def experiment(machine: object, *, agree: Callable[[Any], None], **_: object) -> Iterator[Any]:
        with pytest.raises(KeyboardInterrupt):  # while the drive is looked for nothing has torque
            come(number)
        agree(run)
        come(number)
        seen.append(run.stop)
        yield run
        # It closes: power goes off, and torque may be all that holds the load.
        run.stop = Stop.NO
        for _ in range(3):
            come(number)
            seen.append(run.stop)

    monkeypatch.setattr("gantryctl.engineering.analysis.measured.on_engine.experiment", experiment)
    before = signal.getsignal(number)
    with bus_experiment(MACHINE, "moves", takes_s=1.0, yes=True, quiet=True):
        pass
    assert seen == [Stop.RAMP, Stop.RAMP, Stop.QUICK, Stop.QUICK]
    assert signal.getsignal(number) is before


def test_a_stop_that_comes_as_one_run_closes_counts_for_the_next() -> None:
    first, second = run_of(), run_of()
    with asking(MACHINE, "moves", yes=True) as agree:
        agree(first)
        come(signal.SIGTERM)
        agree(second)
        assert second.stop is Stop.RAMP
        come(signal.SIGTERM)
    assert (first.stop, second.stop) == (Stop.RAMP, Stop.QUICK)
