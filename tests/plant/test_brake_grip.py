"""A motor stronger than its brake: the brake is seen by half of its torque that comes at once and stays, nothing else.

The drafted gantry has a brake of 126 N m and a motor of 210, the drafted crane 285 against 274 and a wind that helps;
the reference gantry's motor cannot turn its brake.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gantryctl.engineering.faults.case import FaultCase, ReactionClass
from gantryctl.engineering.faults.catalogue import fault_case
from gantryctl.engineering.faults.injection import injection
from gantryctl.engineering.faults.oracle.limits import bounds_of
from gantryctl.engineering.faults.oracle.taps import Oracle
from gantryctl.engineering.faults.run import FaultRun, run_fault
from gantryctl.image import Mode
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.machine.places import reach_deg
from gantryctl.program.monitors import drag, torque
from gantryctl.units import rad
from gantryctl.wiring.simulator import plant_params
from plant.plant_rig import PlantRig
from support.delivered_axes import CONFIGS, DRAFTS, axis_of
from support.fault_rows import seen_by

SCANS_MS = (1.0, 2.0, 4.0, 10.0)
STRONG = ("draft of gantry", "draft of crane_slew")
SLOW = pytest.mark.slow


def at_scan(name: str, scan_ms: float) -> Machine:
    return with_values(axis_of(name), {"control.scan_period_ms": scan_ms})


def gripping(share: float) -> FaultCase:
    """The brake closes by itself in motion, its contact says open, and it has this part of its torque."""
    return replace(
        fault_case("C10"),
        injections=(injection("brake", "torque", share=share), *fault_case("C10").injections),
    )


# --- it grips -----------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("name", "scan_ms"),
    [
        pytest.param(name, scan_ms, marks=() if name == STRONG[0] and scan_ms in {1.0, 10.0} else SLOW)
        for name in STRONG
        for scan_ms in SCANS_MS
    ],
)
@pytest.mark.parametrize("part", [1.0, -1.0, pytest.param(0.5, marks=SLOW), pytest.param(-0.25, marks=SLOW)])
def test_a_motor_that_turns_its_brake_is_taken_off_in_time(
    name: str, scan_ms: float, part: float, oracle: Oracle
) -> None:
    """Both ways round, within the way permitted of the axis, on the true motor side."""
    machine = at_scan(name, scan_ms)
    oracle.bounds = bounds_of(machine)
    speed = part * machine.speed.setting_max_deg_s
    for case in map(fault_case, ("C10", "C5")):
        assert run_fault(FaultRun(case, machine, speed_deg_s=speed)).faults == ()
        assert seen_by(oracle, case) == []


@pytest.mark.parametrize("scan_ms", [pytest.param(1.0, marks=SLOW), 10.0])
def test_without_these_monitors_the_motor_turns_its_brake_for_a_second(
    scan_ms: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The liar: a controller that does not know a brake by its torque, nor by its mean: 18 deg of 3.3 permitted."""
    for monitor in (torque, drag):
        monkeypatch.setattr(monitor, "_GRIPS_SHARE", math.inf)
    result = run_fault(FaultRun(fault_case("C10"), at_scan("draft of gantry", scan_ms)))
    assert result.way_deg > 3.0 * result.limit_deg
    assert any("permitted" in fault for fault in result.faults)


# --- it does not --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("scan_ms", [*(pytest.param(each, marks=SLOW) for each in SCANS_MS[:3]), 10.0])
def test_a_brake_that_never_grips_is_no_brake_in_motion(scan_ms: float) -> None:
    """A brake that closes by itself and holds nothing leaves the axis as it is: no alarm, and the move ends."""
    never = replace(gripping(0.0), codes=(), instead=(), reaction=ReactionClass.NONE)
    result = run_fault(FaultRun(never, at_scan("draft of gantry", scan_ms)))
    assert "BRK-14" not in result.codes
    assert "BRK-05" not in result.codes
    # The liar: the same brake with three quarters of its torque.
    assert run_fault(FaultRun(gripping(0.75), at_scan("draft of gantry", scan_ms))).first_out == "BRK-14"


def taps(name: str, scan_ms: float, *, grips: bool = False) -> list[str]:
    """Alarms of an axis whose key is let go and pressed at the rate at which its load swings, forth and back.

    Args:
        grips: in the middle of it the brake closes, and its contact says open.
    """
    machine = at_scan(name, scan_ms)
    plant, speed = plant_params(machine), machine.speed.setting_max_deg_s
    swing_s = math.tau * math.sqrt(plant.inertia_load_kg_m2 / plant.stiffness_1_nm_per_rad)
    rig = PlantRig(machine, sum(reach_deg(machine)) / 2.0)
    rig.power_up(0.5)
    rig.say(mode=Mode.CONTINUOUS, speed_rad_s=rad(speed))

    def press(seconds: float, forward: bool) -> None:
        begin = rig.engine.time_s
        while rig.engine.time_s < begin + seconds:
            rig.say(lease=rig.op.command.lease + 1, forward=forward, reverse=not forward)
            rig.run(min(0.03, 0.25 * swing_s))

    for forward in (True, False):
        press(speed / machine.virtual_axis.acc_deg_s2 + 1.0, forward)
        for number in range(8):
            if grips and number == 4:
                rig.inject("brake", "stuck", position="closed")
                rig.inject("brake", "contact", open=True)
            rig.say(forward=False, reverse=False)
            rig.run(0.5 * swing_s)
            press(0.5 * swing_s, forward)
        rig.say(forward=False, reverse=False)
        rig.until(lambda: rig.axis.at_rest, 60.0)
    return rig.codes


