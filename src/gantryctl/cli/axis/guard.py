"""The guarded run of a command that gives torque: it ends without torque, whatever happens."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from gantryctl.cli.options import stop_signals

if TYPE_CHECKING:
    from gantryctl.errors import GantryctlError
    from gantryctl.operation.client import AxisClient, BrakeTestReport, MotionReport

    Report = TypeVar("Report", MotionReport, BrakeTestReport)


def guarded(
    axis: AxisClient, action: Callable[[AxisClient], Report]
) -> tuple[Report | None, GantryctlError | None]:
    """Run an action under stop signals; whatever happens, the axis is left without torque and its state kept."""
    from gantryctl.errors import AlarmStop, CommandRefused
    from gantryctl.operation.client import Stop

    report: Report | None = None
    failure: GantryctlError | None = None
    alarm: AlarmStop | None = None
    result = "failed"

    # Signal handlers do no more than raise a flag: the run looks at it between two slices of scans.
    def stop() -> None:
        axis.stop = Stop.RAMP if axis.stop is Stop.NO else Stop.QUICK

    # The axis is never left with torque: refused, alarm, Ctrl-C or a bug, `close` runs.
    with stop_signals(stop):
        try:
            report = action(axis)
            result = report.text
            # Inside: an alarm on the way down ends the run like one on the way.
            axis.power_down()
        except AlarmStop as stopped:
            failure = alarm = stopped
            result = f"stopped by an alarm: {alarm}"
        except CommandRefused as refused:
            failure, result = refused, f"refused: {refused}"
        finally:
            axis.close(result, alarm)
    return report, failure
