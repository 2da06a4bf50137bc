"""A commissioning in the controller's place, and the chord test as a step: what is told, kept and left behind."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning.in_service import process
from gantryctl.commissioning.in_service.process import Session
from gantryctl.commissioning.load_side import chord_test
from gantryctl.commissioning.results import Figure, Outcome, StepResult
from gantryctl.commissioning.run import Step
from gantryctl.commissioning.watch import StepStopped
from gantryctl.errors import AlarmStop, ConfigError, DeviceError, UsageError
from gantryctl.service.memory.memory import Word

pytestmark = pytest.mark.can

STEP = Step("brake", "", "", "", lambda c: StepResult("brake", Outcome.PASSED, ""))


class Desk:
    """Orders that come, and what was told."""

    def __init__(self, *orders: Step | None) -> None:
        self.orders, self.told, self.did = list(orders), list[tuple[str, str]](), list[str]()
        self.by, self.halt = "anna", object()

    def run(self) -> None:
        pass

    def tell(self, kind: str, text: str, **values: Any) -> None:
        self.told.append((kind, text))

    def tell_of_step(self, kind: str, text: str, **values: Any) -> None:
        assert values["step"] == STEP.key
        self.told.append((kind, text))

    def next_order(self) -> Step | None:
        return self.orders.pop(0)

    def __getattr__(self, name: str) -> Any:
        return lambda: self.did.append(name)


def session(desk: Desk, **work: Any) -> tuple[Any, SimpleNamespace]:
    seen = SimpleNamespace(words={}, notes=[], refused=[], ended_before=[])

    def show(work: object, note: str = "") -> None:
        seen.notes.append(note)
        seen.ended_before.append("step_ended" in desk.did)

    made: Any = object.__new__(Session)
    made._machine = SimpleNamespace(name="m")
    made._memory = SimpleNamespace(words=seen.words, alarms=None)
    made._board = SimpleNamespace(
        show=show,
        refuse=lambda machine, why: seen.refused.append(why),
    )
    made.desk, made._work = desk, SimpleNamespace(**work)
    return made, seen


@pytest.mark.parametrize(
    ("outcome", "kind"),
    [(Outcome.PASSED, "command"), (Outcome.FAILED, "alarm"), (Outcome.NOT_TESTABLE, "command")],
)
def test_a_step_that_has_failed_is_an_alarm_in_the_journal(outcome: Outcome, kind: str) -> None:
    desk, halts = Desk(), list[object]()

    def do(step: Step, halt: object) -> StepResult:
        halts.append(halt)
        return StepResult("brake", outcome, "as it was")

    made, seen = session(desk, do=do)
    made._do(STEP)
    assert desk.told == [("command", "step brake began"), (kind, f"step brake {outcome.value}: as it was")]
    assert (desk.did, seen.notes, halts) == (["step_ended"], [""], [desk.halt])
    # Its turn is over when its result is on the board, by which the next one is judged.
    assert seen.ended_before == [False]


def test_a_step_that_a_person_has_stopped_is_told_on_the_board() -> None:
    def do(*_: object) -> StepResult:
        raise StepStopped("stopped by anna")

    desk = Desk()
    made, seen = session(desk, do=do)
    made._do(STEP)
    assert (desk.did, seen.notes) == (["step_ended"], ["stopped by anna"])
    assert desk.told[-1] == ("command", "step brake: stopped by anna")


@pytest.mark.parametrize("fault", [None, DeviceError("no answer")])
def test_without_a_drive_no_step_is_offered(fault: DeviceError | None) -> None:
    def start(*, again: bool) -> None:
        assert not again
        # No step may begin while the drive is being set up.
        assert desk.did == []
        if fault is not None:
            raise fault

    desk = Desk()
    made, seen = session(desk, start=start)
    made._set_up()
    assert (seen.refused, seen.notes) == (["no answer"], []) if fault else ([], [""])
    assert desk.did == ["set_up"]
    assert desk.told == ([("service", "commissioning: no answer")] if fault else [])


@pytest.mark.parametrize("broken", [False, True])
def test_the_controller_is_told_whether_the_commissioning_has_ended_as_it_should(
    monkeypatch: pytest.MonkeyPatch, broken: bool
) -> None:
    """Step by step; record and report at the end. One that was broken off has left nothing in order."""
    desk = Desk(STEP, None)
    made, seen = session(desk)
    done: list[object] = []

    def do(step: Step) -> None:
        done.append((step.key, seen.words[Word.CONTROLLER_CLEAN]))
        if broken:
            raise MemoryError

    def keep() -> None:
        done.append(("kept", seen.words[Word.CONTROLLER_CLEAN]))

    published: list[object] = []
    monkeypatch.setattr(process, "publish_json", lambda *given: published.append(given))
    monkeypatch.setattr(process, "short_hash", lambda _: "")
    for name, stand_in in (("_set_up", lambda: None), ("_do", do), ("_keep", keep)):
        monkeypatch.setattr(made, name, stand_in)
    if broken:
        with pytest.raises(MemoryError):
            made.run()
    else:
        assert made.run() == 0
    assert done == [("brake", 0), *([] if broken else [("kept", 0)])]
    assert seen.words[Word.CONTROLLER_CLEAN] == (0 if broken else 1)
    assert desk.did == ["close"]
    assert desk.told[0] == ("service", "commissioning began: m")
    # Alarms of the controller are of a program that is gone.
    assert published == [(None, {"alarms": [], "alarm_history": []})]
    ended = ("service", "commissioning ended: torque off, brake closed")
    assert (desk.told[-1] == ended) is not broken


@pytest.mark.parametrize("complete", [False, True])
@pytest.mark.parametrize("results", [{}, {"brake": STEP.run(None)}])  # type: ignore[arg-type]
def test_the_record_is_written_when_all_is_proven_and_the_report_of_what_was_shown(
    monkeypatch: pytest.MonkeyPatch, complete: bool, results: dict[str, StepResult]
) -> None:
    desk, wrote = Desk(), list[str]()
    made, _ = session(
        desk, progress=SimpleNamespace(results=results, hash="0" * 64), complete=complete, ledger=(),
        record=lambda: wrote.append("record"),
    )  # fmt: skip
    made._folder, made._store = Path(), SimpleNamespace(directory=Path())
    made._machine.required = SimpleNamespace(source="")
    monkeypatch.setattr(process, "known_serials", lambda *_: None)
    monkeypatch.setattr(process, "machine_facts", lambda *_: ())
    heads: list[Any] = []
    monkeypatch.setattr(
        process, "write_report", lambda *given: (heads.append(given[-1]), wrote.append("report"))
    )
    made._keep()
    assert wrote == ([*(["record"] if complete else []), "report"] if results else [])
    assert [head.made.operator for head in heads] == (["anna"] if results else [])
    assert [head.made.command for head in heads] == (["page of gantryctl serve"] if results else [])
    assert [text.partition(":")[0] for _, text in desk.told] == [f"commissioning {each}" for each in wrote]


@pytest.mark.parametrize("hashed", ["as it was", "another"])
def test_a_machine_file_that_has_changed_since_the_service_began_is_not_commissioned(
    monkeypatch: pytest.MonkeyPatch, hashed: str
) -> None:
    """The service shows the limits of the file that it has read."""
    ran: list[object] = []
    handlers: dict[int, Any] = {}
    ended: list[str] = []
    logs: list[object] = []
    parents: list[int] = []
    memory = SimpleNamespace(words={Word.SUPERVISOR: 4711}, frames="the frames")
    stand_ins = {
        "SharedMemory": lambda _: memory, "die_with_parent": parents.append, "need": lambda _: None,
        "load_machine": lambda path: path, "config_hash": lambda _: hashed, "signal": SimpleNamespace(
            SIGTERM=1, SIGINT=2, SIGHUP=3, signal=handlers.__setitem__
        ),
        "StateStore": lambda *_: nullcontext("store"), "logged_links": lambda log: nullcontext(logs.append(log)),
        "RingFrames": lambda frames: ("log of", frames),
        "Session": lambda *_, second_person: SimpleNamespace(
            run=lambda: ran.append(second_person) or 0, desk=SimpleNamespace(end=ended.append)
        ),
    }  # fmt: skip
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(process, name, stand_in)
    arguments = ["7", "a.toml", "as it was", "root", process.SECOND_PERSON]
    if hashed == "another":
        with pytest.raises(ConfigError, match="has changed since the service was started"):
            process.main(arguments)
        assert ran == []
    else:
        assert process.main(arguments) == 0
        process.main(arguments[:-1])
        assert ran == [True, False]
        assert logs == [("log of", "the frames")] * 2
        # Nobody is left behind who moves an axis that no page shows.
        assert parents == [4711] * 2
        # Whatever ends the process ends the step first.
        assert sorted(handlers) == [1, 2, 3]
        for number, handler in handlers.items():
            handler(number, None)
        assert ended == ["the service ends"] * 3


def test_the_desk_is_waited_for_when_a_commissioning_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was told between its last look and the end would be lost with it."""
    desk = Desk(None)
    made, _ = session(desk)
    listener = SimpleNamespace(
        start=lambda: desk.did.append("listens"), join=lambda _: desk.did.append("waited for")
    )
    monkeypatch.setattr(process, "threading", SimpleNamespace(Thread=lambda **_: listener))
    monkeypatch.setattr(process, "publish_json", lambda *_: None)
    monkeypatch.setattr(process, "short_hash", lambda _: "")
    for name in ("_set_up", "_keep"):
        monkeypatch.setattr(made, name, lambda: None)
    assert made.run() == 0
    assert desk.did == ["listens", "close", "waited for"]


