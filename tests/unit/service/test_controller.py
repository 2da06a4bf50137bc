"""The controller process without a process: its machine opened, scanned in virtual time, and closed again."""

from __future__ import annotations

import gc
import json
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.errors import AlarmStop, ConfigError, DeviceError, UsageError
from gantryctl.image import DriveRequest, EncoderFlag, OutputImage, StopCause, SystemStop
from gantryctl.machine import (
    Machine,
    config_hash,
    configs_folder,
    default_machine,
    default_machine_path,
    load_machine,
    with_values,
)
from gantryctl.operation.state import machine_status
from gantryctl.operation.store import StateStore
from gantryctl.program import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason
from gantryctl.runtime import Engine, Retained, VirtualClock
from gantryctl.service.controller import process
from gantryctl.service.controller.process import Controller
from gantryctl.service.controller.publisher import Publisher
from gantryctl.service.memory.memory import SharedMemory, Source, Word
from gantryctl.service.memory.snapshot import Snapshot, publish_fast
from gantryctl.service.protocol.messages import Identity, to_record
from gantryctl.service.protocol.roles import Role
from gantryctl.units import deg
from support.marks import newest_mark

MACHINE = default_machine()
TURN_COUNTS = 2048 * MACHINE.encoder.counts_per_turn  # fine counts of a motor turn
LATE = SystemStop(StopCause.FROZEN, 2.01, 0.05, 0.0)
ALICE = Identity("c1", "alice", Role.OPERATOR, "console")
SERVICE = Identity("c2", "serena", Role.SERVICE, "console")


class Desk:
    """A controller in service, and a person who commands it. `scans` goes on in time."""

    def __init__(self, machine: Machine, store: StateStore, memory: SharedMemory) -> None:
        self.memory = memory
        self.controller = made = Controller(machine, store, memory)
        self.engine, self.operator, self.axis = made.engine, made.operator, made.axis
        self.engine.clock = VirtualClock()
        self.operator.now = lambda: self.engine.time_s
        self.operator.frames.start_s = 0.0
        self.permit = made.permit
        memory.words[Word.RECORDER_NS] = 2**62  # a recorder that is always alive
        self.seq = 0

    def scans(self, count: int) -> None:
        self.engine.run_until(self.after, count * self.engine.period_s)

    def after(self, _: Engine) -> bool:
        self.operator.settle()
        self.controller._watch()
        holder = self.operator.authority.holder
        if self.engine.scan % 500 == 0 and holder is not None:
            self.send("alive", holder)
        return False

    def send(self, kind: str, who: Identity = ALICE, **values: object) -> None:
        self.seq += 1
        raw = {"type": kind, "seq": self.seq, "frame": newest_mark(self.operator, who.client), **values}
        if kind != "alive":
            raw["epoch"] = self.operator.authority.epoch
        assert self.memory.commands[Source.WEB].put(to_record(who, raw))

    def ask(self, kind: str, who: Identity = ALICE, **values: object) -> str:
        """The code of the reply, empty when it was done."""
        self.send(kind, who, **values)
        self.scans(3)
        replies = self.memory.replies[Source.WEB]
        while (record := replies.take()) is not None:
            reply = json.loads(record)[1]
            if reply["seq"] == self.seq:
                return str(reply["code"])
        raise AssertionError(f"no reply to {kind}")

    def moving(self) -> None:
        """Power on, on the way to 90 deg, faster than 2 deg/s."""
        assert self.ask("take", over=False) == ""
        assert self.ask("power", on=True) == ""
        self.scans(4000)
        assert self.ask("set", tag="speed_setting_deg_s", value=6.0) == ""
        assert self.ask("move", target_deg=90.0) == ""
        self.scans(8000)
        assert deg(self.axis.feedback.vel_rad_s) > 2.0


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))


@contextmanager
def opened(machine: Machine = MACHINE) -> Iterator[Desk]:
    """The machine as the last run left it."""
    memory = SharedMemory.create()
    try:
        with StateStore(machine) as store:
            yield Desk(machine, store, memory)
    finally:
        memory.close()


def texts(memory: SharedMemory) -> list[str]:
    """Events of the controller so far."""
    records = memory.events[Source.CONTROLLER].peek(1000)
    return [json.loads(record)["text"] for record in records if record is not None]


