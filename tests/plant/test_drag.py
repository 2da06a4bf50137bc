"""A brake that drags, and a brake that wears, on the simulated gantry."""

from __future__ import annotations

import pytest

from gantryctl.program import Code
from gantryctl.units import rad
from plant.plant_rig import AT_EVERY_SCAN_MS, CHECK_NM, PlantRig, machine_at

RATED_NM = 257.0
DRAGS = ((0.25, True), (0.15, False), (0.4, True))
"""Share of the brake's torque, and whether the axis stops."""


def move(rig: PlantRig, to_deg: float, speed_deg_s: float = 6.0) -> None:
    rig.say(move=True, target_rad=rad(to_deg), speed_rad_s=rad(speed_deg_s))
    rig.say(move=False)
    rig.until(lambda: rig.axis.at_rest, 200.0)
    rig.run(1.0)


def learned(scan_ms: float, moment_nm: float = 16_000.0) -> PlantRig:
    """There and back over a quarter turn: load and friction are told apart."""
    rig = PlantRig(machine_at(scan_ms, moment_nm), 0.0)
    rig.power_up(0.5)
    for target in (100.0, 0.0, -60.0, 40.0):
        move(rig, target)
    assert rig.axis.monitors.drag.model.learned
    assert not rig.codes, "a sound machine"
    return rig


# 1.5 s of a processor each at 1 ms.
@pytest.mark.parametrize(
    ("scan_ms", "drag_share", "stops"),
    [
        *((10.0, *row) for row in DRAGS),
        *((1.0, *row) for row in DRAGS[:1]),
        *(pytest.param(1.0, *row, marks=pytest.mark.slow) for row in DRAGS[1:]),
        *(pytest.param(4.0, *row, marks=pytest.mark.slow) for row in DRAGS),
    ],
)
def test_a_brake_that_drags_is_told_and_stops_the_motion(scan_ms, drag_share, stops):
    """60 N m warn (23 % of rated), 100 and 160 N m stop on the ramp; the limits are 15 and 30 %."""
    rig = learned(scan_ms)
    rig.say(move=True, target_rad=rad(150.0), speed_rad_s=rad(3.0))
    rig.run(6.0)
    rig.inject("brake", "stuck", position="closed")
    rig.inject("brake", "contact", open=True)
    rig.inject("brake", "torque", share=drag_share)
    rig.run(4.0)
    assert rig.codes == ["BRK-02"]
    assert rig.axis.at_rest is stops
    assert rig.axis.alarms.first_out is None, "still enabled"
    if stops:
        rig.say(move=False)
        rig.say(move=True)
        rig.run(0.5)
        assert rig.axis.at_rest, "no motion before a reset"
    assert rig.torque_most_nm < rig.machine.motor.torque_max_nm


@AT_EVERY_SCAN_MS
def test_before_it_has_learned_only_more_than_any_load_is_drag(scan_ms):
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), 30.0)
    rig.power_up(0.5)
    rig.say(move=True, target_rad=rad(120.0), speed_rad_s=rad(6.0))
    rig.say(move=False)
    rig.run(12.0)
    assert not rig.codes
    rig.inject("brake", "stuck", position="closed")
    rig.inject("brake", "contact", open=True)
    rig.inject("brake", "torque", share=0.4)
    rig.run(3.0)
    assert rig.codes == ["BRK-02"]


def test_service_makes_the_axis_learn_anew_after_the_load_was_changed():
    rig = learned(10.0)
    rig.axis.alarms.raise_(Code.BRK_02, measured=50.0, share=20.0)
    assert rig.axis.reset(service=False) is None
    rig.run(0.1)
    assert rig.axis.monitors.drag.model.learned
    rig.axis.alarms.raise_(Code.BRK_02, measured=50.0, share=20.0)
    assert rig.axis.reset(service=True) is None
    rig.run(0.1)
    assert not rig.axis.monitors.drag.model.learned


def test_what_was_learned_serves_the_next_run():
    weights = learned(10.0).axis.torque_weights
    rig = PlantRig(machine_at(10.0), 0.0)
    rig.axis.monitors.drag.model.restore(weights)
    assert rig.axis.torque_weights == weights
    rig.power_up(0.5)
    rig.say(move=True, target_rad=rad(100.0), speed_rad_s=rad(3.0))
    rig.run(8.0)
    assert not rig.codes
    rig.inject("brake", "stuck", position="closed")
    rig.inject("brake", "contact", open=True)
    rig.inject("brake", "torque", share=0.15)
    rig.run(4.0)
    assert rig.codes == ["BRK-02"]


@pytest.mark.parametrize(
    ("scan_ms", "speed"),
    [(1.0, 6.0), (10.0, 6.0), (10.0, 1.0)]
    + [pytest.param(*row, marks=pytest.mark.slow) for row in ((1.0, 1.0), (4.0, 6.0), (4.0, 1.0))],
)
def test_a_stop_by_the_brake_is_counted_with_its_energy(scan_ms, speed):
    rig = PlantRig(machine_at(scan_ms), 0.0)
    rig.axis.power.wear.restore(998)
    rig.power_up(0.5)
    rig.cruise_to(60.0, speed, 1.0)
    rig.inject("input", "off", name="estop_ok")
    rig.mark()
    rig.run(3.0)
    wear = rig.axis.power.wear
    assert wear.stops == 1
    assert "BRK-09" not in rig.codes
    # Read once a scan, so one scan of the first speed is in doubt. 11.8 kJ from 6 deg/s, 77 J from 1 deg/s: the load
    # keeps most of its energy and swings on.
    scan_j = rig.machine.brake.torque_nm * rad(speed) * rig.ratio * rig.axis.settings.period_s
    assert wear.energy_j == pytest.approx(rig.brake_work_j, abs=scan_j)
    rig.faults.estop_ok = True
    rig.run(0.1)
    assert rig.axis.reset() is None
    rig.run(0.1)
    rig.say(power=False)
    rig.power_up(0.5)
    rig.cruise_to(rig.motor_deg - 30.0, speed, -1.0)
    rig.inject("input", "off", name="estop_ok")
    rig.run(3.0)
    assert wear.stops == 2
    assert "BRK-09" in rig.codes
    assert rig.first == "INT-03", "service is due, which stops nothing"


def test_torque_off_at_standstill_wears_nothing():
    rig = PlantRig(machine_at(1.0), 60.0)
    rig.power_up(0.5)
    rig.inject("input", "off", name="estop_ok")
    rig.run(2.0)
    assert rig.axis.power.wear.stops == 0
