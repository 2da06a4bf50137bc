"""Who asks the service to end, and when it does: torque alone may hold the load, and it ends with the service."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import pytest

from gantryctl.service.clients.hub import Hub
from unit.service.test_supervisor_by_hand import Desk

PERSONS = [signal.SIGINT, signal.SIGHUP]


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Desk:
    return Desk(monkeypatch, tmp_path)


def asked(desk: Desk, phase: str, *numbers: signal.Signals) -> list[int]:
    """Requests one after the other in a phase of the power sequence; how many of them it took to end."""
    made: Any = desk.made()
    made.hub.status = lambda: {"tags": {"power_phase": phase} if phase else {}}
    taken: list[int] = []

    async def ended() -> None:
        for count, number in enumerate(numbers, 1):
            desk.handlers[number]()
            if desk.said and count == 1:
                continue
            taken.append(count)
            return

    desk.watch = ended
    assert desk.run(made, lambda: None) == 0
    return taken


@pytest.mark.parametrize("number", PERSONS)
def test_a_person_has_to_ask_twice_while_torque_alone_holds_the_load(
    desk: Desk, number: signal.Signals
) -> None:
    assert asked(desk, "torque_hold", number, number) == [2]
    (said,) = desk.said
    assert "torque alone holds the load" in said
    assert "within 20 s nothing holds the load" in said


@pytest.mark.parametrize(
    ("phase", "number"),
    [("torque_hold", signal.SIGTERM), ("on", signal.SIGINT), ("off", signal.SIGHUP), ("", signal.SIGINT)],
)
def test_else_the_first_request_ends_it(desk: Desk, phase: str, number: signal.Signals) -> None:
    """Also that of the system, which kills soon after; and before the controller has told anything."""
    assert asked(desk, phase, number) == [1]
    assert desk.said == []


def test_a_controller_that_has_gone_holds_nothing(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it told last; asked while it runs: the service was ready before."""
    made: Any = desk.made()
    made.hub.status = lambda: {"tags": {"power_phase": "torque_hold"}}

    async def gone() -> None:
        monkeypatch.setattr(Hub, "fresh", False)
        desk.handlers[signal.SIGINT]()

    desk.watch = gone
    assert desk.run(made, lambda: None) == 0
    assert desk.said == []


def test_a_request_of_an_earlier_time_is_not_the_first_of_this_one(desk: Desk) -> None:
    """The load was secured, service has reset, and the brake slips again."""
    made: Any = desk.made()
    phase = ["torque_hold"]
    made.hub.status = lambda: {"tags": {"power_phase": phase[0]}}
    said: list[int] = []

    async def again() -> None:
        for now in ("torque_hold", "torque_hold", "on", "torque_hold"):
            phase[0] = now
            made._look_at_load()
            if now != "on" and len(said) != 1:
                desk.handlers[signal.SIGINT]()
            said.append(len(desk.said))
        desk.handlers[signal.SIGINT]()

    desk.watch = again
    assert desk.run(made, lambda: None) == 0
    assert said == [1, 1, 1, 2]
