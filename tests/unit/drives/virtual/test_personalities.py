"""Each quirk, beside the plain drive."""

import struct
from pathlib import Path

import pytest

from gantryctl.drives.od.facts import facts_of
from gantryctl.drives.od.reading import parse_eds
from gantryctl.drives.od.standard import STANDARD
from gantryctl.drives.od.writing import write_eds
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.drives.virtual.communication.nmt import NmtState
from gantryctl.drives.virtual.personality import PERSONALITIES, personality
from gantryctl.errors import UsageError
from unit.drives.virtual.bench import (
    EMCY,
    ENABLE,
    HEARTBEAT,
    QUICK_STOP,
    RESET,
    SDO_RX,
    SDO_TX,
    SHUTDOWN,
    SWITCH_ON,
    Aborted,
    Bench,
)


@pytest.mark.parametrize("name", PERSONALITIES)
def test_every_personality_is_a_csv_axis_by_its_eds_and_can_be_enabled(name: str) -> None:
    bench = Bench(name)
    device = parse_eds(write_eds(bench.node.device).encode())
    assert device.notes == ()
    facts = facts_of(device)
    for index in (0x6040, 0x6041, 0x6064, 0x60FF):
        assert facts.objects[index, 0].mappable
    assert facts.objects[0x6060, 0].takes(9)
    if name == "sdo-preop-only":
        bench.nmt(0x80)
    bench.set_up()
    bench.enable()


def test_no_csv_accepts_mode_9_shows_it_and_never_moves() -> None:
    bench = Bench("no-csv").set_up()
    assert bench.up(0x6502) & 0x100 == 0
    bench.enable()
    assert bench.up(0x6061) == 9
    start = bench.load_deg
    assert not bench.run(1.0, ENABLE, bench.turn(1.0)).status & 0x1000
    assert abs(bench.load_deg - start) < 0.01


def test_self_starting_is_operational_after_boot_up() -> None:
    bench = Bench("self-starting")
    assert bench.node.state is NmtState.OPERATIONAL
    assert Bench().node.state is NmtState.PRE_OPERATIONAL


def test_sdo_preop_only_answers_nothing_in_operational() -> None:
    bench = Bench("sdo-preop-only").set_up()
    request = bytes.fromhex("4000100000000000")
    assert bench.send(SDO_RX, request) == []
    bench.nmt(0x80)
    assert bench.send(SDO_RX, request)[0][0] == SDO_TX


def test_zero_status_is_zero_until_the_first_controlword() -> None:
    bench = Bench("zero-status").set_up()
    assert bench.up(0x6041) == 0
    bench.run(0.02, SHUTDOWN)
    assert bench.up(0x6041) & 0x6F == State.READY


def test_step_by_step_ignores_0f_from_ready() -> None:
    bench = Bench("step-by-step").set_up()
    bench.run(0.02, SHUTDOWN)
    assert bench.run(0.3, ENABLE).state is State.READY
    bench.run(0.02, SWITCH_ON)
    assert bench.run(0.3, ENABLE).state is State.ENABLED


def test_level_reset_resets_without_an_edge() -> None:
    bench = Bench("level-reset").set_up()
    bench.run(0.02, RESET)
    bench.event("fault", code=1)
    assert bench.run(0.02, RESET).state is State.SWITCH_ON_DISABLED


def test_frozen_reset_obeys_nothing_while_the_reset_bit_is_set() -> None:
    bench = Bench("frozen-reset").set_up()
    bench.event("fault", code=1)
    bench.run(0.02, RESET)
    assert bench.run(0.1, SHUTDOWN | RESET).state is State.SWITCH_ON_DISABLED
    assert bench.run(0.1, SHUTDOWN).state is State.READY
    plain = Bench().set_up()
    assert plain.run(0.1, SHUTDOWN | RESET).state is State.READY


def test_lagging_shows_status_and_mode_10_ms_later() -> None:
    bench = Bench("lagging", period_ms=1).set_up(mode=9)
    bench.run(0.02, SHUTDOWN)
    bench.send(0x80)
    states = [bench.cycle(SWITCH_ON).state for _ in range(20)]
    assert states.index(State.SWITCHED_ON) in (11, 12)
    bench.down(0x6060, 0, 3, 1)
    assert bench.up(0x6061) == 9
    bench.run(0.015, SWITCH_ON)
    assert bench.up(0x6061) == 3


