"""Parts of the CANopen master: the two pure functions of CiA 402, unwrapping, SDO, mapping, telegram counters."""

from __future__ import annotations

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.bus.link import BusLink, Frame
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.canopen.cia402 import decode_statusword, next_controlword
from gantryctl.drives.canopen.diagnostics import TpdoWatch
from gantryctl.drives.canopen.emergency import HISTORY, EmergencyLog, emergency_text
from gantryctl.drives.canopen.process_image import Unwrap
from gantryctl.drives.canopen.setup.parameter_check import interpolation
from gantryctl.errors import DeviceError
from gantryctl.image import DriveRequest, DriveState

pytestmark = pytest.mark.can

# CiA 402, statusword: (mask, value) of every state.
TABLE = {
    DriveState.NOT_READY_TO_SWITCH_ON: (0x4F, 0x00),
    DriveState.SWITCH_ON_DISABLED: (0x4F, 0x40),
    DriveState.READY_TO_SWITCH_ON: (0x6F, 0x21),
    DriveState.SWITCHED_ON: (0x6F, 0x23),
    DriveState.OPERATION_ENABLED: (0x6F, 0x27),
    DriveState.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    DriveState.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    DriveState.FAULT: (0x4F, 0x08),
}


# --- CiA 402 ------------------------------------------------------------------------------------------------------


def test_every_statusword_is_the_state_of_the_table_or_unknown() -> None:
    for word in range(1 << 16):
        fitting = [state for state, (mask, value) in TABLE.items() if word & mask == value]
        assert len(fitting) <= 1, hex(word)
        assert decode_statusword(word) is (fitting[0] if fitting else DriveState.UNKNOWN)


def test_of_the_low_patterns_104_are_no_state() -> None:
    """12 of the 128 patterns of bits 0 to 6 belong to the four states without bit 5, 12 to the others."""
    unknown = [low for low in range(128) if decode_statusword(low) is DriveState.UNKNOWN]
    assert len(unknown) == 128 - 4 * 4 - 4 * 2


@pytest.mark.parametrize("previous", [0x00, 0x02, 0x06, 0x07, 0x0F, 0x80])
def test_for_every_statusword_the_word_is_one_that_the_request_allows(previous: int) -> None:
    allowed = {
        DriveRequest.DISABLE: {0x00},
        DriveRequest.ENABLE: {0x00, 0x02, 0x06, 0x07, 0x0F},
        DriveRequest.QUICK_STOP: {0x00, 0x02},
        DriveRequest.FAULT_RESET: {0x00, 0x80},
    }
    for word in range(1 << 16):
        state = decode_statusword(word)
        for request, words in allowed.items():
            command = next_controlword(state, request, previous)
            assert command in words
            if state is DriveState.UNKNOWN:
                assert command == 0x00


def test_only_enable_in_switched_on_or_enabled_gives_torque() -> None:
    giving = {
        (state, request)
        for state in DriveState
        for request in DriveRequest
        if next_controlword(state, request, 0) & 0x0F == 0x0F
    }
    assert giving == {
        (DriveState.SWITCHED_ON, DriveRequest.ENABLE),
        (DriveState.OPERATION_ENABLED, DriveRequest.ENABLE),
    }


def test_the_reset_bit_is_an_edge() -> None:
    first = next_controlword(DriveState.FAULT, DriveRequest.FAULT_RESET, 0)
    second = next_controlword(DriveState.FAULT, DriveRequest.FAULT_RESET, first)
    assert (first, second) == (0x80, 0x00)


# --- position -----------------------------------------------------------------------------------------------------


def as_i32(value: int) -> int:
    return (value + (1 << 31)) % (1 << 32) - (1 << 31)


