"""Telegrams, SDO and network management byte by byte, by hand from CiA 301 and CiA 402.

Nothing here is computed by the code that is tested: bytes, ages and quantities are written down. The motor has 524 288
increments in a turn, so that one turn a second is 2 pi rad/s or 00 00 08 00, and 257 N m of rated torque, so that
100 per mille (64 00) are 25.7 N m.
"""

from __future__ import annotations

import math
from dataclasses import replace

import can
import pytest

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.bus.link import BusLink, Frame
from gantryctl.drives.canopen.bus.node import LATCHED, LOST, NmtState, connection_flags
from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.bus.sdo import SdoClient, SdoError
from gantryctl.drives.canopen.cia402 import ENERGISED, next_controlword
from gantryctl.drives.canopen.emergency import stops
from gantryctl.drives.canopen.process_image import ProcessImage
from gantryctl.drives.canopen.scaling import BusUnits
from gantryctl.drives.canopen.settings import CanopenSettings, EncoderStatus
from gantryctl.image import DriveRequest, DriveState, EncoderFlag, LinkFlag
from gantryctl.wiring.canopen import canopen_settings
from unit.drives.canopen.canopen_bench import machine
from unit.drives.canopen.wire import NODE, Wire, remote_node

pytestmark = pytest.mark.can

ALL = frozenset((m.TORQUE_OFFSET, m.VELOCITY, m.TORQUE, m.INPUTS))
# 6041 = 1237h, 6064 = one turn, 6077 = -100 per mille; 606C = minus one turn a second, 60FD = bits 1 and 16.
TPDO_1, TPDO_2 = "37 12 00 00 08 00 9C FF", "00 00 F8 FF 02 00 01 00"
TURN = 524_288


def settings(**changes: object) -> CanopenSettings:
    return replace(canopen_settings(machine()), **changes)  # type: ignore[arg-type]


class Telegrams:
    """The process image of a drive on a bus by hand, SYNC every 4 ms."""

    def __init__(self, signals: frozenset[m.Signal] = ALL, *extra: m.Signal, **changes: object) -> None:
        self.wire, used = Wire(), settings(**changes)
        self.node = remote_node(self.wire)
        mapping = m.plan_mapping(signals, False, extra)
        self.image = ProcessImage(self.node, used, BusUnits(used, 257.0), mapping)

    def sync(self, *frames: tuple[int, str], periods: int = 1) -> ProcessImage:
        for can_id, data in frames:
            self.wire.comes(can_id, data)
        self.image.begin(periods)
        self.image.collect(0.002)
        return self.image


BOTH = ((0x182, TPDO_1), (0x282, TPDO_2))


# --- process data -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("inverted", [False, True])
def test_what_a_drive_tells(inverted: bool) -> None:
    bus, sign = Telegrams(inverted=inverted), -1 if inverted else 1
    seen = bus.sync(*BOTH)
    assert (seen.statusword, seen.input_word, seen.complete) == (0x1237, 0x0001_0002, True)
    assert seen.torque_nm == pytest.approx(sign * -25.7)
    assert seen.vel_rad_s == pytest.approx(sign * -math.tau)
    # 4096 turns of 2^19 increments: one turn below 0 is 2^31 less one turn.
    assert seen.counts == (2**31 - TURN if inverted else TURN)
    # 6064 grows by 1000.
    before = seen.counts
    assert bus.sync((0x182, "37 12 E8 03 08 00 9C FF"), BOTH[1]).counts - before == sign * 1000
    # The same by SDO.
    seen.take_position(TURN)
    assert seen.counts == before


@pytest.mark.parametrize(
    ("inverted", "sign", "data"),
    [
        (False, 1, "0F 00 00 00 08 00 64 00"), (True, 1, "0F 00 00 00 F8 FF 9C FF"),
        (False, -1, "0F 00 00 00 F8 FF 9C FF"), (True, -1, "0F 00 00 00 08 00 64 00"),
    ],
)  # fmt: skip
def test_what_a_drive_is_told(inverted: bool, sign: int, data: str) -> None:
    bus = Telegrams(inverted=inverted)
    bus.image.send(0x0F, sign * math.tau, sign * 25.7, 0)
    assert bus.wire.sent == [(0x202, data)]


