"""What the master sends to a drive in each of its states, and what it makes of a drive that does not answer.

The other end is the virtual drive; what is judged are the bytes on the bus and the true shaft.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import pytest

from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.canopen.setup.opening import read_restart_marker
from gantryctl.drives.canopen.setup.read_only import ReadOnlyDrive
from gantryctl.errors import DeviceError
from gantryctl.image import DriveRequest, DriveState, LinkFlag, OutputImage
from gantryctl.wiring.canopen import canopen_settings
from unit.drives.canopen.canopen_bench import ENABLE, SYNC_S, Bench, machine
from unit.drives.canopen.wire import Wire

pytestmark = pytest.mark.can

RPDO, HEARTBEAT, SDO, NMT = 0x202, 0x77F, 0x602, 0x000
ONE_DEG_S = math.radians(1.0) * 1144.0
Frame = tuple[int, bytes]


def spied(bench: Bench) -> list[Frame]:
    """Frames of the master from now on."""
    sent, send = list[Frame](), bench.link.send

    def spy(can_id: int, data: bytes) -> bool:
        sent.append((can_id, data))
        return send(can_id, data)

    bench.link.send = spy  # type: ignore[method-assign]
    return sent


class Command(NamedTuple):
    """RPDO 1: 6040, 60FF, 60B2."""

    word: int
    speed: int
    torque: int


def commands(sent: list[Frame]) -> list[Command]:
    return [
        Command(
            int.from_bytes(data[:2], "little"),
            int.from_bytes(data[2:6], "little", signed=True),
            int.from_bytes(data[6:8], "little", signed=True),
        )
        for can_id, data in sent
        if can_id == RPDO
    ]


def each(
    bench: Bench, sent: list[Frame], scans: int, output: OutputImage
) -> list[tuple[DriveState, Command]]:
    """State that was shown, and what was sent then."""
    found = []
    for _ in range(scans):
        state = bench.drive.read().state
        sent.clear()
        bench.drive.write(output)
        found.append((state, commands(sent)[0]))
    bench.drive.read()
    return found


def test_speed_and_torque_go_out_in_the_states_that_may_have_them() -> None:
    """1 deg/s is 19.97 rad/s or 1 666 048 increments a second; 25.7 N m are 100 per mille of 257."""
    bench = Bench().open()
    sent, moving = spied(bench), OutputImage(ENABLE, ONE_DEG_S, 25.7, True)
    seen = each(bench, sent, 100, moving)
    states = {state for state, _ in seen}
    assert {DriveState.SWITCH_ON_DISABLED, DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED} <= states
    for state, command in seen:
        # 524 288 x 1144 / 360
        assert command.speed == (1_666_071 if state is DriveState.OPERATION_ENABLED else 0), state
        given = state in (DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED)
        assert command.torque == (100 if given else 0), state
    # The speed stays 0 with every other request, whatever the program says.
    for request, word in ((DriveRequest.QUICK_STOP, 0x02), (DriveRequest.DISABLE, 0x00)):
        bench.run(0.4)
        assert bench.drive.read().state is DriveState.OPERATION_ENABLED
        (_, command), *_ = each(bench, sent, 1, OutputImage(request, ONE_DEG_S, 0.0, True))
        assert command == (word, 0, 0)
        bench.run(1.0, DriveRequest.DISABLE)
    bench.drive.close()


def test_the_torque_stays_while_a_quick_stop_lasts() -> None:
    """The preload holds the unbalanced load until the brake does: 25.7 N m are 100 per mille."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    turning: list[bool] = []
    bench.drive._supervision.ask = turning.append  # type: ignore[method-assign]
    seen = each(bench, spied(bench), 150, OutputImage(DriveRequest.QUICK_STOP, ONE_DEG_S, 25.7, True))
    states = {state for state, _ in seen}
    assert states == {
        DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.SWITCH_ON_DISABLED,
    }  # fmt: skip
    for state, command in seen:
        assert command.torque == (0 if state is DriveState.SWITCH_ON_DISABLED else 100), state
        assert command.speed == 0
    # Its target is its own business until it has stopped.
    assert turning == [state is not DriveState.SWITCH_ON_DISABLED for state, _ in seen]
    bench.drive.close()