@given(
    st.integers(0, (1 << 31) - 1),
    st.lists(st.integers(-(1 << 28), 1 << 28), max_size=60),
    st.sampled_from(["32 bits", "multiturn"]),
    st.sampled_from([1 << 31, 1 << 29, 3 * (1 << 29), 4096 * 10_000 * 32]),
)
def test_unwrapping_follows_any_way_over_either_wrap(
    start: int, steps: list[int], wrap: str, span: int
) -> None:
    unwrap, true = Unwrap(span), start % span
    read = as_i32 if wrap == "32 bits" else (lambda value: value % span)
    assert unwrap(read(true)) == true
    for step in steps:
        true += max(-(span // 5), min(span // 5, step))  # an axis moves far less than half a range in a scan
        assert unwrap(read(true)) == true


# Whole numbers of turns that are no power of two, up to the last before 2^32.
RANGES = [
    3 * (1 << 29),
    4096 * 10_000,
    3000 * 1_000_000,
    1144 * 4096 * 360,
    4294 * 1_000_000,
    (1 << 32) - 4096,
    1 << 32,
]
COUNTED = {
    "on and on": lambda value, _: as_i32(value),
    "from 0": lambda value, span: as_i32(value % span),
    "around 0": lambda value, span: (value + span // 2) % span - span // 2,
}


@given(
    st.sampled_from(RANGES),
    st.sampled_from(sorted(COUNTED)),
    st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60),
)
def test_any_range_of_any_drive_is_followed_near_raw_0(span: int, counted: str, steps: list[float]) -> None:
    """A drive that shows 0 where it starts, and goes to -5; steps as long as a fast motor makes in a late scan."""
    around = counted == "around 0"
    unwrap, true = Unwrap(span, around), 0
    # Where the range begins at 0 the axis stands in its middle; an axis keeps away from the ends of the range.
    middle = 0 if around else span // 2
    start = unwrap(COUNTED[counted](middle, span))
    assert start == span // 2
    for step in (-5.0 / span, *steps):
        true = max(-span // 3, min(span // 3, true + round(step * span / 20)))
        assert unwrap(COUNTED[counted](middle + true, span)) == start + true


@pytest.mark.parametrize(
    ("span", "below", "above"),
    [
        (3 << 29, 1_610_612_735, 0),
        (1 << 31, 2_147_483_647, 0),
        # In 32 bits with a sign: the middle of the range is a wrap too, and its end lies at 3 000 000 000 - 2^32.
        (3_000_000_000, 2_147_483_647, -2_147_483_648),
        (3_000_000_000, -1_294_967_297, 0),
        (1 << 32, -1, 0),
    ],
)
def test_a_range_from_0_goes_on_over_its_end(span: int, below: int, above: int) -> None:
    unwrap = Unwrap(span)
    start = unwrap(below)
    assert [unwrap(raw) - start for raw in (above, above + 2, below, below - 3)] == [1, 3, 0, -3]


@pytest.mark.parametrize("span", [4096, 3000 * 1_000_000, 4294 * 1_000_000])
def test_a_range_around_0_ends_at_its_halves(span: int) -> None:
    """One step up from the last reading is the first one, and back."""
    unwrap, half = Unwrap(span, around_zero=True), span // 2
    assert [unwrap(raw) for raw in (half - 1, -half, -half + 2, half - 1)] == [
        span - 1, span, span + 2, span - 1,
    ]  # fmt: skip


# What 2^32 leaves beyond the range is the jump at its end: above an eighth of the range, and below.
@pytest.mark.parametrize(
    ("span", "step", "counted"),
    [(3_800_000_000, 250_000_000, -244_967_296), (3_840_000_000, 240_000_000, 240_000_000)],
)
def test_a_jump_of_less_than_an_eighth_of_the_range_is_motion(span: int, step: int, counted: int) -> None:
    unwrap = Unwrap(span)
    start = unwrap(1000)
    assert unwrap(1000 + step) - start == counted


def test_the_first_reading_lies_within_the_range() -> None:
    assert Unwrap(4096 * 10_000, around_zero=True)(-5) == 4096 * 5_000 - 5
    assert Unwrap(1 << 31)(-5) == (1 << 31) - 5
    assert Unwrap(1 << 34)(-5) == (1 << 32) - 5  # what does not fit 32 bits is wrapped there


# --- emergency messages -------------------------------------------------------------------------------------------


@given(st.lists(st.binary(max_size=8), max_size=300))
def test_emergency_messages_of_any_length_are_kept_within_bounds(messages: list[bytes]) -> None:
    log = EmergencyLog()
    for scan, data in enumerate(messages):
        log.take(data, scan)
    assert len(log.messages) <= HISTORY
    assert log.count == sum(len(data) >= 2 for data in messages)
    assert all("EMCY" in message.text for message in log.messages)


def test_a_flood_in_one_scan_is_one_line() -> None:
    log = EmergencyLog()
    for _ in range(10_000):
        log.take(b"\x30\x81\x10", 7)
    assert (log.count, len(log.messages)) == (10_000, 1)
    assert "heartbeat" in log.messages[0].text


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (0x8110, "lost telegrams"), (0x8120, "error passive"), (0x8130, "heartbeat"), (0x8140, "came back"),
        (0x8150, "same identifier"), (0x8210, "too short"), (0x8220, "longer"), (0x8240, "SYNC"),
        (0x8250, "missed its process data"), (0x2310, "overcurrent"), (0x2350, "overload of the drive or motor"),
        (0x2351, "warning"), (0x3210, "overvoltage"), (0x3220, "undervoltage"), (0x4310, "too hot"),
        (0x5530, "memory"), (0x6310, "lost"), (0x7305, ": motor encoder"),
        (0x8611, "following error"), (0xFF00, "manufacturer-specific"),
        # Any other one by its class (CiA 301).
        (0x1FFF, "general error"), (0x2FFF, "current"), (0x3FFF, "voltage"), (0x4123, "temperature"),
        (0x5FFF, "drive hardware"), (0x6FFF, "software or parameters"), (0x7FFF, "motor, brake, encoder"),
        (0x8FFF, "monitoring"), (0x9FFF, "external"), (0xF123, "specific to the drive"), (0xA000, "unknown class"),
        (0x0000, "no error any more"),
    ],
)  # fmt: skip
def test_a_code_says_what_it_means(code: int, says: str) -> None:
    assert emergency_text(code).startswith(f"EMCY {code:04X}: ")
    assert says in emergency_text(code)
    log = EmergencyLog()
    # Two bytes carry the code; some drives send no more.
    for data in (b"\1", code.to_bytes(2, "little"), code.to_bytes(2, "little") + bytes((7, 1, 2, 3, 4, 5))):
        log.take(data, log.count)
    assert (log.count, log.code) == (2, code)
    assert [(each.register, each.vendor) for each in log.messages] == [(0, b""), (7, b"\1\2\3\4\5")]


@pytest.mark.parametrize(
    ("codes", "do"),
    [
        ((0x8110,), "Lower the bus load."), ((0x8120,), "Check cable, terminators and bit rate."),
        ((0x8130, 0x8250), "Was the controller stopped or overloaded?"), ((0x8140,), "Check cable and terminators."),
        ((0x8150,), "Give every node its own node id."), ((0x8210, 0x8220), "Start the controller again."),
        ((0x8240,), "Another master may be on the bus."), ((0x2310,), "Motor cable or motor; call service."),
        ((0x2350,), "Let it cool; move less or slower."), ((0x2351,), "Move less or slower."),
        ((0x3210,), "Check the brake resistor: stops feed energy back."), ((0x3220,), "Check the mains."),
        ((0x4310,), "Check cooling."), ((0x5530, 0x6310), "Restore the drive's parameters from a backup."),
        ((0x7305,), "Check encoder cable and plug; call service."),
        ((0x8611,), "The drive does not reach its set-point."), ((0xFF00,), "Read the drive's display."),
        ((0x4123, 0xA000), "Look it up in the drive's manual."),
    ],
)  # fmt: skip
def test_a_code_says_what_to_do(codes: tuple[int, ...], do: str) -> None:
    assert [emergency_text(code).partition(" · ")[2] for code in codes] == [do] * len(codes)


# --- telegram counters --------------------------------------------------------------------------------------------


def test_a_telegram_counts_once_per_sync() -> None:
    watch = TpdoWatch(2)
    watch.begin()
    for _ in range(2):
        watch.take(b"ab", in_time=True)
    assert watch.settle()
    assert not watch.take(b"ab", in_time=False)
    assert (watch.data, watch.age, watch.duplicated, watch.contradicted) == (b"ab", 0, 2, 0)


def test_missed_late_and_wrong_telegrams_are_told_apart() -> None:
    watch = TpdoWatch(2)
    watch.begin()
    watch.begin()  # nothing came
    assert (watch.missed, watch.age) == (1, 2)
    assert watch.take(b"ab", in_time=False)
    assert watch.late == 1
    watch.begin()
    assert not watch.take(b"abc", in_time=True)
    assert (watch.wrong_length, watch.data, watch.age) == (1, b"ab", 1)


def test_only_the_telegrams_of_the_last_30_ms_are_owed() -> None:
    """Eight SYNCs of 4 ms and the one of this scan: what comes beyond them is of somebody else."""
    watch = TpdoWatch(2, 0.004)
    for _ in range(20):
        watch.begin()
    assert watch.behind == 8
    contradicted = []
    for number in range(11):
        watch.take(bytes((number, 0)), in_time=True)
        contradicted.append(watch.contradicted)
    assert contradicted == [0] * 9 + [1, 2]


def test_a_telegram_behind_one_that_was_late_is_the_newest() -> None:
    """The first belongs to the SYNC before, and counts at once; the second answers none that is still waited for."""
    watch = TpdoWatch(2, 0.004)
    watch.begin()
    watch.begin()
    assert watch.take(b"ab", in_time=False)
    assert not watch.take(b"cd", in_time=False)
    assert not watch.take(b"cd", in_time=False)
    assert (watch.settle(), watch.data, watch.duplicated, watch.contradicted) == (None, b"ab", 2, 0)


def test_a_telegram_that_was_passed_over_is_owed_no_more() -> None:
    watch = TpdoWatch(2, 0.004)
    watch.begin()
    watch.pass_over()
    assert (watch.late, watch.contradicted) == (1, 0)
    watch.take(b"ab", in_time=True)
    assert watch.contradicted == 1


# --- mapping ------------------------------------------------------------------------------------------------------

OPTIONAL = (m.TORQUE_OFFSET, m.VELOCITY, m.TORQUE, m.INPUTS, m.ERROR)


@given(st.frozensets(st.sampled_from(OPTIONAL)), st.booleans())
def test_any_drive_gets_telegrams_that_fit(present: frozenset[m.Signal], by_60fe: bool) -> None:
    plan = m.plan_mapping(present, by_60fe)
    assert len(plan.rpdos) == 1 + by_60fe
    assert 1 <= len(plan.tpdos) <= 2
    assert all(0 < pdo.size <= 8 for pdo in (*plan.rpdos, *plan.tpdos))
    assert all(len(set(pdo.signals)) == len(pdo.signals) for pdo in (*plan.rpdos, *plan.tpdos))
    assert {m.CONTROLWORD, m.TARGET_VELOCITY, m.STATUSWORD, m.POSITION} <= plan.signals
    assert plan.signals - {m.CONTROLWORD, m.TARGET_VELOCITY, m.STATUSWORD, m.POSITION, m.OUTPUTS} <= present


@pytest.mark.parametrize(
    ("period_us", "pair"),
    [
        (1000, (1, -3)),
        (4000, (4, -3)),
        (10_000, (10, -3)),
        (2500, (25, -4)),
        (250, (25, -5)),
        (125, (125, -6)),
    ],
)
def test_the_sync_period_as_60c2(period_us: int, pair: tuple[int, int]) -> None:
    assert interpolation(period_us) == pair
    assert pair[0] * 10.0 ** pair[1] == pytest.approx(period_us * 1e-6)


def test_60c2_holds_no_more_than_eight_bits() -> None:
    assert interpolation(255_000) == (255, -3)
    with pytest.raises(DeviceError, match="256000 us cannot be told to the drive"):
        interpolation(256_000)


# --- SDO ----------------------------------------------------------------------------------------------------------


class Server:
    """Answers from a script; time goes on only when nothing is there."""

    refused, stepped, down = 0, False, False

    def __init__(self, *answers: bytes) -> None:
        self.answers, self.sent, self.time_s = list(answers), [], 0.0

    def send(self, can_id: int, data: bytes) -> bool:
        self.sent.append((can_id, data))
        return True

    def receive(self, timeout_s: float) -> Frame | None:
        if self.answers:
            return Frame(0x582, self.answers.pop(0))
        self.time_s += timeout_s
        return None

    def now_s(self) -> float:
        return self.time_s


def client(*answers: bytes) -> SdoClient:
    return SdoClient(Server(*answers), 2, lambda frame: None, 0.1)


def test_an_old_answer_is_passed_over() -> None:
    sdo = client(bytes.fromhex("4F 61 60 00 01 00 00 00"), bytes.fromhex("4B 41 60 00 37 02 00 00"))
    assert sdo.number(0x6041) == 0x0237


def test_an_abort_is_told_in_words() -> None:
    with pytest.raises(SdoError, match=r"6502:00: no such object"):
        client(bytes.fromhex("80 02 65 00 00 00 02 06")).number(0x6502)


def test_a_missing_object_is_none_but_silence_is_an_error() -> None:
    assert client(bytes.fromhex("80 02 65 00 00 00 02 06")).optional(0x6502) is None
    with pytest.raises(SdoError, match="no answer"):
        client().optional(0x6502)


def test_segments_with_the_wrong_toggle_are_refused() -> None:
    first = bytes.fromhex("41 08 10 00 09 00 00 00")
    with pytest.raises(SdoError, match="toggle"):
        client(first, b"\x10abcdefg").read(0x1008, 0)


def test_a_long_text_comes_in_segments() -> None:
    first = bytes.fromhex("41 08 10 00 09 00 00 00")
    assert client(first, b"\x00abcdefg", b"\x1bhi\0\0\0\0\0").text(0x1008) == "abcdefghi"


# --- the link -----------------------------------------------------------------------------------------------------


class Echoing(can.BusABC):
    """Delivers everything back, as udp_multicast does."""

    def __init__(self) -> None:
        self.waiting: list[can.Message] = []
        self._can_protocol = can.CanProtocol.CAN_20
        super().__init__(channel="echo")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.waiting.append(msg)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.waiting.pop(0) if self.waiting else None), False


