"""`gantryctl arm` and what `move` asks first, at a service that is played by the test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from gantryctl.cli.axis import service_state
from gantryctl.cli.axis.service_axis import SHOWN_FRAMES, ServiceAxis
from gantryctl.machine import default_machine
from support.command_line import refused


class Link:
    """A connection to a service whose tags show what is armed in some of the frames."""

    client = "c1"

    def __init__(self, shows: Callable[[int], bool]) -> None:
        self._shows, self.looks = shows, 0
        self.tags: dict[str, Any] = {"armed_client": ""}

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: object) -> None:
        return

    def ask(self, kind: str, **_: object) -> None:
        assert kind == "arm"

    def look(self) -> dict[str, Any]:
        self.looks += 1
        self.tags["armed_client"] = self.client if self._shows(self.looks) else ""
        return self.tags

    def alive(self) -> None:
        return


@pytest.mark.parametrize(
    ("shows", "looks"),
    [(lambda look: 2 <= look < 50, 50), (lambda _: False, SHOWN_FRAMES)],
    ids=["until it is used", "used before the tags have shown it"],
)
def test_arming_for_somebody_else_ends(
    monkeypatch: pytest.MonkeyPatch, shows: Callable[[int], bool], looks: int
) -> None:
    link = Link(shows)
    monkeypatch.setattr(service_state, "ServiceLink", lambda _: link)
    service_state.arm_for_another(default_machine(), "brake_test")
    assert link.looks == looks


def test_a_speed_that_cannot_be_is_refused_before_control_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """With --take-over the service stops what moves."""

    def taken(_: ServiceAxis) -> float:
        raise AssertionError("control was taken")

    monkeypatch.setattr(ServiceAxis, "take", taken)
    why = refused("move", "10", "--speed", "60", "--service", "--yes", "--take-over")
    assert "CTL-01" in why or "speed" in why
