"""Control authority and epoch: one holder, and no command from before the last change."""

from __future__ import annotations

from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import Refusal, refusal
from gantryctl.program.alarms.words import Words
from gantryctl.service.command.round_trip import RoundTrip
from gantryctl.service.protocol.limits import SILENCE_S
from gantryctl.service.protocol.messages import Identity


class Authority:
    """The control authority of one axis.

    Attributes:
        holder: who has control, or None.
        epoch: number of the present epoch; every command names it.
        round_trip: of the holder's connection.
    """

    def __init__(self, epoch: int) -> None:
        self.holder: Identity | None = None
        self.epoch = epoch
        self.round_trip = RoundTrip()
        self._alive_s = 0.0

    def holds(self, who: Identity) -> bool:
        """Whether this connection has control."""
        return self.holder is not None and self.holder.client == who.client

    def alive(self, who: Identity, now_s: float) -> None:
        """Count a command of a connection as its sign of life."""
        if self.holds(who):
            self._alive_s = now_s

    def take(self, who: Identity, over: bool, at_rest: bool, now_s: float) -> Refusal | None:
        """Give control to `who`; return the reason if that is refused."""
        held = self.holder
        # Decision 0011: the local console comes first; the caller stops a moving axis before. Others take control over
        # at standstill only, and never from the console.
        if held is not None and held.client != who.client and not who.local:
            if not over:
                return refusal(Code.SEC_07, reason=Words.HAS_CONTROL(user=held.user))
            if held.local:
                return refusal(Code.SEC_08, reason=Words.HAS_CONTROL_LOCALLY(user=held.user))
            if not at_rest:
                return refusal(Code.SEC_08, reason=Words.HAS_CONTROL_MOVING(user=held.user))
        if held is None or held.client != who.client:
            self.new_epoch()
            self.round_trip = RoundTrip()
        self.holder, self._alive_s = who, now_s
        return None

    def give(self, client: str) -> bool:
        """Free the control of a client; False if it had none."""
        if self.holder is None or self.holder.client != client:
            return False
        self.holder, self.round_trip = None, RoundTrip()
        self.new_epoch()
        return True

    def silent(self, now_s: float, limit_s: float = SILENCE_S) -> bool:
        """Whether the holder was silent for too long."""
        return self.holder is not None and now_s - self._alive_s > limit_s

    def new_epoch(self) -> None:
        """Begin another epoch: commands that were sent before are void."""
        self.epoch += 1