SOUND = [
    pytest.param(name, scan_ms, marks=() if name == "draft of gantry" and scan_ms in {1.0, 10.0} else SLOW)
    for name in (*DRAFTS, *CONFIGS)
    for scan_ms in SCANS_MS
]


@pytest.mark.parametrize(("name", "scan_ms"), SOUND)
def test_a_sound_load_that_is_made_to_swing_is_no_brake(name: str, scan_ms: float, oracle: Oracle) -> None:
    """On the drafted gantry torque leaves its mean by 0.7 of a brake, and speed its command by 0.15 of its part."""
    # A key of a fast table begins at what is a motion of the reference gantry.
    oracle.bounds = bounds_of(axis_of(name))
    assert taps(name, scan_ms) == []


@pytest.mark.parametrize("scan_ms", [pytest.param(1.0, marks=SLOW), 10.0])
def test_a_brake_that_closes_in_such_a_swing_is_seen(scan_ms: float) -> None:
    """The liar of the test above: the monitor is awake all the time."""
    assert taps("draft of gantry", scan_ms, grips=True)[0] == "BRK-14"


def highest_share(frequency_hz: float, scan_ms: float) -> float:
    """What a swing of amplitude 1 stays above its mean of `_GRIPS_S` for that time, at most, over all phases.

    The mean is a first-order filter of that time constant, taken in the scan before the first that counts.
    """
    period_s = scan_ms * 1e-3
    scans = max(2, math.ceil(torque._GRIPS_S / period_s - 1e-9))
    step = math.tau * frequency_hz * period_s
    fresh = min(1.0, period_s / torque._GRIPS_S)
    mean = fresh / (1.0 - (1.0 - fresh) * np.exp(-1j * step))
    phase = np.linspace(0.0, math.tau, 361)[:, None]
    above = np.sin(phase + step * np.arange(scans)) - np.imag(np.exp(1j * (phase - step)) * mean)
    return float(above.min(axis=1).max())


def test_no_swing_below_half_of_the_brakes_torque_looks_like_a_brake() -> None:
    """Whatever its frequency: a slow one does not rise in 30 ms, a fast one does not stay for 30 ms."""
    worst = {
        scan_ms: max(highest_share(f, scan_ms) for f in np.geomspace(0.1, 0.4e3 / scan_ms, 200))
        for scan_ms in SCANS_MS
    }
    assert worst[1.0] == pytest.approx(0.84, abs=0.01)
    assert worst[10.0] == pytest.approx(1.03, abs=0.01)
    assert torque._GRIPS_SHARE / max(worst.values()) >= 0.48


@pytest.mark.parametrize(
    ("name", "ramps"),
    [("hust_gantry", math.inf), ("draft of crane_slew", math.inf), ("draft of gantry", 4.6),
     ("draft of rotary_table", math.inf), ("draft of telescope_azimuth", 13.0), ("draft of tilt_table", 23.0),
     ("draft of wind_turbine_yaw", math.inf), ("azimuth_dish", math.inf), ("rotary_table", math.inf)],
)  # fmt: skip
def test_the_swing_that_each_axis_may_have(name: str, ramps: float) -> None:
    """Amplitude that looks like its brake, as so many of its steepest ramps in step; inf: beyond its motor's torque."""
    machine = default_machine() if name == "hust_gantry" else axis_of(name)
    plant, virtual = plant_params(machine), machine.virtual_axis
    swing_hz = math.sqrt(plant.stiffness_1_nm_per_rad / plant.inertia_load_kg_m2) / math.tau
    share = max(highest_share(swing_hz, scan_ms) for scan_ms in SCANS_MS)
    most_nm = torque._GRIPS_SHARE * machine.brake.torque_nm / share if share > 0.0 else math.inf
    steepest = rad(max(virtual.acc_deg_s2, virtual.dec_deg_s2, virtual.jog_release_dec_deg_s2))
    ramp_nm = plant.inertia_load_kg_m2 * steepest / plant.ratio
    found = most_nm / ramp_nm if most_nm < machine.motor.torque_max_nm else math.inf
    assert found == pytest.approx(ramps, rel=0.05)
    # A motion begins and ends, and the next begins: with less a sound operator could do it.
    assert found >= 4.0
