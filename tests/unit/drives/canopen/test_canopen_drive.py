"""The CANopen master against the virtual drive: setting up, refusing, quirks, and what breaks on the bus."""

from __future__ import annotations

import math

import can
import pytest

from bus.bus_rig import BusRig, bus_machine
from gantryctl.drives.canopen.bus.link import Frame
from gantryctl.drives.canopen.drive import CanopenDrive
from gantryctl.drives.canopen.setup.opening import UnusableDrive, parameter_rows
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.drives.virtual.communication.abort import Abort, SdoAbort
from gantryctl.errors import DeviceError
from gantryctl.image import DriveRequest, DriveState, LinkFlag
from gantryctl.wiring.canopen import canopen_drive
from unit.drives.canopen.canopen_bench import ENABLE, SYNC_S, Bench

pytestmark = pytest.mark.can

USABLE = [
    "plain", "self-starting", "zero-status", "step-by-step", "level-reset", "frozen-reset", "lagging", "cycle-time",
    "halting", "early-enabled", "silent-faults", "sparse", "array-mapping", "odd-identity", "no-1005", "odd-1005",
    "dangerous-defaults", "standstill-torque", "short-frames", "slow-save", "dead-after-quick-stop",
]  # fmt: skip
CHANGES = {"standstill-torque": (("can.torque_reference", 1.2),)}


@pytest.mark.parametrize("quirk", USABLE)
def test_a_drive_with_this_quirk_is_set_up_and_runs(quirk: str) -> None:
    bench = Bench(quirk, changes=CHANGES.get(quirk, ())).open()
    assert bench.drive.refusals == ()
    bench.enable()
    before = bench.load_deg
    feedback = bench.ramp_to(0.6)
    assert math.degrees(feedback.vel_act_rad_s) / bench.ratio == pytest.approx(0.6, rel=0.05)
    assert bench.load_deg - before > 0.2
    bench.drive.close()
    assert not bench.virtual.plant.brake_open


def test_another_unit_of_speed_is_a_matter_of_the_machine_file() -> None:
    bench = Bench("rpm", changes=(("can.velocity_unit", "0.1 r/min"), ("can.increments_per_turn", 65536)))
    bench.open().enable()
    feedback = bench.ramp_to(0.6)
    assert math.degrees(feedback.vel_act_rad_s) / bench.ratio == pytest.approx(0.6, rel=0.05)
    bench.drive.close()


@pytest.mark.parametrize("sign", [1, -1])
def test_an_inverted_motor_turns_the_axis_the_right_way(sign: int) -> None:
    """The machine file says how the motor is mounted: the axis goes forward, and the telegrams have the other sign."""
    bench = Bench(changes=(("can.inverted", sign < 0),)).open().enable()
    objects = bench.virtual.od
    before, raw = bench.drive.read().pos_act_counts, objects.value(0x6064, 0)
    feedback = bench.ramp_to(0.6)
    assert bench.load_deg > 0.2
    assert feedback.pos_act_counts - before == pytest.approx(sign * (objects.value(0x6064, 0) - raw), abs=600)
    assert sign * objects.value(0x606C, 0) > 0
    assert sign * objects.value(0x60FF, 0) > 0
    assert feedback.vel_act_rad_s == pytest.approx(math.radians(0.6) * bench.ratio, rel=0.05)
    assert feedback.torque_act_nm > 0.0
    assert sign * objects.value(0x6077, 0) > 0
    bench.drive.close()


