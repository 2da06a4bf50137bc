"""Questions to the running service: status, alarms, retained memory, an armed action."""

from __future__ import annotations

import json
import math
from typing import Final

import click

from gantryctl.cli.axis.display import Display
from gantryctl.cli.axis.service_axis import SHOWN_FRAMES, Tags, brake_due, directory_of, held_codes
from gantryctl.cli.options import stop_signals
from gantryctl.machine import Machine
from gantryctl.operation.client import Snapshot
from gantryctl.operation.proofs import ledger_shown
from gantryctl.operation.state import MachineStatus
from gantryctl.runtime import AlarmEntry, Retained, RetainedMemory
from gantryctl.service.clients.link import ServiceLink
from gantryctl.units import deg, rad

# Time of the axis between two lines of `status --watch`, where it is no line on a terminal.
WATCH_S: Final = 1.0


def service_status(machine: Machine) -> tuple[MachineStatus, Tags]:
    """Status of the axis of the service, and everything that it publishes."""
    with ServiceLink(directory_of(machine)) as link:
        tags = link.tags
    # Counters are in the retained memory, which the service writes at every power-off and at its end.
    kept = RetainedMemory(directory_of(machine)).load() or Retained(machine.name, tags["config_hash"])
    status = MachineStatus(
        machine=tags["machine"],
        condition=f"in service, {tags['axis_state'].replace('_', ' ')}",
        angle_deg=tags["pos_act_deg"],
        encoder="ok" if tags["position_valid"] else tags["blocked_by"] or "the position is not valid",
        last_result=kept.last_result,
        last_alarm="; ".join(row["text"] for row in tags["alarms"]) or _last_alarm(tags, kept),
        error_stop=next((row["code"] for row in tags["alarms"] if row["first_out"]), kept.error_stop),
        power_ups=kept.power_ups,
        moves=kept.moves,
        travelled_deg=deg(kept.travelled_rad),
        brake_test=_brake_words(machine, tags),
        directory=str(directory_of(machine)),
        quick_dec_deg_s2=tags["quick_dec_deg_s2"],
        ledger=ledger_shown(machine, directory_of(machine)),
    )
    return status, tags


def _last_alarm(tags: Tags, kept: Retained) -> str:
    """Text of the last alarm, of this start or an earlier one, where none is active; "" where there was none."""
    texts = [row["text"] for row in tags["alarm_history"][:1]] or [alarm.text for alarm in kept.alarms[-1:]]
    return texts[0] if texts else ""


def watch_service(machine: Machine, *, as_json: bool) -> None:
    """Show the axis of the service until Ctrl-C: a live line, lines in a log, or a JSON object a line."""
    ended = False

    def end() -> None:
        nonlocal ended
        ended = True

    display = Display(machine, enabled=not as_json, log_every_s=WATCH_S)
    next_s = -math.inf
    with stop_signals(end), ServiceLink(directory_of(machine)) as link:
        while not ended:
            tags = link.look()
            # A controller that was started anew counts from 0.
            if as_json and not next_s - WATCH_S <= tags["time_s"] < next_s:
                next_s = tags["time_s"] + WATCH_S
                click.echo(json.dumps(tags, allow_nan=False))
            display.show(
                Snapshot(
                    tags["time_s"],
                    tags["pos_act_deg"],
                    tags["vel_act_deg_s"],
                    tags["pos_err_deg"],
                    tags["axis_state"].replace("_", " "),
                    tags["time_left_s"] or None,
                )
            )
    display.end()


def service_rows(tags: Tags) -> list[tuple[str, str]]:
    """Name and value of what only a running axis has, for a terminal."""
    lateness = _lateness_words(tags)
    return [
        ("speed", "not known" if tags["vel_act_deg_s"] is None else f"{tags['vel_act_deg_s']:.3f} deg/s"),
        ("power", _power_words(tags)),
        ("drive", str(tags["drive_state"]).replace("_", " ")),
        ("control", tags["authority_user"] or "free"),
        ("scan", lateness),
        ("journal", f"{tags['journal_state']}, {tags['journal_committed']} events"),
        ("configuration", tags["config_hash"]),
    ]


def _lateness_words(tags: Tags) -> str:
    late_us = tags.get("scan_lateness_p99_us")
    late = "not known" if late_us is None else f"p99 {late_us:.0f} us"
    return f"lateness {late}, {tags.get('scan_overruns')} overruns"


def _power_words(tags: Tags) -> str:
    phase = str(tags["power_phase"]).replace("_", " ")
    if not tags["power"]:
        # On the way up, in a stop, and where torque alone holds the load, the motor may have torque.
        words = [] if phase == "off" else [phase]
        return "; ".join([*words, tags["blocked_by"]] if tags["blocked_by"] else words) or "off"
    left_s = tags["unheld_power_left_s"]
    return "on" if left_s is None else f"on; off in {left_s:.0f} s, because nobody has control"


def _rad(angle_deg: float | None) -> float | None:
    return None if angle_deg is None else rad(angle_deg)


def _brake_words(machine: Machine, tags: Tags) -> str:
    if not tags["brake_test_available"]:
        return f"not testable here: {tags['brake_test_blocked']}"
    last = f"{tags['brake_test_result']}: {tags['brake_test_text']}; " if tags["brake_test_text"] else ""
    return f"{last}{brake_due(machine, tags).words}"


def service_alarms(machine: Machine) -> tuple[list[AlarmEntry], list[str]]:
    """Alarms since the service started and those retained from before, newest first; codes of what holds the axis."""
    with ServiceLink(directory_of(machine)) as link:
        tags = link.tags
    # The service keeps its memory at power-off: alarms since then are in the tags alone, others in both.
    fresh = [
        AlarmEntry(
            row["code"],
            row["text"],
            row["at"],
            row["time_s"],
            _rad(row["pos_act_deg"]),
            severity=row["severity"],
            follows=row["follows"],
        )
        for row in tags["alarm_history"]
    ]
    known = {(alarm.code, round(alarm.time_s, 6), alarm.text) for alarm in fresh}
    kept = RetainedMemory(directory_of(machine)).load()
    older = [
        alarm
        for alarm in reversed(kept.alarms if kept else ())
        if (alarm.code, round(alarm.time_s, 6), alarm.text) not in known
    ]
    first_out = [row["code"] for row in tags["alarms"] if row["first_out"]]
    return [*fresh, *older], first_out or held_codes(tags)


def service_retained(machine: Machine) -> Retained | None:
    """The retained memory as it is on the disk; the service keeps it at every power-off."""
    with ServiceLink(directory_of(machine)):
        return RetainedMemory(directory_of(machine)).load()


def arm_for_another(machine: Machine, action: str) -> None:
    """Arm for somebody else, and stay until it is used or over."""
    with ServiceLink(directory_of(machine)) as link:
        link.ask("arm", action=action)
        click.echo(f"{action.replace('_', '-')} is armed for 10 s: somebody else may execute it")
        # What is armed dies with its connection, so this one stays (decision 0014).
        # The reply is faster than the tags; it may also be used or over before they show it.
        for _ in range(SHOWN_FRAMES):
            if link.look()["armed_client"] == link.client:
                break
        while link.tags["armed_client"] == link.client:
            link.look()
            link.alive()
    click.echo("not armed any more")
