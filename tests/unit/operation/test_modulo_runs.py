"""Runs of a modulo axis on every kind of drive, over wraps of its encoder and over power cycles. The plant judges."""

from __future__ import annotations

import math
from contextlib import nullcontext
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.drives.canopen.process_image import Unwrap
from gantryctl.drives.simulated import SimDrive
from gantryctl.errors import CommandRefused, ConfigError
from gantryctl.image import Direction, DriveIdentity, DriveState
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.operation import opening
from gantryctl.operation import state as state_module
from gantryctl.operation.home_reference import EncoderScale, RestVerdict, judge_reference, why_not_referenced
from gantryctl.operation.opening import new_machine
from gantryctl.operation.run import AxisRun
from gantryctl.operation.run_memory import RunEnd, RunMemory, retained_after
from gantryctl.operation.state import encoder_report, machine_status, reset_machine, set_encoder_zero
from gantryctl.operation.store import StateStore
from gantryctl.program import Axis, Code
from gantryctl.runtime import Retained
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.units import rad
from gantryctl.wiring.program import axis_settings, travel_settings
from gantryctl.wiring.simulator import turned_back
from support.modulo_machine import ENCODER_TURNS, modulo_machine

# Gear error and wind-up of the reference plant between motor and load, in up to four moves: 0.012 deg.
LOAD_DEG = 0.02
# Of the motor side: within the in-position window.
MOTOR_DEG = 0.005
END = RunEnd("done", None, 1, 1, 1.0)


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def apart(angle_deg: float, true_deg: float) -> float:
    """Difference of two angles, whole turns left out."""
    return math.remainder(angle_deg - true_deg, 360.0)


def moved(machine: Machine, way_deg: float) -> tuple[float, float | None]:
    """One power cycle with one move; where the axis says it stands, and where its load does."""
    with StateStore(machine) as store:
        run = AxisRun(machine, store)
        result = "failed"
        try:
            report = run.move_by(way_deg, 6.0)
            assert report.done
            run.power_down()
            truth = run.drive.truth_source
            load_deg = None if truth is None else math.degrees(truth.truth()[0])
            angle_deg, result = run.angle_deg, "done"
        finally:
            run.close(result)
    return angle_deg, load_deg


MACHINES = {
    "sim, 1 ms": {"control.scan_period_ms": 1.0},
    "sim, 4 ms": {"control.scan_period_ms": 4.0},
    "sim, 10 ms": {"control.scan_period_ms": 10.0},
    "ideal, 4 ms": {"drive.kind": "ideal", "control.scan_period_ms": 4.0},
    "canopen, 10 ms": {"drive.kind": "canopen", "control.scan_period_ms": 10.0},
}


@pytest.mark.parametrize("changes", MACHINES.values(), ids=MACHINES)
def test_wraps_in_motion_and_between_runs_lose_no_turn(changes: dict[str, object]) -> None:
    """Five wraps of the encoder in three runs, some of them within a run, some between two."""
    machine = modulo_machine(changes)
    at = 0.0
    for way in (35.0, 5.0, -67.0):
        at += way
        angle_deg, load_deg = moved(machine, way)
        assert apart(angle_deg, at) == pytest.approx(0.0, abs=MOTOR_DEG)
        if load_deg is not None:
            assert apart(load_deg, at) == pytest.approx(0.0, abs=LOAD_DEG)
        assert machine_status(machine).angle_deg == pytest.approx(angle_deg, abs=1e-4)


