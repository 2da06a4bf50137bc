"""No-go sectors over a bus, at 1, 4 and 10 ms and both ways: on the true shaft nothing ends in one."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from bus.bus_rig import BusRig, bus_machine
from gantryctl.program import Code
from gantryctl.units import rad

SECTORS = ((-120.0, -60.0), (60.0, 120.0))
EDGE_DEG, SPEED_DEG_S = 60.0, 3.0
BOTH_WAYS = pytest.mark.parametrize("direction", [1.0, -1.0], ids=["forward", "back"])
SCANS = pytest.mark.parametrize(
    "scan_ms", [4.0, pytest.param(1.0, marks=pytest.mark.slow), pytest.param(10.0, marks=pytest.mark.slow)]
)


def rig(scan_ms: float, at_deg: float) -> BusRig:
    machine = bus_machine(scan_ms=scan_ms, changes={"axis.no_go_deg": SECTORS})
    return BusRig(machine, at_deg).power_up()


def far(bus: BusRig, direction: float, seconds: float) -> tuple[float, float]:
    """The furthest way of motor and load towards the sector, deg; the load at the end of each scan."""
    load = -math.inf
    before = len(bus.ticks)
    for _ in range(round(seconds / bus.axis.settings.period_s)):
        bus.engine.step()
        load = max(load, direction * math.degrees(bus.node.plant.sim.state["pos_load"]))
    return max(direction * tick.pos_deg for tick in bus.ticks[before:]), load


@BOTH_WAYS
@SCANS
def test_a_set_point_that_goes_into_a_sector_is_stopped_before_it(scan_ms: float, direction: float) -> None:
    """A faulty program plans without the sector; the drive's own ramp brings motor and load to rest outside."""
    bus = rig(scan_ms, direction * 45.0)
    blind = replace(bus.axis.settings.travel, no_go_rad=())
    bus.axis.virtual._travel = blind
    bus.axis.motion._settings = replace(bus.axis.settings, travel=blind)
    bus.command(move=True, target_rad=rad(direction * 100.0), speed_rad_s=rad(SPEED_DEG_S))
    motor, load = far(bus, direction, 10.0)
    assert bus.axis.alarms.first_out is not None
    assert bus.axis.alarms.first_out.code is Code.LIM_06
    assert abs(bus.ticks[-1].vel_deg_s) < 0.01
    assert max(motor, load) < EDGE_DEG
    # And not much earlier than it must: four scans, the margin, and what a quick stop takes less on friction.
    assert motor > EDGE_DEG - SPEED_DEG_S * 4e-3 * scan_ms - 0.15


@BOTH_WAYS
def test_a_move_to_the_clearance_ends_there_and_one_beyond_is_refused(direction: float) -> None:
    bus = rig(4.0, direction * 52.0)
    bus.command(move=True, target_rad=rad(direction * 60.5), speed_rad_s=rad(SPEED_DEG_S))
    bus.run(0.1)
    assert bus.axis.refusal is not None
    assert bus.axis.refusal.code is Code.CTL_18
    stretch = bus.axis.settings.travel.stretch(bus.axis.virtual.pos_ref_rad)
    end = stretch.high_rad if direction > 0.0 else stretch.low_rad
    bus.command(move=False)
    bus.run(0.1)
    bus.command(move=True, target_rad=end, speed_rad_s=rad(SPEED_DEG_S))
    motor, load = far(bus, direction, 9.0)
    assert not bus.axis.alarms.history
    assert max(motor, load) < EDGE_DEG
    assert direction * math.degrees(bus.axis.pos_act_rad) == pytest.approx(
        direction * math.degrees(end), abs=0.01
    )
