"""Brake, stop by SDO, supervision and the nodes beside the drive, scan by scan, by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from gantryctl.drives.canopen.brake import BrakeControl
from gantryctl.drives.canopen.bus.node import NmtState
from gantryctl.drives.canopen.emergency import EmergencyLog
from gantryctl.drives.canopen.stop_by_sdo import StopBySdo
from gantryctl.drives.canopen.supervision import Supervision
from gantryctl.image import DriveRequest, DriveState, LinkFlag
from unit.drives.canopen.canopen_bench import Bench
from unit.drives.canopen.test_set_up_by_hand import Dictionary, settings
from unit.drives.canopen.wire import Asked, Wire, remote_node

pytestmark = pytest.mark.can

S, R = DriveState, DriveRequest
ENABLED, ON = S.OPERATION_ENABLED, R.ENABLE
# 150 ms of closing time are 37.5 scans of 4 ms, and with 200 ms more of patience 87.5.
CLOSING, PATIENCE = 38, 87

# --- brake --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("owner", ["object_60FE", "controller_output"])
@pytest.mark.parametrize("state", S)
def test_an_output_releases_the_brake_only_while_the_drive_turns(owner: str, state: DriveState) -> None:
    brake = BrakeControl(settings(brake_owner=owner))
    for release in (True, False):
        assert brake.word(0x0F, state, ON, release) == 0x0F
        assert brake.released is (release and state in (ENABLED, S.QUICK_STOP_ACTIVE))


def test_a_brake_at_an_output_is_closed_after_its_time() -> None:
    brake = BrakeControl(settings(brake_owner="object_60FE"))
    assert not brake.is_open(S.SWITCH_ON_DISABLED, None)
    brake.word(0x0F, ENABLED, ON, True)
    assert brake.is_open(ENABLED, None)
    seen = []
    for _ in range(CLOSING):
        brake.word(0x0F, ENABLED, ON, False)
        seen.append(brake.is_open(ENABLED, None))
    assert seen == [True] * (CLOSING - 1) + [False]


@pytest.mark.parametrize("owner", ["drive", "object_60FE"])
@pytest.mark.parametrize("contact", [True, False])
def test_the_contact_is_believed_before_everything_else(owner: str, contact: bool) -> None:
    brake = BrakeControl(settings(brake_owner=owner))
    for release in (True, False):
        brake.word(0x0F, ENABLED, ON, release)
        assert brake.is_open(ENABLED, contact) is contact
        assert brake.is_open(S.SWITCH_ON_DISABLED, contact) is contact


def test_a_drive_closes_its_brake_in_order_and_is_not_enabled_again() -> None:
    brake = BrakeControl(settings(brake_owner="drive"))
    assert [brake.word(0x0F, ENABLED, ON, True) for _ in range(3)] == [0x0F] * 3
    words = [brake.word(0x0F, ENABLED, ON, False) for _ in range(PATIENCE + 10)]
    assert words == [0x07] * PATIENCE + [0x0F] * 10
    assert not brake.released

    brake = BrakeControl(settings(brake_owner="drive"))
    brake.word(0x0F, ENABLED, ON, True)
    assert brake.word(0x0F, ENABLED, ON, False) == 0x07
    # It has left for Switched on, which an ENABLE would answer with 0F.
    assert [brake.word(0x0F, S.SWITCHED_ON, ON, False) for _ in range(5)] == [0x07] * 5
    assert brake.word(0x06, S.SWITCH_ON_DISABLED, ON, False) == 0x06
    # Until the program wants the brake open again.
    assert brake.word(0x0F, S.SWITCHED_ON, ON, True) == 0x0F


def test_the_next_run_begins_with_torque_against_the_closed_brake() -> None:
    """What ended the one before in order forbids nothing once the program has disabled the drive."""
    brake = BrakeControl(settings(brake_owner="drive"))
    brake.word(0x0F, ENABLED, ON, True)
    assert brake.word(0x0F, ENABLED, ON, False) == 0x07
    assert brake.word(0x0F, S.SWITCHED_ON, ON, False) == 0x07
    assert brake.word(0x00, S.SWITCHED_ON, R.DISABLE, False) == 0x00
    assert brake.word(0x0F, S.SWITCHED_ON, ON, False) == 0x0F


def test_a_quick_stop_is_no_disable_operation() -> None:
    brake = BrakeControl(settings(brake_owner="drive"))
    brake.word(0x0F, ENABLED, ON, True)
    assert brake.word(0x0F, ENABLED, ON, False) == 0x07
    assert brake.word(0x02, ENABLED, R.QUICK_STOP, False) == 0x02
    assert brake.word(0x02, S.QUICK_STOP_ACTIVE, R.QUICK_STOP, False) == 0x02


# --- stop by SDO --------------------------------------------------------------------------------------------------


class Stop:
    """A drive that has left OPERATIONAL, scan by scan; its answers are those of the test."""

    def __init__(self, owner: str = "drive", state: NmtState = NmtState.PRE_OPERATIONAL) -> None:
        self.wire, self.asked = Wire(), Asked()
        self.node = remote_node(self.wire)
        self.node.state = state
        self.stop = StopBySdo(self.node, self.asked, settings(brake_owner=owner))  # type: ignore[arg-type]

    def scan(self, word: int, brake: int = 1, *, scans: int = 1, answers: bool = True) -> None:
        for _ in range(scans):
            before = len(self.asked.writes)
            self.stop.scan(word, brake, 1)
            if answers and len(self.asked.writes) > before:
                self.asked.then(b"")

    @property
    def started(self) -> int:
        return self.wire.sent.count((0x000, "01 02"))


def test_each_word_that_stops_is_sent_once_and_the_torque_goes_off_after_the_ramp() -> None:
    drive = Stop()
    drive.scan(0x02, scans=20)
    assert drive.asked.writes == [(0x6040, 0, "0200")]
    drive.scan(0x00, scans=20)
    assert drive.asked.writes == [(0x6040, 0, "0200"), (0x6040, 0, "0000")]
    # It takes process data again, and is lost once more.
    drive.stop.forget()
    drive.scan(0x00, scans=20)
    assert drive.asked.writes[2:] == [(0x6040, 0, "0000")]


def test_the_brake_at_60fe_closes_with_it() -> None:
    drive = Stop("object_60FE")
    drive.scan(0x02, 0, scans=10)
    drive.scan(0x00, 1, scans=10)
    assert drive.asked.writes == [
        (0x6040, 0, "0200"), (0x60FE, 1, "00000000"), (0x6040, 0, "0000"), (0x60FE, 1, "01000000"),
    ]  # fmt: skip


def test_what_is_refused_is_not_asked_again() -> None:
    """The same request would get the same answer, and the torque would wait behind it."""
    drive = Stop("object_60FE")
    for word, brake in ((0x02, 0), (0x00, 1)):
        for _ in range(20):
            before = len(drive.asked.writes)
            drive.scan(word, brake, answers=False)
            if len(drive.asked.writes) > before:
                drive.asked.then(None)
    assert drive.asked.writes == [
        (0x6040, 0, "0200"), (0x60FE, 1, "00000000"), (0x6040, 0, "0000"), (0x60FE, 1, "01000000"),
    ]  # fmt: skip


@pytest.mark.parametrize(("periods", "scans"), [(1, 751), (5, 151)])
def test_a_drive_that_never_answers_is_asked_for_3_s_and_no_longer(periods: int, scans: int) -> None:
    """750 scans of 4 ms, those that were missed included: by then its own watch has stopped it."""
    drive = Stop()
    for _ in range(scans):
        drive.stop.scan(0x00, 1, periods)
    asked = len(drive.asked.writes)
    assert asked == scans
    drive.scan(0x00, scans=100)
    assert len(drive.asked.writes) == asked


def test_a_request_has_20_ms_to_be_answered_before_the_next_one() -> None:
    """Five scans of 4 ms: one that takes the place of another throws its answer away."""
    drive = Stop()
    drive.scan(0x00, answers=False)
    drive.asked.waiting = True
    counts = []
    for _ in range(12):
        drive.scan(0x00, answers=False)
        counts.append(len(drive.asked.writes))
    assert counts == [1] * 4 + [2] * 5 + [3] * 3


@pytest.mark.parametrize("word", [0x06, 0x07, 0x0F, 0x80])
def test_no_other_word_is_sent(word: int) -> None:
    drive = Stop(state=NmtState.STOPPED)
    drive.scan(word, scans=50)
    assert (drive.asked.writes, drive.asked.reads, drive.wire.sent) == ([], [], [])


@pytest.mark.parametrize(
    ("state", "answers", "boots", "started"),
    [
        (NmtState.PRE_OPERATIONAL, True, 0, 0),
        (NmtState.PRE_OPERATIONAL, False, 0, 1),
        (NmtState.STOPPED, True, 0, 1),
        (NmtState.STOPPED, False, 1, 0),  # it has lost its mapping
        (NmtState.PRE_OPERATIONAL, False, 1, 0),
    ],
)
def test_a_drive_that_answers_nothing_is_started_once_unless_it_has_booted(
    state: NmtState, answers: bool, boots: int, started: int
) -> None:
    drive = Stop(state=state)
    drive.node.boots = boots
    drive.scan(0x00, scans=100, answers=answers)
    assert drive.started == started


@pytest.mark.parametrize(
    ("word", "state"),
    [
        ("4002", S.SWITCH_ON_DISABLED),
        ("0802", S.FAULT),
        ("2702", S.UNKNOWN),
        ("0702", S.UNKNOWN),
        ("0f02", S.UNKNOWN),
    ],
)
def test_only_a_state_without_torque_is_shown(word: str, state: DriveState) -> None:
    drive = Stop()
    drive.scan(0x00, scans=20)
    assert drive.asked.reads == [(0x6041, 0)] * len(drive.asked.reads)
    # A drive that refuses to show its state has shown none.
    drive.asked.then(None)
    assert drive.stop.state is S.UNKNOWN
    drive.asked.then(bytes.fromhex(word))
    assert drive.stop.state is state


# --- supervision --------------------------------------------------------------------------------------------------


class Watched:
    """Supervision of a drive in Operation enabled, with fake telegrams."""

    def __init__(self) -> None:
        self.wire, self.asked = Wire(), Asked()
        self.node = remote_node(self.wire)
        self.node.emergencies = EmergencyLog()
        self.process = SimpleNamespace(
            age=0, inputs_age=0, wrong_lengths=0, contradicted=0, congested=False, crowded=False
        )
        self.watch = Supervision(self.node, self.process, self.asked, settings())  # type: ignore[arg-type]
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
    # Of one whose state is not known nothing is known, whatever is asked of it.
    assert {drive.scan(S.UNKNOWN, 0x1037) for _ in range(8)} == {LinkFlag.NONE}


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


# --- nodes beside the drive ---------------------------------------------------------------------------------------

IO = {
    "can.io.node": 3, "can.io.inputs.estop_ok": 0, "can.io.inputs.enabling_switch": 1, "can.io.inputs.brake_open": 9,
    "brake.owner": "controller_output", "can.io.outputs.brake_release": 0,
}  # fmt: skip


def io_bench() -> Bench:
    return Bench(changes=tuple(IO.items())).open()


def test_inputs_of_a_lost_node_are_safe_at_rest_and_its_brake_contact_is_unknown() -> None:
    bench = io_bench()
    bench.run(0.05, DriveRequest.DISABLE)
    beside = bench.drive.beside
    assert beside.read_inputs(None, keep=False)[:2] == (True, True)
    assert beside.brake_contact() is False
    node = beside.nodes[0]
    # No heartbeat for 0.2 s.
    node.remote.heartbeat_age = 50
    seen = bench.scan(DriveRequest.DISABLE)
    assert seen.link & LinkFlag.IO_LOST
    assert seen.inputs[:2] == (False, False)
    assert beside.brake_contact() is None
    # In motion the alarm stops the axis; what is not known is not said to be an emergency stop.
    assert beside.read_inputs(None, keep=True)[:2] == (True, True)
    # Its brake contact is not carried on, in motion neither.
    assert beside.brake_contact() is None
    bench.drive.close()


@pytest.mark.parametrize(("age", "wrong", "lost"), [(6, 0, False), (7, 0, True), (0, 2, False), (0, 3, True)])
def test_a_node_is_lost_after_30_ms_or_three_wrong_lengths(age: int, wrong: int, lost: bool) -> None:
    """Six scans of 4 ms are bridged; with the seventh the 30 ms would be over before the next one."""
    bench = io_bench()
    bench.run(0.05, DriveRequest.DISABLE)
    node = bench.drive.beside.nodes[0]
    node.watch.age, node.watch.wrong_in_row = age, wrong
    assert node.judge(True) is lost
    bench.drive.close()


@pytest.mark.parametrize(("age", "known"), [(0, True), (6, True), (7, False)])
def test_a_ring_encoder_of_the_drive_is_believed_for_30_ms(age: int, known: bool) -> None:
    bench = Bench(changes=(("can.load_encoder.source", "60E4"),)).open()
    seen = bench.drive.beside.ring_rad(SimpleNamespace(ring=(0, age)))  # type: ignore[arg-type]
    assert math.isfinite(seen) is known
    bench.drive.close()


def test_the_heartbeat_of_a_node_grows_old_by_the_scans_that_were_missed() -> None:
    bench = io_bench()
    node = bench.drive.beside.nodes[0]
    node.remote.heartbeat_age = 0
    node.begin(5)
    assert (node.remote.heartbeat_age, node.watch.age) == (5, 5)
    bench.drive.close()


@pytest.mark.parametrize(
    ("byte_1", "byte_2", "is_open"), [(0xFF, 0x00, False), (0x00, 0x02, True), (0, 0xFD, False)]
)
def test_the_contact_by_sdo_is_the_bit_of_its_group(byte_1: int, byte_2: int, is_open: bool) -> None:
    """Input 9 is bit 1 of 6000:02."""
    bench = io_bench()
    io = bench.drive.beside.io
    assert io is not None
    io.node.remote.sdo = Dictionary({(0x6000, 1): byte_1, (0x6000, 2): byte_2}, {0x6000: 1})  # type: ignore[assignment]
    assert bench.drive.beside.ask_brake_contact() is is_open