def test_brief_quick_stop_lasts_one_tick_and_drops_the_torque() -> None:
    bench = Bench("brief-quick-stop", period_ms=1).set_up()
    bench.down(0x605A, 0, 6, 2)
    bench.enable()
    states = [bench.cycle(QUICK_STOP).state for _ in range(6)]
    assert states.count(State.QUICK_STOP) == 1
    assert states[-1] is State.SWITCH_ON_DISABLED
    assert not bench.node.axis.stage.energised


def test_no_quick_stop_goes_on() -> None:
    bench = Bench("no-quick-stop").set_up()
    bench.enable()
    bench.ramp_to(1.0, 4.0)
    assert bench.run(0.5, QUICK_STOP, bench.turn(1.0)).state is State.ENABLED
    assert bench.deg_s(bench.cycle(QUICK_STOP, bench.turn(1.0)).velocity) == pytest.approx(1.0, abs=0.1)


def test_dead_after_quick_stop_says_that_it_follows_until_6060_changes() -> None:
    bench = Bench("dead-after-quick-stop").set_up()
    bench.enable()
    bench.run(1.0, QUICK_STOP)
    bench.run(0.02, SHUTDOWN)
    bench.down(0x605A, 0, 6, 2)
    bench.enable()
    bench.run(0.1, QUICK_STOP)
    start = bench.load_deg
    dead = bench.run(1.0, ENABLE, bench.turn(1.0))
    assert dead.status & 0x106F == 0x1000 | State.ENABLED
    assert abs(bench.load_deg - start) < 0.01
    bench.down(0x6060, 0, 9, 1)
    assert abs(bench.load_deg - start) < 0.01
    bench.run(0.02, ENABLE)
    bench.down(0x6060, 0, 3, 1)
    bench.down(0x6060, 0, 9, 1)
    bench.ramp_to(1.0, 4.0)
    assert bench.load_deg - start > 0.1


def test_cycle_time_does_not_move_before_60c2_fits() -> None:
    bench = Bench("cycle-time")
    bench.map(0x1400, 0x202, (0x60400010, 0x60FF0020, 0x60B20010))
    bench.map(0x1800, 0x182, (0x60410010, 0x60640020))
    bench.map(0x1801, 0x282, (0x606C0020, 0x60770010, 0x603F0010))
    bench.down(0x1006, 0, 4000, 4)
    bench.down(0x6060, 0, 9, 1)
    bench.start()
    start = bench.load_deg
    assert not bench.enable().status & 0x1000
    bench.run(0.5, ENABLE, bench.turn(0.5))
    assert abs(bench.load_deg - start) < 0.01
    bench.down(0x60C2, 1, 2, 1)
    assert not bench.run(0.02, ENABLE).status & 0x1000
    bench.down(0x60C2, 1, 4, 1)
    assert bench.run(0.02, ENABLE).status & 0x1000


def test_halting_stops_in_csv_by_bit_8() -> None:
    bench = Bench("halting").set_up()
    bench.enable()
    bench.ramp_to(1.0, 4.0)
    halted = bench.run(4.0, ENABLE | 0x100, bench.turn(1.0))
    assert abs(bench.deg_s(halted.velocity)) < 0.05
    assert not halted.status & 0x1000


def test_early_enabled_says_enabled_while_the_brake_opens_with_bit_12_at_0() -> None:
    bench = Bench("early-enabled").set_up()
    bench.run(0.02, SHUTDOWN)
    bench.run(0.02, SWITCH_ON)
    seen = [bench.cycle(ENABLE) for _ in range(60)]
    early = [f for f in seen if f.state is State.ENABLED and not f.status & 0x1000]
    assert len(early) > 30
    assert seen[-1].status & 0x1000


def test_silent_faults_send_no_emcy_and_have_no_603f() -> None:
    bench = Bench("silent-faults").set_up()
    bench.frames.clear()
    bench.event("fault", code=0x7305)
    assert bench.run(0.02, 0).state is State.FAULT
    assert bench.take(EMCY) == []
    with pytest.raises(Aborted, match="06020000"):
        bench.up(0x603F)


def test_sparse_lacks_objects_and_moves_all_the_same() -> None:
    bench = Bench("sparse").set_up()
    for index in (0x603F, 0x6502, 0x60B1, 0x60B2, 0x60C2, 0x60FD, 0x1029):
        with pytest.raises(Aborted, match="06020000"):
            bench.up(index)
    bench.enable()
    bench.ramp_to(0.5, 4.0)
    assert bench.load_deg_s > 0.2


def test_array_mapping_declares_arrays_and_gives_no_default_of_6502() -> None:
    bench = Bench("array-mapping")
    device = parse_eds(write_eds(bench.node.device).encode())
    assert device.objects[0x1600].kind.name == "ARRAY"
    modes = device.entry(0x6502)
    assert modes is not None
    assert modes.default is None
    assert bench.up(0x6502) == 0x104


