"""What a drive and its nodes are told and believed in scans that come seldom: faults, losses, silences, set-ups."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.brake import BrakeControl
from gantryctl.drives.canopen.bus.link import Frame
from gantryctl.drives.canopen.bus.node import NmtState, connection_flags
from gantryctl.drives.canopen.bus.requests import SdoRequests
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.canopen.nodes.neighbours import Neighbours
from gantryctl.drives.canopen.nodes.outputs import OutputWriter
from gantryctl.drives.canopen.process_image import ProcessImage
from gantryctl.drives.canopen.scaling import BusUnits
from gantryctl.drives.canopen.settings import LoadEncoderSettings, OutputBits
from gantryctl.drives.canopen.setup import opening
from gantryctl.drives.canopen.setup.gains import GainChange, write_gains
from gantryctl.drives.canopen.setup.parameter_check import WantedParameter, write_parameters
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.drives.profiles import load_profile
from gantryctl.errors import DeviceError
from gantryctl.image import DigitalInputs, DriveRequest, DriveState, LinkFlag, OutputImage
from unit.drives.canopen.canopen_bench import SYNC_S, Bench
from unit.drives.canopen.dictionary import Dictionary, settings
from unit.drives.canopen.test_in_motion_by_hand import Stop
from unit.drives.canopen.test_nodes_by_hand import of_cia_401
from unit.drives.canopen.test_scan_by_hand import HEARTBEAT, RPDO_1, TPDO_1, sent_from_now, statuswords
from unit.drives.canopen.test_supervision_by_hand import Watched
from unit.drives.canopen.test_wire import ALL, BOTH, TURN, Telegrams
from unit.drives.canopen.wire import Wire, remote_node

pytestmark = pytest.mark.can

S, R = DriveState, DriveRequest


def deaf(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on no telegram of the drive comes through."""
    receive = bench.link.receive

    def without(wait: float) -> Frame | None:
        while (frame := receive(wait)) is not None and frame.can_id in (TPDO_1, 0x282):
            pass
        return frame

    monkeypatch.setattr(bench.link, "receive", without)


# --- faults and losses ------------------------------------------------------------------------------------------------


def test_a_set_up_brings_the_fault_code_of_the_drive_and_no_older_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench().open()
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | 0x08)
    for code in (0x7305, 0):
        bench.drive.node.emergencies.code = 0x2310
        bench.drive._set_up(bench.drive.opened._replace(error_code=code), None)
        assert bench.drive.node.emergencies.code == code


def test_an_error_that_is_reset_has_no_code_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """EMCY 0000 of a drive that still shows its fault: the next cause is asked for."""
    bench = Bench().open()
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | 0x08)
    told = []
    for data in ("10 23 02", "00 00 00"):
        bench.drive.node.emergencies.take(bytes.fromhex(data), 1)
        told.append(bench.scan(R.DISABLE).error_code)
    assert told == [0x2310, 0]


