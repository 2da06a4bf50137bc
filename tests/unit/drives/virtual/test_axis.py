"""The CiA 402 axis on the full plant: every transition, option codes, brake, faults."""

from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.virtual.axis.cabinet import Cabinet
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.drives.virtual.axis.plant import DrivePlant
from gantryctl.drives.virtual.axis.power_stage import Phase
from unit.drives.virtual.bench import (
    DISABLE_VOLTAGE,
    EMCY,
    ENABLE,
    QUICK_STOP,
    RESET,
    SHUTDOWN,
    SWITCH_ON,
    Aborted,
    Bench,
)


@pytest.fixture
def bench() -> Bench:
    return Bench().set_up()


def state_after(bench: Bench, *words: int) -> State:
    feedback = None
    for word in words:
        feedback = bench.run(0.3, word)
    assert feedback is not None
    return feedback.state


@pytest.mark.parametrize(
    ("words", "state"),
    [
        ((DISABLE_VOLTAGE,), State.SWITCH_ON_DISABLED),  # 0, 1
        ((SWITCH_ON,), State.SWITCH_ON_DISABLED),
        ((ENABLE,), State.SWITCH_ON_DISABLED),
        ((SHUTDOWN,), State.READY),  # 2
        ((SHUTDOWN, SWITCH_ON), State.SWITCHED_ON),  # 3
        ((SHUTDOWN, SWITCH_ON, ENABLE), State.ENABLED),  # 4
        ((SHUTDOWN, ENABLE), State.ENABLED),  # 3 and 4
        ((SHUTDOWN, ENABLE, SWITCH_ON), State.SWITCHED_ON),  # 5
        ((SHUTDOWN, SWITCH_ON, SHUTDOWN), State.READY),  # 6
        ((SHUTDOWN, DISABLE_VOLTAGE), State.SWITCH_ON_DISABLED),  # 7
        ((SHUTDOWN, QUICK_STOP), State.SWITCH_ON_DISABLED),  # 7
        ((SHUTDOWN, ENABLE, SHUTDOWN), State.READY),  # 8
        ((SHUTDOWN, ENABLE, DISABLE_VOLTAGE), State.SWITCH_ON_DISABLED),  # 9
        ((SHUTDOWN, SWITCH_ON, DISABLE_VOLTAGE), State.SWITCH_ON_DISABLED),  # 10
        ((SHUTDOWN, SWITCH_ON, QUICK_STOP), State.SWITCH_ON_DISABLED),  # 10
        ((SHUTDOWN, ENABLE, QUICK_STOP), State.SWITCH_ON_DISABLED),  # 11, 12 by option code 2
    ],
)
def test_the_transitions_by_command(bench: Bench, words: tuple[int, ...], state: State) -> None:
    assert state_after(bench, *words) is state


def test_transition_11_12_and_16_with_an_option_code_that_stays(bench: Bench) -> None:
    bench.down(0x605A, 0, 6, 2)
    bench.enable()
    stopped = bench.run(0.3, QUICK_STOP)
    assert stopped.state is State.QUICK_STOP
    assert stopped.status & 0x400  # stands
    assert bench.run(0.1, ENABLE).state is State.ENABLED
    bench.run(0.1, QUICK_STOP)
    assert bench.run(0.02, DISABLE_VOLTAGE).state is State.SWITCH_ON_DISABLED


def test_transitions_13_14_15_and_that_a_reset_never_enables(bench: Bench) -> None:
    bench.enable()
    bench.event("fault", code=0x7305, ramp=True)
    assert bench.cycle(ENABLE).state is State.FAULT_REACTION
    stopped = bench.run(0.5, ENABLE)
    assert stopped.state is State.FAULT
    assert stopped.error == 0x7305
    assert bench.run(0.1, ENABLE | RESET).state is State.SWITCH_ON_DISABLED
    assert bench.run(0.1, ENABLE).state is State.SWITCH_ON_DISABLED
    assert bench.cycle(ENABLE).error == 0


def test_a_fault_stays_without_a_rising_edge(bench: Bench) -> None:
    bench.run(0.02, RESET)
    bench.event("fault", code=0x7305)
    assert bench.run(0.1, RESET).state is State.FAULT
    bench.run(0.02, 0)
    assert bench.run(0.02, RESET).state is State.SWITCH_ON_DISABLED


