"""A person stops a step: at once, whatever it does, with the axis off afterwards and nothing proven by it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gantryctl.commissioning import STEPS, Commissioning, Outcome
from gantryctl.commissioning.watch import LISTENER_S, Halt, Seen, StepStopped
from gantryctl.image import DriveState
from gantryctl.machine import configs_folder, load_machine
from gantryctl.operation.client import Stop
from gantryctl.operation.store import StateStore

pytestmark = pytest.mark.can

MACHINE = load_machine(configs_folder() / "hust_can.toml")
BY_KEY = {step.key: step for step in STEPS}


class Person(Halt):
    """Presses Stop once, as soon as the axis is seen to do something; the step is the one that looks.

    Attributes:
        at: what the axis did then.
    """

    def __init__(self, work: Commissioning, when: Callable[[Seen], bool], urgency: Stop = Stop.RAMP) -> None:
        super().__init__()
        self._work, self._when, self._how = work, when, urgency
        self.at: Seen | None = None

    def asked(self) -> bool:
        watch = self._work.watch
        if self.at is None and watch is not None and watch.seen is not None and self._when(watch.seen):
            self.at = watch.seen
            self.ask(self._how, "stopped by anna")
        return super().asked()


def turns(speed_deg_s: float) -> Callable[[Seen], bool]:
    return lambda seen: seen.speed_deg_s is not None and abs(seen.speed_deg_s) > speed_deg_s


def enabled(seen: Seen) -> bool:
    return seen.drive is not None and seen.drive.state is DriveState.OPERATION_ENABLED


@pytest.fixture
def work(tmp_path: Path) -> Iterator[Commissioning]:
    with StateStore(MACHINE, tmp_path) as store:
        started = Commissioning(MACHINE, store, tmp_path, lambda line: None, lambda step: True)
        started.start(again=False)
        yield started


def way_deg(work: Commissioning, begun: Seen | None) -> float:
    """From where Stop was pressed to where the axis was seen last."""
    watch = work.watch
    assert begun is not None
    assert begun.angle_deg is not None
    assert watch is not None
    assert watch.seen is not None
    assert watch.seen.angle_deg is not None
    assert watch.seen.speed_deg_s is not None
    assert abs(watch.seen.speed_deg_s) < 0.05, "it is seen at rest"
    return abs(watch.seen.angle_deg - begun.angle_deg)


# Torque off and brake stop the gantry from 3 deg/s within 0.75 s, so from 1 deg/s within 0.5 deg. The jog-release ramp
# from 1 deg/s takes 0.9 deg, and a tenth of a second passes before the observer looks.
@pytest.mark.parametrize(
    ("key", "when", "urgency", "most_deg"),
    [
        ("silence", enabled, Stop.RAMP, 0.05),
        ("velocity", turns(0.05), Stop.RAMP, 0.1),
        ("stops", turns(0.9), Stop.RAMP, 0.5),
        ("turn", turns(0.9), Stop.RAMP, 1.2),
        ("turn", turns(0.9), Stop.QUICK, 0.3),
    ],
)
def test_a_stop_ends_the_step_at_once_and_for_good(
    work: Commissioning, key: str, when: Callable[[Seen], bool], urgency: Stop, most_deg: float
) -> None:
    person = Person(work, when, urgency)
    with pytest.raises(StepStopped, match="stopped by anna"):
        work.do(BY_KEY[key], person)
    assert way_deg(work, person.at) < most_deg
    assert key not in work.progress.results


def test_a_step_that_was_stopped_before_it_began_switches_nothing_on(work: Commissioning) -> None:
    for key in ("pdo", "silence", "velocity", "loop", "turn"):
        halt = Halt()
        halt.ask(Stop.RAMP, "stopped by anna")
        with pytest.raises(StepStopped):
            work.do(BY_KEY[key], halt)
        watch = work.watch
        assert watch is not None
        # An open drive shows itself in the answer to torque off; a program has not scanned once.
        assert watch.seen is None or (watch.seen.drive is not None and not enabled(watch.seen)), key
    assert work.progress.results == {}


def test_what_was_proven_before_stands_when_its_repetition_is_stopped(work: Commissioning) -> None:
    step = BY_KEY["velocity"]
    proven = work.do(step)
    assert proven is not None
    assert proven.outcome is Outcome.PASSED
    with pytest.raises(StepStopped):
        work.do(step, Person(work, turns(0.05)))
    assert work.progress.results["velocity"] is proven


def test_a_step_that_nobody_can_stop_ends() -> None:
    now = [100.0]
    halt = Halt(listens=True, now_s=lambda: now[0])
    now[0] += LISTENER_S
    assert not halt.asked()
    halt.listened()
    now[0] += 0.99 * LISTENER_S
    assert not halt.asked()
    now[0] += 0.02 * LISTENER_S
    assert halt.asked()
    assert "nobody has listened" in halt.why


def test_the_first_reason_is_told_and_the_hardest_stop_is_made() -> None:
    halt = Halt()
    halt.ask(Stop.RAMP, "first")
    halt.ask(Stop.QUICK, "second")
    halt.ask(Stop.RAMP, "third")
    assert (halt.urgency, halt.why) == (Stop.QUICK, "first")
