"""The brake test of a machine in service: retained results, due date, tags."""

from __future__ import annotations

import math
from datetime import UTC, datetime
from typing import Any, Final

from gantryctl.machine import Machine
from gantryctl.operation.brake_policy import after_test, judge_due, last_test
from gantryctl.operation.client import BrakeDue
from gantryctl.program import Axis, BrakeTestOutcome, BrakeTestResult
from gantryctl.program.alarms.log import messages_to_wire
from gantryctl.runtime import Retained
from gantryctl.service.memory.events import EventLog
from gantryctl.service.memory.snapshot import rounded
from gantryctl.units import deg

# A test becomes due by date too: the calendar is not the program's (decision 0014), so it is asked every minute.
JUDGE_S: Final = 60.0


class BrakeWatch:
    """Brake tests of the program, written into memory, journal and tags.

    Attributes:
        due: when the next one is due.
        changed: rises when a tag has changed.
    """

    def __init__(self, machine: Machine, axis: Axis, events: EventLog, retained: Retained) -> None:
        self._machine, self._axis, self._events = machine, axis, events
        self._untestable = axis.settings.power.untestable
        self._tests = 0
        self._judged_s = -math.inf
        self._retained = retained
        self.changed = 0
        self.due = BrakeDue("", None, overdue=False)
        self.judge(retained, retained.power_ups)

    def judge(self, retained: Retained, power_ups: int) -> None:
        """Judge by date and power-ups whether the test is due."""
        self._retained = retained
        before = self.due.overdue
        self.due = judge_due(self._machine, self._axis, retained, power_ups)
        if self.due.overdue and not before:
            self._events.put("brake_test", f"brake test {self.due.words}")
        self.changed += 1

    def scan(self, retained: Retained, power_ups: int, time_s: float) -> Retained:
        """Follow the tests after a scan; return the memory, changed after the end of a test."""
        test = self._axis.brake_test
        if test.count != self._tests and (result := test.last) is not None:
            self._tests = test.count
            retained = after_test(retained, result, power_ups, datetime.now(UTC))
            self.judge(retained, power_ups)
            self._write(result)
        elif time_s - self._judged_s >= JUDGE_S:
            self._judged_s = time_s
            self.judge(retained, power_ups)
        return retained

    def _write(self, result: BrakeTestResult) -> None:
        """Write a result into the journal."""
        values: dict[str, Any] = {
            "level_nm": self._axis.brake_test.level_nm,
            "plus_nm": rounded(result.plus_nm),
            "minus_nm": rounded(result.minus_nm),
            "moved_deg": rounded(deg(result.moved_rad)),
            "due_at": self.due.at,
        }
        text = f"brake test {result.outcome.name.lower()}: {result.text}; {self.due.words}"
        self._events.put("brake_test", text, **values)

    def fast(self) -> dict[str, float]:
        """The 20 Hz tags."""
        test = self._axis.brake_test
        return {
            "brake_test_phase": test.phase,
            "brake_test_left_s": test.left_s,
            "brake_test_torque_nm": test.on_brake_nm,
            "brake_test_moved_deg": deg(test.moved_rad),
        }

    def slow(self) -> dict[str, Any]:
        """The tags that are sent on change. The last test may be one of an earlier start."""
        test, kept = self._axis.brake_test, self._retained
        return {
            "brake_test_available": not self._untestable,
            "brake_test_blocked": str(self._untestable or ""),
            "brake_test_blocked_messages": messages_to_wire(self._untestable) if self._untestable else [],
            "brake_test_level_nm": test.level_nm,
            "brake_test_limit_deg": rounded(deg(test.moved_max_rad)),
            "brake_test_result": kept.brake_test_outcome or BrakeTestOutcome.NONE.name.lower(),
            "brake_tests": self._tests,
            "brake_test_text": kept.brake_test_text,
            "brake_test_messages": last_test(kept),
            "brake_test_plus_nm": None if kept.brake_plus_nm is None else rounded(kept.brake_plus_nm),
            "brake_test_minus_nm": None if kept.brake_minus_nm is None else rounded(kept.brake_minus_nm),
            "brake_tested_at": kept.brake_tested_at,
            "brake_test_due_at": self.due.at,
            "brake_test_cycles_left": self.due.power_ups_left,
            "brake_test_overdue": self.due.overdue,
        }