@pytest.mark.parametrize(
    ("speed", "behind", "now"),
    [("00 00 08 00", "31 08 08 00", "62 10 08 00"), ("00 00 F8 FF", "CF F7 07 00", "9E EF 07 00")],
)
def test_a_position_behind_a_missing_one_is_as_old_as_its_way_says(speed: str, behind: str, now: str) -> None:
    """One turn a second, either way: 2097 increments a scan. A telegram that was held up comes in place of the next."""
    for position, age in ((behind, 1), (now, 0)):
        bus = Telegrams()
        other = (0x282, f"{speed} 02 00 01 00")
        bus.sync(BOTH[0], other)
        bus.sync(other)
        assert bus.sync((0x182, f"37 12 {position} 9C FF"), other).age == age


@pytest.mark.parametrize(("speed", "age"), [("2C 01 00 00", 1), ("F0 00 00 00", 0)])
def test_a_way_of_less_than_an_increment_tells_no_age(speed: str, age: int) -> None:
    """300 increments a second are 1.2 a scan, 240 are 0.96. Of two scans the position has gone on by one."""
    bus, other = Telegrams(), (0x282, f"{speed} 02 00 01 00")
    bus.sync(BOTH[0], other)
    bus.sync(other)
    assert bus.sync((0x182, "37 12 01 00 08 00 9C FF"), other).age == age


def test_the_ends_of_the_numbers() -> None:
    units = BusUnits(settings(), 257.0)
    assert (units.velocity(1e9), units.velocity(-1e9)) == (2**31 - 1, -(2**31) + 1)
    assert (units.torque(1e9), units.torque(-1e9)) == (32_767, -32_767)
    assert [units.velocity(bad) for bad in (math.nan, math.inf, -math.inf)] == [0, 0, 0]
    # 6085 is UNSIGNED32.
    assert (units.ramp(0.0), units.ramp(1e12)) == (1, 2**32 - 1)
    # 1000 means twice the rated torque: 25.7 N m are 50.
    assert BusUnits(settings(torque_reference=2.0), 257.0).torque(25.7) == 50


def test_a_scan_waits_for_its_answers_and_no_longer() -> None:
    """2 ms at the most, and not at all where both telegrams are there."""
    bus = Telegrams()
    for frames, waited_s, answered in (
        (BOTH, 0.0, 1),
        (BOTH[:1], 0.002, 1),
        (BOTH[1:], 0.004, 1),
        (BOTH, 0.004, 2),
    ):
        bus.sync(*frames)
        assert bus.wire.time_s == pytest.approx(waited_s)
        assert len(bus.image.answer_times_s) == answered
    assert list(bus.image.answer_times_s) == pytest.approx([0.0, 0.0])


def test_each_telegram_has_its_own_age() -> None:
    bus = Telegrams()
    ages = [(s.age, s.speed_age, s.inputs_age, s.silence) for s in [bus.sync(*BOTH)]]
    ages += [(s.age, s.speed_age, s.inputs_age, s.silence) for s in [bus.sync(BOTH[0])]]
    ages += [(s.age, s.speed_age, s.inputs_age, s.silence) for s in [bus.sync(BOTH[1], periods=3)]]
    ages += [(s.age, s.speed_age, s.inputs_age, s.silence) for s in [bus.sync(periods=5)]]
    assert ages == [(0, 0, 0, 0), (0, 1, 1, 0), (3, 0, 0, 0), (8, 5, 5, 5)]