def test_who_only_looks_gives_no_sign_of_a_controller() -> None:
    """From its first heartbeat on the drive would miss the next, and trip when the looker has gone."""
    bench = Bench().open()
    sent = spied(bench)
    for _ in range(40):
        bench.drive.look()
    assert HEARTBEAT not in [can_id for can_id, _ in sent]
    # What the drive shows now, and not what it showed before.
    assert bench.drive.look().state is DriveState.SWITCH_ON_DISABLED
    bench.event("fault", code=0x2310)
    bench.drive.look()
    assert bench.drive.look().state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
    bench.scan(DriveRequest.DISABLE)
    assert HEARTBEAT in [can_id for can_id, _ in sent]
    bench.drive.close()


def test_who_only_looks_sees_which_telegram_is_late() -> None:
    bench = Bench().open()
    assert not bench.drive.look().link & LinkFlag.LATE
    for tpdo in (1, 2):
        bench.ask("inject", fault="tpdo", tpdo=tpdo, kind="drop", count=1)
        assert bench.drive.look().link & LinkFlag.LATE
        assert not bench.drive.look().link & LinkFlag.LATE
    bench.drive.close()


@pytest.mark.parametrize(("stepped", "waited"), [(True, [0.1]), (False, [])])
def test_only_a_drive_that_is_stepped_is_waited_for_in_a_look(stepped: bool, waited: list[float]) -> None:
    """By its SDO answer: a real one goes on by itself, and a look must not take longer than its scan."""
    bench, found = Bench().open(), list[float]()
    bench.drive.requests.wait = found.append  # type: ignore[assignment, method-assign]
    bench.link.stepped = stepped
    bench.drive.look()
    assert found == waited
    bench.link.stepped = True
    bench.drive.close()


@pytest.mark.parametrize(
    ("follows_bit", "shown"),
    [
        (False, [DriveState.OPERATION_ENABLED] * 3),
        (True, [DriveState.SWITCHED_ON, *[DriveState.OPERATION_ENABLED] * 2]),
    ],
)
def test_a_drive_without_bit_12_is_enabled_when_it_says_so(
    follows_bit: bool, shown: list[DriveState]
) -> None:
    drive = object.__new__(CanopenDrive)
    drive.settings, drive._followed = SimpleNamespace(follows_bit=follows_bit), False  # type: ignore[assignment]
    words = (0x0237, 0x1237, 0x0237)
    assert [drive._shown(DriveState.OPERATION_ENABLED, word) for word in words] == shown
    # Of one that was off it counts anew.
    assert drive._shown(DriveState.SWITCH_ON_DISABLED, 0x1240) is DriveState.SWITCH_ON_DISABLED
    assert drive._shown(DriveState.OPERATION_ENABLED, 0x0237) is shown[0]


def test_a_real_drive_has_no_gantry_in_this_process() -> None:
    drive = CanopenDrive(Wire(), canopen_settings(machine()))  # type: ignore[arg-type]
    assert (drive.plant_state(), drive.truth_source) == ({}, None)


@pytest.mark.parametrize("offset", [True, False])
@pytest.mark.parametrize("known", [True, False])
def test_a_preload_needs_a_torque_that_can_be_read(offset: bool, known: bool) -> None:
    drive = object.__new__(CanopenDrive)
    drive.process = SimpleNamespace(torque_offset=offset, torque_known=known)  # type: ignore[assignment]
    assert drive.torque_preload is (offset and known)
    assert drive.reports_torque is known


def test_the_marker_of_a_run_is_the_one_that_the_drive_holds() -> None:
    bench = Bench().open()
    marker = bench.drive.leave_restart_marker()
    assert marker is not None
    assert read_restart_marker(bench.drive.node.sdo) == marker
    for index in (0x1402, 0x1403):
        bench.virtual.od.readers[index, 1] = lambda: 0x8000_0181  # whatever is written
    # Markers are drawn: one of 639 is what the drive says anyway.
    assert bench.drive.leave_restart_marker() in (None, 0x181)
    bench.drive.close()


def lost_by_restart(bench: Bench) -> None:
    bench.event("reset")


def lost_by_silence(bench: Bench) -> None:
    bench.inject("silence")


