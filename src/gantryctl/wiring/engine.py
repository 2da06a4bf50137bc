"""Machine file to a running engine."""

from __future__ import annotations

from collections.abc import Callable

from gantryctl.drives.canopen import CanopenDrive
from gantryctl.machine import Machine
from gantryctl.ports import Clock, Drive, Operator, Recorder, Truth
from gantryctl.program import Axis, AxisProgram, GantryProgram
from gantryctl.runtime import Engine, FixedOperator, OverrunPolicy, RealClock, VirtualClock, trace_columns
from gantryctl.wiring.canopen import in_virtual_time
from gantryctl.wiring.compensation import check_calibration
from gantryctl.wiring.drives import delivered_zero_counts, drive_of
from gantryctl.wiring.program import axis_settings

ProgramFactory = Callable[[Axis], AxisProgram]
RecorderFactory = Callable[[tuple[str, ...]], Recorder]


def build_engine(
    machine: Machine,
    *,
    program: ProgramFactory = GantryProgram,
    operator: Operator | None = None,
    drive: Drive | None = None,
    zero_counts: float | None = None,
    holding_torque_nm: float = 0.0,
    recorder: RecorderFactory | None = None,
    real_time: bool = False,
    keep_plans: bool = False,
) -> Engine:
    """An engine with the machine's drive, standing with power off.

    Args:
        program: made from the axis; the shipped program, or a class derived from `AxisProgram`.
        operator: where commands come from; a `FixedOperator` (`engine.operator.command`) when not given.
        drive: an open drive; a new machine standing at 0 deg when not given.
        zero_counts: encoder count at 0 deg (retained memory); that of a new machine when not given.
        holding_torque_nm: what held the load last time: the preload of the first release of the brake.
        recorder: makes a recorder for the columns of the trace; none when not given.
        real_time: pace the scans by the clock; a real drive on a bus always is.
        keep_plans: keep every set-point plan with its start scan in `axis.virtual.plans`.
    """
    if drive is None:
        drive = drive_of(machine)
    if machine.control.compensation.needs_calibration and machine.drive.kind != "ideal":
        check_calibration(machine, drive.identity().encoder_serial)
    if zero_counts is None:
        zero_counts = float(delivered_zero_counts(machine))
    on_bus = isinstance(drive, CanopenDrive)
    preload = not isinstance(drive, CanopenDrive) or drive.torque_preload
    settings = axis_settings(machine, holding_torque_nm, preload)
    real_time = real_time or not in_virtual_time(machine)
    made = program(Axis(settings, zero_counts, keep_plans=keep_plans))
    truth = drive if isinstance(drive, Truth) else None
    clock: Clock = RealClock(settings.period_s) if real_time else VirtualClock()
    return Engine(
        drive,
        made,
        operator or FixedOperator(),
        clock,
        settings.period_s,
        recorder=recorder(trace_columns(made, truth)) if recorder is not None else None,
        truth=truth,
        # the simulated plant waits for a late scan: nothing runs away; a drive on a bus does not
        overrun_policy=OverrunPolicy.QUICK_STOP if on_bus and real_time else OverrunPolicy.CONTINUE,
    )