def delivered() -> None:
    """A run that leaves the machine in order."""
    with opened() as desk:
        desk.scans(10)
        desk.controller._close(None)


def retained(change: Callable[[Retained], Retained] = lambda kept: kept) -> Retained:
    """What is on the disk, changed first."""
    with StateStore(MACHINE) as store:
        kept = store.load_retained()
        assert kept is not None
        store.store_retained(change(kept))
        return change(kept)


def lost_turns(kept: Retained) -> Retained:
    assert kept.rest_position_counts is not None
    return replace(kept, rest_position_counts=kept.rest_position_counts + 3 * TURN_COUNTS)


def moved_while_off(kept: Retained) -> Retained:
    """By 0.1 deg: more than the 0.05 deg that gears settle, less than the 1 deg that is ambiguous."""
    assert kept.rest_position_counts is not None
    return replace(
        kept, rest_position_counts=kept.rest_position_counts + int(0.1 / 360.0 * 1144 * TURN_COUNTS)
    )


@pytest.mark.can
def test_a_controller_that_cannot_be_made_leaves_the_bus(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from gantryctl.drives.canopen.drive import CanopenDrive

    left = []
    close = CanopenDrive.close
    monkeypatch.setattr(CanopenDrive, "close", lambda drive: (left.append(drive), close(drive)))

    def fails(*_: object) -> None:
        raise DeviceError("no memory for the alarms")

    monkeypatch.setattr("gantryctl.service.controller.process.AlarmView", fails)
    machine = load_machine(configs_folder() / "hust_can.toml")
    memory = SharedMemory.create()
    try:
        with StateStore(machine, tmp_path) as store, pytest.raises(DeviceError, match="no memory"):
            Controller(machine, store, memory)
        assert len(left) == 1
    finally:
        memory.close()


@pytest.mark.can
def test_what_a_bus_has_lost_stands_in_the_tags() -> None:
    """Two telegrams lost, two of a wrong length, and 50 frames of somebody else; null without a bus."""
    with opened(load_machine(configs_folder() / "hust_can.toml")) as desk:
        drive = desk.engine.drive
        desk.scans(10)
        for tpdo, kind in ((1, "drop"), (2, "length")):
            fault = {"cmd": "inject", "fault": "tpdo", "tpdo": tpdo, "kind": kind, "amount": 3, "count": 2}
            assert Requests(drive.plant).answer(fault)["ok"]
        for _ in range(50):
            drive.plant._out(0x7E5, b"")
        desk.scans(10)
        tags = publisher_of(desk).slow()
        desk.controller._close(None)
    assert (tags["bus_missed"], tags["bus_wrong_length"], tags["bus_others"]) == (4, 2, 50)
    assert (tags["bus_contradicted"], tags["bus_refused"], tags["bus_duplicated"]) == (0, 0, 0)
    with opened() as desk:
        assert publisher_of(desk).slow()["bus_missed"] is None


def publisher_of(desk: Desk) -> Publisher:
    made = desk.controller
    return Publisher(
        made.machine, made.engine, made.operator, made.alarms, made.brake, made._recorder, desk.memory,
        real_time=False, version="test",
    )  # fmt: skip


def published(desk: Desk) -> dict[str, Any]:
    """The tags that a page would see now."""
    publish_fast(desk.memory.fast, publisher_of(desk).fast(), desk.operator.frames.key)
    return Snapshot(desk.memory).fast()[0]


def test_the_next_start_tells_the_angle_at_which_the_controller_was_killed() -> None:
    """SYS-05 (F6, G16): the killed controller has sent 6 deg/s; where it was then is true to the last status frame."""
    delivered()
    with opened() as desk:
        desk.moving()
        true_deg = math.degrees(desk.engine.drive.sim.truth()[2]) / MACHINE.axis.ratio
        tags = published(desk)
        assert tags["pos_act_deg"] == pytest.approx(true_deg, abs=0.05)
        desk.controller._write_start()  # the next one, with the memory of this one
        (told,) = [text for text in texts(desk.memory) if text.startswith("SYS-05")]
        assert f"it was at {tags['pos_act_deg']:.2f} deg, {tags['vel_act_deg_s']:.2f} deg/s" in told
        assert tags["vel_act_deg_s"] > 2.0


def test_numbers_of_a_reading_in_doubt_are_told_nowhere_and_stay_so_over_a_start() -> None:
    delivered()
    with opened() as desk:
        desk.moving()
        desk.engine.drive.faults.encoder_flags = EncoderFlag.ALARM
        desk.scans(3000)
        assert desk.axis.feedback.in_doubt
        tags = published(desk)
        for name in (
            "pos_act_deg",
            "vel_act_deg_s",
            "travel_left_minus_deg",
            "travel_left_plus_deg",
            "target_deg",
        ):
            assert tags[name] is None, name
        assert not tags["position_valid"]
        desk.controller._write_start()
        (told,) = [text for text in texts(desk.memory) if text.startswith("SYS-05")]
        assert "it was at an angle that is not known" in told
        desk.controller._close(None)
        assert texts(desk.memory)[-1] == "controller ended, the angle is not known, brake closed, torque off"
    kept = retained()
    assert kept.doubted_by == "ENC-05"
    status = machine_status(MACHINE)
    assert status.angle_deg is None
    assert status.encoder.startswith("in doubt since ENC-05")
    with opened() as desk:
        desk.scans(3)
        assert not published(desk)["position_valid"]
        assert desk.ask("take", over=False) == ""
        assert desk.ask("reset") == "CTL-14"  # service compares the angle
        assert desk.ask("take", SERVICE, over=True) == ""
        assert desk.ask("arm", SERVICE, action="reset_locked") == ""
        assert desk.ask("reset", SERVICE) == ""
        desk.scans(3)
        assert published(desk)["position_valid"]
        desk.controller._close(None)
    assert retained().doubted_by == ""


def test_a_doubt_that_no_encoder_alarm_began_lasts_over_a_start_too() -> None:
    """A drive that restarted in motion (DRV-11): its code says nothing of the encoder, the retained memory does."""
    delivered()
    retained(lambda kept: replace(kept, doubted_by="DRV-11"))
    with opened() as desk:
        desk.scans(3)
        tags = published(desk)
        assert (tags["position_valid"], tags["pos_act_deg"]) == (False, None)
        assert desk.ask("take", over=False) == ""
        assert desk.ask("power", on=True) == "PWR-04"
        desk.controller._close(None)
    assert retained().doubted_by == "DRV-11"


# --- what keeps the power off ---------------------------------------------------------------------


def test_no_reset_opens_an_encoder_that_lost_turns_also_when_a_scan_was_late() -> None:
    delivered()
    retained(lost_turns)
    with opened() as desk:
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        assert desk.ask("reset") == "ENC-08"
        desk.engine.system_stop = LATE
        desk.scans(3)
        assert desk.ask("reset") == "ENC-08"
        assert str(desk.permit.blocked_by).startswith("ENC-08")
        assert desk.ask("power", on=True) == "PWR-04"


def test_a_frozen_controller_is_the_first_alarm_on_page_and_in_the_journal_until_a_reset() -> None:
    delivered()
    retained(moved_while_off)
    with opened() as desk:
        desk.engine.system_stop = LATE
        desk.scans(3)
        assert str(desk.permit.blocked_by).startswith("ENC-09")
        first = desk.axis.alarms.first_out
        assert first is not None
        assert first.code == "SYS-03"
        desk.controller.alarms.scan()
        row = desk.controller.alarms.rows()["alarms"][0]
        assert (row["code"], row["first_out"]) == ("SYS-03", True)
        assert row["values"] == {"late_s": 2.01, "limit_s": 0.05}
        assert (
            sum(text.startswith("SYS-03 STOP · controller frozen for 2.010 s") for text in texts(desk.memory))
            == 1
        )
        assert desk.ask("take", over=False) == ""
        assert desk.ask("power", on=True) == "PWR-04"
        assert desk.ask("reset") == ""
        desk.scans(2)
        assert desk.engine.system_stop is None
        assert desk.axis.alarms.first_out is None
        assert str(desk.permit.blocked_by) == ""
        assert desk.ask("power", on=True) == ""


def test_a_reset_does_not_acknowledge_a_stop_of_its_own_scan() -> None:
    """Nobody has seen it yet: it is reported, and holds the axis until the next reset."""
    delivered()
    with opened() as desk:
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        desk.engine.system_stop = LATE
        assert desk.ask("reset") == "CTL-14"
        assert desk.engine.system_stop is LATE
        assert desk.axis.alarms.first_out is not None
        desk.controller.alarms.scan()
        assert sum(text.startswith("SYS-03 STOP") for text in texts(desk.memory)) == 1
        assert desk.ask("power", on=True) == "PWR-04"
        assert desk.ask("reset") == ""
        desk.scans(2)
        assert desk.engine.system_stop is None
        assert desk.ask("power", on=True) == ""


@pytest.mark.parametrize(("change", "code"), [(lost_turns, "ENC-08"), (moved_while_off, "ENC-09")])
def test_a_service_that_is_started_anew_asks_again(change: Callable[[Retained], Retained], code: str) -> None:
    """What nobody has acknowledged is not forgotten by ending the service."""
    delivered()
    before = retained(change)
    for _ in range(2):
        with opened() as desk:
            desk.scans(3)
            assert str(desk.permit.blocked_by).startswith(code)
            desk.controller._close(None)
    assert retained().rest_position_counts == before.rest_position_counts


def test_a_motion_while_off_that_was_acknowledged_is_forgotten() -> None:
    delivered()
    retained(moved_while_off)
    with opened() as desk:
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        assert desk.ask("reset") == ""
        desk.controller._close(None)
    with opened() as desk:
        assert str(desk.permit.blocked_by) == ""


# --- the brake ------------------------------------------------------------------------------------


def brake_slipped(kept: Retained) -> Retained:
    return replace(kept, error_stop="BRK-04")


def test_a_locked_alarm_of_an_earlier_run_is_reset_by_service_only_and_in_two_steps() -> None:
    delivered()
    retained(brake_slipped)
    with opened() as desk:
        desk.scans(3)
        assert desk.permit.reset_locked
        assert desk.ask("take", over=False) == ""
        assert desk.ask("reset") == "CTL-14"
        assert desk.ask("power", on=True) == "PWR-04"
        # A reset that was refused lets the next start forget nothing.
        assert desk.controller.retainer.retained.error_stop == "BRK-04"
        assert desk.ask("take", SERVICE, over=True) == ""
        assert desk.ask("reset", SERVICE) == "SEC-10"
        assert desk.ask("arm", SERVICE, action="reset_locked") == ""
        assert desk.ask("reset", SERVICE) == ""
        assert not desk.permit.reset_locked
        assert desk.ask("power", SERVICE, on=True) == ""


def test_a_brake_test_is_kept_and_clears_the_due_date_and_is_in_the_journal() -> None:
    delivered()
    retained(lambda kept: replace(kept, brake_tested_at="2020-01-01T00:00:00Z"))
    with opened() as desk:
        desk.scans(3)
        assert desk.controller.brake.slow()["brake_test_overdue"]
        assert desk.axis.motion.brake_overdue
        assert desk.ask("take", SERVICE, over=False) == ""
        assert desk.ask("arm", SERVICE, action="brake_test") == ""
        assert desk.ask("brake_test", SERVICE) == ""
        assert desk.controller.brake.slow()["brake_tests"] == 0  # it is under way
        desk.scans(7000)
        shown = desk.controller.brake.slow()
        assert shown["brake_tests"] == 1
        assert shown["brake_test_result"] == "passed"
        assert not shown["brake_test_overdue"]
        assert not desk.axis.motion.brake_overdue
        said = texts(desk.memory)
        assert any(text.startswith("brake test overdue") for text in said)
        assert any(text.startswith("brake test passed") and "due 2" in text for text in said)
        desk.controller._close(None)
    assert retained().brake_tests == 1


def test_a_failed_brake_still_holds_after_a_start_and_is_not_counted_twice() -> None:
    delivered()
    retained(lambda kept: replace(kept, brake_failed="+40.0 N m reached", brake_test_outcome="failed"))
    for _ in range(2):
        with opened() as desk:
            desk.scans(3)
            assert desk.controller.brake.slow()["brake_test_result"] == "failed"
            assert desk.ask("take", over=False) == ""
            assert desk.ask("power", on=True) == "PWR-04"
            desk.controller._close(None)
    kept = retained()
    assert kept.brake_failed == "+40.0 N m reached"
    assert len([alarm for alarm in kept.alarms if alarm.code == "BRK-08"]) == 0


# --- what a scan must not do ----------------------------------------------------------------------


@pytest.mark.parametrize("raised", [UsageError("a ring"), DeviceError("a disk"), RuntimeError("a program")])
def test_whatever_a_scan_raises_the_axis_comes_to_rest_and_it_is_remembered(raised: Exception) -> None:
    delivered()
    with opened() as desk:
        desk.moving()
        desk.memory.words[Word.CONTROLLER_CLEAN] = 0
        usual = desk.engine.drive.write

        def write(output: OutputImage) -> None:
            desk.engine.drive.write = usual
            raise raised

        desk.engine.drive.write = write
        assert desk.controller.run(real_time=False) == AlarmStop.exit_code
        drive = desk.engine.image.drive
        # StopProgram's own limit of rest, 0.5 rad/s at the motor
        assert abs(drive.vel_act_rad_s) < 0.5
        assert not drive.brake_open
        assert desk.engine.output.request is DriveRequest.DISABLE
        assert desk.memory.words[Word.CONTROLLER_CLEAN] == 0
        assert any(text.startswith("SYS-09 STOP") and str(raised) in text for text in texts(desk.memory))
    assert retained().error_stop == "SYS-09"
    with opened() as desk:
        assert "SYS-09 stopped the axis" in str(desk.permit.blocked_by)


def test_a_controller_whose_program_has_failed_holds_what_torque_alone_holds_until_it_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It goes on to tell its state, and ends as one that holds a load is ended: 20 s after it was asked."""
    monkeypatch.setattr(process, "END_S", 0.0)
    held = OutputImage(DriveRequest.ENABLE, 0.0, 10.0, torque_holds=True)
    delivered()
    with opened() as desk:
        told: list[OutputImage] = []
        after = desk.controller._after_scan

        def scan(image: object) -> OutputImage:
            if told:
                raise ArithmeticError("planted")
            return held

        def looked(publisher: Any) -> bool:
            told.append(desk.engine.output)
            if len(told) == 1000:
                desk.controller.end()
            return after(publisher)

        desk.engine.program.scan = scan
        desk.controller._after_scan = looked
        assert desk.controller.run(real_time=False) == AlarmStop.exit_code
        # The first is of the program itself.
        assert len(told) >= 1000
        assert set(told[1:]) == {held._replace(lamp=True)}
        assert any(
            "torque goes on holding the load" in text or "Torque kept" in text for text in texts(desk.memory)
        )
        assert any(text.startswith("SYS-09 STOP") for text in texts(desk.memory))


def test_a_state_that_cannot_be_kept_is_said_by_the_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk has a thread of its own; the event ring has one writer, the scan."""
    delivered()
    with opened() as desk:
        writers = set()
        put = desk.operator.events.put

        def watched(*arguments: Any, **values: Any) -> int:
            writers.add(threading.current_thread())
            return put(*arguments, **values)

        def fails(*_: object) -> None:
            raise DeviceError("no space left")

        monkeypatch.setattr(desk.operator.events, "put", watched)
        monkeypatch.setattr("gantryctl.service.controller.retainer.keep_machine", fails)
        desk.controller.retainer.start("power off")
        desk.controller.retainer.join()
        desk.scans(2)
        assert texts(desk.memory)[-1] == "the state was not kept: no space left"
        assert writers == {threading.main_thread()}


def test_a_brake_that_fails_holds_the_machine_over_a_start_until_service_resets() -> None:
    weak = with_values(MACHINE, {"plant.brake.torque_share": 0.1})
    with opened(weak) as desk:
        desk.scans(3)
        assert desk.ask("take", SERVICE, over=False) == ""
        assert desk.ask("arm", SERVICE, action="brake_test") == ""
        assert desk.ask("brake_test", SERVICE) == ""
        desk.scans(7000)
        assert desk.ask("power", SERVICE, on=True) == "PWR-04"
        desk.controller._close(None)
    assert [alarm.code for alarm in retained().alarms] == ["BRK-08"]
    with opened(weak) as desk:
        desk.scans(3)
        assert desk.ask("take", SERVICE, over=False) == ""
        assert desk.ask("power", SERVICE, on=True) == "PWR-04"
        assert desk.ask("reset", SERVICE) == "SEC-10"
        assert desk.ask("arm", SERVICE, action="reset_locked") == ""
        assert desk.ask("reset", SERVICE) == ""
        assert desk.ask("power", SERVICE, on=True) == ""
        desk.scans(2000)
        assert desk.axis.power.status
        desk.controller._close(None)
    assert retained().brake_failed == ""


def test_a_reason_too_long_for_a_reply_is_refused_without_its_values_and_stops_no_scan() -> None:
    delivered()
    with opened() as desk:
        why = {"parameters": "a parameter of the drive; " * 100}
        desk.permit.reasons = (Reason(Code.CFG_CAN_01, why, ClearedBy.RESET),)
        desk.scans(3)
        assert desk.ask("take", over=False) == ""
        assert desk.ask("power", on=True) == "PWR-04"


def test_a_machine_file_that_has_changed_since_the_start_starts_no_controller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(process, "die_with_parent", lambda _: None)
    memory, config = SharedMemory.create(), tmp_path / "machine.toml"
    config.write_bytes(default_machine_path().read_bytes())
    before = config_hash(load_machine(config))
    text = config.read_text(encoding="utf-8")
    config.write_text(text.replace("kpp_per_s = 10.0", "kpp_per_s = 10.5"), encoding="utf-8")
    with pytest.raises(ConfigError, match="has changed since the service was started"):
        process.main([str(memory.handle), str(config), before, str(tmp_path)])
    memory.close()


# --- hours of service -------------------------------------------------------------------------------


def a_day(desk: Desk) -> None:
    """Everything that people do, and what goes wrong, with writes of the state in their threads."""
    assert desk.ask("take", SERVICE, over=True) == ""
    for refused in ({"tag": "nothing"}, {"tag": "increment_deg", "value": "1"}, {"tag": "increment_deg"}):
        assert desk.ask("set", SERVICE, **refused) == "SEC-05"
    assert desk.ask("take", ALICE, over=True) == ""
    assert desk.ask("power", on=True) == ""
    desk.scans(3000)
    assert desk.ask("move", target_deg=500.0) != ""
    assert desk.ask("move", target_deg=1.0 if desk.axis.pos_act_rad < 0.0 else -1.0) == ""
    desk.scans(500)
    assert desk.ask("stop") == ""
    desk.scans(1500)
    assert desk.ask("mode", mode="continuous") == ""
    assert desk.ask("jog", lease=f"{desk.seq:016x}", direction="forward") == ""
    desk.scans(800)  # the lease runs out
    assert desk.ask("quick_stop") == ""
    assert desk.ask("power", on=False) == ""
    desk.scans(1000)
    desk.engine.system_stop = LATE
    desk.scans(10)
    assert desk.ask("reset") == ""
    desk.controller.retainer.join()
    assert not desk.controller.retainer.faults
    for ring in desk.memory.events:
        ring.clear()
    desk.memory.rows.clear()


def test_a_day_leaves_nothing_that_only_a_garbage_collector_would_free() -> None:
    """The process of the scan has none: objects that refer to each other were 1 MB an hour once."""
    with opened() as desk:
        controller = desk.controller
        publisher = Publisher(
            MACHINE, desk.engine, desk.operator, controller.alarms, controller.brake, controller._recorder,
            desk.memory, real_time=False, version="test",
        )  # fmt: skip
        after = desk.after

        def with_publisher(engine: Engine) -> bool:
            publisher.scan()
            return after(engine)

        desk.after = with_publisher  # type: ignore[method-assign]
        a_day(desk)
        gc.collect()
        gc.disable()
        try:
            a_day(desk)
            gc.set_debug(gc.DEBUG_SAVEALL)
            gc.collect()
            left = [repr(each)[:200] for each in gc.garbage]
        finally:
            gc.set_debug(0)
            gc.garbage.clear()
            gc.enable()
        assert not left
