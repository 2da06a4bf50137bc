"""Every class of stop in every phase of power, on the simulated gantry: the load is held, and nothing comes back."""

from __future__ import annotations

import pytest

from gantryctl.image import DriveRequest
from gantryctl.program import Code, PowerPhase, Reaction
from gantryctl.units import rad
from plant.plant_rig import AT_EVERY_SCAN_MS, CHECK_NM, PlantRig, at_scans, machine_at

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
PHASES = [phase for phase in PowerPhase if phase is not PowerPhase.TORQUE_HOLD]
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
        rig.run(0.6)
        rig.say(quick_stop=True)
    elif phase is PowerPhase.TORQUE_OFF:
        rig.until(lambda: rig.phase is PowerPhase.ON, 5.0)
        rig.inject("input", "off", name="estop_ok")
    rig.until(lambda: rig.phase is phase, LONGEST_S)
    for _ in range(share * {1.0: 12, 4.0: 3, 10.0: 1}[scan_ms]):
        if rig.phase is phase:
            rig.step()
    rig.mark()
    return rig


@at_scans(10.0, phase=PHASES, reaction=list(STOPS), share=[0, 2])
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
@pytest.mark.parametrize("speed", [0.09, 0.17, 0.45])
def test_a_quick_stop_that_is_not_obeyed_shows_at_any_speed(speed: float, scan_ms: float) -> None:
    """Half a degree per second above its ramp no drive is that was slower than that when the stop began."""
    rig = PlantRig(machine_at(scan_ms, CHECK_NM, **{"virtual_axis.acc_deg_s2": 1.0}), 80.0)
    rig.power_up()
    rig.say(move=True, target_rad=rad(120.0), speed_rad_s=rad(3.0))
    rig.until(lambda: rig.motor_deg_s >= speed)
    rig.inject("drive", "quick_stop_off")
    rig.mark()
    rig.say(quick_stop=True)
    rig.run(3.0)
    assert rig.codes == ["INT-06", "DRV-07"]
    assert rig.reach_deg < 0.35
    # 0.25 s after the ramp, for 50 ms, and a scan; 3 s before.
    told_s = rig.axis.alarms.active["DRV-07"].time_s - rig.first_alarm.time_s
    assert told_s < speed / 5.5 + 0.25 + 0.05 + 2.0 * rig.period_s
    assert rig.phase is PowerPhase.OFF


@AT_EVERY_SCAN_MS
def test_a_contact_that_lies_at_power_up_takes_no_torque_off_before_the_brake(scan_ms: float) -> None:
    """It says open for a moment; the way down is the one behind the closed brake all the same (INV-6, the oracle)."""
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), 90.0, holding_nm=44.0)
    rig.run(0.2)
    rig.inject("brake", "contact", open=True)
    rig.say(power=True)
    rig.run(0.1)
    rig.faults.brake_feedback = None
    rig.until(lambda: rig.phase is PowerPhase.ON, 5.0)
    rig.run(1.0)
    rig.mark()
    rig.say(power=False)
    rig.run(2.0)
    assert rig.phase is PowerPhase.OFF
    assert rig.reach_deg < 0.02
    assert not rig.codes


@AT_EVERY_SCAN_MS
def test_a_contact_that_was_wrong_tells_no_time_of_the_brake(scan_ms: float) -> None:
    """Closed by itself with a contact that says open, which is right again half a second later."""
    rig = PlantRig(machine_at(scan_ms, CHECK_NM), 60.0)
    rig.cruise(1.0)
    rig.inject("brake", "stuck", position="closed")
    rig.inject("brake", "contact", open=True)
    rig.until(lambda: rig.first == "BRK-14", 2.0)
    rig.run(0.5)
    rig.faults.brake = rig.faults.brake_feedback = None
    rig.until(lambda: rig.phase is PowerPhase.OFF, 5.0)
    rig.run(0.1)
    told = rig.first_alarm.done.lower()
    assert "brake seen closed after" in told
    assert "brake closed after" not in told


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