def test_odd_identity_has_another_device_type() -> None:
    assert Bench("odd-identity").up(0x1000) == 0x92013412


def test_1005_may_be_absent_or_odd() -> None:
    with pytest.raises(Aborted, match="06020000"):
        Bench("no-1005").up(0x1005)
    odd = Bench("odd-1005")
    assert odd.up(0x1005) == 0x80000080
    for bench in (odd, Bench("no-1005")):
        bench.set_up()
        assert bench.cycle(0).state is State.SWITCH_ON_DISABLED


def test_dangerous_defaults_are_what_they_say() -> None:
    bench = Bench("dangerous-defaults")
    assert (bench.up(0x6007), bench.up(0x605E)) == (0, 0)
    assert bench.up(0x6085) / bench.node.scaling.counts_per_turn * 360 == pytest.approx(360_000, rel=1e-6)


def test_rpm_has_velocities_in_tenths_of_r_min() -> None:
    bench = Bench("rpm").set_up()
    assert bench.up(0x60A9) == 0xFFB44700
    assert bench.up(0x608F, 1) == 65536
    bench.enable()
    bench.run(0.1, ENABLE)
    for units in range(0, 2000, 20):
        bench.cycle(ENABLE, units)
    feedback = bench.run(2.0, ENABLE, 1907)  # 190.7 r/min at the motor, 1 deg/s at the gantry
    assert feedback.velocity == pytest.approx(1907, abs=20)
    assert bench.load_deg_s == pytest.approx(1.0, abs=0.15)


def test_fine_counts_wrap_within_the_multiturn_range() -> None:
    bench = Bench("fine-counts")
    raw = bench.up(0x2110, 3) * (1 << 22) + bench.up(0x2110, 2)
    assert raw >= 1 << 32
    assert (bench.up(0x6064) - raw) % (1 << 32) == 0


def test_standstill_torque_scales_60b2_and_6077_otherwise() -> None:
    bench = Bench("standstill-torque").set_up()
    bench.inject("brake", "closed")
    bench.enable()
    feedback = bench.run(0.2, ENABLE, 0, 100)
    assert bench.node.plant.torque_nm == pytest.approx(0.1 * 1.2 * 257, abs=2)
    assert feedback.torque == pytest.approx(100, abs=8)


def test_short_frames_have_three_bytes_of_emcy_and_empty_heartbeats() -> None:
    bench = Bench("short-frames").set_up()
    bench.down(0x1017, 0, 20, 2)
    bench.event("fault", code=0x7305)
    assert [data for can_id, data in bench.frames if can_id == EMCY] == [struct.pack("<HB", 0x7305, 1)]
    bench.frames.clear()
    bench.run(0.05, 0)
    assert set(bench.take(HEARTBEAT)) == {b""}


def test_slow_save_answers_late_and_leaves_the_bus(tmp_path: Path) -> None:
    bench = Bench("slow-save", store=tmp_path / "store.json").set_up()
    bench.down(0x1017, 0, 100, 2)
    bench.run(0.02, 0)
    bench.frames.clear()
    bench.send(SDO_RX, bytes.fromhex("2310100173617665"))
    assert bench.frames == []
    times = []
    for step in range(400):
        before = len(bench.frames)
        bench.send(0x80)
        times += [
            (step * 0.004, can_id) for can_id, _ in bench.frames[before:] if can_id in (SDO_TX, HEARTBEAT)
        ]
    answered = [at for at, can_id in times if can_id == SDO_TX]
    alive = [at for at, can_id in times if can_id == HEARTBEAT]
    assert answered == [pytest.approx(1.2, abs=0.01)]
    assert min(alive) > 0.38


def test_personalities_combine_and_unknown_ones_are_refused() -> None:
    both = personality(["rpm", "lagging"])
    assert (both.velocity_unit, both.lag_ms, both.name) == ("0.1 r/min", 10, "rpm+lagging")
    joined = personality(["sparse", "silent-faults"])
    assert {0x60B2, 0x603F} <= set(joined.absent)
    assert joined.silent_faults
    with pytest.raises(UsageError, match="there is no personality 'nonsense'"):
        personality(["nonsense"])


def test_the_objects_have_the_names_of_cia_402() -> None:
    visible = Bench().node.device
    for (index, sub), standard in STANDARD.items():
        entry = visible.entry(index, sub)
        if index >= 0x6000 and entry is not None:
            assert entry.name == standard.name, f"{index:04X}:{sub:02X}"
