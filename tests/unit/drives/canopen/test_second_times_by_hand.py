"""What counts anew: the second complaint, full queue, wrong length, silence; and what a drive lacks, by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.brake import BrakeControl
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.diagnostics import TpdoWatch
from gantryctl.drives.canopen.emergency import EmergencyLog
from gantryctl.drives.canopen.nodes.outputs import Watchdog
from gantryctl.drives.canopen.process_image import ProcessImage
from gantryctl.drives.canopen.settings import LoadEncoderSettings
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.image import DriveRequest, DriveState, LinkFlag
from unit.drives.canopen.canopen_bench import Bench
from unit.drives.canopen.dictionary import Dictionary, settings
from unit.drives.canopen.test_in_motion_by_hand import Stop
from unit.drives.canopen.test_nodes_by_hand import neighbours
from unit.drives.canopen.test_scan_by_hand import HEARTBEAT, RPDO_1, sent_from_now, statuswords
from unit.drives.canopen.test_set_up_by_hand import UNUSED
from unit.drives.canopen.test_supervision_by_hand import Watched
from unit.drives.canopen.test_wire import ALL, TPDO_1, TPDO_2, Telegrams

pytestmark = pytest.mark.can

S, R = DriveState, DriveRequest


def test_a_complaint_behind_another_one_is_told_with_its_own_code_and_time() -> None:
    """Of 4 ms a scan: 30 ms are eight scans, a second is 250."""
    drive = Watched()
    drive.scan()
    drive.node.emergencies.take(bytes.fromhex("10 23 02"), 1)
    assert [drive.scan() for _ in range(100)][-1] == LinkFlag.EMERGENCY
    drive.node.emergencies.take(bytes.fromhex("10 43 08"), 101)
    flags = [drive.scan() for _ in range(300)]
    assert [k for k, flag in enumerate(flags) if flag] == list(range(8 + 251))
    drive.node.emergencies.take(bytes.fromhex("10 43 08"), 401)
    drive.scan()
    assert drive.watch.complaint == 0x4310


def test_a_drive_that_complains_all_the_time_is_told_30_ms_after_it_began() -> None:
    """Every 20 ms, five scans, sooner than a fault state must show."""
    drive, told = Watched(), []
    drive.scan()
    for scan in range(30):
        if scan % 5 == 0:
            drive.node.emergencies.take(bytes.fromhex("10 43 08"), scan)
        told.append(LinkFlag.EMERGENCY in drive.scan())
    assert told == [False] * 8 + [True] * 22


@pytest.mark.parametrize("then", ["10 81 10", "00 00 00"])
def test_a_complaint_is_told_whatever_follows_it_in_its_scan(then: str) -> None:
    """An overrun, which is a warning, or "no error any more"."""
    drive = Watched()
    drive.scan()
    for data in ("10 23 02", then):
        drive.node.emergencies.take(bytes.fromhex(data), 1)
    flags = [drive.scan() for _ in range(9)]
    assert flags == [LinkFlag.NONE] * 8 + [LinkFlag.EMERGENCY]
    assert drive.watch.complaint == 0x2310


def test_each_full_queue_is_told_in_its_own_scan() -> None:
    drive = Watched()
    told = []
    for full in (0, 1, 1, 1, 3, 3):
        drive.wire.queue_full = full
        told.append(drive.scan())
    assert [flag == LinkFlag.QUEUE_FULL for flag in told] == [False, True, False, False, True, False]


@pytest.mark.parametrize(
    ("state", "request_", "told"),
    [
        (S.SWITCH_ON_DISABLED, R.ENABLE, True), (S.SWITCH_ON_DISABLED, R.DISABLE, False),
        (S.SWITCHED_ON, R.DISABLE, True), (S.FAULT, R.FAULT_RESET, False),
    ],
)  # fmt: skip
def test_local_control_is_told_where_the_drive_is_wanted_or_is_on(
    state: DriveState, request_: DriveRequest, told: bool
) -> None:
    drive = Watched()
    flags = [drive.scan(state, 0x0040, request_) for _ in range(4)]
    assert (flags[-1] == LinkFlag.LOCAL_CONTROL) is told


def test_wrong_lengths_count_in_a_row_only() -> None:
    watch, rows = TpdoWatch(2), []
    for data in (b"a", b"abc", b"ab", b"a", b"ab", b""):
        watch.begin()
        watch.take(data, in_time=True)
        watch.settle()
        rows.append(watch.wrong_in_row)
    assert (rows, watch.wrong_length) == ([1, 2, 0, 1, 0, 1], 4)


def test_the_way_of_a_silence_is_no_speed() -> None:
    """Without 606C: 1000 increments in 4 ms, then a silence in which the shaft turns by half a turn."""
    bus = Telegrams(frozenset())
    for position in ("00 00 08 00", "E8 03 08 00"):
        bus.sync((0x182, f"37 12 {position}"))
    speed = 1000 / 524_288 * math.tau / 0.004
    assert bus.image.vel_rad_s == pytest.approx(speed)
    bus.image.forget()
    bus.sync((0x182, "37 12 E8 03 0C 00"))
    assert bus.image.vel_rad_s == pytest.approx(speed)


def test_a_program_that_ends_in_a_proof_of_silence_speaks_for_its_last_scans(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench().open().enable()
    bench.drive.silent_process_data = bench.drive.silent_heartbeat = True
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    bench.drive.close()
    assert sent
    assert sent[-1].startswith("00 00")


def test_the_state_of_a_drive_that_is_off_is_asked_for_until_it_is_known() -> None:
    """Every 20 ms, behind the word that has stopped it."""
    drive, asked = Stop(), []
    for _ in range(12):
        drive.scan(0x00)
        asked.append(len(drive.asked.reads))
    assert asked == [0, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 3]
    assert set(drive.asked.reads) == {(0x6041, 0)}
    drive.asked.then(bytes.fromhex("40 02"))
    drive.scan(0x00, scans=100)
    assert (len(drive.asked.reads), drive.stop.state) == (3, S.SWITCH_ON_DISABLED)


def test_the_frames_before_the_first_scan_are_no_load() -> None:
    drive = Watched()
    drive.wire.traffic.bits = 10_000_000
    assert {drive.scan() for _ in range(6)} == {LinkFlag.NONE}


def test_what_pads_the_answer_about_the_mode_means_nothing() -> None:
    drive = Watched()
    drive.scan()
    drive.watch.ask(True)
    drive.asked.then(bytes.fromhex("09 FF 00 12"))
    assert drive.scan() == LinkFlag.NONE


def test_a_second_telegram_of_the_wrong_length_counts_too() -> None:
    bus = Telegrams(ALL)
    for row in range(1, 4):
        assert bus.sync((0x182, TPDO_1), (0x282, TPDO_2[:-3])).wrong_lengths == row


def test_the_latest_64_messages_are_kept() -> None:
    log = EmergencyLog()
    for number in range(70):
        log.take(bytes((number, 0x23)), number)
    assert [message.scan for message in log.messages] == list(range(6, 70))
    assert log.count == 70


def test_the_watchdog_goes_on_behind_a_failure_where_it_stood() -> None:
    """An edge every second scan of 10 ms for a relay of 0.1 s: a failure is no part of the two scans."""
    watchdog = Watchdog(0.1, 0.01)
    levels = [watchdog.scan(well) for well in (True, False, False, False, True, True, True, True)]
    assert levels == [True, True, True, True, True, False, False, True]


# --- the brake of the drive -------------------------------------------------------------------------------------------


def test_an_enable_that_ends_at_once_takes_the_torque_at_once() -> None:
    """The first way down was ended by the drive in its third scan; then the drive is enabled for one scan only."""
    brake = BrakeControl(settings())
    brake.word(0x0F, S.OPERATION_ENABLED, R.ENABLE, True)
    assert [brake.word(0x0F, S.OPERATION_ENABLED, R.ENABLE, False) for _ in range(3)] == [0x07] * 3
    brake.word(0x00, S.SWITCHED_ON, R.DISABLE, False)
    assert brake.word(0x00, S.OPERATION_ENABLED, R.DISABLE, False) == 0x00


def test_torque_that_goes_at_once_waits_for_no_order_of_the_way_down() -> None:
    """The drive ramps for its brake, and its encoder is found wrong: 07 would go on for 0.35 s."""
    brake = BrakeControl(settings())
    brake.word(0x0F, S.OPERATION_ENABLED, R.ENABLE, True)
    assert brake.word(0x0F, S.OPERATION_ENABLED, R.ENABLE, False) == 0x07
    assert brake.word(0x00, S.OPERATION_ENABLED, R.DISABLE, False) == 0x07
    assert brake.word(0x00, S.OPERATION_ENABLED, R.DISABLE, False, at_once=True) == 0x00
    assert brake.word(0x00, S.OPERATION_ENABLED, R.DISABLE, False) == 0x00


def test_a_disable_in_the_way_down_leaves_the_next_enable_free() -> None:
    brake = BrakeControl(settings())
    brake.word(0x0F, S.OPERATION_ENABLED, R.ENABLE, True)
    brake.word(0x0F, S.OPERATION_ENABLED, R.ENABLE, False)
    assert brake.word(0x00, S.OPERATION_ENABLED, R.DISABLE, False) == 0x07
    assert brake.word(0x0F, S.SWITCHED_ON, R.ENABLE, False) == 0x0F


# --- scans of the drive -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("scans", "flag"), [(3, LinkFlag.NONE), (4, LinkFlag.IGNORES_COMMAND)])
def test_a_drive_has_three_scans_to_obey(monkeypatch: pytest.MonkeyPatch, scans: int, flag: LinkFlag) -> None:
    bench = Bench().open().enable()
    statuswords(bench, monkeypatch, lambda word: word & ~(1 << 12))
    bench.drive._enabling = scans - 1
    assert bench.scan().link == flag
    bench.drive.close()


def test_the_first_command_brings_a_heartbeat(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench().open()
    sent = sent_from_now(bench, monkeypatch, HEARTBEAT)
    bench.scan(R.DISABLE)
    assert sent == ["05"]
    bench.drive.close()


def test_a_proof_of_silence_begins_with_the_word_that_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    """No word follows the state of the drive in it: the first one must not enable."""
    bench = Bench().open()
    bench.drive.silent_heartbeat = True
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    bench.scan()
    assert sent[0].startswith("00 00")
    bench.drive.close()


@pytest.mark.parametrize("low", [0x08, 0x0F])
@pytest.mark.parametrize(
    ("by_telegram", "by_message", "asked_for", "shown", "asks"),
    [
        (0x7305, 0x8110, 0, 0x7305, False), (0, 0x2310, 0x3210, 0x2310, False), (0, 0, 0x3210, 0x3210, True),
        # A warning explains no fault: CAN overrun.
        (0, 0x8110, 0x3210, 0x3210, True),
    ],
)  # fmt: skip
def test_the_code_of_a_fault_is_that_of_the_telegram_then_of_the_message(
    monkeypatch: pytest.MonkeyPatch,
    low: int,
    by_telegram: int,
    by_message: int,
    asked_for: int,
    shown: int,
    asks: bool,
) -> None:
    """In Fault and on the ramp that leads there."""
    bench = Bench().open()
    bench.run(0.02, R.DISABLE)
    drive, unknown = bench.drive, list[bool]()
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | low)
    monkeypatch.setattr(ProcessImage, "error_code", by_telegram)
    monkeypatch.setattr(drive.parameter_watch, "scan", lambda periods, fault: unknown.append(fault))
    drive.node.emergencies.code, drive.parameter_watch.error_code = by_message, asked_for
    assert bench.scan(R.DISABLE).error_code == shown
    bench.scan(R.DISABLE)
    assert unknown[-1] is asks
    drive.close()


def test_nodes_beside_grow_old_by_the_scans_that_were_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, periods = Bench().open(), list[int]()
    monkeypatch.setattr(bench.drive.beside, "begin", periods.append)
    monkeypatch.setattr(bench.drive, "_periods", lambda: 7)
    bench.scan(R.DISABLE)
    assert periods == [7]
    bench.drive.close()


def test_in_a_silence_the_time_of_a_stepped_drive_goes_on_by_a_period() -> None:
    bench, passed = Bench().open(), list[float]()
    bench.run(0.02, R.DISABLE)
    plant: Any = SimpleNamespace(let_pass=passed.append)
    virtual, bench.drive.plant = bench.drive.plant, plant
    for silent in (True, False):
        bench.drive.silent_process_data = silent
        bench.scan(R.DISABLE)
        assert passed == [0.004]
    bench.drive.plant = virtual
    bench.drive.close()


def test_the_last_scans_of_a_drive_that_stays_on_last_3_s(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, scans = Bench().open(), list[int]()
    on = bench.run(0.02, R.DISABLE)._replace(state=S.OPERATION_ENABLED)

    def seen() -> Any:
        scans.append(1)
        return on

    monkeypatch.setattr(bench.drive, "read", seen)
    assert not bench.drive._comes_to_rest()
    assert len(scans) == 750
    bench.link.close()


def test_the_first_answer_is_waited_for_half_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """The answers of a scan have 2 ms; a drive that has just been started may be busy."""
    collect, waits_s = ProcessImage.collect, list[float]()

    def waited(image: ProcessImage, answer_s: float) -> None:
        waits_s.append(answer_s)
        collect(image, answer_s)

    monkeypatch.setattr(ProcessImage, "collect", waited)
    bench = Bench().open()
    assert waits_s == [0.5]
    bench.drive.close()


# --- what a drive lacks ---------------------------------------------------------------------------------------------


def test_telegrams_are_numbered_without_a_gap() -> None:
    """A drive with neither speed nor inputs nor error code has no second telegram of its own."""
    for present, numbers in ((frozenset[m.Signal](), [0, 1]), (frozenset({m.VELOCITY}), [0, 1, 2])):
        plan = m.plan_mapping(present, False, (m.RING_POSITION,))
        assert [pdo.number for pdo in plan.tpdos] == numbers
        assert plan.tpdos[-1].signals == (m.RING_POSITION,)


def test_what_a_drive_refuses_to_map_is_told() -> None:
    """60B2, the third object of the first telegram: it stays out, and the ledger knows that the drive has it."""
    sizes = {0x60B2: 2, 0x606C: 4, 0x6077: 2}
    sdo = Dictionary({**UNUSED, **{(obj, 0): 0 for obj in sizes}}, sizes)
    sdo.refused[0x1600, 3] = 0x0604_0041
    found = m.configure(sdo, 2, False)  # type: ignore[arg-type]
    assert found.refused == {m.TORQUE_OFFSET}
    assert m.TORQUE_OFFSET not in found.signals
    assert {m.VELOCITY, m.TORQUE} <= found.signals


@pytest.mark.parametrize(
    ("objects", "alone"),
    [
        ({}, False),
        ({(0x1016, 1): ObjectFact(True, False, 0)}, True),
        ({(0x1016, 1): ObjectFact(False, False, 0)}, False),
        # 100 ms of node 127 are there and stay.
        ({(0x1016, 1): ObjectFact(False, False, 0x007F_0064)}, True),
        ({(0x1016, 1): ObjectFact(True, False, 0), (0x1400, 5): ObjectFact(True, False, 0)}, False),
        ({(0x1016, 1): ObjectFact(True, False, 0), (0x1400, 5): ObjectFact(False, False, 0)}, True),
        ({(0x1016, 1): ObjectFact(True, False, 0), (0x1400, 5): ObjectFact(False, False, 50)}, False),
    ],
)
def test_only_a_drive_without_a_deadline_of_its_commands_misses_the_heartbeat_sooner(
    objects: dict[tuple[int, int], ObjectFact], alone: bool
) -> None:
    used = settings(lone_heartbeat_s=0.1).of_drive(DriveFacts(1, 2, 3, 4, "", objects))
    assert (used.watched_alone, used.watch_s) == (alone, 0.1 if alone else 0.15)


def test_a_ring_at_the_drive_goes_on_over_the_end_of_its_turn() -> None:
    """60E4 counts 2^20 steps in a turn and begins at 0 again."""
    beside = neighbours(load_encoder=LoadEncoderSettings(None, 1 << 20, 0, False))
    beside.open()
    seen = []
    for raw in ((1 << 20) - 3, (1 << 20) - 1, 1):
        beside.begin(1)
        seen.append(beside.ring_rad(SimpleNamespace(ring=(raw, 0))))  # type: ignore[arg-type]
    assert seen == pytest.approx([step / (1 << 20) * math.tau for step in (-3, -1, 1)], abs=1e-9)


@pytest.mark.parametrize(("lacks", "timeout"), [(False, 38), (True, None)])
def test_a_drive_without_a_heartbeat_is_not_lost_for_it(
    monkeypatch: pytest.MonkeyPatch, lacks: bool, timeout: int | None
) -> None:
    """150 ms are 37.5 scans of 4 ms."""
    bench = Bench()
    read = bench.drive.node.sdo.read

    def reads(index: int, sub: int) -> bytes:
        if lacks and index == 0x1017:
            raise SdoError(index, sub, 0x0602_0000)
        return read(index, sub)

    monkeypatch.setattr(bench.drive.node.sdo, "read", reads)
    bench.open()
    assert bench.drive._heartbeat_timeout == timeout
    bench.drive.close()