def test_a_session_has_a_folder_for_its_report(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("Board", "Desk", "Commissioning"):
        monkeypatch.setattr(process, name, lambda *_, **__: SimpleNamespace())
    none: Any = None
    store: Any = SimpleNamespace(directory=tmp_path)
    for _ in range(2):  # the second one finds it there
        Session(none, store, none)
    assert [path.name for path in tmp_path.iterdir()] == ["commissioning_report"]


# --- the chord test as a step -----------------------------------------------------------------------------------------


class Chord:
    """Stands for the run of the axis and the attended test on it."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, folder: Path, *, complete: bool, fault: AlarmStop | None
    ) -> None:
        self.did: list[object] = []
        self.opened: list[dict[str, object]] = []
        self.path = folder / "commissioning_chord_test.json"
        session = SimpleNamespace(complete=complete, text="3 of 8 readings", instruments=("laser",))
        run = SimpleNamespace(
            power_down=lambda: self.did.append("down"),
            close=lambda what, alarm: self.did.append((what, alarm)),
        )

        def go_on() -> object:
            self.did.append(("read", self.path.exists()))
            if fault is not None:
                raise fault
            return session

        def both_named(kept: object, *, instruments: tuple[str, ...]) -> object:
            assert instruments == ("laser", "tracker")
            return kept

        stand_ins = {
            "session_path": lambda _: folder / "session.json", "order_of": lambda _: SimpleNamespace(made=lambda: None),
            "check_travel": lambda *_: None, "session_to_go_on_with": lambda *_: session,
            "replace": both_named,
            "AxisRun": lambda *_, **how: (self.opened.append(how), run)[1],
            "AttendedTest": lambda *_: SimpleNamespace(go_on=go_on),
            "store_session": lambda *_: self.did.append("stored"),
            "_judged": lambda *_: StepResult("accuracy", Outcome.PASSED, ""),
        }  # fmt: skip
        for name, stand_in in stand_ins.items():
            monkeypatch.setattr(chord_test, name, stand_in)
        halt = SimpleNamespace(stops=lambda run: nullcontext(self.did.append("may be stopped")))
        self.context: Any = SimpleNamespace(
            instrument=lambda run: SimpleNamespace(name="tracker"), store=None, machine=None, results={}, folder=folder,
            say=print, watch=SimpleNamespace(observer=lambda: "who watches", halt=halt),
        )  # fmt: skip


@pytest.mark.parametrize("before", [None, {}, {"a_deg": Figure(0.01)}])
@pytest.mark.parametrize("complete", [True, False])
def test_a_chord_test_goes_on_until_it_has_a_result_and_another_begins_anew(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, before: dict[str, Figure] | None, complete: bool
) -> None:
    chord = Chord(monkeypatch, tmp_path, complete=complete, fault=None)
    chord.path.touch()
    if before:  # the folder of the one before is there
        (tmp_path / "accuracy").mkdir()
    if before is not None:
        chord.context.results["accuracy"] = StepResult("accuracy", Outcome.FAILED, "", before)
    found = chord_test.accuracy(chord.context)
    assert found.outcome is (Outcome.PASSED if complete else Outcome.FAILED)
    ended = ["stored"] if complete else []
    assert chord.did == ["may be stopped", ("read", not before), "down", ("commissioning", None), *ended]
    # Where nothing of the one before is there any more, another one begins all the same.
    chord.path.unlink(missing_ok=True)
    chord.did.clear()
    chord_test.accuracy(chord.context)
    assert chord.did[1] == ("read", False)
    chord.opened.pop()
    # Without the record that it is for, and seen by the person.
    assert chord.opened == [{"commissioning": True, "observer": "who watches"}]


def test_a_chord_test_that_an_alarm_ends_leaves_the_axis_as_it_is(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    alarm = AlarmStop("MON-01")
    chord = Chord(monkeypatch, tmp_path, complete=True, fault=alarm)
    with pytest.raises(AlarmStop):
        chord_test.accuracy(chord.context)
    assert chord.did == ["may be stopped", ("read", False), ("commissioning", alarm)]


def test_a_chord_test_that_does_not_fit_the_travel_opens_no_axis(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def check(*_: object) -> None:
        raise UsageError("beyond the travel")

    chord = Chord(monkeypatch, tmp_path, complete=True, fault=None)
    monkeypatch.setattr(chord_test, "check_travel", check)
    with pytest.raises(UsageError, match="beyond the travel"):
        chord_test.accuracy(chord.context)
    assert chord.did == []


def test_without_an_instrument_nothing_is_measured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    chord = Chord(monkeypatch, tmp_path, complete=True, fault=None)
    chord.context.instrument = None
    assert chord_test.accuracy(chord.context).outcome is Outcome.NOT_TESTABLE
    assert chord.did == []
