"""`gantryctl why`: the last stop by an alarm, in sentences and as a picture."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from gantryctl.cli.axis.state import who_resets
from gantryctl.cli.options import (
    config_option,
    json_option,
    machine_of,
    print_json,
    service_option,
    to_service,
)
from gantryctl.cli.values import PATH
from gantryctl.extras import ExtraMissing, need

if TYPE_CHECKING:
    from gantryctl.engineering.report.last_stop import LastStop, Moment
    from gantryctl.machine import Machine
    from gantryctl.runtime import AlarmEntry

# A service shows times of alarms in whole microseconds.
_SAME_S: Final = 1e-5


@click.command()
@config_option
@click.option("--out", type=PATH, help="Picture of the moment, PNG or SVG (default: beside its recording).")
@json_option
@service_option
def why(config_file: Path | None, out: Path | None, as_json: bool, service: bool) -> int:
    """Tell why the axis stopped last: which alarm, what followed, where it was, what the drive said, what to do.

    From the alarms that are kept, the recording of that run, and the service's journal where there is one. An alarm
    that was reset is told as well; exit code 0 too when no alarm has ever stopped the axis.
    """
    from gantryctl.engineering.report.last_stop import last_stop, moment_of, sentences
    from gantryctl.operation.store import state_root

    machine = machine_of(config_file)
    if out is not None:
        from gantryctl.trace.figure import check_picture

        need("matplotlib")
        check_picture(out)
    stop = last_stop(*_alarms(machine, to_service(service, config_file)))
    if stop is None:
        if as_json:
            print_json(None)
        else:
            click.echo(f"{machine.name}: no alarm has stopped the axis")
        return 0
    directory = state_root() / machine.name
    moment = moment_of(machine, stop.first, directory / "traces")
    asked = _asked_for(directory, stop.first)
    lines = [*sentences(machine, stop, moment)]
    if asked is not None:
        lines.insert(1, f"The last command before it: {asked}.")
    picture, absent = None, ""
    if moment is not None:
        # The sentences need nothing but this program: where pictures are not installed they still are told.
        try:
            need("matplotlib")
            picture = _picture(machine, stop, moment, out)
        except ExtraMissing as missing:
            absent = str(missing)
    if as_json:
        print_json(_data(stop, moment, asked, lines, picture))
        return 0
    for line in lines:
        click.echo(line)
    click.echo(
        f"It still holds the axis: {who_resets(stop.first.code)}, when its cause is removed."
        if stop.holds
        else "It does not hold the axis any more."
    )
    if machine.on_bus:
        click.echo("What was said on the bus around it: gantryctl can log")
    if picture is not None or absent:
        click.echo(f"picture: {picture or absent}")
    return 0


def _alarms(machine: Machine, at_service: bool) -> tuple[list[AlarmEntry], list[str]]:
    """Alarms, newest first, and codes of what holds the axis."""
    if at_service:
        from gantryctl.cli.axis.service_state import service_alarms

        return service_alarms(machine)
    from gantryctl.operation.state import read_retained

    retained = read_retained(machine)
    return (list(reversed(retained.alarms)), [retained.error_stop]) if retained else ([], [])


def _asked_for(directory: Path, alarm: AlarmEntry) -> str | None:
    """The last command carried out before an alarm; None without a journal, or where it lacks the alarm."""
    import json

    from gantryctl.service.recorder.journal.places import FILE
    from gantryctl.service.recorder.journal.reading import read_journal

    if not (directory / FILE).exists():
        return None
    command = None
    # As many as a shift has: the alarms that are kept come from newer events.
    for row in read_journal(directory, limit=10_000, newest=True):
        values, detail = row.values, json.loads(row.values["detail"])
        # What was refused has asked nothing of the axis; its event has the code of the refusal.
        if values["kind"] == "command" and "code" not in detail:
            command = f"{values['text']}, by {values['user'] or 'nobody named'}, {values['utc']}"
        if values["kind"] != "alarm":
            continue
        if detail.get("code") == alarm.code and abs(detail.get("time_s", math.inf) - alarm.time_s) < _SAME_S:
            return command
    return None


def _picture(machine: Machine, stop: LastStop, moment: Moment, out: Path | None) -> Path:
    from gantryctl.engineering.report.last_stop import window_s
    from gantryctl.trace.figure import draw, overview, save
    from gantryctl.trace.reader import read_trace

    part = read_trace(moment.file).slice(*window_s(stop.first, moment))
    path = out or moment.file.with_name(f"{moment.file.stem}_stop.png")
    marks = {alarm.code: alarm.time_s for alarm in (*reversed(stop.followed), stop.first)}
    save(draw(part, overview(part), f"{machine.name} · {stop.first.code} · {stop.first.at}", marks), path)
    return path


def _data(
    stop: LastStop, moment: Moment | None, asked: str | None, lines: list[str], picture: Path | None
) -> dict[str, Any]:
    shown = None
    if moment is not None:
        drive = [{"time_s": change.time_s, "state": change.state.name} for change in moment.drive]
        shown = {**moment._asdict(), "file": str(moment.file), "drive": drive}
    return {
        "first": asdict(stop.first),
        "before": [asdict(alarm) for alarm in stop.before],
        "followed": [asdict(alarm) for alarm in stop.followed],
        "holds": stop.holds,
        "command": asked,
        "moment": shown,
        "sentences": lines,
        "picture": None if picture is None else str(picture),
    }
