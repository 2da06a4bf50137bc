"""The table of stops as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from gantryctl.engineering.report.origin import Origin
from gantryctl.engineering.report.text import TextTable, decimals, figure
from gantryctl.engineering.stops.certify import QuickStops
from gantryctl.engineering.stops.held_key import key_rows
from gantryctl.engineering.stops.measured import MeasuredStops
from gantryctl.engineering.stops.run import StopRow, at_rest_deg_s
from gantryctl.engineering.stops.silence import watch_rows
from gantryctl.engineering.stops.uncertain import bands
from gantryctl.machine import Machine, required_stopping_angle
from gantryctl.machine.places import heaviest_deg
from gantryctl.machine.rules.reaction import REACTION_S

_NOTES: Final = (
    "All figures of the table are {origin}, on the full plant of the machine file; {measured}.",
    "Worst of four stops each (at {at} deg, both directions), with an eccentric moment of {moment:g} kN m.",
    "Angle and time: until the motor stands (below {rest:.2g} deg/s); the load goes on swinging, and is calm when the "
    "envelope of its swing is below 0.05 deg/s. kJ: what motor and brake lining take; friction takes the rest.",
    "Column + {reaction:g} ms: the angle with that much travel before the stop begins; permitted: {permitted:g} deg.",
    "Required by {source}.",
    "Above the ratings (motor {torque:g} N m, reducer {reducer:g} kN m momentary): inspect afterwards.",
)


def stops_text(rows: Sequence[StopRow]) -> TextTable:
    """One row per stop; the first and the last column are words."""
    stops = [row.stop for row in rows]
    motor = decimals([stop.torque_motor_nm for stop in stops], 0)
    reducer = decimals([stop.torque_reducer_nm / 1e3 for stop in stops], 1)
    energy = decimals([max(stop.brake_energy_kj, stop.motor_energy_kj) for stop in stops], 1)
    base = decimals([stop.base_um for stop in stops], 0)
    speed = decimals([stop.speed_deg_s for stop in stops], 1)
    return TextTable.of("", [_row(row, speed, motor, reducer, energy, base) for row in rows])._replace(
        left=(0, 12)
    )


def _row(row: StopRow, speed: int, motor: int, reducer: int, energy: int, base: int) -> dict[str, str]:
    stop = row.stop
    return {
        "stop": stop.stop_class.value,
        "from\ndeg/s": f"{stop.speed_deg_s:.{speed}f}",
        "angle\ndeg": f"{stop.angle_deg:.2f}",
        "+ 60 ms\ndeg": f"{row.angle_with_reaction_deg:.2f}",
        "time\ns": f"{stop.time_s:.2f}",
        "motor\nN m": f"{stop.torque_motor_nm:.{motor}f}",
        "reducer\nkN m": f"{stop.torque_reducer_nm / 1e3:.{reducer}f}",
        "base\num p-p": f"{stop.base_um:.{base}f}",
        "motor\nkJ": f"{stop.motor_energy_kj:z.{energy}f}",
        "brake\nkJ": f"{stop.brake_energy_kj:.{energy}f}" if stop.brake_energy_kj else "-",
        "load swing\ndeg/s": f"{stop.load_swing_deg_s:.2f}",
        "calm\ns": f"{stop.settled_s:.1f}" if math.isfinite(stop.settled_s) else "never",
        "": "inspect" if row.inspect else "",
    }


def certificate_lines(machine: Machine, found: QuickStops) -> list[str]:
    """What `stops --find-quick` tells."""
    certified, known = found.certificate, found.identified_ratio
    worst, motor, reducer = certified.worst, machine.motor, machine.reducer
    half, moment = bands(machine), machine.plant.load.eccentric_check_moment_nm
    widths = ", ".join(f"{name.replace('_', ' ')} +-{100.0 * value:g} %" for name, value in half.items())
    configured = machine.virtual_axis.quick_dec_deg_s2
    most = machine.plant.load.inertia_kg_m2 * (1.0 + known)
    lines = [
        f"{machine.name}: the largest quick stop within motor and reducer is {found.nominal_deg_s2:.4g} deg/s2; "
        f"the machine file has quick_dec_deg_s2 = {configured:g}",
        f"identified: {configured:g} deg/s2 hold for a load of up to {most:.4g} kg m2 ({100.0 * known:.1f} % more than "
        f"the machine file); identified_inertia_ratio = {machine.plant.uncertainty.identified_inertia_ratio:g}",
        f"not identified: certified {certified.dec_deg_s2:.4g} deg/s2, from at most {certified.speed_deg_s:.4g} deg/s "
        f"within the permitted {machine.required.stopping_angle_deg:g} deg",
        f"  over {widths} ([plant.uncertainty]), {moment / 1e3:g} kN m",
        f"  {certified.plants} plants, {certified.stops} stops; largest at the motor {worst.torque_motor_nm:.4g} of "
        f"{motor.torque_max_nm:g} N m ({certified.hardest_motor.text})",
        f"  at the reducer {worst.torque_reducer_nm / 1e3:.4g} of {reducer.torque_momentary_nm / 1e3:g} kN m "
        f"({certified.hardest_reducer.text})",
    ]
    if found.inertia_alone is not None:
        alone = found.inertia_alone
        lines.append(
            f"  inertia alone, {100.0 * half['inertia']:+g} %: {alone.dec_deg_s2:.4g} deg/s2, from at most "
            f"{alone.speed_deg_s:.4g} deg/s"
        )
    return lines


def watch_lines(machine: Machine, rows: Sequence[StopRow]) -> list[str]:
    """The stops of a silent controller's axis, a line for each watch of the drive and speed."""
    lines = []
    for row in watch_rows(machine, rows):
        line = f"controller silent, seen by {row.watch} after {row.delay_ms:g} ms: {row.angle_deg:.2f} deg"
        line += f" from {figure(row.speed_deg_s, 1)} deg/s"
        if row.speed_max_deg_s is not None and row.speed_deg_s > row.speed_max_deg_s:
            line += f": a drive with this watch alone is held to {figure(row.speed_max_deg_s, 1)} deg/s"
        lines.append(line)
    return lines


