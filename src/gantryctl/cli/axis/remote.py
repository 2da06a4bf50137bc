"""Commands to the running service: through its local socket, for `--service` and after `attach`."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any, Final

from gantryctl.errors import AlarmStop, CommandRefused, GantryctlError, UsageError
from gantryctl.machine import Machine, short_hash
from gantryctl.operation.store import state_root
from gantryctl.program.alarms.codes import Code
from gantryctl.service.clients.link import ServiceLink

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
        raise CommandRefused(
            f"{Code.SEC_07} · {holder} has control; --take-over takes it, and stops what moves"
        )


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