def test_one_old_telegram_makes_the_inputs_old() -> None:
    status = m.Signal(0x2110, 5, 16, False)
    bus = Telegrams(ALL, status, encoder=EncoderStatus(0x2110, 5, 2, 0, 1, 2, 3))
    bus.sync(*BOTH, (0x382, "00 00"))
    assert bus.sync(BOTH[0], (0x382, "00 00")).inputs_age == 1
    assert bus.sync(BOTH[0], BOTH[1]).inputs_age == 1


@pytest.mark.parametrize(
    ("word", "flag"),
    [
        ("01 00", EncoderFlag.CRC_ERROR), ("02 00", EncoderFlag.ALARM), ("04 00", EncoderFlag.WARNING),
        ("08 00", EncoderFlag.BATTERY), ("0A 00", EncoderFlag.ALARM | EncoderFlag.BATTERY), ("10 00", EncoderFlag.NONE),
    ],
)  # fmt: skip
def test_the_bits_of_the_encoder(word: str, flag: EncoderFlag) -> None:
    status = m.Signal(0x2110, 5, 16, False)
    bus = Telegrams(ALL, status, encoder=EncoderStatus(0x2110, 5, 2, 0, 1, 2, 3))
    assert bus.image.encoder_flags == EncoderFlag.NONE
    assert bus.sync(*BOTH, (0x382, word)).encoder_flags == flag


def test_a_bit_that_the_encoder_has_not_means_nothing() -> None:
    status = m.Signal(0x2110, 5, 16, False)
    bus = Telegrams(ALL, status, encoder=EncoderStatus(0x2110, 5, 2, alarm=1))
    assert bus.sync(*BOTH, (0x382, "0F 00")).encoder_flags == EncoderFlag.ALARM


def test_a_telegram_that_comes_after_its_scan_counts_at_once() -> None:
    """The drive answers late: its position is used with the age that it has, and not left until the next one."""
    bus = Telegrams()
    bus.sync(*BOTH)
    assert (bus.sync(BOTH[1]).age, bus.image.counts) == (1, TURN)
    bus.node.dispatch(Frame(0x182, bytes.fromhex("37 12 00 00 10 00 9C FF")))
    assert (bus.image.age, bus.image.counts) == (0, 2 * TURN)


@pytest.mark.parametrize("inverted", [False, True])
def test_a_missing_position_goes_on_the_way_that_the_motor_turns(inverted: bool) -> None:
    """Minus one turn a second: 2097 increments in 4 ms, 15 729 in the 30 ms after which nothing is bridged."""
    bus, sign = Telegrams(inverted=inverted), -1 if inverted else 1
    counts = bus.sync(*BOTH).position
    assert bus.sync(BOTH[1]).position - counts == -sign * 2097
    assert bus.sync(BOTH[1], periods=50).position - counts == -sign * 15_729


def test_without_the_speed_telegram_the_way_is_the_speed() -> None:
    """1000 increments in 4 ms, and again 2000 in 8 ms: 250 000 a second, whatever an old 606C says."""
    bus = Telegrams()
    bus.sync((0x182, "37 12 00 00 00 00 00 00"), BOTH[1])
    bus.sync((0x182, "37 12 E8 03 00 00 00 00"))
    assert bus.image.vel_rad_s == pytest.approx(250_000 / TURN * math.tau)
    bus.sync()
    bus.sync((0x182, "37 12 B8 0B 00 00 00 00"))
    assert bus.image.vel_rad_s == pytest.approx(250_000 / TURN * math.tau)


def test_a_drive_without_606c_has_the_speed_of_its_way() -> None:
    bus = Telegrams(frozenset((m.TORQUE,)))
    assert bus.sync((0x182, "37 12 00 00 00 00 00 00")).vel_rad_s == 0.0
    bus.sync((0x182, "37 12 E8 03 00 00 00 00"))
    assert bus.image.vel_rad_s == pytest.approx(250_000 / TURN * math.tau)
    # A position that is missing has gone no way: the axis goes on with its speed, 1000 increments a scan.
    bus.sync()
    assert (bus.image.speed_age, bus.image.position) == (1, 2000)
    assert bus.image.vel_rad_s == pytest.approx(250_000 / TURN * math.tau)
    bus.sync((0x182, "37 12 B8 0B 00 00 00 00"))
    assert bus.image.vel_rad_s == pytest.approx(250_000 / TURN * math.tau)