def key_lines(machine: Machine, rows: Sequence[StopRow]) -> list[str]:
    """The stops of a held key whose page or network is gone, a line for each speed."""
    return [
        f"held key whose page is gone: {row.angle_deg:.2f} deg and {row.time_s:.2f} s after the last picture "
        f"from {figure(row.speed_deg_s, 1)} deg/s (lease of {machine.monitors.lease_ms:g} ms, then the ramp)"
        for row in key_rows(machine, rows)
    ]


def stops_notes(machine: Machine, measured: MeasuredStops | None) -> list[str]:
    """Origin and meaning of the columns, the permitted values, and what was measured; a paragraph each."""
    required = required_stopping_angle(machine)
    values: dict[str, Any] = dict(
        at=" and ".join(map(machine.axis.dial.text, heaviest_deg(machine))),
        origin=Origin.SIMULATED,
        measured=_measured(measured),
        moment=machine.plant.load.eccentric_check_moment_nm / 1e3,
        rest=at_rest_deg_s(machine),
        reaction=REACTION_S * 1e3,
        permitted=required.limit,
        source=required.origin,
        torque=machine.motor.torque_max_nm,
        reducer=machine.reducer.torque_momentary_nm / 1e3,
    )
    return [note.format(**values) for note in _NOTES]


def _measured(stops: MeasuredStops | None) -> str:
    if stops is None:
        return "nothing was measured on this machine"
    told = [
        f"quick stop {stops.quick_stop_dec_deg_s2:.2f} deg/s2" if stops.quick_stop_dec_deg_s2 else "",
        f"a silent controller's axis stops after {1e3 * stops.silent_stop_s:.0f} ms"
        if stops.silent_stop_s
        else "",
    ]
    return f"measured by {stops.by} on {stops.date}: {', '.join(filter(None, told)) or 'nothing'}"
