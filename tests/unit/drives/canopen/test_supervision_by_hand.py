"""Supervision of a drive scan by scan, by hand: complaints, mode and target, load of the bus, a second sender."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gantryctl.drives.canopen.emergency import EmergencyLog
from gantryctl.drives.canopen.supervision import Supervision
from gantryctl.image import DriveRequest, DriveState, LinkFlag
from unit.drives.canopen.dictionary import settings
from unit.drives.canopen.wire import Asked, Wire, remote_node

pytestmark = pytest.mark.can

S, R = DriveState, DriveRequest
ENABLED, ON = S.OPERATION_ENABLED, R.ENABLE


class Watched:
    """Supervision of a drive in Operation enabled, with fake telegrams."""

    def __init__(self, period_s: float = 0.004, **changes: object) -> None:
        self.wire, self.asked = Wire(), Asked()
        self.node = remote_node(self.wire)
        self.node.emergencies = EmergencyLog()
        self.process = SimpleNamespace(
            age=0, inputs_age=0, wrong_lengths=0, contradicted=0, congested=False, crowded=False
        )
        used = settings(period_s=period_s, **changes)
        self.watch = Supervision(self.node, self.process, self.asked, used)  # type: ignore[arg-type]
        self.now = 0

    def scan(self, state: DriveState = ENABLED, status: int = 0x1237, request: DriveRequest = ON) -> LinkFlag:
        self.now += 1
        return self.watch.flags(self.now, state, status, request)


def test_an_enabled_drive_is_asked_for_its_mode_every_time() -> None:
    """Every 0.1 s, 25 scans; a drive at rest for mode and target in turn."""
    drive = Watched()
    for enabled, objects in ((True, [0x6061] * 4), (False, [0x60FF, 0x6061, 0x60FF, 0x6061])):
        drive.asked.reads.clear()
        for _ in range(100):
            drive.scan()
            drive.watch.ask(enabled)
        assert drive.asked.reads == [(obj, 0) for obj in objects]


def test_an_answer_that_is_slow_is_waited_for_as_long_again() -> None:
    """Asked in scans 1, 51 and 101: a question every scan would throw each answer away."""
    drive, asked = Watched(), []
    for _ in range(101):
        drive.scan()
        drive.watch.ask(True)
        drive.asked.waiting = True
        asked.append(len(drive.asked.reads))
    assert asked == [1] * 50 + [2] * 50 + [3]


@pytest.mark.parametrize("telegram", ["age", "inputs_age"])
def test_either_telegram_that_is_missing_is_told(telegram: str) -> None:
    drive = Watched()
    setattr(drive.process, telegram, 1)
    assert drive.scan() == LinkFlag.LATE


@pytest.mark.parametrize(
    ("data", "flag"),
    [
        ("09", LinkFlag.NONE),
        ("08", LinkFlag.WRONG_MODE),
        ("00", LinkFlag.WRONG_MODE),
        ("F7", LinkFlag.WRONG_MODE),
    ],
)
def test_any_mode_but_csv_is_told(data: str, flag: LinkFlag) -> None:
    drive = Watched()
    drive.scan()
    drive.watch.ask(True)
    drive.asked.then(bytes.fromhex(data))
    assert drive.scan() == flag
    assert drive.watch.forbids is bool(flag)


def test_a_target_that_is_told_after_the_enable_is_meant() -> None:
    drive = Watched()
    while drive.asked.reads[-1:] != [(0x60FF, 0)]:
        drive.scan(S.SWITCH_ON_DISABLED, 0x0240, R.DISABLE)
        drive.watch.ask(False)
    drive.watch.ask(True)
    drive.asked.then(bytes.fromhex("01 00 00 00"))
    assert drive.scan() == LinkFlag.NONE
    assert not drive.watch.forbids


@pytest.mark.parametrize("data", ["01 00 00 00", "00 01 00 00", "00 00 08 00", "00 00 00 FF"])
def test_any_speed_that_waits_in_a_resting_drive_is_told(data: str) -> None:
    drive = Watched()
    for word, flag in ((data, LinkFlag.STALE_TARGET), ("00 00 00 00", LinkFlag.NONE)):
        while drive.asked.reads[-1:] != [(0x60FF, 0)]:
            drive.scan(S.SWITCH_ON_DISABLED, 0x0240, R.DISABLE)
            drive.watch.ask(False)
        drive.asked.then(bytes.fromhex(word))
        drive.asked.reads.clear()
        assert drive.scan(S.SWITCH_ON_DISABLED, 0x0240, R.DISABLE) == flag
        assert drive.watch.forbids is bool(flag)


def test_a_complaint_without_a_fault_is_told_after_30_ms() -> None:
    drive = Watched()
    drive.scan()
    assert drive.watch.complaint == 0
    drive.node.emergencies.take(bytes.fromhex("10 23 02"), 1)
    # The scan that has seen it, and eight more (30 ms are 7.5 scans of 4 ms).
    flags = [drive.scan() for _ in range(10)]
    assert flags == [LinkFlag.NONE] * 8 + [LinkFlag.EMERGENCY] * 2
    assert drive.watch.complaint == 0x2310
    assert drive.scan(S.FAULT, 0x0208) == LinkFlag.NONE
    assert drive.watch.complaint == 0
    # A drive that is off has nothing to stop.
    drive.node.emergencies.take(bytes.fromhex("10 23 02"), 2)
    off = [drive.scan(S.SWITCH_ON_DISABLED, 0x0240, R.DISABLE) for _ in range(20)]
    assert set(off) == {LinkFlag.NONE}


def test_a_drive_under_local_control_is_told_after_three_scans() -> None:
    drive = Watched()
    assert [drive.scan(status=0x1037) for _ in range(5)] == [LinkFlag.NONE] * 3 + [LinkFlag.LOCAL_CONTROL] * 2
    assert drive.scan() == LinkFlag.NONE
    # Bit 9 of some drives means nothing.
    other = Watched(remote_bit=False)
    assert {other.scan(status=0x1037) for _ in range(5)} == {LinkFlag.NONE}
    # Of one whose state is not known nothing is known, whatever is asked of it.
    assert {drive.scan(S.UNKNOWN, 0x1037) for _ in range(8)} == {LinkFlag.NONE}
    assert [drive.scan(status=0x1037) for _ in range(4)] == [LinkFlag.NONE] * 3 + [LinkFlag.LOCAL_CONTROL]


@pytest.mark.parametrize(
    ("gaps", "told"), [((0,), False), ((0, 1), True), ((0, 2), True), ((0, 3), False), ((0, 9), False)]
)
def test_two_contradictions_within_three_scans_are_another_sender(gaps: tuple[int, ...], told: bool) -> None:
    drive = Watched()
    seen = LinkFlag.NONE
    for k in range(12):
        drive.process.contradicted += k in gaps
        seen |= drive.scan()
    assert bool(seen & LinkFlag.TWO_SENDERS) is told


@pytest.mark.parametrize("state", [S.READY_TO_SWITCH_ON, S.SWITCHED_ON, ENABLED, S.QUICK_STOP_ACTIVE])
def test_a_complaint_is_told_for_a_second(state: DriveState) -> None:
    """From 30 ms on, eight scans of 4 ms, for 250 more."""
    drive = Watched()
    drive.scan(state)
    drive.node.emergencies.take(bytes.fromhex("10 23 02"), 1)
    flags = [drive.scan(state) for _ in range(300)]
    assert [k for k, flag in enumerate(flags) if flag] == list(range(8, 8 + 251))
    assert set(flags) == {LinkFlag.NONE, LinkFlag.EMERGENCY}
    assert drive.watch.complaint == 0


@pytest.mark.parametrize("state", [S.SWITCH_ON_DISABLED, S.NOT_READY_TO_SWITCH_ON, S.UNKNOWN])
def test_a_drive_that_complains_and_switches_itself_off_is_told(state: DriveState) -> None:
    """Off is no fault state: nothing else tells why."""
    drive = Watched()
    drive.scan()
    drive.node.emergencies.take(bytes.fromhex("10 23 02"), 1)
    drive.scan()
    flags = [drive.scan(state, 0x0240) for _ in range(8)]
    assert (flags, drive.watch.complaint) == ([LinkFlag.NONE] * 7 + [LinkFlag.EMERGENCY], 0x2310)


@pytest.mark.parametrize(("messages", "told"), [(10, False), (11, True)])
def test_more_than_ten_messages_in_a_second_are_a_flood_until_the_next(messages: int, told: bool) -> None:
    """Warnings, which are no complaint of their own; a second has 250 scans."""
    drive = Watched()
    drive.scan()
    for _ in range(messages):
        drive.node.emergencies.take(bytes.fromhex("20 81 10"), 1)
    assert (drive.scan() == LinkFlag.EMERGENCY_FLOOD) is told
    # Seconds begin at scans 1 and 251; this was scan 2.
    later = [drive.scan() for _ in range(260)]
    assert [flag == LinkFlag.EMERGENCY_FLOOD for flag in later] == [told] * 248 + [False] * 12
    for _ in range(messages):
        drive.node.emergencies.take(bytes.fromhex("20 81 10"), 1)
    assert (drive.scan() == LinkFlag.EMERGENCY_FLOOD) is told


def test_local_control_of_one_time_does_not_count_with_that_of_another() -> None:
    drive = Watched()
    for _ in range(5):
        assert {drive.scan(status=0x1037) for _ in range(3)} == {LinkFlag.NONE}
        assert drive.scan() == LinkFlag.NONE


def test_what_was_contradicted_while_the_drive_was_set_up_is_no_second_sender() -> None:
    drive = Watched()
    drive.process.contradicted = 5
    drive.watch.begin()
    assert {drive.scan() for _ in range(5)} == {LinkFlag.NONE}


@pytest.mark.parametrize(
    ("congested", "told"),
    [
        ({1}, set()), ({1, 2}, {2}), ({1, 2, 3}, {*range(2, 11)}), ({1, 4, 10}, {10}), ({1, 4, 11}, set()),
        ({1, 4, 7, 12}, {7, 8, 9, 10, 12, 13}),
    ],
)  # fmt: skip
def test_frames_that_wait_before_two_scans_or_three_of_ten_are_too_many(
    congested: set[int], told: set[int]
) -> None:
    drive, seen = Watched(), set()
    for scan in range(1, 20):
        drive.process.congested = scan in congested
        if drive.scan() & LinkFlag.OVERLOADED:
            seen.add(scan)
    assert seen == told


@pytest.mark.parametrize(("frames", "crowded"), [(85, False), (86, True)])
def test_frames_of_others_crowd_the_bus_with_a_fifth_of_its_bits(frames: int, crowded: bool) -> None:
    """Of 20 000 in 20 ms 4000 are 85.1 frames of 47 bits. Only those of the last five scans count."""
    drive, seen = Watched(), []
    for scan in range(1, 13):
        # Between the measurements at scans 1, 6 and 11: some that a filter kept away, and some that were received.
        if scan == 3:
            drive.wire.traffic.filtered += frames - 30
            drive.node.unknown += 30
        drive.scan()
        seen.append(drive.process.crowded)
    assert seen == [False] * 5 + [crowded] * 5 + [False] * 2


def test_frames_of_others_before_the_set_up_crowd_nothing() -> None:
    drive = Watched()
    drive.wire.traffic.filtered, drive.node.unknown = 1000, 1000
    drive.watch = Supervision(drive.node, drive.process, drive.asked, settings())  # type: ignore[arg-type]
    for _ in range(12):
        drive.scan()
        assert not drive.process.crowded


def test_the_load_of_scans_that_were_missed_is_spread_over_them() -> None:
    """Nine tenths of the bus, and every now and then eleven scans at once."""
    drive = Watched()
    for gap in (1, 1, 1, 1, 1, 12, 1, 1, 1, 1, 12, 12):
        drive.wire.traffic.bits += 3600 * gap
        drive.now += gap - 1
        assert drive.scan() == LinkFlag.NONE


@pytest.mark.parametrize(("lengths", "told"), [(2, False), (3, True)])
def test_three_wrong_lengths_are_no_mutilated_frame(lengths: int, told: bool) -> None:
    drive = Watched()
    drive.process.age = drive.process.wrong_lengths = lengths
    assert bool(drive.scan() & LinkFlag.WRONG_LENGTH) is told


def test_scans_of_40_ms_have_some_scans_for_each_time() -> None:
    """Three for a SYNC that is not seen and for a complaint, two for the load and for a question."""
    drive = Watched(0.040)
    asked = []
    for _ in range(8):
        drive.scan()
        drive.watch.ask(True)
        asked.append(len(drive.asked.reads))
    assert asked == [1, 1, 2, 2, 3, 3, 4, 4]
    drive.node.emergencies.take(bytes.fromhex("10 23 02"), 1)
    assert [drive.scan() for _ in range(5)] == [LinkFlag.NONE] * 3 + [LinkFlag.EMERGENCY] * 2
    drive, seen = Watched(0.040), []
    for scan in range(1, 8):
        # 40 000 bits in a scan: all of it in one of two, and then in both.
        drive.wire.traffic.bits += 40_000 * (scan in (2, 4, 5))
        seen.append(drive.scan())
    assert [k for k, flag in enumerate(seen, 1) if flag & LinkFlag.OVERLOADED] == [5, 6]
    for unseen, told in ((3, False), (4, True)):
        drive.wire.unseen = unseen
        assert bool(drive.scan() & LinkFlag.SYNC_UNSEEN) is told


@pytest.mark.parametrize(("unseen", "told"), [(8, False), (9, True)])
def test_sync_that_is_not_seen_for_30_ms_is_told(unseen: int, told: bool) -> None:
    drive = Watched()
    drive.wire.unseen = unseen
    assert bool(drive.scan() & LinkFlag.SYNC_UNSEEN) is told


@pytest.mark.parametrize(("bits", "told"), [(3800, False), (3801, True)])
def test_a_bus_with_more_than_95_percent_of_its_bits_is_full(bits: int, told: bool) -> None:
    """Measured over 20 ms, five scans: 20 000 bits at 1 Mbit/s, of which 19 000 may be used."""
    drive, seen = Watched(), LinkFlag.NONE
    for _ in range(12):
        drive.wire.traffic.bits += bits
        seen |= drive.scan()
    assert bool(seen & LinkFlag.OVERLOADED) is told


@pytest.mark.parametrize(
    ("elapsed_ms", "told"),
    [
        ((6.1, 6.1, 6.1), True), ((1.9, 1.9, 1.9), True), ((1.9, 6.1, 0.0), True), ((5.9, 2.1, 5.9), False),
        ((6.1, 6.1, 4.0), False), ((1.9, 4.0, 1.9), False),
    ],
)  # fmt: skip
def test_three_periods_off_by_more_than_half_are_told(elapsed_ms: tuple[float, ...], told: bool) -> None:
    """Too short ones as well: the drive interpolates over the 4 ms that it was told."""
    drive = Watched()
    for each in elapsed_ms:
        drive.watch.period(1e-3 * each)
    assert bool(drive.scan() & LinkFlag.SYNC_JITTER) is told
