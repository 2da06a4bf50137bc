"""What counts as proven, by hand: whose proofs, which steps, and when the machine may move by its record."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import STEPS, Commissioning, Outcome, StepResult
from gantryctl.commissioning import run as commissioning_run
from gantryctl.commissioning.results import Figure, Progress, load_progress
from gantryctl.commissioning.run import Reach, Step, complete, steps_for, void_control_proofs
from gantryctl.commissioning.watch import Halt, StepStopped
from gantryctl.drives.canopen.setup.opening import UnusableDrive
from gantryctl.drives.od.facts import DriveFacts
from gantryctl.engineering.report.pictures import Picture
from gantryctl.errors import AlarmStop, CommandRefused, DeviceError, StateError, UsageError
from gantryctl.machine import configs_folder, load_machine, with_values
from gantryctl.machine.places import reach_deg
from gantryctl.operation.client import Stop
from gantryctl.operation.ledger import LedgerRow, Standing
from gantryctl.operation.ledger.kept_facts import facts_path, store_facts
from gantryctl.operation.ledger.rows import RAMP_DEG_S2, TORQUE_LIMIT_NM
from gantryctl.operation.proofs import load_record, record_path
from gantryctl.operation.state import operator_name
from gantryctl.operation.store import StateStore

pytestmark = pytest.mark.can

MACHINE = load_machine(configs_folder() / "hust_can.toml")
ALL_PASSED = {each.key: StepResult(each.key, Outcome.PASSED, "") for each in STEPS}
P, F, N = Outcome.PASSED, Outcome.FAILED, Outcome.NOT_TESTABLE


def step(key: str, outcome: Outcome = P, **changes: Any) -> Step:
    return Step(key, key, "", "", lambda c: StepResult(key, outcome, ""), **changes)


A, B, MAY = step("a"), step("b"), step("c", required=False)


@pytest.mark.parametrize("own", [True, False])
def test_proofs_of_another_configuration_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own: bool
) -> None:
    kept = Progress(MACHINE.name, commissioning_run.proven_hash(MACHINE) if own else "0" * 16)
    kept.results["identity"] = StepResult("identity", P, "")
    monkeypatch.setattr(commissioning_run, "load_progress", lambda path: kept)
    with StateStore(MACHINE, tmp_path) as store:
        work = Commissioning(MACHINE, store, tmp_path, lambda line: None, lambda asked: True)
        assert (list(work.progress.results), work.resumed) == ((["identity"], True) if own else ([], False))


def test_two_commissionings_that_showed_the_same_have_one_hash() -> None:
    """Whoever did it, and when; of another machine, file, drive, firmware, node, proof or figure it is another."""
    result = StepResult("ramp", P, "as it was", {"dec_deg_s2": Figure(5.4)})
    first = Progress("m", "h", "d", results={"ramp": result})

    def hash_with(**changes: Any) -> str:
        return replace(first, results={"ramp": replace(result, **changes)}).hash

    assert hash_with(seconds=7.0, axis_s=3.0, at="2026-11-20", by="eve") == first.hash
    others = [
        hash_with(outcome=F), hash_with(proof="not as it was"), hash_with(figures={"dec_deg_s2": Figure(5.3)}),
        *(replace(first, **{name: "x"}).hash for name in ("machine", "proven_hash", "drive", "software")),
        replace(first, nodes=("x",)).hash,
    ]  # fmt: skip
    assert len({first.hash, *others}) == 9


@pytest.mark.parametrize(
    ("outcomes", "whole"),
    [
        ({}, False), ({"a": P}, False), ({"b": P}, False), ({"a": P, "b": P}, True), ({"a": P, "b": N}, True),
        ({"a": P, "b": F}, False), ({"a": F, "b": P}, False), ({"a": P, "b": P, "c": F}, True),
    ],
)  # fmt: skip
def test_every_required_step_must_have_passed_or_not_be_testable(
    outcomes: dict[str, Outcome], whole: bool
) -> None:
    results = {key: StepResult(key, outcome, "") for key, outcome in outcomes.items()}
    assert complete(results, (A, B, MAY)) is whole


@pytest.mark.parametrize(
    ("standing", "needed"), [(Standing.OBJECT, False), (Standing.PROVEN, True), (Standing.MADE_UP, True)]
)
def test_a_step_for_a_lack_is_left_out_only_where_the_drive_has_the_object(
    standing: Standing, needed: bool
) -> None:
    makes_up = {each.makes_up for each in STEPS if each.makes_up}
    assert len(makes_up) == 2
    for what in makes_up:
        rows: Any = [SimpleNamespace(what=what, standing=standing)]
        found = {each.makes_up for each in steps_for(rows)}
        assert (what in found) is needed
        assert makes_up - {what} <= found


@pytest.fixture
def made(tmp_path: Path) -> Iterator[Callable[..., Commissioning]]:
    store = StateStore(MACHINE, tmp_path)
    with store:
        asked: list[str] = []

        def make(answers: Callable[[Step], bool] = lambda each: True) -> Commissioning:
            def confirm(each: Step) -> bool:
                asked.append(each.key)
                return answers(each)

            work = Commissioning(MACHINE, store, tmp_path, lambda line: None, confirm)
            work.asked = asked  # type: ignore[attr-defined]
            return work

        yield make


@pytest.mark.parametrize(
    ("drive", "keeps"),
    [
        (("key", "1.0", ("3 n",)), True), (("other", "1.0", ("3 n",)), False), (("key", "1.1", ("3 n",)), False),
        (("key", "1.0", ("3 m",)), False), (("key", "1.0", ()), False),
    ],
)  # fmt: skip
def test_proofs_are_of_one_drive_with_one_software_and_its_nodes(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch, drive: tuple[Any, ...], keeps: bool
) -> None:
    monkeypatch.setattr(commissioning_run, "known_of_model", lambda machine, facts: ())
    monkeypatch.setattr(commissioning_run, "ledger_reasons", lambda machine, rows: ())
    work = made()
    for key, software, nodes in (("key", "1.0", ("3 n",)), drive):
        found = SimpleNamespace(key=key, software=software), nodes
        monkeypatch.setattr(work, "_set_up", lambda found=found: found)
        before = dict(work.progress.results)
        work.start(again=False)
        if not before:
            work.do(A)
    assert bool(work.progress.results) is keeps
    assert (work.progress.drive, work.progress.software, work.progress.nodes) == drive
    # What the ledger refuses begins no step.
    reasons = (SimpleNamespace(text="lacks everything"),)
    monkeypatch.setattr(commissioning_run, "ledger_reasons", lambda machine, rows: reasons)
    with pytest.raises(CommandRefused, match="lacks everything"):
        work.start(again=False)


@pytest.mark.parametrize(("serial", "software", "outcome"), [(7, "1.0", P), (8, "1.0", F), (7, "1.1", F)])
def test_a_drive_that_is_exchanged_between_two_steps_passes_none(
    made: Callable[..., Commissioning], serial: int, software: str, outcome: Outcome
) -> None:
    """Or gets another firmware, while the commissioning waits: its record would name the one before."""
    work = made()
    work.progress = replace(work.progress, drive="00000001-00000002-7", software="1.0")

    def run(c: Any) -> StepResult:
        store_facts(facts_path(c.store.directory, c.machine), DriveFacts(1, 2, 3, serial, software, {}))
        return StepResult("a", P, "")

    found = work.do(replace(A, run=run))
    assert found is not None
    assert (found.outcome, work.progress.results["a"].outcome) == (outcome, outcome)
    assert outcome is P or f"the drive is now 00000001-00000002-{serial}, software {software};" in found.proof


@pytest.mark.parametrize("again", [True, False])
def test_a_commissioning_from_the_start_keeps_no_proof(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch, again: bool
) -> None:
    """The same drive with the same software."""
    work = made()
    facts = SimpleNamespace(key="key", software="1.0")
    stand_ins = {
        "can_link": lambda _: SimpleNamespace(close=lambda: None), "ledger_reasons": lambda *_: (),
        "ReadOnlyDrive": lambda *_: SimpleNamespace(rows=()), "known_of_model": lambda *_: (),
    }  # fmt: skip
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(commissioning_run, name, stand_in)
    monkeypatch.setattr(work, "_set_up", lambda: (facts, ()))
    work.progress = replace(work.progress, drive="key", software="1.0", results=ALL_PASSED)
    work.start(again=again)
    assert bool(work.progress.results) is not again


def test_a_step_gets_the_drive_as_it_was_found_and_leaves_its_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: Any = ("6085 as it came",)
    stand_ins = {
        "can_link": lambda _: SimpleNamespace(close=lambda: None), "ledger_reasons": lambda *_: (),
        "ReadOnlyDrive": lambda *_: SimpleNamespace(rows=found), "known_of_model": lambda *_: (),
    }  # fmt: skip
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(commissioning_run, name, stand_in)
    given: list[Any] = []
    picture, tracker = Picture("torque", ()), lambda run: None

    def run(c: Any) -> StepResult:
        given.append((c.as_found, c.instrument, c.certificate, c.results))
        c.watch.pictures.append(picture)
        return StepResult("b", P, "")

    with StateStore(MACHINE, tmp_path) as store:
        work = Commissioning(
            MACHINE, store, tmp_path, lambda line: None, lambda asked: True, tracker, "D-K-4711"  # type: ignore[arg-type]
        )  # fmt: skip
        monkeypatch.setattr(work, "_set_up", lambda: (SimpleNamespace(key="key", software="1.0"), ()))
        work.start(again=False)
        before = {"a": work.do(A)}
        result = work.do(Step("b", "", "", "", run))
    assert given == [(found, tracker, "D-K-4711", before)]
    assert result is not None
    assert result.pictures == (picture,)


@pytest.mark.parametrize(("limits", "fastest"), [((), math.inf), ((4.5, 2.5, None), 2.5)])
def test_a_step_goes_no_faster_than_what_the_drive_lacks_permits(
    made: Callable[..., Commissioning],
    monkeypatch: pytest.MonkeyPatch,
    limits: tuple[float | None, ...],
    fastest: float,
) -> None:
    rows = tuple(
        LedgerRow(f"row {k}", Standing.LACKING, speed_max_deg_s=each) for k, each in enumerate(limits)
    )
    monkeypatch.setattr(commissioning_run, "read_ledger", lambda *_, **__: rows)
    given: list[float] = []

    def run(c: Any) -> StepResult:
        given.append(c.speed_max_deg_s)
        return StepResult("a", P, "")

    made().do(replace(A, run=run))
    assert given == [fastest]


def test_what_is_known_and_what_is_lacking_is_told_before_any_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lacks = (SimpleNamespace(text="no watch"), SimpleNamespace(text="no limit"))
    stand_ins = {
        "can_link": lambda _: SimpleNamespace(close=lambda: None), "ledger_reasons": lambda *_: lacks,
        "ReadOnlyDrive": lambda *_: SimpleNamespace(rows=()), "known_of_model": lambda *_: ("it answers late",),
        "read_ledger": lambda *_, **__: (SimpleNamespace(text="stop: 6085", what="", standing=None),),
    }  # fmt: skip
    for name, stand_in in stand_ins.items():
        monkeypatch.setattr(commissioning_run, name, stand_in)
    said: list[str] = []
    with StateStore(MACHINE, tmp_path) as store:
        work = Commissioning(MACHINE, store, tmp_path, said.append, lambda asked: True)
        monkeypatch.setattr(work, "_set_up", lambda: (SimpleNamespace(key="key", software="1.0"), ()))
        with pytest.raises(CommandRefused, match=r"^no watch · no limit$"):
            work.start(again=False)
    assert said == ["  it answers late", "  stop: 6085"]


def test_who_agreed_to_little_is_asked_before_more(made: Callable[..., Commissioning]) -> None:
    work = made(lambda each: each.key != "far")
    near, far = step("near", reach=Reach.STANDSTILL), step("far", reach=Reach.TRAVEL)
    for each in (
        A,
        near,
        near,
        step("further", reach=Reach.NEAR),
        near,
        far,
        step("turn", reach=Reach.TRAVEL),
    ):
        result = work.do(each)
        assert (result is None) is (each is far)
    assert work.asked == ["near", "further", "far", "turn"]  # type: ignore[attr-defined]
    assert "far" not in work.progress.results


def raising(fault: Exception) -> Callable[[Any], StepResult]:
    def run(_: Any) -> StepResult:
        raise fault

    return run


def test_a_proof_that_fails_takes_the_record_away_and_a_stop_by_a_person_does_not(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch
) -> None:
    frozen: list[str] = []
    monkeypatch.setattr(commissioning_run, "freeze", lambda folder, what: frozen.append(what))
    work = made()
    record = work.record()
    assert record == record_path(work.store.directory, MACHINE)
    work.do(A)
    assert record.exists()
    stopped = Halt()
    stopped.ask(Stop.RAMP, "stopped by anna")
    # With what the drive has confirmed.
    with pytest.raises(StepStopped, match=r"^stopped by anna · torque off and brake closed$"):
        work.do(Step("a", "", "", "", raising(AlarmStop("torque off and brake closed"))), stopped)
    assert record.exists()
    assert work.progress.results["a"].outcome is P
    faults = (AlarmStop("turned"), CommandRefused("not now"), DeviceError("no answer"))
    # One that is not required shows what it shows too.
    for failing in (
        step("a", F),
        step("a", F, required=False),
        *(Step("a", "", "", "", raising(fault)) for fault in faults),
    ):
        work.record()
        result = work.do(failing)
        assert result is not None
        assert result.outcome is F
        assert not record.exists()
    # What the bus has carried is kept of each that failed.
    assert frozen == ["step-a"] * 5


def test_the_record_names_what_has_passed_and_what_it_has_measured(
    made: Callable[..., Commissioning],
) -> None:
    work = made()
    for each in (A, step("b", F), step("c", N)):
        work.do(each)
    for outcome, measured in ((F, {}), (P, {RAMP_DEG_S2: 3.0})):
        result = StepResult("ramp", outcome, "", {RAMP_DEG_S2: Figure(3.0)})
        work.do(Step("ramp", "", "", "", lambda c, result=result: result))
        record = load_record(work.record())
        assert record is not None
        assert record.measured == measured
    assert set(record.steps) == {"a", "ramp"}
    assert record.by == operator_name()
    # A step that has failed is left, and so is one that nobody has done.
    left = {each.key for each in work.left()}
    assert {"identity", "sign"} <= left
    work.do(step("identity"))
    work.do(step("sign", F))
    left = {each.key for each in work.left()}
    assert "identity" not in left
    assert "sign" in left


def test_what_cannot_be_tested_is_done_and_what_a_person_does_by_hand_is_never_left(
    made: Callable[..., Commissioning],
) -> None:
    work = made()
    assert {"wiring", "watchdog"} & {each.key for each in work.left()} == {"watchdog"}
    work.do(step("watchdog", N))
    assert "watchdog" not in {each.key for each in work.left()}
    # Asked for by its name it is run, and again.
    assert [each.key for each in work.left("wiring")] == ["wiring"]
    assert [each.key for each in work.left("watchdog")] == ["watchdog"]
    with pytest.raises(UsageError, match="the steps are identity, encoder"):
        work.left("nothing")


def test_results_are_kept_with_every_step(made: Callable[..., Commissioning]) -> None:
    """A power cut takes the step under way and no other."""
    made().do(A)
    made().do(step("b", F))
    assert {key: each.outcome for key, each in made().progress.results.items()} == {"a": P, "b": F}


def test_the_record_is_of_this_drive_and_the_ledger_of_what_has_passed(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch
) -> None:
    work, asked = made(), list[Any]()

    def read_ledger(*_: object, proofs: Any) -> tuple[()]:
        asked.append(proofs)
        return ()

    monkeypatch.setattr(commissioning_run, "read_ledger", read_ledger)
    work.progress = replace(work.progress, drive="maker 1", software="2.0", nodes=("3 n",))
    ramp = StepResult("ramp", P, "", {RAMP_DEG_S2: Figure(3.0)})
    torque = StepResult("torque", F, "", {TORQUE_LIMIT_NM: Figure(385.0)})
    for each in (A, step("b", F), step("c", N)):
        work.do(each)
    for result in (ramp, torque):
        work.do(Step(result.key, "", "", "", lambda c, result=result: result))
    record = load_record(work.record())
    assert record is not None
    assert (record.machine, record.drive, record.software, record.nodes) == (
        MACHINE.name, "maker 1", "2.0", ("3 n",)
    )  # fmt: skip
    assert record.proven_hash == commissioning_run.proven_hash(MACHINE)
    assert record.report_hash == work.progress.hash
    proofs = asked[-1]
    assert (proofs.passed, proofs.failed, proofs.measured) == (
        {"a", "ramp"}, {"b", "torque"}, {RAMP_DEG_S2: 3.0}
    )  # fmt: skip


def test_the_slow_turn_lasts_as_long_as_its_three_moves() -> None:
    """To one end, to the other and to the middle: twice the travel at 3 deg/s, and 6 s for the ramps of each move."""
    turn = next(each for each in STEPS if each.key == "turn")
    machine = with_values(MACHINE, {"virtual_axis.acc_deg_s2": 0.5})
    low, high = reach_deg(machine)
    assert turn.lasts_s(machine) == pytest.approx(2.0 * (high - low) / 3.0 + 3.0 * 6.0)


def test_how_far_each_step_may_move_the_gantry() -> None:
    """Who agrees to less is asked again before more; what moves nothing comes first, the whole travel last."""
    standing = {"silence", "watchdog", "brake", "torque", "sign"}
    near, far = {"velocity", "ring", "ramp", "loop", "stops"}, {"turn", "accuracy"}
    for each in STEPS:
        reach = (
            Reach.STANDSTILL if each.key in standing else Reach.NEAR if each.key in near
            else Reach.TRAVEL if each.key in far else Reach.NOTHING
        )  # fmt: skip
        assert each.reach is reach, each.key
        assert bool(each.could_move(MACHINE)) is (reach is not Reach.NOTHING)
    order = [each.key for each in STEPS]
    moving = [each.reach for each in STEPS if each.reach is not Reach.NOTHING]
    assert moving == sorted(moving)
    # A brake is pushed before anything turns, and the sign is known before a loop is closed.
    wanted = [
        "parameters",
        "silence",
        "brake",
        "torque",
        "sign",
        "velocity",
        "ring",
        "ramp",
        "loop",
        "stops",
        "turn",
    ]
    assert [key for key in order if key in wanted] == wanted


def test_a_machine_with_an_open_row_is_not_complete(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch
) -> None:
    work = made()
    work.progress = replace(work.progress, results=ALL_PASSED)
    for rows in ((), (SimpleNamespace(text="open"),)):
        monkeypatch.setattr(commissioning_run, "unproven", lambda ledger, rows=rows: rows)
        assert work.complete is (not rows)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"machine": 5}', '{"results": {"sign": 1}}'])
def test_damaged_results_are_told_with_what_to_do(tmp_path: Path, text: str) -> None:
    path = tmp_path / "commissioning.json"
    assert load_progress(path) is None
    path.write_text(text, encoding="utf-8")
    with pytest.raises(StateError, match="remove it to commission from the start"):
        load_progress(path)


def test_other_gains_take_away_the_record_and_every_proof_from_the_sign_on(
    made: Callable[..., Commissioning],
) -> None:
    work = made()
    work.progress = replace(work.progress, results=ALL_PASSED)
    work.do(A)
    record = work.record()
    void_control_proofs(MACHINE, work.store)
    assert not record.exists()
    kept = set(made().progress.results)
    assert {"identity", "silence", "brake", "torque"} <= kept
    assert not kept & {"sign", "velocity", "ring", "ramp", "loop", "stops", "turn", "bands"}
    # Once more, without a record.
    void_control_proofs(MACHINE, work.store)
    assert set(made().progress.results) == kept
    # And a record whose results are gone.
    work.record()
    work._path.unlink()
    void_control_proofs(MACHINE, work.store)
    assert not record.exists()


def test_a_result_has_the_time_of_the_axis_and_of_the_person(tmp_path: Path) -> None:
    """In virtual time the axis has moved for 7 s, and the person has waited 2."""
    now = [100.0]

    def run(c: Any) -> StepResult:
        c.watch.meter.advance(7.0)
        now[0] += 2.0
        return StepResult("a", P, "")

    with StateStore(MACHINE, tmp_path) as store:
        work = Commissioning(
            MACHINE, store, tmp_path, lambda line: None, lambda asked: True, now_s=lambda: now[0], by=lambda: "anna"
        )  # fmt: skip
        result = work.do(Step("a", "", "", "", run, lasts_s=lambda machine: 20.0))
    assert result is not None
    assert (result.seconds, result.axis_s, result.by) == (2.0, 7.0, "anna")
    # 7 of the 20 s that such a step takes.
    assert work.watch is not None
    assert work.watch.meter.part == pytest.approx(0.35)


def test_only_what_a_person_has_accepted_is_accepted_in_the_record(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [SimpleNamespace(text=standing.name, standing=standing) for standing in Standing]
    monkeypatch.setattr(commissioning_run, "read_ledger", lambda *_, **__: rows)
    record = load_record(made().record())
    assert record is not None
    assert record.accepted == ("ACCEPTED",)


@pytest.mark.parametrize("in_fault", [False, True])
def test_a_drive_is_left_set_up_and_off_the_bus_and_one_in_its_fault_begins_nothing(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch, in_fault: bool
) -> None:
    did: list[object] = []
    drive = SimpleNamespace(health=lambda: SimpleNamespace(node_keys=("3 n",)))
    monkeypatch.setattr(commissioning_run, "open_machine", lambda *_: SimpleNamespace(drive=drive))
    monkeypatch.setattr(commissioning_run, "leave_bus", did.append)
    fault = SimpleNamespace(text="in its fault")
    monkeypatch.setattr(commissioning_run, "why_in_fault", lambda _: fault if in_fault else None)
    monkeypatch.setattr(commissioning_run, "load_facts", lambda _: "facts")
    if in_fault:
        with pytest.raises(CommandRefused, match="in its fault"):
            made()._set_up()
    else:
        assert made()._set_up() == ("facts", ("3 n",))
    assert did == [drive]


def test_what_an_unusable_drive_has_shown_is_kept(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The ledger says what is lacking by it."""
    kept: list[object] = []

    def opens(*_: object) -> None:
        raise UnusableDrive("no 6040", facts="its facts")  # type: ignore[arg-type]

    monkeypatch.setattr(commissioning_run, "open_machine", opens)
    monkeypatch.setattr(commissioning_run, "store_facts", lambda path, facts: kept.append(facts))
    monkeypatch.setattr(commissioning_run, "load_facts", lambda _: kept[0])
    assert made()._set_up() == ("its facts", ())


def test_the_bus_is_left_by_whoever_reads_the_drive_before_it_is_set_up(
    made: Callable[..., Commissioning], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two masters on one bus: the second finds it taken."""
    closed: list[int] = []
    link = SimpleNamespace(close=lambda: closed.append(1))
    monkeypatch.setattr(commissioning_run, "can_link", lambda _: link)
    for fault in (None, DeviceError("silent")):

        def read(*_: object, fault: Exception | None = fault) -> SimpleNamespace:
            if fault is not None:
                raise fault
            return SimpleNamespace(rows=())

        monkeypatch.setattr(commissioning_run, "ReadOnlyDrive", read)
        work = made()
        monkeypatch.setattr(work, "_set_up", raising(AlarmStop("set up")).__get__(work))
        with pytest.raises((AlarmStop, DeviceError)):
            work.start(again=False)
    assert closed == [1, 1]
