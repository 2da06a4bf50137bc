"""Steps that turn the axis, on axes other than the gantry: no faster than they may, no further than is said."""

from __future__ import annotations

import itertools
import math
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gantryctl.commissioning import STEPS, steps_motion, steps_power, steps_sign
from gantryctl.commissioning.load_side import ring
from gantryctl.commissioning.results import Outcome, figure_text, torque_text
from gantryctl.commissioning.steps_lacks import _stop_from, ramp
from gantryctl.commissioning.stopping.quick_stop import trial_speed_deg_s
from gantryctl.drives.od.verdicts import ParameterVerdict
from gantryctl.image import DriveRequest
from gantryctl.machine import Machine, with_values
from unit.commissioning.hand_drive import AWAY, MACHINE, PERIOD_S, HandDrive, axis_of, context, opens

pytestmark = pytest.mark.can


def axis_with(top_deg_s: float, **changes: object) -> Machine:
    named = {f"{table}.{key}": value for name, value in changes.items() for table, key in [name.split("__")]}
    return with_values(MACHINE, {"speed.setting_max_deg_s": top_deg_s, **named})


def commanded(drive: HandDrive) -> list[float]:
    """Speeds that were commanded, deg/s of the gantry, while the drive was to follow."""
    return [
        math.degrees(out.vel_cmd_rad_s) / 1144 for out in drive.wrote if out.request is DriveRequest.ENABLE
    ]


@pytest.mark.parametrize(
    ("top_deg_s", "allowed_deg_s", "speeds"),
    [
        (6.0, math.inf, [1.0, -1.0, 3.0, -3.0]), (2.0, math.inf, [1.0, -1.0, 2.0, -2.0]),
        (1.2, math.inf, [0.6, -0.6, 1.2, -1.2]),
        # Nothing moves faster, by what the drive lacks.
        (6.0, 2.5, [1.0, -1.0, 2.5, -2.5]), (6.0, 0.9, [0.45, -0.45, 0.9, -0.9]),
    ],
)  # fmt: skip
def test_stops_are_shown_up_to_the_highest_speed_in_force(
    monkeypatch: pytest.MonkeyPatch, top_deg_s: float, allowed_deg_s: float, speeds: list[float]
) -> None:
    asked: list[float] = []

    def stop(c: object, speed: float, decs: list[float]) -> tuple[str, float, float]:
        asked.append(speed)
        return f"stop {len(asked)}", 0.1, 0.1

    monkeypatch.setattr(steps_motion, "_quick_stop", stop)
    monkeypatch.setattr(steps_motion, "_silent_stop", stop)
    monkeypatch.setattr(steps_motion, "_jog_release", lambda c, speed: 0.01)
    steps_motion.stops(
        replace(context(axis_with(top_deg_s, speed__setting_min_deg_s=0.5)), speed_max_deg_s=allowed_deg_s)
    )
    assert asked == speeds


@pytest.mark.parametrize(
    ("release_deg_s2", "quick_deg_s2", "fastest"), [(2.0, 5.4, 3.6), (0.5, 0.73, 2.2), (0.4, 5.4, 2.5)]
)
def test_a_trial_stop_takes_ten_degrees_at_most(
    release_deg_s2: float, quick_deg_s2: float, fastest: float
) -> None:
    """Ramps up and down, half a second between them and 60 ms of reaction; the second one is a crane."""
    changes = {"jog_release_dec_deg_s2": release_deg_s2, "quick_dec_deg_s2": quick_deg_s2, "acc_deg_s2": 0.3,
               "dec_deg_s2": 0.3}  # fmt: skip
    named = {f"virtual_axis.{name}": value for name, value in changes.items()}
    machine = with_values(
        MACHINE,
        {
            "speed.setting_max_deg_s": 3.6,
            "required.stopping_angle_deg": 10.0,
            **named,
            "axis.mechanical_stop_min_deg": -195.0,
            "axis.mechanical_stop_max_deg": 195.0,
        },
    )
    found = trial_speed_deg_s(machine)
    assert found == fastest
    # In whole tenths: 0.1 deg/s more takes half a degree.
    way = found**2 / (2.0 * min(1.0, release_deg_s2)) + 0.56 * found + found**2 / (2.0 * quick_deg_s2)
    assert 9.2 < way <= 10.0