@pytest.mark.parametrize("period_ms", [1.0, 4.0, 10.0])
@pytest.mark.parametrize("turns_short", [0, 1])
def test_a_drive_that_wraps_within_its_range_is_followed_through_10_000_turns(
    period_ms: float, turns_short: int
) -> None:
    """Readings of 64 motor turns; and the liar: an unwrap by a motor turn too few is found at the first wrap."""
    per_turn = 2**20
    span = ENCODER_TURNS * per_turn
    unwrap = Unwrap(span)
    unwrap._jumps = tuple(jump - turns_short * int(math.copysign(per_turn, jump)) for jump in unwrap._jumps)
    # 8 times the motor's 1150 r/min, so that a test of 10,000 turns of the axis has few readings: 9.8 turns in 64 ms.
    step = round(8 * 8 * 1150.0 / 60.0 * period_ms * 1e-3 * per_turn)
    begin = unwrap(12_345)
    readings = 10_000 * 1144 * per_turn // step if period_ms == 10.0 else 20_000
    true = begin
    for _ in range(readings):
        true += step
        found = unwrap(true % span)
        if found != true:
            break
    assert (found == true) is (turns_short == 0)
    if not turns_short and period_ms == 10.0:
        assert true - begin > 9_999 * 1144 * per_turn


def test_liar_a_power_on_that_forgets_a_turn_of_the_encoder_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine = modulo_machine({"control.scan_period_ms": 10.0})
    moved(machine, 35.0)
    true = SimDrive.power_on

    def lying(drive: SimDrive) -> None:
        true(drive)
        drive._wrap_counts += drive.identity().counts_per_turn

    monkeypatch.setattr(SimDrive, "power_on", lying)
    with pytest.raises(CommandRefused, match="ENC-08"):
        moved(machine, 5.0)


def test_direction_and_ways_beyond_a_turn_on_the_plant() -> None:
    machine = modulo_machine({"control.scan_period_ms": 10.0})
    run = AxisRun(machine)
    assert run.drive.truth_source is not None
    try:
        assert run.move(170.0).end_deg == pytest.approx(170.0, abs=MOTOR_DEG)
        # Without a direction a run stays within the turn: tests and measurements choose their ways in it.
        assert run.move(-40.0).end_deg == pytest.approx(-40.0, abs=MOTOR_DEG)
        assert math.degrees(run.drive.truth_source.truth()[0]) == pytest.approx(-40.0, abs=LOAD_DEG)
        run.move(170.0)
        run.move(-170.0, direction=Direction.SHORTEST)
        assert math.degrees(run.drive.truth_source.truth()[0]) == pytest.approx(190.0, abs=LOAD_DEG)
        run.move_by(-730.0)
        assert math.degrees(run.drive.truth_source.truth()[0]) == pytest.approx(-540.0, abs=LOAD_DEG)
        assert abs(run.axis.pos_act_rad) < 1.6 * math.pi, "whole turns go into the zero"
        run.jog(True, 6.0, 5.0)
        with pytest.raises(CommandRefused, match="within -360"):
            run.move(400.0)
    finally:
        run.power_down()
        run.close("done")


def test_a_linear_axis_refuses_a_direction_before_power() -> None:
    run = AxisRun(with_values(default_machine(), {"drive.kind": "ideal"}))
    with pytest.raises(CommandRefused, match="a direction is for a modulo axis"):
        run.move(10.0, direction=Direction.SHORTEST)
    assert run.axis.is_off
    run.close("refused")


@pytest.mark.parametrize(("read_deg", "shown_deg"), [(100.0, 100.0), (-170.0, -170.0), (190.0, -170.0)])
def test_before_the_first_scan_the_angle_is_that_of_the_opening(read_deg: float, shown_deg: float) -> None:
    """In the turn of the file, from -180 deg on: a move is checked against it."""
    run: Any = SimpleNamespace(
        engine=SimpleNamespace(scan=0),
        axis=SimpleNamespace(settings=SimpleNamespace(travel=travel_settings(modulo_machine()))),
        _open=SimpleNamespace(reading=SimpleNamespace(angle_deg=read_deg)),
    )
    assert AxisRun.angle_deg.fget(run) == pytest.approx(shown_deg)  # type: ignore[attr-defined]


