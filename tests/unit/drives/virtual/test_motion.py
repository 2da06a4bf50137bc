"""CSV and PV: speed, limits, wrap, overload; on the full plant."""

import pytest

from gantryctl.drives.virtual.axis.cia402 import State
from unit.drives.virtual.bench import ENABLE, Bench

FOLLOWS, REACHED, LIMIT, WARNING, REMOTE = 0x1000, 0x400, 0x800, 0x80, 0x200


@pytest.fixture
def bench() -> Bench:
    return Bench().set_up()


def test_csv_follows_60ff_without_a_ramp_of_its_own(bench: Bench) -> None:
    bench.enable()
    feedback = bench.ramp_to(3.0)
    assert feedback.status & (FOLLOWS | REMOTE) == FOLLOWS | REMOTE
    assert not feedback.status & REACHED
    assert bench.deg_s(feedback.velocity) == pytest.approx(3.0, abs=0.02)
    start = bench.load_deg
    bench.run(1.0, ENABLE, bench.turn(3.0))
    assert bench.load_deg - start == pytest.approx(3.0, abs=0.05)


def test_60b1_is_added_to_60ff(bench: Bench) -> None:
    bench.enable()
    bench.down(0x60B1, 0, bench.turn(0.5), 4)
    bench.run(3.0, ENABLE)
    assert bench.load_deg_s == pytest.approx(0.5, abs=0.05)


def test_a_stale_target_moves_the_axis_at_enable(bench: Bench) -> None:
    """A trap of real drives: 60FF is what was written last."""
    bench.run(0.02, 0x06, bench.turn(0.5))
    bench.run(0.02, 0x07, bench.turn(0.5))
    bench.run(1.0, ENABLE, bench.turn(0.5))
    assert abs(bench.load_deg_s) > 0.3


def test_6080_clamps_the_speed_and_says_so(bench: Bench) -> None:
    bench.down(0x6080, 0, 191, 4)  # r/min, 1 deg/s
    bench.enable()
    bench.ramp_to(1.5)
    feedback = bench.run(2.0, ENABLE, bench.turn(2.0))
    assert feedback.status & LIMIT
    assert bench.deg_s(feedback.velocity) == pytest.approx(191 * 6 / 1144, abs=0.02)


def test_6072_limits_the_torque_and_says_so(bench: Bench) -> None:
    bench.down(0x6072, 0, 100, 2)
    bench.enable()
    seen = [bench.cycle(ENABLE, bench.turn(3.0)) for _ in range(100)]
    assert max(abs(feedback.torque) for feedback in seen) <= 107  # and the torque ripple
    assert any(feedback.status & LIMIT for feedback in seen)
    bench.down(0x6072, 0, 1498, 2)
    seen = [bench.cycle(ENABLE, 0) for _ in range(50)]
    assert max(abs(feedback.torque) for feedback in seen) > 300


def test_60b2_is_a_torque_in_per_mille_of_6076(bench: Bench) -> None:
    bench.inject("brake", "closed")
    bench.enable()
    bench.run(0.2, ENABLE, 0, 200)
    assert bench.node.plant.torque_nm == pytest.approx(0.2 * 257, abs=2.5)
    assert bench.cycle(ENABLE, 0, 200).torque == pytest.approx(200, abs=10)


def test_6077_and_606c_have_the_sign_of_the_motion(bench: Bench) -> None:
    bench.enable()
    before = bench.cycle(ENABLE).position
    bench.ramp_to(-1.0)
    after = bench.cycle(ENABLE, bench.turn(-1.0))
    assert after.velocity < 0
    assert after.position < before


def test_the_position_scale_is_that_of_608f(bench: Bench) -> None:
    bench.enable()
    motor, feedback = bench.node.truth()[2], bench.cycle(ENABLE)
    bench.ramp_to(2.0)
    moved = bench.cycle(ENABLE, bench.turn(2.0)).position - feedback.position
    turns = (bench.node.truth()[2] - motor) / 6.283185307179586
    assert moved / (1 << 19) == pytest.approx(turns, rel=2e-3)


def test_6064_wraps_at_32_bit() -> None:
    bench = Bench("centre-wrap").set_up()
    bench.enable()
    feedback = bench.ramp_to(-6.0, 4.0)
    while feedback.position < 0:
        last, feedback = feedback.position, bench.cycle(ENABLE, bench.turn(-6.0))
        assert bench.load_deg > -30
    assert last < -(1 << 31) + 100_000
    assert feedback.position > (1 << 31) - 100_000


def test_the_absolute_encoder_is_told_apart_by_turn_and_part_of_a_turn(bench: Bench) -> None:
    turn, part = bench.up(0x2110, 3), bench.up(0x2110, 2)
    assert bench.up(0x6064) == turn * (1 << 19) + part
    assert bench.up(0x2110, 4) == 4096
    bench.event("lose_turns", turns=7)
    bench.run(0.02, 0)
    assert bench.up(0x2110, 3) == turn + 7