@pytest.mark.parametrize(("speed", "held_s"), [(0.6, 3.0), (6.0, 1.333)])
def test_a_key_is_held_no_further_than_eight_degrees(
    monkeypatch: pytest.MonkeyPatch, speed: float, held_s: float
) -> None:
    asked: list[tuple[float, float]] = []
    run = SimpleNamespace(angle_deg=0.0, jog=lambda forward, speed, seconds: asked.append((speed, seconds)))
    trace = {"vel_ref_rad_s": np.array([1.0, 0.0]), "pos_act_rad": np.array([0.0, 0.1])}
    recorder = SimpleNamespace(trace=lambda: trace)
    monkeypatch.setattr(steps_motion, "_recorded_run", lambda c, part: nullcontext((run, recorder)))
    steps_motion._jog_release(context(), speed)
    assert asked == [(speed, pytest.approx(held_s, abs=0.001))]


@pytest.mark.parametrize(("angle_deg", "forward"), [(41.0, True), (60.0, True), (80.0, False), (99.0, False)])
def test_a_key_is_held_away_from_the_end_of_a_travel_beside_0_deg(
    monkeypatch: pytest.MonkeyPatch, angle_deg: float, forward: bool
) -> None:
    asked: list[bool] = []
    run = SimpleNamespace(angle_deg=angle_deg, jog=lambda forward, speed, seconds: asked.append(forward))
    trace = {"vel_ref_rad_s": np.array([1.0, 0.0]), "pos_act_rad": np.array([0.0, 0.1])}
    monkeypatch.setattr(
        steps_motion,
        "_recorded_run",
        lambda c, part: nullcontext((run, SimpleNamespace(trace=lambda: trace))),
    )
    steps_motion._jog_release(context(AWAY), 0.6)
    assert asked == [forward]


def test_the_slow_turn_goes_from_end_to_end_of_a_travel_beside_0_deg(monkeypatch: pytest.MonkeyPatch) -> None:
    """2 deg before either end of 40 to 100 deg, and to where a new machine stands."""
    asked: list[float] = []

    def move(target: float, speed_deg_s: float) -> SimpleNamespace:
        asked.append(target)
        return SimpleNamespace(done=False)

    run: Any = SimpleNamespace(speed_max_deg_s=6.0, move=move, observe=lambda look: None)
    monkeypatch.setattr(steps_motion, "_recorded_run", lambda c, part: nullcontext((run, None)))
    steps_motion.slow_turn(context(AWAY))
    assert asked == [98.0, 42.0, 70.0]


@pytest.mark.parametrize(("release_deg_s2", "most"), [(2.0, 1.0), (0.5, 0.5)])
@pytest.mark.parametrize("step", ["stops", "ramp"])
def test_a_trial_stop_is_reached_no_harder_than_a_key_is_let_go(
    monkeypatch: pytest.MonkeyPatch, step: str, release_deg_s2: float, most: float
) -> None:
    """From 0 to 1 deg/s; the way there and half a second of cruise lie on the leash."""
    machine = axis_with(6.0, virtual_axis__jog_release_dec_deg_s2=release_deg_s2)
    drive = HandDrive()
    monkeypatch.setattr(f"gantryctl.commissioning.{'steps_lacks' if step == 'ramp' else 'steps_motion'}"
                        ".open_loop_axis", opens(drive))  # fmt: skip
    if step == "ramp":
        _stop_from(context(machine), 1.0)
    else:
        steps_motion._quick_stop(context(machine), 1.0, [])
    speeds = commanded(drive)
    assert max(abs(b - a) for a, b in itertools.pairwise(speeds)) == pytest.approx(most * PERIOD_S, rel=0.01)
    # 0.3 deg to spare; the stop with 60 ms before it.
    dec = release_deg_s2 if step == "ramp" else MACHINE.virtual_axis.quick_dec_deg_s2
    assert drive.leashes[0][0] == pytest.approx(0.5 / most + 0.5 + 0.5 / dec + 0.06 + 0.3, abs=1e-6)


def test_an_axis_slower_than_the_slowest_trial_shows_its_ramp_from_its_highest_setting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from unit.commissioning.test_ramps_by_hand import Ramps

    ramps = Ramps(monkeypatch)
    slow = axis_with(0.2, speed__setting_min_deg_s=0.02, speed__creep_deg_s=0.01,
                     monitors__velocity_deviation_deg_s=0.1)  # fmt: skip
    assert ramp(context(slow)).outcome is Outcome.PASSED
    assert ramps.speeds == [0.2]


