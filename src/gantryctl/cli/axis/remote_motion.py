"""`move` and `jog` on the axis of the running service."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import click

from gantryctl.cli.axis.remote import RemoteAxis, look_first
from gantryctl.cli.options import print_json
from gantryctl.errors import CommandRefused, UsageError
from gantryctl.machine import Machine
from gantryctl.operation.run import require
from gantryctl.operation.summary import way_note
from gantryctl.program.axis.command_checks import check_direction, check_setting, check_target
from gantryctl.service.protocol.limits import HELD_S
from gantryctl.units import rad
from gantryctl.wiring.program import speed_settings, travel_settings

_SAME_DEG: Final = 0.01
"""An axis that has moved by more is not where it was when the person was asked."""


def remote_move(
    machine: Machine,
    end: Callable[[float], float],
    speed: float | None,
    override: float,
    *,
    yes: bool,
    take_over: bool,
    as_json: bool,
) -> int:
    """Move the axis of the service; the exit code."""
    wanted = machine.speed.setting_max_deg_s if speed is None else speed
    require(check_setting(rad(wanted), speed_settings(machine)))
    start = math.nan
    if not yes:
        tags = look_first(machine, take_over=take_over)
        start = tags["pos_act_deg"]
        click.echo(_way(machine, tags, end(start), wanted), err=as_json)
        if not click.confirm("Move?", err=True):
            return 2
    with RemoteAxis(machine, take_over=take_over) as axis, axis.stop_signals():
        axis.come_to_rest()
        now = axis.link.tags["pos_act_deg"]
        if yes:
            start = now
            way = _way(machine, axis.link.tags, end(start), wanted)
            if not as_json:
                click.echo(way)
        elif abs(now - start) > _SAME_DEG:
            raise CommandRefused(
                f"the gantry stood at {start:.3f} deg when you were asked, now at {now:.3f} deg: look, then ask again"
            )
        target = end(start)
        axis.power_up()
        tags = axis.link.tags
        before = tags["speed_setting_deg_s"], tags["override_percent"]
        axis.set("speed_setting_deg_s", wanted)
        axis.set("override_percent", override * 100.0)
        try:
            axis.link.ask("move", target_deg=target)
            done = axis.follow()
        finally:
            axis.set("speed_setting_deg_s", before[0])
            axis.set("override_percent", before[1])
        axis.finish()
        return _say(axis, start, done, as_json)


def remote_jog(
    machine: Machine, forward: bool, speed: float | None, seconds: float, *, take_over: bool, as_json: bool
) -> int:
    """Hold a key of the service for a time; the exit code."""
    if seconds > HELD_S:
        raise UsageError(
            f"--for {seconds:g} s: the service lets a key be held for {HELD_S:g} s at most; ask again then"
        )
    with RemoteAxis(machine, take_over=take_over) as axis, axis.stop_signals():
        axis.come_to_rest()
        start = axis.link.tags["pos_act_deg"]
        wanted = machine.speed.setting_min_deg_s if speed is None else speed
        require(check_setting(rad(wanted), speed_settings(machine)))
        require(check_direction(rad(start), 1.0 if forward else -1.0, travel_settings(machine)))
        axis.power_up()
        axis.link.ask("mode", mode="continuous")
        axis.set("speed_setting_deg_s", wanted)
        axis.link.hold(forward, seconds, lambda: axis.stops > 0)
        done = axis.follow()
        axis.finish()
        return _say(axis, start, done, as_json)


def _way(machine: Machine, tags: dict[str, Any], target: float, speed: float) -> str:
    """What a move would do; CommandRefused for one that cannot be."""
    start = tags["pos_act_deg"]
    require(check_target(rad(start), rad(target), travel_settings(machine)))
    note = way_note(machine, start, target)
    return (
        f"{tags['machine']} ({tags['drive_kind']}): from {start:.3f} to {target:.3f} deg, way "
        f"{abs(target - start):.3f} deg at {speed:g} deg/s" + (f"; {note}" if note else "")
    )


def _say(axis: RemoteAxis, start: float, done: bool, as_json: bool) -> int:
    end, word = axis.link.tags["pos_act_deg"], "done" if done else "stopped by the operator"
    if as_json:
        code, name = int(not done), axis.machine.name
        print_json({"exit_code": code, "machine": name, "result": word, "start_deg": start, "end_deg": end})
    else:
        click.echo(f"{word}: {start:.4f} -> {end:.4f} deg")
    return int(not done)
