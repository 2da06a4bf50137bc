"""Identification over the bus of a drive: what 6064, 6077 and an instrument say, and nothing else."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gantryctl.engineering.analysis.measured.on_engine import EngineProbe, experiment
from gantryctl.engineering.analysis.measured.probe import FrequencyResponse, fit_amplitude, measure
from gantryctl.engineering.analysis.measured.speed_loop import (
    SpeedLoop,
    fit_speed_loop,
    measured_speed_loop,
    speed_loop_signal,
)
from gantryctl.engineering.identification import EngineAxis, SimulatedAxis
from gantryctl.engineering.identification.experiment import experiment_of
from gantryctl.engineering.identification.fit import _fit_windup
from gantryctl.engineering.identification.lead import Lead
from gantryctl.engineering.identification.measure import quiet_machine
from gantryctl.engineering.identification.samples import MoveLog, Samples, joined, steady
from gantryctl.engineering.identification.torque_balance import torque_balance
from gantryctl.engineering.instruments import Reading, SimulatedTracker, TrackerErrors
from gantryctl.errors import AlarmStop, InstrumentError, UsageError
from gantryctl.machine import Machine, configs_folder, load_machine, with_values
from gantryctl.operation.run import AxisRun
from gantryctl.units import deg, rad
from gantryctl.wiring import virtual as virtual_wiring

MACHINE = load_machine(configs_folder() / "hust_can.toml")
PERIOD_S = 0.004


def response_of(machine: Machine) -> FrequencyResponse:
    with experiment(machine) as run:
        run.move(60.0)
        run.begin_move(100.0, 0.6)
        run.follow(3.0)
        probe = EngineProbe(run, 128.0)
        signal = fit_amplitude(probe, speed_loop_signal(PERIOD_S), 40.0)
        seen = measure(probe, signal, settle_periods=1, periods=5)
        run.halt()
    return seen


@pytest.fixture(scope="module")
def response() -> FrequencyResponse:
    return response_of(MACHINE)


@pytest.fixture(scope="module")
def loop(response: FrequencyResponse) -> SpeedLoop:
    return fit_speed_loop(response, PERIOD_S)


def test_the_speed_loop_of_a_drive_on_a_bus_is_read_from_its_position_and_torque(loop: SpeedLoop) -> None:
    """The bus holds every command for 4 ms, so frequencies up to 120 Hz carry what is known; the drive's own delays of
    0.4 ms are one lag in the model, and trade some per cent with the gains.
    """
    settings = MACHINE.drive.speed_loop
    assert loop.kvp_nm_s_per_rad == pytest.approx(settings.kvp_nm_s_per_rad, rel=0.06)
    assert loop.tvi_s == pytest.approx(settings.tvi_ms * 1e-3, rel=0.12)
    assert loop.inertia_kg_m2 == pytest.approx(0.362, rel=0.03)
    # A command acts at the next SYNC; computing, current and the age of the reading are 0.515 ms. 5 % of a cycle.
    assert loop.dead_time_s == pytest.approx(PERIOD_S + 0.000515, abs=0.05 * PERIOD_S)


@pytest.mark.slow
def test_a_slower_drive_has_more_dead_time(loop: SpeedLoop) -> None:
    """The liar of the figure above: a drive whose current takes 1.6 ms more must show it."""
    machine = with_values(MACHINE, {"drive.current_loop.bandwidth_hz": 85.0})
    slow = fit_speed_loop(response_of(machine), PERIOD_S)
    lag_s = 1.0 / (2.0 * np.pi) * (1.0 / 85.0 - 1.0 / MACHINE.drive.current_loop.bandwidth_hz)
    assert slow.dead_time_s - loop.dead_time_s == pytest.approx(lag_s, abs=0.05 * PERIOD_S)


def test_torque_at_the_scans_is_less_than_its_mean_while_the_command_rises_in_steps(loop: SpeedLoop) -> None:
    """A rotor J behind a gain K follows each step of a held command as 1 - exp(-t K/J): with J/K = 4.5 ms the torque
    that a scan of 4 ms sees lacks J - K T e/(1 - e), e = exp(-T K/J), of the acceleration; integrator and lag take
    a little more or less.
    """
    time_s = loop.inertia_kg_m2 / loop.kvp_nm_s_per_rad
    e = float(np.exp(-PERIOD_S / time_s))
    lack = loop.inertia_kg_m2 - loop.kvp_nm_s_per_rad * PERIOD_S * e / (1.0 - e)
    assert loop.sampled_torque_lack_kg_m2(PERIOD_S) == pytest.approx(lack, rel=0.25)
    # Four times as many steps, a quarter of the kick.
    assert loop.sampled_torque_lack_kg_m2(0.25 * PERIOD_S) < 0.35 * lack


def test_a_drive_without_torque_is_refused_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    made = virtual_wiring.virtual_node
    monkeypatch.setattr(
        virtual_wiring,
        "virtual_node",
        lambda machine, angle_deg=0.0, state=None, _quirks=(): made(machine, angle_deg, state, ("sparse",)),
    )
    with pytest.raises(UsageError, match=r"does not report its torque \(6077"), experiment(MACHINE):
        pass


def test_a_torque_beyond_the_limit_stops_the_axis_and_the_signal() -> None:
    # The moment alone takes 12 N m at 60 deg.
    run = None

    def beyond() -> None:
        nonlocal run
        with experiment(MACHINE) as run:
            run.move(60.0)
            measured_speed_loop(EngineProbe(run, 15.0), 14.0)

    with pytest.raises(AlarmStop, match="measurement was stopped"):
        beyond()
    assert run is not None
    assert run.axis.is_off


class Broken:
    """An instrument that has lost its beam."""

    name = "broken"

    def read(self, time_s: float) -> Reading:
        raise InstrumentError("beam lost")


def test_an_instrument_that_gives_no_reading_ends_the_experiment_by_its_own_words() -> None:
    with pytest.raises(InstrumentError, match="beam lost"), experiment(MACHINE) as run:
        EngineAxis(MACHINE, run, Broken()).go(2.0, 1.0)


def tracker(run: AxisRun, seed: int, delay_s: float = 0.0) -> SimulatedTracker:
    """A tracker with the errors of a real one on the simulated load; `delay_s`: it answers so late."""
    truth = run.drive.truth_source
    assert truth is not None
    kept: list[float] = []
    steps = round(delay_s / 0.1)

    def angle(_: float) -> float:
        kept.append(deg(truth.truth()[0]))
        return kept[max(0, len(kept) - 1 - steps)]

    return SimulatedTracker(angle, seed, TrackerErrors())


def test_a_late_instrument_is_found_out_and_its_delay_is_no_lost_motion() -> None:
    """Late by one reading of 0.1 s: 0.1 deg at 1 deg/s, a hundred times the lost motion."""
    # Of the compiled loop, with a load that is read late; the fit is the same for every axis.
    axis = SimulatedAxis(with_values(MACHINE, {"drive.kind": "sim"}))

    def late(log: MoveLog) -> MoveLog:
        return log._replace(load_rad=log.load_rad - 0.1 * log.vel_rad_s)

    axis.go(50.0, 6.0)
    experiment = experiment_of(MACHINE)
    swings: list[Samples] = [
        steady(late(axis.go(to, 3.5)), experiment, cruise_only=False) for to in (130.0, 50.0)
    ]
    parts = joined(swings)
    balance = torque_balance(parts, MACHINE.axis.ratio, 0.362, 0.0).balance
    none = Lead(np.zeros(33), np.zeros(25), [], [], None, math.inf, np.zeros(0), None)
    _, delay_s = _fit_windup(parts, none, balance, 1000.0)
    # 8 % of the gear error of 80 deg looks like speed without a map: 0.002 of 3.5 deg/s
    assert delay_s == pytest.approx(0.1, abs=0.002)


def test_a_response_that_is_no_pi_is_refused(response: FrequencyResponse) -> None:
    """A notch filter in the drive, 20 dB at 40 Hz: the model must not take it for a gain."""
    s = 1j * response.hz / 40.0
    notch = (s * s + 0.05 * s + 1.0) / (s * s + 0.5 * s + 1.0)
    filtered = response._replace(position=response.position * notch, torque=response.torque * notch)
    with pytest.raises(UsageError, match="filters or an observer"):
        fit_speed_loop(filtered, PERIOD_S)


def test_a_reading_taken_between_two_scans_keeps_its_lead() -> None:
    """The engine's axis puts a reading on the next scan by the way of the motor meanwhile."""
    with experiment(MACHINE, controlled_as=quiet_machine(MACHINE)) as run:
        axis = EngineAxis(MACHINE, run, tracker(run, 1))
        log = axis.go(6.0, 1.0)
    read = np.isfinite(log.load_rad)
    assert np.count_nonzero(read) > 40
    # lost motion, wind-up and the tracker's 0.0003 deg
    assert np.max(np.abs(log.act_rad[read] - log.load_rad[read])) < rad(0.01)
