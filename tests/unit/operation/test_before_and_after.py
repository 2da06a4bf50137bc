"""What a run judges before anything moves, and what it leaves behind; on the simulated machine of this process."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.ideal import IdealDrive
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.image import DriveState, LinkHealth
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation import opening, proofs
from gantryctl.operation.client import BrakeTestReport, Ending, Stop
from gantryctl.operation.home_reference import judge_reference, why_not_referenced
from gantryctl.operation.ledger.equipment import csv_row
from gantryctl.operation.ledger.judging import speed_max_deg_s
from gantryctl.operation.ledger.kept_facts import load_facts, store_facts
from gantryctl.operation.ledger.rows import LedgerRow, Standing
from gantryctl.operation.opening import left_on_failure, new_machine, open_axis
from gantryctl.operation.proofs import CommissioningRecord
from gantryctl.operation.run import AxisRun
from gantryctl.operation.run_memory import RunMemory
from gantryctl.operation.store import StateStore
from gantryctl.program import BrakeTestOutcome, BrakeTestResult, Code
from gantryctl.units import deg

MACHINE = with_values(default_machine(), {"drive.kind": "ideal"})
COUNTS_PER_DEG = 13_328_565.6  # 4 194 304 x 1144 / 360


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


@contextmanager
def kept(moved_deg: float = 0.0, **values: Any) -> Iterator[StateStore]:
    """A machine that stands at 10 deg, left `moved_deg` before that, with these values in its memory."""
    found = new_machine(MACHINE, 10.0)
    rest = found.retained.rest_position_counts
    assert rest is not None
    left = replace(found.retained, rest_position_counts=rest - round(moved_deg * COUNTS_PER_DEG), **values)
    with StateStore(MACHINE) as store:
        opening.keep_machine(MACHINE, store, found.drive, left)
        yield store


# --- before -----------------------------------------------------------------------------------------------------------


def test_the_load_is_held_with_the_torque_of_the_last_run() -> None:
    with kept(holding_torque_nm=-17.5) as store:
        opened = open_axis(MACHINE, store)
    assert opened.program.axis.holding_torque_nm == -17.5


@pytest.mark.parametrize("moved_deg", [0.01, -0.01])
def test_a_small_way_while_off_is_accepted_only_where_nothing_else_is_wrong(moved_deg: float) -> None:
    with kept(moved_deg) as store:
        opened = open_axis(MACHINE, store)
        assert any(f"moved {moved_deg:+.3f} deg while off" in note for note in opened.notes)
        assert opened.retained.alarms[-1].code == "ENC-09"
    with kept(moved_deg, error_stop="CTL-03") as store:
        opened = open_axis(MACHINE, store)
        assert not any("accepted" in note for note in opened.notes)
        assert not opened.retained.alarms


def test_a_larger_way_while_off_is_acknowledged_by_a_reset() -> None:
    found = new_machine(MACHINE, 10.0)
    rest = found.retained.rest_position_counts
    assert rest is not None
    left = replace(found.retained, rest_position_counts=rest - round(0.8 * COUNTS_PER_DEG))
    reason = why_not_referenced(judge_reference(found.scale, found.feedback.pos_act_counts, left))
    assert reason is not None
    assert reason.by_reset


def test_stops_are_those_of_a_ramp_that_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "own_ramp_deg_s2", lambda machine, directory: 3.0)
    with kept() as store:
        opened = open_axis(MACHINE, store)
    assert opened.quick_dec_deg_s2 == pytest.approx(3.0)
    assert deg(opened.program.axis.settings.ramps.quick_dec_rad_s2) == pytest.approx(3.0)


@pytest.mark.parametrize("fault", [KeyboardInterrupt, DeviceError("gone"), CommandRefused("no")])
def test_whatever_ends_an_opening_the_bus_is_left(fault: Any) -> None:
    left = []
    drive: Any = SimpleNamespace(health=lambda: "some", close=lambda: left.append(True))
    with pytest.raises(fault if isinstance(fault, type) else type(fault)), left_on_failure(drive):
        raise fault
    assert left == [True]


def test_a_drive_that_is_in_fault_is_not_switched_on(monkeypatch: pytest.MonkeyPatch) -> None:
    read = IdealDrive.read
    monkeypatch.setattr(
        IdealDrive, "read", lambda drive: read(drive)._replace(state=DriveState.FAULT, error_code=0x3210)
    )
    with pytest.raises(CommandRefused, match="DRV-15"):
        AxisRun(MACHINE)


@pytest.mark.parametrize(
    ("paced", "required", "asks"),
    [(True, True, True), (True, False, False), (False, True, False), (False, False, False)],
)
def test_a_person_is_asked_before_a_real_gantry_moves(paced: bool, required: bool, asks: bool) -> None:
    machine = SimpleNamespace(paced_by_clock=paced, can=SimpleNamespace(commissioning_required=required))
    run: Any = SimpleNamespace(machine=machine)
    assert AxisRun.must_ask.fget(run) is asks  # type: ignore[attr-defined]


@pytest.mark.parametrize(("end_deg", "forward"), [(180.0, True), (-180.0, False)])
def test_a_key_towards_the_end_at_which_the_axis_stands_switches_nothing_on(
    end_deg: float, forward: bool
) -> None:
    found = new_machine(MACHINE, end_deg)
    with StateStore(MACHINE) as store:
        opening.keep_machine(MACHINE, store, found.drive, found.retained)
        run = AxisRun(MACHINE, store)
        with pytest.raises(CommandRefused):
            run.jog(forward, 6.0, 1.0)
        assert run.axis.is_off
        assert run.engine.scan == 0
        run.close("refused")


def test_a_move_without_a_speed_is_as_fast_as_the_ledger_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "speed_max_deg_s", lambda rows: 2.0)
    run = AxisRun(MACHINE)
    assert run.move(3.0).asked_deg_s == pytest.approx(2.0)
    run.close("done")


@pytest.mark.parametrize("forward", [True, False])
def test_a_key_that_comes_after_a_request_to_stop_is_not_pressed(forward: bool) -> None:
    run = AxisRun(MACHINE)
    run.power_up()
    run.stop = Stop.RAMP
    begun_s = run.engine.time_s
    report = run.jog(forward, 6.0, 1.0)
    assert report.ending is Ending.STOPPED
    assert (report.from_s, report.to_s) == (begun_s, begun_s)
    assert run.engine.time_s == begun_s
    run.close("stopped")


@pytest.mark.parametrize("turned", [1, -1])
def test_a_modulo_axis_stands_where_it_rested_and_what_it_has_moved_since(turned: int) -> None:
    """Left 100 counts before the end of the encoder's range, found 100 behind it: 200 on, not a range back."""
    scale = new_machine(MACHINE).scale._replace(axis_turn_counts=Fraction(1))
    whole = scale.range_counts
    rest, found = (whole - 100, 100) if turned > 0 else (100, whole - 100)
    assert scale.unwrapped(found, 0, rest) == rest + turned * 200


