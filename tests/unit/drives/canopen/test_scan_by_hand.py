"""Scans of a drive on the bench by hand: frames are changed on their way, or read on the wire."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from gantryctl.drives.canopen.bus.link import Frame, Traffic
from gantryctl.image import DriveRequest, DriveState, LinkFlag, OutputImage
from unit.drives.canopen.canopen_bench import SYNC_S, Bench

pytestmark = pytest.mark.can

TPDO_1, RPDO_1, SDO, HEARTBEAT = 0x182, 0x202, 0x602, 0x77F
S, R = DriveState, DriveRequest


def statuswords(bench: Bench, monkeypatch: pytest.MonkeyPatch, change: Callable[[int], int]) -> None:
    """From now on 6041 (bytes 0 and 1 of TPDO 1) is changed on its way."""
    receive = bench.link.receive

    def changed(wait: float) -> Frame | None:
        frame = receive(wait)
        if frame is None or frame.can_id != TPDO_1:
            return frame
        word = change(int.from_bytes(frame.data[:2], "little"))
        return Frame(TPDO_1, word.to_bytes(2, "little") + frame.data[2:])

    monkeypatch.setattr(bench.link, "receive", changed)


def show_mode_of_positions(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each answer about 6061 says 8 from now on."""
    receive = bench.link.receive

    def answered(wait: float) -> Frame | None:
        frame = receive(wait)
        mode = frame is not None and (frame.can_id, frame.data[:4].hex(" ")) == (0x582, "4f 61 60 00")
        return Frame(0x582, bytes.fromhex("4F 61 60 00 08 00 00 00")) if mode else frame

    monkeypatch.setattr(bench.link, "receive", answered)


def sent_from_now(bench: Bench, monkeypatch: pytest.MonkeyPatch, can_id: int) -> list[str]:
    """Data of the frames with an identifier, in hexadecimal."""
    sent: list[str] = []
    send = bench.link.send

    def listen(identifier: int, data: bytes) -> bool:
        if identifier == can_id:
            sent.append(data.hex(" "))
        return send(identifier, data)

    monkeypatch.setattr(bench.link, "send", listen)
    return sent


def test_behind_more_frames_than_a_scan_takes_no_position_is_believed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A scan takes 500. Telegrams behind the rest may answer any SYNC, so the position is one scan old."""
    bench = Bench().open().enable()
    waiting: list[Frame] = []
    receive = bench.link.receive
    monkeypatch.setattr(bench.link, "receive", lambda wait: waiting.pop() if waiting else receive(wait))
    ages = []
    for frames in (0, 499, 600, 0):
        waiting += [Frame(0x701, b"\x05")] * frames
        ages.append(bench.scan().age_scans)
    assert ages == [0, 0, 1, 0]
    bench.drive.close()


def test_a_drive_that_says_between_two_scans_that_it_is_not_operational_is_lost_in_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its heartbeat waits before SYNC goes out, and is of this scan."""
    bench = Bench().open().enable()
    waiting = [Frame(0x702, b"\x7f")]
    receive = bench.link.receive
    monkeypatch.setattr(bench.link, "receive", lambda wait: waiting.pop() if waiting else receive(wait))
    assert LinkFlag.NOT_OPERATIONAL in bench.scan().link
    bench.drive.close()