def test_profile_velocity_ramps_and_reports_target_reached() -> None:
    bench = Bench().set_up(mode=3)
    bench.down(0x6083, 0, bench.turn(1.0), 4)
    bench.down(0x6084, 0, bench.turn(2.0), 4)
    bench.enable()
    assert bench.run(0.2, ENABLE).status & FOLLOWS  # speed zero
    bench.run(1.0, ENABLE, bench.turn(2.0))
    assert bench.deg_s(bench.cycle(ENABLE, bench.turn(2.0)).velocity) == pytest.approx(1.0, abs=0.05)
    arrived = bench.run(1.6, ENABLE, bench.turn(2.0))
    assert arrived.status & (REACHED | FOLLOWS) == REACHED
    slowing = bench.run(0.5, ENABLE)
    assert bench.deg_s(slowing.velocity) == pytest.approx(1.0, abs=0.06)


def test_halt_stops_profile_velocity_and_has_no_function_in_csv() -> None:
    profile = Bench().set_up(mode=3)
    profile.down(0x6083, 0, profile.turn(2.0), 4)
    profile.down(0x6084, 0, profile.turn(2.0), 4)
    profile.enable()
    profile.run(1.0, ENABLE, profile.turn(1.0))
    halted = profile.run(2.0, ENABLE | 0x100, profile.turn(1.0))
    assert halted.state is State.ENABLED
    assert halted.status & REACHED
    assert abs(profile.deg_s(halted.velocity)) < 0.05
    assert profile.deg_s(profile.run(1.5, ENABLE, profile.turn(1.0)).velocity) == pytest.approx(1.0, abs=0.05)
    csv = Bench().set_up()
    csv.enable()
    csv.ramp_to(1.0)
    on = csv.run(0.5, ENABLE | 0x100, csv.turn(1.0))
    assert csv.deg_s(on.velocity) == pytest.approx(1.0, abs=0.05)


def test_an_enabled_drive_without_a_mode_stands_and_does_not_follow() -> None:
    bench = Bench().set_up(mode=0)
    feedback = bench.enable()
    assert not feedback.status & FOLLOWS
    start = bench.load_deg
    bench.run(1.0, ENABLE, bench.turn(3.0))
    assert abs(bench.load_deg - start) < 0.01


def test_a_change_of_mode_in_motion_goes_on_from_the_present_speed() -> None:
    bench = Bench().set_up()
    bench.enable()
    bench.ramp_to(2.0)
    bench.down(0x6060, 0, 3, 1)
    after = bench.run(0.1, ENABLE, bench.turn(2.0))
    assert bench.deg_s(after.velocity) == pytest.approx(2.0, abs=0.1)


def test_the_overload_warns_then_limits_to_rated_torque() -> None:
    """A brake that does not open: full torque against it, 6 s of it from cold."""
    bench = Bench(overload_time_s=6.0).set_up()
    bench.inject("brake", "closed")
    bench.enable()
    torque = bench.turn(50.0)
    warned = limited = 0.0
    for step in range(80):
        feedback = bench.run(0.1, ENABLE, torque)
        if feedback.status & WARNING and not warned:
            warned = step
        if abs(feedback.torque) < 1100 and not limited:
            limited = step
    assert 45 <= warned <= 52
    assert 58 <= limited <= 63
    assert feedback.status & LIMIT
    assert feedback.torque == pytest.approx(1000, abs=20)
    assert [data[:2].hex() for data in bench.take(0x82)] == ["5123"]
    cooled = bench.run(2.0, ENABLE)
    assert not cooled.status & WARNING
    assert bench.up(0x2101, 1) < 800


def test_digital_inputs_show_limit_switches_chain_mains_and_brake(bench: Bench) -> None:
    assert bench.up(0x60FD) == 0x177_0008
    bench.enable()
    assert bench.up(0x60FD) == 0x17F_0008
    bench.inject("limit_plus_ok", False)
    bench.inject("brake_feedback", False)
    assert bench.up(0x60FD) == 0x177_000A
    bench.inject("estop_ok", False)
    assert bench.up(0x60FD) == 0x176_0002


def test_a_threshold_of_0_leaves_the_drives_own_standstill(bench: Bench) -> None:
    """606F = 0, as in the EDS of several makers: the ramp down still ends in torque off and a closed brake."""
    bench.down(0x606F, 0, 0, 2)
    bench.enable()
    bench.ramp_to(1.0)
    assert bench.run(2.0, 0x06).state is State.READY
    assert bench.node.plant.sim.state["brake_closed"]
