"""How commands end and what they pass on, by hand: exit codes, the second of two, a figure that is not known."""

from __future__ import annotations

import json
import math
from contextlib import nullcontext
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import pytest

from gantryctl.cli.axis import brake_test, why
from gantryctl.cli.axis.display import log_line, print_motion
from gantryctl.cli.axis.service_axis import brake_due
from gantryctl.cli.drive import commission, drive
from gantryctl.cli.options import ATTACHED, confirm, to_service
from gantryctl.commissioning import STEPS, Outcome, StepResult
from gantryctl.engineering.computer import scan_trial
from gantryctl.errors import AlarmStop, CommandRefused
from gantryctl.machine import default_machine
from gantryctl.operation import state as machine_state
from gantryctl.operation import store
from gantryctl.operation.client import BrakeDue, BrakeTestReport, Ending, MotionReport, Snapshot
from gantryctl.program import BrakeTestOutcome
from gantryctl.runtime import AlarmEntry
from gantryctl.service.recorder.journal import reading
from gantryctl.trace import listing
from gantryctl.trace.listing import Recorded
from support.command_line import cli, done, machine_file

MACHINE = default_machine()
DONE = MotionReport(Ending.DONE, 0.0, 90.0, 0.0, 20.0)


def test_a_motion_is_done_where_nothing_has_failed_behind_it(capsys: pytest.CaptureFixture[str]) -> None:
    """An alarm on the way down: the motion has reached its end, and the command has not."""
    assert print_motion(MACHINE, DONE, None, as_json=True) == 0
    assert json.loads(capsys.readouterr().out)["result"] == DONE.text
    alarm = AlarmStop("BRK-03 STOP", "BRK-03")
    assert print_motion(MACHINE, DONE, alarm, as_json=True) == alarm.exit_code == 4
    said = json.loads(capsys.readouterr().out)
    assert (said["result"], said["error"], said["exit_code"]) == (None, "BRK-03 STOP", 4)
    stopped = DONE._replace(ending=Ending.STOPPED)
    assert print_motion(MACHINE, stopped, None, as_json=True) == 1


def test_a_line_of_a_log_has_the_direction_of_the_motion() -> None:
    shot = Snapshot(12.0, -10.0, -2.5, -0.001, "moving", 3.0)
    assert "-2.500 deg/s" in log_line(shot, MACHINE.axis.dial)
    assert "+2.500 deg/s" in log_line(shot._replace(speed_deg_s=2.5), MACHINE.axis.dial)
    assert "? deg/s" in log_line(shot._replace(speed_deg_s=None), MACHINE.axis.dial)


def test_a_status_without_an_angle_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    known = machine_state.machine_status(MACHINE)
    monkeypatch.setattr(machine_state, "machine_status", lambda _: replace(known, angle_deg=None))
    shown = {line[2:20].strip(): line[20:] for line in done("status").out.splitlines()[1:]}
    assert shown["angle"] == "not known"
    assert done("status", "--json").json["angle_deg"] is None


def test_a_no_to_what_is_locked_is_no_success(monkeypatch: pytest.MonkeyPatch) -> None:
    from gantryctl.operation import brake_policy

    asked: list[str] = []
    monkeypatch.setattr(brake_policy, "locked_code", lambda _: "ENC-01")
    monkeypatch.setattr(machine_state, "reset_machine", lambda _: pytest.fail("it was reset"))
    monkeypatch.setattr(click, "confirm", lambda text, **_: asked.append(text))
    assert cli("reset").code == 2
    assert asked == ["ENC-01: locked. Has the cause been removed?"]


