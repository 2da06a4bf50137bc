"""Arm, then execute: two steps for what must not happen by one wrong key. Judged in the scan, dead with its epoch."""

from __future__ import annotations

from typing import NamedTuple

from gantryctl.service.protocol.limits import ARMED_S
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import Action


class Armed(NamedTuple):
    """What is armed, by whom, in which epoch, and until when on the monotonic clock."""

    action: Action
    who: Identity
    epoch: int
    until_s: float


class Arming:
    """At most one action is armed; it can be executed once.

    Args:
        second_person: the one who executes must be another user than the one who armed. Otherwise both steps
            come over the same connection.
    """

    def __init__(self, *, second_person: bool = False) -> None:
        self.second_person = second_person
        self._armed: Armed | None = None

    def arm(self, action: Action, who: Identity, epoch: int, now_s: float) -> None:
        """Arm an action; what was armed before is not any more."""
        self._armed = Armed(action, who, epoch, now_s + ARMED_S)

    def now(self, epoch: int, now_s: float) -> Armed | None:
        """What is armed now. It is gone after its time and in every other epoch, for ever."""
        armed = self._armed
        if armed is not None and (armed.epoch != epoch or not now_s < armed.until_s):
            armed = self._armed = None
        return armed

    def left_s(self, epoch: int, now_s: float) -> float:
        """How long it is still armed, s; 0 when nothing is."""
        armed = self.now(epoch, now_s)
        return 0.0 if armed is None else armed.until_s - now_s

    def check(self, action: Action, who: Identity, epoch: int, now_s: float) -> None:
        """Whether this person may execute the action now.

        Raises:
            MessageRefused: SEC-10, with what is to be done first.
        """
        armed = self.now(epoch, now_s)
        if armed is None or armed.action is not action:
            by = "another user must arm it first" if self.second_person else "arm it first"
            raise MessageRefused("SEC-10", f"{action} is not armed: {by}, then execute within {ARMED_S:g} s")
        if self.second_person and armed.who.user == who.user:
            raise MessageRefused("SEC-10", f"{action} was armed by {who.user}: another user must execute it")
        if not self.second_person and armed.who.client != who.client:
            raise MessageRefused(
                "SEC-10", f"{action} was armed by {armed.who.user} at another screen: arm it here"
            )

    def use(self) -> None:
        """It is executed: armed no more."""
        self._armed = None

    def gone(self, client: str) -> None:
        """A connection has ended, and what it armed with it."""
        if self._armed is not None and self._armed.who.client == client:
            self._armed = None

    def gone_all(self, *, local: bool) -> None:
        """All connections of a source have ended."""
        if self._armed is not None and self._armed.who.local is local:
            self._armed = None
