"""What begins anew with a set-up, an answer or a new count, and who counts what: link, nodes and drive by hand."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import can
import pytest

from gantryctl.drives.canopen.bus.link import BusLink, Frame
from gantryctl.drives.canopen.bus.node import NmtState, NodeIdentity, RemoteNode
from gantryctl.drives.canopen.diagnostics import TpdoWatch
from gantryctl.drives.canopen.nodes.bus_node import BusNode
from gantryctl.drives.canopen.nodes.inputs import InputReader
from gantryctl.drives.canopen.nodes.ring_encoder import RingAngle
from gantryctl.drives.canopen.settings import OutputBits
from gantryctl.drives.canopen.setup import parameter_check as check
from gantryctl.drives.canopen.setup.opening import wanted_of
from gantryctl.drives.canopen.setup.parameter_watch import ROUND_S, ParameterWatch
from gantryctl.drives.profiles import load_profile
from gantryctl.errors import DeviceError
from gantryctl.image import DriveRequest, LinkFlag, OutputImage
from unit.drives.canopen.canopen_bench import Bench
from unit.drives.canopen.dictionary import Dictionary, settings
from unit.drives.canopen.test_nodes_by_hand import CONTACTS, RING, neighbours, of_cia_401
from unit.drives.canopen.test_refusals_and_silence import Scripted, message
from unit.drives.canopen.test_scan_by_hand import sent_from_now, statuswords
from unit.drives.canopen.test_set_up_by_hand import NOTHING
from unit.drives.canopen.wire import Asked, Wire, remote_node

pytestmark = pytest.mark.can

DISABLE = DriveRequest.DISABLE

# --- the link ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("reads", "down"), [("--+--", False), ("--+---", True), ("---+", False)])
def test_only_failures_in_a_row_are_a_bus_that_cannot_be_read(reads: str, down: bool) -> None:
    link = BusLink(Scripted(*(can.CanOperationError("no") if r == "-" else message(0x182) for r in reads)))
    for _ in reads:
        link.receive(0.0)
    assert link.down is down
    link.close()


def test_our_own_frames_under_way_are_echoes_in_any_order() -> None:
    bus = Scripted()
    link = BusLink(bus, echoes=True)
    frames = (0x080, 0x202, 0x302, 0x77F, 0x602)
    for can_id in frames:
        link.send(can_id, b"\x05")
    bus.given = [message(can_id, b"\x05") for can_id in (*reversed(frames), 0x202)]
    # The sixth is a second one of the same identifier and data: of somebody else.
    assert link.receive(0.0) == Frame(0x202, b"\x05")
    link.close()


def test_a_copy_of_the_process_begins_without_what_was_sent_before() -> None:
    bus = Scripted()
    link = BusLink(bus, echoes=True)
    link.send(0x080, b"")
    bus.given = [message(0x182)]
    link.take_over()
    assert (link.unseen, bus.given) == (0, [])
    bus.given = [message(0x080)]
    assert link.receive(0.0) == Frame(0x080, b"")
    link.close()


def test_what_has_come_is_passed_over_and_nothing_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive that sends a heartbeat every 50 ms would be waited for without an end."""
    bus, waits = Scripted(), list[float | None]()
    bus.given = [message(0x702, b"\x05"), message(0x182)]
    given = bus.recv
    monkeypatch.setattr(bus, "recv", lambda timeout=None: (waits.append(timeout), given(timeout))[1])
    link = BusLink(bus)
    link.take_over()
    assert (waits, bus.given) == ([0.0] * 3, [])
    link.close()


def test_a_frame_that_was_not_sent_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """To a bus that refuses it, and to one that was left."""
    bus = Scripted()
    link = BusLink(bus)
    assert link.send(0x202, b"") is True

    def refuse(*_: object) -> None:
        raise can.CanOperationError("no")

    monkeypatch.setattr(bus, "send", refuse)
    assert link.send(0x202, b"") is False
    link.close()
    assert link.send(0x202, b"") is False


def test_frames_that_never_come_back_are_dropped_behind_256() -> None:
    """An interface that gives no frame back after all: 256 of them at the most are waited for."""
    link = BusLink(Scripted(), echoes=True)
    for number in range(1000):
        link.send(0x202, number.to_bytes(2, "little"))
    assert link._echoes is not None
    assert 0 < len(link._echoes) <= 257
    link.close()


def test_a_drive_that_cannot_be_set_up_leaves_the_bus_to_others() -> None:
    """Its node does not answer: nobody else could open the interface, or the drive, until the process ends."""
    bench = Bench()
    told: list[str] = []
    bench.link._when_closed = lambda: told.append("closed")
    bench.link.send = lambda can_id, data: True  # type: ignore[method-assign]
    with pytest.raises(DeviceError, match="does not answer"):
        bench.drive.open()
    assert told == ["closed"]


