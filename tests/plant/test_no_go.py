"""No-go sectors on the plant, at 1, 4 and 10 ms and both ways: nothing that the axis does ends in one."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gantryctl.image import Mode
from gantryctl.machine import Machine
from gantryctl.units import deg, rad
from plant.plant_rig import AT_EVERY_SCAN_MS, PlantRig, machine_at

SECTORS = ((-120.0, -60.0), (60.0, 120.0))
EDGE_DEG, SPEED_DEG_S = 60.0, 3.0
BOTH_WAYS = pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forward", "back"])


def machine(scan_ms: float) -> Machine:
    return machine_at(scan_ms, **{"axis.no_go_deg": SECTORS})


def watch(rig: PlantRig, direction: float, seconds: float) -> tuple[float, float]:
    """The furthest way of motor and load towards the sector, deg."""
    motor = load = -1e9
    for _ in range(round(seconds / rig.period_s)):
        rig.step()
        motor, load = max(motor, direction * rig.motor_deg), max(load, direction * deg(rig.sim.truth()[0]))
    return motor, load


@BOTH_WAYS
@AT_EVERY_SCAN_MS
def test_a_set_point_that_goes_into_a_sector_is_stopped_before_it(scan_ms: float, direction: float) -> None:
    """A faulty program plans without the sector: motor and load come to rest outside by a quick stop.

    Watched: without `no_go_lead_s` the motor ends inside at 10 ms, without `no_go_margin_rad` the load at 1 ms, without
    both at every scan period.
    """
    rig = PlantRig(machine(scan_ms), direction * 25.0)
    rig.power_up(0.5)
    blind = replace(rig.axis.settings.travel, no_go_rad=())
    rig.axis.virtual._travel = blind
    rig.axis.motion._settings = replace(rig.axis.settings, travel=blind)
    rig.say(move=True, target_rad=rad(direction * 100.0), speed_rad_s=rad(SPEED_DEG_S))
    rig.say(move=False)
    motor, load = watch(rig, direction, 20.0)
    assert rig.first == "LIM-06", rig.texts
    assert max(motor, load) < EDGE_DEG
    # And not much earlier than it must: four scans, the margin, and what a quick stop takes less on friction.
    assert motor > EDGE_DEG - SPEED_DEG_S * 4e-3 * scan_ms - 0.15


@BOTH_WAYS
def test_a_jog_ends_before_a_sector_without_an_alarm(direction: float) -> None:
    rig = PlantRig(machine(4.0), direction * 50.0)
    rig.power_up(0.5)
    rig.say(mode=Mode.CONTINUOUS, speed_rad_s=rad(1.0))
    far = -1e9
    for k in range(150):  # held for 15 s, the lease renewed every 0.1 s
        rig.say(**{"forward" if direction > 0.0 else "reverse": True}, lease=k + 1)
        far = max(far, *watch(rig, direction, 0.096))
    assert rig.first == "", rig.texts
    assert EDGE_DEG - 0.2 < far < EDGE_DEG


@BOTH_WAYS
def test_an_axis_that_stands_in_a_sector_leaves_it_by_the_nearer_edge(direction: float) -> None:
    rig = PlantRig(machine(4.0), direction * 65.0)
    rig.power_up(0.5)
    assert rig.first == "", rig.texts
    rig.say(move=True, target_rad=rad(direction * 66.0), speed_rad_s=rad(1.0))
    rig.say(move=False)
    rig.run(0.5)
    assert "no-go sector" in rig.axis.refusal.text
    rig.say(move=True, target_rad=rad(direction * 50.0), speed_rad_s=rad(SPEED_DEG_S))
    rig.say(move=False)
    rig.run(18.0)
    assert rig.first == "", rig.texts
    assert rig.motor_deg == pytest.approx(direction * 50.0, abs=0.05)
