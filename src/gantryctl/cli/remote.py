"""Commands to the running service: through its local socket, for `--service` and after `attach`."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, Final

import click

from gantryctl.cli.options import ATTACHED, config_option, machine_of, print_json
from gantryctl.errors import AlarmStop, CommandRefused, GantryctlError, UsageError
from gantryctl.machine import Machine, short_hash
from gantryctl.operation.brake import BrakeDue
from gantryctl.operation.requests import check_direction, check_speed, check_target, way_note
from gantryctl.operation.store import state_root
from gantryctl.service.lease import HELD_S
from gantryctl.service.remote import ServiceLink

_SAME_DEG: Final = 0.01
"""An axis that has moved by more is not where it was when the person was asked."""
_WITHOUT: Final = ("program_name", "out", "fresh", "real_time", "no_trace", "seed")
"""Options that only make sense without the service; seed may be anything, it is not used."""


def directory_of(machine: Machine) -> Path:
    """The machine's state directory."""
    return state_root() / machine.name


def refuse_local_options(run: dict[str, Any]) -> None:
    """UsageError for an option that the service cannot follow."""
    for name in _WITHOUT:
        if run.get(name):
            option = "program" if name == "program_name" else name.replace("_", "-")
            raise UsageError(
                f"--{option} does not go with a running service; gantryctl detach, or leave it out"
            )


def look_first(machine: Machine, *, take_over: bool) -> dict[str, Any]:
    """The tags of the running service before anything is asked of it, for the question to the person.

    Raises:
        CommandRefused: control would not be had.
    """
    with ServiceLink(directory_of(machine)) as link:
        _check_service(machine, link.tags, take_over)
        return link.tags


def _check_service(machine: Machine, tags: dict[str, Any], take_over: bool) -> None:
    """Whether it is this machine, and whether its control can be had."""
    if tags["config_hash"] != short_hash(machine):
        raise CommandRefused(
            f"the service runs {tags['machine']} with configuration {tags['config_hash']}, this command has "
            f"{short_hash(machine)}: name the service's machine file with --config"
        )
    holder = tags["authority_user"]
    if holder and not take_over:
        raise CommandRefused(f"SEC-07 · {holder} has control; --take-over takes it, and stops what moves")


class RemoteAxis:
    """The axis of the running service, under one's own control; a context manager.

    Control is lost after 2 s of silence: questions to the person come before, see `look_first`.

    Whoever has control keeps it unless `take_over`. What was switched on here is switched off at the end.

    Raises:
        CommandRefused: another configuration, or somebody else has control.
    """

    def __init__(self, machine: Machine, *, take_over: bool) -> None:
        self.machine = machine
        self.link = ServiceLink(directory_of(machine))
        self.stops = 0
        self._take_over, self._powered = take_over, False

    def __enter__(self) -> RemoteAxis:
        self.link.__enter__()
        try:
            _check_service(self.machine, self.link.tags, self._take_over)
            self.link.ask("take", over=True)
        except BaseException:
            self.link.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._powered:  # something went wrong on the way
            with suppress(GantryctlError):
                self.link.ask("power", on=False)
        self.link.__exit__()

    def come_to_rest(self) -> None:
        """What moves without a holder of control is left alone, or stopped with `take_over`.

        Raises:
            CommandRefused: it moves.
        """
        tags = self.link.tags
        if tags["at_rest"]:
            return
        if not self._take_over:
            raise CommandRefused(
                f"the axis moves to {tags['target_deg']:.2f} deg; --take-over stops it, or wait"
            )
        self.link.ask("stop")
        self.wait(lambda now: bool(now["at_rest"]))

    def power_up(self) -> None:
        """Power on, unless it is on; AlarmStop when it does not come."""
        if self.link.tags["power"]:
            return
        self.link.ask("power", on=True)
        self._powered = True
        self.wait(lambda tags: bool(tags["power"]) or tags["power_phase"] == "off")
        self.raise_alarm()

    def set(self, tag: str, value: float) -> None:
        """One setting."""
        self.link.ask("set", tag=tag, value=value)

    def follow(self) -> bool:
        """Wait for the end of the motion; whether it ended in position and was not stopped."""
        self.wait(
            lambda tags: (tags["at_rest"] and (tags["in_position"] or self.stops > 0)) or not tags["power"]
        )
        self.raise_alarm()
        return not self.stops

    def finish(self) -> None:
        """Power off if it was switched on here; control is free again."""
        if self._powered:
            self.link.ask("power", on=False)
            self.wait(lambda tags: tags["power_phase"] == "off")
            self._powered = False
        self.link.ask("give")

    @contextmanager
    def stop_signals(self) -> Iterator[None]:
        """Ctrl-C stops, a second one is a quick stop."""

        def count(_: int, __: FrameType | None) -> None:
            self.stops += 1

        known = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP")]
        before = {number: signal.signal(number, count) for number in known}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def wait(self, holds: Callable[[dict[str, Any]], bool]) -> None:
        """Until the tags show something; signs of life and stop requests go out meanwhile."""
        sent = 0
        self.link.look()
        while not holds(self.link.look()):
            self.link.alive()
            if self.stops > sent:
                sent = self.stops
                self.link.ask("stop" if sent == 1 else "quick_stop")

    def raise_alarm(self) -> None:
        """AlarmStop for the alarm that holds the axis, if one does."""
        first = next((row for row in self.link.tags["alarms"] if row["first_out"]), None)
        if first is not None:
            raise AlarmStop(first["text"])


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
    check_speed(machine, wanted)
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
        check_speed(machine, wanted)
        check_direction(machine, start, forward)
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
    check_target(machine, start, target)
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


