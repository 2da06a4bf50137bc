"""Ways of an operation that hardly any run takes: each once, with what must follow."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.errors import AlarmStop, DeviceError, UsageError
from gantryctl.image import DriveState, LinkHealth, OperatorCommand
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation import bus_log, opening, proofs, state
from gantryctl.operation import run as run_module
from gantryctl.operation.beside import begin
from gantryctl.operation.bus_log import AlarmFrames
from gantryctl.operation.client import Ending, Stop
from gantryctl.operation.ledger import LedgerRow, Proofs, Standing
from gantryctl.operation.opening import keep_machine, new_machine, set_up_again
from gantryctl.operation.run import AxisRun
from gantryctl.operation.run_memory import RunMemory
from gantryctl.operation.state import machine_status, reset_simulation
from gantryctl.operation.store import SERVICE_SOCKET, StateStore
from gantryctl.operation.summary import summarise
from gantryctl.program import AlarmLog, Axis, Code
from gantryctl.program.alarms.words import Clauses, Words
from gantryctl.runtime import Retained
from gantryctl.trace.frames.files import read_frames
from gantryctl.trace.table import Trace
from gantryctl.units import rad
from gantryctl.wiring.program import axis_settings
from support.modulo_machine import modulo_machine

from .ledger_bench import FACTS, REAL, VIRTUAL, changed, row_of

MACHINE = default_machine()
IDEAL = with_values(MACHINE, {"drive.kind": "ideal"})
REAL_BUS = {"can.interface": "socketcan", "can.channel": "can0"}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


# --- the ledger of a drive --------------------------------------------------------------------------------------------


def test_a_drive_that_does_not_take_the_mode_runs_no_csv() -> None:
    facts = replace(FACTS, objects={**FACTS.objects, (0x6060, 0): replace(FACTS.objects[0x6060, 0], high=8)})
    row = row_of("runs_csv", facts)
    assert (row.standing, row.acceptable, row.proof) == (Standing.LACKING, False, "")


@pytest.mark.parametrize(
    ("objects", "standing"),
    [
        ({"o1800_2": 255}, Standing.LACKING),
        ({"o1800_2": 1}, Standing.OBJECT),
        ({"o1400_2": 255}, Standing.OBJECT),
        ({"o1400_2": 254}, Standing.OBJECT),
        ({"o1400_2": 100}, Standing.LACKING),
        ({"o1400_2": 0}, Standing.LACKING),
        ({"o1400_2": 1}, Standing.OBJECT),
        ({"o1400_2": 2}, Standing.LACKING),
    ],
)
def test_fixed_telegrams_are_answered_at_each_sync(objects: dict[str, int], standing: Standing) -> None:
    assert row_of("maps_telegrams", changed(FACTS, **objects)).standing is standing


def test_a_motion_that_was_tried_and_did_not_show_the_scale_is_told_as_that() -> None:
    failed = Proofs(frozenset({"silence"}), frozenset({"sign"}))
    row = row_of("knows_speed_unit", changed(FACTS, o60A9=None), proofs=failed)
    assert (row.standing, row.proof) == (Standing.LACKING, "sign")
    assert "step sign has failed" in row.text


def test_a_ramp_that_was_tried_and_failed_is_told_as_that() -> None:
    failed = Proofs(frozenset({"silence", "sign"}), frozenset({"ramp"}))
    row = row_of("ramps_quick_stop", changed(FACTS, o6085=None), proofs=failed)
    assert "step ramp has failed" in row.text


@pytest.mark.parametrize(("ceiling_r_min", "standing"), [(1140, Standing.LACKING), (1148, Standing.MADE_UP)])
def test_a_ceiling_that_stays_below_the_highest_speed_is_lacking(
    ceiling_r_min: int, standing: Standing
) -> None:
    """6 deg/s at the gantry are 1144 r/min of the motor."""
    assert row_of("limits_speed", changed(FACTS, o6080=ceiling_r_min)).standing is standing


def test_an_optional_object_that_holds_another_value_for_good_has_its_consequence() -> None:
    row = row_of("shows_its_life", changed(FACTS, o1017=7777))
    assert row.standing is Standing.MADE_UP


# --- proofs -----------------------------------------------------------------------------------------------------------


class Drive:
    """An open drive on a bus, as far as proofs ask it."""

    refusals: tuple[str, ...] = ()
    facts = FACTS
    lost = False

    def __init__(self, **values: object) -> None:
        vars(self).update(values)

    def health(self) -> LinkHealth:
        return LinkHealth("A", scans=5)


def test_a_drive_that_refused_a_parameter_keeps_power_off() -> None:
    (reason,) = proofs.bus_reasons(REAL, None, Drive(refusals=("6085: 5 wanted, 4 kept", "x")))  # type: ignore[arg-type]
    assert reason.code is Code.CFG_CAN_01
    assert "6085: 5 wanted, 4 kept; x" in reason.text


@pytest.mark.parametrize(
    ("machine", "kept", "commissioning", "codes"),
    [
        (REAL, True, False, [Code.CFG_CAN_02]),
        (REAL, True, True, []),
        (REAL, False, False, []),
        (VIRTUAL, True, False, []),
    ],
)
def test_a_record_is_asked_of_a_real_drive_that_is_not_being_commissioned(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    machine: Machine,
    kept: bool,
    commissioning: bool,
    codes: list[Code],
) -> None:
    """Nothing of the drive is lacking; without a directory there is no run that could have left a record."""
    monkeypatch.setattr(proofs, "ledger_of", lambda *_: ())
    store: Any = SimpleNamespace(directory=tmp_path) if kept else None
    options = {"commissioning": True} if commissioning else {}
    found = proofs.bus_reasons(machine, store, Drive(), **options)  # type: ignore[arg-type]
    assert [reason.code for reason in found] == codes


@pytest.mark.parametrize(("fastest", "codes"), [(0.59, [Code.CFG_CAN_05]), (0.61, [])])
def test_a_drive_that_may_only_be_slower_than_the_lowest_setting_keeps_power_off(
    fastest: float, codes: list[Code]
) -> None:
    row = LedgerRow("ramps_quick_stop", Standing.PROVEN, "step ramp", Clauses(()), "ramp", False, fastest)
    assert [reason.code for reason in proofs.ledger_reasons(REAL, (row,))] == codes


def test_steps_that_are_missing_are_named_once_each() -> None:
    record = proofs.CommissioningRecord(
        REAL.name, proofs.proven_hash(REAL), "A", "1", (), "2026-01-01", "x", "", (), (), {}
    )
    rows = tuple(
        LedgerRow(what, Standing.LACKING, "", Clauses((Words.LEDGER_MOTION_TO_SHOW,)), step)
        for what, step in (("a", "sign"), ("b", "silence"), ("c", "sign"))
    )
    why = proofs.why_not_commissioned(REAL, record, LinkHealth("A", "1"), rows)
    assert why is not None
    assert "sign, silence" in str(why)


# --- opening and keeping ----------------------------------------------------------------------------------------------


def test_without_a_zero_the_axis_counts_from_where_it_stands() -> None:
    found = new_machine(MACHINE, 20.0)
    lost = found._replace(retained=replace(found.retained, zero_offset_counts=None))
    assert opening._zero_counts(lost) == found.feedback.pos_act_counts


@pytest.mark.parametrize("lost", [True, False])
def test_a_drive_that_was_lost_is_set_up_again_between_two_scans(lost: bool) -> None:
    done: list[str] = []
    drive = SimpleNamespace(lost=lost, set_up_again=lambda: done.append("set up"))
    engine: Any = SimpleNamespace(drive=drive, between_scans=lambda work: (done.append("between"), work()))
    assert set_up_again(engine) is lost
    assert done == (["between", "set up"] if lost else [])


@pytest.mark.parametrize(
    ("machine", "scans", "kept"),
    [(MACHINE, 5, ["memory", "plant", "bus"]), (REAL, 5, ["memory", "bus"]), (REAL, 0, ["memory"])],
)
def test_the_memory_is_kept_first_and_a_plant_only_where_there_is_one(
    machine: Machine, scans: int, kept: list[str]
) -> None:
    done: list[str] = []
    store: Any = SimpleNamespace(
        store_retained=lambda _: done.append("memory"),
        store_plant=lambda _: done.append("plant"),
        store_bus=lambda _: done.append("bus"),
    )
    drive: Any = SimpleNamespace(plant_state=dict, health=lambda: LinkHealth("A", scans=scans))
    keep_machine(machine, store, drive, Retained(machine=machine.name, config_hash=""))
    assert done == kept
    keep_machine(machine, None, drive, Retained(machine=machine.name, config_hash=""))
    assert done == kept


def test_a_run_on_a_bus_keeps_where_it_rests_while_it_stands() -> None:
    axis = Axis(axis_settings(REAL), 0.0)
    kept: list[Retained] = []
    store: Any = SimpleNamespace(store_retained=kept.append)
    memory = RunMemory(REAL, axis, Retained(machine=REAL.name, config_hash="", zero_offset_counts=5), store)
    memory.rest_keeper(1_000_007, 1_000_000)()
    assert [(each.rest_position_counts, each.zero_offset_counts) for each in kept] == [(7, 5)]
    RunMemory(MACHINE, axis, kept[0], store).rest_keeper(3, 1_000_000)()
    RunMemory(REAL, axis, kept[0], None).rest_keeper(3, 1_000_000)()
    assert len(kept) == 1, "a plant of this process comes back where it was; without a store nothing is kept"


def test_a_modulo_axis_keeps_its_zero_with_its_rest() -> None:
    turning = with_values(
        modulo_machine(), {"drive.kind": "canopen", "control.scan_period_ms": 4.0, **REAL_BUS}
    )
    axis = Axis(axis_settings(turning), 1000.0)
    assert axis.turns is not None
    kept: list[Retained] = []
    store: Any = SimpleNamespace(store_retained=kept.append)
    RunMemory(turning, axis, Retained(machine=turning.name, config_hash=""), store).rest_keeper(5000, 2**30)()
    zero = kept[0].zero_offset_counts
    assert zero is not None
    turn = axis.turns.turn_counts
    assert (5000 - 1000 - (5000 - zero)) % turn == 0


def test_a_second_user_of_a_machine_of_the_service_is_told_of_the_service(folder: Path) -> None:
    store = StateStore(MACHINE)
    assert "wait for it" in store._advice()
    (store.directory / SERVICE_SOCKET).touch()
    assert "--service" in store._advice()


# --- status -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "elsewhere", [DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.SWITCHED_ON]
)
def test_a_drive_that_another_controller_runs_is_told_as_that(
    elsewhere: DriveState, monkeypatch: pytest.MonkeyPatch
) -> None:
    reset_simulation(MACHINE, 10.0)
    real = opening.open_machine

    def enabled(*given: Any, **named: Any) -> Any:
        found = real(*given, **named)
        return found._replace(feedback=found.feedback._replace(state=elsewhere))

    monkeypatch.setattr(opening, "open_machine", enabled)
    runs = elsewhere is not DriveState.SWITCHED_ON
    assert ("another controller runs it" in machine_status(MACHINE).condition) is runs


def test_a_drive_that_cannot_be_reached_of_a_machine_without_a_memory_is_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def unreachable(*_: object) -> object:
        raise DeviceError("node 1 does not answer")

    monkeypatch.setattr(state, "read_only", unreachable)
    with pytest.raises(DeviceError, match="does not answer"):
        machine_status(REAL)
    with StateStore(REAL) as store:
        store.store_retained(Retained(machine=REAL.name, config_hash="", moves=7))
    shown = machine_status(REAL)
    assert (shown.condition, shown.angle_deg, shown.moves) == ("the drive cannot be reached", None, 7)


def test_nothing_simulated_is_reset_of_a_machine_on_a_bus() -> None:
    with pytest.raises(UsageError, match="on a bus"):
        reset_simulation(REAL, None)


# --- runs -------------------------------------------------------------------------------------------------------------


def test_a_linear_axis_moves_by_a_way_from_where_it_is() -> None:
    run = AxisRun(IDEAL)
    run.move(3.0, 6.0)
    report = run.move_by(-5.0, 6.0)
    assert report.ending is Ending.DONE
    assert report.end_deg == pytest.approx(-2.0, abs=0.005)
    run.close("done")


@pytest.mark.parametrize("paced", [True, False])
def test_only_a_run_that_is_paced_by_the_clock_asks_for_its_time(
    paced: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[str] = []

    @contextmanager
    def keeps_time() -> Iterator[None]:
        held.append("begun")
        yield
        held.append("ended")

    monkeypatch.setattr(Machine, "paced_by_clock", property(lambda _: paced))
    monkeypatch.setattr(run_module, "keeps_time", keeps_time)
    run = AxisRun(IDEAL)
    assert held == (["begun"] if paced else [])
    run.close("done")
    assert held == (["begun", "ended"] if paced else [])


def test_work_beside_the_scan_ends_with_its_result_or_with_the_operator() -> None:
    run = AxisRun(IDEAL, real_time=True)
    run.power_up()
    assert run.while_standing(lambda: 7) == 7
    run.stop = Stop.RAMP
    assert run.while_standing(lambda: 8, finish=True) == 8
    run.close("done")


def test_in_virtual_time_nothing_passes_while_a_person_works() -> None:
    """The work is done between two scans, not beside them."""
    run = AxisRun(IDEAL)
    run.power_up()
    scans = run.engine.scan
    assert run.while_standing(threading.get_ident) == threading.get_ident()
    assert run.engine.scan == scans
    run.close("done")


def test_a_recording_of_a_run_that_was_refused_is_closed() -> None:
    """Before anything was switched on: not a scan is made."""
    closed = list[str]()
    recorder = SimpleNamespace(record=None, close=lambda: closed.append("recording"))
    run = AxisRun(IDEAL, recorder=lambda columns: recorder)  # type: ignore[arg-type, return-value]
    run.close("refused")
    assert (run.engine.scan, closed) == (0, ["recording"])


@pytest.mark.parametrize("finish", [True, False])
@pytest.mark.parametrize("comes", ["stop", "alarm", "nothing"])
def test_only_work_that_must_end_is_waited_for_whatever_comes(
    comes: str, finish: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What comes comes in the third scan, the end of the work in the tenth."""
    run, release = AxisRun(IDEAL, real_time=True), threading.Event()

    def poll(_: float) -> OperatorCommand:
        if run.engine.scan == 3 and comes == "stop":
            run.stop = Stop.RAMP
        if run.engine.scan == 3 and comes == "alarm":
            run.axis.alarms.raise_(Code.CTL_02, measured="a test")
        if run.engine.scan == 10:
            release.set()
        return run.operator.command

    monkeypatch.setattr(run.operator, "poll", poll)
    ended, options = finish or comes == "nothing", {"finish": True} if finish else {}
    if comes == "alarm":
        with pytest.raises(AlarmStop, match="CTL-02"):
            run.while_standing(lambda: release.wait(9.0), **options)
    else:
        assert run.while_standing(lambda: release.wait(9.0), **options) is (True if ended else None)
    assert release.is_set() is ended
    release.set()
    run.close("done")


