"""What a person accepts by name, what nobody can accept, and the ledger in whole runs."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import STEPS, Commissioning, Outcome, StepResult, write_report
from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.virtual.personality import PERSONALITIES, Personality
from gantryctl.errors import CommandRefused, StateError, UsageError
from gantryctl.machine import Machine, load_machine, with_values
from gantryctl.operation.ledger import Proofs, Standing
from gantryctl.operation.ledger.acceptance import (
    check_acceptance,
    ledger_path,
    load_acceptances,
    proven_hash,
    store_acceptances,
)
from gantryctl.operation.ledger.inputs import SAFETY_INPUTS
from gantryctl.operation.ledger.judging import lacks, ledger
from gantryctl.operation.ledger.kept_facts import facts_path, load_facts, store_facts
from gantryctl.operation.proofs import (
    CommissioningRecord,
    bus_reasons,
    ledger_of,
    ledger_reasons,
    load_record,
    must_be_proven,
    own_ramp_deg_s2,
    read_ledger,
    record_path,
    store_record,
)
from gantryctl.operation.run import AxisRun
from gantryctl.operation.state import machine_status
from gantryctl.operation.store import StateStore
from gantryctl.program.alarms.log import from_wire, to_wire
from gantryctl.program.alarms.words import Clauses, Said, Words
from gantryctl.wiring import canopen as canopen_wiring
from gantryctl.wiring.virtual import virtual_node
from support.command_line import cli, machine_file
from support.reports import HEAD

from .ledger_bench import (
    ALL_PROVEN,
    EPOS,
    FACTS,
    REAL,
    REAL_EPOS,
    SILENT,
    VIRTUAL,
    accepted,
    changed,
    facts_of_virtual,
    put_virtual_drive,
    row_of,
    without,
)

pytestmark = pytest.mark.can


def test_an_acceptance_covers_a_lack_by_name() -> None:
    facts = facts_of_virtual(EPOS)
    row = row_of("limits_torque", facts, REAL_EPOS)
    assert (row.standing, row.acceptable) == (Standing.LACKING, True)
    rows = ledger(REAL_EPOS, facts, ALL_PROVEN, [accepted(REAL_EPOS, "limits_torque", facts)])
    (row,) = [row for row in rows if row.what == "limits_torque"]
    assert row.text == (
        "limits_torque: accepted by A. Person (the chain cuts the drive's STO; 2026-01-01, entered by user; "
        "no 6072; 385 N m set with the maker's tool, what lies above 0 N m is not shown)"
    )
    assert lacks(rows) == ()


@pytest.mark.parametrize("change", ["serial", "firmware", "parameter", "machine"])
def test_an_acceptance_dies_with_any_change(change: str) -> None:
    facts, machine = facts_of_virtual(EPOS), REAL_EPOS
    given = [accepted(machine, "limits_torque", facts)]
    assert not lacks(ledger(machine, facts, ALL_PROVEN, given))
    match change:
        case "serial":
            facts = replace(facts, serial=facts.serial + 1)
        case "firmware":
            facts = replace(facts, software="2.0")
        case "parameter":  # the rated torque, by which every torque on the bus is meant
            facts = changed(facts, o6076=300_000)
        case "machine":
            machine = with_values(machine, {"brake.close_time_ms": 151.0})
    assert [row.what for row in lacks(ledger(machine, facts, ALL_PROVEN, given))] == ["limits_torque"]


def test_speeds_and_monitors_leave_an_acceptance_as_it_is() -> None:
    machine = without("estop_ok")
    given = [accepted(machine, "estop_ok")]
    other = with_values(machine, {"speed.creep_deg_s": 0.2})
    assert lacks(ledger(other, FACTS, ALL_PROVEN, given)) == ()


def test_a_failed_proof_is_covered_by_no_acceptance() -> None:
    facts = facts_of_virtual(EPOS)
    failed = Proofs(frozenset({"silence", "sign"}), frozenset({"torque"}))
    rows = ledger(REAL_EPOS, facts, failed, [accepted(REAL_EPOS, "limits_torque", facts)])
    (row,) = [row for row in rows if row.what == "limits_torque"]
    assert (row.standing, row.acceptable) == (Standing.LACKING, False)
    assert "step torque has failed" in str(row.detail)
    with pytest.raises(CommandRefused, match="no acceptance covers it"):
        check_acceptance(rows, "limits_torque", "A", "B")


@pytest.mark.parametrize(
    ("facts", "what", "words"),
    [
        (SILENT, "stops_without_controller", "no 1400:05, no 1016:01"),
        (SILENT, "stops_without_commands", "only a watchdog outside of it"),
        (FACTS, "stops_without_controller", "commission --only silence"),
        (changed(FACTS, o6085=None), "ramps_quick_stop", "commission --only ramp"),
        (FACTS, "keeps_brake", "commission --only silence"),
        (changed(FACTS, o6072=None), "limits_torque", "torque_limit_in_drive_nm"),
        (changed(FACTS, o6502=0x45), "runs_csv", "has no CSV"),
    ],
)
def test_what_nobody_can_accept(facts: DriveFacts, what: str, words: str) -> None:
    with pytest.raises(CommandRefused, match="no acceptance covers it") as refused:
        check_acceptance(ledger(REAL, facts), what, "A", "B")
    assert words in str(refused.value)
    # Nor does one that somebody has written into the file.
    rows = ledger(REAL, facts, Proofs(), [accepted(REAL, what, facts)])
    assert [row.standing for row in rows if row.what == what] == [Standing.LACKING]


@pytest.mark.parametrize(
    ("what", "by", "because", "error", "words"),
    [
        ("mains_ready", "A", "B", CommandRefused, "has it by 60FD bit 18"),
        ("horn", "A", "B", UsageError, "the rows of this machine are estop_ok, enabling_switch"),
        ("estop_ok", "  ", "B", UsageError, "--by"),
        ("estop_ok", "A", "x" * 301, UsageError, "--because"),
        ("estop_ok", "A", "line\nbreak", UsageError, "--because"),
    ],
)
def test_what_cannot_be_accepted(
    what: str, by: str, because: str, error: type[Exception], words: str
) -> None:
    with pytest.raises(error) as refused:
        check_acceptance(ledger(without("estop_ok"), FACTS), what, by, because)
    assert words in str(refused.value)


def test_damaged_files_are_no_acceptance_and_no_facts(tmp_path: Path) -> None:
    for text in ("{", "[{}]", '[{"what": 1}]'):
        ledger_path(tmp_path, REAL).write_text(text, encoding="utf-8")
        with pytest.raises(StateError, match="remove it and accept again"):
            load_acceptances(ledger_path(tmp_path, REAL))
        facts_path(tmp_path, REAL).write_text(text, encoding="utf-8")
        with pytest.raises(StateError, match="remove it"):
            load_facts(facts_path(tmp_path, REAL))


def test_facts_and_acceptances_are_read_as_they_were_written(tmp_path: Path) -> None:
    store_facts(facts_path(tmp_path, REAL), FACTS)
    assert load_facts(facts_path(tmp_path, REAL)) == FACTS
    given = (accepted(REAL, "estop_ok"),)
    store_acceptances(ledger_path(tmp_path, REAL), given)
    assert load_acceptances(ledger_path(tmp_path, REAL)) == given


# --- whole runs -----------------------------------------------------------------------------------------------


def test_the_highest_speed_of_the_ledger_is_enforced(tmp_path: Path) -> None:
    slow = with_values(EPOS, {"can.heartbeat_alone_ms": 150.0})
    with StateStore(slow, tmp_path) as store:
        run = AxisRun(slow, store)
        try:
            assert run.speed_max_deg_s == 5.8
            assert any("not faster than 5.8 deg/s" in note for note in run.notes)
            with pytest.raises(CommandRefused, match=r"within 0.6 and 5.8 deg/s"):
                run.move(1.0, 6.0)
            with pytest.raises(CommandRefused, match=r"within 0.6 and 5.8 deg/s"):
                run.jog(True, 5.9, 0.1)
        finally:
            run.close("test")


def test_a_drive_that_watches_nothing_is_not_even_commissioned(tmp_path: Path) -> None:
    machine = with_values(VIRTUAL, {"can.virtual_drive": "e35@", "can.encoder.index": 0})
    with StateStore(machine, tmp_path) as store:
        said: list[str] = []
        work = Commissioning(machine, store, tmp_path, said.append, lambda step: True)
        with pytest.raises(
            CommandRefused, match=r"CFG-CAN-05.*stops_without_controller \(no 1400:05, no 1016:01"
        ):
            work.start(again=False)
        assert any("stops_without_commands: lacking" in line for line in said)
        with pytest.raises(CommandRefused, match="CFG-CAN-05"):
            AxisRun(machine, store, commissioning=True)


@pytest.mark.parametrize("on_bus", [True, False])
@pytest.mark.parametrize("local", [True, False])
@pytest.mark.parametrize("required", [True, False])
def test_a_drive_on_a_bus_that_is_not_virtual_must_be_proven(
    on_bus: bool, local: bool, required: bool
) -> None:
    """Unless its file says that it need not be: a drive of a test bench."""
    can = SimpleNamespace(commissioning_required=required)
    machine: Any = SimpleNamespace(on_bus=on_bus, plant_is_local=local, can=can)
    assert must_be_proven(machine) is ((on_bus, local, required) == (True, False, True))


@pytest.mark.parametrize("machine", [VIRTUAL, with_values(REAL, {"can.commissioning_required": False})])
def test_a_virtual_drive_needs_no_acceptance(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, machine: Machine
) -> None:
    put_virtual_drive(monkeypatch)
    bare = without(*SAFETY_INPUTS, machine=machine)
    assert not must_be_proven(bare)
    with StateStore(bare, tmp_path) as store:
        drive = canopen_wiring.canopen_drive(bare)
        try:
            assert bus_reasons(bare, store, drive) == ()
        finally:
            drive.close()


def test_the_command_keeps_it_and_config_show_shows_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path / "state"))
    file = machine_file(
        tmp_path / "m.toml",
        {"drive.kind": "canopen", "can.interface": "socketcan", "can.channel": "can0", "control.scan_period_ms": 4.0,
         "can.inputs.estop_ok": -1},
    )  # fmt: skip
    shown = cli("config", "show", file, "--no-derived").out
    assert "# Safety ledger" in shown
    assert "estop_ok: lacking" in shown, shown[-500:]
    who = ("--by", "A. Person", "--because", "the chain cuts STO")
    accept = ("commission", "accept", "--lack", "estop_ok", *who, "--config", file)
    # An acceptance belongs to a drive: there must have been one.
    unknown = cli(*accept)
    assert unknown.code == 2
    assert "was never set up" in unknown.err
    machine = load_machine(file)
    with StateStore(machine) as store:
        store_facts(facts_path(store.directory, machine), FACTS)
    done = cli(*accept)
    assert done.code == 0, done
    assert "estop_ok: accepted by A. Person (the chain cuts STO;" in done.out
    rows = cli("config", "show", file, "--json").json["ledger"]
    (row,) = [row for row in rows if row["what"] == "estop_ok"]
    assert (row["standing"], row["by"]) == ("accepted by", "A. Person")
    refused = cli("commission", "accept", "--lack", "limit_plus", *who, "--config", file)
    assert refused.code == 2
    assert "there is nothing to accept" in refused.err
    monkeypatch.setattr(canopen_wiring, "can_link", lambda machine: virtual_node(VIRTUAL)[0])
    shown = cli("status", "--config", file).out
    assert "ledger            estop_ok: accepted by A. Person (the chain cuts STO;" in shown, shown
    assert "ledger            keeps_brake: lacking" in shown
    assert "# Safety ledger" not in cli("config", "show", "--no-derived").out
    assert json.loads(json.dumps(rows)) == rows


def test_an_acceptance_stands_in_the_record_and_a_step_that_fails_later_takes_the_record_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = lambda machine: virtual_node(EPOS)[0]  # noqa: E731
    monkeypatch.setattr(canopen_wiring, "can_link", link)
    monkeypatch.setattr("gantryctl.commissioning.run.can_link", link)
    machine = REAL_EPOS
    with StateStore(machine, tmp_path) as store:
        work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        with pytest.raises(CommandRefused, match=r"CFG-CAN-04.*limits_torque \(no 6072; 385 N m set"):
            work.start(again=False)
        facts = load_facts(facts_path(store.directory, machine))
        assert facts is not None
        given = accepted(machine, "limits_torque", facts)
        store_acceptances(ledger_path(store.directory, machine), [given])
        work.start(again=False)
        done = {step.key: StepResult(step.key, Outcome.PASSED, "seen") for step in STEPS}
        work.progress = replace(work.progress, results=done)
        assert work.complete
        record = load_record(work.record())
        assert record is not None
        assert [text.partition(" (")[0] for text in record.accepted] == [
            "limits_torque: accepted by A. Person"
        ]
        page = write_report(work.progress, work.ledger, tmp_path, HEAD).read_text(encoding="utf-8")
        assert "A. Person" in page
        # Nothing but the proof of this boot-up is missing now.
        drive = canopen_wiring.canopen_drive(machine)
        assert [reason.code for reason in bus_reasons(machine, store, drive)] == ["CFG-CAN-03"]
        fails = replace(STEPS[0], run=lambda context: StepResult("identity", Outcome.FAILED, "seen"))
        work.do(fails)
        assert [reason.code for reason in bus_reasons(machine, store, drive)] == ["CFG-CAN-02", "CFG-CAN-03"]
        drive.close()


def test_kept_facts_are_those_of_the_last_set_up(tmp_path: Path) -> None:
    store_facts(facts_path(tmp_path, REAL), changed(FACTS, o6080=None))
    rows = {row.what: row for row in read_ledger(REAL, tmp_path)}
    assert rows["limits_speed"].standing is Standing.MADE_UP


def test_the_measured_ramp_is_the_one_that_everybody_tells(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`move`, `status`, the page, the monitors of the program and the ledger: 5.2 deg/s2, not the 5.4 of the file."""
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    monkeypatch.setitem(PERSONALITIES, "no-ramp", Personality("no-ramp", "", absent=(0x6085,)))
    machine = with_values(VIRTUAL, {"can.virtual_drive": "no-ramp"})
    set_dec = machine.virtual_axis.quick_dec_deg_s2
    record = CommissioningRecord(
        machine=machine.name, proven_hash=proven_hash(machine), drive=FACTS.key, software=FACTS.software,
        nodes=(), date="2026-01-01", by="somebody", report_hash="r", steps=("silence", "sign", "ramp"),
        accepted=(), measured={"quick_stop_dec_deg_s2": 5.2},
    )  # fmt: skip
    with StateStore(machine) as store:
        run = AxisRun(machine, store)
        assert run.quick_dec_deg_s2 == pytest.approx(set_dec)
        run.close("looked")
        store_record(record_path(store.directory, machine), record)
        run = AxisRun(machine, store)
        assert run.quick_dec_deg_s2 == pytest.approx(5.2)
        assert run.axis.settings.ramps.quick_dec_rad_s2 == pytest.approx(math.radians(5.2))
        row = next(row for row in ledger_of(machine, store, run.drive) if row.what == "ramps_quick_stop")
        # 36 / 10.4 and 60 ms at 6 deg/s.
        assert "5.20 deg/s2: 3.82 deg from 6 deg/s" in str(row.detail)
        run.close("looked")
    assert machine_status(machine).quick_dec_deg_s2 == 5.2
    # Of another configuration nothing is measured.
    other = with_values(machine, {"motor.torque_max_nm": 380.0})
    with StateStore(other) as store:
        assert own_ramp_deg_s2(other, store.directory) is None