@pytest.mark.parametrize("lose", [lost_by_restart, lost_by_silence])
def test_a_lost_drive_is_told_nothing_but_torque_off_and_shows_no_state(
    lose: Callable[[Bench], None],
) -> None:
    bench = Bench().open().enable()
    lose(bench)
    bench.run(0.2)
    well: list[bool] = []
    bench.drive.beside.send = lambda output, released, heard: well.append(heard)  # type: ignore[method-assign]
    sent = spied(bench)
    bench.inject("silence", False)
    for _ in range(100):
        seen = bench.scan(ENABLE, 1.0)
        # What it shows since is by SDO, and without torque.
        assert seen.state in (DriveState.UNKNOWN, DriveState.SWITCH_ON_DISABLED, DriveState.FAULT)
    assert set(commands(sent)) == {Command(0, 0, 0)}
    # The watchdog gets no edge, and the drive no enable.
    assert well == [False] * 100


def test_in_the_proof_of_the_heartbeat_the_master_keeps_its_word_and_sends_none() -> None:
    bench = Bench().open().enable()
    sent = spied(bench)
    bench.drive.silent_heartbeat = True
    bench.run(0.3)
    # It has stopped by itself, and the word has not followed.
    assert bench.virtual.axis.state.name == "FAULT"
    assert {command.word for command in commands(sent)} == {0x0F}
    assert HEARTBEAT not in {can_id for can_id, _ in sent}


def test_a_drive_that_takes_no_commands_gets_no_heartbeat_that_keeps_it_going() -> None:
    bench = Bench().open().enable()
    bench.ramp_to(0.6)
    bench.event("nmt", state="PRE_OPERATIONAL")
    while not bench.scan(ENABLE, 0.6).link & LinkFlag.NOT_OPERATIONAL:
        pass
    sent = spied(bench)
    bench.run(0.4, ENABLE, 0.6)
    assert HEARTBEAT not in {can_id for can_id, _ in sent}


@pytest.mark.parametrize(("tpdo", "ages"), [(1, (1, 0, 0)), (2, (0, 1, 1))])
def test_a_missing_telegram_ages_what_it_carries(tpdo: int, ages: tuple[int, int, int]) -> None:
    bench = Bench().open().enable()
    bench.ask("inject", fault="tpdo", tpdo=tpdo, kind="drop", count=1)
    seen = bench.scan()
    assert (seen.age_scans, seen.speed_age_scans, seen.inputs_age_scans) == ages
    bench.drive.close()


@pytest.mark.parametrize(
    ("bit", "limited", "warns"),
    [(0x0080, False, True), (0x0400, False, False), (0x0800, True, False), (0x1000, False, False)],
)
def test_bit_11_is_the_limited_torque_and_only_while_there_is_torque(
    bit: int, limited: bool, warns: bool
) -> None:
    """Bit 7 is a warning, with torque or without."""
    bench = Bench().open()
    bench.inject("status_set", value=bit)
    seen = bench.run(0.02, DriveRequest.DISABLE)
    assert (seen.torque_limited, seen.warning) == (False, warns)
    seen = bench.run(0.4)
    assert (seen.torque_limited, seen.warning) == (limited, warns)
    bench.drive.close()


def test_bit_12_is_waited_for_at_every_enabling() -> None:
    bench = Bench().open()
    for _ in range(2):
        bench.inject("status_clear", value=0x1000)
        seen = [bench.scan() for _ in range(75)]
        assert {each.state for each in seen[-20:]} == {DriveState.SWITCHED_ON}
        assert not any(each.link & LinkFlag.IGNORES_COMMAND for each in seen)
        bench.inject("status_clear", value=0)
        assert bench.run(0.02).state is DriveState.OPERATION_ENABLED
        bench.inject("status_clear", value=0x1000)
        assert bench.run(0.02).link & LinkFlag.IGNORES_COMMAND
        bench.inject("status_clear", value=0)
        bench.run(0.6, DriveRequest.DISABLE)
    bench.drive.close()


@pytest.mark.parametrize(
    ("period_s", "stepped", "drain_s"),
    [(0.010, False, 0.004), (0.004, False, 0.0016), (0.001, False, 0.001), (0.004, True, math.inf)],
)
def test_frames_that_wait_have_four_tenths_of_a_scan(period_s: float, stepped: bool, drain_s: float) -> None:
    """1 ms at the least; a drive that is stepped waits, however long this computer was held up."""
    wire = Wire()
    wire.stepped = stepped
    drive = CanopenDrive(wire, replace(canopen_settings(machine()), period_s=period_s))  # type: ignore[arg-type]
    assert drive._drain_s == pytest.approx(drain_s)


