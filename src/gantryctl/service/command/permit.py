"""Permission to switch power on: the reasons against it beside the program's alarms, and who may clear them."""

from __future__ import annotations

from gantryctl.program import Axis
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import JournalHealth
from gantryctl.service.protocol.messages import Identity, MessageRefused


class Permit:
    """What stands against power in this run.

    Args:
        lock: a reason that no reset clears, or "".
        held: reasons that a reset clears, or "".
        locked_code: code of an alarm of an earlier run that only service may reset, or "".

    Attributes:
        resets: how many resets were asked for.
    """

    def __init__(
        self,
        axis: Axis,
        journal: JournalHealth,
        events: EventLog,
        *,
        lock: str = "",
        held: str = "",
        locked_code: str = "",
    ) -> None:
        self._axis, self._journal, self._events = axis, journal, events
        self.lock, self.held, self._locked_code = lock, held, locked_code
        self.resets = 0

    @property
    def blocked_by(self) -> str:
        """Why power cannot be switched on, or ""."""
        return self.lock or self.held

    @property
    def keeps_events(self) -> bool:
        """Events of new motion find their place."""
        return self._journal.keeps and self._events.room

    @property
    def reset_locked(self) -> bool:
        """A reset meets something that only the service role may reset."""
        return (
            self._journal.locked
            or bool(self._locked_code)
            or not self._axis.feedback.position_valid
            or any(alarm.definition.lock for alarm in self._axis.alarms.active.values())
        )

    def hold(self, reason: str) -> bool:
        """Add a reason that a reset clears; False for one that stands already."""
        if reason in self.held:
            return False
        self.held = f"{self.held}; {reason}" if self.held else reason
        return True

    def reset(self, who: Identity, *, service: bool) -> None:
        """Clear what a reset acknowledges beside the program's alarms.

        Raises:
            MessageRefused: a reason stands that this reset does not clear.
        """
        self.resets += 1
        if self._journal.locked and service:
            self._events.put("journal", f"the damaged journal was acknowledged by {who.user}", who)
        if self.lock:
            raise MessageRefused(Code.CTL_14, reason=self.lock)
        if not self.held:
            return
        if self._locked_code and not service:
            reason = Words.SERVICE_ONLY(code=self._locked_code, measured=self.held)
            raise MessageRefused(Code.CTL_14, reason=reason)
        self._events.put("command", f"acknowledged: {self.held}", who)
        self.held = self._locked_code = ""