def test_what_is_lacking_travels_as_words() -> None:
    """The page makes Chinese of it, and a file English: no sentence is among the values, and none is parsed back."""
    reason = ledger_reasons(REAL, ledger(REAL, SILENT))[0]
    assert reason.code == "CFG-CAN-05"
    wire = to_wire(reason.values)["lacks"]
    row = wire[0]
    assert (row["words"], row["values"]["what"]) == ("LEDGER_LACK", "stops_without_commands")
    cost, wanted = row["values"]["detail"]
    assert cost["words"] == "LEDGER_COST"
    (both,) = cost["values"]["objects"]
    assert {both["values"][each]["words"] for each in ("first", "second")} == {"LEDGER_NO_OBJECT"}
    assert cost["values"]["cost"] == {"words": "LEDGER_GOES_ON", "values": {}}
    assert wanted["words"] == "LEDGER_WATCHDOG_WANTED"
    restored = from_wire(wire)
    assert str(restored[0]).startswith("stops_without_commands (no 1400:05, no 1016:01: the drive goes on")


# Keys of the machine file, places of objects, names of steps, numbers and units: the same in every language.
_NO_SENTENCE = re.compile(r"[\w.\[\]:\"=, -]*")


@pytest.mark.parametrize(
    "facts", [FACTS, SILENT, replace(FACTS, objects={})], ids=["whole", "silent", "nothing"]
)
def test_no_value_of_the_ledger_is_a_sentence(facts: DriveFacts) -> None:
    def texts(value: object) -> Iterator[str]:
        match value:
            case Said():
                for each in value.values.values():
                    yield from texts(each)
            case tuple():
                for each in value:
                    yield from texts(each)
            case str() if not isinstance(value, Words):
                yield value

    for row in ledger(REAL, facts):
        # The page takes a list of words, and none in a list.
        assert not [each for each in row.detail if type(each) is Clauses]
        for text in (*texts(row.by), *texts(row.detail)):
            assert len(text.split()) <= 6, (row.what, text)
            assert _NO_SENTENCE.fullmatch(text), (row.what, text)
