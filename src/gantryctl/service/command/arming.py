"""Arm, then execute: two steps for actions that one wrong key must not start. What is armed dies with its epoch."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.protocol.limits import ARMED_S
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import Action


class Armed(NamedTuple):
    """The armed action, who armed it, its epoch, and its end on the monotonic clock.

    Attributes:
        step: the step of commissioning, empty for another action.
    """

    action: Action
    who: Identity
    epoch: int
    until_s: float
    step: str = ""


class Arming:
    """At most one action is armed; it can be executed once.

    Args:
        second_person: another person than the arming one must execute. Otherwise both steps come over the same
            connection.
    """

    def __init__(self, *, second_person: bool = False) -> None:
        self.second_person = second_person
        self._armed: Armed | None = None

    # Arming needs no control, for taking control would begin a new epoch and end it (decision 0014).
    def arm(self, action: Action, who: Identity, epoch: int, now_s: float, step: str = "") -> None:
        """Arm an action in place of the one before; SEC-10 where two persons are needed and this one is not known."""
        if self.second_person:
            _check_known(who)
        self._armed = Armed(action, who, epoch, now_s + ARMED_S, step)

    def now(self, epoch: int, now_s: float) -> Armed | None:
        """Forget an action that is too old or of another epoch; return the one that is armed."""
        armed = self._armed
        if armed is not None and (armed.epoch != epoch or not now_s < armed.until_s):
            armed = self._armed = None
        return armed

    def left_s(self, epoch: int, now_s: float) -> float:
        """Time until the arming ends, s; 0 with nothing armed."""
        armed = self.now(epoch, now_s)
        return 0.0 if armed is None else armed.until_s - now_s

    def use(self) -> None:
        """Disarm after execution."""
        self._armed = None

    def gone(self, client: str) -> None:
        """Disarm what a connection armed that has ended."""
        if self._armed is not None and self._armed.who.client == client:
            self._armed = None

    def gone_all(self, *, local: bool) -> None:
        """Disarm after the end of all connections of a source."""
        if self._armed is not None and self._armed.who.local is local:
            self._armed = None


def check_armed(
    armed: Armed | None, action: Action, who: Identity, step: str = "", *, second_person: bool
) -> None:
    """Refuse with SEC-10 an execution that this person may not begin now."""
    if armed is None or armed.action is not action:
        first = Words.OTHER_ARMS_FIRST if second_person else Words.ARM_FIRST
        raise MessageRefused(Code.SEC_10, reason=first(action=action, limit=ARMED_S))
    # Who armed it has seen what that step could move, and no other.
    if armed.step != step:
        words = Words.OTHER_STEP_ARMED(step=step, user=armed.who.user, armed=armed.step)
        raise MessageRefused(Code.SEC_10, reason=words)
    if second_person:
        _check_known(who)
    if second_person and armed.who.person == who.person:
        raise MessageRefused(Code.SEC_10, reason=Words.OTHER_EXECUTES(action=action, user=armed.who.user))
    if not second_person and armed.who.client != who.client:
        raise MessageRefused(Code.SEC_10, reason=Words.ARMED_ELSEWHERE(action=action, user=armed.who.user))


def _check_known(who: Identity) -> None:
    if not who.person:
        raise MessageRefused(Code.SEC_10, reason=Words.PERSON_UNKNOWN(user=who.user))