# --- proofs -----------------------------------------------------------------------------------------------------------


def test_a_record_shows_nothing_of_another_drive_firmware_or_configuration() -> None:
    machine: Machine = default_machine()
    record = CommissioningRecord(
        machine.name, proofs.proven_hash(machine), "A", "1.0", (), "2026-01-01", "x", "", ("ramp",), (),
        {"quick_stop_dec_deg_s2": 3.0},
    )  # fmt: skip
    same: Any = SimpleNamespace(key="A", software="1.0")
    other: Any = SimpleNamespace(key="B", software="1.0")
    newer: Any = SimpleNamespace(key="A", software="1.1")
    assert proofs._recorded(machine, same, record).measured == {"quick_stop_dec_deg_s2": 3.0}
    assert not proofs._recorded(machine, other, record).measured
    assert not proofs._recorded(machine, newer, record).measured
    assert not proofs._recorded(machine, None, record).measured
    assert not proofs._recorded(machine, same, None).measured
    assert not proofs._recorded(machine, same, replace(record, proven_hash="-")).passed


# --- after ------------------------------------------------------------------------------------------------------------


def test_a_run_that_ends_in_a_brake_test_leaves_no_torque() -> None:
    run = AxisRun(with_values(default_machine(), {"control.scan_period_ms": 4.0}))
    run.engine.step()
    run._scans.command(brake_test=True)
    run.engine.run_for(2.0)
    assert run.axis.brake_test.under_way
    run.close("interrupted")
    assert run.axis.is_off
    assert not run.axis.feedback.energised


def test_a_zero_that_a_program_has_set_is_kept() -> None:
    with kept() as store:
        run = AxisRun(MACHINE, store)
        run.engine.step()
        assert run.axis.set_position(0.0) is None
        run.engine.step()
        run.close("zero")
    with StateStore(MACHINE) as store:
        after = store.load_retained()
    assert after is not None
    assert after.rest_position_counts is not None
    assert after.zero_offset_counts == pytest.approx(after.rest_position_counts, abs=2)


