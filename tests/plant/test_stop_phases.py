"""Every class of stop in every phase of power, on the simulated gantry: the load is held, and nothing comes back."""

from __future__ import annotations

import pytest

from gantryctl.image import DriveRequest
from gantryctl.program import Code, PowerPhase, Reaction
from gantryctl.units import rad
from plant.plant_rig import AT_EVERY_SCAN_MS, CHECK_NM, PlantRig, machine_at

STOPS = {
    Reaction.QUICK_STOP: Code.LIM_03,
    Reaction.TORQUE_OFF: Code.DRV_04,
    Reaction.HOLD: Code.BRK_04,
}
VALUES = {
    Code.LIM_03: {"side": "plus", "measured": 0.0},
    Code.DRV_04: {"measured": "test"},
    Code.BRK_04: {"measured": 0.03, "limit": 0.02},
}
LONGEST_S = 5.0


def in_phase(phase: PowerPhase, scan_ms: float, share: int) -> PlantRig:
    """At 90 deg with the check moment, `share` quarters into the phase."""
    machine = machine_at(
        scan_ms,
        CHECK_NM,
        **{"brake.hold": "brake", "brake.hold_brake_after_s": 1.0, "brake.test_torque_nm": 70.0},
    )
    rig = PlantRig(machine, 90.0, holding_nm=44.0)
    rig.run(0.2)
    if phase is PowerPhase.TESTING:
        rig.say(brake_test=True)
    elif phase is not PowerPhase.OFF:
        rig.say(power=True)
    if phase in (PowerPhase.CLOSING, PowerPhase.UNLOADING, PowerPhase.DISABLING):
        rig.until(lambda: rig.phase is PowerPhase.ON, 5.0)
        rig.say(power=False)
    elif phase is PowerPhase.QUICK_STOPPING:
        rig.until(lambda: rig.phase is PowerPhase.ON, 5.0)
        rig.say(move=True, target_rad=rad(120.0), speed_rad_s=rad(3.0))
        rig.run(3.0)
        rig.say(quick_stop=True)
    elif phase is PowerPhase.TORQUE_OFF:
        rig.until(lambda: rig.phase is PowerPhase.ON, 5.0)
        rig.faults.estop_ok = False
    rig.until(lambda: rig.phase is phase, LONGEST_S)
    for _ in range(share * {1.0: 12, 4.0: 3, 10.0: 1}[scan_ms]):
        if rig.phase is phase:
            rig.step()
    rig.mark()
    return rig


@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("share", [0, 2])
@pytest.mark.parametrize("reaction", list(STOPS))
@pytest.mark.parametrize("phase", [phase for phase in PowerPhase if phase is not PowerPhase.TORQUE_HOLD])
def test_a_stop_ends_with_the_load_held(phase, reaction, share, scan_ms):
    rig = in_phase(phase, scan_ms, share)
    before = rig.phase
    code = STOPS[reaction]
    rig.axis.alarms.raise_(code, **VALUES[code])
    enabled = False
    rig.step()
    for _ in range(round(2.5 / rig.axis.settings.period_s)):
        rig.step()
        enabled = enabled or rig.engine.output.request is DriveRequest.ENABLE
    moving = before in (PowerPhase.QUICK_STOPPING,)
    assert rig.reach_deg < (1.4 if moving else 0.15)
    assert not rig.engine.output.brake_open
    assert not rig.axis.power.status
    if rig.phase is PowerPhase.TORQUE_HOLD:
        assert reaction is Reaction.HOLD
        assert rig.engine.output.request is not DriveRequest.DISABLE
    else:
        assert rig.phase is PowerPhase.OFF
        assert rig.engine.output.request is DriveRequest.DISABLE
        assert rig.engine.output.torque_ff_nm == 0.0
        assert (
            not enabled or reaction is Reaction.HOLD or before in (PowerPhase.CLOSING, PowerPhase.UNLOADING)
        )
    assert "BRK-13" not in rig.codes
    assert set(rig.codes) <= {str(code), "INT-06", "INT-03", "BRK-11"}


@AT_EVERY_SCAN_MS
@pytest.mark.parametrize("moment_nm", [16_000.0, CHECK_NM])
def test_a_sound_machine_keeps_its_brake_times(scan_ms, moment_nm):
    """Up, parked by the brake, woken by a move, down again: no brake time runs out at any scan period."""
    machine = machine_at(scan_ms, moment_nm, **{"brake.hold": "brake", "brake.hold_brake_after_s": 0.5})
    rig = PlantRig(machine, 90.0)
    for _ in range(2):
        rig.say(power=True)
        rig.until(lambda: rig.phase is PowerPhase.PARKED, 10.0)
        rig.say(move=True, target_rad=rad(rig.motor_deg - 1.0), speed_rad_s=rad(1.0))
        rig.say(move=False)
        rig.run(8.0)
        rig.say(power=False)
        rig.run(2.0)
        assert rig.phase is PowerPhase.OFF
    assert not rig.codes