def remote_status(machine: Machine, as_json: bool) -> int:
    """Where the axis of the service stands."""
    with ServiceLink(directory_of(machine)) as link:
        tags = link.tags
    if as_json:
        print_json(tags)
        return 0
    click.echo(f"{tags['machine']}: in service, {tags['axis_state'].replace('_', ' ')}")
    for name, value in (
        ("angle", f"{tags['pos_act_deg']:.4f} deg (motor encoder)"),
        ("speed", f"{tags['vel_act_deg_s']:.3f} deg/s"),
        ("power", "on" if tags["power"] else tags["blocked_by"] or "off"),
        ("drive", str(tags["drive_state"]).replace("_", " ")),
        ("control", tags["authority_user"] or "free"),
        ("brake test", brake_words(tags)),
        ("alarms", "; ".join(row["text"] for row in tags["alarms"]) or "none"),
        ("scan", f"lateness p99 {tags.get('scan_lateness_p99_us')} us, {tags.get('scan_overruns')} overruns"),
        ("journal", f"{tags['journal_state']}, {tags['journal_committed']} events"),
        ("configuration", tags["config_hash"]),
    ):
        click.echo(f"  {name:<18}{value}")
    return 0


def brake_words(tags: dict[str, Any]) -> str:
    """The last brake test and the next one, for people."""
    if not tags["brake_test_available"]:
        return f"not testable here: {tags['brake_test_blocked']}"
    due = BrakeDue(tags["brake_test_due_at"], tags["brake_test_cycles_left"], tags["brake_test_overdue"])
    last = f"{tags['brake_test_text']}; " if tags["brake_test_text"] else ""
    return f"{last}{due.words}"


@click.command()
@config_option
def attach(config_file: Path | None) -> int:
    """From now on commands for this machine go to its running service, if they can: see --service."""
    machine = machine_of(config_file)
    with ServiceLink(directory_of(machine)) as link:
        running = link.tags["config_hash"]
    if running != short_hash(machine):
        raise CommandRefused(f"the service runs configuration {running}, this is {short_hash(machine)}")
    (directory_of(machine) / ATTACHED).touch()
    click.echo(f"commands for {machine.name} go to its service; gantryctl detach ends that")
    return 0


@click.command()
@config_option
def detach(config_file: Path | None) -> int:
    """Commands run on their own again."""
    (directory_of(machine_of(config_file)) / ATTACHED).unlink(missing_ok=True)
    click.echo("commands run on their own again")
    return 0
