"""Brake, stop by SDO and the nodes beside the drive, scan by scan, by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from gantryctl.drives.canopen.brake import BrakeControl
from gantryctl.drives.canopen.bus.node import NmtState
from gantryctl.drives.canopen.stop_by_sdo import StopBySdo
from gantryctl.image import DriveRequest, DriveState, LinkFlag
from unit.drives.canopen.canopen_bench import Bench
from unit.drives.canopen.dictionary import Dictionary, settings
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


def test_a_brake_that_is_to_open_is_shut_until_the_drive_turns() -> None:
    """Its release waits for Operation enabled: nothing has opened it yet."""
    brake = BrakeControl(settings(brake_owner="object_60FE"))
    for state in (S.SWITCH_ON_DISABLED, S.READY_TO_SWITCH_ON, S.SWITCHED_ON):
        brake.word(0x07, state, ON, True)
        assert not brake.is_open(state, None)
    brake.word(0x0F, ENABLED, ON, True)
    assert brake.is_open(ENABLED, None)


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
    # The first run has none before it.
    assert brake.word(0x0F, S.SWITCHED_ON, ON, False) == 0x0F
    brake.word(0x0F, ENABLED, ON, True)
    assert brake.word(0x0F, ENABLED, ON, False) == 0x07
    assert brake.word(0x0F, S.SWITCHED_ON, ON, False) == 0x07
    assert brake.word(0x00, S.SWITCHED_ON, R.DISABLE, False) == 0x00
    assert brake.word(0x0F, S.SWITCHED_ON, ON, False) == 0x0F


@pytest.mark.parametrize("before", S)
def test_a_drive_that_shows_enabled_too_late_loses_its_torque_at_once(before: DriveState) -> None:
    """The program gave up meanwhile: nothing was released, so there is nothing to close in order."""
    # One that another master has enabled before our first scan too.
    assert BrakeControl(settings(brake_owner="drive")).word(0x00, ENABLED, R.DISABLE, False) == 0x00
    brake = BrakeControl(settings(brake_owner="drive"))
    brake.word(0x0F, before, ON, False)
    assert [brake.word(0x00, ENABLED, R.DISABLE, False) for _ in range(3)] == [0x00] * 3
    # The same for one that is asked for its torque against the closed brake, however long.
    assert [brake.word(0x0F, ENABLED, ON, False) for _ in range(3)] == [0x0F] * 3


def test_a_quick_stop_is_no_disable_operation() -> None:
    brake = BrakeControl(settings(brake_owner="drive"))
    brake.word(0x0F, ENABLED, ON, True)
    assert brake.word(0x0F, ENABLED, ON, False) == 0x07
    assert brake.word(0x02, ENABLED, R.QUICK_STOP, False) == 0x02
    assert brake.word(0x02, S.QUICK_STOP_ACTIVE, R.QUICK_STOP, False) == 0x02


# --- stop by SDO --------------------------------------------------------------------------------------------------


class Stop:
    """A drive that has left OPERATIONAL, scan by scan; its answers are those of the test."""

    def __init__(
        self, owner: str = "drive", state: NmtState = NmtState.PRE_OPERATIONAL, period_s: float = 0.004
    ) -> None:
        self.wire, self.asked = Wire(), Asked()
        self.node = remote_node(self.wire)
        self.node.state = state
        self.speeds: list[tuple[int, int]] = []
        self.stop = StopBySdo(
            self.node,
            self.asked,  # type: ignore[arg-type]
            settings(brake_owner=owner, period_s=period_s),
            lambda raw, scan: self.speeds.append((raw, scan)),
        )

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
    # Scans of 40 ms are longer than that.
    drive = Stop(period_s=0.040)
    drive.asked.waiting = True
    drive.scan(0x00, scans=5, answers=False)
    assert len(drive.asked.writes) == 5


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


def test_a_drive_that_answers_nothing_has_20_ms_before_it_is_started() -> None:
    drive = Stop()
    drive.scan(0x00, scans=5, answers=False)
    assert drive.started == 0
    drive.scan(0x00, answers=False)
    assert drive.started == 1


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
    # What it has shown does not count for the next time.
    drive.stop.forget()
    assert drive.stop.state is S.UNKNOWN


SPEED = (0x606C, 0)


def on_its_ramp(owner: str = "drive") -> Stop:
    """It has taken the quick stop, and is asked for its speed in scan 100."""
    drive = Stop(owner)
    drive.scan(0x02, 0, scans=1 if owner == "drive" else 2)
    drive.node.scan = 100
    assert drive.asked.reads == []
    drive.scan(0x02, 0)
    drive.asked.waiting = True
    assert drive.asked.reads == [SPEED]
    return drive


@pytest.mark.parametrize("owner", ["drive", "object_60FE"])
def test_a_drive_on_its_ramp_is_asked_for_its_speed_again_as_soon_as_it_answers(owner: str) -> None:
    drive = on_its_ramp(owner)
    drive.node.scan = 101
    drive.asked.then(bytes.fromhex("fcffffff"))
    drive.asked.waiting = False
    drive.scan(0x02, 0)
    drive.asked.then(bytes.fromhex("00010000"))
    assert drive.speeds == [(-4, 100), (256, 101)]
    # Without torque there is no ramp: then its state is asked for.
    drive.scan(0x00, 1, scans=40)
    assert drive.asked.reads[:2] == [SPEED] * 2
    assert set(drive.asked.reads[2:]) == {(0x6041, 0)}


def test_a_word_that_stops_waits_for_no_speed_and_is_waited_for() -> None:
    drive = on_its_ramp()
    drive.scan(0x00, answers=False)
    assert drive.asked.writes[1:] == [(0x6040, 0, "0000")]
    # For 20 ms, five scans of 4 ms, it is not sent again.
    drive.scan(0x00, scans=4, answers=False)
    assert len(drive.asked.writes) == 2
    drive.scan(0x00, answers=False)
    assert len(drive.asked.writes) == 3


def test_a_speed_that_comes_late_is_as_old_as_the_first_request_for_it() -> None:
    """It may answer that one: asked for in scan 100, and again five scans of 4 ms later."""
    drive = on_its_ramp()
    for scan in range(101, 106):
        drive.node.scan = scan
        drive.scan(0x02)
    assert drive.asked.reads == [SPEED] * 2
    drive.asked.then(bytes(4))
    drive.asked.waiting = False
    drive.node.scan = 106
    drive.scan(0x02)
    drive.asked.then(bytes(4))
    assert drive.speeds == [(0, 100), (0, 106)]
    # What has not been answered before telegrams came again counts no more.
    drive.scan(0x02)
    drive.stop.forget()
    drive.node.scan = 200
    drive.scan(0x02, scans=2)
    drive.asked.then(bytes(4))
    assert drive.speeds[2:] == [(0, 200)]


def test_a_drive_that_refuses_its_speed_is_not_asked_again_in_this_stop() -> None:
    drive = on_its_ramp()
    drive.asked.then(None)
    drive.asked.waiting = False
    drive.scan(0x02, scans=40)
    assert drive.asked.reads.count(SPEED) == 1
    assert drive.speeds == []
    drive.stop.forget()
    drive.scan(0x02, scans=2)
    assert drive.asked.reads.count(SPEED) == 2


def test_a_drive_without_a_speed_of_its_own_is_asked_for_its_state_alone() -> None:
    drive = Stop()
    drive.stop = StopBySdo(drive.node, drive.asked, settings(brake_owner="drive"))  # type: ignore[arg-type]
    drive.scan(0x02, scans=40)
    assert set(drive.asked.reads) == {(0x6041, 0)}


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
