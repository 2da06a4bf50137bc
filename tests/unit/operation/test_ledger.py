"""Ledger of a real machine: what is not wired or not in the drive keeps power off until a person accepts it by name."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.commissioning import STEPS, Commissioning, Outcome, StepResult, write_report
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.virtual.personality import PERSONALITIES, Personality
from gantryctl.errors import CommandRefused, StateError, UsageError
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.ledger import LedgerRow, Proofs, Standing
from gantryctl.operation.ledger.acceptance import (
    Acceptance,
    binding_of,
    check_acceptance,
    ledger_path,
    load_acceptances,
    proven_hash,
    store_acceptances,
)
from gantryctl.operation.ledger.inputs import SAFETY_INPUTS
from gantryctl.operation.ledger.judging import impossible, lacks, ledger, unproven
from gantryctl.operation.ledger.kept_facts import facts_path, load_facts, store_facts
from gantryctl.operation.ledger.rows import INCREMENTS_PER_TURN
from gantryctl.operation.opening import new_machine
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

pytestmark = pytest.mark.can

VIRTUAL = load_machine(configs_folder() / "hust_can.toml")
REAL = with_values(VIRTUAL, {"can.interface": "socketcan", "can.channel": "can0"})


def facts_of_virtual(machine: Machine = VIRTUAL) -> DriveFacts:
    """The virtual drive as the set-up of a machine leaves it."""
    drive = canopen_wiring.canopen_drive(
        with_values(machine, {"can.interface": "simulated", "can.channel": ""})
    )
    drive.close()
    return drive.facts


FACTS = facts_of_virtual()
ALL_PROVEN = Proofs(frozenset({"silence", "sign"}))


def changed(facts: DriveFacts, **objects: int | None) -> DriveFacts:
    """Other values of objects, "o6085=5"; None takes the object away."""
    table = dict(facts.objects)
    for name, value in objects.items():
        index, _, sub = name[1:].partition("_")
        place = int(index, 16), int(sub or "0")
        if value is None:
            table.pop(place, None)
        else:
            table[place] = replace(table[place], default=value, writable=False)
    return replace(facts, objects=table)


def row_of(
    what: str, facts: DriveFacts | None = FACTS, machine: Machine = REAL, proofs: Proofs = ALL_PROVEN
) -> LedgerRow:
    (row,) = [row for row in ledger(machine, facts, proofs) if row.what == what]
    return row


def without(*names: str, machine: Machine = REAL) -> Machine:
    return with_values(machine, {f"can.inputs.{name}": -1 for name in names})


def accepted(machine: Machine, what: str, facts: DriveFacts = FACTS) -> Acceptance:
    return Acceptance(
        what, "A. Person", "the chain cuts the drive's STO", "2026-01-01", "user", binding_of(machine, facts)
    )


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> None:
    """A virtual drive in the place of the real one: the machine knows nothing of it."""
    monkeypatch.setattr(canopen_wiring, "can_link", lambda machine: virtual_node(VIRTUAL)[0])
    monkeypatch.setattr("gantryctl.commissioning.run.can_link", lambda machine: virtual_node(VIRTUAL)[0])


def test_what_is_wired_has_its_object_and_nothing_lacks_on_the_shipped_machine() -> None:
    rows = {row.what: row for row in ledger(REAL, FACTS)}
    assert [rows[name].standing for name in SAFETY_INPUTS] == [Standing.OBJECT] * 6
    assert rows["estop_ok"].text == "estop_ok: has it by 60FD bit 16"
    assert rows["drive_follows_command"].by == "6041 bit 12"
    # What a drive does when nobody speaks to it is shown by the drive alone, never by a name.
    assert {row.what for row in unproven(rows.values())} == {
        "stops_without_commands", "stops_without_controller", "keeps_brake",
    }  # fmt: skip
    assert lacks(rows.values()) == impossible(rows.values()) == ()
    assert all(row.standing in (Standing.OBJECT, Standing.PROVEN) for row in ledger(REAL, FACTS, ALL_PROVEN))


def test_of_a_drive_that_nobody_has_asked_only_the_inputs_are_known() -> None:
    assert [row.what for row in ledger(REAL, None)] == [*SAFETY_INPUTS, "drive_follows_command"]


@pytest.mark.parametrize("name", SAFETY_INPUTS)
def test_each_safety_input_that_is_not_wired_keeps_power_off(bus: None, tmp_path: Path, name: str) -> None:
    machine = without(name)
    with StateStore(machine, tmp_path) as store:
        store.store_retained(new_machine(VIRTUAL).retained)  # its zero is set
        with pytest.raises(CommandRefused, match=rf"^CFG-CAN-04 · .*: {name} · Wire or set up") as refused:
            AxisRun(machine, store)
        assert "gantryctl commission accept --lack NAME --by PERSON --because TEXT" in str(refused.value)
        # Commissioning moves the machine too.
        with pytest.raises(CommandRefused, match="CFG-CAN-04"):
            AxisRun(machine, store, commissioning=True)
        work = Commissioning(machine, store, tmp_path, lambda line: None, lambda step: True)
        with pytest.raises(CommandRefused, match="CFG-CAN-04"):
            work.start(again=False)
        facts = load_facts(facts_path(store.directory, machine))
        assert facts is not None
        store_acceptances(ledger_path(store.directory, machine), (accepted(machine, name, facts),))
        work.start(again=False)
        with pytest.raises(CommandRefused, match="CFG-CAN-02"):  # the next thing that lacks: the proofs
            AxisRun(machine, store)


def test_bits_of_a_drive_without_digital_inputs_are_no_inputs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sparse = lambda machine: virtual_node(VIRTUAL, quirks=["sparse"])[0]  # noqa: E731
    monkeypatch.setattr(canopen_wiring, "can_link", sparse)
    with StateStore(REAL, tmp_path) as store:
        drive = canopen_wiring.canopen_drive(REAL)
        try:
            (reason,) = bus_reasons(REAL, store, drive, commissioning=True)
        finally:
            drive.close()
    assert reason.code == "CFG-CAN-04"
    assert str(reason.values["lacks"]) == "; ".join(
        f"{name} (the drive has no 60FD)" for name in SAFETY_INPUTS
    )


# --- acceptance -----------------------------------------------------------------------------------------------

EPOS = with_values(
    VIRTUAL,
    {"can.virtual_drive": "maxon EPOS4@", "can.encoder.index": 0, "can.velocity_unit": "r/min",
     "can.torque_limit_in_drive_nm": 385.0},
)  # fmt: skip
REAL_EPOS = with_values(EPOS, {"can.interface": "socketcan", "can.channel": "can0", "can.virtual_drive": ""})


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


_SILENT = changed(FACTS, o1016_1=None, o1400_5=None)


@pytest.mark.parametrize(
    ("facts", "what", "words"),
    [
        (_SILENT, "stops_without_controller", "no 1400:05, no 1016:01"),
        (_SILENT, "stops_without_commands", "only a watchdog outside of it"),
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


# --- a silent controller --------------------------------------------------------------------------------------


def test_a_heartbeat_alone_costs_angle_and_limits_the_speed() -> None:
    """5.4 deg/s2: 36 / 10.8 = 3.33 deg, and 6 deg/s x 150 ms = 0.90 deg: 4.23 deg, of 4 permitted.

    v^2 / 10.8 + 0.15 v = 4 has the root 5.81 deg/s, told and enforced to the tenth below.
    """
    slow = with_values(REAL, {"can.heartbeat_alone_ms": 150.0})
    row = row_of("stops_without_commands", changed(FACTS, o1400_5=None), slow)
    assert (row.standing, str(row.by)) == (Standing.MADE_UP, "1016:01, step silence")
    assert row.speed_max_deg_s == 5.8
    assert "no 1400:05" in str(row.detail)
    # 0.67 deg are left for the delay: 111 ms at 6 deg/s.
    assert (
        "150 ms, then its ramp: 4.23 deg from 6 deg/s; permitted 4 deg: not faster than 5.8 deg/s; "
        "111 ms allow 6 deg/s" in str(row.detail)
    )
    # 100 ms, the default where the heartbeat is alone: 3.93 deg.
    row = row_of("stops_without_controller", changed(FACTS, o1400_5=None, o1016_1=127 << 16 | 100))
    assert (row.standing, row.speed_max_deg_s) == (Standing.PROVEN, None)
    assert "100 ms, then its ramp: 3.93 deg" in str(row.detail)


def test_a_drive_that_watches_the_heartbeat_alone_gets_the_shorter_time_where_it_takes_it() -> None:
    """EPOS4 has no 1400:05. Set up, it holds 100 ms; one that takes at least 120 ms keeps the 150 of both watches."""
    assert facts_of_virtual(EPOS).value(0x1016, 1) == 127 << 16 | 100
    assert FACTS.value(0x1016, 1) == 127 << 16 | 150
    least = dict(changed(FACTS, o1400_5=None).objects)
    least[0x1016, 1] = replace(least[0x1016, 1], low=127 << 16 | 120, default=0)
    row = row_of("stops_without_controller", canopen_wiring.set_up_facts(REAL, replace(FACTS, objects=least)))
    assert row.speed_max_deg_s == 5.8


def test_a_deadline_alone_stops_the_axis_of_a_dead_controller() -> None:
    """6 deg/s x 50 ms + 3.33 deg = 3.63 deg."""
    row = row_of("stops_without_controller", changed(FACTS, o1016_1=None))
    assert (row.standing, str(row.by)) == (Standing.MADE_UP, "1400:05, step silence")
    assert "no 1016:01" in str(row.detail)
    assert "3.63 deg from 6 deg/s" in str(row.detail)
    assert row.speed_max_deg_s is None


def test_a_watchdog_stops_the_axis_of_a_drive_that_watches_nothing() -> None:
    """A contact in the emergency-stop chain: 80 ms at 6 deg/s are 0.48 deg, then torque off and brake.

    It closes in 150 ms, in which the check moment (1.08 deg/s2) drives: 0.91 deg to 6.16 deg/s, and from there at
    8.80 deg/s2: 2.16 deg. 3.55 deg in all.
    """
    what = "stops_without_controller"
    row = row_of(what, _SILENT)
    assert (row.standing, row.proof, row.acceptable) == (Standing.LACKING, "", False)
    fitted = with_values(REAL, {"can.io.node": 9, "can.io.outputs.watchdog": 3})
    row = row_of(what, _SILENT, fitted, Proofs())
    assert (row.standing, row.proof, row.acceptable) == (Standing.LACKING, "watchdog", False)
    assert "the watchdog relay at 6200 bit 3 of node 9 is to be proven; 100 ms" in str(row.detail)
    proven = Proofs(frozenset({"sign", "watchdog"}), measured={"silent_stop_s": 0.08})
    row = row_of(what, _SILENT, fitted, proven)
    assert (row.standing, str(row.by)) == (
        Standing.MADE_UP, "the watchdog relay at 6200 bit 3 of node 9, step watchdog",
    )  # fmt: skip
    assert "80 ms, then torque off and brake: 3.55 deg from 6 deg/s" in str(row.detail)
    assert str(row_of("keeps_brake", _SILENT, fitted, proven).by) == "step watchdog"
    failed = Proofs(frozenset({"sign"}), frozenset({"watchdog"}))
    assert "step watchdog has failed" in str(row_of(what, _SILENT, fitted, failed).detail)


def test_a_node_that_takes_the_enable_off_is_a_watchdog() -> None:
    """Before it is proven its heartbeat time counts: 150 ms at 6 deg/s and the way of above, 3.97 deg in all."""
    fitted = with_values(REAL, {"can.io.node": 9, "can.io.outputs.drive_enable": 3})
    row = row_of("stops_without_controller", _SILENT, fitted, Proofs())
    assert (row.standing, row.proof, row.acceptable) == (Standing.LACKING, "watchdog", False)
    assert "the enable relay at 6200 bit 3 of node 9 (1016, 6206, 6207) is to be proven; 150 ms" in str(
        row.detail
    )
    assert "3.97 deg from 6 deg/s" in str(row.detail)
    proven = Proofs(frozenset({"sign", "watchdog"}), measured={"silent_stop_s": 0.05})
    row = row_of("stops_without_commands", _SILENT, fitted, proven)
    assert str(row.by) == "the enable relay at 6200 bit 3 of node 9 (1016, 6206, 6207), step watchdog"
    assert "50 ms, then torque off and brake: 3.37 deg from 6 deg/s" in str(row.detail)


def test_a_failed_silence_is_lacking() -> None:
    failed = Proofs(frozenset({"sign"}), frozenset({"silence"}))
    for what in ("stops_without_commands", "stops_without_controller", "keeps_brake"):
        assert row_of(what, proofs=failed).text == f"{what}: lacking (step silence has failed)"


# --- limits and ramp ------------------------------------------------------------------------------------------


def test_a_torque_limit_of_the_makers_tool_is_shown_by_a_pulse() -> None:
    facts = changed(FACTS, o6072=None)
    entered = with_values(REAL, {"can.torque_limit_in_drive_nm": 385.0})
    assert not row_of("limits_torque", facts).acceptable
    shown = Proofs(frozenset({"silence", "sign", "torque"}), measured={"torque_limit_nm": 200.0})
    assert "what lies above 200 N m is not shown" in str(
        row_of("limits_torque", facts, entered, shown).detail
    )
    whole = Proofs(frozenset({"silence", "sign", "torque"}), measured={"torque_limit_nm": 385.0})
    assert row_of("limits_torque", facts, entered, whole).standing is Standing.PROVEN


def test_a_torque_limit_that_stays_lower_makes_the_stops_wrong() -> None:
    row = row_of("limits_torque", changed(FACTS, o6072=1000))
    assert (row.standing, row.acceptable) == (Standing.LACKING, False)
    assert "6072 stays 1000, wanted 1498" in str(row.detail)  # 385 of 257 N m


def test_a_measured_ramp_goes_into_the_stops() -> None:
    """4 deg/s2: 36 / 8 = 4.5 deg and 0.36 deg in 60 ms; v^2 / 8 + 0.06 v = 4 at 5.42 deg/s."""
    facts = changed(FACTS, o6085=None)
    row = row_of("ramps_quick_stop", facts)
    assert (row.standing, row.proof) == (Standing.LACKING, "ramp")
    measured = Proofs(frozenset({"silence", "sign", "ramp"}), measured={"quick_stop_dec_deg_s2": 4.0})
    row = row_of("ramps_quick_stop", facts, proofs=measured)
    assert (row.standing, str(row.by), row.speed_max_deg_s) == (Standing.PROVEN, "step ramp", 5.4)
    assert "4.86 deg from 6 deg/s" in str(row.detail)
    # The silence of the controller ends with the same ramp: 4.5 + 0.3 deg.
    assert "4.80 deg from 6 deg/s" in str(row_of("stops_without_controller", facts, proofs=measured).detail)


def test_what_is_read_only_is_judged_by_its_value() -> None:
    right = changed(FACTS, o605A=2, o605C=1, o605D=1, o605E=2)
    assert all(row.standing in (Standing.OBJECT, Standing.PROVEN) for row in ledger(REAL, right, ALL_PROVEN))
    # Held instead of switched off after the ramp: the ramp is the same.
    assert row_of("ramps_quick_stop", changed(FACTS, o605A=6)).standing is Standing.OBJECT
    assert row_of("ramps_quick_stop", changed(FACTS, o605A=0)).standing is Standing.LACKING
    # A fault without a ramp: 0.3 deg in 50 ms, then torque off and brake.
    assert "torque off and brake" in str(row_of("stops_without_controller", changed(FACTS, o605E=0)).detail)
    # 605B is asked for nothing.
    assert ledger(REAL, changed(FACTS, o605B=0), ALL_PROVEN) == ledger(REAL, FACTS, ALL_PROVEN)


def test_nobody_commands_the_brake_without_60fe() -> None:
    owner = with_values(REAL, {"brake.owner": "object_60FE"})
    assert str(row_of("keeps_brake", machine=owner).by) == "60FE:01"
    row = row_of("keeps_brake", changed(FACTS, o60FE_1=None), owner)
    assert (row.standing, row.acceptable, row.proof) == (Standing.LACKING, False, "")


def test_scales_that_contradict_the_machine_are_lacking() -> None:
    assert row_of("knows_counts", changed(FACTS, o608F_1=65536)).standing is Standing.LACKING
    assert row_of("knows_speed_unit", changed(FACTS, o60A9=0x00B4_4700)).standing is Standing.LACKING
    # Missing, they are shown by a short motion.
    no_608f, shown = (
        changed(FACTS, o608F_1=None),
        replace(ALL_PROVEN, measured={INCREMENTS_PER_TURN: 524288.0}),
    )
    assert str(row_of("knows_counts", no_608f, proofs=shown).by) == "step sign"
    in_turns = with_values(REAL, {"can.velocity_unit": "0.1 r/min"})
    assert str(row_of("knows_counts", no_608f, in_turns).by) == "step sign"
    # Position and speed in the same increments agree whatever their number in a turn is.
    row = row_of("knows_counts", no_608f)
    assert (row.standing, row.acceptable, row.proof) == (Standing.LACKING, True, "")
    assert row_of("knows_counts", changed(FACTS, o608F_1=None), proofs=Proofs()).proof == "sign"


def test_what_makes_up_for_a_lack_says_its_cost() -> None:
    # 20 ms, and 0.5 deg/s at 10.59 deg/s2 (torque limit and check moment on the rigid machine) are 47 ms.
    row = row_of("drive_follows_command", machine=with_values(REAL, {"can.follows_bit": False}))
    assert (row.standing, row.by) == (Standing.MADE_UP, "velocity_deviation_deg_s")
    assert str(row.detail) == "seen after 67 ms instead of 4 ms"
    # From 6 to 6.6 deg/s at 10.59 deg/s2 are 57 ms, and 20 ms of the monitor; in 24 ms it gains 0.25 deg/s more.
    row = row_of("limits_speed", changed(FACTS, o6080=None))
    assert row.text == (
        "limits_speed: made up for by overspeed_trip_deg_s (no 6080; seen after 77 ms at 6.9 deg/s)"
    )


def test_fixed_telegrams_are_no_csv_axis() -> None:
    fixed = dict(FACTS.objects)
    fixed[0x1600, 0] = replace(fixed[0x1600, 0], writable=False)
    row = row_of("maps_telegrams", replace(FACTS, objects=fixed))
    assert "1600:00 cannot be written" in str(row.detail)
    assert (row.standing, row.acceptable, row.proof) == (Standing.LACKING, False, "")
    event = {**FACTS.objects, (0x1400, 2): ObjectFact(False, False, 255)}
    assert "acts when it arrives" in str(row_of("maps_telegrams", replace(FACTS, objects=event)).detail)


# --- whole runs -----------------------------------------------------------------------------------------------


def test_the_highest_speed_of_the_ledger_is_enforced(tmp_path: Path) -> None:
    slow = with_values(EPOS, {"can.heartbeat_alone_ms": 150.0})
    with StateStore(slow, tmp_path) as store:
        run = AxisRun(slow, store)
        try:
            assert run.speed_max_deg_s == 5.8
            assert any("not faster than 5.8 deg/s" in note for note in run.notes)
            with pytest.raises(CommandRefused, match=r"within 0.60 and 5.80 deg/s"):
                run.move(1.0, 6.0)
            with pytest.raises(CommandRefused, match=r"within 0.60 and 5.80 deg/s"):
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


@pytest.mark.parametrize("machine", [VIRTUAL, with_values(REAL, {"can.commissioning_required": False})])
def test_a_virtual_drive_needs_no_acceptance(bus: None, tmp_path: Path, machine: Machine) -> None:
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
        page = write_report(work.progress, work.ledger, tmp_path).read_text(encoding="utf-8")
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
    reason = ledger_reasons(REAL, ledger(REAL, _SILENT))[0]
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
    "facts", [FACTS, _SILENT, replace(FACTS, objects={})], ids=["whole", "silent", "nothing"]
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