@pytest.mark.parametrize("present", [(), (m.TORQUE,), (m.TORQUE_OFFSET,), tuple(ALL)])
def test_only_a_torque_that_is_mapped_is_known(present: tuple[m.Signal, ...]) -> None:
    image = Telegrams(frozenset(present)).image
    assert (image.torque_known, image.torque_offset) == (m.TORQUE in present, m.TORQUE_OFFSET in present)


def test_what_is_not_mapped_is_0_and_603f_is_bytes_4_and_5_behind_the_speed() -> None:
    bus = Telegrams(frozenset((m.VELOCITY, m.ERROR)))
    seen = bus.sync((0x182, "37 12 00 00 08 00"), (0x282, "00 00 F8 FF 10 23"))
    assert (seen.error_code, seen.torque_nm, seen.input_word) == (0x2310, 0.0, None)
    assert Telegrams().sync(*BOTH).error_code == 0


def test_the_outputs_go_out_in_the_second_telegram_of_the_drive() -> None:
    """CiA 301: RPDO 1 of node 2 at 202h, RPDO 2 at 302h; nobody else may send either."""
    wire, used = Wire(), settings()
    node = remote_node(wire)
    image = ProcessImage(node, used, BusUnits(used, 257.0), m.plan_mapping(ALL, True))
    image.send(0x0F, 0.0, 0.0, 0x0001_0002)
    assert wire.sent == [(0x202, "0F 00 00 00 00 00 00 00"), (0x302, "02 00 01 00")]
    for number, can_id in enumerate((0x302, 0x202), 1):
        node.dispatch(Frame(can_id, bytes(8)))
        assert (node.foreign, node.foreign_id) == (number, 0x302)


def test_frames_of_others_do_not_hold_up_the_wait_for_an_answer() -> None:
    """A frame every 0.5 ms on a bus that is never quiet: the 2 ms end, and one telegram is missing."""
    bus = Telegrams()
    receive = bus.wire.receive

    def busy(timeout_s: float) -> Frame | None:
        bus.wire.time_s += 0.0005
        return receive(0.0) or Frame(0x123, b"") if bus.wire.time_s < 1.0 else None

    bus.wire.receive = busy  # type: ignore[method-assign]
    seen = bus.sync(BOTH[0])
    assert (seen.age, seen.inputs_age) == (0, 1)
    assert bus.wire.time_s == pytest.approx(0.0025)


def test_one_telegram_of_two_is_no_answer_and_an_old_answer_is_forgotten() -> None:
    bus = Telegrams()
    assert not bus.sync(BOTH[0]).complete
    assert bus.sync(*BOTH).complete
    bus.image.forget()
    assert not bus.image.complete
    assert not bus.sync(BOTH[0]).complete


def test_behind_frames_that_could_not_be_read_no_telegram_is_believed() -> None:
    bus = Telegrams()
    bus.sync(*BOTH)
    bus.image.congested = True
    seen = bus.sync((0x182, "37 12 FF FF FF 00 00 00"))
    assert (seen.counts, seen.age) == (TURN, 1)


@pytest.mark.parametrize("data", ["37 12 00 00 09 00 9C", "37 12 00 00 09 00 9C FF 00"])
def test_a_telegram_of_another_length_is_not_taken(data: str) -> None:
    bus = Telegrams()
    bus.sync(*BOTH)
    bus.image.begin(1)
    bus.image.watches[0].take(bytes.fromhex(data), in_time=True)
    bus.image.collect(0.0)
    assert (bus.image.counts, bus.image.age, bus.image.wrong_lengths) == (TURN, 1, 1)