def test_the_command_before_an_alarm_is_that_before_the_same_alarm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two stops by CTL-03 in one journal: 5.1 s and 7.3 s after their runs began."""
    (tmp_path / "journal.sqlite").touch()
    told = [
        ("command", "move 90.0: done", {"time_s": 3.0}),
        ("alarm", "CTL-03 STOP", {"code": "CTL-03", "time_s": 5.1}),
        ("command", "jog forward: done", {"time_s": 7.0}),
        ("alarm", "CTL-03 STOP", {"code": "CTL-03", "time_s": 7.3}),
    ]
    rows = [
        SimpleNamespace(values={"kind": kind, "user": "anna", "text": text, "utc": "now", "detail": json.dumps(detail)})
        for kind, text, detail in told
    ]  # fmt: skip
    monkeypatch.setattr(reading, "read_journal", lambda *_, **__: rows)
    for time_s, command in ((5.1, "move 90.0: done"), (7.3, "jog forward: done")):
        alarm = AlarmEntry("CTL-03", "CTL-03 STOP", "now", time_s, 0.0)
        assert why._asked_for(tmp_path, alarm) == f"{command}, by anna, now"
    assert why._asked_for(tmp_path, AlarmEntry("CTL-03", "", "now", 9.0, 0.0)) is None


def test_a_zero_is_set_at_the_angle_that_a_display_of_0_to_360_means(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """350 deg of an axis from -180 to 180 are -10."""
    asked: list[float] = []

    def set_zero(_: object, angle_deg: float, witness: str) -> str:
        asked.append(angle_deg)
        return witness

    monkeypatch.setattr(machine_state, "set_encoder_zero", set_zero)
    file = machine_file(tmp_path / "m.toml", {"axis.display": "0..360"})
    done("encoder", "set-zero", "--angle", "350", "--witness", "mark", "--config", file)
    done("encoder", "set-zero", "--angle", "10", "--witness", "mark", "--config", file)
    assert asked == [-10.0, 10.0]


def test_both_directions_of_a_brake_test_have_their_own_torque(capsys: pytest.CaptureFixture[str]) -> None:
    report = BrakeTestReport(
        BrakeTestOutcome.PASSED, "held", 90.0, 91.0, -88.0, 0.0123, 0.05, BrakeDue("", 7, overdue=False)
    )
    assert brake_test._print("m", report, None, as_json=False) == 0
    rows = {line[2:20].strip(): line[20:] for line in capsys.readouterr().out.splitlines()[1:]}
    assert (rows["plus"], rows["minus"]) == ("+91 N m held", "-88 N m held")
    assert rows["moved"] == "0.0123 deg, 0.0500 deg allowed"
    assert brake_test._print("m", report._replace(minus_nm=math.nan), None, as_json=True) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["plus_nm"], said["minus_nm"]) == (91.0, None)
    failed = report._replace(outcome=BrakeTestOutcome.FAILED)
    assert brake_test._print("m", failed, None, as_json=False) == 1


@pytest.mark.parametrize(("overdue", "words"), [(True, "overdue: nothing moves faster"), (False, "due ")])
def test_a_brake_test_at_a_service_is_due_as_its_tags_say(overdue: bool, words: str) -> None:
    tags = {
        "brake_test_due_at": "2026-12-01T00:00:00Z", "brake_test_cycles_left": 7, "brake_test_overdue": overdue,
    }  # fmt: skip
    assert brake_due(MACHINE, tags).words.startswith(words)


class Work:
    """Steps of which the first one ends in one way; the rest pass."""

    resumed = complete = False
    machine, ledger = MACHINE, ()
    store = SimpleNamespace(directory=Path())

    def __init__(self, first: Outcome | None) -> None:
        self.first, self.begun = first, list[str]()
        self.progress = SimpleNamespace(results={}, hash="0" * 64)

    def left(self, only: str | None = None) -> tuple[Any, ...]:
        return STEPS[:3]

    def start(self, again: bool) -> None:
        pass

    def do(self, step: Any, halt: object) -> StepResult | None:
        self.begun.append(step.key)
        outcome = self.first if len(self.begun) == 1 else Outcome.PASSED
        return None if outcome is None else StepResult(step.key, outcome, "")


@pytest.mark.can
@pytest.mark.parametrize(
    ("first", "begun", "code"),
    [(Outcome.PASSED, 3, 0), (Outcome.NOT_TESTABLE, 3, 0), (Outcome.FAILED, 1, 1), (None, 1, 1)],
)
def test_no_step_is_begun_behind_one_that_has_failed_or_was_left_out(
    monkeypatch: pytest.MonkeyPatch, first: Outcome | None, begun: int, code: int
) -> None:
    import gantryctl.commissioning as steps

    monkeypatch.setattr(steps, "write_report", lambda *_: Path("report.html"))
    monkeypatch.setattr(commission, "head_of", lambda *_, **__: None)
    work: Any = Work(first)
    assert commission._run(work, None, False, Path(), SimpleNamespace()) == code  # type: ignore[arg-type]
    assert len(work.begun) == begun


def test_the_newest_recordings_are_listed(monkeypatch: pytest.MonkeyPatch, state: Path) -> None:
    (state / "hust_gantry" / "traces").mkdir(parents=True)
    rows = [
        Recorded(Path(f"/a/m/traces/{day}.parquet"), datetime(2026, 1, day, tzinfo=UTC), 1, 1.0, 1000, True)
        for day in (3, 1, 2)
    ]
    monkeypatch.setattr(listing, "recordings", lambda _: rows)
    shown = [Path(line.split()[-1]).stem for line in done("trace", "list", "--last", "2").out.splitlines()]
    assert shown == ["2", "3"]


@pytest.mark.parametrize("option", ["--no-trace", "--fresh", "--real-time", "--seed"])
def test_what_a_service_cannot_follow_is_refused(option: str) -> None:
    words = ("move", "3", "--service", "--yes", option, *(["5"] if option == "--seed" else []))
    answer = cli(*words)
    assert answer.code == 2
    assert f"{option} does not go with a running service" in answer.err


def test_commands_of_another_machine_do_not_go_to_an_attached_service(state: Path, tmp_path: Path) -> None:
    other = machine_file(tmp_path / "other.toml", {"machine.name": "other"})
    assert not to_service(False, None)
    (state / "hust_gantry").mkdir(parents=True)
    (state / "hust_gantry" / ATTACHED).touch()
    assert to_service(False, None)
    assert not to_service(False, other)
    assert to_service(True, other)


@pytest.mark.parametrize("answer", [False, click.Abort()])
def test_neither_a_no_nor_an_interrupt_is_a_yes(
    monkeypatch: pytest.MonkeyPatch, answer: bool | click.Abort
) -> None:
    def asked(*_: object, **__: object) -> bool:
        if isinstance(answer, click.Abort):
            raise answer
        return answer

    monkeypatch.setattr(click, "confirm", asked)
    with pytest.raises(CommandRefused, match="not confirmed: nothing moved"):
        confirm("Move?", "nothing moved")


def test_the_period_of_the_machine_is_tried_beside_those_of_every_computer(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    tried: list[float] = []

    def trial(period_ms: float, *_: object, **__: object) -> Any:
        tried.append(period_ms)
        return SimpleNamespace(good=period_ms != 2.0, to_dict=lambda _: {})

    monkeypatch.setattr(scan_trial, "scan_trial", trial)
    file = machine_file(tmp_path / "m.toml", {"control.scan_period_ms": 2.0})
    answer = cli("doctor", "--json", "--config", file)
    assert (tried, answer.json["judged_ms"], answer.code) == ([1.0, 2.0, 4.0], [2.0], 1)
    tried.clear()
    assert cli("doctor", "--json", "--config", file, "--period", "4", "--period", "1").code == 0
    assert tried == [1.0, 4.0]
    assert cli("doctor", "--json", "--config", file, "--period", "4", "--period", "2").code == 1


@pytest.mark.parametrize(
    ("size", "shown"), [(99_000, "99.0 kB"), (250_000, "0.2 MB"), (12_340_000, "12.3 MB")]
)
def test_a_size_is_in_the_unit_beside_it(state: Path, size: int, shown: str) -> None:
    (state / "hust_gantry").mkdir(parents=True)
    with (state / "hust_gantry" / "plant.json").open("wb") as file:
        file.truncate(size)
    assert f"{shown}  where the simulated machine stands" in done("state", "show").out


def test_what_comes_into_a_state_while_it_is_locked_is_listed_too(
    monkeypatch: pytest.MonkeyPatch, state: Path
) -> None:
    """A command that ran until this one had the lock."""
    folder, enter = state / "hust_gantry", store.StateStore.__enter__
    folder.mkdir(parents=True)
    for name in ("lock", "plant.json"):
        (folder / name).touch()

    def entered(self: store.StateStore) -> store.StateStore:
        made = enter(self)
        (folder / "bus.json").write_text("{}")
        return made

    monkeypatch.setattr(store.StateStore, "__enter__", entered)
    asked: list[str] = []
    monkeypatch.setattr(click, "confirm", lambda text, **_: asked.append(text))
    answer = cli("state", "remove")
    assert "bus.json" in answer.err
    assert len(asked) == 1
    assert f"{len([*folder.iterdir()])} files" in asked[0]


@pytest.mark.can
@pytest.mark.parametrize(
    ("code", "shown"), [(0, "-"), (None, "-"), (0x3210, "EMCY 3210: DC link overvoltage")]
)
def test_a_drive_has_an_error_where_it_tells_one(
    monkeypatch: pytest.MonkeyPatch, code: int | None, shown: str
) -> None:
    """603F is 0 without one, and not in every drive."""
    numbers = {0x6041: 0x0250, 0x6064: 7}
    sdo = SimpleNamespace(number=numbers.__getitem__, optional={0x603F: code, 0x6061: 9}.get)
    who = SimpleNamespace(name="d", software="1", key="k", text="a drive")
    node = SimpleNamespace(identity=lambda: who, sdo=sdo)
    settings = SimpleNamespace(node=2)
    monkeypatch.setattr(drive, "drive_node", lambda _: nullcontext((node, settings, MACHINE)))
    rows = dict(line.strip().split(maxsplit=1) for line in done("drive", "status").out.splitlines()[1:])
    assert rows["error"].partition(" · ")[0] == shown
    assert rows["position"] == "7 increments"