@pytest.mark.parametrize("state", ["SWITCH_ON_DISABLED", "READY", "SWITCHED_ON", "ENABLED"])
def test_a_fault_without_ramp_takes_the_torque_off_from_every_state(bench: Bench, state: str) -> None:
    words = {"READY": [SHUTDOWN], "SWITCHED_ON": [SHUTDOWN, SWITCH_ON], "ENABLED": [SHUTDOWN, ENABLE]}
    for word in words.get(state, []):
        bench.run(0.3, word)
    bench.event("fault", code=0x2310)
    assert bench.run(0.02, 0).state is State.FAULT
    assert not bench.node.axis.stage.energised
    assert bench.take(EMCY)[-1][:3].hex() == "102303"


def test_mains_lost_while_enabled_is_a_fault_that_cannot_be_reset_before_they_are_back(bench: Bench) -> None:
    bench.enable()
    bench.inject("mains_ready", False)
    lost = bench.run(0.02, ENABLE)
    assert (lost.state, lost.error, lost.status & 0x10) == (State.FAULT, 0x3220, 0)
    bench.run(0.02, 0)
    assert bench.run(0.02, RESET).state is State.FAULT
    bench.inject("mains_ready", True)
    bench.run(0.02, 0)
    assert bench.run(0.02, RESET).state is State.SWITCH_ON_DISABLED


def test_safe_torque_off_leads_to_switch_on_disabled_and_blocks_switching_on(bench: Bench) -> None:
    bench.enable()
    bench.inject("estop_ok", False)
    assert bench.run(0.02, ENABLE).state is State.SWITCH_ON_DISABLED
    bench.run(0.02, SHUTDOWN)
    assert bench.run(0.1, SWITCH_ON).state is State.READY
    bench.inject("estop_ok", True)
    assert bench.run(0.1, SWITCH_ON).state is State.SWITCHED_ON


def test_the_brake_opens_after_the_preload_and_the_state_follows_the_brake(bench: Bench) -> None:
    bench.run(0.02, SHUTDOWN)
    bench.run(0.02, SWITCH_ON)
    phases = []
    for _ in range(60):
        feedback = bench.cycle(ENABLE, 0, 100)
        phases.append((bench.node.plant.brake_open, feedback.state, round(bench.node.plant.torque_nm)))
    closed = [p for p in phases if not p[0]]
    assert all(state is State.SWITCHED_ON for _, state, _ in closed[:-1])
    assert closed[10][2] == pytest.approx(25.7, abs=2)  # 100 per mille of 257 N m against the closed brake
    assert phases[-1][1] is State.ENABLED
    assert 0.15 <= 0.004 * len(closed) <= 0.17  # 50 ms preload, 100 ms opening


def test_with_the_right_preload_the_load_does_not_sag(bench: Bench) -> None:
    start = bench.load_deg
    bench.run(0.02, SHUTDOWN)
    bench.run(0.3, SWITCH_ON)
    moment = 16_000 * 0.29552 / 1144  # 16 kN m at 0.3 rad
    bench.run(1.0, ENABLE, 0, round(1000 * moment / 257))
    assert abs(bench.load_deg - start) < 0.003


def test_a_leaving_ramp_holds_the_load_until_the_brake_is_closed(bench: Bench) -> None:
    bench.enable()
    torques = []
    for _ in range(70):
        feedback = bench.cycle(SWITCH_ON)
        torques.append((feedback.state, bench.node.plant.brake_open, abs(bench.node.plant.torque_nm) > 1.0))
    assert all(held for state, brake_open, held in torques if brake_open)
    assert torques[-1] == (State.SWITCHED_ON, False, False)
    assert bench.node.axis.stage.phase is Phase.OFF


def test_torque_off_at_once_where_the_option_code_says_so(bench: Bench) -> None:
    bench.down(0x605C, 0, 0, 2)
    bench.enable()
    assert bench.run(0.012, SWITCH_ON).state is State.SWITCHED_ON
    assert not bench.node.axis.stage.energised


