"""Rules for commands as functions of the message, its sender and the situation; the program judges the rest."""

from __future__ import annotations

from typing import Final, NamedTuple

from gantryctl.image import Mode, OperatorCommand
from gantryctl.machine import Machine
from gantryctl.program import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.service.command.arming import Armed, check_armed
from gantryctl.service.protocol.limits import FRAMES_MAX, FRAMES_MAX_JOG
from gantryctl.service.protocol.messages import Identity, Message, MessageRefused, action_of
from gantryctl.service.protocol.roles import NEEDS_AUTHORITY, Action, may
from gantryctl.units import deg, rad

_ACC_PART: Final = 0.1
"""Lowest acceleration setting, as a part of the machine file's."""
_INCREMENT_MIN_DEG: Final = 0.001
_NEW_MOTION: Final = frozenset({Action.POWER, Action.JOG, Action.MOVE, Action.BRAKE_TEST})


class Situation(NamedTuple):
    """The moment in which a command is judged; the operator fills it once per command.

    Attributes:
        frame, epoch: the present ones.
        holder: who has control.
        paused: a motion stands still at override 0.
        armed: the armed action. second_person: another user must execute it.
        journal_keeps: events find their place in the journal.
        blocked_by: why power cannot be switched on, or "".
        untestable: why the brake cannot be tested here, or "".
        reset_locked: a reset meets something that only the service role may reset.
    """

    frame: int
    epoch: int
    holder: Identity | None
    mode: Mode
    paused: bool
    armed: Armed | None
    second_person: bool
    shutdown: bool
    journal_keeps: bool
    blocked_by: str
    untestable: str
    reset_locked: bool


class SettingRange(NamedTuple):
    """Lowest and highest value of a tag that `set` changes."""

    name: str
    unit: str
    low: float
    high: float


def setting_ranges(machine: Machine) -> dict[str, SettingRange]:
    """The range of every setting of a machine, by tag."""
    speed, axis, acc = machine.speed, machine.axis, machine.virtual_axis.acc_deg_s2
    travel = axis.pos_max_deg - axis.pos_min_deg
    return {
        "speed_setting_deg_s": SettingRange(
            "speed", "deg/s", speed.setting_min_deg_s, speed.setting_max_deg_s
        ),
        "increment_deg": SettingRange("increment", "deg", _INCREMENT_MIN_DEG, travel),
        "override_percent": SettingRange("override", "%", 0.0, 100.0),
        "acc_setting_deg_s2": SettingRange("acceleration", "deg/s2", _ACC_PART * acc, acc),
    }


def first_levels(
    machine: Machine, speed_rad_s: float | None = None, increment_rad: float | None = None
) -> OperatorCommand:
    """Operator levels at the start, with settings of the last run where they still fit the machine."""
    ranges = setting_ranges(machine)
    speed, step = ranges["speed_setting_deg_s"], ranges["increment_deg"]
    speed_deg_s = speed.low if speed_rad_s is None else min(max(deg(speed_rad_s), speed.low), speed.high)
    step_deg = 1.0 if increment_rad is None else deg(increment_rad)
    if not step.low <= step_deg <= step.high:
        step_deg = 1.0
    return OperatorCommand(speed_rad_s=rad(speed_deg_s), increment_rad=rad(step_deg), override=1.0)


def check_fresh(message: Message, now: Situation) -> None:
    """Refuse a command whose sender saw an old status frame, or an earlier epoch."""
    most = FRAMES_MAX_JOG if message.kind in ("jog", "renew") else FRAMES_MAX
    behind = now.frame - message.frame
    if not 0 <= behind <= most:
        raise MessageRefused("SEC-02", f"status frame {message.frame} is {behind} behind, at most {most}")
    if message.epoch is not None and message.epoch != now.epoch:
        raise MessageRefused(
            "SEC-03", "sent before the last stop, reset or change of control: look, then ask again"
        )


def check_allowed(message: Message, who: Identity, now: Situation) -> None:
    """Refuse what role, control, arming, journal or machine forbid."""
    action = action_of(message)
    if not may(who.role, action):
        raise MessageRefused("SEC-01", f"the role {who.role} may not do this ({action})")
    # Switching off and arming must not wait for control: the first is safe, the second needs it when executed.
    power_off = message.kind == "power" and not message.values["on"]
    needs_control = action in NEEDS_AUTHORITY and not power_off and message.kind != "arm"
    if needs_control and (now.holder is None or now.holder.client != who.client):
        raise MessageRefused(
            "SEC-07", f"{now.holder.user} has control" if now.holder else "take control first"
        )
    begins = action in _NEW_MOTION and not power_off and message.kind not in ("renew", "arm")
    if begins or (action is Action.OVERRIDE and now.paused):
        _check_motion(message, who, now)
    if message.kind == "reset" and resets_locked(who, now):
        check_armed(now.armed, Action.RESET_LOCKED, who, second_person=now.second_person)


def resets_locked(who: Identity, now: Situation) -> bool:
    """Whether a reset by `who` resets something locked."""
    return now.reset_locked and may(who.role, Action.RESET_LOCKED)


def _check_motion(message: Message, who: Identity, now: Situation) -> None:
    if not now.journal_keeps:
        raise MessageRefused(
            "JRN-02", "the journal cannot keep events now: no new motion; see `journal_state`"
        )
    if now.shutdown:
        raise MessageRefused("SYS-07", "the service is being shut down")
    if message.kind in ("power", "brake_test") and now.blocked_by:
        raise MessageRefused(str(Code.PWR_04), now.blocked_by)
    if message.kind == "brake_test":
        if now.untestable:
            raise MessageRefused(str(Code.CTL_14), f"not testable here: {now.untestable}")
        check_armed(now.armed, Action.BRAKE_TEST, who, second_person=now.second_person)
    wanted = {"jog": Mode.CONTINUOUS, "increment": Mode.INCREMENTAL}.get(message.kind)
    if wanted is not None and now.mode not in (wanted, Mode.NONE):
        words = f"{message.kind} needs the mode {wanted.name.lower()}, it is {now.mode.name.lower()}"
        raise MessageRefused(str(Code.CTL_16), words)


def check_setting(value: float, allowed: SettingRange) -> None:
    """Refuse a setting outside its range: no value is ever clamped behind the user's back."""
    name, unit, low, high = allowed
    if not low <= value <= high:
        words = f"within {low:.4g} and {high:.4g} {unit}"
        reason = refusal(Code.CTL_01, name=name, allowed=words, measured=f"{value:.6g} {unit}")
        raise MessageRefused(str(reason.code), reason.text)