def test_an_answer_that_another_one_contradicts_is_not_used() -> None:
    bus = Telegrams()
    for _ in range(12):
        bus.sync(*BOTH)
    assert bus.image.watches[0].late == 0
    bus.sync(BOTH[0], (0x182, "37 12 00 00 09 00 9C FF"), BOTH[1])
    assert (bus.image.counts, bus.image.age, bus.image.contradicted) == (TURN, 1, 1)


# --- the two functions of CiA 402 ---------------------------------------------------------------------------------

S, R = DriveState, DriveRequest
# Transitions 2 to 5 up (06, 07, 0F), 7 to 10 and 12 down (00), 10 or 11 quick stop (02), 15 reset (80).
WORDS = {
    S.SWITCH_ON_DISABLED: {R.ENABLE: 0x06},
    S.READY_TO_SWITCH_ON: {R.ENABLE: 0x07},
    S.SWITCHED_ON: {R.ENABLE: 0x0F, R.QUICK_STOP: 0x02},
    S.OPERATION_ENABLED: {R.ENABLE: 0x0F, R.QUICK_STOP: 0x02},
    S.QUICK_STOP_ACTIVE: {R.ENABLE: 0x02, R.QUICK_STOP: 0x02},
    S.FAULT: {R.FAULT_RESET: 0x80},
}


@pytest.mark.parametrize("state", S)
@pytest.mark.parametrize("request_", R)
def test_the_word_for_every_state_and_request(state: DriveState, request_: DriveRequest) -> None:
    assert next_controlword(state, request_, 0) == WORDS.get(state, {}).get(request_, 0)
    # The reset is an edge: after 80 comes 00. Nothing else depends on the word before.
    again = next_controlword(state, request_, 0x80)
    assert again == (0 if request_ is R.FAULT_RESET else WORDS.get(state, {}).get(request_, 0))


def test_a_drive_in_its_fault_reaction_has_torque() -> None:
    assert set(ENERGISED) == {S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE, S.FAULT_REACTION_ACTIVE}


@pytest.mark.parametrize(
    "code", [0x2310, 0x2350, 0x3210, 0x4310, 0x7305, 0x8130, 0x8150, 0x8250, 0x8611, 0xFF00]
)
def test_a_complaint_stops(code: int) -> None:
    assert stops(code)


@pytest.mark.parametrize("code", [0x0000, 0x2351, 0x8110, 0x8120, 0x8140, 0x8240])
def test_a_warning_and_the_end_of_an_error_stop_nothing(code: int) -> None:
    assert not stops(code)


# --- network management -------------------------------------------------------------------------------------------


def judged(
    wire: Wire, *frames: tuple[int, str], before: LinkFlag = LinkFlag.NONE, scans: int = 0
) -> LinkFlag:
    node = remote_node(wire)
    node.heartbeat_age = scans
    for can_id, data in frames:
        node.dispatch(Frame(can_id, bytes.fromhex(data)))
    return connection_flags(node, before, commanded=True, timeout_scans=37)


