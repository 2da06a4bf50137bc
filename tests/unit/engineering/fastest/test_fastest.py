"""The fastest profile within limits, against hand computation on a plant without gears."""

from __future__ import annotations

import math

import pytest

from gantryctl.engineering.comparison.key_figures import Move
from gantryctl.engineering.fastest import search
from gantryctl.engineering.fastest.search import Limits, bound_s, fastest_moves
from gantryctl.engineering.fastest.text import fastest_data, fastest_notes
from gantryctl.errors import UsageError
from gantryctl.machine import Machine, default_machine, with_values
from support.command_line import refused
from support.improved import improved_machine

MOVE_DEG = (0.0, 90.0)
# J_l = 2.18e6 kg m2, motor side 1144^2 x 0.274 = 0.36e6; base 6e5 kg m2 on 7 Hz; ring radius 2.366 m; 6 deg/s.
INERTIA, RADIUS_M = 2.18e6, 2.366
BASE_NM_PER_RAD = 6.0e5 * (2.0 * math.pi * 7.0) ** 2


def smooth_machine() -> Machine:
    """Load, gear and base, and nothing that excites them but the profile."""
    off = (
        "gear_error",
        "backlash",
        "hysteresis",
        "roller_friction",
        "motor_friction",
        "eccentric_moment",
        "torque_ripple",
    )
    return with_values(default_machine(), {f"plant.switches.{name}": False for name in off})  # fmt: skip


def acc_of(base_um: float) -> float:
    """The base carries K B / 2 either way, which is J a."""
    return math.degrees(BASE_NM_PER_RAD * 0.5 * base_um * 1e-6 / RADIUS_M / INERTIA)


def test_base_motion_is_what_the_load_needs_to_gain_speed() -> None:
    """150 um carry 0.97 deg/s2. Ramps of a second rock base and load by 2 to 3 % more than that."""
    limits = Limits(base_um=150.0)
    ((found,),) = fastest_moves(smooth_machine(), MOVE_DEG, [limits], [1.0]).found
    assert found.binding == "base"
    assert found.move.base_um <= 150.0
    assert found.acc_deg_s2 == pytest.approx(acc_of(150.0), rel=0.04)
    assert found.acc_deg_s2 < acc_of(150.0)
    # 90 deg at 6 deg/s, a ramp up and a ramp down of which each costs half its time, and the second of the jerk.
    assert found.move.time_s == pytest.approx(15.0 + 6.0 / found.acc_deg_s2 + 1.0, abs=1e-6)


def test_no_profile_is_faster_than_the_bound() -> None:
    machine = smooth_machine()
    ladder = [Limits(base_um=base_um) for base_um in (60.0, 120.0, 240.0)]
    found = fastest_moves(machine, MOVE_DEG, ladder, [0.5]).found
    times = [row.move.time_s for (row,) in found]
    assert times == sorted(times, reverse=True)
    for limits, (row,) in zip(ladder, found, strict=True):
        assert row.bound_s == bound_s(machine, MOVE_DEG, limits.base_um)
        # The ramp of the jerk itself is what a profile needs more; the rest is the base's own swing.
        assert row.bound_s < row.move.time_s < row.bound_s + 0.5 + 0.5
    # 15 s and 6 / 0.775 s with 120 um.
    assert bound_s(machine, MOVE_DEG, 120.0) == pytest.approx(15.0 + 6.0 / acc_of(120.0), rel=1e-6)
    # Too short for 6 deg/s: 5 deg up to the middle and down again.
    assert bound_s(machine, (10.0, 5.0), 120.0) == pytest.approx(
        2.0 * math.sqrt(5.0 / acc_of(120.0)), rel=1e-6
    )


def test_a_small_reducer_and_a_small_motor_bind_before_the_base() -> None:
    """The reducer turns the load by a 13th: 3 kN m are 1.025 deg/s2; 30 N m of the motor turn load and rotor."""
    machine = smooth_machine()
    wide = Limits(base_um=400.0)
    (by_reducer,), (by_motor,) = fastest_moves(
        machine, MOVE_DEG, [wide._replace(reducer_knm=3.0), wide._replace(motor_nm=30.0)], [1.0]
    ).found
    assert (by_reducer.binding, by_motor.binding) == ("reducer", "motor")
    assert by_reducer.acc_deg_s2 == pytest.approx(math.degrees(3.0e3 * 13.0 / INERTIA), rel=0.04)
    rotor = machine.motor.inertia_kg_m2 + machine.plant.motor.wave_generator_inertia_kg_m2
    whole = INERTIA + rotor * 1144.0**2
    assert by_motor.acc_deg_s2 == pytest.approx(math.degrees(30.0 * 1144.0 / whole), rel=0.04)