@pytest.mark.parametrize("creep_deg_s", [0.02, 0.1, 1.0])
@pytest.mark.parametrize("acc_deg_s2", [0.393, 5.0])
def test_the_step_to_creep_speed_ends_within_the_degree_that_it_says(
    step: Any, creep_deg_s: float, acc_deg_s2: float
) -> None:
    """A creep of 1 deg/s with 0.393 deg/s2 would take 2.5 deg to be reached and left."""
    drive = HandDrive()
    drive.machine = axis_with(6.0, speed__creep_deg_s=creep_deg_s, virtual_axis__acc_deg_s2=acc_deg_s2)
    found = step(steps_power, "velocity", drive)
    assert found.outcome is Outcome.PASSED
    # A scan or two more, by rounding up.
    assert 0.09 < drive.deg < 1.01
    assert drive.deg < drive.leashes[0][0] <= 1.2
    fastest = max(commanded(drive))
    # sqrt(0.5 deg x 0.393 deg/s2)
    assert fastest == pytest.approx(min(creep_deg_s, math.sqrt(0.5 * acc_deg_s2)), rel=1e-6)
    assert found.number("speed_deg_s") == pytest.approx(fastest, rel=1e-3)


@pytest.mark.parametrize(
    ("top_deg_s", "acc_deg_s2", "most"), [(6.0, 0.393, 0.3), (0.2, 0.393, 0.2), (6.0, 0.05, 0.2739)]
)
def test_the_ring_is_turned_by_its_way_whatever_the_axis_can(
    monkeypatch: pytest.MonkeyPatch, top_deg_s: float, acc_deg_s2: float, most: float
) -> None:
    """1.5 deg: with 0.05 deg/s2 it is half ramp up and half ramp down, with a peak of sqrt(0.075)."""
    changes: dict[str, object] = {"virtual_axis__acc_deg_s2": acc_deg_s2}
    if top_deg_s < 1.0:
        changes |= {"speed__setting_min_deg_s": 0.02, "speed__creep_deg_s": 0.01,
                    "monitors__velocity_deviation_deg_s": 0.1}  # fmt: skip
    machine = with_values(
        axis_with(top_deg_s, **changes), {"can.load_encoder.source": "node", "can.load_encoder.node": 4}
    )
    drive = HandDrive()
    stood: list[float] = []

    def standing(axis: Any) -> Any:
        stood.append(axis.angle_deg)
        return ring._Standing(axis.angle_deg, axis.angle_deg)

    monkeypatch.setattr(ring, "open_loop_axis", opens(drive))
    monkeypatch.setattr(ring, "_standing", standing)
    assert ring.ring(context(machine)).outcome is Outcome.PASSED
    # A scan or two at the peak more.
    assert stood == pytest.approx([0.0, 1.5, 0.0], abs=0.006)
    assert max(map(abs, commanded(drive))) == pytest.approx(most, abs=1e-4)


@pytest.mark.parametrize(
    ("least", "most", "allowed", "speed", "lasts_s"),
    # To one end of 360 deg, to the other and to the middle; ramps of 0.393 deg/s2.
    [
        (0.6, 6.0, 6.0, 3.0, 262.9), (0.2, 2.0, 2.0, 2.0, 375.3), (4.0, 6.0, 6.0, 4.0, 210.5),
        # The ledger of the drive lets nothing move faster than 2.5 deg/s.
        (0.6, 6.0, 2.5, 2.5, 262.9),
    ],
)  # fmt: skip
def test_the_slow_turn_has_a_speed_that_the_axis_takes(
    monkeypatch: pytest.MonkeyPatch, least: float, most: float, allowed: float, speed: float, lasts_s: float
) -> None:
    asked: list[float] = []

    def move(target: float, speed_deg_s: float) -> SimpleNamespace:
        asked.append(speed_deg_s)
        return SimpleNamespace(done=False)

    run: Any = SimpleNamespace(speed_max_deg_s=allowed, move=move, observe=lambda look: None)
    monkeypatch.setattr(steps_motion, "_recorded_run", lambda c, part: nullcontext((run, None)))
    machine = axis_with(most, speed__setting_min_deg_s=least)
    assert steps_motion.slow_turn(context(machine)).number("speed_deg_s") == speed
    assert asked == [speed] * 3
    turn = next(step for step in STEPS if step.key == "turn")
    assert turn.lasts_s(machine) == pytest.approx(lasts_s, abs=0.1)


