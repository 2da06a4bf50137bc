"""`gantryctl stops`: what every stop costs, on the full plant."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gantryctl.cli.options import FINITE, config_option, json_option, machine_of, print_json

if TYPE_CHECKING:
    from gantryctl.engineering.stops import StopRow
    from gantryctl.machine import Machine

_NOTE = """Worst of four stops each (at +-90 deg, both directions), with an eccentric moment of {moment:g} kN m.
Angle and time: until the motor stands (below 0.05 deg/s); the load goes on swinging at the speed of the last column.
+ {reaction:g} ms: the angle with that much travel before the stop begins; permitted: {permitted:g} deg.
Above the ratings (motor {torque:g} N m, reducer {reducer:g} kN m momentary): inspect afterwards."""


@click.command()
@config_option
@click.option("--speed", "speeds", type=FINITE, multiple=True, help="Speed in deg/s; may be repeated.")
@click.option("--find-quick", is_flag=True, help="Find the largest quick-stop deceleration instead.")
@json_option
def stops(config_file: Path | None, speeds: tuple[float, ...], find_quick: bool, as_json: bool) -> int:
    """What every stop costs: normal ramp, jog release, quick stop, torque off + brake.

    Exit code 1 when a stop class is worse than the machine file permits.
    """
    from gantryctl.errors import UsageError

    machine = machine_of(config_file)
    for speed in speeds:
        if not 0.0 < speed <= machine.speed.setting_max_deg_s:
            raise UsageError(
                f"--speed {speed:g}: must be above 0 and at most {machine.speed.setting_max_deg_s:g} deg/s "
                "([speed] setting_max_deg_s)"
            )
    return _find(machine, as_json) if find_quick else _table(machine, speeds, as_json)


def _find(machine: Machine, as_json: bool) -> int:
    from gantryctl.engineering.stops import find_quick_dec

    found = find_quick_dec(machine)
    present = machine.virtual_axis.quick_dec_deg_s2
    if as_json:
        print_json({"quick_dec_deg_s2": found, "configured_deg_s2": present, "machine": machine.name})
        return 0
    click.echo(
        f"{machine.name}: the largest quick stop within motor and reducer is {found:.1f} deg/s2; "
        f"the machine file has quick_dec_deg_s2 = {present:g}"
    )
    return 0


def _table(machine: Machine, speeds: tuple[float, ...], as_json: bool) -> int:
    from gantryctl.engineering.stops import REACTION_S, stop_table

    rows = stop_table(machine, speeds or None)
    failed = any(_too_long(machine, row) for row in rows)
    if as_json:
        print_json(
            {
                "machine": machine.name,
                "permitted_deg": machine.axis.stopping_angle_max_deg,
                "rows": [_as_dict(row) for row in rows],
            }
        )
        return int(failed)
    _print(rows)
    click.echo(
        _NOTE.format(
            moment=machine.plant.load.eccentric_check_moment_nm / 1e3,
            reaction=REACTION_S * 1e3,
            permitted=machine.axis.stopping_angle_max_deg,
            torque=machine.motor.torque_max_nm,
            reducer=machine.reducer.torque_momentary_nm / 1e3,
        )
    )
    return int(failed)


def _too_long(machine: Machine, row: StopRow) -> bool:
    from gantryctl.engineering.stops import StopClass

    limit = machine.axis.stopping_angle_max_deg
    return row.stop.stop_class is StopClass.QUICK and row.angle_with_reaction_deg > limit


def _as_dict(row: StopRow) -> dict[str, Any]:
    values = row.stop._asdict()
    values["stop_class"] = row.stop.stop_class.value
    return values | {"angle_with_reaction_deg": row.angle_with_reaction_deg, "inspect": row.inspect}


def _print(rows: list[StopRow]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    heads = ("stop", "from\ndeg/s", "angle\ndeg", "+ 60 ms\ndeg", "time\ns", "motor\nN m", "reducer\nkN m")
    for head in (*heads, "base\num p-p", "brake\nkJ", "load swing\ndeg/s", ""):
        table.add_column(head, justify="left" if head in ("stop", "") else "right")
    for row in rows:
        s = row.stop
        table.add_row(
            s.stop_class.value,
            f"{s.speed_deg_s:.1f}",
            f"{s.angle_deg:.2f}",
            f"{row.angle_with_reaction_deg:.2f}",
            f"{s.time_s:.2f}",
            f"{s.torque_motor_nm:.0f}",
            f"{s.torque_reducer_nm / 1e3:.1f}",
            f"{s.base_um:.0f}",
            f"{s.brake_energy_kj:.1f}" if s.brake_energy_kj else "-",
            f"{s.load_swing_deg_s:.2f}",
            "inspect afterwards" if row.inspect else "",
        )
    Console(width=120, highlight=False).print(table)
