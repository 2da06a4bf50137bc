"""`gantryctl brake-test` and `gantryctl arm`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import (
    bus_log_option,
    config_option,
    confirm,
    directory,
    fresh_option,
    json_option,
    machine_of,
    out_option,
    print_json,
    proven_machine,
    refuse_local_options,
    service_option,
    take_over_option,
    to_service,
    write_text,
)
from gantryctl.cli.report import head_of, report_options
from gantryctl.terminal import tell

if TYPE_CHECKING:
    from gantryctl.engineering.report.head import Made
    from gantryctl.errors import GantryctlError
    from gantryctl.operation.client import AxisClient, BrakeTestReport


@click.command("brake-test")
@bus_log_option
@config_option
@fresh_option
@out_option
@report_options
@json_option
@service_option
@click.option("--yes", is_flag=True, help="Do not ask before a real drive, or the service, gives torque.")
@take_over_option
def brake_test(
    config_file: Path | None,
    fresh: bool,
    out: Path | None,
    as_json: bool,
    service: bool,
    yes: bool,
    take_over: bool,
    made: Made,
) -> int:
    """Test the closed brake: torque both ways for 2 s each, and nothing may move. Power must be off.

    With --out a report as well. Exit code 1 when the brake does not pass. Ctrl-C ends the test: torque off, drive
    disabled, the brake stays closed.
    """
    if to_service(service, config_file):
        from gantryctl.cli.axis.service_axis import ServiceAxis

        refuse_local_options({"fresh": fresh})
        axis = ServiceAxis(machine_of(config_file), take_over=take_over)
        axis.look()
        return _test(axis, out, made, yes=yes, as_json=as_json)
    from contextlib import nullcontext

    from gantryctl.operation.run import AxisRun
    from gantryctl.operation.store import StateStore

    # The failed test of an earlier run refuses motion, not the next test, which is the way out of it.
    machine = proven_machine(config_file)
    with nullcontext() if fresh else StateStore(machine) as store:
        return _test(AxisRun(machine, store, brake_test=True), out, made, yes=yes, as_json=as_json)


def _test(axis: AxisClient, out: Path | None, made: Made, *, yes: bool, as_json: bool) -> int:
    """Ask, test, print, report; the exit code."""
    # Torque against the closed brake of a real machine is asked for like a motion.
    from gantryctl.cli.axis.move import guarded
    from gantryctl.engineering.report.origin import origin_of
    from gantryctl.errors import CommandRefused
    from gantryctl.wiring.program import untestable

    machine = axis.machine

    def action(axis: AxisClient) -> BrakeTestReport:
        reason = untestable(machine)
        if reason:
            raise CommandRefused(f"not testable here: {reason}")
        if axis.must_ask and not yes:
            question = (
                f"{machine.name}: +-{machine.brake.test_torque_nm:g} N m against the closed brake. Test?"
            )
            confirm(question, "no torque was given")
        return axis.test_brake()

    # An alarm or a refusal ends it without a verdict; what was measured until then is still shown.
    folder = None if out is None else directory(out)
    ended, failure = guarded(axis, action)
    report = ended or axis.brake_test_report()
    code = _print(machine.name, report, failure, as_json=as_json)
    if folder is not None:
        from gantryctl.engineering.report.pages.brake_test import render_brake_test

        ended_by = "" if failure is None else str(failure)
        page = render_brake_test(report, ended_by, origin_of(machine), head_of(machine, made))
        click.echo(f"report: {write_text(folder / 'report.html', page).resolve()}", err=as_json)
    return code


def _print(name: str, report: BrakeTestReport, failure: GantryctlError | None, *, as_json: bool) -> int:
    code = failure.exit_code if failure is not None else int(not report.done)
    tested = failure is None
    if as_json:
        print_json(
            {
                "exit_code": code,
                "machine": name,
                "result": report.outcome.name.lower() if tested else None,
                "text": report.detail if tested else None,
                "level_nm": report.level_nm,
                "plus_nm": known(report.plus_nm),
                "minus_nm": known(report.minus_nm),
                "moved_deg": report.moved_deg,
                "limit_deg": report.limit_deg,
                "due_at": report.due.at,
                "power_ups_left": report.due.power_ups_left,
                "error": str(failure) if failure is not None else None,
            }
        )
    elif tested:
        click.echo(f"{name}: {report.text}: {report.detail}")
        for title, text in (
            ("torque asked for", f"+-{report.level_nm:.3g} N m at the motor, for 2 s each way"),
            ("plus", _torque(report.plus_nm)),
            ("minus", _torque(report.minus_nm)),
            ("moved", f"{report.moved_deg:.4f} deg, {report.limit_deg:.4f} deg allowed"),
            ("next test", report.due.words),
        ):
            click.echo(f"  {title:<18}{text}")
    if failure is not None:
        tell(f"error: {failure}")
    return code


def known(value: float) -> float | None:
    """A number for JSON, or None."""
    # Torque that was not held is NaN inside and null in JSON, which has no NaN.
    return value if math.isfinite(value) else None


def _torque(value: float) -> str:
    return f"{value:+.3g} N m held" if math.isfinite(value) else "not held"


@click.command()
@click.argument("action", type=click.Choice(["brake-test", "reset-locked"]))
@config_option
def arm(action: str, config_file: Path | None) -> int:
    """Arm ACTION at the running service for somebody else to execute within 10 s (serve --second-person).

    `brake-test --service` and `reset --service` arm by themselves where one person is enough.
    """
    from gantryctl.cli.axis.service_state import arm_for_another

    arm_for_another(machine_of(config_file), action.replace("-", "_"))
    return 0
