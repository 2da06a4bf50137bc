"""The frequency response of the running axis, through the drive port alone."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.drives.ideal import IdealDrive
from gantryctl.engineering.analysis.data import measured_data
from gantryctl.engineering.analysis.measured.excitation import Excitation, multisine
from gantryctl.engineering.analysis.measured.probe import Probe, ProbeLimits, fit_amplitude, measure
from gantryctl.engineering.analysis.measured.response import (
    Condition,
    measure_simulated,
    model_ratios,
    simulated_probe,
)
from gantryctl.engineering.analysis.models.margins import phase_margins, smallest_phase_margin
from gantryctl.engineering.analysis.models.mechanics import Friction
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.engineering.analysis.text import measured_sentence
from gantryctl.errors import AlarmStop, UsageError
from gantryctl.image import DriveRequest, DriveState
from gantryctl.machine import default_machine, with_values
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import sim_drive

MACHINE = default_machine()


def sine(where: Input, hz: float, cycles: int, amplitude: float, scan_s: float) -> Excitation:
    """One frequency, moved to the nearest one of which `cycles` cycles are whole scans."""
    scans = max(2 * cycles + 1, round(cycles / hz / scan_s))
    return Excitation(where, scans * scan_s, (cycles,), (1.0,), (0.0,), amplitude)


OFF = (
    "gear_error",
    "backlash",
    "hysteresis",
    "roller_friction",
    "motor_friction",
    "torque_ripple",
    "three_slopes",
)
LINEAR = with_values(
    MACHINE,
    {f"plant.switches.{name}": False for name in OFF}
    | {"drive.speed_loop.feedback": "ideal", "plant.switches.eccentric_moment": False},
)
SHORT = {"period_s": 4.0, "scan_s": 1e-3}


def ready(machine=LINEAR, angle_deg=0.0):
    probe = simulated_probe(machine, angle_deg)
    probe.enable()
    return probe


@pytest.mark.parametrize("where", list(Input))
def test_without_friction_the_axis_is_the_model(where):
    """The strongest check of the sampled model: the compiled loop itself, scan by scan, at 25 frequencies."""
    probe = ready()
    signal = fit_amplitude(probe, multisine(where, 0.5, 150.0, 25, **SHORT), 5.0)
    result = measure(probe, signal, settle_periods=9)
    model = model_ratios(LINEAR, Friction.NONE, 0.0, result.hz)
    if where is Input.SPEED:
        np.testing.assert_allclose(result.position_open, model.position_open, rtol=1e-2)
        np.testing.assert_allclose(result.speed_loop, model.speed_loop, rtol=1e-2)
        assert np.median(np.abs(result.plant / model.plant - 1.0)) < 2e-3
        assert np.max(np.abs(result.plant / model.plant - 1.0)) < 0.03
    else:
        # the torque is held for a scan, so its value at the scan is the plant's input only at higher frequencies
        fast = result.hz > 30.0
        np.testing.assert_allclose(result.plant[fast], model.plant[fast], rtol=0.1)


def test_one_sine_measures_one_frequency():
    probe = ready()
    signal = fit_amplitude(probe, sine(Input.SPEED, 20.0, 20, 1.0, 1e-3), 5.0)
    result = measure(probe, signal, settle_periods=4)
    assert result.hz == pytest.approx([20.0])
    assert result.torque_nm == pytest.approx([5.0], rel=0.15)
    model = model_ratios(LINEAR, Friction.NONE, 0.0, result.hz)
    np.testing.assert_allclose(result.speed_loop, model.speed_loop, rtol=5e-3)


def test_friction_is_a_spring_to_a_small_signal(measurements):
    small = measurements[0]
    assert small.typical_error < 0.1
    assert len(small.off) <= 2
    assert "holds like springs" in measured_sentence(small)


def test_a_larger_signal_makes_it_slide_at_low_frequencies(measurements):
    larger = measurements[1]
    low = larger.measured.hz < 1.5
    assert np.median(np.abs(larger.measured.plant / larger.model.plant)[low]) > 1.3
    assert set(larger.off) >= set(larger.measured.hz[low & (larger.trusted > 0.0)])
    assert "0.25..1." in measured_sentence(larger)


def test_turning_it_slides_and_the_axis_is_nearly_linear(measurements):
    turning = measurements[2]
    assert turning.typical_error < 0.1
    high = (turning.measured.hz > 15.0) & (turning.trusted > 0.0)
    np.testing.assert_allclose(
        np.abs(turning.measured.plant[high]), np.abs(turning.model.plant[high]), rtol=0.15
    )
    # the wrong model is told apart: held friction at low frequencies is 40 times stiffer
    held = model_ratios(MACHINE, Friction.HOLDING, 75.0, turning.measured.hz)
    assert np.abs(turning.measured.plant / held.plant)[0] > 30.0


def test_measurements_are_torque_limited(measurements):
    for result in measurements:
        assert np.all(result.measured.torque_nm <= 1.1 * result.condition.torque_nm)


def test_a_measurement_as_data(measurements):
    data = measured_data(measurements[0])
    assert (
        len(data["hz"])
        == len(data["measured"]["plant"]["magnitude"])
        == len(data["model"]["plant"]["phase_deg"])
    )
    assert data["model_friction"] == "holding"


@given(st.floats(0.3, 5.0), st.floats(2.0, 60.0), st.integers(2, 40))
def test_a_multisine_is_periodic_and_flat(low, ratio, count):
    signal = multisine(Input.TORQUE, low, low * ratio, count, 1e-3)
    period = signal.period(1e-3)
    spectrum = np.abs(np.fft.rfft(period)) / (len(period) / 2)
    lines = np.array(signal.lines)
    np.testing.assert_allclose(spectrum[lines], 1.0, rtol=1e-6)
    assert np.delete(spectrum, lines).max() < 1e-9
    crest = np.max(np.abs(period)) / np.sqrt(np.mean(period**2))
    assert crest < min(6.0, math.sqrt(2.0 * len(lines)) + 1e-9)  # 40 sines that peak together have 8.9


def test_a_speed_signal_falls_off_so_that_the_torque_does_not_grow():
    signal = multisine(Input.SPEED, 1.0, 100.0, 20, 1e-3)
    assert signal.weights[0] == 1.0
    assert signal.weights[-1] == pytest.approx(5.0 / 100.0, rel=0.01)


def test_frequencies_that_the_scan_cannot_carry_are_refused():
    for low, high in ((0.01, 10.0), (10.0, 1.0), (1.0, 600.0), (math.nan, 10.0)):
        with pytest.raises(UsageError, match="half the scan rate"):
            multisine(Input.SPEED, low, high, 5, 1e-3)


def test_too_few_periods_are_refused():
    probe = ready()
    with pytest.raises(UsageError, match="at least 4"):
        measure(probe, sine(Input.SPEED, 10.0, 10, 0.01, 1e-3), periods=3)


@pytest.mark.parametrize("torque", [0.0, -1.0, 128.5, math.nan])
def test_a_test_torque_beyond_the_limit_is_refused(torque):
    with pytest.raises(UsageError, match=r"above 0 and below the limit of 128\.5"):
        fit_amplitude(ready(), sine(Input.SPEED, 10.0, 10, 1.0, 1e-3), torque)


def test_too_much_torque_stops_the_axis():
    probe = ready()
    with pytest.raises(
        AlarmStop, match=r"permitted \+-128.5 N m; the signal is off, the axis makes a quick stop"
    ):
        probe.run(sine(Input.SPEED, 20.0, 20, 3.0, 1e-3), 2000)
    assert probe.drive.read().state is DriveState.QUICK_STOP_ACTIVE


def test_the_end_of_travel_stops_the_axis():
    probe = simulated_probe(LINEAR, 179.0)
    probe.enable()
    with pytest.raises(AlarmStop, match=r"permitted -180\.00 to 180\.00 deg"):
        probe.turn(rad(1.0))


def test_a_drive_that_falls_off_stops_the_measurement():
    probe = ready()
    probe.drive.trip(0x2310)
    with pytest.raises(AlarmStop, match="the drive is FAULT"):
        probe.run(None, 100)


def test_a_drive_that_does_not_come_up_is_named():
    limits = ProbeLimits(100.0, -3.0, 3.0, motion_limits(MACHINE))
    drive = sim_drive(MACHINE)
    drive.faults.mains_ready = False
    with pytest.raises(AlarmStop, match="not enabled with its brake open after 5 s"):
        Probe(drive, position_law(MACHINE), 1e-3, limits, 0.0).enable()


def test_it_needs_nothing_but_the_port():
    """The same probe on a drive without any plant: speed follows the command exactly one scan later."""
    counts = MACHINE.encoder.lines * MACHINE.encoder.interpolation
    drive = IdealDrive(1e-3, counts, MACHINE.axis.ratio, turns=4096)
    limits = ProbeLimits(100.0, -3.0, 3.0, motion_limits(MACHINE))
    probe = Probe(drive, position_law(MACHINE), 1e-3, limits, 0.0)
    probe.enable()
    record = probe.run(sine(Input.SPEED, 5.0, 5, 0.5, 1e-3), 2000)
    np.testing.assert_allclose(record["vel_act_rad_s"][1:], record["vel_cmd_rad_s"][:-1], atol=1e-9)


def test_turning_comes_to_rest_again():
    probe = ready()
    probe.turn(rad(0.5))
    moving = probe.run(None, 1000)["vel_act_rad_s"]
    assert np.mean(moving) / MACHINE.axis.ratio == pytest.approx(rad(0.5), rel=5e-3)
    probe.turn(0.0)
    assert abs(np.mean(probe.run(None, 500)["vel_act_rad_s"])) < 1e-2
    assert probe.drive.read().state is DriveState.OPERATION_ENABLED
    assert DriveRequest.ENABLE == 1


def test_a_way_that_does_not_fit_is_refused():
    with pytest.raises(UsageError, match=r"takes 54 deg: 152 to 206 deg must lie within"):
        measure_simulated(MACHINE, Condition("turning", 10.0, 0.3, 179.0, Friction.SLIDING))


GRID = np.geomspace(0.1, 100.0, 500)


def test_a_loop_whose_margin_is_negative_bears_a_delay_of_a_turn_less() -> None:
    """An integrator behind 2 s crosses 1 at 1 rad/s with 180 - 90 - 114.59 deg: 335.41 deg of delay turn it round."""
    (found,) = phase_margins(lambda w: np.exp(-2j * w) / (1j * w), GRID)
    assert (found.margin_deg, found.crossover_rad_s) == pytest.approx((-24.592, 1.0), abs=1e-3)
    assert found.delay_s == pytest.approx(math.radians(335.408), abs=1e-4)
    (sound,) = phase_margins(lambda w: np.exp(-0.5j * w) / (1j * w), GRID)
    assert sound.delay_s == pytest.approx(0.5 * math.pi - 0.5, abs=1e-6)


@pytest.mark.parametrize(("first_deg", "second_deg"), [(-100.0, 20.0), (100.0, -20.0), (30.0, 70.0)])
def test_the_crossover_that_counts_is_the_nearest_to_instability_on_either_side(
    first_deg: float, second_deg: float
) -> None:
    """Above 1 between 1 and 10 rad/s, with these margins there."""

    def loop(w: np.ndarray) -> np.ndarray:
        place = np.log10(w)
        margin_deg = first_deg + (second_deg - first_deg) * place
        return np.exp(place * (1.0 - place)) * np.exp(1j * np.radians(margin_deg - 180.0))

    found = smallest_phase_margin(loop, GRID)
    assert found is not None
    nearest = min((first_deg, second_deg), key=abs)
    assert found.margin_deg == pytest.approx(nearest, abs=1e-4)
    assert found.crossover_rad_s == pytest.approx(1.0 if nearest == first_deg else 10.0, rel=1e-6)


@pytest.mark.parametrize("torque_nm", [101.0, -101.0])
def test_torque_beyond_the_limit_stops_either_way(torque_nm):
    limits = ProbeLimits(100.0, -3.0, 3.0, motion_limits(MACHINE))
    counts = MACHINE.encoder.lines * MACHINE.encoder.interpolation
    drive = IdealDrive(1e-3, counts, MACHINE.axis.ratio, turns=4096)
    probe = Probe(drive, position_law(MACHINE), 1e-3, limits, 0.0)
    probe.enable()
    read = drive.read
    drive.read = lambda: read()._replace(torque_act_nm=torque_nm)
    with pytest.raises(AlarmStop, match=rf"the torque is {torque_nm:g} N m, permitted \+-100 N m"):
        probe.run(None, 10)
