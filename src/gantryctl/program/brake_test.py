"""The brake test: torque against the closed brake, both ways, and whether anything moves."""

from __future__ import annotations

from enum import IntEnum


class BrakeTestPhase(IntEnum):
    """Where a brake test is."""

    IDLE = 0
    ENABLING = 1
    PLUS_RISING = 2
    PLUS_HELD = 3
    MINUS_RISING = 4
    MINUS_HELD = 5
    RELIEVING = 6
    DISABLING = 7


class BrakeTestOutcome(IntEnum):
    """How the last brake test ended."""

    NONE = 0
    """There was none."""
    PASSED = 1
    FAILED = 2
    ABORTED = 3
    """Ended before it could show anything: stopped, an alarm, control lost."""
