"""A stop by a person, by hand: which one counts, who is told, and what ends when nobody listens."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gantryctl.commissioning import STEPS, Outcome, StepResult
from gantryctl.commissioning.watch import Halt, StepStopped, StepWatch
from gantryctl.engineering.report.meter import Meter
from gantryctl.machine import configs_folder, load_machine
from gantryctl.operation.client import Stop

pytestmark = pytest.mark.can

MACHINE = load_machine(configs_folder() / "hust_can.toml")
ALL_PASSED = {each.key: StepResult(each.key, Outcome.PASSED, "") for each in STEPS}
P, F, N = Outcome.PASSED, Outcome.FAILED, Outcome.NOT_TESTABLE


def test_a_stop_that_comes_as_a_run_begins_is_not_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    halt, run = Halt(), SimpleNamespace(stop=Stop.NO, load_is_held=lambda: False)
    # Nobody has asked when the run is about to begin; somebody does before it can be told.
    monkeypatch.setattr(halt, "check", lambda: halt.ask(Stop.QUICK, "now"))
    with halt.stops(run):  # type: ignore[arg-type]
        assert run.stop is Stop.QUICK


def test_the_first_who_stops_a_step_is_told_and_the_hardest_stop_counts() -> None:
    halt = Halt()
    halt.check()
    run = SimpleNamespace(stop=Stop.NO, load_is_held=lambda: False)
    halt._run = run  # type: ignore[assignment]
    for urgency, who in ((Stop.RAMP, "anna"), (Stop.QUICK, "eve"), (Stop.RAMP, "otto")):
        halt.ask(urgency, who)
    assert (halt.urgency, halt.why, run.stop) == (Stop.QUICK, "anna", Stop.QUICK)


@pytest.mark.parametrize(("silent_s", "stops"), [(0.5, False), (0.51, True)])
def test_a_step_ends_when_nobody_has_listened_for_half_a_second(silent_s: float, stops: bool) -> None:
    now = [100.0]
    halt = Halt(listens=True, now_s=lambda: now[0])
    for _ in range(3):
        now[0] += silent_s
        assert halt.asked() is stops
        halt.listened()
    # One that nobody ever listens for is not silent.
    assert not Halt(now_s=lambda: 1e9).asked()


def test_a_run_ends_too_when_nobody_has_listened_for_half_a_second() -> None:
    """Its program asks nobody: whoever looks at the run does."""
    now = [100.0]
    halt, run = (
        Halt(listens=True, now_s=lambda: now[0]),
        SimpleNamespace(stop=Stop.NO, load_is_held=lambda: False),
    )
    watch = StepWatch(Meter(lambda line: None, 1.0, lambda: 0.0), halt)
    observe = watch.observer()
    halt._run = run  # type: ignore[assignment]
    for wanted in (Stop.NO, Stop.RAMP):
        observe(SimpleNamespace(time_s=0.0, angle_deg=-90.5, speed_deg_s=0.25))  # type: ignore[arg-type]
        # The program has the drive: only what people read is shown.
        assert watch.seen == (-90.5, 0.25, None)
        assert run.stop is wanted
        now[0] += 0.51
    # One that did nothing has no picture.
    watch.draw("nothing", [])
    assert watch.pictures == []


def test_a_run_that_was_stopped_has_not_passed_however_it_ended() -> None:
    """The stop came with its last move: what the run has shown is not what was asked for."""
    halt, run = Halt(), SimpleNamespace(stop=Stop.NO, load_is_held=lambda: False)
    with pytest.raises(StepStopped, match="stopped by anna"), halt.stops(run):  # type: ignore[arg-type]
        halt.ask(Stop.RAMP, "stopped by anna")
    assert run.stop is Stop.RAMP


def test_a_load_that_torque_alone_holds_is_let_go_by_two_requests_while_the_run_is_closed() -> None:
    """As `AxisRun.close` does: what was asked for before counts nothing, then it waits for `Stop.QUICK`."""
    halt, run = Halt(), SimpleNamespace(stop=Stop.NO, load_is_held=lambda: False)
    with pytest.raises(StepStopped), halt.stops(run):  # type: ignore[arg-type]
        halt.ask(Stop.QUICK, "stopped by anna")
    run.stop, run.load_is_held = Stop.NO, lambda: True
    stops = []
    for urgency in (Stop.QUICK, Stop.RAMP):
        halt.ask(urgency, "stopped by eve")
        stops.append(run.stop)
    assert stops == [Stop.RAMP, Stop.QUICK]
