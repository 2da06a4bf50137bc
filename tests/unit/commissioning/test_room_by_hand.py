"""Room of steps with the position loop open, by hand: where they may begin, and the limit switches on the way."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.commissioning import STEPS
from gantryctl.commissioning.room import sag_deg, stand_deg, why_no_room
from gantryctl.commissioning.steps_lacks import push_deg
from gantryctl.commissioning.stopping.quick_stop import trial_speed_deg_s
from gantryctl.errors import AlarmStop
from gantryctl.image import DigitalInputs, DriveRequest
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.home_reference import RestVerdict
from support.modulo_machine import modulo_machine
from unit.commissioning.hand_drive import MACHINE, enabled

pytestmark = pytest.mark.can

SECTOR = with_values(MACHINE, {"axis.no_go_deg": ((40.0, 50.0),)})
ROUND = modulo_machine({"axis.no_go_deg": [[170.0, -170.0]]}, "hust_can")


def at(angle_deg: float | None, verdict: RestVerdict = RestVerdict.OK) -> Any:
    return SimpleNamespace(
        angle_deg=angle_deg,
        verdict=verdict,
        moved_deg=0.2,
        margin_minus_deg=1.0,
        margin_plus_deg=1.0,
        serial="S",
    )


@pytest.mark.parametrize(
    ("machine", "angle_deg", "leash_deg", "met"),
    [
        # Travel is -180 to 180 deg, its limit switches stand at -182 and 182.
        (MACHINE, 174.8, 7.1, ""), (MACHINE, 174.8, 7.3, "limit switch at 182 deg"),
        (MACHINE, -174.8, 7.1, ""), (MACHINE, -174.8, 7.3, "limit switch at -182 deg"),
        # Standing at the very end, without the intention to turn.
        (MACHINE, 181.95, 0.1, ""),
        (SECTOR, 32.0, 7.9, ""), (SECTOR, 32.0, 8.1, "no-go sector 40 to 50 deg"),
        (SECTOR, 58.0, 7.9, ""), (SECTOR, 58.0, 8.1, "no-go sector 40 to 50 deg"),
        # Over the end of the turn: the sector goes from 170 to 190 deg, which is -170.
        (ROUND, 165.0, 4.9, ""), (ROUND, 165.0, 5.1, "no-go sector 170"),
        (ROUND, -165.0, 4.9, ""), (ROUND, -165.0, 5.1, "no-go sector 170"),
        # An axis without ends has no limit switch.
        (ROUND, 0.0, 169.0, ""),
    ],
)  # fmt: skip
def test_a_step_begins_where_its_leash_meets_nothing(
    machine: Machine, angle_deg: float, leash_deg: float, met: str
) -> None:
    why = why_no_room(machine, at(angle_deg), leash_deg)
    assert met in why
    assert bool(why) is bool(met)


@pytest.mark.parametrize("way", [3.0, -3.0])
def test_a_step_that_turns_one_way_needs_its_room_there(way: float) -> None:
    """A tilting table of -5 to 95 deg begins at 0: 7.1 deg fit ahead of it, and 6.5 behind."""
    ahead = math.copysign(174.8, way)
    assert "limit switch" in why_no_room(MACHINE, at(ahead), 7.3, way=way)
    assert why_no_room(MACHINE, at(ahead), 7.1, way=way) == ""
    assert why_no_room(MACHINE, at(-ahead), 300.0, way=way) == ""
    # It may swing back.
    assert "limit switch" in why_no_room(MACHINE, at(math.copysign(181.95, -way)), 7.3, way=way)


def test_why_a_step_does_not_begin_is_told_with_place_and_way() -> None:
    assert why_no_room(MACHINE, at(-176.04), 7.26) == (
        "the axis stands at -176.0 deg and may turn by 7.3 deg, to the limit switch at -182 deg: turn it away from "
        "there first"
    )


@pytest.mark.parametrize("verdict", [each for each in RestVerdict if each is not RestVerdict.OK])
def test_what_turns_needs_an_angle_and_what_stands_does_not(verdict: RestVerdict) -> None:
    unknown = at(None if verdict is RestVerdict.NO_ZERO else 0.0, verdict)
    assert why_no_room(MACHINE, unknown, 1.2).startswith("nobody knows how far the axis may turn: ")
    assert why_no_room(MACHINE, unknown, 0.1) == ""


@pytest.mark.parametrize("end", ["minus", "plus"])
@pytest.mark.parametrize("request_", [DriveRequest.ENABLE, DriveRequest.QUICK_STOP])
def test_a_limit_switch_that_opens_on_the_way_takes_the_torque_off(end: str, request_: DriveRequest) -> None:
    drive, axis = enabled()
    axis.run(0.1, speed_deg_s=0.2)
    drive.spoil = lambda seen: seen._replace(inputs=DigitalInputs(**{f"limit_{end}_ok": False}))
    with pytest.raises(
        AlarmStop, match=f"the limit switch at the {end} end has opened .* torque off and brake"
    ):
        axis.scan(request_, 0.2)
    assert drive.wrote[-1].request is DriveRequest.DISABLE


def test_a_hand_may_try_the_limit_switches_of_a_drive_that_is_off() -> None:
    drive, axis = enabled()
    axis.run(0.1, DriveRequest.DISABLE)
    drive.spoil = lambda seen: seen._replace(inputs=DigitalInputs(limit_plus_ok=False, limit_minus_ok=False))
    axis.run(0.1, DriveRequest.DISABLE)


@pytest.mark.parametrize(
    ("travel_deg", "fastest"),
    [
        # Within 10 deg, as on any long travel: 4.1^2/2 + 0.56 x 4.1 + 4.1^2/10.8 = 12.3 is too far, 3.6 takes 9.7.
        (360.0, 3.6),
        # 0.8 of half of 10 deg are 4 deg: 2.1 deg/s take 3.79, 2.2 take 4.10.
        (10.0, 2.1),
        # Of half of 3 deg 1.2: 1.0 deg/s takes 1.15, 1.1 takes 1.33.
        (3.0, 1.0),
    ],
)
def test_a_trial_stop_stays_within_a_short_travel(travel_deg: float, fastest: float) -> None:
    half = travel_deg / 2.0
    ends = {"axis.pos_min_deg": -half, "axis.pos_max_deg": half}
    beside = {
        f"axis.{name}_{end}_deg": sign * (half + more)
        for name, more in (("over_travel", 0.5), ("limit_switch", 2.0), ("mechanical_stop", 7.0))
        for end, sign in (("min", -1.0), ("max", 1.0))
    }
    assert trial_speed_deg_s(with_values(MACHINE, ends | beside)) == fastest


def test_a_trial_stop_stays_between_no_go_sectors() -> None:
    """From 4 to 14 deg, with half a degree to each sector: 0.8 of 4.5 deg are 3.6; 2.0 deg/s take 3.49, 2.1 3.79."""
    machine = with_values(MACHINE, {"axis.no_go_deg": ((-6.0, -5.0), (5.0, 6.0))})
    assert trial_speed_deg_s(machine) == 2.0


TABLE = load_machine(configs_folder() / "rotary_table.toml")
# A brake of 400 ms on the reference gantry.
LATE = with_values(
    MACHINE,
    {"brake.close_time_ms": 400.0, "monitors.brake_feedback_time_ms": 400.0, "speed.setting_max_deg_s": 3.0},
)


def fallen_deg(machine: Machine) -> float:
    """Way of the load of the check moment until a brake holds it that closes in its time, step by step."""
    axis, load, way, speed, time = machine.axis, machine.plant.load, 0.0, 0.0, 0.0
    rotor = machine.motor.inertia_kg_m2 + machine.plant.motor.wave_generator_inertia_kg_m2
    inertia, step = load.inertia_kg_m2 + rotor * axis.ratio**2, 1e-5
    closes = machine.brake.close_time_ms * 1e-3
    while time < closes or speed > 0.0:
        held = axis.ratio * machine.brake.torque_nm if time >= closes else 0.0
        speed += (load.eccentric_check_moment_nm - held) / inertia * step
        way += speed * step
        time += step
    return math.degrees(way)


@pytest.mark.parametrize("machine", [MACHINE, TABLE, LATE], ids=["gantry", "table", "late"])
def test_a_standing_axis_may_sag_by_what_its_load_falls_and_its_brake_gives_way(
    machine: Machine,
) -> None:
    """A table whose brake has a play of 0.19 deg was told of a drive that does not stop; a gantry falls 0.02 deg."""
    # The step of the fall is 0.01 ms, of 150 ms and more.
    expected = max(0.05, fallen_deg(machine) + machine.brake.sag_max_deg)
    assert sag_deg(machine) == pytest.approx(expected, rel=2e-3)
    # The leash is no shorter, and a step with it is one that stands.
    assert stand_deg(machine) == pytest.approx(max(0.1, expected), rel=2e-3)
    unknown = at(None, RestVerdict.NO_ZERO)
    assert why_no_room(machine, unknown, stand_deg(machine)) == ""
    assert why_no_room(machine, unknown, 1.01 * stand_deg(machine)) != ""


def test_a_brake_with_much_play_is_no_reason_to_turn_without_room() -> None:
    """0.15 deg are less than the 0.204 deg that the table may sag by, and more than a step that stands turns."""
    assert why_no_room(TABLE, at(None, RestVerdict.NO_ZERO), 0.15).startswith("nobody knows")
    assert "limit switch at 192 deg" in why_no_room(TABLE, at(191.9), 0.15)
    assert why_no_room(TABLE, at(191.8), 0.15) == ""


def test_who_is_asked_is_told_the_figures_of_this_machine() -> None:
    told = {step.key: step for step in STEPS}
    for key, gantry, table in (
        ("silence", "less than 0.05 deg", "less than 0.21 deg"),
        ("watchdog", "less than 0.05 deg", "less than 0.21 deg"),
        ("brake", "less than 0.02 deg", "less than 0.19 deg"),
        ("torque", "less than 0.02 deg", "less than 0.19 deg"),
    ):
        assert gantry in told[key].could_move(MACHINE)
        assert table in told[key].could_move(TABLE)
    assert push_deg(TABLE) == TABLE.brake.sag_max_deg