def test_enable_during_a_leaving_ramp_calls_the_way_out_off(bench: Bench) -> None:
    bench.enable()
    bench.ramp_to(1.0, 4.0)
    bench.run(0.05, SWITCH_ON)
    assert bench.node.axis.stage.phase is Phase.STOPPING
    assert bench.run(0.02, ENABLE, bench.turn(1.0)).state is State.ENABLED
    assert bench.node.axis.stage.phase is Phase.RUNNING


@pytest.mark.parametrize(("code", "seconds", "deg"), [(2, 0.6, 0.6), (1, 3.2, 3.2), (3, 0.4, 0.4)])
def test_quick_stop_ramps_by_its_option_code(bench: Bench, code: int, seconds: float, deg: float) -> None:
    """From 2 deg/s: 5.4 deg/s2 takes 0.37 s, 0.393 deg/s2 5.1 s (so it is raised to 0.8 here), the limit less."""
    bench.down(0x605A, 0, code, 2)
    bench.down(0x6084, 0, bench.turn(0.8), 4)
    bench.enable()
    bench.ramp_to(2.0)
    start = bench.load_deg
    took = 0.0
    while bench.node.axis.stage.phase is not Phase.CLOSING:
        bench.cycle(QUICK_STOP)
        took += 0.004
        assert took < 5.0
    assert took < seconds
    assert bench.load_deg - start < deg
    assert bench.run(0.3, QUICK_STOP).state is State.SWITCH_ON_DISABLED


def test_quick_stop_decelerates_with_6085(bench: Bench) -> None:
    bench.down(0x605A, 0, 6, 2)
    bench.down(0x6085, 0, bench.turn(3.0), 4)
    bench.enable()
    bench.ramp_to(3.0)
    bench.run(0.5, QUICK_STOP)
    speed = bench.deg_s(bench.cycle(QUICK_STOP).velocity)
    assert speed == pytest.approx(1.5, abs=0.1)


def test_a_fault_reaction_ramps_by_605e_and_reports_fault_at_rest(bench: Bench) -> None:
    bench.down(0x605E, 0, 2, 2)
    bench.enable()
    bench.ramp_to(2.0)
    bench.event("fault", code=0x4210, ramp=True)
    assert bench.run(0.2, ENABLE).state is State.FAULT_REACTION
    assert bench.run(0.5, ENABLE).state is State.FAULT
    bench.run(3.0, 0)
    assert abs(bench.load_deg_s) < 0.01


@pytest.mark.parametrize(
    ("action", "state", "error"),
    [
        (0, State.ENABLED, 0),
        (1, State.FAULT, 0x8130),
        (2, State.SWITCH_ON_DISABLED, 0),
        (3, State.QUICK_STOP, 0),
    ],
)
def test_6007_decides_what_a_lost_heartbeat_does(bench: Bench, action: int, state: State, error: int) -> None:
    bench.down(0x6007, 0, action, 2)
    bench.down(0x605A, 0, 6, 2)
    bench.down(0x1029, 1, 1, 1)
    bench.down(0x1016, 1, 0x7F << 16 | 50, 4)
    bench.enable()
    bench.send(0x77F, b"\x05")
    feedback = bench.run(1.0, ENABLE)
    assert (feedback.state, feedback.error) == (state, error)


def test_a_stop_by_6007_is_not_undone_by_the_enable_that_still_stands(bench: Bench) -> None:
    bench.down(0x6007, 0, 3, 2)
    bench.down(0x605A, 0, 6, 2)
    bench.down(0x1029, 1, 1, 1)
    bench.down(0x1016, 1, 0x7F << 16 | 50, 4)
    bench.enable()
    bench.ramp_to(1.0, 4.0)
    bench.send(0x77F, b"\x05")
    assert bench.run(1.0, ENABLE, bench.turn(1.0)).state is State.QUICK_STOP
    assert abs(bench.deg_s(bench.cycle(ENABLE, bench.turn(1.0)).velocity)) < 0.02
    bench.send(0x77F, b"\x05")
    bench.run(0.02, QUICK_STOP)
    assert bench.run(0.02, ENABLE).state is State.ENABLED