def test_own_frames_are_dropped_once_and_a_foreign_copy_is_seen() -> None:
    link = BusLink(Echoing(), echoes=True)
    link.send(0x202, b"ab")
    assert link.receive(0.0) is None
    link._bus.send(can.Message(arbitration_id=0x202, data=b"ab", is_extended_id=False))
    assert link.receive(0.0) == Frame(0x202, b"ab")
    link.close()


def test_the_log_sees_each_frame_once_with_its_direction() -> None:
    seen: list[tuple[float, int, bytes, bool]] = []
    link = BusLink(Echoing(), echoes=True, advance=lambda _: None, log=lambda *frame: seen.append(frame))
    link.send(0x202, b"ab")
    link.pause(0.004)
    link._bus.send(can.Message(arbitration_id=0x182, data=b"cd", is_extended_id=False))
    assert link.receive(0.0) == Frame(0x182, b"cd")
    assert seen == [(0.0, 0x202, b"ab", True), (0.004, 0x182, b"cd", False)]
    link.close()


class Broken(Echoing):
    """A bus that has gone."""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise can.CanOperationError("gone")


def test_a_dead_bus_is_down_after_three_failures_and_never_raises() -> None:
    seen: list[object] = []
    link = BusLink(Broken(), log=lambda *frame: seen.append(frame))
    for k in range(3):
        assert not link.down, k
        link.send(0x80, b"")
    assert link.down
    assert link.refused == 3
    assert not seen  # What the bus did not take was not on it.
    link.close()
