"""`gantryctl arm` and what `move` asks first, at a service that is played by the test."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.cli.axis import service_state
from gantryctl.cli.axis.service_axis import SHOWN_FRAMES, ServiceAxis
from gantryctl.machine import default_machine
from gantryctl.runtime import AlarmEntry, Retained
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


def test_what_somebody_else_has_armed_instead_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    link = Link(lambda look: 2 <= look < 5)
    look = link.look

    def replaced() -> dict[str, Any]:
        assert link.looks < 20, "it waits for the arming of somebody else"
        found = look()
        if link.looks >= 5:
            found["armed_client"] = "c2"
        return found

    monkeypatch.setattr(link, "look", replaced)
    monkeypatch.setattr(service_state, "ServiceLink", lambda _: link)
    service_state.arm_for_another(default_machine(), "brake_test")
    assert link.looks == 5


def test_alarms_of_before_the_start_follow_newest_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that is in the memory already is told once."""
    rows = [
        {"code": "CTL-03", "text": "the newest", "at": "now", "time_s": 7.0, "pos_act_deg": 90.0, "severity": "STOP",
         "follows": "", "first_out": True}
    ]  # fmt: skip
    kept = [AlarmEntry("INT-06", f"number {n}", "then", 1.0 * n, 0.0) for n in range(3)]
    memory = SimpleNamespace(alarms=(*kept, AlarmEntry("CTL-03", "the newest", "now", 7.0000004, 1.5)))
    link = Link(lambda _: False)
    link.tags = {"alarm_history": rows, "alarms": rows}
    monkeypatch.setattr(service_state, "ServiceLink", lambda _: link)
    monkeypatch.setattr(service_state, "RetainedMemory", lambda _: SimpleNamespace(load=lambda: memory))
    found, holds = service_state.service_alarms(default_machine())
    assert [alarm.text for alarm in found] == ["the newest", "number 2", "number 1", "number 0"]
    assert found[0].pos_act_rad == pytest.approx(1.5707963)
    assert holds == ["CTL-03"]


@pytest.mark.parametrize(
    ("holds", "history", "told", "last"),
    [
        ([], [], "INT-06", "INT-06 the newest"),
        ([], ["CTL-05", "BRK-06"], "INT-06", "CTL-05"),
        (["CTL-03", "CTL-12"], ["CTL-12", "CTL-03"], "CTL-03", "CTL-03; CTL-12"),
    ],
)
def test_the_stop_that_is_told_is_the_one_that_holds_or_the_last_one(
    monkeypatch: pytest.MonkeyPatch, holds: list[str], history: list[str], told: str, last: str
) -> None:
    """So is the last alarm: after a reset it is that of this start, else that of the runs before."""
    machine = default_machine()
    alarms = [{"code": code, "first_out": code == holds[0], "text": code} for code in holds]
    link = Link(lambda _: False)
    link.tags = {
        "machine": "one", "axis_state": "error_stop", "pos_act_deg": 1.0, "position_valid": True, "alarms": alarms,
        "quick_dec_deg_s2": 5.4, "brake_test_available": False, "brake_test_blocked": "no contact", "config_hash": "",
        "alarm_history": [{"text": code} for code in history],
    }  # fmt: skip
    alarms_kept = tuple(
        AlarmEntry("INT-06", f"INT-06 {text}", "", 1.0, None) for text in ("older", "the newest")
    )
    kept = Retained("one", "", error_stop="INT-06", alarms=alarms_kept)
    monkeypatch.setattr(service_state, "ServiceLink", lambda _: link)
    monkeypatch.setattr(service_state, "RetainedMemory", lambda _: SimpleNamespace(load=lambda: kept))
    monkeypatch.setattr(service_state, "ledger_shown", lambda *_: ())
    found, _ = service_state.service_status(machine)
    assert (found.error_stop, found.condition) == (told, "in service, error stop")
    assert found.last_alarm == last
    assert found.brake_test == "not testable here: no contact"


def test_events_are_those_on_the_disk() -> None:
    """Three of 43 wait for it."""
    tags = dict.fromkeys(("vel_act_deg_s", "unheld_power_left_s", "scan_overruns", "config_hash")) | {
        "power": True, "power_phase": "on", "drive_state": "ready", "authority_user": "anna", "journal_state": "slow",
        "journal_sequence": 43, "journal_committed": 40,
    }  # fmt: skip
    assert dict(service_state.service_rows(tags))["journal"] == "slow, 40 events"


@pytest.mark.parametrize(
    ("phase", "blocked_by", "told"),
    [
        ("off", "", "off"),
        ("off", "reset first", "reset first"),
        ("torque_hold", "reset first", "torque hold; reset first"),
        ("enabling", "", "enabling"),
    ],
)
def test_power_is_not_told_as_off_while_the_motor_has_torque(phase: str, blocked_by: str, told: str) -> None:
    """A brake that slips: the motor alone holds the load, with an alarm that forbids to switch on."""
    tags = dict.fromkeys(
        ("vel_act_deg_s", "unheld_power_left_s", "config_hash", "drive_state", "authority_user", "journal_state",
         "journal_committed")
    ) | {"power": False, "power_phase": phase, "blocked_by": blocked_by}  # fmt: skip
    assert dict(service_state.service_rows(tags))["power"] == told


@pytest.mark.parametrize("as_json", [True, False])
def test_a_controller_that_was_started_anew_is_watched_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], as_json: bool
) -> None:
    """Its time begins with 0; a line a second before and behind it."""
    ends: list[Callable[[], None]] = []
    times = [100.0, 100.5, 101.0, 0.2, 0.7, 1.2, 1.3]

    def look() -> dict[str, Any]:
        link.looks += 1
        if link.looks == len(times):
            ends[0]()
        return {
            "time_s": times[link.looks - 1], "pos_act_deg": 1.0, "vel_act_deg_s": 0.0, "pos_err_deg": 0.0,
            "axis_state": "standstill", "time_left_s": 0.0,
        }  # fmt: skip

    link = Link(lambda _: False)
    monkeypatch.setattr(link, "look", look)
    monkeypatch.setattr(service_state, "ServiceLink", lambda _: link)
    monkeypatch.setattr(service_state, "stop_signals", lambda end: ends.append(end) or nullcontext())
    service_state.watch_service(default_machine(), as_json=as_json)
    lines = capsys.readouterr().out.splitlines()
    told = [json.loads(line)["time_s"] if as_json else float(line.split()[0]) for line in lines]
    assert told == [100.0, 101.0, 0.2, 1.2]


def test_a_speed_that_cannot_be_is_refused_before_control_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """With --take-over the service stops what moves."""

    def taken(_: ServiceAxis) -> float:
        raise AssertionError("control was taken")

    monkeypatch.setattr(ServiceAxis, "take", taken)
    why = refused("move", "10", "--speed", "60", "--service", "--yes", "--take-over")
    assert "CTL-01" in why or "speed" in why
