"""The oracle sees each invariant broken when a liar breaks it, and nothing in a sound run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import pytest

from gantryctl.engineering.fault_campaign.machines import base_machine
from gantryctl.engineering.faults.injection import injection
from gantryctl.engineering.faults.limits import runs_out_deg
from gantryctl.engineering.faults.oracle import limits
from gantryctl.engineering.faults.oracle.asked import Asked
from gantryctl.engineering.faults.oracle.axis_oracle import AxisOracle, Violation
from gantryctl.engineering.faults.oracle.known import Effect, KnownFaults
from gantryctl.engineering.faults.oracle.limits import StopClass
from gantryctl.engineering.faults.oracle.silence import Silence
from gantryctl.engineering.faults.oracle.stretch import stretch_around
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.engineering.faults.oracle.tell import tell
from gantryctl.engineering.faults.oracle.words import Instant, Stop, judge_words
from gantryctl.image import DriveRequest, Mode, OutputImage
from gantryctl.machine import default_machine, with_values
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.log import Alarm, Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.program.settings import TravelSettings
from gantryctl.units import rad
from gantryctl.wiring.program import axis_settings
from unit.oracle_liars import LIARS, RATIO, Bench, Between, frozen_at_rest, silent_bus, turning


@pytest.mark.parametrize(
    ("invariant", "liar"),
    LIARS,
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
def test_a_liar_is_caught(
    invariant: str,
    liar: Callable[[pytest.MonkeyPatch], None],
    oracle: Oracle,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    liar(monkeypatch)
    assert oracle.caught(invariant), oracle.violations
    oracle.violations.clear()  # one lie may break others too


@pytest.mark.parametrize("period_ms", [1.0, 4.0, 10.0])
def test_a_sound_run_is_passed(period_ms: float, oracle: Oracle) -> None:
    """Moves, jog, halt, stop, increment, override, power off and on, quick stop: each way at least once."""
    bench = Bench(control__scan_period_ms=period_ms)
    everything(bench)
    assert not oracle.violations
    axis = oracle.axis(bench.drive)
    assert axis.bound
    assert axis.ms == pytest.approx(1e3 * bench.engine.time_s, abs=10)
    assert axis.angle / RATIO == pytest.approx(bench.drive.truth_source.truth()[2] / RATIO)


@pytest.mark.can
def test_a_sound_zero_that_moves_on_is_passed(oracle: Oracle) -> None:
    bench = turning()
    assert bench.engine.program.axis.turns._turns == 1
    assert not oracle.violations


@pytest.mark.parametrize(("owner", "period_ms"), [("drive", 4.0), ("object_60FE", 10.0)])
def test_a_sound_run_over_the_bus_is_passed(owner: str, period_ms: float, oracle: Oracle) -> None:
    bench = Bench(drive__kind="canopen", control__scan_period_ms=period_ms, brake__owner=owner)
    everything(bench)
    bench.engine.close()
    assert not oracle.violations


def test_a_frozen_reading_is_believed_until_it_has_been_asked(oracle: Oracle) -> None:
    bench = frozen_at_rest()
    first = bench.engine.program.axis.alarms.first_out
    assert first is not None
    assert first.code == "ENC-02"
    assert not oracle.caught("INV-7")
    oracle.violations.clear()


def test_a_key_is_refused_where_a_move_turns_round(oracle: Oracle) -> None:
    """Its lease ends nothing, and the move goes on."""
    bench = Bench(virtual_axis__acc_deg_s2=2.0, virtual_axis__dec_deg_s2=2.0).moving()
    bench.op(move=True, target_rad=rad(80.0))
    bench.op(move=False, mode=Mode.CONTINUOUS)
    virtual = bench.engine.program.axis.virtual
    assert bench.engine.run_until(lambda _: abs(virtual.vel_ref_rad_s) < rad(0.02), 10.0)
    bench.op(reverse=True, lease=1)
    bench.op(reverse=False)
    bench.engine.run_for(6.0)
    assert abs(virtual.vel_ref_rad_s) > rad(1.0)
    assert not oracle.violations


def test_a_key_is_refused_while_an_increment_is_under_way(oracle: Oracle) -> None:
    """Its lease ends nothing, and the increment goes on."""
    bench = Bench().up()
    bench.op(mode=Mode.INCREMENTAL, increment_rad=rad(3.0), speed_rad_s=rad(0.6))
    bench.op(forward=True)
    bench.op(forward=False)
    bench.engine.run_for(2.5)
    bench.op(mode=Mode.CONTINUOUS)
    bench.op(forward=True, lease=1)
    bench.engine.run_for(4.0)
    assert not oracle.violations


def test_a_move_that_override_0_holds_goes_on(oracle: Oracle) -> None:
    """For seconds, and near its target."""
    bench = Bench().up()
    bench.op(override=0.0)
    bench.op(move=True, target_rad=rad(90.04), speed_rad_s=rad(1.0))
    bench.op(move=False)
    bench.engine.run_for(3.0)
    bench.op(override=1.0)
    bench.engine.run_for(2.0)
    assert not oracle.violations


def test_an_emergency_stop_within_a_quick_stop_is_passed(oracle: Oracle) -> None:
    bench = Bench().moving(2.0)
    bench.op(quick_stop=True)
    bench.engine.run_for(0.15)
    bench.inject("input", "off", name="estop_ok")
    bench.engine.run_for(3.0)
    assert not oracle.violations


def test_a_dither_is_no_step_of_the_speed(oracle: Oracle) -> None:
    """0.307 deg/s for 8 ms and back, as an encoder is tried that stands still: 0.0025 deg each way."""
    bench = Bench().up()
    begun, period_s = bench.engine.time_s, bench.engine.program.axis.settings.period_s
    step = rad(0.307) * RATIO

    def dither(output: OutputImage) -> OutputImage:
        at_s = bench.engine.time_s - begun
        vel = step if at_s < 0.008 - 0.5 * period_s else -step if 0.010 < at_s < 0.018 else 0.0
        return output._replace(vel_cmd_rad_s=output.vel_cmd_rad_s + vel)

    Between(bench, dither)
    bench.engine.run_for(0.05)
    assert not oracle.violations


def test_a_stop_that_goes_on_without_the_controller_has_its_true_times() -> None:
    """Torque off 50 ms after the alarm, brake closed after 200 ms, and nobody commands meanwhile."""
    axis = AxisOracle(lambda found: pytest.fail(str(found)))
    axis.begin(0.0, brake_open=True, energised=True)
    axis.bound, axis._silent_from = True, -1
    told = Instant(0, 0.0, 0.0, energised=True, brake_open=True)
    stop = axis._stop = Stop(Alarm(Code.INT_06, 0.0, {}, Reaction.QUICK_STOP), StopClass.QUICK, told, told)
    for ms in range(1, 301):
        axis.sample(0.0, 0.0, 0.0, brake_open=ms < 200, energised=ms < 50)
    assert (stop.off_ms, stop.closed_ms) == (50, 200)
    stop.alarm.steps = (Words.TORQUE_OFF_SEEN(time_ms=290.0), Words.BRAKE_CLOSED_SEEN(time_ms=290.0))
    axis._axis = SimpleNamespace(settings=SimpleNamespace(period_s=0.004))
    assert list(judge_words(stop.alarm, stop, axis)) == []
    stop.alarm.steps = (Words.BRAKE_CLOSED_AFTER(time_ms=290.0),)
    assert list(judge_words(stop.alarm, stop, axis)) == ["brake closed after 290 ms is told, true 200 ms"]
    # A contact that was held open could not show it earlier.
    axis.known.contact_lies = True
    assert list(judge_words(stop.alarm, stop, axis)) == []
    stop.alarm.steps = (Words.BRAKE_CLOSED_AFTER(time_ms=100.0),)
    assert list(judge_words(stop.alarm, stop, axis)) == ["brake closed after 100 ms is told, true 200 ms"]


@pytest.mark.parametrize(
    ("lies_ms", "found"),
    [
        ([], True), ([1120], False), ([1400], False),
        # It lied before the alarm, or saw the shaft move on for a while.
        ([900], True), ([1450], True), ([900, 1120], False),
    ],
)  # fmt: skip
def test_a_rest_that_a_frozen_encoder_shows_is_told_by_nobody_s_fault(
    lies_ms: list[int], found: bool
) -> None:
    """Alarm at 1 s, at rest from 0.1 s on, torn off 0.4 s behind it; frozen in between nobody can see it."""
    axis = bare([])
    axis._axis = SimpleNamespace(settings=SimpleNamespace(period_s=0.004))
    told = Instant(1000, 0.0, 0.0, energised=True, brake_open=True)
    stop = Stop(Alarm(Code.CTL_02, 0.0, {}, Reaction.TORQUE_OFF), StopClass.TORQUE_OFF, told, told)
    stop.speeds = [5.0] * 100 + [0.0] * 300 + [0.153] * 100
    stop.alarm.steps = (Words.AT_REST_AFTER(time_ms=100.0),)
    axis.known.encoder_lies_ms = lies_ms
    said = list(judge_words(stop.alarm, stop, axis))
    assert said == (["at rest after 100 ms is told, 0.153 deg/s later"] if found else [])


@pytest.mark.parametrize(("key_ms", "found"), [(4200, False), (4800, True)])
def test_a_move_that_comes_late_into_its_window_ends_there(key_ms: int, found: bool) -> None:
    """Beside its window until 3.2 s, as friction kept a rotary table: a key is refused until 4.7 s at most."""
    settings = axis_settings(default_machine())
    window = settings.monitors.in_position_window_rad * RATIO
    asked = Asked(settings, settled=window, told=10.0 * window, sag=window)

    def take(now: int, refused: Refusal | None = None, **levels: object) -> str:
        op = asked.levels._replace(**levels)
        ramps = settings.ramps
        return asked.take(op, now, 0.0, 0.0, moves=False, refused=refused, in_force=ramps)

    take(0, power=True)
    take(1000, move=True, target_rad=0.0)
    for now in range(1001, key_ms):
        asked.perhaps_arrived(now, 1.5 * window if now < 3200 else 0.5 * window)
    told = take(key_ms, refusal(Code.CTL_14, reason=Words.JOG_FROM_REST), forward=True)
    assert ("has not ended" in told) is found


def test_a_stop_leads_no_further_than_the_target() -> None:
    """At 5.28 deg/s, on ramps that need 8.04 deg: a move to 1 deg that is stopped ends there, and 0.15 deg sag."""
    settings, deg = axis_settings(default_machine()), RATIO * rad(1.0)
    asked = Asked(settings, settled=0.05 * deg, told=0.05 * deg, sag=0.15 * deg)
    take = partial(asked.take, moves=True, refused=None, in_force=settings.ramps)
    take(asked.levels._replace(power=True), 0, 0.0, 0.0)
    take(asked.levels._replace(move=True, target_rad=rad(1.0)), 10, 0.0, 0.0)
    take(asked.levels._replace(stop=True), 20, 5.28 * deg, 0.0)
    assert not asked.leads_away(1.14 * deg, deg)
    assert asked.leads_away(1.16 * deg, deg)


CAUGHT = {"brake_open": False, "energised": False}


@pytest.mark.parametrize(
    ("after_ms", "speed_deg_s", "way_deg", "state", "passes"),
    [
        (60, 3.0, 0.5, CAUGHT, True),
        (240, 3.0, 0.5, CAUGHT, True),
        (260, 3.0, 0.5, CAUGHT, False),
        (60, 3.0, 2.0, CAUGHT, False),
        (60, 3.0, 0.5, {"brake_open": True, "energised": True}, False),
        (60, 3.0, 0.5, {"brake_open": False, "energised": True}, False),
        (60, 0.3, 0.5, CAUGHT, False),
    ],
    ids=[
        "torn off",
        "by the slowest swing",
        "later",
        "beyond the way of the stop",
        "driven on",
        "driven against the brake",
        "creeps on behind the swing",
    ],
)
def test_a_load_that_swings_on_tears_the_rotor_off_within_half_a_swing(
    after_ms: int, speed_deg_s: float, way_deg: float, state: dict[str, bool], passes: bool
) -> None:
    """0.3 deg behind a closed brake: 205 ms are half a swing, 251 of one a fifth larger on a gear a fifth softer.

    The stop from 3 deg/s may take 2.1 deg in all. At 0.3 deg/s half of the way is left at the end of the swing.
    """
    found: list[Violation] = []
    axis = AxisOracle(found.append)
    axis.bound, axis._rest, axis._sag, axis._deg = True, 0.05, 0.15, 1.0
    axis.begin(0.0, **state)
    alarm = Alarm(Code.CTL_03, 0.0, {}, Reaction.TORQUE_OFF)
    onset = Instant(0, -way_deg, 3.0, True, True)
    axis._stop = Stop(alarm, StopClass.FEEDBACK, onset, axis.now())
    for ms in range(1200):
        slips = min(max(0.0, 1e-3 * speed_deg_s * (ms - after_ms)), 0.3)
        axis.sample(slips, speed_deg_s if 0.0 < slips < 0.3 else 0.0, 0.0, **state)
    assert [each.invariant for each in found] == ([] if passes else ["INV-2"])


@pytest.mark.parametrize(
    ("signal", "step", "passes"), [(0.0, 0.08, False), (0.1, 0.16, True), (0.1, 0.18, False)]
)
def test_the_signal_of_an_experiment_is_no_step_of_the_ramps(
    signal: float, step: float, passes: bool
) -> None:
    """At 1 deg/s, in 4 ms: 0.067 deg/s are ramps (2 + 4.36 of 0.5 deg/s) and regulation, and the signal."""
    found: list[Violation] = []
    axis = AxisOracle(found.append)
    settings = axis_settings(default_machine())
    settings = replace(
        settings,
        law=replace(settings.law, kpp_per_s=4.36),
        monitors=replace(settings.monitors, velocity_deviation_rad_s=rad(0.5)),
    )
    deg = axis._deg = RATIO * rad(1.0)
    axis._wire.bind(settings, SimpleNamespace(signal_step_rad_s=signal * deg), shipped=False)
    for ms, vel in ((4, 1.0), (8, 1.0), (12, 1.0 + step), (16, 1.0 + step), (20, 1.0 + step)):
        axis.ms = ms
        if ms == 4:
            axis._wire.vel = vel * deg
        axis._wire.command(axis, vel * deg, 0.0, None)
    assert [each.invariant for each in found] == ([] if passes else ["INV-3"])


@pytest.mark.parametrize(
    ("brake_share", "speed_deg_s", "passes"), [(0.0, 0.76, True), (0.0, 0.80, False), (1.0, 0.45, False)]
)
def test_a_gear_that_turns_back_gives_the_rotor_so_much_speed_and_no_more(
    brake_share: float, speed_deg_s: float, passes: bool
) -> None:
    """0.44 deg/s are 1.1 of the highest speed; 65 N m have gone, of which 0.005 deg/s each come back: 0.765 deg/s."""
    found: list[Violation] = []
    axis = AxisOracle(found.append, replace(limits.REFERENCE, untwists_deg_s_per_nm=0.005))
    axis.bound, axis._speed_max, axis._rest, axis._sag = True, 0.44, 0.05, math.inf
    axis.known.brake_share = brake_share
    axis.begin(0.0, brake_open=False, energised=True)
    axis.sample(0.0, 0.0, -65.0, brake_open=False, energised=True)
    axis.sample(0.0, speed_deg_s, 0.0, brake_open=False, energised=False)
    assert [each.invariant for each in found] == ([] if passes else ["INV-3"])


@pytest.mark.parametrize(
    ("caught_deg_s", "speed_deg_s", "passes"),
    [(0.76, 0.76, True), (0.76, 0.75, True), (0.60, 0.62, False), (0.76, 0.80, False)],
)
def test_a_brake_that_closes_takes_what_a_gear_has_thrown_and_gives_nothing(
    caught_deg_s: float, speed_deg_s: float, passes: bool
) -> None:
    """0.44 deg/s, and 0.325 thrown by 65 N m: a rotor that is faster behind the brake than as it closed is driven."""
    found: list[Violation] = []
    axis = AxisOracle(found.append, replace(limits.REFERENCE, untwists_deg_s_per_nm=0.005))
    alarm = Alarm(Code.CAN_06, 0.0, {}, Reaction.TORQUE_OFF)
    axis._axis = SimpleNamespace(alarms=SimpleNamespace(active={Code.CAN_06: alarm}))
    axis.bound, axis._speed_max, axis._rest, axis._sag = True, 0.44, 0.05, math.inf
    axis.begin(0.0, brake_open=True, energised=True)
    axis.sample(0.0, 0.0, -65.0, brake_open=True, energised=True)
    axis.sample(0.0, 0.5, 0.0, brake_open=True, energised=False)
    axis.sample(0.0, caught_deg_s, 0.0, brake_open=False, energised=False)
    axis.sample(0.0, speed_deg_s, 0.0, brake_open=False, energised=False)
    assert [each.invariant for each in found] == ([] if passes else ["INV-3"])


@pytest.mark.parametrize(("torque_nm", "passes"), [(65.0, True), (20.0, False)])
@pytest.mark.parametrize("in_ramp", [False, True])
def test_a_gear_throws_back_the_rotor_of_a_torque_that_went_before_it_was_told_or_within_a_ramp(
    in_ramp: bool, torque_nm: float, passes: bool
) -> None:
    """65 N m throw it by 0.325 deg/s, 0.049 deg in the 150 ms of the brake; 20 N m by 0.1, and it goes 0.045."""
    found: list[Violation] = []
    ways = {StopClass.QUICK: 0.12, StopClass.TORQUE_OFF: 0.019}
    bounds = replace(limits.REFERENCE, untwists_deg_s_per_nm=0.005, way_deg=lambda kind, _speed: ways[kind])
    axis = AxisOracle(found.append, bounds)
    alarm = Alarm(Code.INT_03, 0.0, {}, Reaction.TORQUE_OFF)
    axis._axis = SimpleNamespace(alarms=SimpleNamespace(active={Code.INT_03: alarm}))
    axis.bound, axis._rest, axis._sag = True, 0.05, math.inf
    axis.begin(0.0, brake_open=True, energised=True)
    begun_deg = 0.1 if in_ramp else 0.0
    if in_ramp:
        axis._stop = Stop(alarm, StopClass.QUICK, axis.now(), axis.now())
    axis.sample(begun_deg, 0.0, -torque_nm, brake_open=True, energised=True)
    axis.sample(begun_deg, 0.0, 0.0, brake_open=True, energised=False)
    if not in_ramp:
        axis._stop = Stop(alarm, StopClass.TORQUE_OFF, axis.now(), axis.now())
    for ms in range(1, 200):
        way = begun_deg + 0.3e-3 * min(ms, 149)
        axis.sample(way, 0.3 if ms < 149 else 0.0, 0.0, brake_open=ms < 150, energised=False)
    assert [each.invariant for each in found] == ([] if passes else ["INV-1"])


@pytest.mark.parametrize(
    ("torque_nm", "moves_ms", "passes"),
    [(65.0, 150, True), (65.0, 180, False), (20.0, 150, False)],
    ids=["thrown back", "goes on behind the closed brake", "no such torque was held"],
)
def test_the_way_of_a_rotor_that_its_gear_throws_back_ends_with_the_brake(
    torque_nm: float, moves_ms: int, passes: bool
) -> None:
    """At rest 0.019 deg are permitted; 65 N m throw it by 0.325 deg/s, 0.049 deg in the 150 ms of the brake."""
    found: list[Violation] = []
    bounds = replace(limits.REFERENCE, untwists_deg_s_per_nm=0.005, way_deg=lambda _kind, _speed: 0.019)
    axis = AxisOracle(found.append, bounds)
    alarm = Alarm(Code.ENC_14, 0.0, {}, Reaction.TORQUE_OFF)
    axis._axis = SimpleNamespace(alarms=SimpleNamespace(active={Code.ENC_14: alarm}))
    axis.bound, axis._rest, axis._sag = True, 0.05, math.inf
    axis.begin(0.0, brake_open=True, energised=True)
    axis.sample(0.0, 0.0, -torque_nm, brake_open=True, energised=True)
    axis._stop = Stop(alarm, StopClass.FEEDBACK, axis.now(), axis.now())
    for ms in range(1, 201):
        way = 0.3e-3 * min(ms, moves_ms)
        axis.sample(way, 0.3 if ms <= moves_ms else 0.0, 0.0, brake_open=ms <= 150, energised=False)
    assert [each.invariant for each in found] == ([] if passes else ["INV-1"])


@pytest.mark.parametrize(
    ("own_ramp", "way_deg", "passes"), [(False, 0.31, False), (True, 0.37, True), (True, 0.39, False)]
)
def test_a_drive_that_takes_no_command_goes_as_far_as_its_own_ramp(
    own_ramp: bool, way_deg: float, passes: bool
) -> None:
    """An azimuth drive from 0.8 deg/s: 0.30 deg by its brake, which nobody commands, 0.38 by its ramp."""
    found: list[Violation] = []
    ways = {StopClass.TORQUE_OFF: 0.30, StopClass.QUICK: 0.38}
    axis = AxisOracle(found.append, replace(limits.REFERENCE, way_deg=lambda kind, _speed: ways[kind]))
    axis.bound, axis._rest, axis._sag, axis.known.own_ramp = True, 0.05, math.inf, own_ramp
    axis.begin(0.0, brake_open=True, energised=True)
    alarm = Alarm(Code.CAN_13, 0.0, {}, Reaction.TORQUE_OFF)
    axis._stop = Stop(alarm, StopClass.TORQUE_OFF, axis.now(), axis.now())
    for ms in range(1001):
        axis.sample(way_deg * ms * 1e-3, 0.37 if ms < 1000 else 0.0, 0.0, brake_open=True, energised=True)
    assert [each.invariant for each in found] == ([] if passes else ["INV-1"])


@pytest.mark.parametrize(
    ("kind", "share", "rests_s", "passes"),
    [
        (StopClass.TORQUE_OFF, 1.0, 0.99, True), (StopClass.TORQUE_OFF, 1.0, 1.02, False),
        (StopClass.TORQUE_OFF, 0.5, 1.98, True), (StopClass.TORQUE_OFF, 0.5, 2.02, False),
        (StopClass.TORQUE_OFF, 0.0, 3.48, True), (StopClass.TORQUE_OFF, 0.0, 3.52, False),
        (StopClass.NO_RAMP, 1.0, 1.48, True), (StopClass.NO_RAMP, 1.0, 1.52, False),
        (StopClass.QUICK, 0.5, 1.52, False),
    ],
)  # fmt: skip
def test_a_stop_comes_to_rest_in_the_time_that_its_brake_has_left(
    kind: StopClass, share: float, rests_s: float, passes: bool
) -> None:
    """1 s by a whole brake, 1.5 s on the ramp; without a brake people are told after 3 s."""
    found: list[Violation] = []
    axis = AxisOracle(
        found.append,
        replace(limits.REFERENCE, rest_s={**dict.fromkeys(StopClass, 1.0), StopClass.QUICK: 1.5}),
    )
    axis.bound, axis._rest, axis._sag, axis.known.brake_share = True, 0.05, math.inf, share
    axis.begin(0.0, brake_open=True, energised=True)
    alarm = Alarm(Code.DRV_10, 0.0, {}, Reaction.TORQUE_OFF)
    axis._stop = Stop(alarm, kind, axis.now(), axis.now())
    for _ in range(round(rests_s * 1e3)):
        axis.sample(0.0, 0.06, 0.0, brake_open=True, energised=True)
    assert [each.invariant for each in found] == ([] if passes else ["INV-1"])


@pytest.mark.parametrize(("after_ms", "passes"), [(9, False), (10, True)])
def test_a_brake_opens_behind_torque_that_has_been_on_for_10_ms(after_ms: int, passes: bool) -> None:
    found: list[Violation] = []
    axis = bare(found)
    axis._axis = SimpleNamespace(settings=SimpleNamespace(period_s=0.004))
    axis.ms = 100
    axis._load.torque_on(axis.ms)
    axis.ms += after_ms
    axis._load.brake_opens(axis)
    assert [each.invariant for each in found] == ([] if passes else ["INV-6"])


@pytest.mark.parametrize(("age_ms", "living"), [(0, True), (250, True), (251, False)])
@pytest.mark.parametrize("key", ["forward", "reverse"])
def test_a_key_asks_for_its_speed_as_long_as_its_lease_lives(key: str, age_ms: int, living: bool) -> None:
    settings = axis_settings(default_machine())
    asked = Asked(settings, settled=1.0, told=1.0, sag=1.0)
    op = asked.levels._replace(power=True, mode=Mode.CONTINUOUS)
    for now, levels in ((1000, op), (1100, op._replace(lease=1, **{key: True}))):
        assert not asked.take(levels, now, 0.0, 0.0, moves=False, refused=None, in_force=settings.ramps)
    assert asked.held(1100 + age_ms, 5.0) is living
    # Both keys ask for nothing, whatever their lease.
    asked.levels = asked.levels._replace(forward=True, reverse=True)
    assert not asked.held(1100, 5.0)


@pytest.mark.parametrize("sectors", [((1.0, 1.5), (2.0, 2.5)), ((2.0, 2.5), (1.0, 1.5))])
@pytest.mark.parametrize(
    ("here", "stretch"),
    [
        (0.0, (-3.2, 1.0, False)), (1.7, (1.5, 2.0, False)), (3.0, (2.5, 3.2, False)), (1.2, (-3.2, 2.0, True)),
        (2.2, (1.5, 3.2, True)),
    ],
)  # fmt: skip
def test_an_axis_may_be_between_the_nearest_of_all_sectors(
    sectors: tuple[tuple[float, float], ...], here: float, stretch: tuple[float, float, bool]
) -> None:
    """In whatever order they stand; in one of them it may leave to either side."""
    assert stretch_around(TravelSettings(-3.1, 3.1, -3.2, 3.2, no_go_rad=sectors), here) == stretch


@pytest.mark.parametrize(("here", "turns"), [(0.0, 0), (7.0, 1), (-6.0, -1)])
def test_an_axis_without_ends_has_its_sector_in_every_turn(here: float, turns: int) -> None:
    """From 1 to 1.5 rad of a turn: between two of them there are 2 pi less half a radian."""
    endless = TravelSettings(-math.inf, math.inf, -math.inf, math.inf, no_go_rad=((1.0, 1.5),))
    low, high, within = stretch_around(endless, here)
    assert (low, high) == pytest.approx((1.5 + (turns - 1) * math.tau, 1.0 + turns * math.tau))
    assert not within


def bare(found: list[Violation]) -> AxisOracle:
    """An axis in degrees, commanded, under power at rest at 0; 10 deg/s and 100 N m at most, and -5 to 5 deg."""
    axis = AxisOracle(found.append)
    axis.begin(0.0, brake_open=True, energised=True)
    axis.bound, axis._sag, axis._rest = True, 0.15, 0.05
    axis._vel_max, axis._torque_max, axis._speed_max = 10.0, 100.0, 11.0
    axis._low, axis._high = -5.0, 5.0
    return axis


def speed_on_the_wire(axis: AxisOracle, sign: float, over: float) -> None:
    axis.command(OutputImage(DriveRequest.ENABLE, sign * 10.0 * over, 0.0, brake_open=True), None)


def torque_on_the_wire(axis: AxisOracle, sign: float, over: float) -> None:
    axis.command(OutputImage(DriveRequest.ENABLE, 0.0, sign * 100.0 * over, brake_open=True), None)


def speed_of_the_axis(axis: AxisOracle, sign: float, over: float) -> None:
    axis.sample(0.0, sign * 11.0 * over, 0.0, brake_open=True, energised=True)


def end_of_travel(axis: AxisOracle, sign: float, over: float) -> None:
    axis.sample(sign * 5.0 * over, 0.0, 0.0, brake_open=True, energised=True)


def creep(axis: AxisOracle, sign: float, over: float) -> None:
    for ms in range(101):
        axis.sample(sign * 0.15 * over * 0.01 * ms, 0.0, 0.0, brake_open=True, energised=True)


def speed_under_a_latch(axis: AxisOracle, sign: float, over: float) -> None:
    axis._latched = alarm = Alarm(Code.CTL_02, 0.0, {}, Reaction.QUICK_STOP)
    axis._latch(alarm, DriveRequest.QUICK_STOP, sign if over > 1.0 else 0.0)


def stop_that_does_not_end(axis: AxisOracle, sign: float, over: float) -> None:
    """1.5 s behind the alarm."""
    alarm = Alarm(Code.CTL_02, 0.0, {}, Reaction.QUICK_STOP)
    axis._stop = Stop(alarm, StopClass.QUICK, axis.now(), axis.now())
    for _ in range(1510):
        axis.sample(0.0, sign * 0.05 * over, 0.0, brake_open=True, energised=True)


def speed_in_silence(axis: AxisOracle, sign: float, over: float) -> None:
    """1.7 s behind the last command."""
    axis.ms, axis.speed = 1701, sign * 0.05 * over
    Silence(Instant(0, 0.0, 0.0, energised=True, brake_open=True)).sample(axis)


def way_at_rest_in_silence(axis: AxisOracle, sign: float, over: float) -> None:
    silence = Silence(Instant(0, 0.0, 0.0, energised=True, brake_open=True))
    axis.ms = 1701
    silence.sample(axis)
    axis.angle = sign * 0.15 * over
    silence.sample(axis)


def way_in_silence(axis: AxisOracle, sign: float, over: float) -> None:
    """0.35 deg from rest."""
    axis.ms, axis.angle = 100, sign * 0.35 * over
    Silence(Instant(0, 0.0, 0.0, energised=True, brake_open=True)).sample(axis)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("does", "invariant"),
    [
        (speed_on_the_wire, "INV-4"),
        (torque_on_the_wire, "INV-4"),
        (speed_of_the_axis, "INV-3"),
        (end_of_travel, "INV-3"),
        (creep, "INV-2"),
        (speed_under_a_latch, "INV-5"),
        (stop_that_does_not_end, "INV-1"),
        (speed_in_silence, "INV-1"),
        (way_in_silence, "INV-1"),
        (way_at_rest_in_silence, "INV-2"),
    ],
)
def test_what_is_wrong_one_way_is_wrong_the_other(
    does: Callable[[AxisOracle, float, float], None], invariant: str, sign: float
) -> None:
    """A hundredth within each limit, and a hundredth beyond it."""
    found: list[Violation] = []
    does(bare(found), sign, 0.99)
    assert not found
    does(bare(found), sign, 1.01)
    assert [each.invariant for each in found] == [invariant]


@pytest.mark.can
def test_a_drive_that_stops_without_commands_is_passed(oracle: Oracle) -> None:
    """Its own watch of the commands, the ramp, and the brake that it closes."""
    silent_bus(6.0).drive.link.close()
    assert not oracle.violations


def everything(bench: Bench) -> None:
    """A sound run."""
    speed = rad(6.0)
    bench.up().op(move=True, target_rad=rad(80.0), speed_rad_s=speed)
    bench.op(move=False)
    bench.engine.run_for(12.0)
    bench.op(move=True, target_rad=rad(100.0), speed_rad_s=speed)
    bench.op(move=False)
    bench.engine.run_for(2.0)
    bench.op(halt=True)
    bench.op(halt=False)
    bench.engine.run_for(6.0)
    bench.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(1.0))
    for lease in range(100):
        bench.op(forward=True, lease=lease)
        bench.engine.run_for(0.03)
    bench.engine.run_for(3.0)  # the lease has run out
    bench.op(forward=False)
    bench.op(mode=Mode.INCREMENTAL, increment_rad=rad(0.5))
    bench.op(reverse=True)
    bench.op(reverse=False)
    bench.engine.run_for(4.0)
    bench.op(move=True, target_rad=rad(90.0), speed_rad_s=speed, override=0.5)
    bench.op(move=False)
    bench.engine.run_for(1.0)
    bench.op(override=0.0)
    bench.engine.run_for(3.0)
    bench.op(override=1.0)
    bench.engine.run_for(1.0)
    bench.op(stop=True)
    bench.engine.run_for(2.0)
    bench.op(stop=False, power=False)
    bench.engine.run_for(2.0)
    bench.up().op(move=True, target_rad=rad(60.0), speed_rad_s=speed)
    bench.op(move=False)
    bench.engine.run_for(8.0)
    bench.op(quick_stop=True)
    bench.engine.run_for(4.0)
    bench.op(quick_stop=False, power=False)
    bench.engine.run_for(2.0)
    bench.op(reset=True)
    bench.op(reset=False)
    bench.engine.run_for(0.5)
    bench.up().op(power=False)
    bench.engine.run_for(2.0)
    assert bench.engine.program.axis.is_off


@pytest.mark.parametrize(
    ("kind", "ways"),
    [
        (StopClass.QUICK, {6.0: 3.75, 3.0: 1.04}),
        (StopClass.TORQUE_OFF, {6.0: 3.6, 3.0: 1.4, 1.0: 0.45}),
        (StopClass.FEEDBACK, {6.0: 4.5, 3.0: 2.1, 1.0: 0.8, 0.1: 0.35}),
    ],
)
def test_the_limits_are_those_of_the_fault_catalogue(kind: StopClass, ways: dict[float, float]) -> None:
    for speed, way in ways.items():
        assert limits.way_deg(kind, speed) == pytest.approx(way)
        assert limits.way_deg(kind, -speed) == pytest.approx(way)


def test_a_cause_that_lasts_keeps_its_onset() -> None:
    """A second fault gives the axis no way anew, but one of the feedback has its own, and one behind 3 s too."""
    known = KnownFaults()

    def at(ms: int, *, feedback: bool = False) -> int:
        known.inject(
            Instant(ms, 0.0, 0.0, energised=True, brake_open=True), Effect(feedback=feedback, at_once=True)
        )
        assert known.onset is not None
        return known.onset.ms

    assert [at(100), at(500), at(600, feedback=True), at(700, feedback=True), at(800), at(3700)] == [
        100, 100, 600, 600, 600, 3700,
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("lasts_s", "ms", "belongs"),
    [
        (0.5, 600, True),
        (0.5, 1600, False),
        (2.4, 2900, True),
        (math.inf, 2900, True),
        (math.inf, 3200, False),
    ],
)
def test_a_fault_that_is_over_explains_no_alarm_a_second_later(
    lasts_s: float, ms: int, belongs: bool
) -> None:
    """Behind it the axis moves soundly, and what stops it then has a cause of its own."""
    known = KnownFaults()
    begun = Instant(100, 0.0, 0.0, energised=True, brake_open=True)
    known.inject(begun, Effect(feedback=True, at_once=True), lasts_s)
    assert (known.recent_onset(ms) is not None) is belongs
    assert known.of_feedback(ms) is belongs


def test_a_fault_that_comes_again_goes_on() -> None:
    known = KnownFaults()
    for ms in (100, 1000):
        known.inject(
            Instant(ms, 0.0, 0.0, energised=True, brake_open=True), Effect(feedback=True, at_once=True), 0.5
        )
    onset = known.recent_onset(2400)
    assert onset is not None
    assert onset.ms == 100
    assert known.recent_onset(2600) is None


@pytest.mark.parametrize(
    ("own_ramp", "share", "most"), [(True, 0.02, 0.8), (True, 1.0, 0.35), (False, 0.02, 0.35)]
)
def test_an_unreached_drive_with_little_torque_runs_out_and_no_further(
    own_ramp: bool, share: float, most: float
) -> None:
    """Its bound holds for nobody else: not where commands reach it, nor with all of its torque."""
    for way, found in ((0.99 * most, list[Violation]()), (1.01 * most, list[Violation]())):
        axis = bare(found)
        axis.bounds = replace(axis.bounds, runs_out_deg=lambda speed, share: 0.8)
        axis.known.own_ramp, axis.known.torque_share = own_ramp, share
        alarm = Alarm(Code.CAN_05, 0.0, {}, Reaction.TORQUE_OFF)
        axis._stop = Stop(alarm, StopClass.TORQUE_OFF, axis.now(), axis.now())
        axis.sample(way, 0.5, 0.0, brake_open=True, energised=True)
        assert [each.invariant for each in found] == ["INV-1"] * (way > most)


def test_how_far_a_drive_runs_out_is_that_of_its_friction_and_its_load() -> None:
    """At the motor 7.70 of 385 N m, 5.50 + 6000 / 1144 = 10.74 N m of friction, 16.0 kN m / 1144 = 13.98 of the load.

    4.47 N m turn 2.654e6 kg m2 by 0.1103 deg/s2 slower: 0.5 deg/s take 1.133 deg, with the 55 ms of deadline, scan and
    drive before it 1.161, and 2 % more. An eccentricity of 22.5 for 8.15 mm, 44 kN m, drives it on.
    """
    bus = base_machine("bus", False, "drive", 4.0)
    assert runs_out_deg(bus, -0.5, 0.02) == pytest.approx(1.184, rel=2e-3)
    assert runs_out_deg(with_values(bus, {"plant.load.eccentricity_m": 0.0225}), 0.5, 0.02) == math.inf


@pytest.mark.parametrize(("nodes", "held_s"), [(False, 0.3902), (True, 0.1)])
@pytest.mark.parametrize("kind", ["rpdo_lost", "drive_silent"])
def test_a_drive_that_no_command_reaches_ends_by_its_relay_or_by_itself(
    kind: str, nodes: bool, held_s: float
) -> None:
    """From 1 deg/s: 55 ms of deadline, scan and drive, 1 / 5.4 s of ramp, 150 ms of its brake; 100 ms of a relay."""
    axis = bare([])
    axis.speed = -1.0
    target = SimpleNamespace(machine=base_machine("bus", nodes, "drive", 4.0))
    tell(axis, injection("frame", kind), target)  # type: ignore[arg-type]
    assert axis.known.held is not None
    assert axis.known.held.held_s == pytest.approx(held_s, abs=1e-4)


@pytest.mark.parametrize(("unreached", "most"), [(False, 0.35), (True, 0.8)])
def test_a_spoilt_encoder_drives_on_a_drive_that_no_command_reaches_and_no_other(
    unreached: bool, most: float
) -> None:
    """A program that could take the torque off and does not is found, and a drive that goes on behind its deadline."""
    for way, found in ((0.99 * most, list[Violation]()), (1.01 * most, list[Violation]())):
        axis = bare(found)
        axis.bounds = replace(axis.bounds, held_way_deg=lambda speed, held_s: 0.8 if held_s == 0.5 else 9.0)
        axis.known.inject(axis.now(), Effect(feedback=True, at_once=True))
        if unreached:
            axis.known.hold(axis.now(), 0.5)
        alarm = Alarm(Code.ENC_14, 0.0, {}, Reaction.TORQUE_OFF)
        axis._stop = Stop(alarm, StopClass.FEEDBACK, axis.now(), axis.now())
        axis.sample(way, 0.5, 0.0, brake_open=True, energised=True)
        assert [each.invariant for each in found] == ["INV-1"] * (way > most)


def test_every_axis_has_a_bound_of_what_a_spoilt_encoder_may_drive_while_nobody_can_act() -> None:
    """2.48e6 kg m2 by 385 N m and the load: 10.6 deg/s2, 1.196 deg in 0.39 s, and the brake from 5.1 deg/s, 2.1 deg."""
    bounds = limits.bounds_of(base_machine("bus", False, "drive", 4.0))
    assert bounds.held_way_deg is not None
    assert bounds.driven_acc_deg_s2 == pytest.approx(10.6, abs=0.05)
    assert bounds.held_way_deg(1.0, 0.3902) == pytest.approx(1.02 * (1.196 + 2.1), rel=0.01)