def test_a_drive_is_asked_once_for_each_command(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second SYNC in a scan would make the drive interpolate over half of its time."""
    bench = Bench().open()
    syncs = sent_from_now(bench, monkeypatch, 0x080)
    before = bench.drive.read()
    assert (bench.drive.read() is before, len(syncs)) == (True, 0)
    for number in (1, 2):
        bench.drive.write(OutputImage())
        seen = bench.drive.read()
        assert (bench.drive.read() is seen, len(syncs)) == (True, number)
    bench.drive.close()


@pytest.mark.parametrize(("bit", "limited"), [(9, False), (10, False), (11, True), (12, False)])
def test_bit_11_of_the_statusword_is_the_internal_limit(
    monkeypatch: pytest.MonkeyPatch, bit: int, limited: bool
) -> None:
    bench = Bench().open().enable()
    assert not bench.scan().torque_limited
    # Bits 0 to 8 are what the drive says: it is enabled.
    statuswords(bench, monkeypatch, lambda word: word & 0x01FF | 1 << bit)
    assert bench.scan().torque_limited is limited
    bench.drive.close()


@pytest.mark.parametrize(("request_", "word"), [(R.QUICK_STOP, "02 00"), (R.DISABLE, "00 00")])
def test_a_telegram_without_the_request_to_run_carries_no_speed(
    monkeypatch: pytest.MonkeyPatch, request_: DriveRequest, word: str
) -> None:
    """Bytes 0 and 1 are 6040, 2 to 5 are 60FF."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    bench.scan(speed_deg_s=1.0)
    bench.scan(request_, 1.0)
    assert sent[0].startswith("0f 00")
    assert sent[0][6:17] != "00 00 00 00"
    assert sent[1][:17] == f"{word} 00 00 00 00"
    bench.drive.close()


def test_the_preload_goes_out_before_the_drive_is_enabled(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive opens its brake on the way to Operation enabled: 60B2 (bytes 6, 7) holds the load by then."""
    bench = Bench().open()
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    seen = {}
    for _ in range(100):
        state = bench.drive.read().state
        bench.drive.write(OutputImage(R.ENABLE, 0.0, 25.7, brake_open=True))
        seen[state] = sent[-1][-5:]
    # 25.7 N m are 100 per mille of 257 N m.
    assert [seen[state] for state in (S.READY_TO_SWITCH_ON, S.SWITCHED_ON, S.OPERATION_ENABLED)] == [
        "00 00", "64 00", "64 00",
    ]  # fmt: skip
    bench.drive.close()


def test_a_drive_is_enabled_from_the_moment_it_follows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bit 12 of 6041: the drive follows 60FF. Until then its brake opens, and no speed goes out."""
    bench, mask = Bench().open(), [0xEFFF]
    statuswords(bench, monkeypatch, lambda word: word & mask[0])
    assert bench.run(0.4).state is S.SWITCHED_ON
    mask[0] = 0xFFFF
    assert bench.run(0.01).state is S.OPERATION_ENABLED
    # Once it has followed it is enabled, whatever it says: it may turn.
    mask[0] = 0xEFFF
    assert bench.run(0.01).state is S.OPERATION_ENABLED
    bench.drive.close()


def test_a_drive_has_a_second_to_follow(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the word that enables it on; by then its brake is open."""
    bench = Bench().open()
    statuswords(bench, monkeypatch, lambda word: word & 0xEFFF)
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    while not bench.scan().link & LinkFlag.NEVER_FOLLOWED:
        assert len(sent) < 400
    # More than 250 periods of 4 ms.
    assert sum(data.startswith("0f 00") for data in sent) == 251
    bench.drive.close()


def test_a_drive_in_another_mode_is_not_enabled(monkeypatch: pytest.MonkeyPatch) -> None:
    """6061 is asked for every 0.1 s; 8 is a mode of positions."""
    bench = Bench().open()
    show_mode_of_positions(bench, monkeypatch)
    assert bench.run(0.5, R.DISABLE).link & LinkFlag.WRONG_MODE
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    bench.run(0.1)
    assert {data[:5] for data in sent} == {"00 00"}
    bench.drive.close()


def test_a_turning_drive_in_another_mode_is_left_to_the_stop_of_the_program(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Without its word the torque would go at once: the program asks for a quick stop, and then closes the brake."""
    bench = Bench().open().enable()
    show_mode_of_positions(bench, monkeypatch)
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    while not bench.scan(R.ENABLE).link & LinkFlag.WRONG_MODE:
        assert len(sent) < 200
    bench.run(0.05, R.ENABLE)
    assert {data[:5] for data in sent} == {"0f 00"}
    bench.drive.close()


def test_a_turning_drive_that_takes_no_command_gets_no_heartbeat(monkeypatch: pytest.MonkeyPatch) -> None:
    """So its own watch stops it. Its heartbeat says within 50 ms that it is not operational."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    sent = sent_from_now(bench, monkeypatch, HEARTBEAT)
    bench.run(0.2, speed_deg_s=1.0)
    assert sent
    bench.event("nmt", state="PRE_OPERATIONAL")
    bench.run(0.06, speed_deg_s=1.0)
    sent.clear()
    bench.run(0.2, speed_deg_s=1.0)
    assert not sent
    bench.drive.close()


@pytest.mark.parametrize(("missed", "kept_scans"), [(1, 50), (2, 25)])
@pytest.mark.parametrize("shown", [0x27, 0x07])
def test_a_drive_that_keeps_its_torque_against_its_command_loses_the_relay(
    monkeypatch: pytest.MonkeyPatch, missed: int, kept_scans: int, shown: int
) -> None:
    """After 0.2 s, scans that were missed included, and until the next command: Operation enabled, or quick stop."""
    bench = Bench().open().enable()
    well: list[bool] = []
    monkeypatch.setattr(bench.drive.beside, "send", lambda output, released, well_: well.append(well_))
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | shown)
    monkeypatch.setattr(bench.drive, "_periods", lambda: missed)
    bench.run(0.4, R.DISABLE)
    assert well == [True] * kept_scans + [False] * (100 - kept_scans)
    statuswords(bench, monkeypatch, lambda word: word & ~0x6F | 0x40)
    well.clear()
    bench.run(0.02, R.DISABLE)
    bench.run(0.02, R.ENABLE)
    assert well == [False] * 5 + [True] * 5


def test_a_ramp_after_a_fault_leaves_the_relay_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drive in its fault reaction ramps down by itself."""
    bench = Bench().open().enable()
    well: list[bool] = []
    monkeypatch.setattr(bench.drive.beside, "send", lambda output, released, well_: well.append(well_))
    statuswords(bench, monkeypatch, lambda word: word & ~0x4F | 0x0F)
    bench.run(0.4, R.DISABLE)
    assert well == [True] * 100


@pytest.mark.parametrize(
    ("changes", "off"),
    [
        ({}, True), ({"vel_act_rad_s": 0.5}, False), ({"vel_act_rad_s": -0.5}, False), ({"brake_open": True}, False),
        ({"age_scans": 1}, False), ({"state": S.UNKNOWN}, False), ({"state": S.OPERATION_ENABLED}, False),
        ({"state": S.QUICK_STOP_ACTIVE}, False), ({"state": S.FAULT_REACTION_ACTIVE}, False),
        ({"state": S.FAULT}, True), ({"vel_act_rad_s": 0.0199}, True), ({"vel_act_rad_s": 0.02}, False),
    ],
)  # fmt: skip
def test_only_a_drive_that_shows_off_and_at_rest_loses_its_watch(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, object], off: bool
) -> None:
    """Its watch over the heartbeat of the controller is 1016:01."""
    bench = Bench().open()
    at_rest = bench.run(0.1, R.DISABLE)
    monkeypatch.setattr(bench.drive, "read", lambda: at_rest._replace(**changes))
    monkeypatch.setattr(bench.drive, "write", lambda _: None)
    sent = sent_from_now(bench, monkeypatch, SDO)
    bench.drive.close()
    assert ("23 16 10 01 00 00 00 00" in sent) is off


def test_the_last_scans_keep_their_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it 3 s of scans are over before the brake has closed, and the drive is left with its watch."""
    bench = Bench().open().enable()
    order: list[object] = []
    send = bench.link.send

    def sends(can_id: int, data: bytes) -> bool:
        if can_id in (RPDO_1, 0x080):
            order.append(can_id)
        return send(can_id, data)

    monkeypatch.setattr(bench.link, "send", sends)
    monkeypatch.setattr(bench.link, "pace", order.append)
    bench.drive.close()
    assert len(order) >= 3 * round(0.15 / SYNC_S)  # the brake takes 0.15 s to close
    assert order == [RPDO_1, SYNC_S, 0x080] * (len(order) // 3)


@pytest.mark.parametrize("contact", [True, False])
def test_a_wired_contact_tells_the_brake(monkeypatch: pytest.MonkeyPatch, contact: bool) -> None:
    bench = Bench().open()
    bench.run(1.0, R.DISABLE)
    monkeypatch.setattr(bench.drive.beside, "brake_contact", lambda: contact)
    assert bench.scan(R.DISABLE).brake_open is contact
    bench.drive.close()


def test_a_drive_that_owns_its_brake_closes_it_before_the_torque_goes_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Disable operation (07) as soon as the release is withdrawn; 605C does the rest."""
    bench = Bench(changes=(("brake.owner", "drive"),)).open().enable()
    sent = sent_from_now(bench, monkeypatch, RPDO_1)
    bench.scan()
    bench.scan(brake_open=False)
    assert [data[:5] for data in sent] == ["0f 00", "07 00"]
    bench.drive.close()


@pytest.mark.parametrize(
    ("periods", "spread"),
    [(1.0, 0.0), (1.09, 0.0), (0.91, 0.0), (1.25, 0.25), (0.75, -0.25), (3.25, 0.25), (2.75, -0.25)],
)
def test_a_sync_that_left_its_scan_says_by_how_much(
    monkeypatch: pytest.MonkeyPatch, periods: float, spread: float
) -> None:
    """Later, or earlier: the way of a sound axis between two readings is longer, or shorter, by so much."""
    bench = Bench().open().enable()
    now_s = [bench.link.now_s()]
    bench.link.stepped = False
    monkeypatch.setattr(bench.link, "now_s", lambda: now_s[0])
    for each, expected in ((1.0, 0.0), (periods, spread)):
        now_s[0] += each * SYNC_S
        assert bench.scan().spread_scans == pytest.approx(expected, abs=1e-9)


def test_each_counter_has_its_own_name() -> None:
    """A bad bus, a slow drive and another sender are told apart by them."""
    bench = Bench().open()
    drive, (first, *_) = bench.drive, bench.drive.process.watches
    names = ("received", "missed", "late", "duplicated", "wrong_length", "longest_age", "contradicted")
    for number, name in enumerate(names, 101):
        setattr(first, name, number)
    drive.node.heartbeat_age, drive.scan, drive.node.boots, drive.node.foreign = 11, 12, 13, 14
    drive.node.unknown, drive.link._last = 20, Traffic(0, 3)
    drive.link.refused, drive.link.queue_full, drive.link.bus_offs, drive.link.passives = 15, 16, 17, 18
    drive.node.emergencies.take(bytes.fromhex("10 23 02"), 1)
    drive.node.emergencies.take(bytes.fromhex("00 00 00"), 2)
    found = drive.health()
    of_first = [getattr(found, "longest_age_scans" if name == "longest_age" else name)[0] for name in names]
    assert of_first == list(range(101, 108))
    assert (found.heartbeat_age_scans, found.scans, found.boots, found.foreign) == (11, 12, 13, 14)
    # Frames without a meaning here, those that the kernel kept away among them.
    assert found.unknown == 23
    assert (found.refused, found.queue_full, found.bus_offs, found.passives) == (15, 16, 17, 18)
    # The end of an error is counted and is no message.
    assert (found.emergencies, [text[:9] for text in found.messages]) == (2, ["EMCY 2310"])
    drive.close()


def test_a_controller_that_sends_no_sync_listens_for_a_period() -> None:
    """Behind a drive of a maker there is no plant that somebody has to step."""
    bench = Bench().open().enable()
    bench.drive.silent_process_data = True
    bench.drive.plant = None
    begun = bench.link.now_s()
    bench.scan()
    assert bench.link.now_s() - begun == pytest.approx(SYNC_S)
