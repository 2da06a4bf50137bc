"""`gantryctl move` and `gantryctl jog`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import (
    FINITE,
    SignedCommand,
    config_option,
    fresh_option,
    json_option,
    machine_of,
    out_option,
    proven_machine,
    real_time_option,
    seed_option,
    service_option,
    to_service,
)

if TYPE_CHECKING:
    from gantryctl.cli.axis.running import Action
    from gantryctl.operation.run import AxisRun, Motion


def _run_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options of a command that runs the axis."""
    for option in (
        config_option,
        click.option("--program", "program_name", help="FILE:CLASS of a program of one's own."),
        click.option("--no-trace", is_flag=True, help="Write no recording."),
        out_option,
        seed_option,
        fresh_option,
        real_time_option,
        json_option,
        service_option,
        click.option(
            "--yes", is_flag=True, help="Do not ask before a real gantry moves, here or at the service."
        ),
        click.option("--take-over", is_flag=True, help="With the service: take control from whoever has it."),
    ):
        command = option(command)
    return command


@click.command(cls=SignedCommand)
@click.argument("target", type=FINITE, required=False)
@click.option("--by", "distance", type=FINITE, help="Move by this angle from where the axis is, deg.")
@click.option("--speed", type=FINITE, help="deg/s; the highest setting when not given.")
@click.option("--override", type=FINITE, default=100.0, show_default=True, help="Speed override, percent.")
@_run_options
def move(
    target: float | None, distance: float | None, override: float, speed: float | None, **run: Any
) -> int:
    """Move to TARGET (deg), or by an angle with --by. Linear axis with a cable: never the shortest way.

    Ctrl-C stops on the jog-release ramp; a second one is a quick stop.
    """
    from gantryctl.cli.axis.asking import ask_before
    from gantryctl.errors import UsageError
    from gantryctl.operation.summary import way_note

    if (target is None) == (distance is None):
        raise UsageError(
            "give a target angle, or --by and an angle: gantryctl move 90, gantryctl move --by -5.5"
        )
    if not 1.0 <= override <= 100.0:  # below, a long move would take days
        raise UsageError(f"--override {override:g}: from 1 to 100 percent")

    yes, take_over = run.pop("yes"), run.pop("take_over")
    if to_service(run.pop("service"), run["config_file"]):
        from gantryctl.cli.axis.remote import refuse_local_options
        from gantryctl.cli.axis.remote_motion import remote_move

        refuse_local_options(run)
        return remote_move(
            machine_of(run["config_file"]),
            lambda here: target if target is not None else here + (distance or 0.0),
            speed,
            override / 100.0,
            yes=yes,
            take_over=take_over,
            as_json=run["as_json"],
        )

    def action(session: AxisRun, say: Callable[[str], None]) -> Motion:
        here = session.angle_deg
        end = target if target is not None else here + (distance or 0.0)
        note = way_note(session.machine, here, end)
        if note is not None:
            say(note)
        wanted = session.machine.speed.setting_max_deg_s if speed is None else speed
        ask_before(session, f"from {here:.2f} to {end:.2f} deg", wanted, yes)
        return session.move(end, speed, override / 100.0)

    return _run(action, "move", **run)


@click.command(cls=SignedCommand)
@click.argument("direction", metavar="[+|-]", type=click.Choice(["+", "-"]))
@click.option("--speed", type=FINITE, help="deg/s; the lowest setting when not given.")
@click.option("--for", "seconds", type=FINITE, required=True, help="How long the key is held, s.")
@_run_options
def jog(direction: str, seconds: float, speed: float | None, **run: Any) -> int:
    """Hold-to-run motion in DIRECTION (+ or -) for a time, then the jog-release ramp.

    Ctrl-C lets go; a second one is a quick stop.
    """
    from gantryctl.errors import UsageError

    if not 0.0 < seconds <= 3600.0:
        raise UsageError(f"--for {seconds:g}: above 0 and at most 3600 s")

    take_over = run.pop("take_over")
    run.pop("yes")  # a key that is held needs no question
    if to_service(run.pop("service"), run["config_file"]):
        from gantryctl.cli.axis.remote import refuse_local_options
        from gantryctl.cli.axis.remote_motion import remote_jog

        refuse_local_options(run)
        machine = machine_of(run["config_file"])
        return remote_jog(
            machine, direction == "+", speed, seconds, take_over=take_over, as_json=run["as_json"]
        )

    def action(session: AxisRun, _: Callable[[str], None]) -> Motion:
        wanted = session.machine.speed.setting_min_deg_s if speed is None else speed
        return session.jog(direction == "+", wanted, seconds)

    return _run(action, "jog", **run)


def _run(
    action: Action,
    name: str,
    *,
    config_file: Path | None,
    program_name: str | None,
    no_trace: bool,
    out: Path | None,
    seed: int,
    fresh: bool,
    real_time: bool,
    as_json: bool,
) -> int:
    """Power up, act, power down, summary; the exit code."""
    from contextlib import nullcontext

    from gantryctl.cli.axis.running import run_axis, trace_path
    from gantryctl.operation.scripting import load_program
    from gantryctl.operation.store import StateStore

    machine = proven_machine(config_file)
    program = load_program(program_name)
    with nullcontext() if fresh else StateStore(machine) as store:
        path = None if no_trace else trace_path(store, out, name)
        return run_axis(machine, store, action, program, path, seed, real_time=real_time, as_json=as_json)