def test_in_a_run_the_angle_is_shown_in_the_turn_of_the_file() -> None:
    """The axis counts on: 400 deg from its zero are 40."""
    run: Any = SimpleNamespace(
        engine=SimpleNamespace(scan=1),
        axis=SimpleNamespace(
            settings=SimpleNamespace(travel=travel_settings(modulo_machine())), pos_act_rad=rad(400.0)
        ),
    )
    assert AxisRun.angle_deg.fget(run) == pytest.approx(40.0)  # type: ignore[attr-defined]


def test_the_zero_is_set_anywhere_in_the_turn_and_kept() -> None:
    machine = modulo_machine(
        {"control.scan_period_ms": 10.0, "axis.pos_min_deg": 0.0, "axis.pos_max_deg": 360.0}
    )
    moved(machine, 35.0)
    set_encoder_zero(machine, 359.0, "mark")
    report = dict(encoder_report(machine).rows())
    assert report["angle"] == "359.00000 deg"
    assert report["wrap margin"] == "none: a modulo axis; a way of less than 10.1 deg while off is told"
    assert moved(machine, 2.0)[0] == pytest.approx(1.0, abs=MOTOR_DEG)


# --- what may have happened while off ----------------------------------------------------------------------------

MACHINE = modulo_machine()
SPAN = ENCODER_TURNS * MACHINE.counts_per_turn
TURN = MACHINE.axis.gear * MACHINE.counts_per_turn
SCALE = EncoderScale(
    DriveIdentity("drive", "E1", MACHINE.counts_per_turn, ENCODER_TURNS),
    MACHINE.axis.ratio, 8192, -180.0, 180.0, (-187.0, 187.0), 5.0, TURN,
)  # fmt: skip
# At 100 deg, 0.05 deg before the end of the encoder's range.
REST = SPAN - round(0.05 / SCALE.deg_per_count)
KEPT = Retained(
    machine="endless", config_hash="", encoder_serial="E1",
    zero_offset_counts=REST - round(100 * TURN / 360), rest_position_counts=REST,
)  # fmt: skip


def test_the_zero_of_a_modulo_axis_lies_on_the_branch_on_which_it_rested() -> None:
    """It rested at 100 deg, 0.05 deg before the end of the range: 0.1 deg on the reading has begun anew."""
    counts = (REST + round(0.1 / SCALE.deg_per_count)) % SPAN
    found: Any = SimpleNamespace(feedback=SimpleNamespace(pos_act_counts=counts), retained=KEPT, scale=SCALE)
    assert counts < REST
    assert (counts - opening._zero_counts(found)) * SCALE.deg_per_count == pytest.approx(100.1, abs=1e-5)


@pytest.mark.parametrize("ranges", [0, 3])
def test_a_rest_position_takes_the_zero_onto_its_branch(ranges: int) -> None:
    """Opened 0.2 deg beyond the wrap, then turned on by whole ranges of 20.14 deg, which are no turn of the axis."""
    opened = (REST + round(0.2 / SCALE.deg_per_count)) % SPAN
    found: Any = SimpleNamespace(feedback=SimpleNamespace(pos_act_counts=opened), retained=KEPT, scale=SCALE)
    counts = opened + ranges * SPAN
    reading = judge_reference(SCALE, counts % SPAN, opening.rested_at(found, KEPT, counts))
    assert reading.verdict is RestVerdict.OK
    assert reading.angle_deg is not None
    assert apart(reading.angle_deg, 100.2 + ranges * 64 * 360.0 / 1144) == pytest.approx(0.0, abs=1e-5)


def test_a_small_way_over_the_wrap_is_acknowledged_where_the_axis_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counts = (REST + round(0.2 / SCALE.deg_per_count)) % SPAN
    seen: Any = SimpleNamespace(state=DriveState.SWITCH_ON_DISABLED, pos_act_counts=counts)
    drive: Any = None
    found = opening.OpenMachine(drive, KEPT, seen, SCALE, judge_reference(SCALE, counts, KEPT))
    kept: list[Retained] = []
    monkeypatch.setattr(state_module, "read_only", lambda machine, store: nullcontext(found))
    monkeypatch.setattr(state_module, "keep_machine", lambda machine, store, drive, kept_: kept.append(kept_))
    assert "moved +0.200 deg while off" in reset_machine(MACHINE)
    reading = judge_reference(SCALE, counts, kept[0])
    assert reading.verdict is RestVerdict.OK
    assert reading.angle_deg == pytest.approx(100.2, abs=1e-5)