@pytest.mark.parametrize("side", [True, False])
def test_the_frames_around_alarms_are_kept_and_not_those_around_notes(
    side: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    kept: list[tuple[str, float]] = []
    monkeypatch.setattr(bus_log, "freeze", lambda _, code, ago_s: kept.append((code, ago_s)))
    alarms = AlarmLog()
    frames = AlarmFrames(alarms, tmp_path if side else None)
    frames.look(1.0)
    alarms.time_s = 2.0
    alarms.raise_(Code.CTL_02, measured="a test")
    alarms.note(Code.INT_05, measured=2.0, limit=1.0)
    alarms.raise_(Code.ENC_06)
    frames.look(2.5)
    frames.look(2.6)
    assert kept == ([("CTL-02", 0.5), ("ENC-06", 0.5)] if side else [])


def test_the_frames_around_an_alarm_are_frozen_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    kept: list[tuple[str, float]] = []
    monkeypatch.setattr(bus_log, "freeze", lambda _, code, ago_s: kept.append((code, ago_s)))
    alarms = AlarmLog()
    frames = AlarmFrames(alarms, tmp_path)
    for time_s, code in ((1.0, Code.CTL_02), (2.0, Code.ENC_06)):
        alarms.time_s = time_s
        alarms.raise_(code, measured="a test")
        frames.look(time_s + 0.25)
    assert kept == [("CTL-02", 0.25), ("ENC-06", 0.25)]


def test_a_failure_beside_the_scan_is_raised_where_its_result_is_taken() -> None:
    def fails() -> int:
        raise DeviceError("the instrument is gone")

    with pytest.raises(DeviceError, match="instrument is gone"):
        begin(fails).result(9.0)
    assert begin(lambda: 7).result(9.0) == 7


@pytest.mark.parametrize("fails", [True, False])
def test_a_log_of_the_bus_is_finished_whatever_ends_it(fails: bool, tmp_path: Path) -> None:
    file = tmp_path / "bus.log"
    with suppress(KeyboardInterrupt), bus_log.logged_bus(file) as recorder:
        take = recorder.link("can0", virtual=False)
        take(1.0, 0x182, b"12", False)
        if fails:
            raise KeyboardInterrupt
    assert [frame.data for frame in read_frames(file)] == [b"12"]


def test_the_frames_before_an_alarm_are_kept_where_there_is_a_log(tmp_path: Path) -> None:
    bus_log.freeze(tmp_path, "CAN-03")
    assert list(tmp_path.iterdir()) == []
    with bus_log.logged_bus(None) as recorder:
        recorder.link("can0", virtual=False)(1.0, 0x182, b"12", False)
        bus_log.freeze(tmp_path, "CAN-03")
    (kept,) = recorder.frozen
    assert (kept.parent, "CAN-03" in kept.name) == (tmp_path, True)
    assert [frame.data for frame in read_frames(kept)] == [b"12"]


def test_the_last_frames_around_an_alarm_are_the_newest_of_all_machines(folder: Path) -> None:
    with pytest.raises(UsageError, match="no frames around an alarm"):
        bus_log.last_frozen()
    made = []
    for name, age_s in (("a", 300), ("b", 100), ("c", 200)):
        (folder / name / "traces").mkdir(parents=True)
        made.append(bus_log.frozen_path(folder / name / "traces", "CAN-03"))
        made[-1].touch()
        os.utime(made[-1], (10_000 - age_s,) * 2)
    assert bus_log.last_frozen() == made[1]


def test_only_a_drive_on_a_bus_has_a_health_to_tell() -> None:
    health = LinkHealth("A", scans=5)
    assert opening.bus_lines(Drive(health=lambda: health)) == health.lines() != ()  # type: ignore[arg-type]
    assert opening.bus_lines(Drive(health=lambda: None)) == ()  # type: ignore[arg-type]


def test_a_motion_of_a_real_drive_is_summed_up_by_its_motor_alone() -> None:
    """Without the truth of a simulator: 0.5 s from 10 to 12 deg, 0.01 deg behind, 0.1 deg/s too slow."""
    columns = (
        "time_s",
        "pos_ref_rad",
        "vel_ref_rad_s",
        "pos_act_rad",
        "vel_act_rad_s",
        "pos_err_rad",
        "torque_act_nm",
    )
    rows = np.array([
        (0.0, rad(10.0), 0.0, rad(10.0), 0.0, 0.0, -3.0),
        (0.1, rad(10.5), rad(4.0), rad(10.49), rad(3.9), rad(0.01), -20.0),
        (0.6, rad(12.0), rad(-5.0), rad(12.0), rad(-5.0), rad(-0.004), 8.0),
        (0.7, rad(12.0), 0.0, rad(12.0), 0.0, 0.0, 8.0),
    ])  # fmt: skip
    found = summarise(Trace.from_rows(columns, rows, {}), 0.0, 1.0, MACHINE.axis)
    assert found is not None
    assert (found.following_error_load_deg, found.speed_error_load_deg_s) == (None, None)
    assert found.following_error_motor_deg == pytest.approx(0.01)
    assert found.speed_error_motor_deg_s == pytest.approx(0.1)
    assert found.duration_s == pytest.approx(0.5)
    assert (found.start_deg, found.end_deg) == (pytest.approx(10.0), pytest.approx(12.0))
    assert (found.peak_deg_s, found.torque_max_nm) == (pytest.approx(5.0), 20.0)
    unknown = summarise(Trace.from_rows(columns, rows, {}), 0.0, 1.0, MACHINE.axis, end_known=False)
    assert unknown is not None
    assert unknown.end_deg is None
