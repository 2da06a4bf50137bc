"""Any machine under test through the scan engine: its PLC program, its monitors, its drive.

What is recorded is what the drive reports, 6064 and 6077 on a bus, and what the instrument says; of a simulated plant
nothing is read but through a simulated instrument.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Final

import numpy as np

from gantryctl.engineering.analysis.measured.on_engine import EngineProbe
from gantryctl.engineering.analysis.measured.speed_loop import SpeedLoop, measured_speed_loop
from gantryctl.engineering.identification.experiment import experiment_of
from gantryctl.engineering.identification.measure import TORQUE_LIMIT_SHARE
from gantryctl.engineering.identification.samples import MoveLog
from gantryctl.engineering.instruments import Instrument
from gantryctl.errors import CommandRefused, InstrumentError, UsageError
from gantryctl.machine import Machine
from gantryctl.machine.places import reach_deg
from gantryctl.operation.client import Snapshot
from gantryctl.operation.run import AxisRun
from gantryctl.operation.sliced_scan import SLICE_S
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace
from gantryctl.units import rad

Progress = Callable[[str], None]

# Of the travel, kept where the speed loop is measured.
_MARGIN_DEG: Final = 0.5
_CALM_S: Final = 3.0


class _Readings:
    """Readings of an instrument beside a run, each with its time.

    In virtual time the axis waits for them. In real time they are taken in a thread of their own: a tracker that
    answers late makes no scan late.

    Attributes:
        rows: time, angle and its standard uncertainty, s and rad.
        fault: why the last reading failed.
    """

    def __init__(self, instrument: Instrument) -> None:
        self._instrument = instrument
        self.rows: list[tuple[float, float, float]] = []
        self.fault: InstrumentError | None = None

    def take(self, begin_s: float, end_s: Callable[[], float]) -> None:
        """Read once; the time of a reading is the middle of its question and its answer."""
        try:
            reading = self._instrument.read(begin_s)
        except InstrumentError as fault:
            self.fault = fault
            return
        self.rows.append((0.5 * (begin_s + end_s()), rad(reading.angle_deg), rad(reading.uncertainty_deg)))

    @contextmanager
    def beside(self, now_s: Callable[[], float]) -> Iterator[None]:
        """Read on and on in a thread."""
        done = threading.Event()

        def read() -> None:
            while not done.wait(0.5 * SLICE_S):
                self.take(now_s(), now_s)

        thread = threading.Thread(target=read, name="instrument", daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()


class EngineAxis:
    """A machine under test.

    Args:
        run: of `experiment`, controlled as `quiet_machine(machine)`.
        instrument: what watches the load.
        progress: called with what begins.
    """

    sees_space = True

    def __init__(
        self, machine: Machine, run: AxisRun, instrument: Instrument, progress: Progress | None = None
    ) -> None:
        recorder = run.engine.recorder
        assert isinstance(recorder, MemoryRecorder)
        self.machine, self._run, self._recorder = machine, run, recorder
        self._experiment = experiment_of(machine)
        self._readings = _Readings(instrument)
        self.instrument = instrument.name
        self.has_ring = machine.can.load_encoder.source != "none"
        self._progress = progress
        self._real_time = machine.paced_by_clock
        run.observe(self._look)

    @property
    def encoder_serial(self) -> str:
        """Serial number of the motor encoder, as the drive says it."""
        return self._run.drive.identity().encoder_serial

    @property
    def time_s(self) -> float:
        """Axis time so far."""
        return self._run.engine.time_s

    def _look(self, snapshot: Snapshot) -> None:
        if not self._real_time:
            # The last row of the trace, and the state that an instrument sees now, are one period old.
            time_s = snapshot.time_s - self._run.engine.period_s
            self._readings.take(time_s, lambda: time_s)

    def go(self, to_deg: float, vel_deg_s: float) -> MoveLog:
        """Move and settle.

        Raises:
            AlarmStop: the axis was stopped. CommandRefused: somebody asked it to stop.
            InstrumentError: the instrument gave no reading.
        """
        self._say(f"to {self.machine.axis.dial.text(to_deg, '.1f')} deg at {vel_deg_s:g} deg/s")
        run, readings = self._run, self._readings
        self._recorder.forget()
        readings.rows.clear()
        speed, override = self._speed(vel_deg_s)
        with readings.beside(lambda: self.time_s) if self._real_time else nullcontext():
            report = run.move(to_deg, speed, override)
            if not report.done:
                target = self.machine.axis.dial.text(to_deg)
                raise CommandRefused(f"the move to {target} deg ended early: {report.ending.name.lower()}")
            run.follow(self._experiment.settle_s)
        if not readings.rows:
            raise readings.fault or InstrumentError(f"{self.instrument}: no reading during a move")
        return self._log(self._recorder.trace())

    def _speed(self, vel_deg_s: float) -> tuple[float, float]:
        """Speed setting and override: below the smallest setting only the override goes."""
        lowest = self.machine.speed.setting_min_deg_s
        return min(max(vel_deg_s, lowest), self._run.speed_max_deg_s), min(1.0, vel_deg_s / lowest)

    def _log(self, trace: Trace) -> MoveLog:
        time_s, act, period_s = trace["time_s"], trace["pos_act_rad"], self._run.engine.period_s
        taken, angle, uncertainty = np.array(self._readings.rows).T
        row = np.searchsorted(time_s, taken)
        inside = (row > 0) & (row < len(time_s))
        row, taken, angle = row[inside], taken[inside], angle[inside]
        load = np.full(len(time_s), np.nan)
        # Between two scans the lead, not the angle, is what hardly changes.
        load[row] = act[row] - (np.interp(taken, time_s, act) - angle)
        return MoveLog(
            period_s=period_s,
            act_rad=act,
            load_rad=load,
            ring_rad=trace["pos_ring_rad"],
            vel_rad_s=trace["vel_ref_rad_s"],
            acc_rad_s2=trace["acc_ref_rad_s2"],
            torque_nm=trace["torque_act_nm"],
            block=round(SLICE_S / period_s),
            uncertainty_rad=float(uncertainty.max()),
        )

    def speed_loop(self, torque_nm: float) -> SpeedLoop:
        """Turn slowly from where the axis stands, excite the speed loop, come to rest."""
        run = self._run
        self._say("the speed loop of the drive, turning slowly")
        turning_deg_s = self._experiment.speed_loop_deg_s
        # To the end of the travel: the measurement is over before.
        run.begin_move(reach_deg(self.machine)[1] - _MARGIN_DEG, *self._speed(turning_deg_s))
        run.follow(_CALM_S + turning_deg_s / self._experiment.swing_acc_deg_s2)
        probe = EngineProbe(run, TORQUE_LIMIT_SHARE * self.machine.motor.torque_rated_nm)
        try:
            found = measured_speed_loop(probe, torque_nm)
        except UsageError:
            run.halt()
            raise
        run.halt()
        return found

    def _say(self, what: str) -> None:
        if self._progress is not None:
            self._progress(what)
