"""The fastest profiles as a table, sentences and plain data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from typing import Any

from gantryctl.engineering.fastest.search import Fastest, Limits, Search, Unkept
from gantryctl.engineering.report.data import plain
from gantryctl.engineering.report.text import TextTable, decimals, figure
from gantryctl.machine import Machine

_UM = (("base_um", 0), ("residual_um", 1))


def fastest_table(
    machine: Machine, ends_deg: tuple[float, float], found: Sequence[Sequence[Fastest]]
) -> TextTable:
    """One row for each length of the ramps under each set of limits; the fastest of a set is marked."""
    every = [each.move for some in found for each in some]
    base, after = (decimals([getattr(move, name) for move in every], least) for name, least in _UM)
    motor, reducer = decimals([m.motor_nm for m in every], 0), decimals([m.reducer_knm for m in every], 2)
    rows = [
        {
            "permitted\num": "any" if math.isinf(each.limits.base_um) else figure(each.limits.base_um, 0),
            "ramp\ns": f"{each.ramp_s:.3f}",
            "acceleration\ndeg/s2": f"{each.acc_deg_s2:.3f}",
            "jerk\ndeg/s3": f"{each.jerk_deg_s3:.2f}",
            "time\ns": f"{each.move.time_s:.2f}",
            "base\num p-p": f"{each.move.base_um:.{base}f}",
            "after\num": f"{each.move.residual_um:.{after}f}",
            "load\ndeg/s": f"{each.move.load_error_deg_s:.4f}",
            "motor\nN m": f"{each.move.motor_nm:.{motor}f}",
            "reducer\nkN m": f"{each.move.reducer_knm:.{reducer}f}",
            "binding": each.binding + (", fastest" if each is min(some, key=_time_s) else ""),
        }
        for some in found
        for each in some
    ]  # fmt: skip
    title = f"{machine.name}: the fastest profile from {machine.axis.dial.span(*ends_deg)} deg and back"
    return TextTable.of(title, rows)._replace(left=(10,))


def fastest_notes(machine: Machine, search: Search) -> list[str]:
    """What the limits are, what no profile keeps, and what none undercuts."""
    found = search.found
    limits = found[0][0].limits
    after = "" if math.isinf(limits.after_um) else f", {limits.after_um:g} um of base motion after the move"
    bounds = "; ".join(
        f"{some[0].bound_s:.2f} s with {figure(some[0].limits.base_um, 0)} um"
        for some in found
        if math.isfinite(some[0].limits.base_um)
    )
    return [
        *_unkept_notes(search.unkept),
        f"Limits besides base motion: {limits.motor_nm:g} N m at the motor and {limits.reducer_knm:g} kN m at the "
        f"reducer, both rated{after}; speed {machine.speed.setting_max_deg_s:g} deg/s, a normal ramp no harder than "
        f"the quick stop. Binding: the limit that is reached.",
        f"No profile is faster than {bounds}: the base alone gives the load its speed, without gears and without ramps "
        "of the acceleration."
        if bounds
        else f"No profile is faster than {found[0][0].bound_s:.2f} s, which the way takes at the highest speed: the "
        "base of this plant does not move, so it bounds nothing.",
        "Each figure is the worse one of both ways. On the plant of the machine file, with the compensations that are "
        "on. As settings: [virtual_axis] acc_deg_s2, dec_deg_s2, jerk_deg_s3.",
    ]  # fmt: skip


def fastest_data(machine: Machine, ends_deg: tuple[float, float], search: Search) -> dict[str, Any]:
    """Everything `profile --json` prints; null for a limit that there is not."""
    return {
        "machine": machine.name,
        "move_deg": list(ends_deg),
        "rows": [
            {
                "limits": _limits_data(each.limits),
                "acc_deg_s2": each.acc_deg_s2,
                "jerk_deg_s3": each.jerk_deg_s3,
                "ramp_s": each.ramp_s,
                "binding": each.binding,
                "fastest": each is min(some, key=_time_s),
                "bound_s": each.bound_s,
                "move": each.move._asdict(),
            }
            for some in search.found
            for each in some
        ],
        "unkept": [{**each._asdict(), "limits": _limits_data(each.limits)} for each in search.unkept],
    }


def _limits_data(limits: Limits) -> dict[str, Any]:
    return {name: plain(value) for name, value in limits._asdict().items()}


def _unkept_notes(unkept: Sequence[Unkept]) -> list[str]:
    notes = []
    for (limits, name), some in groupby(unkept, key=lambda each: (each.limits, each.name)):
        rows = list(some)
        near = min(rows, key=lambda each: each.share)
        ramps = ", ".join(f"{each.ramp_s:.3f}" for each in rows)
        notes.append(
            f"No row with {_permitted(limits)} and ramps of {ramps} s: with {near.acc_deg_s2:.3g} deg/s2 the move "
            f"takes at least {near.share:.3g} times the permitted {name}."
        )
    return notes


def _permitted(limits: Limits) -> str:
    return "any base motion" if math.isinf(limits.base_um) else f"{figure(limits.base_um, 0)} um"


def _time_s(found: Fastest) -> float:
    return found.move.time_s
