"""What counts as rest goes with the axis: little beside its speeds, and more than its speed reading can tell."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from gantryctl.engineering.stops import check_quick_stop
from gantryctl.engineering.stops.limits import unknown_rest
from gantryctl.errors import ConfigError
from gantryctl.image import DriveFeedback
from gantryctl.machine import configs_folder, default_machine, with_values
from gantryctl.program.blocks.cam_switch import Cam, CamDirection, DigitalCamSwitch
from gantryctl.program.settings import AxisSettings, SpeedSettings
from gantryctl.units import rad
from gantryctl.wiring.program import axis_settings, rest_speed_deg_s, speed_step_deg_s
from support.delivered_axes import DRAFTS, axis_of
from unit.program.rig import RATIO, Rig
from unit.program.rig import settings as rig_settings

# Steps of the reading and rest of every delivered machine and template, deg/s.
KNOWN = {
    "hust_gantry": (0.00060, 0.0200),
    "hust_improved": (0.00060, 0.0200),
    "hust_can": (0.00060, 0.0200),
    "hust_can_nodes": (0.00060, 0.0200),
    "azimuth_dish": (0.00029, 0.00666),
    # A small encoder behind a small ratio: a count in 125 us is 0.03 deg/s, which is more than 0.02.
    "rotary_table": (0.03052, 0.06104),
    "draft of crane_slew": (0.00038, 0.0120),
    "draft of gantry": (0.00063, 0.0200),
    "draft of rotary_table": (0.03052, 0.06104),
    "draft of telescope_azimuth": (0.00029, 0.00666),
    "draft of tilt_table": (0.00183, 0.0200),
    "draft of wind_turbine_yaw": (0.00038, 0.0016),
}


def test_no_machine_is_left_out() -> None:
    files = {file.stem for file in configs_folder().glob("*.toml") if "calibration" not in file.name}
    assert set(KNOWN) == files | set(DRAFTS)


@pytest.mark.parametrize("name", KNOWN)
def test_rest_of_every_machine(name: str) -> None:
    machine = axis_of(name)
    step, rest = speed_step_deg_s(machine), rest_speed_deg_s(machine)
    # To the digits of the table above.
    assert (step, rest) == (pytest.approx(KNOWN[name][0], abs=5e-6), pytest.approx(KNOWN[name][1], abs=5e-6))
    assert axis_settings(machine).speed.rest_rad_s == rad(rest)
    assert axis_settings(
        machine, speed_max_deg_s=0.5 * machine.speed.setting_max_deg_s
    ).speed.rest_rad_s == rad(rest), "a lower speed for today is no other reading"
    assert not unknown_rest(machine)


def test_the_reference_machine_keeps_its_rest_to_the_bit() -> None:
    """Its recordings do not change: a 300th of 6 deg/s is 0.02 deg/s, as before."""
    assert rest_speed_deg_s(default_machine()) == 0.02
    assert axis_settings(default_machine()).speed.rest_rad_s == rad(0.02)
    assert SpeedSettings(rad(0.6), rad(6.0), rad(6.3), rad(6.6)).rest_rad_s == rad(0.02)


def test_no_speed_that_can_be_set_is_rest() -> None:
    """A telescope that follows the stars turns at 0.0042 deg/s; a 300th of its highest setting would be 0.0067."""
    machine = with_values(axis_of("azimuth_dish"), {"speed.setting_min_deg_s": 0.004})
    assert rest_speed_deg_s(machine) == 0.002


BASES = ("hust_gantry", "hust_can", "azimuth_dish", "rotary_table", "draft of wind_turbine_yaw")
UNITS = ("inc/s", "0.1 inc/s", "16.16 inc/ms", "r/min", "0.1 r/min", "0.001 r/min", "mrev/s", "profile")
CHANGES = st.fixed_dictionaries(
    {"can.answer_ms": st.just(0.1)},
    optional={
        "drive.kind": st.sampled_from(["sim", "ideal", "canopen"]),
        "drive.speed_loop.feedback": st.sampled_from(["ideal", "interpolated", "counts"]),
        "drive.speed_loop.cycle_us": st.sampled_from([31.25, 62.5, 125.0, 250.0, 1000.0]),
        "encoder.lines": st.integers(1, 2**20),
        "encoder.interpolation": st.integers(1, 65536),
        "can.increments_per_turn": st.integers(64, 2**24),
        "can.velocity_unit": st.sampled_from(UNITS),
        "speed.setting_min_deg_s": st.floats(1e-6, 0.4),
        "control.scan_period_ms": st.sampled_from([1.0, 2.0, 4.0, 10.0]),
    },
)


@settings(deadline=None, max_examples=60)
@given(name=st.sampled_from(BASES), changes=CHANGES)
@example(name="hust_gantry", changes={"drive.speed_loop.feedback": "counts"})
@example(name="draft of wind_turbine_yaw", changes={"encoder.interpolation": 512})
def test_rest_lies_between_the_noise_and_the_speeds_of_any_axis(
    name: str, changes: dict[str, object]
) -> None:
    """No machine that can be described rests below its noise, or above a 60th of its highest setting without a no."""
    try:
        machine = with_values(axis_of(name), changes)
    except ConfigError:
        assume(False)
    step, rest, top = speed_step_deg_s(machine), rest_speed_deg_s(machine), machine.speed.setting_max_deg_s
    # A shaft between two counts is read as one step either way, and that is rest.
    assert rest > step >= 0.0
    assert rest >= 2.0 * step
    refused = unknown_rest(machine)
    assert bool(refused) is (rest > top / 60.0)
    assert all("steps of" in line and f"{top:g} deg/s" in line for line in refused)
    # Below what the reading forces it is at most a 300th and half of the lowest setting.
    if rest > 2.0 * step:
        assert rest <= min(0.02, top / 300.0, 0.5 * machine.speed.setting_min_deg_s)


def test_a_reading_that_is_too_coarse_is_refused_in_words_before_the_axis_moves() -> None:
    """64 interpolated steps a line, not 2048: 0.012 deg/s a count and cycle, of the 0.48 deg/s of a yaw drive."""
    fine, coarse = axis_of("draft of wind_turbine_yaw"), {"encoder.interpolation": 64}
    check_quick_stop(fine)
    with pytest.raises(ConfigError, match=r"read in steps of 0\.0121 deg/s.*below 0\.0243 deg/s.*60th"):
        check_quick_stop(with_values(fine, coarse))
    gantry = axis_of("hust_can")
    assert not unknown_rest(with_values(gantry, {"can.velocity_unit": "r/min"})), "0.0052 of 6 deg/s"
    # An increment in a scan of 4 ms is 1.2 deg/s, where the drive has no 606C.
    (line,) = unknown_rest(with_values(gantry, {"can.increments_per_turn": 64}))
    assert "increments_per_turn" in line


# --- who uses it --------------------------------------------------------------------------------------------
def slow_axis(rest_deg_s: float) -> AxisSettings:
    base = rig_settings()
    return replace(base, speed=replace(base.speed, rest_rad_s=rad(rest_deg_s)))


def read_with(rig: Rig, speed_deg_s: float) -> None:
    """The drive says this speed from now on."""

    def spoil(feedback: DriveFeedback) -> DriveFeedback:
        return feedback._replace(vel_act_rad_s=rad(speed_deg_s) * RATIO)

    rig.spoil = spoil
    rig.step()


@pytest.mark.parametrize(("rest", "speed", "rests"), [
    (0.02, 0.019, True), (0.02, 0.021, False), (0.0016, 0.0015, True), (0.0016, 0.0017, False), (0.0016, 0.019, False),
    (0.061, 0.0305, True), (0.061, 0.0611, False),
])  # fmt: skip
def test_the_output_at_rest_goes_by_the_rest_of_the_axis(rest: float, speed: float, rests: bool) -> None:
    rig = Rig(config=slow_axis(rest))
    read_with(rig, -speed)
    assert rig.output.at_rest is rests
    assert rig.axis.feedback.slow is rests


@pytest.mark.parametrize(("rest", "turns"), [(0.02, False), (0.0016, True)])
def test_a_cam_of_one_direction_sees_a_slow_axis_turn(rest: float, turns: bool) -> None:
    """At 0.01 deg/s a yaw axis turns, and the reading of the gantry at rest is noise of either sign."""
    rig = Rig(config=slow_axis(rest))
    cams = DigitalCamSwitch(rig.axis, [[Cam(rad(-1.0), rad(1.0), CamDirection.NEGATIVE)]])
    read_with(rig, -0.01)
    cams()
    assert cams.outputs == (turns,)
