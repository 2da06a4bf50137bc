"""What a run of the controller takes over from the one before, what it counts and keeps, and how it ends, by hand."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.errors import AlarmStop, DeviceError
from gantryctl.image import DriveState
from gantryctl.machine import config_hash, default_machine_path, load_machine, with_values
from gantryctl.operation.state import machine_status
from gantryctl.operation.store import StateStore
from gantryctl.program import AxisState, Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.program.alarms.words import Words
from gantryctl.program.power.brake_test import BrakeTestOutcome, BrakeTestResult
from gantryctl.program.power.phases import PowerPhase
from gantryctl.runtime import RealClock
from gantryctl.service.controller import process
from gantryctl.service.controller import retainer as retaining
from gantryctl.service.controller.process import Controller
from gantryctl.service.memory.memory import SharedMemory, Word
from gantryctl.units import deg, rad
from support.modulo_machine import modulo_machine
from unit.service.test_controller import (
    MACHINE,
    delivered,
    moved_while_off,
    opened,
    published,
    retained,
    texts,
)

# 1144 motor turns are a turn of the gantry, 2048 x 2048 counts one of the motor.
COUNTS_PER_DEG = 1144.0 * 2048.0 * 2048.0 / 360.0


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))


# --- from one run to the next -------------------------------------------------------------------------


def test_settings_of_a_run_are_those_of_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    delivered()
    with opened() as desk:
        levels = desk.operator.levels
        desk.operator.levels = levels._replace(speed_rad_s=rad(2.0), increment_rad=rad(5.0))
        desk.controller._close(None)
    kept = retained()
    assert (deg(kept.speed_rad_s), deg(kept.increment_rad)) == (pytest.approx(2.0), pytest.approx(5.0))
    assert kept.last_result == "shut down"
    with opened() as desk:
        levels = desk.operator.levels
        assert (deg(levels.speed_rad_s), deg(levels.increment_rad)) == (
            pytest.approx(2.0),
            pytest.approx(5.0),
        )
        before = desk.operator.authority.epoch
    # A machine that may not move so fast any more.
    usual = process.open_axis
    monkeypatch.setattr(process, "open_axis", lambda *given: usual(*given)._replace(speed_max_deg_s=1.5))
    with opened() as desk:
        assert deg(desk.operator.levels.speed_rad_s) == pytest.approx(1.5)
        # Of 2^40 random numbers.
        assert desk.operator.authority.epoch not in (0, before)


def test_commands_to_a_controller_that_is_gone_are_not_obeyed() -> None:
    memory = SharedMemory.create()
    with StateStore(MACHINE) as store:
        for ring in memory.commands:
            assert ring.put(b"power on")
        Controller(MACHINE, store, memory)
        assert [len(ring) for ring in memory.commands] == [0] * len(memory.commands)
    memory.close()


@pytest.mark.parametrize("given", [{}, {"second_person": True}])
def test_a_controller_is_paced_by_the_clock_and_asks_for_a_second_person_where_it_is_told_to(
    given: dict[str, bool],
) -> None:
    memory = SharedMemory.create()
    with StateStore(MACHINE) as store:
        made = Controller(MACHINE, store, memory, **given)
        assert isinstance(made.engine.clock, RealClock)
        assert made.operator.arming.second_person is bool(given)
    memory.close()


@pytest.mark.parametrize(
    ("recorded", "power_ups", "files", "newest"), [(12, 7, 9, 12), (5, 7, 6, 7), (5, 7, 10, 9)]
)
def test_numbers_of_recordings_are_above_all_that_were_given_before(
    monkeypatch: pytest.MonkeyPatch, recorded: int, power_ups: int, files: int, newest: int
) -> None:
    """By the memory of the service, the power-ups of the machine, and the files that are there."""
    delivered()
    retained(lambda kept: replace(kept, power_ups=power_ups))
    monkeypatch.setattr(process, "next_number", lambda _: files)
    memory = SharedMemory.create()
    memory.words[Word.RECORDING] = recorded
    with StateStore(MACHINE) as store:
        Controller(MACHINE, store, memory)
    assert memory.words[Word.RECORDING] == newest
    memory.close()


def test_zero_and_rest_of_an_angle_that_nobody_has_confirmed_are_not_kept() -> None:
    delivered()
    before = retained(moved_while_off)
    for power_ups, kept_back in ((0, True), (1, False)):
        with opened() as desk:
            desk.scans(3)
            desk.axis.zero_counts += 5000
            desk.controller.retainer._power_ups = power_ups
            desk.controller._close(None)
        kept = retained()
        assert (kept.zero_offset_counts == before.zero_offset_counts) is kept_back
        assert (kept.rest_position_counts == before.rest_position_counts) is kept_back


def test_an_alarm_that_ends_a_run_is_known_to_the_next_one() -> None:
    delivered()
    with opened() as desk:
        desk.scans(3)
        desk.controller._record_on()
        desk.controller._close(AlarmStop("the drive has left", Code.DRV_11))
        assert desk.controller._recorder.number == 0
        assert desk.memory.words[Word.CONTROLLER_CLEAN] == 0
    kept = retained()
    assert kept.last_result == "stopped by an alarm: the drive has left"
    assert kept.error_stop == "DRV-11"


@pytest.mark.parametrize("failure", [None, AlarmStop("no", Code.DRV_11)])
@pytest.mark.parametrize("hands_over", [True, False])
def test_commissioning_has_the_axis_next_only_where_it_was_asked_for_and_nothing_failed(
    failure: AlarmStop | None, hands_over: bool
) -> None:
    with opened() as desk:
        desk.operator.hands_over = hands_over
        desk.controller._close(failure)
        assert bool(desk.memory.words[Word.COMMISSIONING]) is (hands_over and failure is None)


@pytest.mark.parametrize("failure", [None, AlarmStop("no", Code.DRV_11)])
def test_a_controller_is_clean_when_its_drive_is_closed_and_its_state_kept(
    monkeypatch: pytest.MonkeyPatch, failure: AlarmStop | None
) -> None:
    """One that is killed while it takes the torque off was not shut down."""
    with opened() as desk:
        words, clean = desk.memory.words, list[int]()
        words[Word.CONTROLLER_CLEAN] = 0
        close, finish = desk.engine.close, desk.controller.retainer.finish
        monkeypatch.setattr(
            desk.engine, "close", lambda: (clean.append(words[Word.CONTROLLER_CLEAN]), close())
        )
        monkeypatch.setattr(
            desk.controller.retainer, "finish",
            lambda failed: (clean.append(words[Word.CONTROLLER_CLEAN]), finish(failed)),
        )  # fmt: skip
        desk.controller._close(failure)
        assert [*clean, words[Word.CONTROLLER_CLEAN]] == [0, 0, failure is None]


# --- what is counted and kept -------------------------------------------------------------------------


def test_the_way_is_that_of_the_gantry_both_ways_without_noise() -> None:
    """From 1 deg to 3 deg and back to 0: 5 deg, with noise of 0.0004 deg in each scan."""
    delivered()
    with opened() as desk:
        retainer, feedback = desk.controller.retainer, desk.axis.feedback
        before = retainer.retained.travelled_rad
        for number, angle_deg in enumerate((1.0, 2.0, 3.0, *[3.0] * 100, 1.5, 0.0, *[0.0] * 100)):
            feedback.counts = (angle_deg + 0.0004 * (number % 2)) * COUNTS_PER_DEG
            retainer.scan()
        assert deg(retainer._state("").travelled_rad - before) == pytest.approx(5.0, abs=0.002)
        # Slower than that nothing is lost either: steps of 0.0012 deg, a thousand of them.
        for number in range(1000):
            feedback.counts = -0.0012 * (number + 1) * COUNTS_PER_DEG
            retainer.scan()
        assert deg(retainer._state("").travelled_rad - before) == pytest.approx(6.2, abs=0.002)


def test_each_motion_counts_once_also_one_by_hand() -> None:
    with opened() as desk:
        retainer, before = desk.controller.retainer, desk.controller.retainer.retained.moves
        for state in (
            AxisState.STANDSTILL, AxisState.DISCRETE_MOTION, AxisState.DISCRETE_MOTION, AxisState.STANDSTILL,
            AxisState.CONTINUOUS_MOTION, AxisState.CONTINUOUS_MOTION, AxisState.STOPPING,
        ):  # fmt: skip
            desk.axis.state = state
            retainer.scan()
        assert retainer._state("").moves == before + 2


def test_a_modulo_axis_on_a_bus_forgets_where_it_rests_when_power_comes_on() -> None:
    """Only that one: a simulated one dies with its plant, a linear one has its turns in the encoder."""
    started: list[str] = []
    for machine, local, told in (
        (modulo_machine(), True, []),
        (modulo_machine(), False, ["power on"]),
        (MACHINE, False, []),
    ):
        started.clear()
        with opened(machine) as desk:
            retainer = desk.controller.retainer
            retainer.start = started.append  # type: ignore[method-assign]
            retainer._machine = SimpleNamespace(plant_is_local=local)  # type: ignore[assignment]
            retainer.powered_up()
            assert retainer.power_ups == retainer.retained.power_ups + 1
        assert started == told


class Thread:
    """A thread that lives as long as the test says."""

    def __init__(self, said: list[str], target: Any, args: Any) -> None:
        self._said, self._target, self._args = said, target, args
        self.alive = True

    def start(self) -> None:
        self._said.append(f"started: {self._args[0].last_result}")

    def is_alive(self) -> bool:
        return self.alive

    def join(self) -> None:
        self._said.append("joined")
        self.alive = False


def test_the_state_is_written_by_one_thread_at_a_time_and_the_last_one_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said: list[str] = []
    threads = SimpleNamespace(Thread=lambda target, args: Thread(said, target, args))
    monkeypatch.setattr(retaining, "threading", threads)
    monkeypatch.setattr(
        retaining, "keep_machine", lambda *given: said.append(f"kept: {given[-1].last_result}")
    )
    with opened() as desk:
        retainer = desk.controller.retainer
        retainer.start("one")
        retainer.start("two")
        assert said == ["started: one"]
        assert isinstance(retainer._thread, Thread)
        retainer._thread.alive = False
        retainer.start("three")
        retainer.finish(None)
    assert said == ["started: one", "started: three", "joined", "kept: shut down"]


def test_power_on_counts_records_and_judges_and_power_off_keeps_the_state() -> None:
    delivered()
    retained(
        lambda kept: replace(
            kept, power_ups=40, brake_tested_power_ups=30, brake_tested_at="2100-01-01T00:00:00Z"
        )
    )
    with opened() as desk:
        controller, axis = desk.controller, desk.axis
        started: list[str] = []
        controller.retainer.start = started.append  # type: ignore[method-assign]
        assert controller.brake.slow()["brake_test_cycles_left"] == 90
        number = desk.memory.words[Word.RECORDING]
        for turn in (1, 2):
            axis.power.phase = PowerPhase.ON
            controller._watch()
            controller._watch()
            assert controller.retainer.power_ups == 40 + turn
            assert controller.brake.slow()["brake_test_cycles_left"] == 90 - turn
            assert desk.memory.words[Word.RECORDING] == controller._recorder.number == number + turn
            axis.power.phase = PowerPhase.OFF
            controller._recorder.lost = 5
            controller._watch()
            assert controller._recorder.number == 0
            assert started == ["power off"] * turn
        # Of both recordings the first has lost rows.
        lost = [text for text in texts(desk.memory) if "rows are missing" in text]
        assert lost == ["recording: 5 rows are missing, the recorder was away for too long"]


def test_a_brake_test_is_on_the_disk_when_it_has_ended() -> None:
    with opened() as desk:
        started: list[str] = []
        desk.controller.retainer.start = started.append  # type: ignore[method-assign]
        test = desk.axis.brake_test
        desk.controller._watch()
        assert started == []
        test.last = BrakeTestResult(BrakeTestOutcome.PASSED, 61.0, 59.0, 0.0, Words.AT_UNKNOWN)
        test.count = 1
        desk.controller._watch()
        assert started == ["brake test"]
        assert desk.controller.retainer.retained.brake_plus_nm == 61.0


def test_a_drive_on_a_bus_is_read_by_the_scan_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Any] = []
    usual = retaining.retained_after

    def seen(machine: Any, kept: Any, axis: Any, drive: Any, end: Any) -> Any:
        read.append(drive)
        return usual(MACHINE, kept, axis, drive, end)

    monkeypatch.setattr(retaining, "retained_after", seen)
    with opened() as desk:
        desk.scans(3)
        retainer = desk.controller.retainer
        retainer._state("simulated")
        retainer._machine = SimpleNamespace(on_bus=True)  # type: ignore[assignment]
        retainer._state("on a bus")
        assert read[0] is desk.engine.drive
        assert read[1].read() is desk.engine.image.drive


# --- a drive that was lost ----------------------------------------------------------------------------


def test_a_drive_that_cannot_be_set_up_again_is_told_and_one_that_can_is_judged(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reason = Reason(Code.CFG_CAN_01, {"parameters": "6065"}, ClearedBy.RESTART)
    monkeypatch.setattr(process, "bus_reasons", lambda *_: (reason,))

    def fails(_: object) -> bool:
        raise DeviceError("no answer")

    with opened() as desk:
        desk.scans(3)
        for again, told in (
            (fails, "the drive could not be set up again: no answer"),
            (lambda _: False, ""),
            (lambda _: True, "the drive was set up again"),
        ):
            monkeypatch.setattr(process, "set_up_again", again)
            before = len(texts(desk.memory))
            assert reason not in desk.permit.reasons
            desk.controller._after_reset()
            assert texts(desk.memory)[before:] == [told] * bool(told)
        assert reason in desk.permit.reasons
        # Once for each reset.
        asked: list[int] = []
        monkeypatch.setattr(desk.controller, "_after_reset", lambda: asked.append(desk.permit.resets))
        desk.permit.resets += 1
        for _ in range(3):
            desk.controller._watch()
        assert asked == [desk.permit.resets]


# --- begin and end ------------------------------------------------------------------------------------------


def test_the_end_of_a_run_takes_torque_off_and_closes_the_brake_of_an_axis_that_still_has_power() -> None:
    """As after 20 s in which it did not come to rest, or after an alarm in which nothing else has acted."""
    delivered()
    with opened() as desk:
        assert desk.ask("take", over=False) == ""
        assert desk.ask("power", on=True) == ""
        desk.scans(1500)
        drive = desk.engine.drive
        assert drive.read().brake_open
        desk.controller._close(AlarmStop("the scan is late", Code.SYS_02))
        left = drive.read()
        assert (left.state, left.brake_open) == (DriveState.SWITCH_ON_DISABLED, False)


def test_a_stop_goes_on_for_5_s_over_a_drive_that_is_silent_for_a_moment() -> None:
    with opened() as desk:
        desk.scans(3)
        engine, asked = desk.engine, []
        silent, scans = [3], [0]

        def run_for(time_s: float) -> None:
            asked.append(time_s)
            engine.scan += scans[0]
            if len(asked) <= silent[0]:
                raise DeviceError("silent")

        engine.run_for = run_for  # type: ignore[method-assign]
        told = AlarmStop("the drive is silent", Code.CAN_06)
        assert desk.controller._stopped_by(told) is told
        assert asked == [pytest.approx(5.0)] * 4
        assert texts(desk.memory)[-1] == "the drive is silent"
        # One that never answers again does not hold the end up.
        asked.clear()
        silent[0] = math.inf  # type: ignore[call-overload]
        desk.controller._stopped_by(told)
        assert len(asked) == 20
        # Nor does one that answers when the time is over.
        asked.clear()
        silent[0], scans[0] = 1, 6000
        desk.controller._stopped_by(told)
        assert asked == [pytest.approx(5.0), 0.0]


def test_a_run_ends_at_rest_with_power_off_or_after_20_s(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]
    publisher: Any = SimpleNamespace(scan=lambda: None)
    with opened() as desk:
        desk.scans(3)
        controller, axis = desk.controller, desk.axis
        controller.retainer.start = lambda _: None  # type: ignore[method-assign]
        monkeypatch.setattr(process, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
        assert not controller._after_scan(publisher)
        controller.end()
        assert controller._after_scan(publisher)
        for phase, rests, ends in (
            (PowerPhase.ON, True, False), (PowerPhase.OFF, False, False), (PowerPhase.ON, False, False),
        ):  # fmt: skip
            axis.power.phase, axis.virtual.at_rest = phase, rests
            assert controller._after_scan(publisher) is ends
        now_s[0] += 20.0
        assert not controller._after_scan(publisher)
        now_s[0] += 0.001
        assert controller._after_scan(publisher)


def test_a_run_ends_a_second_behind_the_power_and_no_scan_later() -> None:
    """Of the brake that holds alone, so that one that slips is seen."""
    publisher: Any = SimpleNamespace(scan=lambda: None)
    with opened() as desk:
        desk.scans(3)
        desk.controller.end()
        for since_s, ends in ((0.996, False), (1.0, True)):
            desk.controller._off_s = desk.engine.time_s - since_s
            assert desk.controller._after_scan(publisher) is ends
        # The set-point is still on its ramp: the next run would begin with it.
        desk.axis.virtual.at_rest = False
        assert not desk.controller._after_scan(publisher)


def test_the_start_tells_what_it_has_found_and_a_kill_before_it_once_it_was_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    delivered()
    with opened() as desk:
        desk.scans(3)
        controller, words = desk.controller, desk.memory.words
        tags = published(desk)
        monkeypatch.setattr(process, "Snapshot", lambda _: SimpleNamespace(fast=lambda: (tags, 2500.0)))
        frozen: list[object] = []
        monkeypatch.setattr(process, "freeze", lambda folder, code: frozen.append((folder.name, code)))
        controller.notes = ("the drive was set to CSV",)
        words[Word.CONTROLLER_CLEAN] = 1
        controller._write_start()
        assert texts(desk.memory) == [f"controller started: {MACHINE.name}", "the drive was set to CSV"]
        assert frozen == []
        controller._write_start()
        # The frames before a kill are those of its alarm.
        assert frozen == [("traces", Code.SYS_05)]
        told = texts(desk.memory)[2]
        assert told.startswith("SYS-05")
        assert str(Words.AGO(age_s=2.5)) in told


def test_the_last_words_confirm_no_brake_that_nobody_sees_and_no_angle_in_doubt() -> None:
    with opened() as desk:
        desk.scans(3)
        feedback = desk.axis.feedback
        assert desk.controller._ended(True) == "controller ended at 0.000 deg, brake closed, torque off"
        desk.axis.pos_act_rad = rad(41.5)
        assert desk.controller._ended(True) == "controller ended at 41.500 deg, brake closed, torque off"
        feedback.brake_contact = False
        assert desk.controller._ended(True).endswith("deg, brake commanded closed, not confirmed, torque off")
        feedback.in_doubt = True
        assert "ended, the angle is not known, brake" in desk.controller._ended(True)
        assert (
            desk.controller._ended(False)
            == "controller ended, brake commanded closed, not confirmed, torque off"
        )


def test_after_each_scan_the_frames_of_alarms_and_the_time_are_looked_at() -> None:
    publisher: Any = SimpleNamespace(scan=lambda: None)
    with opened() as desk:
        desk.scans(3)
        looked: list[object] = []
        controller: Any = desk.controller
        controller._held_up = SimpleNamespace(look=lambda: looked.append("clock"))
        controller._frames = SimpleNamespace(look=looked.append)
        settle = desk.operator.settle
        desk.operator.settle = lambda: looked.append("replies") or settle()  # type: ignore[method-assign, func-returns-value]
        controller._after_scan(publisher)
        assert looked == ["clock", "replies", desk.engine.time_s]


@pytest.mark.parametrize("options", [[], ["--second-person"]])
def test_the_process_takes_its_option_and_ends_with_a_signal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str]
) -> None:
    made: list[Any] = []
    handlers: dict[str, Any] = {}

    class Made:
        def __init__(self, *_: object, second_person: bool) -> None:
            self.second_person, self.ended = second_person, 0
            made.append(self)

        def end(self) -> None:
            self.ended += 1

        def run(self, *, real_time: bool) -> int:
            for handler in handlers.values():
                handler()
            return 3

    names = {name: name for name in ("SIGTERM", "SIGINT", "SIGHUP")}
    monkeypatch.setattr(process, "signal", SimpleNamespace(signal=handlers.__setitem__, **names))
    parents: list[int] = []
    monkeypatch.setattr(process, "die_with_parent", parents.append)
    monkeypatch.setattr(process, "prepare_scan_process", lambda: False)
    monkeypatch.setattr(process, "Controller", Made)
    memory, config = SharedMemory.create(), default_machine_path()
    memory.words[Word.SUPERVISOR] = 4711
    wanted = config_hash(load_machine(config))
    assert process.main([str(memory.handle), str(config), wanted, str(tmp_path), *options]) == 3
    assert [(each.second_person, each.ended) for each in made] == [(bool(options), 3)]
    # No scan outlives its supervisor.
    assert parents == [4711]
    memory.close()


def test_a_run_tells_its_start_and_its_end_and_what_its_recordings_hold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    delivered()
    with opened() as desk:
        controller, scanned = desk.controller, []
        usual = controller.retainer.scan
        controller.retainer.scan = lambda: (scanned.append(desk.engine.scan), usual())[1]  # type: ignore[method-assign]
        seen: list[int] = []
        look = controller._watch

        def watch() -> None:
            look()
            seen.append(desk.engine.scan)
            if len(seen) == 60:
                controller.end()

        monkeypatch.setattr(controller, "_watch", watch)

        def fails(*_: object) -> None:
            raise DeviceError("no space left")

        monkeypatch.setattr(retaining, "keep_machine", fails)
        counted: list[str] = []
        monkeypatch.setattr(desk.operator.refusals, "close", lambda: counted.append("written"))
        assert controller.run(real_time=True) == 0
        # Refusals that were only counted so far.
        assert counted == ["written"]
        assert scanned == seen
        assert len(seen) == 60
        told = texts(desk.memory)
        assert told[0] == f"controller started: {MACHINE.name}"
        assert told[-2:] == [
            "the state was not kept: no space left",
            "controller ended at 0.000 deg, brake closed, torque off",
        ]
        assert desk.memory.words[Word.CONTROLLER_CLEAN] == 1
        about = json.loads(desk.memory.columns.read() or b"{}")
        assert about["columns"] == list(controller._recorder.columns)
        metadata = about["metadata"]
        assert (metadata["machine"], metadata["period_s"]) == (MACHINE.name, 0.001)
        # 5 % of 257 N m.
        assert metadata["rest_band_torque_act_nm"] == pytest.approx(12.85)
        tags = json.loads(desk.memory.slow.read() or b"{}")
        assert tags["real_time"] is True
        assert tags["version"] == metadata["version"] != ""


def test_a_shutdown_sees_that_the_brake_holds() -> None:
    """A load that hangs to one side, and a brake that bears 8 of its 43 N m: told behind the power-down, and kept."""
    hanging = with_values(
        MACHINE, {"plant.load.eccentricity_m": 0.0254, "plant.load.eccentric_angle_deg": 90.0}
    )
    publisher: Any = SimpleNamespace(scan=lambda: None)
    with opened(hanging) as desk:
        desk.controller._write_start()
        assert desk.ask("take", over=False) == ""
        assert desk.ask("power", on=True) == ""
        desk.scans(4000)
        assert desk.axis.state is AxisState.STANDSTILL
        desk.engine.drive.change_plant("brake_torque_nm", 8.0)
        desk.controller.end()
        ended = desk.engine.run_until(lambda _: desk.controller._after_scan(publisher), 3.0)
        assert (ended, desk.axis.alarms.first_out.code) == (False, Code.BRK_03)
        assert desk.axis.power.phase is PowerPhase.TORQUE_HOLD
        desk.controller._close(None)
    assert machine_status(hanging).error_stop == "BRK-03"


def test_a_shutdown_with_a_sound_brake_ends_a_second_behind_the_power_down() -> None:
    publisher: Any = SimpleNamespace(scan=lambda: None)
    with opened() as desk:
        assert desk.ask("take", over=False) == ""
        assert desk.ask("power", on=True) == ""
        desk.scans(4000)
        desk.controller.end()
        off_s: list[float] = []

        def after(_: object) -> bool:
            if desk.axis.is_off:
                off_s.append(desk.engine.time_s)
            return desk.controller._after_scan(publisher)

        assert desk.engine.run_until(after, 3.0)
        assert desk.engine.time_s - off_s[0] == pytest.approx(1.0, abs=0.0021)
