"""A travel whose ends lie differently from 0 deg: nothing may take one of them for the other with its sign turned."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.image import Mode
from gantryctl.program.alarms.codes import Code
from gantryctl.program.axis.command_checks import check_direction, check_range, check_target
from gantryctl.program.axis.parameters import Parameter, read_parameter
from gantryctl.program.axis.reference import Reference
from gantryctl.program.monitors.monitors import Monitors
from gantryctl.program.settings import TravelSettings
from gantryctl.units import deg, rad
from unit.program.parts import Parts
from unit.program.rig import Rig, press, settings

# The measured angle trips 1 deg below, and 2 deg above.
TRAVEL = TravelSettings(rad(-30.0), rad(100.0), rad(-31.0), rad(102.0))
CONFIG = replace(settings(), travel=TRAVEL)
# Neither end is behind 0 deg.
AWAY = TravelSettings(rad(40.0), rad(100.0), rad(39.0), rad(102.0))


@pytest.mark.parametrize(
    ("target_deg", "text"),
    [
        (100.0, ""), (-30.0, ""),
        (100.5, "target 100.50 deg is beyond +100.00 deg; you are at 10.00 deg, so 90.00 deg are left"),
        (-30.5, "target -30.50 deg is beyond -30.00 deg; you are at 10.00 deg, so 40.00 deg are left"),
    ],
)  # fmt: skip
def test_a_target_is_held_against_its_own_end(target_deg: float, text: str) -> None:
    refused = check_target(rad(10.0), rad(target_deg), TRAVEL)
    assert ("" if refused is None else refused.text) == text


def test_the_range_that_is_told_is_that_of_the_axis() -> None:
    refused = check_range(math.nan, TRAVEL)
    assert refused is not None
    assert "-30" in refused.text
    assert "100" in refused.text


@pytest.mark.parametrize(
    ("here_deg", "forward", "back"),
    [(99.9, True, True), (100.0, False, True), (-29.9, True, True), (-30.0, True, False)],
)
def test_an_end_shuts_its_own_direction(here_deg: float, forward: bool, back: bool) -> None:
    open_ways = [check_direction(rad(here_deg), speed, TRAVEL) is None for speed in (1.0, -1.0)]
    assert open_ways == [forward, back]


@pytest.mark.parametrize(("at_deg", "forward", "end_deg"), [(99.0, True, 100.0), (-29.0, False, -30.0)])
def test_a_key_that_is_held_ends_at_the_end_that_it_goes_to(
    at_deg: float, forward: bool, end_deg: float
) -> None:
    rig = Rig(at_deg=at_deg, config=CONFIG)
    rig.power_up()
    rig.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(6.0))
    press(rig, forward=forward, reverse=not forward)
    rig.hold_key(3.0)
    assert rig.axis.virtual.pos_ref_rad == rad(end_deg)
    assert not rig.codes
    limits = [read_parameter(rig.axis, each) for each in (Parameter.SW_LIMIT_NEG, Parameter.SW_LIMIT_POS)]
    assert limits == [rad(-30.0), rad(100.0)]


@pytest.mark.parametrize(("increment_deg", "refused"), [(129.9, "LIM"), (130.1, "at most 130.00 deg")])
def test_an_increment_is_no_longer_than_all_of_the_travel(increment_deg: float, refused: str) -> None:
    """130 deg from end to end; from 0 deg neither fits, but only the longer one is none anywhere."""
    rig = Rig(config=CONFIG)
    rig.power_up()
    rig.op(mode=Mode.INCREMENTAL, speed_rad_s=rad(6.0), increment_rad=rad(increment_deg))
    rig.run(0.01)
    press(rig, forward=True)
    said = rig.refused()
    assert ("at most 130.00 deg" in said) is (refused != "LIM")
    assert refused != "LIM" or "beyond +100.00 deg" in said


@pytest.mark.parametrize(
    ("pos_deg", "speed_deg_s", "codes"),
    [
        (101.9, 0.0, []), (102.1, 0.0, ["LIM-02"]), (-30.9, 0.0, []), (-31.1, 0.0, ["LIM-02"]),
        # 6 deg/s take 36 / 11 = 3.27 deg.
        (98.7, 6.0, []), (98.8, 6.0, ["CTL-10"]), (-27.7, -6.0, []), (-27.8, -6.0, ["CTL-10"]),
    ],
)  # fmt: skip
def test_a_measured_angle_trips_at_its_own_end(pos_deg: float, speed_deg_s: float, codes: list[str]) -> None:
    parts = Parts(config=CONFIG)
    parts.virtual.at_rest, parts.virtual.vel_ref_rad_s = False, rad(speed_deg_s)
    parts.turn(speed_deg_s)
    watch = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    watch.open_the_way_back(0.0)
    watch.scan(rad(pos_deg), 0.0, rad(speed_deg_s) * 1144.0)
    assert parts.codes == codes
    for code in codes:
        assert parts.alarms.active[Code(code)].values["limit"] == pytest.approx(
            102.0 if pos_deg > 0.0 else -31.0
        )


def reference(travel: TravelSettings, raw_deg: float) -> Reference:
    """Of an encoder of 20 turns behind a gear of 10, 720 deg of the gantry, that stands so far from its own zero."""
    law = SimpleNamespace(ratio=10.0, counts_per_turn=1000, turns=20, wrap_margin_rad=rad(5.0))
    chosen: Any = SimpleNamespace(travel=travel, law=law, speed=SimpleNamespace(creep_rad_s=rad(0.1)))
    feedback: Any = SimpleNamespace(counts=raw_deg / 36.0 * 1000.0, vel_rad_s=0.0, position_valid=True)
    return Reference(chosen, feedback, None)


@pytest.mark.parametrize(
    ("travel", "position_deg", "raw_deg", "taken"),
    [
        # From 0 deg there are 30 to the lower end and 100 to the upper one, and 5 more to the wrap at 0 or 720.
        (TRAVEL, 0.0, 34.9, False), (TRAVEL, 0.0, 35.1, True), (TRAVEL, 0.0, 614.9, True), (TRAVEL, 0.0, 615.1, False),
        (TRAVEL, 60.0, 94.9, False), (TRAVEL, 60.0, 95.1, True), (TRAVEL, 60.0, 674.9, True),
        (TRAVEL, 60.0, 675.1, False),
        # From 40 deg there is nothing below and 60 above.
        (AWAY, 40.0, 4.9, False), (AWAY, 40.0, 5.1, True), (AWAY, 40.0, 654.9, True), (AWAY, 40.0, 655.1, False),
        # No angle of the travel, wherever the encoder stands.
        (TRAVEL, 100.1, 360.0, False), (TRAVEL, -30.1, 360.0, False), (AWAY, 39.9, 360.0, False),
    ],
)  # fmt: skip
def test_a_reference_keeps_the_wrap_from_either_end(
    travel: TravelSettings, position_deg: float, raw_deg: float, taken: bool
) -> None:
    assert (reference(travel, raw_deg).check(rad(position_deg), standing=True) is None) is taken


@pytest.mark.parametrize(("at_deg", "tripped"), [(104.0, 104.03), (-33.0, -33.03)])
def test_switched_on_beyond_an_end_the_axis_may_come_back_and_go_no_further(
    at_deg: float, tripped: float
) -> None:
    parts = Parts(config=CONFIG)
    parts.virtual.at_rest = False
    watch = Monitors(parts.settings, parts.feedback, parts.virtual, parts.holding, parts.alarms)
    watch.open_the_way_back(rad(at_deg))
    for pos_deg, codes in ((at_deg, []), (tripped - math.copysign(0.02, at_deg), []), (tripped, ["LIM-02"])):
        watch.scan(rad(pos_deg), 0.0, 0.0)
        assert parts.codes == codes
    assert deg(parts.settings.travel.over_travel_max_rad) == pytest.approx(102.0)
