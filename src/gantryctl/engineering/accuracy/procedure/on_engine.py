"""Driver of a chord test on the scan engine, with the PLC program and its monitors, as on a real drive.

Slower than `run_procedure` and with the same readings; in real time it takes as long as the machine would.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext

import numpy as np

from gantryctl.engineering.accuracy.procedure.on_batch import REST_S, Readings
from gantryctl.engineering.accuracy.procedure.plan import check_travel
from gantryctl.engineering.accuracy.procedure.procedures import Procedure
from gantryctl.machine import Machine
from gantryctl.operation.run import AxisRun
from gantryctl.operation.store import StateStore
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.trace.table import Trace

# Called at every stop with its index and target, deg.
Progress = Callable[[int, float], None]


def run_on_engine(
    machine: Machine, procedure: Procedure, *, real_time: bool = False, progress: Progress | None = None
) -> Readings:
    """Take a new machine through the procedure: power up, every stop with its dwell, power down.

    A machine whose drive is on a bus is no new one: it starts from what is retained, and where nothing tells the load's
    angle, all readings are of the motor side.

    Raises:
        UsageError: a stop lies outside the travel.
        AlarmStop: an alarm stopped the axis.
    """
    check_travel(machine, procedure)
    rows: list[tuple[float, float, float, float, float]] = []
    with nullcontext() if machine.plant_is_local else StateStore(machine) as store:
        session = AxisRun(machine, store, recorder=MemoryRecorder, real_time=real_time)
        recorder = session.engine.recorder
        assert isinstance(recorder, MemoryRecorder)
        try:
            session.power_up()
            session.move(procedure.start_deg)
            session.engine.run_for(REST_S)
            for index, stop in enumerate(procedure.stops):
                if progress is not None:
                    progress(index, stop.target_deg)
                recorder.forget()
                if index or stop.target_deg != procedure.start_deg:
                    session.move(stop.target_deg)
                session.engine.run_for(machine.accuracy.dwell_s)
                rows.append(_reading(recorder.trace(), machine))
            session.power_down()
        finally:
            session.close("accuracy run")
    load, ring, motor, vel_motor, vel_load = np.array(rows).T[:, np.newaxis, :]
    return Readings(load, ring, motor, vel_motor, vel_load, session.engine.time_s)


def _reading(trace: Trace, machine: Machine) -> tuple[float, float, float, float, float]:
    """Load, ring and motor angle averaged over the end of the dwell; speed errors of the move to it."""
    last = round(machine.accuracy.average_s / (machine.control.scan_period_ms * 1e-3))
    ratio, vel_ref = machine.axis.ratio, trace["vel_ref_rad_s"]
    act = trace["pos_act_rad"][-last:]
    vel_motor = trace["vel_act_rad_s"]
    # On a real machine nothing tells the load's angle: then all readings are of the motor side.
    load, base, vel_load = act, np.zeros_like(act), vel_motor
    if "pos_load_rad" in trace.columns:
        load, base, vel_load = (
            trace["pos_load_rad"][-last:],
            trace["pos_base_rad"][-last:],
            trace["vel_load_rad_s"],
        )
        vel_motor = trace["vel_motor_rad_s"] / ratio
    return (
        float(np.mean(load)),
        float(np.mean(load - base)),
        float(np.mean(act)),
        float(np.max(np.abs(vel_motor - vel_ref))),
        float(np.max(np.abs(vel_load - vel_ref))),
    )
