"""No-go sectors: the stretch that an axis can reach, and what a command beyond it is told."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.image import Mode
from gantryctl.machine import default_machine, with_values
from gantryctl.program.axis.command_checks import check_direction, check_target
from gantryctl.program.axis.parameters import Parameter, read_bool_parameter, read_parameter
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.settings import TravelSettings
from gantryctl.units import deg, rad
from gantryctl.wiring.program import travel_settings
from unit.program.parts import BOTH, Parts
from unit.program.rig import Rig, press, settings

LINEAR = travel_settings(with_values(default_machine(), {"axis.no_go_deg": ((-120.0, -60.0), (60.0, 120.0))}))
# Of a modulo axis: one sector over the beginning of its turn.
ENDLESS = replace(
    LINEAR,
    pos_min_rad=-math.inf,
    pos_max_rad=math.inf,
    over_travel_min_rad=-math.inf,
    over_travel_max_rad=math.inf,
    turn_from_rad=0.0,
    no_go_rad=((rad(350.0), rad(370.0)),),
)


def reach(travel: TravelSettings, at_deg: float) -> tuple[float, float]:
    low, high, _, _ = travel.stretch(rad(at_deg))
    return deg(low), deg(high)


@pytest.mark.parametrize(
    ("at_deg", "low_deg", "high_deg"),
    [
        (0.0, -60.0, 60.0),
        (150.0, 120.0, 180.0),
        (-150.0, -180.0, -120.0),
        # In a sector: out of it by the nearer edge, and no further into it.
        (65.0, -60.0, 60.0),
        (115.0, 120.0, 180.0),
    ],
)
def test_the_stretch_ends_a_clearance_before_a_sector(at_deg: float, low_deg: float, high_deg: float) -> None:
    clearance = deg(LINEAR.no_go_clearance_rad)
    assert 0.05 < clearance < 0.2
    edges = [
        low_deg + clearance * (low_deg != -180.0),
        high_deg - clearance * (high_deg != 180.0),
    ]
    assert reach(LINEAR, at_deg) == pytest.approx(edges)


def test_without_sectors_travel_is_one_stretch() -> None:
    assert reach(travel_settings(default_machine()), 12.0) == pytest.approx((-180.0, 180.0))


@pytest.mark.parametrize("target_deg", [90.0, 100.0, 150.0])
def test_a_target_in_or_behind_a_sector_is_refused_with_the_nearest_permitted_angle(
    target_deg: float,
) -> None:
    refused = check_target(rad(10.0), rad(target_deg), LINEAR)
    assert refused is not None
    assert refused.code == "CTL-18"
    nearest = f"{60.0 - deg(LINEAR.no_go_clearance_rad):.2f}"
    assert refused.text.startswith(
        f"the way to {target_deg:.2f} deg enters the no-go sector 60.00 to 120.00 deg; you are at 10.00 deg, "
        f"permitted as far as {nearest} deg; there is no way round"
    )
    # What it names is permitted.
    assert check_target(rad(10.0), LINEAR.stretch(rad(10.0)).high_rad, LINEAR) is None
    # Backwards it is the other one.
    below = check_target(rad(10.0), rad(-target_deg), LINEAR)
    assert below is not None
    assert f"the way to {-target_deg:.2f} deg enters the no-go sector -120.00 to -60.00 deg" in below.text


def test_a_modulo_axis_is_told_its_way_round() -> None:
    """From 340 to 20 deg: 40 deg through the sector, 320 deg round it."""
    refused = check_target(rad(340.0), rad(380.0), ENDLESS)
    assert refused is not None
    assert (
        "the way to 20.00 deg enters the no-go sector 350.00 to 10.00 deg; you are at 340.00 deg"
        in refused.text
    )
    assert refused.text.endswith("the way round is -320.00 deg")
    assert check_target(rad(340.0), rad(20.0), ENDLESS) is None
    # A target in the sector has no way at all.
    inside = check_target(rad(340.0), rad(360.0), ENDLESS)
    assert inside is not None
    assert inside.text.endswith("there is no way round")


@given(st.floats(-3000.0, 3000.0), st.floats(11.0, 349.0))
def test_a_sector_of_a_modulo_axis_is_there_in_every_turn(turns: float, at_deg: float) -> None:
    """The stretch is the turn less the sector and a clearance on both sides, whichever turn it is."""
    whole = 360.0 * round(turns)
    low, high = reach(ENDLESS, whole + at_deg)
    clearance = deg(ENDLESS.no_go_clearance_rad)
    assert low - whole == pytest.approx(10.0 + clearance, abs=1e-6)
    assert high - whole == pytest.approx(350.0 - clearance, abs=1e-6)


def test_a_jog_at_the_edge_is_refused_towards_the_sector_only() -> None:
    edge = LINEAR.stretch(0.0).high_rad
    refused = check_direction(edge, 1.0, LINEAR)
    assert refused is not None
    assert "no-go sector 60.00 to 120.00 deg" in refused.text
    assert check_direction(edge, -1.0, LINEAR) is None


def test_a_way_round_that_meets_another_sector_is_none():
    """From 340 to 20 deg there is a sector both ways."""
    sectors = ((rad(350.0), rad(370.0)), (rad(170.0), rad(190.0)))
    travel = TravelSettings(-math.inf, math.inf, -math.inf, math.inf, 0.0, no_go_rad=sectors)
    refused = check_target(rad(340.0), rad(380.0), travel)
    assert refused is not None
    assert refused.text.endswith("there is no way round")


@BOTH
@pytest.mark.parametrize("sides", [(True, False), (False, True), (True, True)])
def test_a_sector_trips_a_margin_before_it_and_the_end_of_travel_where_it_is(way, sides):
    """Sectors at +-60 deg with 0.03 deg of margin; 180.5 deg is the end."""
    parts = Parts()
    below, above = ((rad(-120.0), rad(-60.0)), (rad(60.0), rad(120.0)))
    sectors = tuple(sector for sector, there in zip((below, above), sides, strict=True) if there)
    travel = replace(parts.settings.travel, no_go_rad=sectors, no_go_margin_rad=rad(0.03))
    config = replace(parts.settings, travel=travel)
    there = sides[1] if way > 0.0 else sides[0]
    edge = 59.97 if there else 180.5
    for off, trips in ((-0.005, False), (0.005, True)):
        parts.alarms.clear()
        monitors = Monitors(config, parts.feedback, parts.virtual, parts.holding, parts.alarms)
        monitors.open_the_way_back(0.0)
        parts.virtual.at_rest = False
        monitors.scan(rad(way * (edge + off)), 0.0, 0.0)
        assert parts.codes == ((["LIM-06"] if there else ["LIM-02"]) if trips else [])


@BOTH
@pytest.mark.parametrize("order", [1, -1])
def test_of_two_sectors_on_one_side_the_nearer_one_bounds(way: float, order: int) -> None:
    edges = [(rad(60.0), rad(70.0)), (rad(90.0), rad(100.0))]
    sectors = tuple(edges if way > 0.0 else [(-end, -begin) for begin, end in edges])[::order]
    travel = TravelSettings(rad(-180.0), rad(180.0), rad(-180.5), rad(180.5), no_go_rad=sectors)
    low, high = reach(travel, 0.0)
    assert (high if way > 0.0 else low) == pytest.approx(way * 60.0)
    assert (low if way > 0.0 else high) == pytest.approx(-way * 180.0)
    assert reach(travel, way * 80.0) == pytest.approx(sorted((way * 70.0, way * 90.0)))


def test_no_way_round_leads_into_a_sector() -> None:
    """From 300 deg to 355, which lies in the sector from 350 to 370: from the other side it is as shut."""
    refused = check_target(rad(300.0), rad(355.0), ENDLESS)
    assert refused is not None
    assert refused.text.endswith("there is no way round")
    round_ = check_target(rad(300.0), rad(380.0), ENDLESS)
    assert round_ is not None
    assert not round_.text.endswith("there is no way round")


@BOTH
@pytest.mark.parametrize("begin_deg", [179.95, 180.05])
def test_a_sector_nearer_to_the_end_of_travel_than_its_clearance_bounds(way: float, begin_deg: float) -> None:
    """Before or behind the end of travel at 180 deg, with 0.1 deg of clearance."""
    sector = (rad(begin_deg), rad(190.0)) if way > 0.0 else (rad(-190.0), rad(-begin_deg))
    travel = TravelSettings(
        rad(-180.0), rad(180.0), rad(-180.5), rad(180.5), no_go_rad=(sector,), no_go_clearance_rad=rad(0.1)
    )
    low, high = reach(travel, 0.0)
    assert (high if way > 0.0 else low) == pytest.approx(way * (begin_deg - 0.1))


@pytest.mark.parametrize(
    ("travel", "at_deg", "forward", "text"),
    [
        (LINEAR, 58.0, True, "stopped at 59.90 deg, before the no-go sector 60.00 to 120.00 deg"),
        (LINEAR, -58.0, False, "stopped at -59.90 deg, before the no-go sector -120.00 to -60.00 deg"),
        # Behind the last of them the travel ends.
        (LINEAR, 178.0, True, "stopped at 180.00 deg, the end of travel"),
        (LINEAR, -178.0, False, "stopped at -180.00 deg, the end of travel"),
        # An axis without ends has no end of travel: 350 to 370 deg, read as 350 to 10.
        (ENDLESS, 12.0, False, "stopped at 10.10 deg, before the no-go sector 350.00 to 10.00 deg"),
        (ENDLESS, 348.0, True, "stopped at 349.90 deg, before the no-go sector 350.00 to 10.00 deg"),
    ],
)
def test_a_key_that_is_held_is_told_what_has_ended_its_motion(
    travel: TravelSettings, at_deg: float, forward: bool, text: str
) -> None:
    """With 0.1 deg of clearance; a degree at 6 deg/s, and the ramp."""
    travel = replace(travel, no_go_clearance_rad=rad(0.1))
    rig = Rig(at_deg=at_deg, config=replace(settings(), travel=travel))
    rig.power_up()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, forward=forward, reverse=not forward)
    rig.hold_key(4.0)
    assert rig.program.jog.at_limit
    assert rig.axis.alarms.history[-1].measured == text


@pytest.mark.parametrize(
    ("travel", "limits"), [(LINEAR, True), (ENDLESS, True), (replace(ENDLESS, no_go_rad=()), False)]
)
def test_limits_are_enabled_where_there_are_some(travel: TravelSettings, limits: bool) -> None:
    """A modulo axis that has a no-go sector has limits of the set-point: their numbers, and that they are in force."""
    rig = Rig(at_deg=12.0, config=replace(settings(), travel=travel))
    rig.run(0.01)
    axis = rig.axis
    for number, limit in ((Parameter.ENABLE_LIMIT_POS, Parameter.SW_LIMIT_POS),
                          (Parameter.ENABLE_LIMIT_NEG, Parameter.SW_LIMIT_NEG)):  # fmt: skip
        value = read_parameter(axis, limit)
        assert isinstance(value, float)
        assert math.isfinite(value) is limits
        assert read_bool_parameter(axis, number) is limits


@pytest.mark.parametrize("turns", [-1, 0, 3])
@pytest.mark.parametrize(
    ("at_deg", "low_deg", "high_deg"),
    [(350.0, 10.0, 350.0), (355.0, 10.0, 350.0), (365.0, 370.0, 710.0), (370.0, 370.0, 710.0)],
)
def test_from_within_a_sector_of_a_modulo_axis_the_way_out_ends_before_the_next(
    turns: int, at_deg: float, low_deg: float, high_deg: float
) -> None:
    """A stop by the brake has ended in 350 to 370 deg: out of it by the nearer edge, and not round into it again."""
    clearance = deg(ENDLESS.no_go_clearance_rad)
    found = reach(ENDLESS, at_deg + 360.0 * turns)
    assert found == pytest.approx((low_deg + clearance + 360.0 * turns, high_deg - clearance + 360.0 * turns))


def test_a_key_that_is_held_does_not_go_round_into_the_sector_that_it_has_left() -> None:
    rig = Rig(at_deg=355.0, config=replace(settings(), travel=ENDLESS))
    rig.power_up()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, reverse=True)
    assert rig.axis.virtual.plan.pos_end == pytest.approx(rad(10.0) + ENDLESS.no_go_clearance_rad)