def test_the_torque_that_was_learned_is_kept() -> None:
    with kept(holding_torque_nm=5.0) as store:
        run = AxisRun(MACHINE, store)
        run.engine.step()
        run.axis.power.holding.mean_nm = 21.0
        run.close("done")
        after = store.load_retained()
    assert after is not None
    assert after.holding_torque_nm == 21.0


def test_a_brake_test_counts_the_power_ups_of_its_own_run() -> None:
    """12 before and 3 in this run: the next hundred begin at 15."""
    run = AxisRun(MACHINE)
    memory = RunMemory(MACHINE, run.axis, replace(run._memory.retained, power_ups=12), None)
    memory.power_ups = 3
    memory.brake_tested(BrakeTestResult(BrakeTestOutcome.PASSED, 70.0, -70.0, 0.0, None))
    assert memory.retained.brake_tested_power_ups == 15
    run.close("done")


@pytest.mark.parametrize("outcome", BrakeTestOutcome)
def test_only_a_test_that_has_passed_is_one(outcome: BrakeTestOutcome) -> None:
    due: Any = None
    report = BrakeTestReport(outcome, "", 70.0, 70.0, -70.0, 0.0, 0.02, due)
    assert report.done is (outcome is BrakeTestOutcome.PASSED)


# --- the ledger -------------------------------------------------------------------------------------------------------


def row(speed_deg_s: float | None = None, proof: str = "") -> LedgerRow:
    return LedgerRow("x", Standing.PROVEN, "", proof=proof, speed_max_deg_s=speed_deg_s)


def test_the_slowest_row_decides() -> None:
    assert speed_max_deg_s([row(3.5), row(), row(2.0)]) == 2.0
    assert speed_max_deg_s([row()]) == math.inf


@pytest.mark.parametrize("missing", [0x6040, 0x6041, 0x6060, 0x6061, 0x6064, 0x60FF])
def test_nothing_makes_up_for_an_object_that_speed_control_needs(missing: int) -> None:
    question: Any = SimpleNamespace(facts=SimpleNamespace(has=lambda index, sub=0: index != missing))
    found = csv_row(question)
    assert found.standing is Standing.LACKING
    assert f"{missing:04X}" in found.text


@pytest.mark.parametrize(("modes", "lacking"), [((1, 3, 9), False), ((1, 3), True)])
def test_a_model_whose_profile_has_no_mode_9_lacks_it(modes: tuple[int, ...], lacking: bool) -> None:
    question: Any = SimpleNamespace(
        facts=SimpleNamespace(
            has=lambda index, sub=0: True, objects={(0x6060, 0): SimpleNamespace(takes=lambda mode: True)}
        ),
        profile=SimpleNamespace(name="x", modes=modes),
        verdict=lambda place: ParameterVerdict.OK,
    )
    assert csv_row(question).lacking is lacking


def test_facts_of_an_exchanged_drive_replace_those_of_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "facts.json"
    facts = {
        (0x6064, 0): ObjectFact(False, True, 0, None, None),
        (0x1018, 0x0A): ObjectFact(True, False, 7, 0, 9),
    }
    old = DriveFacts(vendor=1, product=2, revision=3, serial=4, software="1.0", objects=facts)
    store_facts(path, old)
    store_facts(path, replace(old, serial=5))
    assert load_facts(path) == replace(old, serial=5)


@pytest.mark.parametrize(
    "change", [{"axis.over_travel_max_deg": 180.4}, {"brake.sag_max_deg": 0.019}, {"can.inverted": True}]
)
def test_proofs_are_void_where_the_axis_or_its_brake_has_changed(change: dict[str, object]) -> None:
    machine = default_machine()
    assert proofs.proven_hash(with_values(machine, change)) != proofs.proven_hash(machine)


@pytest.mark.parametrize(("step", "codes"), [("silence", [Code.CFG_CAN_03]), ("watchdog", [])])
def test_a_watch_in_the_drive_is_proven_since_its_last_restart(
    step: str, codes: list[Code], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A relay beside the drive does not change when the drive boots."""
    monkeypatch.setattr(proofs, "ledger_of", lambda *_: (row(proof=step),))
    monkeypatch.setattr(proofs, "ledger_reasons", lambda *_: ())
    monkeypatch.setattr(proofs, "must_be_proven", lambda _: True)
    monkeypatch.setattr(proofs, "why_not_commissioned", lambda *_: None)
    drive: Any = SimpleNamespace(refusals=(), health=lambda: LinkHealth("A", "1.0"))
    store: Any = SimpleNamespace(directory=tmp_path)
    assert [reason.code for reason in proofs.bus_reasons(default_machine(), store, drive)] == codes
