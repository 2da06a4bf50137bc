"""`gantryctl doctor`: is this computer good enough?"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

import click

from gantryctl.cli.options import config_option, json_option, machine_of, number_option, print_json
from gantryctl.cli.progress import metered
from gantryctl.cli.values import FINITE

# With a drive in this process or on a fast bus, and with a drive on CAN (docs/reference/canopen.md).
_PERIODS_MS: Final = (1.0, 4.0)


@click.command()
@config_option
@click.option(
    "--period",
    "periods_ms",
    type=FINITE,
    multiple=True,
    help="Scan period in ms; may be repeated. 1, 4 and that of the machine when not given.",
)
@number_option(("--seconds",), 10.0, "Time of each trial.")
@json_option
def doctor(config_file: Path | None, periods_ms: tuple[float, ...], seconds: float, as_json: bool) -> int:
    """Tell whether this computer is good enough for a scan of 1 ms, of 4 ms, and of the machine.

    The shipped program runs in real time on the simulated axis, power off; how late its scans are is shown as a
    histogram in ms and in degrees that the axis travels at its highest speed. Ten seconds show what happens every
    second, not once in an hour: --seconds 3600. Below it stands what the system says of itself: kernel and rights, wall
    clock, state directory, the CAN adapter of the machine.

    Exit code 1 when a period that was asked for, or that of the machine, is not kept.
    """
    from gantryctl.engineering.computer.findings import findings, this_system, wall_clock
    from gantryctl.engineering.computer.scan_trial import scan_trial
    from gantryctl.engineering.computer.text import finding_lines, trial_lines
    from gantryctl.operation.store import state_root

    machine = machine_of(config_file)
    own_ms, speed_deg_s = machine.control.scan_period_ms, machine.speed.setting_max_deg_s
    judged = dict.fromkeys(periods_ms or (own_ms,))
    # Before the trials: they are a load themselves.
    system = this_system(
        state_root(), (machine.can.interface, machine.can.channel) if machine.on_bus else None
    )
    found, begun_s = list(findings(system)), _wall_s()
    trials = {}
    periods = sorted({*judged, *(() if periods_ms else _PERIODS_MS)})
    for number, period_ms in enumerate(periods):
        with metered((len(periods) - number) * seconds, quiet=as_json) as meter:
            trials[period_ms] = trial = scan_trial(period_ms, seconds, watch=meter.advance)
        if not as_json:
            click.echo("\n".join([*trial_lines(trial, speed_deg_s), ""]))
    found.append(wall_clock(system, _wall_s() - begun_s))
    good = all(trials[period_ms].good for period_ms in judged)
    if as_json:
        print_json(
            {
                "good": good,
                "machine": machine.name,
                "judged_ms": list(judged),
                "scans": [trial.to_dict(speed_deg_s) for trial in trials.values()],
                "findings": [
                    {"check": one.check.value, "verdict": one.verdict.value, "found": one.found}
                    for one in found
                ],
            }
        )
        return int(not good)
    click.echo("\n".join(finding_lines(tuple(found))))
    named = ", ".join(f"{period_ms:g} ms" for period_ms in judged)
    click.echo(f"\n{'good' if good else 'NOT good'} enough for a scan of {named}")
    return int(not good)


def _wall_s() -> float:
    """How far the wall clock is ahead of the steady one, s."""
    return time.time() - time.monotonic()