@pytest.mark.parametrize("turns", [4096, 3000])
def test_a_position_around_0_goes_on_to_the_negative_and_over_a_restart(turns: int) -> None:
    """6064 is 0 in the middle of the range, where the gantry stands; the range need not be a power of two."""
    changes = (
        ("can.position_range", "around 0"),
        ("encoder.turns", turns),
        ("plant.encoder.mounting_turns", turns // 2),
    )
    bench = Bench("around-zero", changes=changes).open().enable()
    assert abs(bench.virtual.od.value(0x6064, 0)) < 1000
    begin, begin_deg = bench.drive.read().pos_act_counts, bench.load_deg
    bench.ramp_to(-0.6)
    counts, moved_deg = bench.drive.read().pos_act_counts, bench.load_deg - begin_deg
    per_deg = bench.machine.can.increments_per_turn * bench.ratio / 360.0
    assert bench.virtual.od.value(0x6064, 0) < 0
    # The load hangs behind the motor by the wind-up of the transmission.
    assert (counts - begin) / per_deg == pytest.approx(moved_deg, abs=0.02)
    bench.drive.close()
    moved_deg = bench.load_deg - begin_deg
    again = Bench("around-zero", angle_deg=bench.load_deg, changes=changes).open()
    assert (again.drive.read().pos_act_counts - begin) / per_deg == pytest.approx(moved_deg, abs=0.05)
    again.drive.close()


# --- refusing -----------------------------------------------------------------------------------------------------


def test_a_drive_without_csv_is_never_enabled() -> None:
    bench = Bench("no-csv").open()
    assert any("6502" in line for line in bench.drive.refusals)
    assert bench.run(0.4).state is DriveState.SWITCH_ON_DISABLED


def test_wrong_units_are_refused_by_name() -> None:
    bench = Bench("rpm").open()
    assert [line[:7] for line in bench.drive.refusals] == ["60A9:00", "608F:01"]


def test_a_parameter_that_does_not_take_is_refused() -> None:
    bench = Bench()
    bench.ask("write", index=0x6007, value=0)

    def refuse(_value: int) -> None:
        raise SdoAbort(Abort.STATE)

    bench.virtual.od.checks[0x6007, 0] = refuse
    bench.open()
    assert any(line.startswith("6007:00") and "have 0" in line for line in bench.drive.refusals)
    bench.drive.close()


def test_an_object_that_cannot_be_mapped_is_told_with_the_abort_code() -> None:
    bench = Bench()
    true_check = bench.virtual.od.checks[0x1A00, 2]

    def refuse(entry: int) -> None:
        if entry >> 16 == 0x6064:
            raise SdoAbort(Abort.NOT_MAPPABLE)
        true_check(entry)

    bench.virtual.od.checks[0x1A00, 2] = refuse
    with pytest.raises(
        DeviceError, match=r"6064:00 cannot be mapped \(.*abort code 06040041\)\); without it"
    ):
        bench.open()


def test_a_write_that_the_drive_refuses_is_told_with_its_abort_code() -> None:
    bench = Bench("dangerous-defaults")

    def refuse(_value: int) -> None:
        raise SdoAbort(Abort.STATE)

    bench.virtual.od.checks[0x6007, 0] = refuse
    bench.open()
    line = next(line for line in bench.drive.refusals if line.startswith("6007:00"))
    assert "writing it: not possible in the drive's present state (abort code 08000022)" in line
    bench.drive.close()


@pytest.mark.parametrize(
    ("answer", "unusable"), [("80 40 60 00 00 00 02 06", True), ("", False)], ids=["refused", "silent"]
)
def test_a_drive_without_a_controlword_is_never_started(
    answer: str, unusable: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A refusal is shown by what the drive has; one that falls silent has not refused it."""
    bench, sent = Bench(), list[str]()
    receive, send = bench.link.receive, bench.link.send

    def listen(identifier: int, data: bytes) -> bool:
        sent.append(f"{identifier:03X} {data.hex()}")
        return send(identifier, data)

    def answered(wait: float) -> Frame | None:
        frame = receive(wait)
        if frame is None or (frame.can_id, frame.data[:4].hex(" ")) != (0x582, "60 40 60 00"):
            return frame
        return Frame(0x582, bytes.fromhex(answer)) if answer else None

    monkeypatch.setattr(bench.link, "send", listen)
    monkeypatch.setattr(bench.link, "receive", answered)
    with pytest.raises(DeviceError, match="6040:00") as raised:
        bench.drive.open()
    assert isinstance(raised.value, UnusableDrive) is unusable
    if isinstance(raised.value, UnusableDrive):
        assert raised.value.facts.has(0x60FF)
    assert "000 0102" not in sent


@pytest.mark.parametrize("rated_mnm", [0, 1, 107, 52, 330, 1_000_000])
def test_a_rated_torque_that_cannot_be_is_refused_with_both_values(rated_mnm: int) -> None:
    """Factory defaults, and units that are wrong by a factor of 1000."""
    bench = Bench()
    motor_nm = bench.machine.motor.torque_rated_nm
    bench.virtual.od.readers[0x6076, 0] = lambda: rated_mnm
    bench.open()
    (line,) = bench.drive.refusals
    assert line.startswith("6076:00")
    assert f"have {rated_mnm} " in line
    assert f"[motor] torque_rated_nm = {motor_nm:g}" in line
    # Nothing is scaled by it: the torque limit has the size of the machine file's motor.
    assert bench.virtual.od.number(0x6072) == round(1000 * bench.machine.motor.torque_max_nm / motor_nm)
    assert bench.run(0.4).state is DriveState.SWITCH_ON_DISABLED
    bench.drive.close()


@pytest.mark.parametrize("share", [1.2, 1.4])
def test_a_rated_torque_of_another_catalogue_scales_the_torques(share: float) -> None:
    bench = Bench()
    motor_nm = bench.machine.motor.torque_rated_nm
    bench.virtual.od.readers[0x6076, 0] = lambda: round(1e3 * share * motor_nm)
    bench.open()
    assert bench.drive.refusals == ()
    limit = 1000 * bench.machine.motor.torque_max_nm / (share * motor_nm)
    assert bench.virtual.od.number(0x6072) == pytest.approx(limit, abs=1.0)
    bench.drive.close()


def test_a_drive_that_never_says_that_it_follows_is_told_with_the_key() -> None:
    """DRV-05 before the time of the power-up is over, which would only say where the drive is stuck (DRV-03)."""
    rig = BusRig(bus_machine())
    rig.inject("drive", "status", set=0, clear=0x1000)
    rig.command(power=True)
    rig.run(3.0)
    assert rig.stops[0] == "DRV-05", rig.told
    assert "[can] follows_bit = false" in rig.first_told
    # [monitors] velocity_deviation_time_ms: the ledger adds the time in which the speed grows.
    assert "not before 20 ms" in rig.first_told
    assert all(not tick.brake_open for tick in rig.ticks[-500:])
    rig.engine.close()


def test_a_drive_that_runs_already_is_left_alone() -> None:
    bench = Bench().open().enable()
    other = CanopenDrive(bench.link, bench.drive.settings, bench.drive.plant)
    with pytest.raises(DeviceError, match="operation enabled already"):
        other.open()


def test_nobody_there_is_said_in_words() -> None:
    bench = Bench()
    bench.inject("silence")
    with pytest.raises(DeviceError, match=r"node 2 does not answer.*can scan"):
        bench.open()


def test_the_drive_of_a_machine_file_stands_where_it_was_asked_to() -> None:
    drive = canopen_drive(Bench(angle_deg=30.0).machine, 30.0)
    assert math.degrees(drive.truth_source.truth()[0]) == pytest.approx(30.0, abs=1e-6)
    drive.close()


# --- what breaks --------------------------------------------------------------------------------------------------


def test_a_restart_in_motion_is_told_at_once_and_never_enables_again() -> None:
    bench = Bench().open().enable()
    bench.ramp_to(0.6)
    bench.event("reset")
    feedback = bench.scan(ENABLE, 0.6)
    assert feedback.link & LinkFlag.RESTARTED
    assert feedback.state is DriveState.UNKNOWN
    bench.run(1.0, ENABLE, 0.6)
    assert not bench.virtual.plant.brake_open
    assert bench.virtual.axis.state.name == "SWITCH_ON_DISABLED"


def test_a_dead_drive_ages_and_its_heartbeat_is_missed() -> None:
    bench = Bench().open().enable()
    bench.inject("silence")
    ages = [bench.scan().age_scans for _ in range(10)]
    assert ages == list(range(1, 11))
    lost = next(k for k in range(200) if bench.scan().link & LinkFlag.HEARTBEAT_LOST)
    assert (10 + lost) * SYNC_S <= 0.170  # E9: time-out 150 ms and not much more


def test_a_bus_that_goes_down_in_motion_and_comes_back_never_moves_the_axis_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The controller can do nothing; the drive's own watch stops the axis, and the bus recovers without motion."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    begun = bench.load_deg

    def gone(*_: object, **__: object) -> None:
        raise can.CanOperationError("bus-off")

    with monkeypatch.context() as broken:
        broken.setattr(bench.link._bus, "send", gone)
        flags = LinkFlag.NONE
        for _ in range(250):
            flags |= bench.scan(ENABLE, 1.0).link
            bench.virtual.advance(4000)  # no SYNC steps it any more: its time goes on by itself
    assert flags & LinkFlag.BUS_DOWN
    way = bench.load_deg - begun
    # 1 deg/s for the deadline of 50 ms and its granularity, the ramp of 5.4 deg/s2, some swing
    assert 0.0 < way < 1.0 * 0.07 + 1.0 / (2.0 * 5.4) + 0.05
    assert bench.virtual.axis.state.name == "FAULT"
    stood = bench.virtual.plant.counts
    bench.run(1.0, ENABLE, 1.0)  # the bus is back, and somebody still wants to move
    assert not bench.virtual.plant.brake_open
    # The load swings on against the braked motor, which gives way by less than a thousandth of a turn.
    assert abs(bench.virtual.plant.counts - stood) < 1e-3 * bench.virtual.hardware.fine_counts_per_turn


def test_a_node_that_leaves_operational_is_noticed() -> None:
    bench = Bench().open().enable()
    bench.event("nmt", state="PRE_OPERATIONAL")
    seen = [bench.scan().link for _ in range(20)]  # its next heartbeat reports it: 50 ms
    assert any(flags & LinkFlag.NOT_OPERATIONAL for flags in seen)


@pytest.mark.parametrize("state", ["PRE_OPERATIONAL", "STOPPED"])
def test_a_turning_drive_that_leaves_operational_is_stopped(state: str) -> None:
    """It takes no process data any more, but SDO, or a start by NMT; in STOPPED it stops by its own 6007 as well."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    begun = bench.load_deg
    bench.event("nmt", state=state)
    bench.run(1.0, ENABLE, 1.0)
    # 1 deg/s for two scans until it counts as silent or 50 ms to its heartbeat, then ramp or brake, some swing
    assert bench.load_deg - begun < 1.0 * 0.06 + 1.0 / (2.0 * 5.4) + 0.1
    assert bench.virtual.axis.state.name in ("SWITCH_ON_DISABLED", "FAULT")
    assert not bench.virtual.plant.brake_open


def test_nothing_enables_a_drive_by_sdo() -> None:
    bench = Bench().open()
    bench.run(0.1)
    bench.event("nmt", state="PRE_OPERATIONAL")
    written = []
    bench.virtual.od.actions[0x6040, 0] = written.append
    for _ in range(250):
        bench.scan(ENABLE)
    assert set(written) <= {0}


def test_missing_and_doubled_telegrams_are_counted_and_bridged() -> None:
    bench = Bench().open().enable()
    bench.ask("inject", fault="tpdo", tpdo=1, kind="drop", count=1)
    assert [bench.scan().age_scans for _ in range(3)] == [1, 0, 0]
    bench.ask("inject", fault="tpdo", tpdo=1, kind="duplicate", count=3)
    assert [bench.scan().age_scans for _ in range(4)] == [0, 0, 0, 0]
    counters = bench.drive.health()
    assert counters.missed[0] == 1
    assert counters.duplicated[0] == 3
    bench.drive.close()


def test_a_missing_position_goes_on_with_its_speed_but_not_for_long() -> None:
    bench = Bench().open().enable()
    bench.ramp_to(6.0)
    per_deg = bench.drive.identity().counts_per_turn * bench.ratio / 360.0
    bench.ask("inject", fault="tpdo", tpdo=1, kind="drop", count=20)
    begun = bench.drive.read().pos_act_counts
    way = [(bench.scan(ENABLE, 6.0).pos_act_counts - begun) / per_deg for _ in range(10)]
    # The speed of this moment is steady to some hundredths of a deg/s: over 28 ms a thousandth of a degree.
    assert way[:7] == pytest.approx([6.0 * SYNC_S * k for k in range(1, 8)], abs=0.002)
    assert way[7:] == pytest.approx([6.0 * 0.030] * 3, abs=0.002)
    bench.drive.close()


def test_ages_and_heartbeats_count_the_periods_that_were_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a gap our heartbeat is due at once; the drive's is lost by the clock, not by the number of scans."""
    bench = Bench().open().enable()
    now_s = [bench.link.now_s()]
    bench.link.stepped = False
    monkeypatch.setattr(bench.link, "now_s", lambda: now_s[0])
    sent: list[int] = []
    send = bench.link.send
    monkeypatch.setattr(bench.link, "send", lambda can_id, data: (sent.append(can_id), send(can_id, data)))

    def scan(periods: int) -> int:
        now_s[0] += periods * SYNC_S
        return bench.scan().age_scans

    assert [scan(1), scan(4), scan(1)] == [0, 0, 0]
    bench.ask("inject", fault="tpdo", tpdo=1, kind="drop", count=2)
    assert [scan(1), scan(4), scan(1)] == [1, 5, 0]
    sent.clear()
    scan(13)
    assert 0x700 + bench.drive.settings.master_node in sent
    for _ in range(13):  # its heartbeat comes every 12
        scan(1)
    bench.inject("silence")
    assert [scan(20), bench.scan().link] == [20, LinkFlag.LATE]
    assert scan(20) == 41
    assert bench.scan().link & LinkFlag.HEARTBEAT_LOST  # 150 ms


def test_a_telegram_of_the_wrong_length_is_never_decoded() -> None:
    bench = Bench().open().enable()
    before = bench.drive.read().pos_act_counts
    bench.ask("inject", fault="tpdo", tpdo=1, kind="length", amount=3, count=2)
    assert [bench.scan().age_scans for _ in range(3)] == [1, 2, 0]
    assert bench.drive.read().pos_act_counts == pytest.approx(before, abs=50)
    assert bench.drive.health().wrong_length[0] == 2
    bench.drive.close()


def test_a_drive_that_stops_following_is_told() -> None:
    bench = Bench().open().enable()
    bench.inject("ignore_target")
    assert any(bench.scan().link & LinkFlag.IGNORES_COMMAND for _ in range(3))


@pytest.mark.parametrize("quirk", ["plain", "short-frames"])
def test_a_fault_is_named_by_its_emergency_message(quirk: str) -> None:
    bench = Bench(quirk).open().enable()
    bench.event("fault", code=0x7305)
    feedback = bench.run(0.02)
    assert feedback.state is DriveState.FAULT
    assert feedback.error_code == 0x7305
    assert bench.run(0.2, DriveRequest.FAULT_RESET).state is DriveState.SWITCH_ON_DISABLED


def test_a_fault_without_an_emergency_message_is_named_by_603f() -> None:
    bench = Bench().open().enable()
    bench.drive.node.listen(0x082, lambda data: None)  # its emergency messages are lost
    bench.event("fault", code=0x7305)
    codes = [bench.scan().error_code for _ in range(5)]
    assert codes[0] == 0
    assert codes[-1] == 0x7305
    assert bench.run(0.2, DriveRequest.FAULT_RESET).error_code == 0
    bench.event("fault", code=0x3210)
    assert bench.run(0.05).error_code == 0x3210
    bench.drive.close()


def test_another_master_is_noticed() -> None:
    bench = Bench().open().enable()
    bench.event("frame", can_id=0x202, data="0F00E8030000")
    assert bench.scan().link & LinkFlag.OTHER_MASTER


def test_what_was_on_the_bus_before_the_first_command_is_no_failure_of_the_run() -> None:
    """Tools that read the drive, and heartbeats that nobody heard."""
    bench = Bench().open()
    for can_id, data in ((0x080, b""), (0x000, bytes((0x01, 2))), (0x702, b"\x05")):
        bench.drive.node.dispatch(Frame(can_id, data))
    bench.drive.node.heartbeat_age = 1000
    for _ in range(3):
        assert bench.drive.look().link == LinkFlag.NONE
    seen = bench.scan(DriveRequest.DISABLE)
    assert (seen.link, seen.foreign_id) == (LinkFlag.NONE, -1)
    assert bench.run(0.4).link == LinkFlag.NONE
    bench.drive.close()


def test_a_drive_that_boots_between_set_up_and_first_command_is_told() -> None:
    """It has lost its mapping and its watch of the controller since."""
    bench = Bench().open()
    bench.drive.node.dispatch(Frame(0x702, b"\x00"))
    assert bench.scan(DriveRequest.DISABLE).link == LinkFlag.RESTARTED
    bench.drive.close()


def test_a_drive_that_still_has_torque_keeps_its_watch_when_it_is_to_be_set_up_again() -> None:
    """1016 is all that stops it, once nobody speaks: node 127 and 150 ms, as the set-up wrote it."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    with pytest.raises(DeviceError, match=r"already|ramps down"):
        bench.drive.set_up_again()
    assert bench.drive.node.sdo.number(0x1016, 1) == 0x007F_0096
    bench.drive.close()


# --- silence ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["silent_process_data", "silent_heartbeat"])
def test_either_silence_alone_stops_the_axis_and_brakes_it(what: str) -> None:
    """The drive ramps down by itself: reaction (50 or 150 ms), then 5.4 deg/s2, and the brake."""
    bench = Bench().open().enable()
    bench.ramp_to(1.0)
    begun = bench.load_deg
    setattr(bench.drive, what, True)
    for _ in range(round(1.0 / SYNC_S)):
        bench.scan(ENABLE, 1.0)
    deadline = 0.05 if what == "silent_process_data" else 0.15
    # Computed: the speed times the deadline and its granularity (one heartbeat, two SYNCs), and the ramp's triangle;
    # the load swings beyond it by some hundredths of a degree.
    most = 1.0 * (deadline + 0.06) + 1.0**2 / (2.0 * 5.4) + 0.05
    assert 0.0 < bench.load_deg - begun < most
    assert bench.virtual.axis.state.name == "FAULT"
    assert not bench.virtual.plant.brake_open


def test_an_orderly_leave_is_no_fault() -> None:
    bench = Bench().open().enable()
    bench.drive.close()
    bench.virtual.advance(2_000_000)
    assert bench.virtual.axis.state.name == "SWITCH_ON_DISABLED"
    assert bench.virtual.od.number(0x1003) == 0  # nothing in the drive's error history


@pytest.mark.parametrize(("shortest_ms", "held_ms"), [(0, 100), (120, 150)])
def test_a_drive_that_takes_no_deadline_gets_a_shorter_heartbeat_time_out_if_it_takes_that(
    shortest_ms: int, held_ms: int
) -> None:
    bench = Bench()
    own = bench.virtual.od.checks[0x1016, 1]

    def deadline(value: int) -> None:
        if value:
            raise SdoAbort(Abort.VALUE)

    def heartbeat(value: int) -> None:
        own(value)
        if 0 < value & 0xFFFF < shortest_ms:
            raise SdoAbort(Abort.VALUE_LOW)

    bench.virtual.od.checks[0x1400, 5] = deadline
    bench.virtual.od.checks[0x1016, 1] = heartbeat
    opened = bench.open().drive.opened
    (row,) = [row for row in opened.rows if row.place == "1016:01"]
    assert (row.verdict, row.value) == (ParameterVerdict.OK, 127 << 16 | held_ms)
    assert opened.settings.watch_s == pytest.approx(1e-3 * held_ms)
    # What judges the drive later comes to the same.
    assert parameter_rows(bench.drive.settings, opened.facts)[opened.rows.index(row)] == row
    # The drive's own watch acts in that time.
    bench.enable()
    bench.drive.silent_heartbeat = True
    scans = 0
    while bench.scan().state is DriveState.OPERATION_ENABLED and scans < 100:
        scans += 1
    assert held_ms - 50 <= 4 * scans <= held_ms + 12  # the last heartbeat is up to 50 ms old
    bench.drive.close()