@pytest.mark.parametrize(
    ("moved_deg", "verdict", "code"),
    [
        (0.0, RestVerdict.OK, None),
        (0.049, RestVerdict.OK, None),
        (-0.049, RestVerdict.OK, None),
        (0.2, RestVerdict.MOVED, Code.ENC_09),  # over the wrap
        (360.0 / 1144.0, RestVerdict.TURNS, Code.ENC_08),
        (9.9, RestVerdict.NOT_VALID, Code.ENC_10),  # half the range is 10.07 deg
        (-9.9, RestVerdict.NOT_VALID, Code.ENC_10),
    ],
)
def test_a_way_while_off_is_told_up_to_half_the_range(
    moved_deg: float, verdict: RestVerdict, code: Code | None
) -> None:
    raw = (REST + round(moved_deg / SCALE.deg_per_count)) % SPAN
    reading = judge_reference(SCALE, raw, KEPT)
    assert reading.verdict is verdict
    reason = why_not_referenced(reading)
    assert (None if reason is None else reason.code) is code
    assert reading.angle_deg == pytest.approx(100.0 + moved_deg, abs=1e-4)


def test_an_axis_whose_controller_died_under_power_is_not_known() -> None:
    """It may have turned on by any number of ranges, and the encoder would show where it rested before."""
    real = with_values(MACHINE, {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.interface": "socketcan",
                                 "can.channel": "can0"})  # fmt: skip
    assert not real.plant_is_local
    axis = Axis(axis_settings(real), float(REST))
    RunMemory(real, axis, replace(KEPT, machine=real.name), None).forget_rest()  # a new machine has no memory
    with StateStore(real) as store:
        RunMemory(real, axis, replace(KEPT, machine=real.name), store).forget_rest()
    with StateStore(real) as store:
        found = store.load_retained()
    assert found is not None
    assert found.rest_position_counts is None
    reason = why_not_referenced(judge_reference(SCALE, REST, found))
    assert reason is not None
    assert reason.code is Code.ENC_10


@pytest.mark.parametrize(
    "machine",
    [with_values(default_machine(), {"drive.kind": "canopen", "control.scan_period_ms": 4.0}), MACHINE],
)
def test_an_axis_with_ends_or_of_a_plant_in_the_process_keeps_what_it_knew(machine: Machine) -> None:
    axis = Axis(axis_settings(machine), float(REST))
    with StateStore(machine) as store:
        RunMemory(machine, axis, replace(KEPT, machine=machine.name), store).forget_rest()
        assert store.load_retained() is None


def test_the_memory_of_a_powered_axis_on_a_bus_holds_no_rest_position() -> None:
    real = with_values(MACHINE, {"drive.kind": "canopen", "control.scan_period_ms": 4.0, "can.interface": "socketcan",
                                 "can.channel": "can0"})  # fmt: skip

    class Read:
        def identity(self) -> DriveIdentity:
            return SCALE.identity

        def read(self) -> object:
            return type("Reading", (), {"pos_act_counts": REST + 5 * SPAN + 7})()

    axis = Axis(axis_settings(real), float(REST - 1000))
    off = retained_after(real, KEPT, axis, Read(), END)  # type: ignore[arg-type]  # a reading of one field
    # 1144 motor turns are one of the axis.
    motor_turns = (5 * SPAN + 7) / real.counts_per_turn
    assert math.degrees(off.travelled_rad) == pytest.approx(motor_turns * 360.0 / 1144)
    assert off.rest_position_counts == (REST + 7) % SPAN
    assert off.zero_offset_counts is not None
    angle = Fraction((REST + 7) % SPAN - off.zero_offset_counts - (5 * SPAN + 1007))
    assert angle % (real.axis.gear * real.counts_per_turn) == 0
    axis.power.switch_on()
    assert not axis.is_off
    on = retained_after(real, KEPT, axis, Read(), END)  # type: ignore[arg-type]
    assert on.rest_position_counts is None


