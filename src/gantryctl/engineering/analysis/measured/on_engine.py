"""A signal on a running machine: through the scan engine, with the PLC program and all its monitors.

The signal is added to the output of the program, so power sequence, monitors, travel and leases act as in every run.
60FF takes speeds and 60B2 torques; a drive adds 60B1 to 60FF, so a signal there would be the same one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Final

import numpy as np

from gantryctl.engineering.analysis.measured.excitation import Excitation
from gantryctl.engineering.analysis.measured.probe import RECORD_COLUMNS, Record
from gantryctl.engineering.analysis.models.linear import FloatArray
from gantryctl.engineering.analysis.models.sampled import Input
from gantryctl.errors import AlarmStop, UsageError
from gantryctl.image import DriveRequest, InputImage, OutputImage
from gantryctl.machine import Machine
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore
from gantryctl.program import Axis, GantryProgram
from gantryctl.program.alarms.codes import Code
from gantryctl.runtime.recorder import MemoryRecorder

# Motor side but the load-side reading, which is the ring's against its base.
_OWN_COLUMNS: Final = ("vel_added_rad_s", "torque_added_nm", "pos_ring_rad")


class ExcitedProgram(GantryProgram):
    """The shipped program with a signal on its output while the axis follows."""

    def __init__(self, axis: Axis) -> None:
        super().__init__(axis)
        self.trace_columns = (*axis.trace_columns, *_OWN_COLUMNS)
        self._torque_limit_nm = math.inf
        self._signal: list[float] = []
        self._to_torque = False
        self._step_rad_s = 0.0
        self._next = 0
        self._added = self._added_before = (0.0, 0.0)
        self._ring_rad = 0.0
        law = axis.settings.law
        self._vel_max = axis.settings.speed.command_clamp_rad_s * law.ratio

    def excite(self, excitation: Excitation, scan_s: float, torque_limit_nm: float) -> None:
        """Add this signal from the next scan on, from the start of its period.

        Args:
            torque_limit_nm: motor torque at which the signal ends and the axis makes a quick stop.
        """
        signal = excitation.period(scan_s)
        self._signal = signal.tolist()
        self._to_torque = excitation.where is Input.TORQUE
        steps = np.abs([signal[0] - self._added[0], *signal, *np.diff(signal, append=signal[0])])
        self._step_rad_s = 0.0 if self._to_torque else float(steps.max())
        self._torque_limit_nm = torque_limit_nm
        self._next = 0

    def end_signal(self) -> None:
        """Add nothing from the next scan on."""
        self._signal = []

    @property
    def signal_step_rad_s(self) -> float:
        """Most by which the signal may have changed the speed command in the last scan, also as it began or ended.

        0 before it and from the scan behind its end on, and for one of the torque.
        """
        return self._step_rad_s if self._added[0] or self._added_before[0] else 0.0

    def scan(self, image: InputImage) -> OutputImage:
        """One scan of the shipped program, with the signal on its output."""
        output = super().scan(image)
        self._ring_rad = image.drive.pos_ring_rad
        self._added, self._added_before = (0.0, 0.0), self._added
        if not self._signal:
            return output
        if not abs(image.drive.torque_act_nm) <= self._torque_limit_nm:
            self._signal = []
            torque_nm = image.drive.torque_act_nm
            self.axis.quick_stop(Code.CTL_23, measured=torque_nm, limit=self._torque_limit_nm)
            return output
        if output.request is not DriveRequest.ENABLE or not self.axis.virtual.following:
            return output
        added = self._signal[self._next % len(self._signal)]
        self._next += 1
        if self._to_torque:
            self._added = (0.0, added)
            return output._replace(torque_ff_nm=output.torque_ff_nm + added)
        # The clamp of the command holds for both together.
        total = max(-self._vel_max, min(self._vel_max, output.vel_cmd_rad_s + added))
        self._added = (total - output.vel_cmd_rad_s, 0.0)
        return output._replace(vel_cmd_rad_s=total)

    def trace_row(self) -> tuple[float, ...]:
        """Values of the last scan, in the order of `trace_columns`."""
        return (*super().trace_row(), *self._added, self._ring_rad)


class EngineProbe:
    """A machine under power whose program is an `ExcitedProgram`, as an axis for frequency responses.

    Args:
        run: made with `ExcitedProgram` and `MemoryRecorder`.
        torque_limit_nm: motor torque that stops a measurement.
    """

    def __init__(self, run: AxisRun, torque_limit_nm: float) -> None:
        program, recorder = run.engine.program, run.engine.recorder
        assert isinstance(program, ExcitedProgram)
        assert isinstance(recorder, MemoryRecorder)
        self._run, self._program, self._recorder = run, program, recorder
        self._ratio = run.axis.settings.law.ratio
        self.torque_limit_nm = torque_limit_nm
        self.scan_s = run.engine.period_s
        self.step_rad = 2.0 * np.pi / run.axis.settings.law.counts_per_turn

    def run(self, excitation: Excitation | None, scans: int) -> Record:
        """Run so many scans with the signal added, from the start of its period.

        Raises:
            AlarmStop: an alarm, or a torque beyond the limit; the axis was stopped.
        """
        self._recorder.forget()
        if excitation is not None:
            self._program.excite(excitation, self.scan_s, self.torque_limit_nm)
        try:
            self._run.follow(scans * self.scan_s)
        except AlarmStop as alarm:
            raise AlarmStop(f"the measurement was stopped: {alarm}", alarm.code) from alarm
        finally:
            self._program.end_signal()
        return self._record()

    def _record(self) -> Record:
        trace, ratio = self._recorder.trace(), self._ratio
        law: FloatArray = ratio * trace["vel_cmd_rad_s"]
        # The mean over a scan, as the simulated drive reports it: a drive on a bus may average 606C as it likes.
        moved: FloatArray = ratio * np.diff(trace["pos_act_rad"]) / self.scan_s
        values = (
            law + trace["vel_added_rad_s"],
            law,
            np.concatenate([moved[:1], moved]),
            trace["torque_act_nm"],
            ratio * trace["pos_err_rad"],
        )
        return dict(zip(RECORD_COLUMNS, values, strict=True))


@contextmanager
def experiment(
    machine: Machine,
    *,
    controlled_as: Machine | None = None,
    agree: Callable[[AxisRun], None] | None = None,
    needs_torque: bool = True,
) -> Iterator[AxisRun]:
    """Power a machine up for an experiment, and down again whatever happens.

    A simulated machine of this process is new and forgotten afterwards; of every other one the retained state, the
    commissioning record and all proofs count as in every run.

    Args:
        controlled_as: the machine by whose control and profile it runs.
        agree: called with the open axis before power is switched on; raises to refuse.
        needs_torque: the experiment reads the motor torque.

    Raises:
        CommandRefused: power cannot be switched on. UsageError: the drive reports no torque.
        AlarmStop: an alarm stopped the axis.
    """
    local = machine.plant_is_local
    with nullcontext() if local else StateStore(machine) as store:
        run = AxisRun(
            (controlled_as or machine) if local else machine,
            store,
            program=ExcitedProgram,
            recorder=MemoryRecorder,
            controlled_as=controlled_as,
        )
        result, alarm = "experiment", None
        try:
            if needs_torque and not run.drive.reports_torque:
                raise UsageError(
                    f"{machine.name}: the drive does not report its torque (6077 is missing or cannot be mapped): "
                    "moment, inertia, friction and speed loop cannot be measured · use a drive with 6077, or run "
                    "without what needs them"
                )
            if agree is not None:
                agree(run)
            run.power_up()
            yield run
            run.power_down()
        except AlarmStop as stopped:
            result, alarm = "stopped by an alarm", stopped
            raise
        finally:
            run.close(result, alarm)
