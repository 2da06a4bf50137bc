"""`gantryctl brake-test` and `gantryctl arm`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import (
    config_option,
    fresh_option,
    json_option,
    machine_of,
    print_json,
    proven_machine,
    service_option,
    to_service,
)

if TYPE_CHECKING:
    from gantryctl.errors import AlarmStop, GantryctlError
    from gantryctl.machine import Machine
    from gantryctl.operation.run import AxisRun
    from gantryctl.operation.store import StateStore
    from gantryctl.program import BrakeTestResult


@click.command("brake-test")
@config_option
@fresh_option
@json_option
@service_option
@click.option("--yes", is_flag=True, help="Do not ask before a real drive, or the service, gives torque.")
@click.option("--take-over", is_flag=True, help="With the service: take control from whoever has it.")
def brake_test(
    config_file: Path | None, fresh: bool, as_json: bool, service: bool, yes: bool, take_over: bool
) -> int:
    """Test the closed brake: torque both ways for 2 s each, and nothing may move. Power must be off.

    Exit code 1 when the brake does not pass. Ctrl-C ends the test: torque off, drive disabled, the brake stays closed.
    """
    if to_service(service, config_file):
        from gantryctl.cli.axis.remote import refuse_local_options
        from gantryctl.cli.axis.remote_state import remote_brake_test

        refuse_local_options({"fresh": fresh})
        return remote_brake_test(machine_of(config_file), yes=yes, take_over=take_over, as_json=as_json)
    from contextlib import nullcontext

    from gantryctl.operation.store import StateStore

    machine = proven_machine(config_file)
    with nullcontext() if fresh else StateStore(machine) as store:
        return _test(machine, store, yes=yes, as_json=as_json)


def _test(machine: Machine, store: StateStore | None, *, yes: bool, as_json: bool) -> int:
    """One run of the axis for the test; the exit code."""
    from gantryctl.cli.axis.asking import ask_for_torque
    from gantryctl.cli.axis.running import stop_signals
    from gantryctl.errors import AlarmStop, CommandRefused
    from gantryctl.operation.run import AxisRun

    session = AxisRun(machine, store, brake_test=True)
    failure: GantryctlError | None = None
    alarm: AlarmStop | None = None
    result: BrakeTestResult | None = None
    word = "failed"
    with stop_signals(session):
        try:
            ask_for_torque(session, yes)
            result = session.test_brake()
            word = f"brake test {result.outcome.name.lower()}"
        except AlarmStop as stopped:
            failure = alarm = stopped
            word = f"stopped by an alarm: {alarm}"
        except CommandRefused as refused:
            failure, word = refused, f"refused: {refused}"
        finally:
            session.close(word, alarm)
    return _report(session, result, failure, as_json)


def _report(
    session: AxisRun, result: BrakeTestResult | None, failure: GantryctlError | None, as_json: bool
) -> int:
    from gantryctl.program import BrakeTestOutcome
    from gantryctl.units import deg

    law = session.axis.brake_test
    passed = result is not None and result.outcome is BrakeTestOutcome.PASSED
    code = failure.exit_code if failure is not None else int(not passed)
    shown = {
        "exit_code": code,
        "machine": session.machine.name,
        "result": result.outcome.name.lower() if result is not None else None,
        "text": result.text if result is not None else None,
        "level_nm": law.level_nm,
        "plus_nm": known(law.plus_nm),
        "minus_nm": known(law.minus_nm),
        "moved_deg": deg(law.moved_rad),
        "limit_deg": deg(law.moved_max_rad),
        "due_at": session.brake_due.at,
        "power_ups_left": session.brake_due.power_ups_left,
        "error": str(failure) if failure is not None else None,
    }
    if as_json:
        print_json(shown)
    elif result is not None:
        print_result(shown, session.brake_due.words)
    if failure is not None:
        click.echo(f"error: {failure}", err=True)
    return code


def known(value: float) -> float | None:
    """A number for JSON, or None."""
    import math

    return value if math.isfinite(value) else None


def print_result(shown: dict[str, object], due: str) -> None:
    """A test for people: the keys of its JSON."""

    def torque(value: object) -> str:
        return f"{value:+.1f} N m held" if isinstance(value, float) else "not held"

    click.echo(f"{shown['machine']}: brake test {shown['result']}: {shown['text']}")
    for name, text in (
        ("torque asked for", f"+-{shown['level_nm']:.1f} N m at the motor, for 2 s each way"),
        ("plus", torque(shown["plus_nm"])),
        ("minus", torque(shown["minus_nm"])),
        ("moved", f"{shown['moved_deg']:.4f} deg, {shown['limit_deg']:.4f} deg allowed"),
        ("next test", due),
    ):
        click.echo(f"  {name:<18}{text}")


@click.command()
@click.argument("action", type=click.Choice(["brake-test", "reset-locked"]))
@config_option
def arm(action: str, config_file: Path | None) -> int:
    """Arm ACTION at the running service for somebody else to execute within 10 s (serve --second-person).

    `brake-test --service` and `reset --service` arm by themselves where one person is enough.
    """
    from gantryctl.cli.axis.remote_state import remote_arm

    return remote_arm(machine_of(config_file), action.replace("-", "_"))
