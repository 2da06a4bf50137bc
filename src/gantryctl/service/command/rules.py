"""Rules for commands as functions of the message, its sender and the situation; the program judges the rest."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from gantryctl.image import Mode, OperatorCommand
from gantryctl.machine import Machine
from gantryctl.program import Code
from gantryctl.program.alarms.reason import Reasons
from gantryctl.program.alarms.words import Said, Words
from gantryctl.service.command.arming import Armed, check_armed
from gantryctl.service.protocol.limits import VIEW_MAX_S, KeyLimits
from gantryctl.service.protocol.messages import SILENT, Identity, Message, MessageRefused, action_of
from gantryctl.service.protocol.roles import RIGHTS, Action, may
from gantryctl.units import deg, rad

# Lowest acceleration setting, as a part of the machine file's.
_ACC_PART: Final = 0.1
_INCREMENT_MIN_DEG: Final = 0.001
_NEW_MOTION: Final = frozenset({Action.POWER, Action.JOG, Action.MOVE, Action.BRAKE_TEST})


class Situation(NamedTuple):
    """The moment in which a command is judged; the operator fills it once per command.

    Attributes:
        epoch: the present one.
        time_s: the present monotonic time.
        issued_s: when the status frame was issued that the command names; nan for one that its connection never had.
        round_trip_s: of its connection.
        keys: limits of a held key.
        holder: who has control.
        paused: a motion stands still at override 0.
        armed: the armed action. second_person: another person must execute it.
        journal_keeps: events find their place in the journal.
        blocked_by: why power cannot be switched on; empty when it can.
        untestable: why the brake cannot be tested here, or None.
        reset_locked: a reset meets something that only the service role may reset.
    """

    epoch: int
    time_s: float
    issued_s: float
    round_trip_s: float
    keys: KeyLimits
    holder: Identity | None
    mode: Mode
    paused: bool
    armed: Armed | None
    second_person: bool
    shutdown: bool
    journal_keeps: bool
    blocked_by: Reasons
    untestable: Words | Said | None
    reset_locked: bool

    @property
    def frame_age_s(self) -> float:
        """Age of the status frame that the command names; nan for an unknown one."""
        return self.time_s - self.issued_s


class SettingRange(NamedTuple):
    """Lowest and highest value of a tag that `set` changes."""

    name: Words
    unit: Words
    within: Words
    low: float
    high: float


def setting_ranges(machine: Machine, speed_max_deg_s: float) -> dict[str, SettingRange]:
    """The range of every setting of a machine, by tag; `speed_max_deg_s` is the highest speed setting in force."""
    speed, axis, acc = machine.speed, machine.axis, machine.virtual_axis.acc_deg_s2
    travel = axis.pos_max_deg - axis.pos_min_deg
    return {
        "speed_setting_deg_s": SettingRange(
            Words.NAME_SPEED,
            Words.SPEED,
            Words.WITHIN_SPEEDS,
            speed.setting_min_deg_s,
            speed_max_deg_s,
        ),
        "increment_deg": SettingRange(
            Words.NAME_INCREMENT, Words.ANGLE, Words.WITHIN_ANGLES, _INCREMENT_MIN_DEG, travel
        ),
        "override_percent": SettingRange(
            Words.NAME_OVERRIDE, Words.PERCENT, Words.WITHIN_PERCENTS, 0.0, 100.0
        ),
        "acc_setting_deg_s2": SettingRange(
            Words.NAME_ACCELERATION, Words.ACCELERATION, Words.WITHIN_ACCELERATIONS, _ACC_PART * acc, acc
        ),
    }


def first_levels(
    machine: Machine,
    speed_max_deg_s: float,
    speed_rad_s: float | None = None,
    increment_rad: float | None = None,
) -> OperatorCommand:
    """Operator levels at the start, with settings of the last run where they still fit the machine."""
    ranges = setting_ranges(machine, speed_max_deg_s)
    speed, step = ranges["speed_setting_deg_s"], ranges["increment_deg"]
    speed_deg_s = speed.low if speed_rad_s is None else min(max(deg(speed_rad_s), speed.low), speed.high)
    step_deg = 1.0 if increment_rad is None else deg(increment_rad)
    if not step.low <= step_deg <= step.high:
        step_deg = min(1.0, step.high)
    return OperatorCommand(speed_rad_s=rad(speed_deg_s), increment_rad=rad(step_deg), override=1.0)


def counts(message: Message, now: Situation) -> bool:
    """Whether a sign of life counts: with an old status frame it is as good as not sent."""
    # No refusal either: after a freeze of the network they come in a burst, and a newer one comes with it.
    return message.kind not in SILENT or not now.frame_age_s > _view_max_s(message, now)


def check_fresh(message: Message, now: Situation) -> None:
    """Refuse a command whose sender saw an old status frame, another one than its own, or an earlier epoch."""
    if math.isnan(now.frame_age_s):
        raise MessageRefused(Code.SEC_02, reason=Words.FRAME_UNKNOWN)
    if message.kind == "jog" and not now.round_trip_s <= now.keys.round_trip_max_s:
        measured, limit = now.round_trip_s * 1e3, now.keys.round_trip_max_s * 1e3
        raise MessageRefused(Code.SEC_13, measured=measured, limit=limit)
    most_s = _view_max_s(message, now)
    if not now.frame_age_s <= most_s:
        words = Words.FRAME_OLD(measured=now.frame_age_s * 1e3, limit=most_s * 1e3)
        raise MessageRefused(Code.SEC_02, reason=words)
    if message.epoch is not None and message.epoch != now.epoch:
        raise MessageRefused(Code.SEC_03)


def _view_max_s(message: Message, now: Situation) -> float:
    return now.keys.view_max_s if message.kind in ("jog", "renew") else VIEW_MAX_S


def check_allowed(message: Message, who: Identity, now: Situation) -> None:
    """Refuse what role, control, arming, journal or machine forbid."""
    action = action_of(message)
    if not may(who.role, action):
        raise MessageRefused(Code.SEC_01, reason=Words.ROLE_MAY_NOT(role=who.role, action=action))
    # Switching off and arming must not wait for control: the first is safe, the second needs it when executed.
    power_off = message.kind == "power" and not message.values["on"]
    bound = RIGHTS[action].control or message.kind == "give"
    needs_control = bound and not power_off and message.kind != "arm"
    if needs_control and (now.holder is None or now.holder.client != who.client):
        reason = Words.HAS_CONTROL(user=now.holder.user) if now.holder else Words.TAKE_CONTROL_FIRST
        raise MessageRefused(Code.SEC_07, reason=reason)
    begins = action in _NEW_MOTION and not power_off and message.kind not in ("renew", "arm")
    if begins or (action is Action.OVERRIDE and now.paused):
        _check_motion(message, who, now)
    if action is Action.NOTE and not now.journal_keeps:
        raise MessageRefused(Code.JRN_02, reason=Words.NOTE_NOT_KEPT)
    if message.kind == "reset" and resets_locked(who, now):
        check_armed(now.armed, Action.RESET_LOCKED, who, second_person=now.second_person)


def resets_locked(who: Identity, now: Situation) -> bool:
    """Whether a reset by `who` resets something locked."""
    return now.reset_locked and may(who.role, Action.RESET_LOCKED)


def _check_motion(message: Message, who: Identity, now: Situation) -> None:
    if not now.journal_keeps:
        raise MessageRefused(Code.JRN_02, reason=Words.NO_JOURNAL)
    if now.shutdown:
        raise MessageRefused(Code.SYS_07)
    if message.kind in ("power", "brake_test") and now.blocked_by:
        raise MessageRefused(Code.PWR_04, reason=now.blocked_by)
    if message.kind == "brake_test":
        if now.untestable:
            raise MessageRefused(Code.CTL_14, reason=Words.NOT_TESTABLE(why=now.untestable))
        check_armed(now.armed, Action.BRAKE_TEST, who, second_person=now.second_person)
    wanted = {"jog": Mode.CONTINUOUS, "increment": Mode.INCREMENTAL}.get(message.kind)
    if wanted is not None and now.mode not in (wanted, Mode.NONE):
        words = Words.MODE_WRONG(command=message.kind, wanted=wanted.name.lower(), mode=now.mode.name.lower())
        raise MessageRefused(Code.CTL_16, reason=words)


def check_setting(value: float, allowed: SettingRange) -> None:
    """Refuse a setting outside its range: no value is ever clamped behind the user's back."""
    if not allowed.low <= value <= allowed.high:
        within = allowed.within(low=allowed.low, high=allowed.high)
        measured = allowed.unit(value=value)
        raise MessageRefused(Code.CTL_01, name=allowed.name, allowed=within, measured=measured)
