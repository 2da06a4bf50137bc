"""No-go sectors of an axis that turns without end, on the plant: refused, gone round, and never entered."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from gantryctl.image import Direction
from gantryctl.program import Code
from gantryctl.program.alarms.words import Said, Words
from gantryctl.units import deg, rad
from plant.plant_rig import PlantRig
from support.modulo_machine import modulo_machine

BEGIN_DEG, END_DEG = 60.0, 90.0
SPEED_DEG_S = 6.0
BOTH_WAYS = pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forward", "back"])
SCANS = pytest.mark.parametrize(
    "scan_ms", [4.0, pytest.param(1.0, marks=pytest.mark.slow), pytest.param(10.0, marks=pytest.mark.slow)]
)


def rig(scan_ms: float, at_deg: float) -> PlantRig:
    machine = modulo_machine(
        {
            "axis.no_go_deg": ((BEGIN_DEG, END_DEG),),
            "control.scan_period_ms": scan_ms,
            # Without retained memory the encoder must show every angle of the turn.
            "encoder.turns": 4096,
            "plant.encoder.mounting_turns": 2048,
            "virtual_axis.acc_deg_s2": 1.0,
            "virtual_axis.dec_deg_s2": 1.0,
        }
    )
    made = PlantRig(machine, at_deg)
    made.power_up(0.5)
    return made


def into_deg(angle_deg: float) -> float:
    """How far an angle lies inside the sector, in any turn; negative outside."""
    place = math.remainder(angle_deg - 0.5 * (BEGIN_DEG + END_DEG), 360.0)
    return 0.5 * (END_DEG - BEGIN_DEG) - abs(place)


def watch(made: PlantRig, seconds: float) -> float:
    """How far motor or load came into the sector, deg."""
    worst = -math.inf
    for _ in range(round(seconds / made.period_s)):
        made.step()
        worst = max(worst, into_deg(made.motor_deg), into_deg(deg(made.sim.truth()[0])))
    return worst


@BOTH_WAYS
@SCANS
def test_the_shortest_way_through_a_sector_is_refused_and_the_way_round_is_taken(
    scan_ms: float, direction: float
) -> None:
    """From one edge to the other: 50 deg through the sector, 310 deg round it."""
    middle = 0.5 * (BEGIN_DEG + END_DEG)
    begin, end = middle - 25.0 * direction, middle + 25.0 * direction
    made = rig(scan_ms, begin)
    made.say(move=True, target_rad=rad(end), speed_rad_s=rad(SPEED_DEG_S), direction=Direction.SHORTEST)
    made.say(move=False)
    refused = made.axis.refusal
    assert refused is not None
    assert refused.code is Code.CTL_18
    told = refused.values["round"]
    assert isinstance(told, Said)
    assert told.words is Words.WAY_ROUND
    assert float(str(told.values["way"])) == pytest.approx(-310.0 * direction, abs=0.1)
    way_round = Direction.NEGATIVE if direction > 0.0 else Direction.POSITIVE
    made.say(move=True, direction=way_round)
    made.say(move=False)
    worst = watch(made, 64.0)
    assert made.first == "", made.texts
    assert math.remainder(made.motor_deg - end, 360.0) == pytest.approx(0.0, abs=0.05)
    assert worst < -9.0


@BOTH_WAYS
@SCANS
def test_a_set_point_that_goes_into_a_sector_is_stopped_before_it(scan_ms: float, direction: float) -> None:
    """A faulty program plans without the sector."""
    edge = BEGIN_DEG if direction > 0.0 else END_DEG
    made = rig(scan_ms, edge - direction * 12.0)
    blind = replace(made.axis.settings.travel, no_go_rad=())
    made.axis.virtual._travel = blind
    made.axis.motion._settings = replace(made.axis.settings, travel=blind)
    made.say(
        move=True, target_rad=rad(edge + direction * 20.0), speed_rad_s=rad(3.0), direction=Direction.SHORTEST
    )
    made.say(move=False)
    worst = watch(made, 12.0)
    assert made.first == "LIM-06", made.texts
    # Outside, and not much earlier than it must be.
    assert -(3.0 * 4e-3 * scan_ms + 0.15) < worst < 0.0
