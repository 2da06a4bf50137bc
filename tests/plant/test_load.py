"""A load that becomes too heavy, and an axis that swings, on the simulated gantry."""

from __future__ import annotations

import math

import pytest

from gantryctl.image import DriveRequest, OutputImage
from gantryctl.program import Code, PowerPhase
from gantryctl.units import rad
from plant.plant_rig import AT_EVERY_SCAN_MS, PlantRig, machine_at

RATED_NM = 257.0


def put_on(rig: PlantRig, moment_nm: float, seconds: float) -> None:
    """The eccentric moment grows while the axis stands."""
    start = rig.drive._maker.plant.eccentric_moment_nm
    steps = max(1, round(seconds / 0.05))
    for k in range(1, steps + 1):
        rig.drive._maker.plant.eccentric_moment_nm = start + (-moment_nm - start) * k / steps
        rig.drive._remake()
        rig.run(0.05)


@AT_EVERY_SCAN_MS
def test_a_heavy_load_is_told_and_held(scan_ms):
    rig = PlantRig(machine_at(scan_ms), 90.0, holding_nm=14.0)
    rig.power_up(1.0)
    rig.mark()
    put_on(rig, 200_000.0, 4.0)
    rig.run(2.0)
    assert rig.codes == ["CTL-06"], "200 kN m are 175 N m: 68 % of rated"
    assert rig.phase is PowerPhase.ON
    assert rig.reach_deg < 0.02


@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("seconds", [0.5, 5.0])
def test_a_load_that_is_too_heavy_goes_to_the_brake_before_the_torque_goes(scan_ms, seconds):
    rig = PlantRig(machine_at(scan_ms), 90.0, holding_nm=14.0)
    rig.power_up(1.0)
    rig.mark()
    put_on(rig, 290_000.0, seconds)
    rig.until(lambda: rig.phase is PowerPhase.OFF, 5.0)
    assert "CTL-06" in rig.codes
    assert rig.first in ("CTL-06", "CTL-13")
    assert rig.reach_deg < 0.15
    rig.run(2.0)
    assert "BRK-03" not in rig.codes, "400 N m of brake bear 253"
    assert abs(rig.axis.holding_torque_nm) < 0.6 * RATED_NM + 1.0, "nothing above the warning is learned"


def swing(rig: PlantRig, amplitude_deg_s: float, rate_hz: float) -> None:
    """The drive swings about its command, as with a gain too high."""
    write, scan_s = rig.drive.write, rig.axis.settings.period_s
    now = [0.0]

    def swinging(output: OutputImage) -> None:
        now[0] += scan_s
        add = rad(amplitude_deg_s) * rig.ratio * math.sin(2.0 * math.pi * rate_hz * now[0])
        follows = output.request is DriveRequest.ENABLE and output.brake_open
        write(output._replace(vel_cmd_rad_s=output.vel_cmd_rad_s + add) if follows else output)

    rig.drive.write = swinging
    rig.engine.drive.write = swinging


@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("rate_hz", [1.5, 3.0])
def test_an_oscillation_is_stopped_after_a_second(scan_ms, moving, rate_hz, oracle):
    rig = PlantRig(machine_at(scan_ms), 60.0)
    rig.power_up(1.0)
    if moving:
        rig.cruise_to(62.0, 1.0, 1.0)
    rig.axis.monitors._torque_watch._known = False  # it tells the drive's disobedience before
    swing(rig, 0.35, rate_hz)
    rig.until(lambda: rig.first != "", 3.0)
    assert rig.first in ("CTL-08", "CTL-13")
    if moving:
        assert rig.first == "CTL-08"
        assert f"{rate_hz:.0f}" in rig.axis.alarms.active[Code.CTL_08].measured or rate_hz == 1.5
    for invariant in ("INV-2", "INV-3"):  # the swing is added to what the wire shows
        oracle.caught(invariant)


@AT_EVERY_SCAN_MS
def test_the_swing_of_the_load_after_stops_is_no_oscillation(scan_ms):
    rig = PlantRig(machine_at(scan_ms, 50_000.0), 60.0)
    rig.power_up(1.0)
    for sign in (1.0, -1.0, 1.0):
        rig.say(move=True, target_rad=rad(60.0 + sign * 60.0), speed_rad_s=rad(6.0))
        rig.say(move=False)
        rig.run(6.0)
        rig.say(stop=True)
        rig.run(4.0)
        rig.say(stop=False)
    assert not rig.codes
