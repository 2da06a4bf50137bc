"""Machine file to a running engine."""

from __future__ import annotations

from collections.abc import Callable

from gantryctl.devices.ideal import IdealDrive
from gantryctl.devices.sim import SimDrive
from gantryctl.machine import Machine
from gantryctl.ports import Clock, Operator, Recorder
from gantryctl.program import Axis, AxisProgram, GantryProgram
from gantryctl.runtime import Engine, HeldOperator, OverrunPolicy, RealClock, VirtualClock, trace_columns
from gantryctl.wiring.compensation import check_calibration
from gantryctl.wiring.drives import delivered_zero_counts, ideal_drive, sim_drive
from gantryctl.wiring.settings import axis_settings

ProgramFactory = Callable[[Axis], AxisProgram]
RecorderFactory = Callable[[tuple[str, ...]], Recorder]


def build_engine(
    machine: Machine,
    *,
    program: ProgramFactory = GantryProgram,
    operator: Operator | None = None,
    drive: SimDrive | IdealDrive | None = None,
    zero_counts: float | None = None,
    holding_torque_nm: float = 0.0,
    recorder: RecorderFactory | None = None,
    real_time: bool = False,
    keep_plans: bool = False,
) -> Engine:
    """An engine with the machine's drive, standing with power off.

    Args:
        program: made from the axis; the shipped program, or a class derived from `AxisProgram`.
        operator: where commands come from; a `HeldOperator` (`engine.operator.command`) when not given.
        drive: an open drive; a new machine standing at 0 deg when not given.
        zero_counts: encoder count at 0 deg (retained memory); that of a new machine when not given.
        holding_torque_nm: what held the load last time: the preload of the first release of the brake.
        recorder: makes a recorder for the columns of the trace; none when not given.
        real_time: pace the scans by the clock.
        keep_plans: keep every set-point plan with its start scan in `axis.virtual.plans`.
    """
    if drive is None:
        drive = ideal_drive(machine) if machine.drive.kind == "ideal" else sim_drive(machine)
    if machine.control.compensation.needs_calibration and isinstance(drive, SimDrive):
        check_calibration(machine, drive.identity().encoder_serial)
    if zero_counts is None:
        zero_counts = float(delivered_zero_counts(machine))
    settings = axis_settings(machine, holding_torque_nm)
    made = program(Axis(settings, zero_counts, keep_plans=keep_plans))
    truth = drive if isinstance(drive, SimDrive) else None
    clock: Clock = RealClock(settings.period_s) if real_time else VirtualClock()
    return Engine(
        drive,
        made,
        operator or HeldOperator(),
        clock,
        settings.period_s,
        recorder=recorder(trace_columns(made, truth)) if recorder is not None else None,
        truth=truth,
        # the simulated plant waits for a late scan: nothing runs away
        overrun_policy=OverrunPolicy.CONTINUE,
    )