@pytest.mark.parametrize("flag", LinkFlag)
def test_what_only_a_new_set_up_mends(flag: LinkFlag) -> None:
    """A wrong mode, target or mapping is in the drive; load and delays of the bus go by."""
    lasting = {
        LinkFlag.RESTARTED, LinkFlag.NOT_OPERATIONAL, LinkFlag.HEARTBEAT_LOST, LinkFlag.OTHER_MASTER,
        LinkFlag.TWO_SENDERS, LinkFlag.WRONG_MODE, LinkFlag.STALE_TARGET, LinkFlag.WRONG_LENGTH,
    }  # fmt: skip
    drive = object.__new__(CanopenDrive)
    drive._flags = flag
    drive.parameter_watch, drive.beside = SimpleNamespace(differs={}), SimpleNamespace(changed=False)  # type: ignore[assignment]
    assert drive.lost is (flag in lasting)


def test_a_parameter_that_has_changed_wants_a_new_set_up() -> None:
    bench = Bench().open()
    assert not bench.drive.lost
    bench.drive.parameter_watch.differs[0x6085, 0] = "6085:00"
    assert bench.drive.lost
    bench.drive.close()


# --- mode and target ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lost", [0, 1])
def test_another_mode_is_noticed_although_an_answer_was_lost(lost: int) -> None:
    """6061 is asked for every 0.1 s; a lost answer costs twice that, not the three seconds of another request."""
    bench = Bench().open().enable()
    bench.run(0.1)
    if lost:
        bench.ask("inject", fault="frame", can_id=0x582, kind="drop", count=lost)
        bench.run(0.12)
    bench.inject("mode_display", 8)
    scans = next(k for k in range(1, 200) if bench.scan().link & LinkFlag.WRONG_MODE)
    assert scans * SYNC_S <= 0.12 + 0.2 * lost
    bench.drive.close()


# --- the beginning ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tpdo", [1, 2])
def test_a_drive_of_which_a_telegram_is_missing_is_not_opened(tpdo: int) -> None:
    bench = Bench()
    bench.ask("inject", fault="tpdo", tpdo=tpdo, kind="drop", count=1000)
    with pytest.raises(DeviceError, match="does not answer SYNC"):
        bench.open()


@pytest.mark.parametrize(
    ("word", "state"),
    [(0x27, "operation enabled"), (0x07, "quick stop active"), (0x0F, "ramps down after a fault")],
)
def test_a_drive_with_torque_is_not_set_up(word: int, state: str) -> None:
    bench = Bench()
    bench.inject("status_value", word)
    sent = spied(bench)
    with pytest.raises(DeviceError, match=state):
        bench.open()
    # Nothing was written, and no state of the network changed: SDO uploads only.
    assert {can_id for can_id, _ in sent} == {SDO}
    assert all(data[0] >> 5 in (2, 3) for _, data in sent)
    # It is closed: nothing is said to the drive of somebody else any more.
    sent.clear()
    bench.drive.write(OutputImage())
    bench.drive.close()
    assert not sent


def test_the_brake_at_60fe_is_closed_and_the_speed_0_before_the_drive_is_started() -> None:
    bench = Bench(changes=(("brake.owner", "object_60FE"),))
    bench.ask("write", index=0x60FF, value=4711)
    sent = spied(bench)
    bench.open()
    started = sent.index((NMT, bytes.fromhex("01 02")))
    for command in ("2B 40 60 00 00 00 00 00", "23 FF 60 00 00 00 00 00", "23 FE 60 01 01 00 00 00"):
        assert (SDO, bytes.fromhex(command)) in sent[:started]
    # 60FE:01 with bit 0 = 0 would release the brake.
    brake = [data for can_id, data in sent if can_id == SDO and data[:4] == bytes.fromhex("23 FE 60 01")]
    assert {data[4] for data in brake} == {1}
    outputs = [data for can_id, data in sent if can_id == 0x302]
    bench.scan(DriveRequest.DISABLE)
    outputs = [data for can_id, data in sent if can_id == 0x302]
    assert outputs == [bytes.fromhex("01 00 00 00")]
    bench.drive.close()


