"""`gantryctl move` and `gantryctl jog`, and the guarded run of a command that gives torque."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import click

from gantryctl.cli.options import (
    SignedCommand,
    bus_log_option,
    config_option,
    confirm,
    fresh_option,
    json_option,
    machine_of,
    out_option,
    proven_machine,
    real_time_option,
    refuse_local_options,
    seed_option,
    service_option,
    stop_signals,
    take_over_option,
    to_service,
)
from gantryctl.cli.values import FINITE

if TYPE_CHECKING:
    from gantryctl.engineering.accuracy.attended.session import ChordSession
    from gantryctl.errors import GantryctlError
    from gantryctl.image import Direction
    from gantryctl.machine import Machine
    from gantryctl.operation.client import AxisClient, BrakeTestReport, MotionReport

    Report = TypeVar("Report", MotionReport, BrakeTestReport, ChordSession)

# An axis that has moved by more is not where it was when the person was asked.
_SAME_DEG: Final = 0.01
# A rotary table would go the other way round from here on; a rounding error is no longer way.
_LONG_WAY_DEG: Final = 180.0 + 1e-7


def _run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options of a command that runs the axis."""
    for option in (
        config_option,
        click.option("--program", "program_name", help="FILE:CLASS of a custom program."),
        click.option("--no-trace", is_flag=True, help="Write no recording."),
        out_option,
        seed_option,
        fresh_option,
        real_time_option,
        json_option,
        service_option,
        click.option(
            "--yes", is_flag=True, help="Do not ask before a real axis moves, here or at the service."
        ),
        take_over_option,
        bus_log_option,
    ):
        command = option(command)
    return command


@click.command(cls=SignedCommand)
@click.argument("target", type=FINITE, required=False)
@click.option("--by", "distance", type=FINITE, help="Move by this angle from where the axis is, deg.")
@click.option(
    "--direction",
    type=click.Choice(["shortest", "positive", "negative", "current"]),
    help="Way of a modulo axis to TARGET; shortest when not given. A linear axis has one way.",
)
@click.option("--speed", type=FINITE, help="deg/s; the highest setting when not given.")
@click.option("--override", type=FINITE, default=100.0, show_default=True, help="Speed override, percent.")
@_run_options
def move(
    target: float | None,
    distance: float | None,
    direction: str | None,
    override: float,
    speed: float | None,
    yes: bool,
    **run: Any,
) -> int:
    """Move to TARGET (deg), or by an angle with --by. A linear axis has a cable: never the shortest way.

    Ctrl-C stops on the jog-release ramp; a second one is a quick stop.
    """
    from gantryctl.errors import UsageError

    if (target is None) == (distance is None):
        raise UsageError(
            "give a target angle, or --by and an angle: gantryctl move 90, gantryctl move --by -5.5"
        )
    if direction is not None and target is None:
        raise UsageError("--by has its direction in its sign: leave --direction out")
    # Below 1 % a long move would take days: 180 deg at the lowest setting and 0.1 % is more than three of them.
    if not 1.0 <= override <= 100.0:
        raise UsageError(f"--override {override:g}: from 1 to 100 percent")

    def action(axis: AxisClient) -> MotionReport:
        from gantryctl.image import Direction

        wanted = axis.speed_max_deg_s if speed is None else speed
        shortest = Direction.SHORTEST if axis.machine.axis.modulo else None
        chosen = shortest if direction is None else Direction[direction.upper()]
        end = None if target is None else axis.machine.axis.meant_deg(target)
        if axis.must_ask:
            # First of all: control at a service may stop what moves (--take-over).
            _check_speed(axis, wanted)
        if axis.must_ask and not yes:
            # Without a claim on the axis: at a service, control is lost after 2 s of silence.
            here = axis.angle_deg
            end = here + (distance or 0.0) if end is None else end
            click.echo(_way(axis, here, end, wanted, distance, chosen), err=run["as_json"])
            confirm("Move?", "nothing moved")
            _check_unmoved(axis.machine, here, axis.take())
        else:
            here = axis.take()
            end = here + (distance or 0.0) if end is None else end
            remark = (
                _way(axis, here, end, wanted, distance, chosen)
                if axis.must_ask
                else way_note(axis.machine, here, end)
            )
            if remark and not run["as_json"]:
                click.echo(remark)
        if distance is not None:
            return axis.move_by(distance, speed, override / 100.0)
        return axis.move(end, speed, override / 100.0, chosen)

    return _run(action, "move", **run)


@click.command(cls=SignedCommand)
@click.argument("direction", metavar="[+|-]", type=click.Choice(["+", "-"]))
@click.option("--speed", type=FINITE, help="deg/s; the lowest setting when not given.")
@click.option("--for", "seconds", type=FINITE, required=True, help="How long the key is held, s.")
@_run_options
def jog(direction: str, seconds: float, speed: float | None, yes: bool, **run: Any) -> int:
    """Hold-to-run motion in DIRECTION (+ or -) for a time, then the jog-release ramp.

    Ctrl-C lets go; a second one is a quick stop.
    """
    from gantryctl.errors import UsageError

    if not 0.0 < seconds <= 3600.0:
        raise UsageError(f"--for {seconds:g}: above 0 and at most 3600 s")

    def action(axis: AxisClient) -> MotionReport:
        wanted = axis.machine.speed.setting_min_deg_s if speed is None else speed
        # A key that is held needs no question: letting go stops the axis.
        return axis.jog(direction == "+", wanted, seconds)

    return _run(action, "jog", **run)


