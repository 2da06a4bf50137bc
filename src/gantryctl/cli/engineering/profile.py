"""`gantryctl profile`: how soon a move can be done, and what its base motion, motor and reducer have to do with it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import config_option, json_option, print_json, simulated_machine
from gantryctl.cli.text import paragraph, print_table
from gantryctl.cli.values import FINITE
from gantryctl.extras import need

if TYPE_CHECKING:
    from gantryctl.machine import Machine


@click.command()
@config_option
@click.option(
    "--move", "ends_deg", type=FINITE, nargs=2, metavar="FROM TO", help="Ends of the move, deg; 0 90."
)
@click.option(
    "--base-um",
    "bases_um",
    type=FINITE,
    multiple=True,
    help="Permitted base motion, peak to peak; may be given again. Default: that of the file's own profile, half and "
    "twice as much.",
)
@click.option("--after-um", type=FINITE, help="Permitted base motion after the move; any when not given.")
@click.option(
    "--identify",
    "anew",
    is_flag=True,
    help="Identify the simulated machine first, as gantryctl identify would today.",
)
@click.option(
    "--fade-hz",
    type=FINITE,
    help="Follow waves of the gear up to this, instead of [control.compensation.gear_map] fade_hz.",
)
@json_option
def profile(
    config_file: Path | None,
    ends_deg: tuple[float, float] | None,
    bases_um: tuple[float, ...],
    after_um: float | None,
    anew: bool,
    fade_hz: float | None,
    as_json: bool,
) -> int:
    """Find the fastest profile of a move for a permitted base motion, and name the limit that binds.

    Acceleration and jerk are searched on the full plant of the machine file, for ramps of the acceleration of a
    quarter, half, one and two periods of the first mode, so that base motion, rated torque of the motor and rated
    torque of the reducer are kept on the way there and back. Beside it stands the time that no profile
    undercuts. Nothing is written: acceleration and jerk are settings of [virtual_axis].
    """
    from gantryctl.engineering.comparison.key_figures import SHORT_DEG
    from gantryctl.engineering.fastest.search import Limits, fastest_moves, own_move, ramps_of
    from gantryctl.engineering.fastest.text import fastest_data, fastest_notes, fastest_table
    from gantryctl.machine import with_values
    from gantryctl.machine.places import fitted_stretch_deg

    machine = simulated_machine(config_file, "profile")
    if ends_deg is not None:
        ends_deg = machine.axis.meant_deg(ends_deg[0]), machine.axis.meant_deg(ends_deg[1])
    ends_deg = ends_deg or fitted_stretch_deg(machine, *SHORT_DEG)
    _check_options(machine, ends_deg, bases_um, after_um)
    if anew:
        machine = _identified(machine)
    # Where nothing is identified the fade tells the first mode that the file expects: ramps are those of the file.
    ramps_s = ramps_of(machine)
    if fade_hz is not None:
        machine = with_values(machine, {"control.compensation.gear_map.fade_hz": fade_hz})
    if not bases_um:
        own_um = own_move(machine, ends_deg).base_um
        bases_um = (0.5 * own_um, own_um, 2.0 * own_um) if own_um else (math.inf,)
    rated = machine.motor.torque_rated_nm, machine.reducer.torque_rated_nm / 1e3
    limits = [Limits(base_um, math.inf if after_um is None else after_um, *rated) for base_um in bases_um]
    search = fastest_moves(machine, ends_deg, limits, ramps_s)
    if as_json:
        print_json(fastest_data(machine, ends_deg, search))
        return 0
    print_table(fastest_table(machine, ends_deg, search.found))
    for note in fastest_notes(machine, search):
        paragraph(note)
    return 0


def _check_options(
    machine: Machine, ends_deg: tuple[float, float], bases_um: tuple[float, ...], after_um: float | None
) -> None:
    """Refuse a move of 0 deg and a limit that leaves nothing."""
    from gantryctl.errors import UsageError

    low, high, dial = machine.axis.pos_min_deg, machine.axis.pos_max_deg, machine.axis.dial
    for angle in ends_deg:
        if not low <= angle <= high:
            raise UsageError(f"--move: {angle:g} deg is beyond travel, {dial.span(low, high)} deg")
    if ends_deg[0] == ends_deg[1]:
        raise UsageError(f"--move: from {dial.span(*ends_deg)} deg is no move: name two angles")
    given = [("--base-um", value) for value in bases_um]
    if after_um is not None:
        given.append(("--after-um", after_um))
    for name, value in given:
        if not value > 0.0:
            raise UsageError(f"{name} {value:g}: must be above 0 um")


def _identified(machine: Machine) -> Machine:
    """The machine with what is identified of it today."""
    need("scipy")
    from gantryctl.engineering.batch import expected
    from gantryctl.engineering.identification import calibrate_each

    (found,) = expected(calibrate_each([machine], [0]))
    return machine.calibrated(found)