def test_a_silent_master_with_6007_at_0_lets_the_axis_run_on(bench: Bench) -> None:
    bench.down(0x6007, 0, 0, 2)
    bench.down(0x1400, 5, 50, 2)
    bench.enable()
    bench.ramp_to(1.0, 4.0)
    bench.node.advance(2_000_000)
    motor_deg_s = bench.node.truth()[3] / 1144 * 57.29578
    assert motor_deg_s == pytest.approx(1.0, abs=0.05)


def test_nmt_stop_acts_by_6007(bench: Bench) -> None:
    bench.down(0x6007, 0, 2, 2)
    bench.enable()
    bench.nmt(0x02)
    assert bench.node.axis.state is State.SWITCH_ON_DISABLED


def test_unknown_modes_are_refused_and_6061_follows(bench: Bench) -> None:
    for mode in (1, 4, 6, 8, 10, -1):
        with pytest.raises(Aborted, match="06090030"):
            bench.down(0x6060, 0, mode, 1)
    bench.down(0x6060, 0, 3, 1)
    assert bench.up(0x6061) == 3


def test_60fe_works_the_brake_where_it_owns_it_and_only_with_torque() -> None:
    bench = Bench(owner="object_60FE").set_up()
    bench.down(0x60FE, 2, 1, 4)
    bench.down(0x60FE, 1, 0, 4)
    bench.run(0.3, SHUTDOWN)
    assert not bench.node.plant.brake_open
    bench.down(0x60FE, 1, 1, 4)
    assert bench.enable().state is State.ENABLED
    assert not bench.node.plant.brake_open
    bench.run(0.2, ENABLE, 0, 20)  # torque proof against the closed brake
    assert bench.node.plant.torque_nm == pytest.approx(5.14, abs=0.2)
    bench.down(0x60FE, 1, 0, 4)
    bench.run(0.2, ENABLE, 0, 20)
    assert bench.node.plant.brake_open
    bench.run(0.3, DISABLE_VOLTAGE)
    assert not bench.node.plant.brake_open


def test_60fe_works_no_brake_whose_bit_is_not_in_its_mask() -> None:
    bench = Bench(owner="object_60FE").set_up()
    bench.down(0x60FE, 2, 2, 4)
    bench.down(0x60FE, 1, 0, 4)
    bench.enable()
    bench.run(0.3, ENABLE)
    assert not bench.node.plant.brake_open
    bench.down(0x60FE, 2, 3, 4)
    bench.run(0.3, ENABLE)
    assert bench.node.plant.brake_open


def test_a_watchdog_relay_closes_at_an_edge_and_not_at_a_level() -> None:
    """Of 20 ms; the first level that is set is no edge, whatever it is, nor is one that stays."""
    cabinet = Cabinet(0.020)
    for level in (True, True):
        cabinet.take({"watchdog": level, "brake_release": True})
        assert (cabinet.watchdog_closed, cabinet.brake_released) == (False, False)
    for level in (False, True):
        cabinet.take({"watchdog": level})
        cabinet.advance(19_000)
        assert (cabinet.watchdog_closed, cabinet.brake_released) == (True, True)
    cabinet.take({"watchdog": True})
    cabinet.advance(1_000)
    assert (cabinet.watchdog_closed, cabinet.brake_released) == (False, False)


def test_torque_above_the_rated_comes_again_a_tenth_of_the_budget_later() -> None:
    """A budget of 12 s at twice the rated torque, which takes 3 a second, and 0.9 of it at rest, which gives 1 back."""
    limits: list[bool] = []
    plant: Any = SimpleNamespace(
        torque_nm=200.0, _hardware=SimpleNamespace(torque_rated_nm=100.0, tick_s=0.5), _account=0.0, _budget=12.0,
        exhausted=False,
    )  # fmt: skip
    plant._apply_torque = lambda: limits.append(plant.exhausted)
    told = []
    for torque_nm, ticks in ((200.0, 9), (0.0, 4)):
        plant.torque_nm = torque_nm
        for _ in range(ticks):
            DrivePlant._count_overload(plant)
            told.append(plant.exhausted)
    # 8 ticks of 1.5 make 12; at 12, 11.5 and 11 it is exhausted, at 10.5 of which 10.8 are the nine tenths no more.
    assert told == [False] * 7 + [True] * 2 + [True] * 2 + [False] * 2
    assert limits == [True, False]