def test_the_code_of_a_fault_that_is_over_explains_no_later_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Some drives send no "error reset" (EMCY 0000), and 603F of some keeps the last error; then 603F is read again."""
    bench = Bench().open()
    bench.drive._set_up(bench.drive.opened._replace(error_code=0x3210), None)
    low = [0x40]
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | low[0])
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(bench.drive.requests, "read", lambda index, sub, then: asked.append((index, sub)))
    told = []
    for state, emergency in ((0x08, ""), (0x08, "10 23 02"), (0x40, ""), (0x08, "")):
        low[0] = state
        if emergency:
            bench.drive.node.emergencies.take(bytes.fromhex(emergency), 1)
        told.append(bench.scan(R.DISABLE).error_code)
        bench.scan(R.DISABLE)
    assert told == [0, 0x2310, 0, 0]
    assert asked.count((0x603F, 0)) == 2


@pytest.mark.parametrize("register_603f", [0x2310, 0])
def test_a_warning_explains_a_fault_only_where_603f_tells_nothing(
    monkeypatch: pytest.MonkeyPatch, register_603f: int
) -> None:
    """CAN overrun (8110) some time ago, then a fault without EMCY."""
    bench = Bench().open()
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | 0x08)
    bench.drive.node.emergencies.take(bytes.fromhex("10 81 10"), 1)
    bench.scan(R.DISABLE)
    bench.drive.parameter_watch.error_code = register_603f
    assert bench.drive._feedback().error_code == (register_603f or 0x8110)


@pytest.mark.parametrize(
    ("low", "code", "kept", "limited"),
    [
        (0x40, 0, False, False), (0x23, 0, False, False), (0x27, 0, True, True), (0x07, 0, True, True),
        (0x0F, 0x2310, True, True), (0x08, 0x2310, False, False),
    ],
)  # fmt: skip
def test_what_a_state_makes_of_code_inputs_and_limit(
    monkeypatch: pytest.MonkeyPatch, low: int, code: int, kept: bool, limited: bool
) -> None:
    """A code is shown with a fault; inputs of a lost node are kept, and bit 11 is believed, while there is torque."""
    bench = Bench().open().enable()
    keeps: list[bool] = []

    def reads(word: int | None, *, keep: bool) -> DigitalInputs:
        keeps.append(keep)
        return DigitalInputs()

    monkeypatch.setattr(bench.drive.beside, "read_inputs", reads)
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | low | 1 << 11)
    bench.drive.node.emergencies.code = 0x2310
    seen = bench.scan(R.DISABLE)
    assert (seen.error_code, keeps[-1], seen.torque_limited) == (code, kept, limited)


@pytest.mark.parametrize("lost", [False, True])
def test_of_a_lost_drive_no_parameter_is_told_and_nothing_is_asked(
    monkeypatch: pytest.MonkeyPatch, lost: bool
) -> None:
    """A question would take the place of the stop by SDO."""
    bench = Bench().open().enable()
    drive, asked, stops = bench.drive, list[bool](), list[int]()
    monkeypatch.setattr(drive._supervision, "ask", asked.append)
    monkeypatch.setattr(drive._stop_by_sdo, "scan", lambda word, outputs, periods: stops.append(periods))
    drive.parameter_watch.differs[0x6085, 0] = "6085 is another one"
    drive.node.boots = int(lost)
    assert bench.scan().changed == ("" if lost else "6085 is another one")
    asked.clear()
    monkeypatch.setattr(drive, "_periods", lambda: 3)
    bench.scan()
    bench.scan()
    assert (len(asked), stops[1:]) == ((0, [3]) if lost else (2, []))


@pytest.mark.parametrize(
    ("low", "request_", "enabled"),
    [(0x40, R.DISABLE, False), (0x23, R.ENABLE, True), (0x1027, R.DISABLE, True), (0x07, R.QUICK_STOP, True)],
)
def test_only_a_resting_drive_is_asked_for_its_target(
    monkeypatch: pytest.MonkeyPatch, low: int, request_: DriveRequest, enabled: bool
) -> None:
    """The target of a drive that power comes on for is meant."""
    bench = Bench().open()
    bench.run(0.02, R.DISABLE)
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | low)
    bench.scan(request_)
    asked: list[bool] = []
    monkeypatch.setattr(bench.drive._supervision, "ask", asked.append)
    bench.scan(request_)
    assert asked == [enabled]


def test_a_drive_is_stopped_by_sdo_from_the_second_scan_without_an_answer_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench().open().enable()
    stops: list[int] = []
    monkeypatch.setattr(
        bench.drive._stop_by_sdo, "scan", lambda *_: stops.append(bench.drive.process.silence)
    )
    deaf(bench, monkeypatch)
    for _ in range(4):
        bench.scan(R.DISABLE)
    assert stops == [2, 3]


@pytest.mark.parametrize("way", [1.0, -1.0], ids=["plus", "minus"])
def test_the_speed_of_a_drive_that_is_not_heard_on_its_ramp_is_read_by_sdo(
    monkeypatch: pytest.MonkeyPatch, way: float
) -> None:
    """From 2 deg/s at 5.5 deg/s2, within what the load swings by; asked for in the scan before."""
    bench = Bench().open().enable()
    bench.run(0.25, speed_deg_s=2.0 * way)
    sent = sent_from_now(bench, monkeypatch, 0x602)
    bench.scan(R.QUICK_STOP)
    assert not [
        data for data in sent if data.startswith("40 6c 60")
    ]  # a stop whose telegrams come asks nothing
    deaf(bench, monkeypatch)
    for since in range(1, 31):
        seen = bench.scan(R.QUICK_STOP)
        assert seen.age_scans == since
        # The words that stop go first, in the second scan; the third asks.
        assert seen.speed_age_scans == (since if since < 4 else 1)
        if since >= 4:
            expected = 2.0 - 5.5 * (since - 3) * SYNC_S
            assert way * math.degrees(seen.vel_act_rad_s) / bench.ratio == pytest.approx(expected, abs=0.15)
    bench.drive.close()


@pytest.mark.parametrize("inverted", [False, True])
def test_the_newer_of_telegram_and_sdo_is_the_speed(inverted: bool) -> None:
    """Minus one turn a second by the telegram of scan 10, two turns a second by SDO, asked for in scan 11."""
    bus, sign = Telegrams(inverted=inverted), -1 if inverted else 1
    bus.node.scan = 10
    seen = bus.sync(*BOTH)
    for scan, asked, age, turns in ((11, None, 1, -1), (12, 11, 1, 2), (13, None, 2, 2), (17, None, 6, 2)):
        periods, bus.node.scan = scan - bus.node.scan, scan
        bus.sync(periods=periods)
        if asked is not None:
            assert seen.takes_speed is not None
            seen.takes_speed(2 * TURN, asked)
        assert seen.speed_age == age
        assert seen.vel_rad_s == pytest.approx(sign * turns * math.tau)
    # A telegram of this scan, and one that is late, but newer.
    bus.node.scan = 18
    bus.sync(*BOTH)
    assert (seen.speed_age, seen.vel_rad_s) == (0, pytest.approx(-sign * math.tau))
    bus.node.scan = 19
    bus.sync()
    seen.takes_speed(2 * TURN, 16)
    assert (seen.speed_age, seen.vel_rad_s) == (1, pytest.approx(-sign * math.tau))


def test_without_606c_the_speed_is_not_asked_for() -> None:
    assert Telegrams(ALL - {m.VELOCITY}).image.takes_speed is None


def test_a_drive_that_says_it_is_not_operational_but_answers_gets_its_heartbeat(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It takes commands: without heartbeats its own watch would make it fault."""
    bench = Bench().open().enable()
    bench.drive._flags |= LinkFlag.NOT_OPERATIONAL
    assert bench.scan().link & LinkFlag.NOT_OPERATIONAL
    sent = sent_from_now(bench, monkeypatch, HEARTBEAT)
    bench.run(0.1)
    assert sent
    bench.drive.close()