@pytest.mark.parametrize(
    ("can_id", "data", "flags"),
    [
        (0x702, "05", LinkFlag.NONE),
        (0x702, "", LinkFlag.NONE),
        (0x702, "85", LinkFlag.NONE),  # bit 7 toggles in node guarding
        (0x702, "00", LinkFlag.RESTARTED),
        (0x702, "04", LinkFlag.NOT_OPERATIONAL),
        (0x702, "7F", LinkFlag.NOT_OPERATIONAL),
        (0x703, "7F", LinkFlag.NONE),  # another node
        # NMT of another master: stop, pre-operational, resets; to this node, to all, and to another one.
        (0x000, "02 02", LinkFlag.NOT_OPERATIONAL | LinkFlag.OTHER_MASTER),
        (0x000, "80 02", LinkFlag.NOT_OPERATIONAL | LinkFlag.OTHER_MASTER),
        (0x000, "02 00", LinkFlag.NOT_OPERATIONAL | LinkFlag.OTHER_MASTER),
        (0x000, "80 00", LinkFlag.NOT_OPERATIONAL | LinkFlag.OTHER_MASTER),
        (0x000, "81 00", LinkFlag.NOT_OPERATIONAL | LinkFlag.OTHER_MASTER),
        (0x000, "82 02", LinkFlag.NOT_OPERATIONAL | LinkFlag.OTHER_MASTER),
        (0x000, "01 02", LinkFlag.OTHER_MASTER),
        (0x000, "80 03", LinkFlag.OTHER_MASTER),
        # SYNC, a request to the drive, our own heartbeat: only this master may send them.
        (0x080, "", LinkFlag.OTHER_MASTER),
        (0x602, "40 41 60 00 00 00 00 00", LinkFlag.OTHER_MASTER),
        (0x77F, "05", LinkFlag.OTHER_MASTER),
        (0x181, "00", LinkFlag.NONE),
    ],
)
def test_a_frame_and_the_flag_of_the_connection(can_id: int, data: str, flags: LinkFlag) -> None:
    assert judged(Wire(), (can_id, data)) == flags


def test_a_state_of_before_the_start_is_no_loss_until_it_is_told_again() -> None:
    """A drive tells its state every 50 ms, and the last time may have been before its start."""
    node = remote_node(Wire())
    node.dispatch(Frame(0x702, b"\x7f"))
    for age, flag in ((1, LinkFlag.NONE), (0, LinkFlag.NOT_OPERATIONAL)):
        node.heartbeat_age = age
        assert connection_flags(node, LinkFlag.NONE, commanded=True, timeout_scans=37) == flag


def test_a_second_boot_up_counts_behind_a_heartbeat() -> None:
    node = remote_node(Wire())
    for data in ("05", "00", "7F", "00"):
        node.dispatch(Frame(0x702, bytes.fromhex(data)))
    assert (node.boots, node.state) == (2, NmtState.BOOT_UP)


def test_the_heartbeat_time_out_ends_with_its_last_scan() -> None:
    assert judged(Wire(), scans=37) == LinkFlag.NONE
    assert judged(Wire(), scans=38) == LinkFlag.HEARTBEAT_LOST


def test_what_was_lost_stays_lost_and_is_not_believed() -> None:
    stays = (
        LinkFlag.HEARTBEAT_LOST, LinkFlag.RESTARTED, LinkFlag.NOT_OPERATIONAL, LinkFlag.OTHER_MASTER,
        LinkFlag.TWO_SENDERS,
    )  # fmt: skip
    for flag in LinkFlag:
        assert judged(Wire(), (0x702, "05"), before=flag) == (flag if flag in stays else LinkFlag.NONE)
        assert bool(flag & LATCHED) is (flag in stays)
    lost = {LinkFlag.HEARTBEAT_LOST, LinkFlag.RESTARTED, LinkFlag.NOT_OPERATIONAL, LinkFlag.BUS_DOWN}
    assert {flag for flag in LinkFlag if flag & LOST} == lost


def test_a_bus_that_is_down_is_told_and_before_the_first_command_nothing_else() -> None:
    wire = Wire()
    wire.down = True
    assert judged(wire) == LinkFlag.BUS_DOWN
    node = remote_node(Wire())
    for frame in ((0x702, "00"), (0x000, "80 00")):
        node.dispatch(Frame(frame[0], bytes.fromhex(frame[1])))
    assert connection_flags(node, LinkFlag.NONE, commanded=False, timeout_scans=1) == LinkFlag.NONE
    # With the first command a new run begins, and what came before is forgotten.
    node.forget_boots()
    node.state = NmtState.OPERATIONAL
    assert (node.boots, node.foreign, node.foreign_id, node.heartbeat_age) == (0, 0, -1, 0)
    assert connection_flags(node, LinkFlag.NONE, commanded=True, timeout_scans=1) == LinkFlag.NONE


