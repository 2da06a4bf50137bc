"""Machine file to a running engine."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from gantryctl.errors import ConfigError
from gantryctl.machine import Machine, short_hash
from gantryctl.ports import Clock, Drive, Operator, Recorder
from gantryctl.program import Axis, AxisProgram, GantryProgram
from gantryctl.program.settings import AxisSettings
from gantryctl.runtime import Engine, FixedOperator, OverrunPolicy, RealClock, VirtualClock, trace_columns
from gantryctl.runtime.stopping import REFERENCE_STOP, StopTimes
from gantryctl.wiring.compensation import check_calibration
from gantryctl.wiring.program import axis_settings

if TYPE_CHECKING:
    from gantryctl.trace.files import Metadata

ProgramFactory = Callable[[Axis], AxisProgram]
RecorderFactory = Callable[[tuple[str, ...]], Recorder]


def drive_of(
    machine: Machine, angle_deg: float | None = None, state: Mapping[str, float] | None = None
) -> Drive:
    """Drive of the kind in the machine file; a real one on a bus as it stands.

    Args:
        angle_deg: angle of a new simulated gantry; [axis] start_angle_deg when not given.
        state: an earlier `plant_state` of such a drive, to go on from; `angle_deg` is ignored then.

    Raises:
        ValueError, KeyError: the state lacks a value or has a non-finite one.
    """
    # Imported here: a controller on a bus loads no simulator, and a simulation no bus.
    if machine.on_bus:
        from gantryctl.wiring.canopen import canopen_drive

        return canopen_drive(machine, angle_deg, state)
    from gantryctl.wiring.simulator import ideal_drive, sim_drive

    return (ideal_drive if machine.drive.kind == "ideal" else sim_drive)(machine, angle_deg, state)


def build_program(
    machine: Machine,
    drive: Drive,
    program: ProgramFactory = GantryProgram,
    *,
    zero_counts: float | None = None,
    holding_torque_nm: float = 0.0,
    speed_max_deg_s: float = math.inf,
    quick_dec_deg_s2: float | None = None,
    keep_plans: bool = False,
) -> AxisProgram:
    """Program of a machine with its axis, standing with power off.

    Args:
        drive: open; a calibration must belong to its encoder.
        program: the shipped program, or a class derived from `AxisProgram`.
        zero_counts: encoder count at 0 deg (retained memory); that of a new machine when not given.
        holding_torque_nm: torque that held the load last time, the preload of the first release of the brake.
        speed_max_deg_s: nothing moves faster, whatever the machine file allows (ledger of a drive on a bus).
        quick_dec_deg_s2: quick-stop ramp of a drive that has its own; that of the machine file when not given.
        keep_plans: keep every set-point plan with its start scan in `axis.virtual.plans`.

    Raises:
        ConfigError: a compensation needs a calibration, and the machine has none of its own; or the torque of the
            motor, which the drive does not report.
    """
    if machine.control.compensation.needs_calibration and machine.drive.kind != "ideal":
        check_calibration(machine, drive.identity().encoder_serial)
        if machine.control.compensation.moment_observer.active and not drive.reports_torque:
            raise ConfigError(
                [
                    f"{machine.name}: [control.compensation.moment_observer] active = true: lives on the torque of the "
                    "motor, which the drive does not report (6077 is not mapped); map it, or switch the observer off"
                ]
            )
    if zero_counts is None:
        from gantryctl.wiring.simulator import delivered_zero_counts

        zero_counts = float(delivered_zero_counts(machine))
    settings = axis_settings(
        machine,
        holding_torque_nm,
        drive.torque_preload,
        speed_max_deg_s,
        quick_dec_deg_s2,
        drive.identity().error_texts if machine.on_bus else {},
    )
    return program(Axis(settings, zero_counts, keep_plans=keep_plans))


def recording_metadata(machine: Machine) -> Metadata:
    """What every recording says of its machine."""
    return {
        "machine": machine.name,
        "config_hash": short_hash(machine),
        "period_s": machine.control.scan_period_ms * 1e-3,
        **machine.axis.dial.metadata(),
    }


def _recorder(machine: Machine, make: RecorderFactory, columns: tuple[str, ...]) -> Recorder:
    from gantryctl.runtime.recorder import MemoryRecorder

    made = make(columns)
    # The class itself was given, and it knows no machine.
    if isinstance(made, MemoryRecorder):
        made.metadata = {**recording_metadata(machine), **made.metadata}
    return made


def build_engine(
    machine: Machine,
    drive: Drive | None = None,
    program: AxisProgram | ProgramFactory = GantryProgram,
    operator: Operator | None = None,
    *,
    recorder: RecorderFactory | None = None,
    real_time: bool = False,
    keep_plans: bool = False,
) -> Engine:
    """Engine with the machine's drive, standing with power off.

    Args:
        drive: an open drive; a new machine standing at 0 deg when not given.
        program: of `build_program`, or what makes one: a class derived from `AxisProgram`.
        operator: where commands come from; a `FixedOperator` (`engine.operator.command`) when not given.
        recorder: makes a recorder for the columns of the trace: `MemoryRecorder` itself, not an object of it, for
            `engine.trace()`; or a function that takes the columns. Nothing is recorded when not given.
        real_time: pace the scans by the clock; a real drive on a bus always is.
        keep_plans: for a program made here, as in `build_program`.
    """
    if drive is None:
        drive = drive_of(machine)
    if not isinstance(program, AxisProgram):
        program = build_program(machine, drive, program, keep_plans=keep_plans)
    period_s = program.axis.settings.period_s
    real_time = real_time or machine.paced_by_clock
    clock: Clock = RealClock(period_s) if real_time else VirtualClock()
    truth = drive.truth_source
    return Engine(
        drive,
        program,
        operator or FixedOperator(),
        clock,
        period_s,
        recorder=None if recorder is None else _recorder(machine, recorder, trace_columns(program, truth)),
        truth=truth,
        # A simulated plant waits for a late scan and nothing is missed; a drive on a bus goes on with the last command
        # (decision 0005).
        overrun_policy=OverrunPolicy.QUICK_STOP if machine.on_bus and real_time else OverrunPolicy.CONTINUE,
        stop_times=_stop_times(program.axis.settings),
    )


def _stop_times(settings: AxisSettings) -> StopTimes:
    """Times of a stop behind a failed program, for ramp and brake of this machine."""
    least = REFERENCE_STOP
    ramp_s = settings.speed.setting_max_rad_s / settings.ramps.quick_dec_rad_s2
    return StopTimes(
        max(least.ramp_s, 2.0 * ramp_s), max(least.brake_s, 2.0 * settings.power.brake_close_time_s)
    )
