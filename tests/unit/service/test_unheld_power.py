"""Power that nobody has control of: off after its time at rest, and never before. Virtual gantry, virtual time."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.image import DriveState
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.program import AxisState, PowerPhase
from gantryctl.service.command.unheld import UnheldPower
from gantryctl.service.protocol.limits import SILENCE_S
from support.service_bench import Bench

LIMIT_S = 2.0
SCAN_MS = 4.0
SCAN_S = SCAN_MS * 1e-3
# From a command to the scan that has carried it out and has counted it: `Bench.ask` goes on by three scans.
ASKED_S = 4.0 * SCAN_S


def machine(**more: object) -> Machine:
    keys = {"control.scan_period_ms": SCAN_MS, "monitors.unheld_power_time_s": LIMIT_S, **more}
    return with_values(default_machine(), keys)


class Axis(Bench):
    """A bench whose steps are seconds."""

    def go(self, seconds: float) -> None:
        self.scans(round(seconds / SCAN_S))

    def on_s(self, limit_s: float, seen: Callable[[], None] = lambda: None) -> float:
        """How long power stays on from now; fails when it is still on after the limit."""
        begun_s = self.time_s
        while self.operator.levels.power:
            seen()
            self.scans(1)
            assert self.time_s - begun_s < limit_s, "power is still on"
        return self.time_s - begun_s

    @property
    def told(self) -> list[dict[str, object]]:
        """Events of power that was switched off because nobody had control."""
        events = [json.loads(record) for record in self.event_ring.peek(4000) if record]
        return [each for each in events if each["kind"] == "authority" and "after_s" in each["values"]]

    @property
    def left_s(self) -> float:
        return self.operator.unheld.left_s(self.time_s)


@pytest.fixture
def axis() -> Axis:
    made = Axis(machine=machine())
    made.powered(made.who())
    return made


def test_power_goes_off_in_the_scan_in_which_its_time_is_over(axis: Axis) -> None:
    axis.do(axis.who(), "give")
    on_s = axis.on_s(LIMIT_S + 1.0)
    # `give` was asked up to four scans before this count began, and the scan that sees the time over is one more.
    assert LIMIT_S - ASKED_S <= on_s <= LIMIT_S + SCAN_S
    (told,) = axis.told
    assert told["text"] == "power off: nobody had control for 2 s"
    assert told["values"] == {"after_s": LIMIT_S}


def test_the_brake_closes_before_the_torque_goes(axis: Axis) -> None:
    axis.do(axis.who(), "give")
    axis.on_s(LIMIT_S + 1.0)
    while axis.axis.power.phase is not PowerPhase.OFF:
        feedback = axis.axis.feedback
        assert feedback.state is DriveState.OPERATION_ENABLED or not feedback.brake_open, "the load was free"
        axis.scans(1)
    assert axis.axis.state is AxisState.DISABLED
    assert not axis.axis.alarms.active


@pytest.mark.parametrize("place", ["console", "local"])
def test_whoever_has_control_keeps_power(axis: Axis, place: str) -> None:
    if place == "local":
        axis.do(axis.who(client="commands", place=place), "take", over=False)
    for _ in range(20):
        axis.go(LIMIT_S / 4.0)
        assert math.isnan(axis.left_s)
    assert axis.axis.power.status
    assert axis.told == []


def test_the_time_left_is_seen_and_begins_anew_when_control_is_taken(axis: Axis) -> None:
    for _ in range(4):
        axis.do(axis.who(), "give")
        axis.go(0.8 * LIMIT_S)
        assert axis.left_s == pytest.approx(0.2 * LIMIT_S, abs=ASKED_S)
        axis.do(axis.who(), "take", over=False)
        assert math.isnan(axis.left_s)
    axis.do(axis.who(), "give")
    assert axis.on_s(LIMIT_S + 1.0) >= LIMIT_S - ASKED_S


def test_a_holder_who_is_silent_has_the_same_time_from_the_loss_of_control(axis: Axis) -> None:
    axis.lively = False
    axis.send(axis.who(), "alive")
    on_s = axis.on_s(SILENCE_S + LIMIT_S + 1.0)
    assert on_s == pytest.approx(SILENCE_S + LIMIT_S, abs=2.0 * ASKED_S)


def test_a_motion_that_goes_on_without_its_holder_is_not_cut_off(axis: Axis) -> None:
    axis.do(axis.who(), "set", tag="speed_setting_deg_s", value=1.0)
    axis.do(axis.who(), "move", target_deg=3.0 * LIMIT_S)
    axis.do(axis.who(), "give")
    rested_s: list[float] = []

    def seen() -> None:
        if axis.axis.at_rest:
            rested_s.append(axis.time_s)
        else:
            assert math.isnan(axis.left_s)
            assert not rested_s

    on_s = axis.on_s(8.0 * LIMIT_S, seen)
    assert on_s > 3.0 * LIMIT_S, "the move alone takes 6 s at 1 deg/s"
    assert axis.time_s - rested_s[0] == pytest.approx(LIMIT_S, abs=ASKED_S)
    assert axis.axis.pos_act_rad == pytest.approx(math.radians(3.0 * LIMIT_S), abs=1e-4)


def test_a_stop_by_somebody_without_control_begins_the_time_anew(axis: Axis) -> None:
    axis.do(axis.who(), "give")
    axis.go(0.8 * LIMIT_S)
    axis.do(axis.who(), "stop")
    # At rest a stop lasts a few scans; its state is not Standstill.
    assert axis.on_s(2.0 * LIMIT_S) == pytest.approx(LIMIT_S, abs=0.5 * LIMIT_S)
    assert axis.axis.alarms.first_out is None


def test_an_axis_that_its_brake_holds_is_switched_off_as_well() -> None:
    held = machine(**{"brake.hold": "brake", "brake.hold_brake_after_s": 1.0})
    axis = Axis(machine=held)
    axis.powered(axis.who())
    axis.go(3.0)
    assert axis.axis.power.phase is PowerPhase.PARKED
    axis.do(axis.who(), "give")
    assert axis.on_s(LIMIT_S + 1.0) >= LIMIT_S - ASKED_S
    axis.go(0.1)
    assert axis.axis.power.phase is PowerPhase.OFF


def test_with_power_off_nothing_counts(axis: Axis) -> None:
    axis.do(axis.who(), "power", on=False)
    axis.do(axis.who(), "give")
    axis.go(2.0 * LIMIT_S)
    assert math.isnan(axis.left_s)
    assert axis.told == []


def test_what_no_operator_has_switched_on_is_not_counted(axis: Axis) -> None:
    """In commissioning and in tests power is on without the operator's level: that is not its to switch off."""
    axis.do(axis.who(), "give")
    unheld = axis.operator.unheld
    for later_s in (0.0, LIMIT_S, 10.0 * LIMIT_S):
        assert not unheld.due(axis.time_s + later_s, power=False)
    assert math.isnan(unheld.left_s(axis.time_s))


@pytest.mark.parametrize(("at_rest", "due"), [(True, [False, False, True]), (False, [False, False, False])])
def test_power_goes_off_as_its_time_is_over_and_not_while_the_set_point_moves(
    at_rest: bool, due: list[bool]
) -> None:
    axis: Any = SimpleNamespace(at_rest=at_rest, state=AxisState.STANDSTILL)
    nobody: Any = SimpleNamespace(holder=None)
    unheld = UnheldPower(axis, nobody, 2.0)
    assert [unheld.due(now_s, power=True) for now_s in (1.0, 2.75, 3.0)] == due