def test_a_node_beside_the_drive_that_does_not_answer_sync_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bench = Bench()

    def silent() -> None:
        raise DeviceError("node 3, I/O does not answer SYNC")

    monkeypatch.setattr(bench.drive.beside, "check_answers", silent)
    with pytest.raises(DeviceError, match="node 3, I/O"):
        bench.drive.open()


def test_what_two_senders_said_before_the_first_command_is_over() -> None:
    """A second controller that was there during the set-up has gone."""
    bench = Bench().open()
    bench.drive.process.watches[0].contradicted = 5
    assert all(LinkFlag.TWO_SENDERS not in bench.scan(DISABLE).link for _ in range(3))
    bench.drive.close()


def test_a_drive_with_an_old_target_may_be_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    """It may not be enabled; in its fault it takes the edge of the reset bit: 80h once, and 0 behind it."""
    bench = Bench().open()
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | 0x08)
    bench.scan(DISABLE)
    bench.drive._supervision._stale_target = True
    sent = sent_from_now(bench, monkeypatch, 0x202)
    for _ in range(2):
        bench.scan(DriveRequest.FAULT_RESET)
    assert [data[:5] for data in sent] == ["80 00", "00 00"]
    bench.drive.close()


def test_a_drive_that_is_heard_again_is_asked_anew_in_its_next_silence(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What was asked of it in the first silence, and what it showed then, is over."""
    bench = Bench().open().enable()
    told: list[str] = []
    monkeypatch.setattr(bench.drive._stop_by_sdo, "forget", lambda: told.append("forgotten"))
    monkeypatch.setattr(bench.drive._stop_by_sdo, "scan", lambda *_: told.append("asked"))
    receive = bench.link.receive
    for silent in (False, True, True, False):
        with monkeypatch.context() as deaf:
            if silent:
                deaf.setattr(bench.link, "receive", lambda wait: receive(0.0) and None)
            bench.drive.read()
        bench.drive.write(OutputImage(DriveRequest.ENABLE, 0.0, 0.0, True))
    bench.drive.read()
    assert told == ["forgotten", "forgotten", "asked", "forgotten"]
    bench.drive.close()


def test_no_drive_tells_what_it_has_used_of_its_i2t() -> None:
    """CiA 402 has no object for it; a share of 1 would stop the axis."""
    bench = Bench().open().enable()
    assert bench.scan().overload == 0.0
    bench.drive.close()


@pytest.mark.parametrize(("contact", "fitted"), [(None, False), (True, True), (False, True)])
def test_a_brake_contact_is_one_whatever_it_says(
    monkeypatch: pytest.MonkeyPatch, contact: bool | None, fitted: bool
) -> None:
    bench = Bench().open()
    monkeypatch.setattr(bench.drive.beside, "brake_contact", lambda: contact)
    assert bench.scan(DISABLE).brake_contact is fitted
    bench.drive.close()


@pytest.mark.parametrize("commanded", [True, False])
def test_a_bus_that_runs_by_the_clock_is_told_how_late_each_sync_is(
    monkeypatch: pytest.MonkeyPatch, commanded: bool
) -> None:
    """Scans of 4 ms after 4, 7.5 and 4 ms: the second has left one out, and is an eighth of a period early."""
    bench, told = Bench().open(), list[float]()
    drive, link = bench.drive, bench.link
    monkeypatch.setattr(link, "stepped", False)
    monkeypatch.setattr(drive._supervision, "period", told.append)
    drive.commanded, drive._synced_s, drive._sampled_s = commanded, 0.0, 0.0
    seen = []
    for now_s in (0.004, 0.0115, 0.0155):
        monkeypatch.setattr(link, "now_s", lambda now_s=now_s: now_s)
        periods = drive._periods()
        seen.append((periods, drive._spread(periods)))
    late = [(1, 0.0), (2, pytest.approx(-0.125)), (1, 0.0)]
    assert seen == (late if commanded else [(1, 0.0)] * 3)
    assert told == (pytest.approx([0.004, 0.0075, 0.004]) if commanded else [])
    monkeypatch.undo()
    drive.commanded = False
    drive.close()


def test_a_drive_that_is_never_enabled_is_not_told_to_ignore_its_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It stays in Switched on, bit 12 is 0, and 0Fh is sent for longer than a second: the program tells of that."""
    bench = Bench().open()
    statuswords(bench, monkeypatch, lambda word: word & ~0x106F | 0x23)
    assert bench.run(1.2).link == LinkFlag.NONE
    bench.drive.close()


def test_a_drive_is_left_in_pre_operational(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its deadline for commands (1400:05) ends there with its process data: silence is no fault any more."""
    bench = Bench().open()
    bench.run(0.1, DISABLE)
    sent = sent_from_now(bench, monkeypatch, 0x000)
    bench.drive.close()
    assert sent == ["80 02"]


def test_a_heartbeat_goes_out_every_12_scans(monkeypatch: pytest.MonkeyPatch) -> None:
    """50 ms are 12.5 scans of 4 ms."""
    bench = Bench().open()
    sent, scans = sent_from_now(bench, monkeypatch, 0x77F), list[int]()
    for _ in range(60):
        bench.scan(DISABLE)
        scans.append(len(sent))
    first = scans.index(1)
    assert [scans.index(k) - first for k in range(2, 5)] == [12, 24, 36]
    bench.drive.close()


def test_in_the_silence_of_the_process_data_no_sync_goes_out(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench().open().enable()
    sent = sent_from_now(bench, monkeypatch, 0x080)
    for silent in (True, False):
        bench.drive.silent_process_data = silent
        bench.scan()
    assert len(sent) == 1
    bench.drive.close()


def test_behind_a_new_set_up_no_heartbeat_is_sent_before_a_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the first one on the drive watches the controller; people may think before they go on."""
    bench = Bench().open()
    bench.run(0.1, DISABLE)
    bench.drive._flags |= LinkFlag.OTHER_MASTER
    # The next one is due.
    bench.drive._heartbeat_due = 0
    sent = sent_from_now(bench, monkeypatch, 0x77F)
    bench.drive.set_up_again()
    assert sent == []
    # One every 50 ms.
    bench.run(0.06, DISABLE)
    assert sent in (["05"], ["05"] * 2)
    bench.drive.close()


def test_a_link_is_closed_once() -> None:
    told: list[str] = []
    bus = Scripted()
    bus.shutdown = lambda: told.append("bus")  # type: ignore[method-assign]
    link = BusLink(bus, when_closed=lambda: told.append("closed"))
    link.close()
    link.close()
    assert told == ["bus", "closed"]


def test_a_copy_of_the_process_writes_into_no_file_of_the_original() -> None:
    logged: list[int] = []
    bus = Scripted(message(0x182))
    link = BusLink(bus, log=lambda time_s, can_id, data, sent: logged.append(can_id))
    link.send(0x202, b"")
    link.log_nothing()
    link.send(0x302, b"")
    assert link.receive(0.0) == Frame(0x182, b"")
    assert logged == [0x202]
    link.close()


# --- nodes ------------------------------------------------------------------------------------------------------------


def test_what_only_the_master_may_send_is_counted_by_the_node_of_the_drive() -> None:
    drive = remote_node(Wire())
    beside = RemoteNode(drive.link, 4, 127, 0.05, beside=drive)
    for can_id in (0x080, 0x77F, 0x604, 0x000):
        beside.dispatch(Frame(can_id, b""))
    assert (drive.foreign, drive.foreign_id, beside.foreign, beside.unknown) == (4, 0x080, 0, 0)


def test_an_answer_that_nobody_waits_for_is_no_frame_of_others() -> None:
    node = remote_node(Wire())
    node.dispatch(Frame(0x582, bytes(8)))
    assert node.unknown == 0
    node.dispatch(Frame(0x583, bytes(8)))
    assert node.unknown == 1


def test_a_drive_that_names_neither_itself_nor_its_software_is_told_by_its_number() -> None:
    assert NodeIdentity(1, 2, 3, 4, 402, "", "", "").text == "drive without a name, software ?, serial 4"
    assert NodeIdentity(1, 2, 3, 4, 402, "X9", "B", "1.7").text == "X9, software 1.7, serial 4"


def test_contacts_of_a_lost_node_have_no_level() -> None:
    reader = InputReader(NOTHING._replace(door_ok=3), CONTACTS)
    reader.read(1 << 3, 1 << 10)
    assert reader.levels() == {"door_ok": True, "brake_open": False, "watchdog_closed": True}
    reader.read(0, None)
    assert reader.levels() == {"door_ok": False}


def test_the_ring_of_a_node_that_is_set_up_again_is_its_new_one() -> None:
    """Its age counts from the new set-up on."""
    beside = neighbours(load_encoder=RING)
    encoder: Any = beside.encoder
    for _ in range(2):
        encoder.angle = RingAngle(RING, 1 << 20, 0.004)
        encoder.open = lambda: None
        beside.open()
        beside.begin(5)
        assert encoder.angle._since == 5


@pytest.mark.parametrize(("period_s", "bridged"), [(0.015, 3), (0.010, 3), (0.004, 7)])
def test_a_node_is_bridged_for_30_ms_and_three_scans_at_the_least(period_s: float, bridged: int) -> None:
    io, _ = of_cia_401(OutputBits())
    node = BusNode(io.node.remote, settings(period_s=period_s), "I/O", io.node._mapping, (), io.node._in_time)
    node.watch.data = b"\0"
    for node.watch.age in range(10):
        assert node.judge(True) is (node.watch.age >= bridged)
    assert neighbours(period_s=period_s)._old_scans == bridged


@pytest.mark.parametrize(("lacks", "timeout"), [(False, 38), (True, None)])
def test_a_node_without_a_heartbeat_is_not_lost_for_it(lacks: bool, timeout: int | None) -> None:
    """150 ms are 37.5 scans of 4 ms."""
    io, sdo = of_cia_401(OutputBits())
    if lacks:
        del sdo.values[0x1017, 0]
    io.node.open()
    assert io.node._timeout == timeout


def test_a_node_that_is_set_up_again_has_told_nothing_yet() -> None:
    io, _ = of_cia_401(OutputBits())
    io.node.open()
    io.node.watch.take(b"abc", in_time=False)
    io.node.watch.data = b"\x01"
    io.node.open()
    assert (io.node.watch.wrong_in_row, io.node.watch.data) == (0, None)


@pytest.mark.parametrize(("period_s", "owed"), [(0.010, 3), (0.001, 30)])
def test_telegrams_of_a_node_that_are_late_by_30_ms_are_no_second_sender(period_s: float, owed: int) -> None:
    """As of the drive; behind them, and the one of this SYNC, any other one is."""
    io, _ = of_cia_401(OutputBits())
    node = BusNode(io.node.remote, settings(period_s=period_s), "I/O", io.node._mapping, (), io.node._in_time)
    node.open()
    for _ in range(50):
        node.watch.begin()
    for number in range(owed + 2):
        assert node.watch.contradicted == 0, number
        node.watch.take(bytes((number,)), in_time=True)
    assert node.watch.contradicted == 1


# --- telegrams --------------------------------------------------------------------------------------------------------


def answered(watch: TpdoWatch, scans: int, *, crowded: bool = False) -> int:
    """SYNCs whose telegrams may still come, after so many scans that were answered in time."""
    for number in range(scans):
        watch.begin(crowded=crowded)
        watch.take(bytes((number, 0)), in_time=True)
        watch.settle()
    return watch.behind


def test_missing_telegrams_are_owed_until_100_ms_were_answered_in_a_row() -> None:
    """25 scans of 4 ms; on a crowded bus ten times as many."""
    watch = TpdoWatch(2, 0.004)
    for _ in range(3):
        watch.begin()
    assert answered(watch, 20) == 3
    watch.begin()
    assert answered(watch, 20) == 4
    assert answered(watch, 6) == 0
    for _ in range(3):
        watch.begin()
    assert answered(watch, 240, crowded=True) == 3
    assert answered(watch, 12, crowded=True) == 0


def test_a_scan_before_a_silence_is_not_missed_and_the_longest_age_stays() -> None:
    watch = TpdoWatch(2, 0.004)
    for periods in (1, 4, 1):
        watch.begin(periods)
        watch.settle()
    answered(watch, 2)
    assert (watch.longest_age, watch.age, watch.missed) == (6, 0, 3)
    watch.begin()
    watch.forget()
    watch.begin()
    assert watch.missed == 3


# --- the drive --------------------------------------------------------------------------------------------------------


def test_a_set_up_begins_with_no_state_and_accepts_the_frames_of_its_nodes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The PRE-OPERATIONAL of the set-up itself is no loss."""
    bench = Bench().open()
    accepted: list[int] = []
    monkeypatch.setattr(bench.link, "accept", accepted.extend)
    bench.drive.node.state = NmtState.PRE_OPERATIONAL
    bench.drive._set_up(bench.drive.opened, None)
    assert bench.drive.node.state in (None, NmtState.OPERATIONAL)
    assert {0x082, 0x182, 0x282, 0x582, 0x702} <= set(accepted)
    bench.drive.close()


def test_the_words_of_the_maker_are_those_of_the_profile_of_the_drive() -> None:
    bench, profile = Bench().open(), load_profile("maxon_epos4")
    bench.drive.opened = bench.drive.opened._replace(settings=replace(bench.drive.settings, profile=profile))
    assert bench.drive.identity().error_texts == profile.texts_by_code
    assert profile.texts_by_code
    bench.drive.close()


def test_the_time_before_the_first_command_is_no_missed_scan() -> None:
    bench = Bench().open()
    bench.link.stepped = False
    bench.link.pause(2.0)
    bench.scan(DISABLE)
    assert (bench.drive._passed, bench.drive.node.scan) == (1, bench.drive.scan)
    bench.link.stepped = True
    bench.drive.close()


@pytest.mark.parametrize(("commanded", "told"), [(True, ["settle", "release"]), (False, ["release"])])
def test_only_a_gantry_that_was_commanded_comes_to_rest_at_the_end(commanded: bool, told: list[str]) -> None:
    bench, seen = Bench().open(), list[str]()
    plant: Any = SimpleNamespace(settle=lambda: seen.append("settle"), release=lambda: seen.append("release"))
    bench.drive.plant, bench.drive.commanded = plant, commanded
    bench.drive._leave()
    assert seen == told


@pytest.mark.parametrize(("watch", "written"), [(0x007F_0096, [(0x1016, 1, 0)]), (0, []), (None, [])])
def test_only_a_watch_that_is_there_is_taken_off(
    watch: int | None, written: list[tuple[int, int, int]]
) -> None:
    bench = Bench().open()
    sdo = Dictionary({} if watch is None else {(0x1016, 1): watch})
    bench.drive.node.sdo = sdo  # type: ignore[assignment]
    bench.drive._take_the_watch_off()
    assert sdo.written == written
    bench.link.close()


@pytest.mark.parametrize("rated_nm", [257.0, 300.0])
def test_torques_count_in_the_rated_torque_that_the_drive_has(
    monkeypatch: pytest.MonkeyPatch, rated_nm: float
) -> None:
    """6076 in mN m; the file says 257 N m, and one per mille of it is 0.257 N m."""
    bench = Bench()
    read = bench.drive.node.sdo.read

    def reads(index: int, sub: int) -> bytes:
        return round(1e3 * rated_nm).to_bytes(4, "little") if index == 0x6076 else read(index, sub)

    monkeypatch.setattr(bench.drive.node.sdo, "read", reads)
    bench.open()
    assert bench.drive.opened.units.torque_unit_nm == pytest.approx(1e-3 * rated_nm)
    bench.drive.close()


# --- parameters -------------------------------------------------------------------------------------------------------


def test_a_watch_of_the_heartbeat_is_shown_as_node_and_ms() -> None:
    row = check.compare(check.WantedParameter(0x1016, 1, 0x007F_012C, "watch"), 0x0003_1388)
    assert "want node 127, 300 ms, have node 3, 5000 ms" in row.line


def test_after_a_long_hold_up_one_parameter_is_asked_for() -> None:
    asked, parameters = Asked(), wanted_of(settings(), None)
    watch = ParameterWatch(asked, parameters, 0.004)  # type: ignore[arg-type]
    watch.scan(1_000_000)
    for _ in range(round(ROUND_S / 0.004 / len(parameters)) - 1):
        watch.scan(1)
    assert len(asked.reads) == 1


# --- times and noise --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("stepped", "spread"), [(True, 0.0), (False, 0.25)])
def test_a_scan_of_a_stepped_drive_is_never_late(stepped: bool, spread: float) -> None:
    """Held up for 9 ms, 2.25 periods of 4 ms: its drive has waited for SYNC."""
    bench = Bench().open()
    bench.scan(DISABLE)
    bench.link.stepped = stepped
    bench.link.pause(0.009 - (bench.link.now_s() - bench.drive._sampled_s))
    assert bench.scan(DISABLE).spread_scans == pytest.approx(spread, abs=1e-6)
    bench.link.stepped = True
    bench.drive.close()


def test_the_nodes_beside_are_released_with_the_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, told = Bench().open(), list[str]()
    monkeypatch.setattr(bench.drive.beside, "release", lambda: told.append("released"))
    bench.drive.close()
    assert told == ["released"]


def test_a_ring_that_differs_by_more_than_a_hundredth_of_a_degree_is_told() -> None:
    """2^20 steps in a turn: 29 of them are 0.00996 deg."""
    encoder: Any = neighbours(load_encoder=RING).encoder
    encoder.node.watch.data = bytes(6)
    for steps, told in ((29, 0), (30, 1)):
        encoder.node.remote.sdo = Dictionary({(0x6004, 0): steps, (0x6503, 0): 0}, {0x6503: 2})
        assert len(encoder.node.compare()) == told