@pytest.mark.parametrize("inverted", [False, True])
def test_a_look_at_a_standing_drive_has_the_angle_of_the_run(inverted: bool) -> None:
    bench = Bench(angle_deg=30.0, changes=(("can.inverted", inverted),))
    readers = dict(bench.virtual.od.readers)
    bench.virtual.od.readers[0x603F, 0] = lambda: 0x7305
    seen = ReadOnlyDrive(bench.link, bench.drive.settings).read()
    assert (seen.state, seen.error_code) == (DriveState.SWITCH_ON_DISABLED, 0x7305)
    at_rest = seen.pos_act_counts
    bench.virtual.od.readers = readers
    bench.open()
    # The closed brake gives way by less than a thousandth of a turn.
    assert bench.drive.read().pos_act_counts == pytest.approx(at_rest, abs=524)
    bench.drive.close()


# --- silence and the end ------------------------------------------------------------------------------------------


def test_after_a_silence_the_speed_is_0_before_the_drive_is_started() -> None:
    bench = Bench().open()
    bench.run(0.05, DriveRequest.DISABLE)
    sent, resumed = spied(bench), []
    bench.drive.beside.resume = lambda: resumed.append(len(sent))  # type: ignore[method-assign]
    bench.drive.resume()
    speed, started = (SDO, bytes.fromhex("23 FF 60 00 00 00 00 00")), (NMT, bytes.fromhex("01 02"))
    assert sent.index(speed) < sent.index(started)
    # The nodes beside it too, before the first SYNC.
    assert resumed == [sent.index(started) + 1]
    bench.event("reset")
    bench.virtual.advance(2_000_000)
    with pytest.raises(DeviceError, match="has restarted"):
        bench.drive.resume()


def shaft_deg_s(bench: Bench) -> float:
    return math.degrees(bench.virtual.plant.sim.state["vel_motor"]) / bench.ratio


@pytest.mark.parametrize(
    ("direction", "spoil"),
    [(0.0, "nothing"), (-1.0, "nothing"), (1.0, "a missing telegram"), (-1.0, "a full queue")],
)
def test_the_bus_is_left_when_the_shaft_stands_and_the_brake_is_closed(direction: float, spoil: str) -> None:
    bench = Bench().open().enable()
    for k in range(1, 501):
        bench.scan(ENABLE, direction * k / 500.0)
    assert shaft_deg_s(bench) == pytest.approx(direction, abs=0.1)
    if spoil == "a missing telegram":
        bench.ask("inject", fault="tpdo", tpdo=1, kind="drop", count=3)
    if spoil == "a full queue":
        bench.link.queue_full += 1
    left: list[tuple[bool, float, str]] = []
    take_off = bench.drive._take_the_watch_off

    def leave() -> None:
        left.append((bench.virtual.plant.brake_open, abs(shaft_deg_s(bench)), bench.virtual.axis.state.name))
        take_off()

    bench.drive._take_the_watch_off = leave  # type: ignore[method-assign]
    bench.drive.close()
    ((brake_open, speed_deg_s, state),) = left
    assert (brake_open, state) == (False, "SWITCH_ON_DISABLED")
    # 0.02 rad/s of the motor.
    assert speed_deg_s <= 0.0011


def test_a_drive_that_is_lost_keeps_its_watch() -> None:
    bench = Bench().open().enable()
    bench.inject("silence")
    bench.run(0.2)
    sent = spied(bench)
    bench.drive.close()
    # Not even asked to leave OPERATIONAL.
    assert (NMT, bytes.fromhex("80 02")) not in sent
    assert bench.virtual.od.number(0x1016, 1) != 0


def test_a_drive_that_does_not_show_torque_off_keeps_its_watch() -> None:
    """Its telegrams are lost, and the commands too: left alone it stops by its own deadline, and brakes."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    for can_id in (RPDO, 0x182, 0x282):
        bench.ask("inject", fault="frame", can_id=can_id, kind="drop", count=100_000)
    sent = spied(bench)
    bench.drive.close()
    assert bench.virtual.od.number(0x1016, 1) != 0
    assert NMT not in {can_id for can_id, _ in sent}
    bench.virtual.advance(2_000_000)
    assert bench.virtual.axis.state.name in ("FAULT", "SWITCH_ON_DISABLED")
    assert not bench.virtual.plant.brake_open
    assert abs(shaft_deg_s(bench)) < 0.05