def test_what_no_profile_keeps_is_refused() -> None:
    with pytest.raises(UsageError, match="times the permitted after; permit more"):
        fastest_moves(smooth_machine(), MOVE_DEG, [Limits(base_um=150.0, after_um=1e-6)], [0.5])


def test_limits_that_no_profile_keeps_hide_no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """1e-6 um behind the move is kept by nothing; without that limit there are profiles."""
    machine, none, some = smooth_machine(), Limits(base_um=150.0, after_um=1e-6), Limits(base_um=150.0)
    monkeypatch.setattr(search, "_STEPS", 2)
    found = fastest_moves(machine, MOVE_DEG, [none, some], [1.0])
    ((row,),) = found.found
    assert row.limits == some
    ((limits, acc, ramp, name, share),) = found.unkept
    # A tenth of what the base is just enough for.
    assert (limits, ramp, name) == (none, 1.0, "after")
    assert acc == pytest.approx(0.1 * acc_of(150.0))
    told = fastest_notes(machine, found)[0]
    assert told == (
        f"No row with 150 um and ramps of 1.000 s: with 0.0967 deg/s2 the move takes at least {share:.3g} times the "
        "permitted after."
    )
    data = fastest_data(machine, MOVE_DEG, found)
    assert [each["limits"]["after_um"] for each in data["rows"]] == [None]
    assert [each["limits"]["after_um"] for each in data["unkept"]] == [1e-6]


@pytest.mark.parametrize(
    ("given", "says"),
    [
        (("--move", "0", "200"), "--move: 200 deg is beyond travel"),
        (("--move", "20", "20"), "is no move"),
        (("--base-um", "0"), "--base-um 0: must be above 0 um"),
        (("--after-um", "-1"), "--after-um -1: must be above 0 um"),
    ],
)
def test_wrong_questions_are_refused(given: tuple[str, ...], says: str) -> None:
    assert says in refused("profile", *given)


def test_the_delivered_machine_is_quick_true_and_calm_at_once() -> None:
    """At the base motion of the paper's loop, both ways, an axis in use. Measured 22.87 s, 0.0106 deg/s and 2.4 um with
    ramps of one period of the first mode; a direction that turns round over 0.01 deg made it 0.022 deg/s.
    """
    ((found,),) = fastest_moves(improved_machine(), MOVE_DEG, [Limits(base_um=165.0)], [0.494]).found
    assert found.binding == "base"
    assert found.move.time_s <= 24.0
    assert found.move.load_error_deg_s <= 0.012
    assert found.move.residual_um <= 5.0


def test_a_base_that_does_not_move_is_told_to_bound_nothing() -> None:
    """90 deg at 6 deg/s take 15 s."""
    stiff = with_values(smooth_machine(), {"plant.switches.base": False})
    found = fastest_moves(stiff, MOVE_DEG, [Limits()], [1.0])
    _, bound, _ = fastest_notes(stiff, found)
    assert bound.startswith("No profile is faster than 15.00 s, which the way takes at the highest speed")


def test_a_move_is_judged_by_the_worst_of_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    """Up takes more torque, down swings more: neither way alone is what the axis does."""

    def played(moves: list[Move]) -> list[tuple[float, ...]]:
        return [
            (float(move.from_deg < move.to_deg), float(move.from_deg > move.to_deg), 1.0) for move in moves
        ]

    monkeypatch.setattr(search, "moves_figures", played)
    monkeypatch.setattr(search, "expected", lambda found: found)
    monkeypatch.setattr(search, "MoveFigures", lambda *figures: figures)
    for ends_deg in ((0.0, 90.0), (90.0, 0.0)):
        assert search.own_move(default_machine(), ends_deg) == (1.0, 1.0, 1.0)