def test_a_ceiling_that_is_lower_than_that_of_the_sign_test_stays(step: Any) -> None:
    """6080 of an axis of 0.27 deg/s is 52 r/min, that of the test 0.6 deg/s, 115 r/min."""
    drive = HandDrive()
    drive.sdo.values[0x6080] = 52
    seen: list[int] = []
    drive.spoil = lambda feedback: (seen.append(drive.sdo.values[0x6080]), feedback)[1]
    step(steps_sign, "sign", drive)
    assert set(seen) == {52}
    assert drive.sdo.values[0x6080] == 52


@pytest.mark.parametrize(
    ("ratio", "pulse_deg", "leash_deg"), [(1144.0, 0.03, 0.05), (500.0, 0.03, 0.05), (180.0, 0.0833, 0.1389)]
)
def test_the_motor_of_a_low_ratio_turns_as_far_as_that_of_a_gantry(
    monkeypatch: pytest.MonkeyPatch, ratio: float, pulse_deg: float, leash_deg: float
) -> None:
    """15 deg of the motor at the least, on a leash of 25; friction takes 1.3 deg of it."""
    seen: dict[str, float] = {}
    machine = SimpleNamespace(axis=SimpleNamespace(ratio=ratio), motor=SimpleNamespace(torque_rated_nm=0.8))
    axis = SimpleNamespace(
        ratio=ratio, period_s=PERIOD_S, angle_deg=0.0, speed_deg_s=0.0, enable=lambda: None, disable=lambda: None,
        drive=SimpleNamespace(
            node=SimpleNamespace(sdo=SimpleNamespace(optional=lambda index: None)),
            opened=SimpleNamespace(settings=None, units=SimpleNamespace(torque_unit_nm=0.001),
                                   rows=[SimpleNamespace(place="608F:01", verdict=ParameterVerdict.OK)]),
        ),
    )  # fmt: skip

    def scan(request: DriveRequest, speed_deg_s: float) -> None:
        axis.speed_deg_s = speed_deg_s
        axis.angle_deg += speed_deg_s * PERIOD_S
        seen["most"] = max(seen.get("most", 0.0), axis.angle_deg)

    axis.scan = scan

    def opened(c: object, leash: float, part: str, *, following: bool) -> Any:
        seen["leash"] = leash
        return nullcontext(axis)

    monkeypatch.setattr(steps_sign, "open_loop_axis", opened)
    found = steps_sign.sign(context(machine))  # type: ignore[arg-type]
    assert found.outcome is Outcome.PASSED
    assert seen["most"] == pytest.approx(pulse_deg, rel=2e-3)
    assert seen["leash"] == pytest.approx(leash_deg, rel=1e-3)
    assert found.number("ratio_position") == pytest.approx(1.0, rel=1e-3)
    # 0.2 deg/s of a gantry, 100 deg/s of the motor.
    assert f"torque off at {leash_deg:.2g} deg or {max(0.2, 100.0 / ratio):.2g} deg/s" in found.proof


@pytest.mark.parametrize(
    ("value", "decimals", "signed", "told"),
    [
        (16.02, 2, False, "16.02"), (0.00604, 2, False, "0.006"), (-0.0031, 2, True, "-0.0031"),
        (0.096, 2, True, "+0.096"), (35.2, 1, False, "35.2"), (0.12, 1, False, "0.12"), (128.4, 0, True, "+128"),
    ],
)  # fmt: skip
def test_a_figure_has_two_digits_on_a_small_axis_too(
    value: float, decimals: int, signed: bool, told: str
) -> None:
    assert figure_text(value, decimals, signed=signed) == told


@pytest.mark.parametrize(("torque_nm", "told"), [(128.4, "128 N m"), (9.7, "9.7 N m"), (-0.394, "-0.39 N m")])
def test_a_torque_has_two_digits_on_a_small_axis_too(torque_nm: float, told: str) -> None:
    assert torque_text(torque_nm) == told


@pytest.mark.parametrize(("torque_nm", "told"), [(128.4, "128 N m"), (0.394, "0.39 N m")])
def test_a_torque_limit_of_a_small_motor_is_not_told_as_none(torque_nm: float, told: str) -> None:
    """Half of what it is rated for."""
    drive = HandDrive(torque_nm=torque_nm)
    drive.opened.units.torque_unit_nm = torque_nm / 500.0
    axis = axis_of(drive)
    axis.enable()
    assert steps_sign._push(axis, {0x6072: 500}, {}) == f"; 6072 lowered to {told}, {told} given"