class Broken(can.BusABC):
    """A bus that takes frames, or gives frames, and never both."""

    def __init__(self, *, sends: bool) -> None:
        super().__init__("broken")
        self.sends = sends

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if not self.sends:
            raise can.CanOperationError("no")

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self.sends:
            raise can.CanOperationError("no")
        return can.Message(arbitration_id=0x702, data=b"\x05", is_extended_id=False), False


@pytest.mark.parametrize("sends", [True, False])
def test_a_bus_that_works_one_way_is_down(sends: bool) -> None:
    bus = Broken(sends=sends)
    link = BusLink(bus)
    for failed in range(3):
        assert link.down is False, failed
        link.send(0x202, b"")
        link.receive(0.0)
    assert link.down
    link.close()


# --- SDO ----------------------------------------------------------------------------------------------------------


def client(wire: Wire) -> SdoClient:
    return SdoClient(wire, NODE, lambda frame: None, 0.05)  # type: ignore[arg-type]


READ_6041 = "40 41 60 00 00 00 00 00"


@pytest.mark.parametrize(
    ("answer", "value"), [("4B 41 60 00 37 12 00 00", 0x1237), ("80 41 60 00 00 00 02 06", None)]
)
def test_an_answer_to_another_object_is_passed_over(answer: str, value: int | None) -> None:
    """An upload of 6061, an abort of it, then the right answer: a late one must not be taken for a parameter."""
    wire = Wire()
    wire.answers[READ_6041] = ["4F 61 60 00 09 00 00 00", "80 61 60 00 00 00 02 06", answer]
    assert client(wire).optional(0x6041) == value


def test_silence_is_no_missing_object() -> None:
    with pytest.raises(SdoError) as raised:
        client(Wire()).optional(0x6041)
    assert raised.value.silent


def test_a_write_is_sent_once_and_a_read_three_times() -> None:
    """A command whose answer was lost has been carried out, for all that is known."""
    for times, ask in (
        (1, lambda sdo: sdo.set(0x6040, 0, 0x80)),
        (3, lambda sdo: sdo.number(0x6041)),
    ):
        wire = Wire()
        with pytest.raises(SdoError):
            ask(client(wire))
        assert len(wire.sent) == times


@pytest.mark.parametrize(
    ("index", "sub", "value", "request_"),
    [
        (0x6040, 0, 0x0F, "2B 40 60 00 0F 00 00 00"),
        (0x60FF, 0, -2, "23 FF 60 00 FE FF FF FF"),
        (0x6060, 0, 9, "2F 60 60 00 09 00 00 00"),
        (0x1016, 1, 0x007F_0096, "23 16 10 01 96 00 7F 00"),
    ],
)
def test_an_expedited_write(index: int, sub: int, value: int, request_: str) -> None:
    wire = Wire()
    wire.answers[request_] = [f"60 {request_[3:11]} 00 00 00 00"]
    client(wire).set(index, sub, value)
    assert wire.sent == [(0x602, request_)]


@pytest.mark.parametrize(
    ("late", "answers"),
    [
        ("4B 3F 60 00 05 73 00 00", []),  # 603F, asked for in the scan before
        ("80 3F 60 00 00 00 02 06", []),
        ("60 41 60 00 00 00 00 00", []),  # a write of the same object was done
        ("4B 41 60 00 37 12 00 00", [b"\x37\x12"]),
        ("80 41 60 00 00 00 02 06", [None]),
    ],
)
def test_a_request_behind_the_process_data_takes_its_own_answer_only(
    late: str, answers: list[bytes | None]
) -> None:
    wire, seen = Wire(), list[bytes | None]()
    node = remote_node(wire)
    requests = SdoRequests(node)
    requests.read(0x6041, 0, seen.append)
    assert wire.sent == [(0x602, READ_6041)]
    node.dispatch(Frame(0x582, bytes.fromhex(late)))
    assert (seen, requests.waiting) == (answers, not answers)