def test_a_drive_without_a_heartbeat_is_not_believed_though_its_telegrams_come(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What sends them may be anything: it is shown as nothing, and told nothing but torque off."""
    bench = Bench().open().enable()
    bench.drive._flags |= LinkFlag.HEARTBEAT_LOST
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | 0x27)
    shown = {bench.scan(R.ENABLE, 1.0).state for _ in range(50)}
    # By SDO it has shown since that its torque is off.
    assert shown == {S.UNKNOWN, S.SWITCH_ON_DISABLED}
    assert bench.drive.process.silence == 0
    assert {data[:17] for data in sent[1:]} == {"00 00 00 00 00 00"}
    bench.drive.close()


def test_a_drive_whose_telegrams_are_lost_gets_its_heartbeat(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has said nothing of leaving OPERATIONAL: the program stops it on its ramp."""
    bench = Bench().open().enable()
    deaf(bench, monkeypatch)
    sent = sent_from_now(bench, monkeypatch, HEARTBEAT)
    bench.run(0.1)
    assert sent
    bench.link.close()


def test_a_drive_whose_bit_12_means_nothing_is_not_told_to_ignore_its_command() -> None:
    bench = Bench().open().enable()
    bench.drive._enabling, bench.drive._followed = 10_000, True
    bench.drive.process._raw[m.STATUSWORD] = 0x0227
    for follows, flag in ((True, LinkFlag.IGNORES_COMMAND), (False, LinkFlag.NONE)):
        bench.drive.settings = replace(bench.drive.settings, follows_bit=follows)
        assert bench.drive._ignores_command() == flag


@pytest.mark.parametrize(
    ("link", "off"), [(LinkFlag.LATE, True), (LinkFlag.QUEUE_FULL, True), (LinkFlag.BUS_DOWN, False)]
)
def test_what_is_no_loss_does_not_end_the_last_scans(
    monkeypatch: pytest.MonkeyPatch, link: LinkFlag, off: bool
) -> None:
    bench = Bench().open()
    at_rest = bench.run(0.1, R.DISABLE)
    monkeypatch.setattr(bench.drive, "read", lambda: at_rest._replace(link=link))
    assert bench.drive._comes_to_rest() is off
    bench.link.close()


# --- silences ---------------------------------------------------------------------------------------------------------


def test_behind_a_silence_only_a_new_answer_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench().open().enable()
    deaf(bench, monkeypatch)
    with pytest.raises(DeviceError, match="does not answer SYNC"):
        bench.drive.resume()


def test_a_look_leaves_the_silence_as_it_was() -> None:
    bench = Bench().open().enable()
    for silent in (True, False):
        bench.drive.silent_process_data = silent
        bench.drive.look()
        assert bench.drive.silent_process_data is silent


def test_a_second_loss_is_stopped_as_the_first_one() -> None:
    """A node that another master has stopped is started once more to take the word that stops it."""
    drive = Stop(state=NmtState.STOPPED)
    for number in (1, 2):
        drive.scan(0x00, scans=10)
        assert drive.started == number
        drive.stop.forget()


def test_an_answer_that_is_no_refusal_has_no_abort_code() -> None:
    wire = Wire()
    node = remote_node(wire)
    requests, seen = SdoRequests(node), list[bytes | None]()
    for answer, code in (
        ("80 85 60 00 00 00 02 06", 0x0602_0000),
        ("43 85 60 00 05 00 00 00", 0),
        ("80 85 60 00 30 00 09 06", 0x0609_0030),
    ):  # fmt: skip
        requests.read(0x6085, 0, seen.append)
        node.dispatch(Frame(0x582, bytes.fromhex(answer)))
        assert requests.abort_code == code
    assert seen == [None, b"\x05\x00\x00\x00", None]


def test_the_answer_to_another_sub_index_is_none() -> None:
    """1016 has an entry for each node that is watched; that of the controller is the first."""
    node = remote_node(Wire())
    requests, seen = SdoRequests(node), list[bytes | None]()
    requests.read(0x1016, 1, seen.append)
    for answer in ("43 16 10 02 00 00 00 00", "43 16 10 01 96 00 7F 00"):
        node.dispatch(Frame(0x582, bytes.fromhex(answer)))
    assert seen == [bytes.fromhex("96 00 7F 00")]


# --- telegrams --------------------------------------------------------------------------------------------------------


def test_the_ring_of_the_drive_is_as_old_as_its_own_telegram() -> None:
    bus = Telegrams(ALL, m.RING_POSITION, load_encoder=LoadEncoderSettings(None, 2**20, 0, False))
    bus.sync(*BOTH, (0x382, "05 00 00 00"))
    assert bus.image.ring == (5, 0)
    bus.sync(*BOTH)
    assert bus.image.ring == (5, 1)


def test_a_second_sender_in_the_name_of_a_node_is_counted() -> None:
    beside: Any = SimpleNamespace(contradicted=3, data=b"", waiting=False)
    image = ProcessImage(
        remote_node(Wire()), settings(), BusUnits(settings(), 257.0), m.plan_mapping(ALL, False), (beside,)
    )
    image.watches[0].contradicted = 2
    assert image.contradicted == 5


def test_a_late_position_behind_a_scan_that_was_missed_is_older() -> None:
    """One turn a second: 2097 increments a scan. Two answers are missing, then a scan: the second comes behind it."""
    bus, other = Telegrams(), (0x282, "00 00 08 00 02 00 01 00")
    bus.sync(BOTH[0], other)
    bus.sync(other)
    bus.sync(other)
    position = (TURN + 2 * 2097).to_bytes(4, "little").hex(" ")
    assert bus.sync((0x182, f"37 12 {position} 9C FF"), other, periods=2).age == 2


def test_a_position_ahead_of_its_place_is_no_old_one() -> None:
    """Two answers are missing, and the axis was faster: 5 x 2097 increments on where 3 were expected."""
    bus, other = Telegrams(), (0x282, "00 00 08 00 02 00 01 00")
    bus.sync(BOTH[0], other)
    bus.sync(other)
    bus.sync(other)
    position = (TURN + 5 * 2097).to_bytes(4, "little").hex(" ")
    assert bus.sync((0x182, f"37 12 {position} 9C FF"), other).age == 0


@pytest.mark.parametrize(("inverted", "sign"), [(False, 1), (True, -1)])
def test_the_way_of_an_inverted_motor_without_606c_is_its_speed(inverted: bool, sign: int) -> None:
    bus = Telegrams(frozenset((m.TORQUE,)), inverted=inverted)
    bus.sync((0x182, "37 12 00 00 08 00 9C FF"))
    # 2097 increments in 4 ms: one turn a second.
    bus.sync((0x182, "37 12 31 08 08 00 9C FF"))
    assert bus.image.vel_rad_s == pytest.approx(sign * 6.283, rel=1e-3)


@pytest.mark.parametrize("commanded", [False, True])
def test_a_bus_that_is_down_is_told_before_the_first_command_too(commanded: bool) -> None:
    wire = Wire()
    wire.down = True
    flags = connection_flags(remote_node(wire), LinkFlag.NONE, commanded=commanded, timeout_scans=None)
    assert flags == LinkFlag.BUS_DOWN


def test_a_refused_question_is_no_wrong_mode_and_no_speed() -> None:
    drive = Watched()
    drive.watch._mode(None)
    drive.watch._target(None)
    assert not drive.watch.forbids
    drive.watch._mode(b"\x08")
    assert drive.watch.forbids


# --- brake, outputs, nodes --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", S)
def test_a_drive_holds_its_own_brake_open_while_it_turns(state: DriveState) -> None:
    """In a quick stop too: it closes at the end of the ramp."""
    brake = BrakeControl(settings(brake_owner="drive"))
    assert brake.is_open(state, None) is (state in (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE))


@pytest.mark.parametrize(("name", "bit"), [("horn", 17), ("lamp", 18), ("in_position", 19), ("at_rest", 20)])
def test_each_level_goes_to_its_own_output(name: str, bit: int) -> None:
    wired = OutputBits(horn=17, lamp=18, in_position=19, at_rest=20)
    writer = OutputWriter(settings(outputs=wired, brake_owner="drive"))
    writer.take(OutputImage(R.DISABLE)._replace(**{name: True}), brake_released=False, well=False)
    assert writer.drive_word == 1 << bit


def test_all_nodes_are_released() -> None:
    done: list[int] = []
    beside = object.__new__(Neighbours)
    beside.nodes = tuple(SimpleNamespace(release=lambda n=n: done.append(n)) for n in (5, 6))  # type: ignore[assignment]
    beside.release()
    assert done == [5, 6]


def test_what_a_node_said_before_its_set_up_is_forgotten() -> None:
    """It was in PRE-OPERATIONAL to be set up: that is no loss behind it."""
    io, _ = of_cia_401(OutputBits())
    io.node.remote.state, io.node.remote.boots = NmtState.PRE_OPERATIONAL, 1
    io.node.open()
    assert (io.node.remote.state, io.node.remote.boots, io.node.remote.heartbeat_age) == (None, 0, 0)


def test_a_node_whose_telegrams_have_another_length_is_set_up_again() -> None:
    io, _ = of_cia_401(OutputBits())
    for wrong, changed in ((2, False), (3, True)):
        io.node.watch.wrong_in_row = wrong
        assert io.node.changed is changed


# --- set-up -----------------------------------------------------------------------------------------------------------


def test_mode_9_is_written_afresh() -> None:
    """Behind a quick stop some drives say that they are enabled, and stand until 6060 changes."""
    sdo = Dictionary({(0x6060, 0): 9})
    assert opening._takes_csv(SimpleNamespace(sdo=sdo))  # type: ignore[arg-type]
    assert sdo.written == [(0x6060, 0, 0), (0x6060, 0, 9)]


def test_a_drive_in_another_mode_is_refused_and_what_it_lacks_is_not_watched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench()
    read = bench.drive.node.sdo.read

    def reads(index: int, sub: int) -> bytes:
        if index == 0x605B:
            raise SdoError(index, sub, 0x0602_0000)
        return read(index, sub)

    monkeypatch.setattr(bench.drive.node.sdo, "read", reads)
    monkeypatch.setattr(opening, "_select_csv", lambda node: ("6061 shows 8",))
    opened = bench.open().drive.opened
    assert "6061 shows 8" in opened.refusals
    absent = {row.place for row in opened.rows if row.verdict is ParameterVerdict.ABSENT}
    assert "605B:00" in absent
    assert not {f"{p.obj:04X}:{p.sub:02X}" for p in opened.kept} & absent


def test_the_unit_of_the_file_stands_above_that_of_the_profile() -> None:
    profile = load_profile("ingenia_everest")
    assert settings(velocity_unit="r/min", profile=profile).speed_unit == "r/min"
    assert settings(velocity_unit=None, profile=profile).speed_unit == "mrev/s"


def test_a_gain_that_is_kept_otherwise_gets_its_old_value_again() -> None:
    """A drive that limits the second one to 15 000: neither of them stays half written."""
    held = {(0x30A2, 1): 10_000, (0x30A2, 2): 10_000}

    def write(index: int, sub: int, data: bytes) -> None:
        value = int.from_bytes(data, "little")
        held[index, sub] = value if sub == 1 else min(value, 15_000)

    sdo = SimpleNamespace(
        number=lambda index, sub=0: 0x40 if index == 0x6041 else 7,
        read=lambda index, sub: held[index, sub].to_bytes(4, "little"),
        write=write,
    )
    node: Any = SimpleNamespace(sdo=sdo, link=SimpleNamespace(pause=lambda _: None))
    loop = load_profile("maxon_epos4").speed_loop
    assert loop is not None
    assert loop.ki is not None
    changes = (GainChange("kp", loop.kp, 10_000, 20_000), GainChange("ki", loop.ki, 10_000, 20_000))
    with pytest.raises(DeviceError, match="holds 15000"):
        write_gains(node, changes, 524_288)
    assert set(held.values()) == {10_000}


# --- what waits, and what is counted ----------------------------------------------------------------------------------


def test_a_second_loss_has_its_3_s_whole() -> None:
    """The first one was asked until the end; then the drive takes process data, and is lost again."""
    drive = Stop()
    drive.scan(0x00, scans=800, answers=False)
    asked = len(drive.asked.writes)
    drive.scan(0x00, scans=10, answers=False)
    assert len(drive.asked.writes) == asked
    drive.stop.forget()
    drive.scan(0x00, answers=False)
    assert len(drive.asked.writes) == asked + 1


@pytest.mark.parametrize(
    ("stepped", "silence", "down", "flags", "waits_s"),
    [
        (False, 5, True, LinkFlag.NOT_OPERATIONAL, 3.0), (True, 0, False, LinkFlag.NONE, 3.0),
        (True, 1, False, LinkFlag.NONE, 0.1), (True, 0, True, LinkFlag.NONE, 0.0),
        (True, 0, False, LinkFlag.NOT_OPERATIONAL, 0.0),
    ],
)  # fmt: skip
def test_no_scan_waits_long_for_a_drive_that_cannot_answer(
    stepped: bool, silence: int, down: bool, flags: LinkFlag, waits_s: float
) -> None:
    """A stepped drive is waited for by 3 s here: its process may be held up, but not in every scan."""
    drive: Any = SimpleNamespace(
        link=SimpleNamespace(stepped=stepped, down=down),
        settings=SimpleNamespace(answer_s=3.0),
        process=SimpleNamespace(silence=silence),
        _flags=flags,
    )
    assert CanopenDrive._patience_s.fget(drive) == waits_s  # type: ignore[attr-defined]


def test_a_drive_of_one_telegram_has_inputs_as_old_as_its_status() -> None:
    bus = Telegrams(frozenset((m.TORQUE,)))
    bus.sync((0x182, "37 12 00 00 08 00 9C FF"))
    assert bus.image.inputs_age == 0
    bus.sync()
    assert bus.image.inputs_age == 1


def test_a_telegram_behind_frames_that_could_not_be_read_is_counted_as_late() -> None:
    bus = Telegrams()
    bus.sync(*BOTH)
    bus.image.congested = True
    late = bus.image.watches[0].late
    bus.node.dispatch(Frame(TPDO_1, bytes.fromhex("37 12 00 00 08 00 9C FF")))
    assert bus.image.watches[0].late == late + 1


def test_behind_a_silence_the_program_begins_anew() -> None:
    """Boot-ups and contradictions of the silence are not its own."""
    bench = Bench().open().enable()
    bench.drive.resume()
    assert not bench.drive.commanded
    bench.scan(R.DISABLE)
    assert bench.drive.commanded


@pytest.mark.parametrize(
    ("code", "takes_none"),
    [
        (0x0601_0002, True), (0x0601_0000, True), (0x0609_0030, True), (0x0609_0031, True), (0x0609_0032, True),
        (0x0800_0022, False), (0x0800_0021, False),
    ],
)  # fmt: skip
def test_a_value_that_is_never_taken_is_told_from_one_that_is_not_taken_now(
    code: int, takes_none: bool
) -> None:
    """CiA 301: cannot be written, access, range, too high, too low; in its present state, under local control."""
    sdo = Dictionary({(0x6085, 0): 5})
    sdo.refused[0x6085, 0] = code
    refused, codes = write_parameters(sdo, [WantedParameter(0x6085, 0, 7, "x")])  # type: ignore[arg-type]
    assert (refused, codes) == (frozenset({(0x6085, 0)} if takes_none else ()), {"6085:00": code})
