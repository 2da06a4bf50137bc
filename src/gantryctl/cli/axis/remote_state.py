"""Status, brake test, reset, alarms and retained memory of the running service."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import click

from gantryctl.cli.axis.brake_test import print_result
from gantryctl.cli.axis.remote import RemoteAxis, directory_of, look_first
from gantryctl.cli.options import print_json
from gantryctl.errors import CommandRefused
from gantryctl.machine import Machine
from gantryctl.operation.brake_policy import BrakeDue
from gantryctl.program.alarms.codes import Code
from gantryctl.runtime import AlarmEntry, Retained, RetainedMemory
from gantryctl.service.clients.link import ServiceLink
from gantryctl.units import rad

_OTHER_S: Final = 120.0
"""How long it waits for the second person."""
_FRAME_S: Final = 0.05
_SHOWS_S: Final = 0.5
"""What was done shows in the tags within this."""


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


def remote_brake_test(machine: Machine, *, yes: bool, take_over: bool, as_json: bool) -> int:
    """Test the brake of the service's axis; the exit code."""
    tags = look_first(machine, take_over=take_over)
    if not tags["brake_test_available"]:
        raise CommandRefused(f"not testable here: {tags['brake_test_blocked']}")
    level = tags["brake_test_level_nm"]
    question = f"{tags['machine']}: +-{level:.1f} N m against the closed brake. Test?"
    if not yes and not click.confirm(question, err=True):
        return 2
    with RemoteAxis(machine, take_over=take_over) as axis, axis.stop_signals():
        axis.come_to_rest()
        _arm(axis, "brake_test")
        before = axis.link.look()["brake_tests"]
        begun = axis.link.ask("brake_test")["journal"]
        axis.wait(lambda now: now["journal_sequence"] >= begun and now["brake_test_phase"] == "idle")
        tags = _until(axis.link, lambda now: now["brake_tests"] != before)
        axis.raise_alarm()
        axis.finish()
    return _report(machine.name, tags, as_json)


def _report(name: str, tags: dict[str, Any], as_json: bool) -> int:
    """What the tags say of the test that has just ended; the exit code."""
    code = int(tags["brake_test_result"] != "passed")
    shown = {
        "exit_code": code,
        "machine": name,
        "result": tags["brake_test_result"],
        "text": tags["brake_test_text"].partition(": ")[2],
        "level_nm": tags["brake_test_level_nm"],
        "plus_nm": tags["brake_test_plus_nm"],
        "minus_nm": tags["brake_test_minus_nm"],
        "moved_deg": tags["brake_test_moved_deg"],
        "limit_deg": tags["brake_test_limit_deg"],
        "due_at": tags["brake_test_due_at"],
        "power_ups_left": tags["brake_test_cycles_left"],
        "error": None,
    }
    if as_json:
        print_json(shown)
    else:
        due = BrakeDue(tags["brake_test_due_at"], tags["brake_test_cycles_left"], tags["brake_test_overdue"])
        print_result(shown, due.words)
    return code


def _arm(axis: RemoteAxis, action: str) -> None:
    """Arm an action, or wait until somebody else has.

    Raises:
        CommandRefused: nobody did.
    """
    if not axis.link.tags["second_person"]:
        axis.link.ask("arm", action=action)
        return
    word = action.replace("_", "-")
    click.echo(f"another user must arm it now: the page, or `gantryctl arm {word}`", err=True)
    left = math.ceil(_OTHER_S / _FRAME_S)

    def armed(tags: dict[str, Any]) -> bool:
        nonlocal left
        left -= 1
        return tags["armed_action"] == action or left < 0 or axis.stops > 0

    axis.wait(armed)
    if axis.link.tags["armed_action"] != action:
        raise CommandRefused(f"{Code.SEC_10} · nobody has armed {word}: nothing was done")


def _until(link: ServiceLink, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Look until what was done shows: the reply is faster than the picture. After a while: the tags as they are."""
    tags = link.look()
    for _ in range(math.ceil(_SHOWS_S / _FRAME_S)):
        if holds(tags):
            break
        tags = link.look()
    return tags


def remote_arm(machine: Machine, action: str) -> int:
    """Arm for somebody else, and stay until it is used or over."""
    with ServiceLink(directory_of(machine)) as link:
        link.ask("arm", action=action)
        click.echo(f"{action.replace('_', '-')} is armed for 10 s: somebody else may execute it")
        _until(link, lambda now: now["armed_client"] == link.client)
        while link.tags["armed_client"] == link.client:
            link.look()
            link.alive()
    click.echo("not armed any more")
    return 0


def remote_reset(machine: Machine, *, yes: bool, take_over: bool, as_json: bool) -> int:
    """Reset the alarms of the service's axis; the exit code."""
    tags = look_first(machine, take_over=take_over)
    locked = tags["reset_locked"]
    if locked and not yes:
        what = ", ".join(_holding(tags)) or "the position or the journal"
        if not click.confirm(f"{what}: locked. Has the cause been removed?", err=True):
            return 2
    with RemoteAxis(machine, take_over=take_over) as axis, axis.stop_signals():
        if axis.link.tags["reset_locked"] and not locked:
            raise CommandRefused("something locked has come since you looked: look, then ask again")
        before = _holding(axis.link.tags)
        if locked:
            _arm(axis, "reset_locked")
        asked = axis.link.ask("reset")["journal"]
        _until(axis.link, lambda now: now["journal_sequence"] >= asked and now["alarm_count"] == 0)
        tags = axis.link.look()
        left = {row["code"] for row in tags["alarms"]}
        axis.finish()
    gone = [code for code in before if code not in left]
    said = f"{', '.join(gone)} reset" if gone else "nothing to reset"
    said += f"; still there: {', '.join(sorted(left))}" if left else ""
    if as_json:
        print_json({"reset": said})
    else:
        click.echo(said)
    return 0


def _holding(tags: dict[str, Any]) -> list[str]:
    """Codes of what holds the axis."""
    blocked = [tags["blocked_by"].partition(" ")[0]] if tags["blocked_by"] else []
    return [row["code"] for row in tags["alarms"]] + blocked


def service_alarms(machine: Machine) -> tuple[list[AlarmEntry], str]:
    """Alarms since the service started and those retained from before, newest first; what holds the axis."""
    with ServiceLink(directory_of(machine)) as link:
        tags = link.tags
    fresh = [
        AlarmEntry(row["code"], row["text"], row["at"], row["time_s"], rad(row["pos_act_deg"]))
        for row in tags["alarm_history"]
    ]
    held = next((row["code"] for row in tags["alarms"] if row["first_out"]), "")
    held = held or (tags["blocked_by"].partition(" ")[0] if tags["blocked_by"] else "")
    known = {(alarm.code, round(alarm.time_s, 6), alarm.text) for alarm in fresh}
    kept = RetainedMemory(directory_of(machine)).load()
    older = [
        alarm
        for alarm in reversed(kept.alarms if kept else ())
        if (alarm.code, round(alarm.time_s, 6), alarm.text) not in known
    ]
    return [*fresh, *older], held


def service_retained(machine: Machine) -> Retained | None:
    """The retained memory as it is on the disk; the service keeps it at every power-off."""
    with ServiceLink(directory_of(machine)):
        return RetainedMemory(directory_of(machine)).load()