def _check_speed(axis: AxisClient, speed: float) -> None:
    from gantryctl.program.axis.command_checks import check_setting, require
    from gantryctl.units import rad
    from gantryctl.wiring.program import speed_settings

    # By the machine file without a word to the service, then by what its ledger leaves of that.
    require(check_setting(rad(speed), speed_settings(axis.machine)))
    require(check_setting(rad(speed), speed_settings(axis.machine, axis.speed_max_deg_s)))


def _way(
    axis: AxisClient,
    here: float,
    end: float,
    speed: float,
    distance: float | None,
    direction: Direction | None,
) -> str:
    """Say what a move would do and what a stop takes.

    Raises:
        CommandRefused: the target is not possible.
    """
    from gantryctl.machine.derived import rigid_stop
    from gantryctl.program.axis.command_checks import check_destination, check_range, require
    from gantryctl.units import rad
    from gantryctl.wiring.program import travel_settings

    machine, travel = axis.machine, travel_settings(axis.machine)
    by_way = distance is not None and machine.axis.modulo
    require(
        check_range(rad(end), travel) if by_way else check_destination(rad(here), rad(end), direction, travel)
    )
    # Of the rigid body: what compliance adds is in `gantryctl stops`.
    stop, _ = rigid_stop(speed, axis.quick_dec_deg_s2, float("inf"))
    note = way_note(machine, here, end)
    way = f"{abs(end - here):.3f} deg"
    if machine.axis.modulo:
        way = f"{distance:+.3f} deg" if by_way else _turning(machine, here, end, direction)
    return (
        f"{machine.machine.name} ({machine.drive.kind}): from {machine.axis.dial.text(here, '.3f')} "
        f"to {machine.axis.dial.text(end, '.3f')} deg, way {way} at {speed:g} deg/s, a quick stop takes {stop:.2f} deg"
        + (f"; {note}" if note else "")
    )


def _turning(machine: Machine, here: float, end: float, direction: Direction | None) -> str:
    """Way of a modulo axis to an angle, with its sign."""
    from gantryctl.image import Direction
    from gantryctl.program.axis.command_checks import way_to
    from gantryctl.units import deg, rad

    if direction is Direction.CURRENT:
        return "in the direction of the last motion"
    window = rad(machine.monitors.in_position_window_deg)
    return f"{deg(way_to(rad(here), rad(end), direction or Direction.SHORTEST, window)):+.3f} deg"


def way_note(machine: Machine, here_deg: float, target_deg: float) -> str | None:
    """Remark on a move that a rotary table would make the other way round; this axis has a cable."""
    if machine.axis.modulo:
        return None
    way_deg = abs(target_deg - here_deg)
    inside = machine.axis.pos_min_deg <= target_deg <= machine.axis.pos_max_deg
    return f"{way_deg:.0f} deg the long way: cable" if inside and way_deg > _LONG_WAY_DEG else None


def _check_unmoved(machine: Machine, asked: float, now: float) -> None:
    moved = now - asked
    if machine.axis.modulo:
        moved -= 360.0 * round(moved / 360.0)
    if abs(moved) > _SAME_DEG:
        from gantryctl.errors import CommandRefused

        raise CommandRefused(
            f"the axis stood at {machine.axis.dial.text(asked, '.3f')} deg when you were asked, now at "
            f"{machine.axis.dial.text(now, '.3f')} deg: look, then ask again"
        )


def _run(
    action: Callable[[AxisClient], MotionReport],
    name: str,
    *,
    config_file: Path | None,
    service: bool,
    take_over: bool,
    as_json: bool,
    **local: Any,
) -> int:
    """Run one command on the axis, here or at the service; the exit code."""
    # The machine file need not be proven here: the service has done that with its own when it started.
    if to_service(service, config_file):
        from gantryctl.cli.axis.service_axis import ServiceAxis

        refuse_local_options(local)
        axis = ServiceAxis(machine_of(config_file), take_over=take_over)
        report, failure = guarded(axis, action)
        from gantryctl.cli.axis.display import print_motion

        return print_motion(axis.machine, report, failure, as_json=as_json)
    from gantryctl.cli.axis.display import print_motion
    from gantryctl.cli.axis.local_run import local_run

    machine = proven_machine(config_file)
    with local_run(machine, name, as_json=as_json, **local) as run:
        report, failure = guarded(run.axis, action)
        return print_motion(machine, report, failure, run.details(report), as_json=as_json)


def guarded(
    axis: AxisClient, action: Callable[[AxisClient], Report]
) -> tuple[Report | None, GantryctlError | None]:
    """Run an action under stop signals; whatever happens, the axis is closed and its state kept."""
    from gantryctl.errors import AlarmStop, CommandRefused
    from gantryctl.operation.client import Ending, Stop

    report: Report | None = None
    failure: GantryctlError | None = None
    alarm: AlarmStop | None = None
    result = "failed"

    # Signal handlers do no more than raise a flag: the run looks at it between two slices of scans.
    def stop() -> None:
        axis.stop = Stop.RAMP if axis.stop is Stop.NO else Stop.QUICK

    # The axis is never left with torque: refused, alarm, Ctrl-C or a bug, `close` runs. Where torque alone holds the
    # load, it lasts until somebody has asked twice for the end.
    def hung_up() -> None:
        if axis.stop is Stop.NO:
            axis.stopped_as = Ending.HUNG_UP
        stop()

    with stop_signals(stop, hung_up):
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
