"""Permission to switch power on: the reasons against it beside the program's alarms, and who may clear them."""

from __future__ import annotations

from typing import Final

from gantryctl.program import Axis
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.reason import ClearedBy, Reason, Reasons
from gantryctl.program.alarms.words import Words
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.memory import JournalHealth
from gantryctl.service.protocol.messages import Identity, MessageRefused

_OF_THE_BUS: Final = frozenset(
    {Code.CFG_CAN_01, Code.CFG_CAN_02, Code.CFG_CAN_03, Code.CFG_CAN_04, Code.CFG_CAN_05}
)


class Permit:
    """The reasons against power in this run.

    Args:
        reasons: of the opening, the gravest first.

    Attributes:
        resets: how many resets were asked for.
    """

    def __init__(
        self, axis: Axis, journal: JournalHealth, events: EventLog, reasons: tuple[Reason, ...] = ()
    ) -> None:
        self._axis, self._journal, self._events = axis, journal, events
        self.reasons = reasons
        self.resets = 0

    @property
    def lasting(self) -> Reason | None:
        """The gravest reason that no reset clears."""
        return next((reason for reason in self.reasons if not reason.by_reset), None)

    @property
    def held(self) -> Reasons:
        """The reasons that a reset clears."""
        return Reasons(reason for reason in self.reasons if reason.by_reset)

    @property
    def blocked_by(self) -> Reasons:
        """Why power cannot be switched on; empty when it can."""
        return Reasons([self.lasting]) if self.lasting else self.held

    @property
    def doubts_position(self) -> bool:
        """Whether the angle of the gantry is in doubt."""
        return any(reason.doubts_position for reason in self.reasons)

    @property
    def keeps_events(self) -> bool:
        """Whether events of new motion find their place."""
        return self._journal.keeps and self._events.room

    @property
    def reset_locked(self) -> bool:
        """Whether a reset meets something that only the service role may reset."""
        return (
            self._journal.locked
            or any(reason.cleared_by is ClearedBy.SERVICE for reason in self.reasons)
            or not self._axis.feedback.position_valid
            or any(alarm.definition.lock for alarm in self._axis.alarms.active.values())
        )

    def judge_bus(self, found: tuple[Reason, ...]) -> None:
        """Replace the reasons of the bus by those found after a drive was set up again."""
        kept = [reason for reason in self.reasons if reason.code not in _OF_THE_BUS]
        # The gravest first: what no reset clears stands before the rest, the encoder before the bus.
        self.reasons = tuple(sorted([*kept, *found], key=lambda reason: reason.by_reset))

    def reset(self, who: Identity, *, service: bool) -> None:
        """Clear what a reset acknowledges beside the program's alarms.

        Raises:
            MessageRefused: a reason stands that this reset does not clear.
        """
        self.resets += 1
        if self._journal.locked and service:
            self._events.put("journal", f"the damaged journal was acknowledged by {who.user}", who)
        lasting, held = self.lasting, self.held
        if lasting is not None:
            raise MessageRefused(lasting.code, **lasting.values)
        for reason in self.reasons:
            if reason.cleared_by is ClearedBy.SERVICE and not service:
                words = Words.SERVICE_ONLY(code=reason.values["stopped_by"], measured=held)
                raise MessageRefused(Code.CTL_14, reason=words)
        if held:
            self._events.put("command", f"acknowledged: {held}", who)
            self.reasons = ()