def test_compensations_go_round_without_a_step() -> None:
    """Maps, load-side encoder and damping of the improved machine over 1.2 turns: no change of the speed command is
    larger after the first half turn, where their laws go on in the next turn, than before it.
    """
    machine = modulo_machine({"control.scan_period_ms": 1.0}, "hust_improved")
    run = AxisRun(machine, recorder=MemoryRecorder)
    run.move_by(430.0)
    run.power_down()
    recorder = run.engine.recorder
    assert isinstance(recorder, MemoryRecorder)
    trace = recorder.trace()
    run.close("done")
    ref_deg, command = np.degrees(trace["pos_ref_rad"]), np.degrees(trace["vel_cmd_rad_s"])
    steps = np.abs(np.diff(command))
    moving = (np.abs(np.degrees(trace["vel_ref_rad_s"])) > 0.0)[1:]
    first = moving & (np.abs(ref_deg[1:]) < 170.0)
    later = moving & (np.abs(ref_deg[1:]) >= 170.0)
    assert later.sum() > 10_000
    assert steps[later].max() <= 1.2 * steps[first].max()
    assert machine.control.compensation.load_encoder.active


# --- machine files and the plant ----------------------------------------------------------------------------------


def test_a_rounded_gear_is_refused_and_an_exact_one_has_no_error() -> None:
    ratio = {"axis.reducer_ratio": 117.3333, "axis.ring_ratio": 9.0}
    with pytest.raises(ConfigError, match="gear_motor_turns"):
        modulo_machine(ratio | {"axis.reducer_ratio": 117.33333})
    exact = {"axis.reducer_ratio": 352.0 / 3.0, "axis.gear_motor_turns": 352 * 9, "axis.gear_axis_turns": 3}
    with pytest.raises(ConfigError, match="12 digits"):
        modulo_machine(ratio | exact | {"axis.reducer_ratio": 117.3333})
    machine = modulo_machine(ratio | exact)
    assert axis_settings(machine).law.turn_counts == Fraction(352 * 3 * MACHINE.counts_per_turn)


def test_a_plant_of_many_turns_goes_on_in_its_first() -> None:
    """The same readings a whole number of turns later, to a count."""
    machine = modulo_machine({"control.scan_period_ms": 10.0})
    run = AxisRun(machine)
    run.move_by(800.0)
    run.power_down()
    state = run.drive.plant_state()
    back = turned_back(machine, state)
    run.close("done")
    assert back["pos_load"] == pytest.approx(rad(80.0), abs=rad(LOAD_DEG))
    twist = state["pos_motor"] / machine.axis.ratio - state["pos_load"]
    assert back["pos_motor"] / machine.axis.ratio - back["pos_load"] == pytest.approx(twist, abs=1e-11)

    def reading(at: dict[str, float]) -> int:
        counts = at["pos_motor"] / math.tau * machine.counts_per_turn + at["count_offset"]
        return round(counts) % SPAN

    assert abs(reading(back) - reading(state)) <= 1
    linear = default_machine()
    assert turned_back(linear, state) == state


@pytest.mark.parametrize("angle_deg", [-350.0, -20.0, 0.0, 11.0, 150.0, 359.0])
def test_a_new_machine_stands_where_it_was_asked_to_stand(angle_deg: float) -> None:
    """The encoder of 20.1 deg has wrapped up to 17 times between its zero and there. Gears rest within 0.01 deg."""
    machine = modulo_machine()
    found = new_machine(machine, angle_deg)
    assert found.reading.verdict is RestVerdict.OK
    assert found.reading.angle_deg is not None
    assert abs(math.remainder(found.reading.angle_deg - angle_deg, 360.0)) < 0.01
